"""A dynamometer: a machine that moves a joint along a path and measures its torque.

Also the path of a machine that clamps velocity, and what the contractile element alone would give.
"""

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
from mjhill.muscles.readings import contractile_force
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal, constant

RAMP_SHARE = 0.1  # the machine reaches its velocity within this share of its travel [-]
_RAMP = 0.04  # and within this time [s]
_STIFF = radians(0.2)  # a machine that turns by so little counts as isometric [rad]
_STIFF_FREQUENCY = 200.0  # of the joint on it, at least [Hz]; its gauge lags by under 0.1 ms
_FASTEST = 0.4  # frequency of the joint on its coupling that the timesteps can follow [1/timestep]
_FEWEST_STEPS = 20  # of a movement that is to be measured

_RECORDED = ["qpos", "qvel", "act", "actuator_force"]

Values = NDArray[np.float64]


@dataclass(frozen=True)
class PathRuns:
    """N runs of T steps on a dynamometer; every value is that at the start of a step.

    Attributes:
        time: Time [s], shape (T,).
        angle: Joint angle [rad], shape (N, T). The coupling lets it differ from the machine's.
        torque: Torque of the joint on the machine, as its gauge reads it [N·m], shape (N, T).
        activation: Activation of each muscle [-], shape (N, T).
    """

    time: Values
    angle: Values
    torque: Values
    activation: Mapping[str, Values]


def stiff_machine(joint: Joint) -> Dynamometer:
    """A dynamometer that turns by 0.2° at most; the limb's inertia hardly delays its reading."""
    return compliant_machine(joint, _STIFF, _STIFF_FREQUENCY)


def compliant_machine(joint: Joint, deflection: float, frequency: float = 0.0) -> Dynamometer:
    """A dynamometer that the joint's strongest muscle turns by ``deflection`` [rad] at most.

    Its coupling is critically damped with the joint's inertia. It is stiffer where the natural
    frequency of the joint on it would be below ``frequency`` [Hz], and softer where that frequency
    would be too high for the timestep.
    """
    stiffness = max(muscle.max_isometric_force for muscle in joint.muscles.values()) / deflection
    natural = max(sqrt(stiffness / joint.inertia) / (2 * pi), frequency)
    return dynamometer(joint, min(natural, _FASTEST / build_rig(joint).timestep))


def balancing_control(
    joint: Joint,
    machine: Dynamometer,
    angle: float,
    excitations: Mapping[str, float] | None = None,
) -> float:
    """Control [N·m] of a machine at rest that holds the joint at an angle [rad].

    It balances the passive elasticity and the muscles, steady at their excitations (default 0).
    """
    return machine.drive(angle) - net_torque(joint, excitations or {}, angle)


def electrically_stimulated(joint: Joint) -> Joint:
    """The joint with electrical stimulation of its muscles, which bypasses neural excitation."""
    muscles = {
        name: replace(muscle, electrical_stimulation=True)
        for name, muscle in joint.hill_muscles.items()
    }
    return replace(joint, muscles=muscles)


def run_paths(
    joint: Joint,
    machine: Dynamometer,
    path: ArrayLike,
    *,
    before: Mapping[str, float] | None = None,
    excitation: Mapping[str, ArrayLike] | None = None,
) -> PathRuns:
    """Move a joint along N paths of a machine, with excited muscles.

    Each run starts at rest at the start of its path. The muscles are steady there, and the machine
    balances the joint.

    Args:
        joint: The joint.
        machine: The dynamometer.
        path: Angle of the machine at every step [rad], shape (T,) or (N, T).
        before: Excitation of each muscle before the start [-]; 0 for the others.
        excitation: Excitation of each muscle over each step [-], broadcast to (N, T); 0 for the
            others.

    Raises:
        UnmeasuredError: MuJoCo warned that a simulation went bad.
    """
    setup = build_rig(joint, machine=machine)
    model, paths = setup.model, np.atleast_2d(np.asarray(path, dtype=np.float64))
    count, steps = paths.shape
    batch = mujoco.batch.Batch(model, nsim=count)
    for i, angle in enumerate(paths[:, 0].tolist()):
        pose = at_rest(setup, angle, before)
        batch.qpos[i], batch.act[i] = pose.qpos, pose.act
    first = np.array(batch.act)
    control = np.zeros((count, steps, model.nu))  # one input and one output an actuator
    control[:, :, model.actuator("dynamometer").id] = _controls(setup, machine, paths, before)
    for name, values in (excitation or {}).items():
        control[:, :, model.actuator(name).id] = values
    with installed():
        found = batch.rollout(steps, control, int(mujoco.mjtState.mjSTATE_CTRL), _RECORDED)
    check_batch(batch, joint)
    # a rollout gives, for each step, the states of its end and the forces of its start
    angle = np.concatenate([paths[:, :1], found["qpos"][:, :-1, 0]], axis=1)
    act = np.concatenate([first[:, np.newaxis], found["act"][:, :-1]], axis=1)
    # implicitfast damps with the velocity at the end of a step, the recorded force with the start's
    rise = np.diff(found["qvel"][:, :, 0], axis=1, prepend=0.0)
    force = found["actuator_force"][:, :, model.actuator("dynamometer").id]
    return PathRuns(
        np.asarray(setup.timestep * np.arange(steps), dtype=np.float64),
        angle,
        machine.damping * rise - force,
        {name: act[:, :, at.state(at.model.activation)] for name, at in addresses(model)},
    )


