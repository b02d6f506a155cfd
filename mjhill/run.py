"""A model driven by inputs over time, recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.callbacks.python import control, muscle_length, series_stretch
from mjhill.checks import check_model
from mjhill.equilibrium import check_finite
from mjhill.install import installed_backend
from mjhill.layout import (
    SCALAR_JOINTS,
    actuator_names,
    address,
    addresses,
    is_muscle,
    joint_id,
    joint_names,
    read_muscle,
    turns,
)
from mjhill.readings import tension
from mjhill.recording import Recording
from mjhill.signals import Signal, as_signals

_Reader = Callable[[mujoco.MjData], float]
_Values = NDArray[np.float64]
_COORDINATES = {  # joint type: position and velocity coordinates and their units
    int(mujoco.mjtJoint.mjJNT_HINGE): (("angle", "rad"), ("velocity", "rad/s")),
    int(mujoco.mjtJoint.mjJNT_SLIDE): (("position", "m"), ("velocity", "m/s")),
}
_EFFORT = {int(mujoco.mjtJoint.mjJNT_HINGE): "N·m", int(mujoco.mjtJoint.mjJNT_SLIDE): "N"}


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

    Over each step, an input is held at its value of mid-step. Series are named
    ``<joint>.angle``, ``<joint>.velocity`` (``position`` for a slide, ``qpos0``... for others),
    ``<joint>.applied`` where a torque is given, and for each muscle ``u``, ``n``, ``a``,
    ``velocity`` (of the contractile element, shortening positive), ``stretch`` (of the series
    element) and ``force`` (tension positive). A native MuJoCo muscle has ``u``, ``a``, ``force``,
    any other actuator ``u`` and ``force`` as MuJoCo has them.

    A muscle's ``velocity`` is the mean over the interval from the sample before: how much the
    contractile element has shortened since, by the time between. So it adds up to the way the
    element has really come. That of the first sample is the scheme's: the mean over the step
    before it, or under RK4 the rate at that moment.

    Args:
        model: The model.
        data: Its state, advanced in place by ``duration``.
        duration: Length of the run [s].
        excitation: Neural input by actuator name; controls not named stay as they are.
        torque: External torque [N·m] or force [N] by joint name.
        every: Record every that many steps.
        progress: Called now and then with the share done, 0 to 1.

    Raises:
        ValueError: A name is unknown, an input is not finite, a number is out of range, or the
            model is not in order; see ``check_model``.
        RuntimeError: Callbacks are not installed though the model has muscles, or MuJoCo
            warned: it resets a state that went bad and goes on, so what follows is no run.
    """
    check_model(model)
    steps = _number_of_steps(duration, float(model.opt.timestep))
    if every < 1:
        raise ValueError(f"every must be at least 1 step, got {every}")
    _require_callbacks(model)
    check_finite(data)
    inputs = as_signals(excitation or {}, actuator_names(model), "actuator")
    loads = as_signals(torque or {}, _scalar_joints(model), "hinge or slide joint")
    apply = _inputs(model, inputs, loads)
    readers = _readers(model, list(loads))
    table = np.empty((steps // every + 1, len(readers) + 1))
    for step in _stepped(model, data, steps, apply, progress):
        if step % every == 0:
            mujoco.mj_forward(model, data)  # lengths and rates of this very state
            table[step // every] = [data.time, *(read(data) for _, _, read in readers)]
        if step == 0:
            first = _first_velocities(model, data)
    time, *columns = np.ascontiguousarray(table.T)
    series = dict(zip([name for name, _, _ in readers], columns, strict=True))
    for name, velocity in first.items():
        series[name] = _mean_rate(time, series[name], velocity)
    return Recording(time, series, {name: unit for name, unit, _ in readers}, _about(model))


def _stepped(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    steps: int,
    apply: Callable[[mujoco.MjData, float], None],
    progress: Callable[[float], None] | None,
) -> Iterator[int]:
    """The number of steps done, from 0 on, with the inputs of the next step in place."""
    for step in range(steps + 1):
        apply(data, data.time + 0.5 * model.opt.timestep)
        yield step
        if step < steps:
            mujoco.mj_step(model, data)
            check_warnings(data)
        if progress is not None and step % 256 == 0:
            progress(step / steps)


def _first_velocities(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, float]:
    """Velocity of each muscle's contractile element as the scheme has it now, by series."""
    return {f"{name}.velocity": -float(data.act_dot[at.act + 2]) for name, at in addresses(model)}


def _mean_rate(time: _Values, values: _Values, first: float) -> _Values:
    """Mean rate of values since the sample before; ``first`` for the first sample."""
    return np.concatenate(([first], np.diff(values) / np.diff(time)))


def _number_of_steps(duration: float, timestep: float) -> int:
    if not (np.isfinite(duration) and duration > 0):
        raise ValueError(f"duration must be positive, got {duration} s")
    steps = round(duration / timestep)
    if steps < 1:
        raise ValueError(f"duration must be at least a timestep, {timestep:g} s, got {duration} s")
    return steps


def _require_callbacks(model: mujoco.MjModel) -> None:
    has_muscles = any(is_muscle(model, i) for i in range(model.nactuator))
    if has_muscles and installed_backend() is None:
        raise RuntimeError(
            "the model has mjhill muscles but no callbacks are installed, so they would stay "
            "limp; run inside `with mjhill.installed():`"
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
        for array, targets in ((data.ctrl, controls), (data.qfrc_applied, dofs)):
            for index, name, signal in targets:
                value = signal(time)
                if not np.isfinite(value):
                    raise ValueError(f"input of {name!r} at {time:g} s must be finite, got {value}")
                array[index] = value

    return apply


def _scalar_joints(model: mujoco.MjModel) -> list[str]:
    return [name for i, name in enumerate(joint_names(model)) if model.jnt_type[i] in SCALAR_JOINTS]


def _readers(model: mujoco.MjModel, loads: list[str]) -> list[tuple[str, str, _Reader]]:
    """Name, unit and reader of each series.

    What is read for the velocity of a muscle is the way its contractile element has shortened.
    """
    readers: list[tuple[str, str, _Reader]] = []
    for joint in range(model.njnt):
        readers += _joint_readers(model, joint)
    for name in loads:
        joint = joint_id(model, name)
        dof = int(model.jnt_dofadr[joint])
        unit = _EFFORT[int(model.jnt_type[joint])]
        readers.append((f"{name}.applied", unit, _item("qfrc_applied", dof)))
    for actuator in range(model.nactuator):
        if is_muscle(model, actuator):
            readers += _muscle_readers(model, actuator)
        elif model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_MUSCLE:
            readers += _native_readers(model, actuator)
        else:
            readers += _other_readers(model, actuator)
    return readers


def _item(array: str, index: int, sign: float = 1.0) -> _Reader:
    return lambda data: sign * float(getattr(data, array)[index])


def _joint_readers(model: mujoco.MjModel, joint: int) -> list[tuple[str, str, _Reader]]:
    name = joint_names(model)[joint]
    position, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    kind = int(model.jnt_type[joint])
    if kind in _COORDINATES:
        (coordinate, unit), (rate, rate_unit) = _COORDINATES[kind]
        return [
            (f"{name}.{coordinate}", unit, _item("qpos", position)),
            (f"{name}.{rate}", rate_unit, _item("qvel", dof)),
        ]
    free = kind == mujoco.mjtJoint.mjJNT_FREE
    counts = (("qpos", position, 7 if free else 4), ("qvel", dof, 6 if free else 3))
    return [
        (f"{name}.{array}{k}", "MuJoCo", _item(array, first + k))
        for array, first, count in counts
        for k in range(count)
    ]


def _muscle_readers(model: mujoco.MjModel, actuator: int) -> list[tuple[str, str, _Reader]]:
    name = actuator_names(model)[actuator]
    muscle, at = read_muscle(model, name), address(model, name)
    effort, length_unit = _muscle_units(model, actuator)

    def stretch(data: mujoco.MjData) -> float:
        return series_stretch(model, data, actuator)

    def shortened(data: mujoco.MjData) -> float:
        return stretch(data) - muscle_length(model, data, actuator)

    return [
        (f"{name}.u", "-", lambda data: control(model, data, actuator)),
        (f"{name}.n", "-", _item("act", at.act)),
        (f"{name}.a", "-", _item("act", at.act + 1)),
        (f"{name}.velocity", f"{length_unit}/s", shortened),
        (f"{name}.stretch", length_unit, stretch),
        (f"{name}.force", effort, lambda data: tension(muscle, stretch(data))),
    ]


def _native_readers(model: mujoco.MjModel, actuator: int) -> list[tuple[str, str, _Reader]]:
    name = actuator_names(model)[actuator]
    effort, _ = _muscle_units(model, actuator)
    return [
        (f"{name}.u", "-", _item("ctrl", int(model.actuator_ctrladr[actuator]))),
        (f"{name}.a", "-", _item("act", int(model.actuator_actadr[actuator]))),
        (
            f"{name}.force",
            effort,
            _item("actuator_force", int(model.actuator_outadr[actuator]), -1),
        ),
    ]


def _other_readers(model: mujoco.MjModel, actuator: int) -> list[tuple[str, str, _Reader]]:
    """The input and force of an actuator of one control and one output that is no muscle."""
    if model.actuator_ctrlnum[actuator] != 1 or model.actuator_outnum[actuator] != 1:
        return []
    name, effort = actuator_names(model)[actuator], "N·m" if turns(model, actuator) else "MuJoCo"
    return [
        (f"{name}.u", "MuJoCo", _item("ctrl", int(model.actuator_ctrladr[actuator]))),
        (f"{name}.force", effort, _item("actuator_force", int(model.actuator_outadr[actuator]))),
    ]


def _muscle_units(model: mujoco.MjModel, actuator: int) -> tuple[str, str]:
    return ("N·m", "rad") if turns(model, actuator) else ("N", "m")


def check_warnings(data: mujoco.MjData) -> None:
    """Refuse data in which MuJoCo warned: it resets a state that went bad and goes on.

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


def _about(model: mujoco.MjModel) -> dict[str, Any]:
    return {
        "model": model.names.split(b"\0", 1)[0].decode(),
        "timestep": float(model.opt.timestep),
        "integrator": mujoco.mjtIntegrator(int(model.opt.integrator)).name,
        "backend": installed_backend() or "none",
        "mujoco": mujoco.__version__,
    }
