"""Stretches of a contracted muscle at constant velocity, on a dynamometer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.dynamometry import active_torque
from mjhill.lab.rig import Dynamometer, build_rig
from mjhill.lab.velocity_clamp import clamped_path, own_torque, ramp_time, travel_time

Values = NDArray[np.float64]

WAIT = 0.1  # isometric time before the stretch [s]
AFTER = 1.5  # and after it [s]
_SETTLING = 5e-3  # of a stiff machine after it has come up to speed [s]
_ISOMETRIC_TIME = 0.3  # of a muscle that is steady from the start [s]
_GRID = 25  # angles at which isometric torque is measured


@dataclass(frozen=True)
class Stretch:
    """One stretch of a muscle that is steadily contracted.

    Attributes:
        level: Neural input [-].
        velocity: Of the joint, positive [rad/s].
        time: From the start of the stretch [s], shape (T,).
        stretched: How far the machine has gone [rad], shape (T,).
        torque: Active torque [N·m], shape (T,).
        relative: That, in units of the isometric torque at the same angle and input, shape (T,).
        steady_from: When the machine is up to speed and has settled [s].
        stop: When it stops [s].
        own: What the contractile element carries at this velocity at the end, in units of its
            isometric torque [-].
    """

    level: float
    velocity: float
    time: Values
    stretched: Values
    torque: Values
    relative: Values
    steady_from: float
    stop: float
    own: float

    @property
    def during(self) -> Values:
        """Relative torque while the machine moves at constant velocity."""
        return self.relative[(self.time >= self.steady_from) & (self.time < self.stop)]

    @property
    def end(self) -> float:
        """Relative torque at the end of the stretch [-]."""
        return float(self.during[-1])

    @property
    def fall(self) -> float:
        """How far relative torque falls from a peak while the stretch goes on [-]."""
        return float((np.maximum.accumulate(self.during) - self.during).max())

    @property
    def residual(self) -> float:
        """Relative torque above the isometric one 1.5 s after the stretch [-]."""
        return float(self.relative[-1]) - 1.0

    def recovery(self, band: float) -> float | None:
        """Time after the stretch from which torque stays within ``band`` of isometric [s].

        None where it is not back by the end of the run.
        """
        after = self.time >= self.stop
        outside = np.flatnonzero(np.abs(self.relative[after] - 1.0) > band)
        if not len(outside):
            return 0.0
        back = self.time[after][outside[-1] + 1 :]
        return float(back[0] - self.stop) if len(back) else None


def stretch_path(
    start: float, end: float, velocity: float, timestep: float
) -> tuple[Values, Values]:
    """Time from the start of a stretch [s] and angle of the machine [rad], shape (T,) each."""
    duration = WAIT + travel_time(end - start, velocity) + AFTER
    time = np.asarray(timestep * np.arange(round(duration / timestep)) - WAIT, dtype=np.float64)
    return time, clamped_path(start, end, velocity, np.maximum(time, 0.0))


def stretch(
    joint: Joint,
    machine: Dynamometer,
    muscle: str,
    *,
    start: float,
    end: float,
    velocity: float,
    level: float,
) -> Stretch:
    """Stretch a muscle, steady at an input, once.

    Isometric torque is measured at 25 angles on the way.

    Args:
        joint: The joint.
        machine: The dynamometer.
        muscle: The muscle; the others stay relaxed.
        start: Angle at which the machine holds the joint first [rad].
        end: Angle to which it takes it [rad].
        velocity: At which it does, positive [rad/s].
        level: Neural input all the while [-].
    """
    timestep, way = build_rig(joint).timestep, end - start
    time, path = stretch_path(start, end, velocity, timestep)
    _, torque = active_torque(joint, machine, path, muscle, before=level, level=level)
    grid = np.linspace(start, end, _GRID)
    held = np.repeat(grid[:, np.newaxis], round(_ISOMETRIC_TIME / timestep), axis=1)
    _, isometric = active_torque(joint, machine, held, muscle, before=level, level=level)
    stretched = np.abs(path - start)
    reference = np.interp(stretched, np.abs(grid - start), isometric[:, -1])
    own = own_torque(joint, muscle, level, end, -velocity) / own_torque(
        joint, muscle, level, end, 0.0
    )
    return Stretch(
        level,
        velocity,
        time,
        stretched,
        torque[0],
        torque[0] / reference,
        ramp_time(way, velocity) + _SETTLING,
        travel_time(way, velocity),
        own,
    )
