"""A model driven by inputs over time, recorded."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Mapping

import mujoco
import numpy as np

from mjhill.engine.checks import check_model
from mjhill.engine.equilibrium import check_finite, check_states
from mjhill.engine.install import installed_backend
from mjhill.engine.layout import (
    SCALAR_JOINTS,
    actuator_names,
    joint_id,
    joint_names,
    muscle_ids,
    muscle_names,
)
from mjhill.simulate.recording import Recording
from mjhill.simulate.samples import Sampler
from mjhill.simulate.series import named
from mjhill.simulate.signals import Signal, as_signals
from mjhill.simulate.transients import transients


def record(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    *,
    duration: float,
    excitation: Mapping[str, Signal | float] | None = None,
    torque: Mapping[str, Signal | float] | None = None,
    every: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Step a model from its present state and record it.

    Over each step, an input is held at its value of mid-step. ``docs/energy.md`` has a table of
    all series with units and equations. Series of joints are ``<joint>.angle``,
    ``<joint>.velocity`` (``position`` for a slide, ``qpos0``... for others), ``<joint>.applied``
    where a torque is given, and ``<joint>.passive_energy`` where the joint is elastic. Each muscle
    has ``u`` (excitation), what its muscle model shows, and a moment arm ``arm_<joint>`` for each
    joint that it moves. ``mjhill.Hill`` shows ``n``, ``a``, ``velocity`` (of the contractile
    element, shortening positive), ``stretch`` (of the series element), ``force`` (tension
    positive, as MuJoCo applies it), ``length``, ``length_rate``, ``contractile_length``,
    ``series_stiffness``, ``series_energy``, ``contractile_power``, ``series_power``, ``power``,
    ``contractile_work`` and ``work``. Where MuJoCo applies another force than the series element
    carries, as with a ``forcerange`` or a disabled group, ``tension`` is that of the element. A
    native MuJoCo muscle has ``u``, ``a``, ``force``, any other actuator ``u`` and ``force`` as
    MuJoCo has them. Energies and works of the whole model are ``model.kinetic_energy`` and so on;
    ``mjhill.energy`` puts them together.

    A muscle's ``velocity`` is the mean over the interval since the sample before: the shortening
    of the contractile element, divided by the time. So its integral is the true shortening. At the
    first sample it is the mean over the step before, or under RK4 the present rate. Powers are
    means in the same way.

    Args:
        model: The model.
        data: Its state, advanced in place by ``duration``.
        duration: Length of the run [s].
        excitation: Excitation by muscle name, or control by actuator name; others stay as they are.
        torque: External torque [N·m] or force [N] by joint name.
        every: Record every that many steps.
        progress: Called from time to time with the share done, 0 to 1.

    Raises:
        ValueError: A name is unknown or would be that of two series, an input is not finite, a
            number is out of range, or the model is not in order; see ``check_model``.
        RuntimeError: Callbacks are not installed though the model has muscles, or MuJoCo
            warned: it resets a bad state and continues, so the rest would be meaningless.

    Warns:
        RuntimeWarning: A muscle did something impossible; see ``transients``.
    """
    check_model(model)
    steps = _number_of_steps(duration, float(model.opt.timestep))
    if every < 1:
        raise ValueError(f"every must be at least 1 step, got {every}")
    _require_callbacks(model)
    _require_own_names(model)
    check_finite(data)
    check_states(model, data)
    inputs = as_signals(excitation or {}, actuator_names(model), "actuator")
    loads = as_signals(torque or {}, _scalar_joints(model), "hinge or slide joint")
    apply = _inputs(model, inputs, loads)
    sampler = Sampler(model, data, steps // every + 1)
    for step in range(steps + 1):
        apply(data, data.time + 0.5 * model.opt.timestep)
        row, skipped = divmod(step, every)
        if not skipped:
            mujoco.mj_forward(model, data)  # lengths and rates of this very state
            sampler.take(row)
        if step < steps:
            mujoco.mj_step(model, data)
            check_warnings(data)
            if not skipped:
                sampler.went_on(row)
        elif not skipped:
            sampler.ended(row)
        if progress is not None and step % 256 == 0:
            progress(step / steps)
    recording = named(model, sampler.samples(), list(loads), every)
    for finding in transients(recording):
        warnings.warn(str(finding), RuntimeWarning, stacklevel=2)
    return recording


def _require_own_names(model: mujoco.MjModel) -> None:
    """Refuse names that would give two series the same name."""
    for kind, names in (("joint", joint_names(model)), ("actuator", actuator_names(model))):
        for name, count in Counter(names).items():
            if count > 1:
                raise ValueError(
                    f"{kind} {name!r}: another one, which has no name, is called so; "
                    "give each a name"
                )
    for name in sorted({*joint_names(model)} & {*muscle_names(model)}):
        raise ValueError(
            f"muscle {name!r} has the name of a joint, so both would have the series "
            f"{name + '.velocity'!r}; rename one of the two"
        )


def _number_of_steps(duration: float, timestep: float) -> int:
    if not (np.isfinite(duration) and duration > 0):
        raise ValueError(f"duration must be positive, got {duration} s")
    steps = round(duration / timestep)
    if steps < 1:
        raise ValueError(f"duration must be at least a timestep, {timestep:g} s, got {duration} s")
    return steps


def _require_callbacks(model: mujoco.MjModel) -> None:
    if muscle_ids(model) and installed_backend() is None:
        raise RuntimeError(
            "the model has mjhill muscles but no callbacks are installed, so they would have "
            "no force; run inside `with mjhill.installed():`"
        )


def _inputs(
    model: mujoco.MjModel, inputs: Mapping[str, Signal], loads: Mapping[str, Signal]
) -> Callable[[mujoco.MjData, float], None]:
    """A function that writes the inputs of a time into data."""
    actuators = actuator_names(model)
    controls = [
        (int(model.actuator_ctrladr[actuators.index(name)]), name, s) for name, s in inputs.items()
    ]
    dofs = [(int(model.jnt_dofadr[joint_id(model, name)]), name, s) for name, s in loads.items()]

    def apply(data: mujoco.MjData, time: float) -> None:
        for what, array, targets in (
            ("excitation", data.ctrl, controls),
            ("torque", data.qfrc_applied, dofs),
        ):
            for index, name, signal in targets:
                value = signal(time)
                if not np.isfinite(value):
                    raise ValueError(
                        f"{what} of {name!r} at {time:g} s must be finite, got {value}"
                    )
                array[index] = value

    return apply


def _scalar_joints(model: mujoco.MjModel) -> list[str]:
    return [name for i, name in enumerate(joint_names(model)) if model.jnt_type[i] in SCALAR_JOINTS]


def check_warnings(data: mujoco.MjData) -> None:
    """Refuse data in which MuJoCo warned: it resets a bad state and continues.

    Raises:
        RuntimeError: A warning was counted; the message has its name and the time.
    """
    if not data.warning.number.any():
        return
    for index, warning in enumerate(data.warning):
        if warning.number:
            name = mujoco.mjtWarning(index).name.removeprefix("mjWARN_").lower()
            raise RuntimeError(
                f"MuJoCo warned '{name}' {warning.number} times by {data.time:g} s (last at index "
                f"{warning.lastinfo}); lower the timestep or look for a bad input"
            )
