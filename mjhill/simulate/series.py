"""The series of a recording: names, units and values, from the samples of a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.engine.install import installed_backend
from mjhill.engine.layout import (
    Address,
    actuator_names,
    addresses,
    joint_id,
    joint_names,
    read_muscles,
    turns,
)
from mjhill.engine.python import excitations
from mjhill.muscles import Muscle
from mjhill.muscles.model import Track, units_of
from mjhill.simulate.mechanics import Path, joint_energies, model_mechanics
from mjhill.simulate.recording import Recording
from mjhill.simulate.samples import Samples

_Values = NDArray[np.float64]
_Series = Iterator[tuple[str, str, _Values]]
_HINGE, _SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
_COORDINATES = {  # joint type: position and velocity coordinates and their units
    _HINGE: (("angle", "rad"), ("velocity", "rad/s")),
    _SLIDE: (("position", "m"), ("velocity", "m/s")),
}
_EFFORT = {_HINGE: "N·m", _SLIDE: "N"}


def named(model: mujoco.MjModel, samples: Samples, loads: list[str], every: int) -> Recording:
    """The samples of a run as a recording.

    Args:
        model: The model.
        samples: Its samples.
        loads: Names of the joints with an external torque.
        every: Number of steps from one sample to the next.
    """
    series: dict[str, _Values] = {}
    units: dict[str, str] = {}
    for name, unit, values in _all_series(model, samples, loads, every):
        series[name], units[name] = values, unit
    return Recording(samples.time, series, units, _about(model), read_muscles(model))


def _all_series(model: mujoco.MjModel, samples: Samples, loads: list[str], every: int) -> _Series:
    path = Path.of(model, samples, every)
    energies = dict(joint_energies(model, samples))
    for joint, name in enumerate(joint_names(model)):
        yield from _joint_series(model, samples, joint, name)
        if name in energies:
            yield f"{name}.passive_energy", "J", energies[name]
    for name in loads:
        joint = joint_id(model, name)
        applied = samples.column("qfrc_applied", int(model.jnt_dofadr[joint]))
        yield f"{name}.applied", _EFFORT[int(model.jnt_type[joint])], applied
    muscles, places = read_muscles(model), dict(addresses(model))
    arms = _arms(model, samples)
    for actuator, name in enumerate(actuator_names(model)):
        if name in muscles:
            found = _muscle_series(model, samples, places[name], muscles[name], path)
        else:
            found = _other_series(model, samples, actuator)
        for quantity, unit, values in found:
            yield f"{name}.{quantity}", unit, values
        if name in muscles:
            yield from arms.get(actuator, [])
    for name, values in model_mechanics(model, samples, path, every):
        yield f"model.{name}", "J", values


def _joint_series(model: mujoco.MjModel, samples: Samples, joint: int, name: str) -> _Series:
    position, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    kind = int(model.jnt_type[joint])
    if kind in _COORDINATES:
        (coordinate, unit), (rate, rate_unit) = _COORDINATES[kind]
        yield f"{name}.{coordinate}", unit, samples.column("qpos", position)
        yield f"{name}.{rate}", rate_unit, samples.column("qvel", dof)
        return
    free = kind == mujoco.mjtJoint.mjJNT_FREE
    counts = (("qpos", position, 7 if free else 4), ("qvel", dof, 6 if free else 3))
    for array, first, count in counts:
        for k in range(count):
            yield f"{name}.{array}{k}", "MuJoCo", samples.column(array, first + k)


def _muscle_series(
    model: mujoco.MjModel, samples: Samples, at: Address, muscle: Muscle, path: Path
) -> _Series:
    """Quantity, unit and values of each series of a muscle but its moment arms."""
    units = units_of(turns(model, at.actuator))
    u = _excitation(model, samples, at)
    track = Track(
        muscle=muscle,
        time=samples.time,
        timestep=float(model.opt.timestep),
        staged=bool(model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4),
        u=u,
        states={name: samples.column("act", at.state(name)) for name in at.model.state_names},
        state_rates={
            name: samples.column("act_dot", at.state(name)) for name in at.model.state_names
        },
        length=samples.column("actuator_length", at.out) - model.actuator_length0[at.out],
        length_rate=samples.column("actuator_velocity", at.out),
        # MuJoCo's force is negative when it pulls; no negative zeros
        force=0.0 - samples.column("actuator_force", at.out),
        work=path.work,
        power=path.power,
    )
    yield "u", "-", u
    for quantity, kind, values in at.model.series(track):
        yield quantity, units[kind], values


def _excitation(model: mujoco.MjModel, samples: Samples, at: Address) -> _Values:
    """Excitation of a muscle as the callbacks use it; see ``python.excitation``."""
    if at.actuator in samples.delayed:
        return samples.delayed[at.actuator]
    return np.ascontiguousarray(excitations(model, samples.arrays["ctrl"], [at.actuator])[:, 0])


def _other_series(model: mujoco.MjModel, samples: Samples, actuator: int) -> _Series:
    """Control and force of another actuator, with one control and one output."""
    ctrl, out = int(model.actuator_ctrladr[actuator]), int(model.actuator_outadr[actuator])
    if model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_MUSCLE:
        yield "u", "-", samples.column("ctrl", ctrl)
        yield "a", "-", samples.column("act", int(model.actuator_actadr[actuator]))
        effort = "N·m" if turns(model, actuator) else "N"
        yield "force", effort, -samples.column("actuator_force", out)
    elif model.actuator_ctrlnum[actuator] == 1 and model.actuator_outnum[actuator] == 1:
        yield "u", "MuJoCo", samples.column("ctrl", ctrl)
        effort = "N·m" if turns(model, actuator) else "MuJoCo"
        yield "force", effort, samples.column("actuator_force", out)


def _arms(model: mujoco.MjModel, samples: Samples) -> dict[int, list[tuple[str, str, _Values]]]:
    """Name, unit and values of the moment arms of each actuator: force times arm is torque.

    Not those that are 0 throughout.
    """
    joints, actuators = joint_names(model), actuator_names(model)
    of_out = {int(out): actuator for actuator, out in enumerate(model.actuator_outadr)}
    arms: dict[int, list[tuple[str, str, _Values]]] = {}
    for (out, dof), slope in sorted(samples.arms.items()):
        if out not in of_out:
            continue
        actuator, joint = of_out[out], int(model.dof_jntid[dof])
        kind, place = int(model.jnt_type[joint]), dof - int(model.jnt_dofadr[joint])
        slides = kind == _SLIDE or (kind == mujoco.mjtJoint.mjJNT_FREE and place < 3)
        unit = "-" if slides or turns(model, actuator) else "m"
        number = "" if kind in _COORDINATES else str(place)
        name = f"{actuators[actuator]}.arm_{joints[joint]}{number}"
        # a muscle that gets longer where an angle grows pulls the angle back
        arms.setdefault(actuator, []).append((name, unit, 0.0 - slope))
    return arms


def _about(model: mujoco.MjModel) -> dict[str, Any]:
    return {
        "model": model.names.split(b"\0", 1)[0].decode(),
        "timestep": float(model.opt.timestep),
        "integrator": mujoco.mjtIntegrator(int(model.opt.integrator)).name,
        "backend": installed_backend() or "none",
        "mujoco": mujoco.__version__,
    }
