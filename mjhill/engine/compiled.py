"""The callbacks as numba compiles them: the same equations, no interpreter, no lock.

Importing this module imports numba; ``machine_code`` does so when there is nothing in its cache.
Each call is a pure function of model and data, so they serve any number of threads.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from types import FunctionType
from typing import Any

import mujoco
import numba

from mjhill.elements import passive_torque
from mjhill.engine.equations import compiled_functions, globals_of, with_callees
from mjhill.engine.intrinsics import (
    argument_row,
    as_array,
    chained_act_bias,
    chained_act_dyn,
    chained_passive,
    load_byte,
    load_double,
    load_int,
    load_pointer,
    read_delayed_control,
    store_double,
    store_tuple,
)
from mjhill.engine.layout import NUSER_JNT, PASSIVE_TAG
from mjhill.engine.structs import offset
from mjhill.muscles import MODELS, MuscleModel
from mjhill.muscles.model import ARRAYS, Equation, arguments

_ROW = 8 * 10  # bytes of one actuator's dynprm, gainprm or biasprm
_JIT: dict[str, Any] = {"error_model": "numpy", "nogil": True, "forceinline": True}
_RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)
_USER = int(mujoco.mjtDyn.mjDYN_USER)
_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_CLAMP_DISABLED = int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
_MAXVAL = float(mujoco.mjMAXVAL)


Jitted = dict[Any, Any]  # by equation


def _jit_equations(models: Iterable[MuscleModel]) -> Jitted:
    """Every equation of the models and what it calls, jitted, each calling the jitted others."""
    jitted: Jitted = {}
    for function in with_callees(compiled_functions(models)):
        namespace = {name: jitted.get(value, value) for name, value in globals_of(function).items()}
        bound = FunctionType(function.__code__, namespace, function.__name__)
        jitted[function] = numba.njit(**_JIT)(bound)
    return jitted


_ACTUATOR = numba.float64(numba.int64, numba.int64, numba.int32)
_GENERIC = numba.void(numba.int64, numba.int64)


def _make_excitation() -> Any:
    """The control that the engine would use, see ``python.excitation``."""
    m_ctrladr = offset("mjModel.actuator_ctrladr")
    m_delay = offset("mjModel.actuator_delay")
    m_history = offset("mjModel.actuator_history")
    m_flags = offset("mjModel.opt.disableflags")
    m_limited = offset("mjModel.actuator_ctrllimited")
    m_range = offset("mjModel.actuator_ctrlrange")
    d_time = offset("mjData.time")
    d_ctrl = offset("mjData.ctrl")

    @numba.njit(**_JIT)
    def excitation(m: int, d: int, i: int) -> float:
        ctrl = numba.int64(load_int(load_pointer(m + m_ctrladr) + 4 * i))
        u = load_double(load_pointer(d + d_ctrl) + 8 * ctrl)
        if load_double(load_pointer(m + m_delay) + 8 * i) != 0.0:
            order = load_int(load_pointer(m + m_history) + 8 * i + 4)
            u = read_delayed_control(m, d, numba.int32(i), load_double(d + d_time), order)
        limited = load_byte(load_pointer(m + m_limited) + ctrl)
        if limited and not load_int(m + m_flags) & _CLAMP_DISABLED:
            bounds = load_pointer(m + m_range) + 16 * ctrl
            u = min(max(u, load_double(bounds)), load_double(bounds + 8))
        if not abs(u) <= _MAXVAL:
            return 0.0
        return min(max(u, 0.0), 1.0)

    return excitation


_excitation = _make_excitation()


def _called(model: MuscleModel, equation: Equation, jitted: Jitted) -> Any:
    """A jitted equation, called with what it asks for from where that is in memory."""
    function, names = jitted[equation], arguments(equation)
    row = argument_row(names, model)
    wants_states, wants_rates = (name in names for name in ARRAYS)

    if wants_states and wants_rates:

        @numba.njit(**_JIT)
        def call(act: int, act_dot: int, count: int, *given: Any) -> Any:
            states, rates = as_array(act, count), as_array(act_dot, count)
            return function(states, rates, *row(act, act_dot, *given))

    elif wants_states:

        @numba.njit(**_JIT)
        def call(act: int, act_dot: int, count: int, *given: Any) -> Any:
            return function(as_array(act, count), *row(act, act_dot, *given))

    else:

        @numba.njit(**_JIT)
        def call(act: int, act_dot: int, count: int, *given: Any) -> Any:
            return function(*row(act, act_dot, *given))

    return call


def _make_count(model: MuscleModel) -> Any:
    """The number of states that a muscle's parameters ask for."""
    named = len(model.states)
    if not model.bins:

        @numba.njit(**_JIT)
        def count(dyn: int, gain: int, bias: int) -> int:
            return named

        return count
    row = argument_row((model.bins,), model)

    @numba.njit(**_JIT)
    def count_bins(dyn: int, gain: int, bias: int) -> int:
        (bins,) = row(0, 0, False, 0.0, 0.0, 0.0, 0.0, dyn, gain, bias)
        return named + numba.int64(bins)

    return count_bins


