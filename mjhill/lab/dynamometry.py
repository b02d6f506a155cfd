"""Runs on a dynamometer, many at once: paths of the machine and inputs in, torques out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, radians, sqrt

import mujoco
import mujoco.batch
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.engine.install import installed
from mjhill.engine.layout import addresses
from mjhill.joints.joint import Joint
from mjhill.lab.batch import check_batch
from mjhill.lab.rig import (
    Dynamometer,
    Rig,
    at_rest,
    build_rig,
    direction,
    dynamometer,
    net_torque,
    record_run,
)
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal, constant

STIFF = radians(0.2)  # a machine that gives way so little counts as isometric [rad]
STIFF_RINGING = 200.0  # ringing of the joint on it, at least [Hz]; its gauge lags by under 0.1 ms
_FASTEST = 0.4  # ringing of the joint on its coupling, in 1/timestep; steps follow no faster one

_RECORDED = ["qpos", "qvel", "act", "actuator_force"]

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Runs:
    """N runs of T steps, as they are at the start of each step.

    Attributes:
        time: [s], shape (T,).
        angle: Of the joint, which the coupling lets stray from the machine's [rad], shape (N, T).
        torque: With which the joint turns the machine, at its gauge [N·m], shape (N, T).
        activation: Of each muscle [-], shape (N, T).
    """

    time: Values
    angle: Values
    torque: Values
    activation: Mapping[str, Values]


def stiff_machine(joint: Joint) -> Dynamometer:
    """A dynamometer that gives way by 0.2° at most and that the limb's inertia delays little."""
    return machine_giving_way(joint, STIFF, STIFF_RINGING)


def machine_giving_way(joint: Joint, deflection: float, ringing: float = 0.0) -> Dynamometer:
    """A dynamometer that the joint's strongest muscle turns by ``deflection`` [rad] at most.

    Its coupling is critically damped with the joint's inertia. Where the joint would ring on it
    slower than ``ringing`` [Hz] it is stiffer; where faster than the steps of the bench can
    follow, softer.
    """
    stiffness = max(muscle.max_isometric_force for muscle in joint.muscles.values()) / deflection
    frequency = max(sqrt(stiffness / joint.inertia) / (2 * pi), ringing)
    return dynamometer(joint, min(frequency, _FASTEST / build_rig(joint).timestep))


def zeroed(
    joint: Joint, machine: Dynamometer, angle: float, levels: Mapping[str, float] | None = None
) -> float:
    """Input of a machine at rest [N·m] that holds the joint at an angle [rad] under some inputs.

    Its coupling is wound up by what muscles and passive elasticity pull there.
    """
    return machine.drive(angle) - net_torque(joint, levels or {}, angle)


def stimulated(joint: Joint) -> Joint:
    """The joint with its muscles stimulated electrically, which bypasses neural excitation."""
    muscles = {
        name: replace(muscle, electrical_stimulation=True) for name, muscle in joint.muscles.items()
    }
    return replace(joint, muscles=muscles)


def runs(
    joint: Joint,
    machine: Dynamometer,
    path: ArrayLike,
    *,
    before: Mapping[str, float] | None = None,
    excitation: Mapping[str, ArrayLike] | None = None,
) -> Runs:
    """Take a joint along N paths of a machine, its muscles driven.

    Each run starts still at the start of its path, the muscles steady and the machine so set
    that the joint is in balance there.

    Args:
        joint: The joint.
        machine: The dynamometer.
        path: Angle of the machine at every step of the bench [rad], shape (T,) or (N, T).
        before: Input of each muscle before the start; 0 where not named.
        excitation: Input of each muscle over each step, broadcast to (N, T); 0 where not named.

    Raises:
        UnmeasuredError: MuJoCo warned that a run went bad.
    """
    bench = build_rig(joint, machine=machine)
    model, paths = bench.model, np.atleast_2d(np.asarray(path, dtype=np.float64))
    count, steps = paths.shape
    batch = mujoco.batch.Batch(model, nsim=count)
    for i, angle in enumerate(paths[:, 0].tolist()):
        pose = at_rest(bench, angle, before)
        batch.qpos[i], batch.act[i] = pose.qpos, pose.act
    first = np.array(batch.act)
    control = np.zeros((count, steps, model.nu))  # one input and one output an actuator
    control[:, :, model.actuator("dynamometer").id] = driven(bench, machine, paths, before)
    for name, level in (excitation or {}).items():
        control[:, :, model.actuator(name).id] = level
    with installed():
        found = batch.rollout(steps, control, int(mujoco.mjtState.mjSTATE_CTRL), _RECORDED)
    check_batch(batch, joint)
    # what is recorded after a step: the states of its end, the forces of its start
    angle = np.concatenate([paths[:, :1], found["qpos"][:, :-1, 0]], axis=1)
    act = np.concatenate([first[:, np.newaxis], found["act"][:, :-1]], axis=1)
    # implicitfast damps with the velocity of a step's end, the recorded force with its start's
    rise = np.diff(found["qvel"][:, :, 0], axis=1, prepend=0.0)
    force = found["actuator_force"][:, :, model.actuator("dynamometer").id]
    return Runs(
        np.asarray(bench.timestep * np.arange(steps), dtype=np.float64),
        angle,
        machine.damping * rise - force,
        {name: act[:, :, address.act + 1] for name, address in addresses(model)},
    )


def recorded(
    joint: Joint, machine: Dynamometer, path: Values, muscle: str, *, before: float, level: float
) -> Recording:
    """One of the runs of ``active_torque`` as a recording, for the film; path of shape (T,)."""
    bench, steady = build_rig(joint, machine=machine), {muscle: before}
    drive = driven(bench, machine, path[np.newaxis], steady)[0]
    since = bench.timestep * np.arange(len(path))
    inputs = {
        muscle: constant(level),
        "dynamometer": Signal(lambda time: float(np.interp(time, since, drive))),
    }
    return record_run(
        bench, at_rest(bench, float(path[0]), steady), float(since[-1]), excitation=inputs
    )


def active_torque(
    joint: Joint,
    machine: Dynamometer,
    path: ArrayLike,
    muscle: str,
    *,
    before: float = 0.0,
    level: ArrayLike = 1.0,
) -> tuple[Runs, Values]:
    """Runs in which one muscle contracts, and its torque as a laboratory finds it.

    That is the gauge's reading less the reading of the same movement with all muscles relaxed,
    which has passive torque and the limb's inertia in it; positive towards the muscle's side.

    Args:
        joint: The joint.
        machine: The dynamometer.
        path: As in ``runs``.
        muscle: The muscle that contracts; the others stay relaxed.
        before: Its input before the start.
        level: Its input over each step, broadcast to (N, T).
    """
    active = runs(joint, machine, path, before={muscle: before}, excitation={muscle: level})
    relaxed = runs(joint, machine, path)
    return active, direction(joint, muscle) * (active.torque - relaxed.torque)


def driven(
    bench: Rig, machine: Dynamometer, paths: Values, before: Mapping[str, float] | None
) -> Values:
    """Input [N·m] that takes a machine along paths, shape (N, T); arguments as in ``runs``."""
    speed = np.gradient(paths, bench.timestep, axis=1)
    start = [zeroed(bench.joint, machine, angle, before) for angle in paths[:, 0].tolist()]
    wound = np.array(start) - machine.stiffness * paths[:, 0]
    return machine.stiffness * paths + machine.damping * speed + wound[:, np.newaxis]
