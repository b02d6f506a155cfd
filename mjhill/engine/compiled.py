"""The callbacks as numba compiles them: the same equations, no interpreter, no lock.

Importing this module imports numba; ``machine_code`` does so when there is nothing in its cache.
Each call is a pure function of model and data, so they serve any number of threads.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any

import mujoco
import numba

from mjhill import elements
from mjhill.engine.intrinsics import (
    chained_act_bias,
    chained_act_dyn,
    chained_passive,
    load_byte,
    load_double,
    load_int,
    load_pointer,
    read_delayed_control,
    store_double,
)
from mjhill.engine.layout import MUSCLE_TAG, NUSER_JNT, PASSIVE_TAG, SLOTS, STATES
from mjhill.engine.structs import offset
from mjhill.muscles import scheme

_ROW = 8 * 10  # bytes of one actuator's dynprm, gainprm or biasprm
_JIT: dict[str, Any] = {"error_model": "numpy", "nogil": True, "forceinline": True}
_RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)
_USER = int(mujoco.mjtDyn.mjDYN_USER)
_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_CLAMP_DISABLED = int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
_MAXVAL = float(mujoco.mjMAXVAL)


def _compile_equations(*modules: ModuleType) -> dict[str, Callable[..., Any]]:
    """Every function of ``modules``, jitted, each calling the jitted others."""
    namespace: dict[str, Any] = {"exp": math.exp, "log": math.log, "sqrt": math.sqrt}
    for module in modules:
        namespace.update((k, v) for k, v in vars(module).items() if isinstance(v, (int, float)))
        for name, function in inspect.getmembers(module, inspect.isfunction):
            if function.__module__ == module.__name__:
                bound = FunctionType(function.__code__, namespace, name)
                namespace[name] = numba.njit(**_JIT)(bound)
    return namespace


_equations = _compile_equations(elements, scheme)
muscle_rates = _equations["muscle_rates"]
series_force = _equations["series_force"]
present_stretch = _equations["present_stretch"]
passive_torque = _equations["passive_torque"]


def _slot(name: str) -> int:
    return 8 * SLOTS[name][1]


_ACTUATOR = numba.float64(numba.int64, numba.int64, numba.int32)
_GENERIC = numba.void(numba.int64, numba.int64)


def _make_control() -> Any:
    """The input the engine would use, see ``python.control``."""
    m_ctrladr = offset("mjModel.actuator_ctrladr")
    m_delay = offset("mjModel.actuator_delay")
    m_history = offset("mjModel.actuator_history")
    m_flags = offset("mjModel.opt.disableflags")
    m_limited = offset("mjModel.actuator_ctrllimited")
    m_range = offset("mjModel.actuator_ctrlrange")
    d_time = offset("mjData.time")
    d_ctrl = offset("mjData.ctrl")

    @numba.njit(**_JIT)
    def control(m: int, d: int, i: int) -> float:
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

    return control


_control = _make_control()


def _make_act_dyn() -> Any:
    m_dynprm, m_gainprm = offset("mjModel.actuator_dynprm"), offset("mjModel.actuator_gainprm")
    m_biasprm, m_actnum = offset("mjModel.actuator_biasprm"), offset("mjModel.actuator_actnum")
    m_actadr, m_outadr = offset("mjModel.actuator_actadr"), offset("mjModel.actuator_outadr")
    m_length0 = offset("mjModel.actuator_length0")
    m_timestep, m_integrator = offset("mjModel.opt.timestep"), offset("mjModel.opt.integrator")
    d_act, d_act_dot = offset("mjData.act"), offset("mjData.act_dot")
    d_length, d_velocity = offset("mjData.actuator_length"), offset("mjData.actuator_velocity")
    tau_nex, tau_act = _slot("excitation_tau"), _slot("activation_tau")
    tau_deact, floor = _slot("deactivation_tau"), _slot("activation_floor")
    stimulated = _slot("electrical_stimulation")
    optimal, width_short, width_long = map(_slot, ("optimal_length", "width_short", "width_long"))
    stretch_max, shape, limit = map(_slot, ("series_stretch", "series_shape", "series_limit"))
    max_velocity, hill = _slot("max_velocity"), _slot("hill_shape")
    plateau, slope_ratio = _slot("eccentric_plateau"), _slot("eccentric_slope_ratio")
    viscosity, share = _slot("viscosity"), _slot("velocity_activation")

    @numba.cfunc(_ACTUATOR, **_JIT)
    def act_dyn(m: int, d: int, actuator: int) -> float:
        i = numba.int64(actuator)
        dyn = load_pointer(m + m_dynprm) + _ROW * i
        actnum = load_int(load_pointer(m + m_actnum) + 4 * i)
        if load_double(dyn) != MUSCLE_TAG or actnum != STATES:
            return chained_act_dyn(m, d, actuator)
        gain = load_pointer(m + m_gainprm) + _ROW * i
        bias = load_pointer(m + m_biasprm) + _ROW * i
        out = 8 * numba.int64(load_int(load_pointer(m + m_outadr) + 4 * i))
        first = 8 * numba.int64(load_int(load_pointer(m + m_actadr) + 4 * i))
        act = load_pointer(d + d_act) + first
        n_rate, a_rate, s_rate = muscle_rates(
            load_int(m + m_integrator) == _RK4,
            _control(m, d, i),
            load_double(act),
            load_double(act + 8),
            load_double(act + 16),
            load_double(load_pointer(d + d_length) + out)
            - load_double(load_pointer(m + m_length0) + out),
            load_double(load_pointer(d + d_velocity) + out),
            load_double(m + m_timestep),
            load_double(dyn + tau_nex),
            load_double(dyn + tau_act),
            load_double(dyn + tau_deact),
            load_double(dyn + stimulated),
            load_double(dyn + floor),
            load_double(gain + optimal),
            load_double(gain + width_short),
            load_double(gain + width_long),
            load_double(gain + stretch_max),
            load_double(gain + shape),
            load_double(gain + limit),
            load_double(bias + max_velocity),
            load_double(bias + hill),
            load_double(bias + plateau),
            load_double(bias + slope_ratio),
            load_double(bias + viscosity),
            load_double(bias + share),
        )
        act_dot = load_pointer(d + d_act_dot) + first
        store_double(act_dot, n_rate)
        store_double(act_dot + 8, a_rate)
        store_double(act_dot + 16, s_rate)
        return s_rate

    return act_dyn


def _make_act_bias() -> Any:
    m_dyntype, m_dynprm = offset("mjModel.actuator_dyntype"), offset("mjModel.actuator_dynprm")
    m_gainprm, m_actnum = offset("mjModel.actuator_gainprm"), offset("mjModel.actuator_actnum")
    m_actadr, m_outadr = offset("mjModel.actuator_actadr"), offset("mjModel.actuator_outadr")
    m_length0 = offset("mjModel.actuator_length0")
    m_timestep, m_integrator = offset("mjModel.opt.timestep"), offset("mjModel.opt.integrator")
    d_act, d_act_dot = offset("mjData.act"), offset("mjData.act_dot")
    d_length = offset("mjData.actuator_length")
    d_velocity, m_biasprm = offset("mjData.actuator_velocity"), offset("mjModel.actuator_biasprm")
    floor = _slot("activation_floor")
    optimal, width_short, width_long = map(_slot, ("optimal_length", "width_short", "width_long"))
    stretch_max, shape, limit = map(_slot, ("series_stretch", "series_shape", "series_limit"))
    max_velocity, hill = _slot("max_velocity"), _slot("hill_shape")
    plateau, slope_ratio = _slot("eccentric_plateau"), _slot("eccentric_slope_ratio")
    viscosity, share = _slot("viscosity"), _slot("velocity_activation")
    max_force = _slot("max_isometric_force")

    @numba.cfunc(_ACTUATOR, **_JIT)
    def act_bias(m: int, d: int, actuator: int) -> float:
        i = numba.int64(actuator)
        dyn = load_pointer(m + m_dynprm) + _ROW * i
        actnum = load_int(load_pointer(m + m_actnum) + 4 * i)
        dyntype = load_int(load_pointer(m + m_dyntype) + 4 * i)
        if load_double(dyn) != MUSCLE_TAG or actnum != STATES or dyntype != _USER:
            return chained_act_bias(m, d, actuator)
        gain = load_pointer(m + m_gainprm) + _ROW * i
        bias = load_pointer(m + m_biasprm) + _ROW * i
        out = 8 * numba.int64(load_int(load_pointer(m + m_outadr) + 4 * i))
        first = 8 * numba.int64(load_int(load_pointer(m + m_actadr) + 4 * i))
        act = load_pointer(d + d_act) + first
        stretch = present_stretch(
            load_int(m + m_integrator) == _RK4,
            load_double(act + 8),
            load_double(act + 16),
            load_double(load_pointer(d + d_act_dot) + first + 16),
            load_double(load_pointer(d + d_length) + out)
            - load_double(load_pointer(m + m_length0) + out),
            load_double(load_pointer(d + d_velocity) + out),
            load_double(m + m_timestep),
            load_double(dyn + floor),
            load_double(gain + optimal),
            load_double(gain + width_short),
            load_double(gain + width_long),
            load_double(gain + stretch_max),
            load_double(gain + shape),
            load_double(gain + limit),
            load_double(bias + max_velocity),
            load_double(bias + hill),
            load_double(bias + plateau),
            load_double(bias + slope_ratio),
            load_double(bias + viscosity),
            load_double(bias + share),
        )
        force, _ = series_force(
            stretch,
            load_double(gain + stretch_max),
            load_double(gain + shape),
            load_double(gain + limit),
        )
        # tension is positive in elements; MuJoCo's force is positive when it lengthens
        return -force * load_double(gain + max_force)

    return act_bias


def _make_passive() -> Any:
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
    functions = {
        "act_dyn": _make_act_dyn(),
        "act_bias": _make_act_bias(),
        "passive": _make_passive(),
    }
    code = {}
    for name, function in functions.items():
        _, _, (object_code, _) = function._library.serialize_using_object_code()
        code[name] = (function.native_name, object_code)
    return code