def _make_actuator(
    models: Iterable[MuscleModel], jitted: Jitted, field: str, finish: Any, chained: Any
) -> Any:
    """A callback of actuators: an equation of the model whose muscle the actuator is.

    Args:
        models: The models to serve.
        jitted: Their equations.
        field: The field of ``MuscleModel`` that is the equation.
        finish: Makes, for a model, the function from the equation's result to the callback's.
        chained: What serves other actuators.
    """
    serves = chained
    for model in reversed(list(models)):
        equation = _called(model, getattr(model, field), jitted)
        serves = _make_link(model, equation, finish(model), serves)
    first = serves

    @numba.cfunc(_ACTUATOR, **_JIT)
    def callback(m: int, d: int, actuator: int) -> float:
        return first(m, d, actuator)

    return callback


def _make_link(model: MuscleModel, equation: Any, finish: Any, rest: Any) -> Any:
    """Serves the muscles of one model, and leaves other actuators to the rest."""
    m_dyntype, m_actnum = offset("mjModel.actuator_dyntype"), offset("mjModel.actuator_actnum")
    m_dynprm, m_gainprm = offset("mjModel.actuator_dynprm"), offset("mjModel.actuator_gainprm")
    m_biasprm, m_actadr = offset("mjModel.actuator_biasprm"), offset("mjModel.actuator_actadr")
    m_outadr, m_length0 = offset("mjModel.actuator_outadr"), offset("mjModel.actuator_length0")
    m_timestep, m_integrator = offset("mjModel.opt.timestep"), offset("mjModel.opt.integrator")
    d_act, d_act_dot = offset("mjData.act"), offset("mjData.act_dot")
    d_length, d_velocity = offset("mjData.actuator_length"), offset("mjData.actuator_velocity")
    tag, wanted = model.tag, _make_count(model)

    @numba.njit(**_JIT)
    def serve(m: int, d: int, actuator: int) -> float:
        i = numba.int64(actuator)
        dyn = load_pointer(m + m_dynprm) + _ROW * i
        gain = load_pointer(m + m_gainprm) + _ROW * i
        bias = load_pointer(m + m_biasprm) + _ROW * i
        count = numba.int64(load_int(load_pointer(m + m_actnum) + 4 * i))
        dyntype = load_int(load_pointer(m + m_dyntype) + 4 * i)
        if load_double(dyn) != tag or count != wanted(dyn, gain, bias) or dyntype != _USER:
            return rest(m, d, actuator)
        first = 8 * numba.int64(load_int(load_pointer(m + m_actadr) + 4 * i))
        out = 8 * numba.int64(load_int(load_pointer(m + m_outadr) + 4 * i))
        act, act_dot = load_pointer(d + d_act) + first, load_pointer(d + d_act_dot) + first
        result = equation(
            act,
            act_dot,
            count,
            load_int(m + m_integrator) == _RK4,
            _excitation(m, d, i),
            load_double(load_pointer(d + d_length) + out)
            - load_double(load_pointer(m + m_length0) + out),
            load_double(load_pointer(d + d_velocity) + out),
            load_double(m + m_timestep),
            dyn,
            gain,
            bias,
        )
        return finish(result, act_dot, count)

    return serve


