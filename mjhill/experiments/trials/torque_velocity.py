"""A torque-velocity curve: a joint taken through the same angles at one velocity after another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.dynamometry import active_torque
from mjhill.lab.rig import Dynamometer, build_rig, direction
from mjhill.lab.velocity_clamp import (
    RAMP_SHARE,
    check_velocity,
    clamped_path,
    own_torque,
    ramp_time,
    travel_time,
)

_MARGIN = 0.1  # of the range of motion, at either end, where no machine takes a joint
_ISOMETRIC_TIME = 2.0  # [s]
_GRID = 17  # angles at which the largest isometric torque is sought

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Sweep:
    """What is done: velocities through a range of angles, and where torque is read.

    Attributes:
        muscle: The muscle that contracts.
        long: Angle at which shortening starts, the muscle long [rad].
        short: Angle at which it ends [rad].
        velocities: Positive where the muscle shortens, ascending [rad/s], shape (V,).
        angles: At which torque is read [rad], shape (A,).
    """

    muscle: str
    long: float
    short: float
    velocities: Values
    angles: Values

    @property
    def shortening(self) -> NDArray[np.bool_]:
        """At which velocities the muscle shortens, shape (V,)."""
        return np.asarray(self.velocities > 0)

    @property
    def way(self) -> float:
        """From where the muscle is long to where it is short [rad]."""
        return self.short - self.long


@dataclass(frozen=True)
class Curve:
    """Active torque at every velocity, as measured.

    Attributes:
        peak: Largest after the machine is up to speed [N·m], shape (V,).
        at: At the angles of the sweep [N·m], shape (A, V).
        own: What the contractile element alone would give there, at the angle and activation of
            that moment [N·m], shape (A, V).
    """

    peak: Values
    at: Values
    own: Values


def make_sweep(joint: Joint, muscle: str, velocities: Values, angles: Values | None) -> Sweep:
    """A sweep through the middle four fifths of the range of motion.

    Args:
        joint: The joint.
        muscle: The muscle that contracts.
        velocities: As in ``Sweep``, in any order.
        angles: At which torque is read [rad]; without it at the quarters of the way.

    Raises:
        ValueError: A velocity cannot be clamped, or an angle lies outside where the machine is
            up to speed.
    """
    low, high = joint.range
    margin = _MARGIN * (high - low)
    ends = (low + margin, high - margin)
    long, short = ends if direction(joint, muscle) > 0 else ends[::-1]
    way, timestep = short - long, build_rig(joint).timestep
    for velocity in velocities.tolist():
        check_velocity(velocity, way, timestep)
    read = np.asarray(long + way * np.array([0.25, 0.5, 0.75])) if angles is None else angles
    for angle in read.tolist():
        if not RAMP_SHARE <= (angle - long) / way <= 1 - RAMP_SHARE:
            first, last = sorted((long + RAMP_SHARE * way, short - RAMP_SHARE * way))
            raise ValueError(
                f"torque can be read between {first:.3g} and {last:.3g} rad, where the machine "
                f"is up to speed, got {angle:.3g}"
            )
    return Sweep(muscle, long, short, np.sort(velocities), read)


def measure(joint: Joint, machine: Dynamometer, sweep: Sweep, *, before: float) -> Curve:
    """The curve of a muscle under full input from the moment the machine starts.

    Args:
        joint: The joint.
        machine: The dynamometer that moves it.
        sweep: What is done.
        before: Input at which the muscle is steady before, 0 for a relaxed start.
    """
    path, time = paths(sweep, build_rig(joint).timestep)
    runs, torque = active_torque(joint, machine, path, sweep.muscle, before=before)
    activation = runs.activation[sweep.muscle]
    peak, shape = np.empty(len(path)), (len(sweep.angles), len(path))
    at, own = np.empty(shape), np.empty(shape)
    for k, velocity in enumerate(sweep.velocities.tolist()):
        first, last = ramp_time(sweep.way, velocity), travel_time(sweep.way, velocity)
        seen = (time >= first) & (time < last)
        peak[k] = torque[k, seen].max()
        gone = np.abs(path[k, seen] - path[k, 0])
        for j, angle in enumerate(sweep.angles.tolist()):
            here = abs(angle - path[k, 0])
            at[j, k] = np.interp(here, gone, torque[k, seen])
            active = float(np.interp(here, gone, activation[k, seen]))
            own[j, k] = own_torque(joint, sweep.muscle, active, angle, velocity)
    return Curve(peak, at, own)


def isometric(joint: Joint, machine: Dynamometer, sweep: Sweep) -> tuple[float, Values]:
    """Largest isometric torque on the way, and that at the angles of the sweep, shape (A,)."""
    grid = np.concatenate([sweep.angles, np.linspace(sweep.long, sweep.short, _GRID)])
    steps = round(_ISOMETRIC_TIME / build_rig(joint).timestep)
    path = np.repeat(grid[:, np.newaxis], steps, axis=1)
    _, torque = active_torque(joint, machine, path, sweep.muscle)
    return float(torque[:, -1].max()), torque[: len(sweep.angles), -1]


def own_curve(joint: Joint, sweep: Sweep) -> tuple[Values, Values]:
    """What the fully active contractile element gives: at best on the way, and at each angle.

    Returns:
        Largest over the way, shape (V,), and at the angles of the sweep, shape (A, V) [N·m].
    """
    grid = np.concatenate([sweep.angles, np.linspace(sweep.long, sweep.short, _GRID)])
    table = np.array(
        [
            [own_torque(joint, sweep.muscle, 1.0, angle, v) for v in sweep.velocities.tolist()]
            for angle in grid.tolist()
        ]
    )
    return table.max(axis=0), table[: len(sweep.angles)]


def paths(sweep: Sweep, timestep: float) -> tuple[Values, Values]:
    """Paths of the machine, shape (V, T), and their time [s], shape (T,)."""
    slowest = float(np.abs(sweep.velocities).min())
    steps = round(travel_time(sweep.way, slowest) / timestep) + 2
    time = np.asarray(timestep * np.arange(steps), dtype=np.float64)
    rows = []
    for velocity in sweep.velocities.tolist():
        ends = (sweep.long, sweep.short) if velocity > 0 else (sweep.short, sweep.long)
        rows.append(clamped_path(*ends, abs(velocity), time))
    return np.array(rows), time