def active_torque(
    joint: Joint,
    machine: Dynamometer,
    path: ArrayLike,
    muscle: str,
    *,
    before: float = 0.0,
    excitation: ArrayLike = 1.0,
) -> tuple[PathRuns, Values]:
    """Runs in which one muscle contracts, and its torque as a laboratory measures it.

    The torque is the gauge's reading minus its reading in the same movement with all muscles
    relaxed, which contains passive torque and the limb's inertia.

    Args:
        joint: The joint.
        machine: The dynamometer.
        path: As in ``run_paths``.
        muscle: The muscle that contracts; the others stay relaxed.
        before: Its excitation before the start [-].
        excitation: Its excitation over each step [-], broadcast to (N, T).

    Returns:
        The runs, and the torque in the muscle's direction [N·m], shape (N, T).
    """
    active = run_paths(
        joint, machine, path, before={muscle: before}, excitation={muscle: excitation}
    )
    relaxed = run_paths(joint, machine, path)
    return active, direction(joint, muscle) * (active.torque - relaxed.torque)


def record_path(
    joint: Joint,
    machine: Dynamometer,
    path: Values,
    muscle: str,
    *,
    before: float,
    excitation: float,
) -> Recording:
    """Recording of one of the runs of ``active_torque``, for a film; path of shape (T,)."""
    setup, steady = build_rig(joint, machine=machine), {muscle: before}
    control = _controls(setup, machine, path[np.newaxis], steady)[0]
    since = setup.timestep * np.arange(len(path))
    signals = {
        muscle: constant(excitation),
        "dynamometer": Signal(lambda time: float(np.interp(time, since, control))),
    }
    start = at_rest(setup, float(path[0]), steady)
    return record_run(setup, start, float(since[-1]), excitation=signals)


def _controls(
    setup: Rig, machine: Dynamometer, paths: Values, before: Mapping[str, float] | None
) -> Values:
    """Control [N·m] that moves a machine along paths, shape (N, T); see ``run_paths``."""
    velocity = np.gradient(paths, setup.timestep, axis=1)
    start = [balancing_control(setup.joint, machine, q, before) for q in paths[:, 0].tolist()]
    offset = np.array(start) - machine.stiffness * paths[:, 0]
    return machine.stiffness * paths + machine.damping * velocity + offset[:, np.newaxis]


def ramp_time(travel: float, velocity: float) -> float:
    """Time [s] in which the machine reaches a velocity [rad/s] on its travel [rad]."""
    return min(_RAMP, 2 * RAMP_SHARE * abs(travel / velocity))


def travel_time(travel: float, velocity: float) -> float:
    """Time [s] that the machine takes, from rest, for its travel [rad] at a velocity [rad/s]."""
    return abs(travel / velocity) + 0.5 * ramp_time(travel, velocity)


def clamped_path(start: float, end: float, velocity: float, time: Values) -> Values:
    """Angle [rad] of a machine that moves from start to end at constant velocity and stops there.

    Its velocity first rises linearly, and falls to 0 at once at the end.

    Args:
        start: Angle at time 0 [rad].
        end: Angle at which it stops [rad].
        velocity: Its speed, without sign [rad/s].
        time: Times from 0 [s], shape (T,).
    """
    travel = end - start
    ramp = ramp_time(travel, velocity)
    gone = np.where(time < ramp, 0.5 * velocity * time**2 / ramp, velocity * (time - 0.5 * ramp))
    return np.asarray(start + np.sign(travel) * np.minimum(gone, abs(travel)))


def check_velocity(velocity: float, travel: float, timestep: float) -> None:
    """Check that a machine can clamp a velocity [rad/s] over a travel [rad].

    Raises:
        ValueError: The velocity is 0 or not finite, or the travel takes fewer than 20 steps.
    """
    fastest = abs(travel) / (_FEWEST_STEPS * timestep)
    if not (np.isfinite(velocity) and 0 < abs(velocity) <= fastest):
        raise ValueError(
            f"a clamp velocity must not be 0 and at most {fastest:.4g} rad/s in either direction "
            f"(the {abs(travel):.3g} rad then take {_FEWEST_STEPS} steps), got {velocity}"
        )


def contractile_torque(
    joint: Joint, muscle: str, activation: float, angle: float, velocity: float
) -> float:
    """Torque [N·m] that the contractile element of a muscle would give alone, without sign.

    Args:
        joint: The joint.
        muscle: The muscle.
        activation: Its activation [-].
        angle: Joint angle [rad].
        velocity: Joint velocity, positive where the muscle shortens [rad/s].
    """
    gear = joint.gears[muscle]
    length, speed = gear * angle, abs(gear) * velocity
    return abs(gear) * contractile_force(joint.hill_muscles[muscle], activation, length, speed)