def _write_rates(model: MuscleModel) -> Any:
    """Writes the rates of a model's states, if its equation has not, and returns the last."""
    if "state_rates" in arguments(model.rates):

        @numba.njit(**_JIT)
        def last(result: Any, act_dot: int, count: int) -> float:
            return load_double(act_dot + 8 * (count - 1))

        return last

    @numba.njit(**_JIT)
    def write(result: Any, act_dot: int, count: int) -> float:
        store_tuple(act_dot, result)
        return result[-1]

    return write


def _pull(_model: MuscleModel) -> Any:
    @numba.njit(**_JIT)
    def pull(tension: float, act_dot: int, count: int) -> float:
        # tension is positive in equations; MuJoCo's force is positive when it lengthens
        return -tension

    return pull


def _make_passive(passive_torque: Any) -> Any:
    m_njnt, m_nuser, m_user = map(offset, ("mjModel.njnt", "mjModel.nuser_jnt", "mjModel.jnt_user"))
    m_type, m_qposadr = offset("mjModel.jnt_type"), offset("mjModel.jnt_qposadr")
    m_dofadr, m_treeid = offset("mjModel.jnt_dofadr"), offset("mjModel.dof_treeid")
    m_spring, d_awake = offset("mjModel.qpos_spring"), offset("mjData.tree_awake")
    d_qpos, d_passive = offset("mjData.qpos"), offset("mjData.qfrc_passive")

    @numba.cfunc(_GENERIC, **_JIT)
    def passive(m: int, d: int) -> None:
        chained_passive(m, d)
        nuser = load_pointer(m + m_nuser)
        if nuser < NUSER_JNT:
            return
        for joint in range(load_pointer(m + m_njnt)):
            user = load_pointer(m + m_user) + 8 * nuser * joint
            kind = load_int(load_pointer(m + m_type) + 4 * joint)
            scalar = kind == _SLIDE or kind == _HINGE  # noqa: PLR1714 (numba's `in` can raise)
            if load_double(user) != PASSIVE_TAG or not scalar:
                continue
            dof = numba.int64(load_int(load_pointer(m + m_dofadr) + 4 * joint))
            tree = numba.int64(load_int(load_pointer(m + m_treeid) + 4 * dof))
            if not load_int(load_pointer(d + d_awake) + 4 * tree):
                continue  # MuJoCo does not clear qfrc_passive of a sleeping tree
            position = 8 * numba.int64(load_int(load_pointer(m + m_qposadr) + 4 * joint))
            rest = load_double(load_pointer(m + m_spring) + position)
            total = load_pointer(d + d_passive) + 8 * dof
            torque = passive_torque(
                load_double(load_pointer(d + d_qpos) + position) - rest,
                0.0,
                load_double(user + 8),
                load_double(user + 16),
                load_double(user + 24),
                load_double(user + 32),
                load_double(user + 40),
            )
            store_double(total, load_double(total) + torque)

    return passive


def compile_callbacks() -> dict[str, tuple[str, bytes]]:
    """Symbol and object code of each callback, by its name in MuJoCo less ``mjcb_``."""
    jitted = _jit_equations(MODELS)
    make = partial(_make_actuator, MODELS, jitted)
    functions = {
        "act_dyn": make("rates", _write_rates, chained_act_dyn),
        "act_bias": make("force", _pull, chained_act_bias),
        "passive": _make_passive(jitted[passive_torque]),
    }
    code = {}
    for name, function in functions.items():
        _, _, (object_code, _) = function._library.serialize_using_object_code()
        code[name] = (function.native_name, object_code)
    return code
