"""Torque-velocity curves of a muscle on a dynamometer that clamps the joint's velocity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.dynamometer import (
    RAMP_SHARE,
    active_torque,
    check_velocity,
    clamped_path,
    contractile_torque,
    ramp_time,
    travel_time,
)
from mjhill.lab.rig import Dynamometer, build_rig, direction

_END_MARGIN = 0.1  # of the range of motion, at either end, that the machine leaves out
_ISOMETRIC_TIME = 2.0  # [s]
_GRID = 17  # angles at which the largest isometric torque is sought

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Sweep:
    """The movements: velocities through a range of angles, and where torque is read.

    Attributes:
        muscle: The muscle that contracts.
        long: Joint angle at which shortening starts, where the muscle is long [rad].
        short: Joint angle at which it ends [rad].
        velocities: Joint velocities, positive where the muscle shortens, ascending [rad/s],
            shape (V,).
        angles: Joint angles at which torque is read [rad], shape (A,).
    """

    muscle: str
    long: float
    short: float
    velocities: _Values
    angles: _Values

    @property
    def shortening(self) -> NDArray[np.bool_]:
        """Whether the muscle shortens, by velocity, shape (V,)."""
        return np.asarray(self.velocities > 0)

    @property
    def travel(self) -> float:
        """Movement from where the muscle is long to where it is short [rad]."""
        return self.short - self.long


@dataclass(frozen=True)
class Curve:
    """Measured active torque at every velocity.

    Attributes:
        peak: Largest torque once the machine has reached its velocity [N·m], shape (V,).
        at: Torque at the angles of the sweep [N·m], shape (A, V).
        contractile: Torque that the contractile element would give alone, at the same angle and
            at the activation of that moment [N·m], shape (A, V).
    """

    peak: _Values
    at: _Values
    contractile: _Values


def make_sweep(joint: Joint, muscle: str, velocities: _Values, angles: _Values | None) -> Sweep:
    """A sweep through the middle four fifths of the range of motion.

    Args:
        joint: The joint.
        muscle: The muscle that contracts.
        velocities: As in ``Sweep``, in any order.
        angles: As in ``Sweep``; None gives the quarters of the travel.

    Raises:
        ValueError: A velocity cannot be clamped, or the machine has not reached its velocity at
            an angle.
    """
    low, high = joint.range
    margin = _END_MARGIN * (high - low)
    ends = (low + margin, high - margin)
    long, short = ends if direction(joint, muscle) > 0 else ends[::-1]
    travel, timestep = short - long, build_rig(joint).timestep
    for velocity in velocities.tolist():
        check_velocity(velocity, travel, timestep)
    read = np.asarray(long + travel * np.array([0.25, 0.5, 0.75])) if angles is None else angles
    for angle in read.tolist():
        if not RAMP_SHARE <= (angle - long) / travel <= 1 - RAMP_SHARE:
            first, last = sorted((long + RAMP_SHARE * travel, short - RAMP_SHARE * travel))
            raise ValueError(
                f"torque can be read between {first:.3g} and {last:.3g} rad, where the machine "
                f"has reached its velocity, got {angle:.3g}"
            )
    return Sweep(muscle, long, short, np.sort(velocities), read)


def measure_curve(joint: Joint, machine: Dynamometer, sweep: Sweep, *, before: float) -> Curve:
    """The curve of a muscle that is fully excited from the moment the machine starts.

    ``before`` is the excitation at which the muscle is steady before [-], 0 for a relaxed start.
    """
    path, time = machine_paths(sweep, build_rig(joint).timestep)
    runs, torque = active_torque(joint, machine, path, sweep.muscle, before=before)
    activation = runs.activation[sweep.muscle]
    peak, shape = np.empty(len(path)), (len(sweep.angles), len(path))
    at, own = np.empty(shape), np.empty(shape)
    for k, velocity in enumerate(sweep.velocities.tolist()):
        first, last = ramp_time(sweep.travel, velocity), travel_time(sweep.travel, velocity)
        seen = (time >= first) & (time < last)
        peak[k] = torque[k, seen].max()
        gone = np.abs(path[k, seen] - path[k, 0])
        for j, angle in enumerate(sweep.angles.tolist()):
            here = abs(angle - path[k, 0])
            at[j, k] = np.interp(here, gone, torque[k, seen])
            active = float(np.interp(here, gone, activation[k, seen]))
            own[j, k] = contractile_torque(joint, sweep.muscle, active, angle, velocity)
    return Curve(peak, at, own)


def measure_isometric(joint: Joint, machine: Dynamometer, sweep: Sweep) -> tuple[float, _Values]:
    """Largest isometric torque on the travel, and that at the angles of the sweep, shape (A,)."""
    grid = _angles_and_grid(sweep)
    steps = round(_ISOMETRIC_TIME / build_rig(joint).timestep)
    path = np.repeat(grid[:, np.newaxis], steps, axis=1)
    _, torque = active_torque(joint, machine, path, sweep.muscle)
    return float(torque[:, -1].max()), torque[: len(sweep.angles), -1]


def own_curve(joint: Joint, sweep: Sweep) -> tuple[_Values, _Values]:
    """Torque of the fully active contractile element alone [N·m].

    Returns:
        The largest on the travel, shape (V,); at the angles of the sweep, shape (A, V).
    """
    table = np.array(
        [
            [contractile_torque(joint, sweep.muscle, 1.0, q, v) for v in sweep.velocities.tolist()]
            for q in _angles_and_grid(sweep).tolist()
        ]
    )
    return table.max(axis=0), table[: len(sweep.angles)]


def _angles_and_grid(sweep: Sweep) -> _Values:
    """The angles of the sweep, then 17 over the travel, shape (A + 17,)."""
    return np.concatenate([sweep.angles, np.linspace(sweep.long, sweep.short, _GRID)])


def machine_paths(sweep: Sweep, timestep: float) -> tuple[_Values, _Values]:
    """Paths of the machine, shape (V, T), and their time [s], shape (T,)."""
    slowest = float(np.abs(sweep.velocities).min())
    steps = round(travel_time(sweep.travel, slowest) / timestep) + 2
    time = np.asarray(timestep * np.arange(steps), dtype=np.float64)
    rows = []
    for velocity in sweep.velocities.tolist():
        ends = (sweep.long, sweep.short) if velocity > 0 else (sweep.short, sweep.long)
        rows.append(clamped_path(*ends, abs(velocity), time))
    return np.array(rows), time
