"""Free movements by pulses of input, and how far each is from twice another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np
from numpy.typing import NDArray

from mjhill.experiments.result import Measure
from mjhill.joints.joint import Joint
from mjhill.lab.ensemble import angles
from mjhill.lab.rest import resting_angle
from mjhill.lab.rig import UnmeasuredError, direction
from mjhill.lab.variants import (
    AS_IT_IS,
    FAST,
    FLAT,
    LINEAR,
    SERIES,
    with_fast_muscles,
    with_flat_torque,
    with_linear_elasticity,
    with_linear_series,
)

_VISIBLE = 1e-3  # least travel that a ratio is taken of, as a share of the largest

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Pulse:
    """One pulse and the movement it makes.

    Attributes:
        level: Input during the pulse [-].
        width: [s].
        time: [s], shape (T,).
        travel: How far the joint has gone the muscle's way [rad], shape (T,).
    """

    level: float
    width: float
    time: _Values
    travel: _Values

    @property
    def name(self) -> str:
        """Level and width."""
        return f"{self.level:.0%} for {1e3 * self.width:g} ms"

    @property
    def velocity(self) -> _Values:
        """Along the muscle's way [rad/s], shape (T,)."""
        return np.asarray(np.gradient(self.travel, self.time))

    @property
    def peak_velocity(self) -> float:
        """Largest velocity [rad/s]."""
        return float(self.velocity.max())

    @property
    def amplitude(self) -> float:
        """Largest travel [rad]."""
        return float(self.travel.max())

    @property
    def time_to_peak_velocity(self) -> float:
        """[s]."""
        return float(self.time[self.velocity.argmax()])

    @property
    def time_to_amplitude(self) -> float:
        """[s]."""
        return float(self.time[self.travel.argmax()])

    def measures(self) -> Iterator[Measure]:
        """Peaks and when they are."""
        yield Measure(f"{self.name}: peak velocity", degrees(self.peak_velocity), "°/s")
        yield Measure(f"{self.name}: amplitude", degrees(self.amplitude), "°")
        yield Measure(f"{self.name}: time to peak velocity", 1e3 * self.time_to_peak_velocity, "ms")
        yield Measure(f"{self.name}: time to amplitude", 1e3 * self.time_to_amplitude, "ms")


def pulses(
    joints: Sequence[Joint],
    muscle: str,
    tasks: Sequence[tuple[float, float]],
    duration: float,
    timestep: float,
) -> list[Pulse]:
    """Movements of joints from where they stay relaxed by pulses of level and width [s].

    Raises:
        UnmeasuredError: A joint is still on its way at the end.
    """
    steps = round(duration / timestep)
    middle = (np.arange(steps) + 0.5) * timestep
    inputs = np.zeros((len(joints), steps, len(joints[0].muscles)))
    for i, (level, width) in enumerate(tasks):
        # a pulse that ends inside a step ends in a level in between
        share = np.clip((width - middle) / timestep + 0.5, 0.0, 1.0)
        inputs[i, :, list(joints[0].muscles).index(muscle)] = level * share
    rest = [resting_angle(joint) for joint in joints]
    runs = angles(joints, start=rest, excitation=inputs, steps=steps, timestep=timestep)
    travels = direction(joints[0], muscle) * (runs - runs[:, :1])
    if (travels.argmax(axis=1) == steps).any():
        raise UnmeasuredError(
            f"{joints[0].name} still moves away {duration:g} s after the start of a pulse of "
            f"{muscle}; give a longer duration"
        )
    time = np.asarray(np.arange(steps + 1) * timestep)
    return [Pulse(*task, time, travel) for task, travel in zip(tasks, travels, strict=True)]


def doublings(
    joint: Joint, muscle: str, low: Pulse, timestep: float
) -> Mapping[str, tuple[Pulse, Pulse]]:
    """A pulse and one twice as strong, in the joint and in joints that lack a nonlinearity.

    Linear elasticity and flat torque are those with which the weaker pulse would hold the joint at
    its amplitude.
    """
    joints = {
        AS_IT_IS: joint,
        FAST: with_fast_muscles(joint),
        SERIES: with_linear_series(joint),
        LINEAR: with_linear_elasticity(joint, muscle, low.amplitude),
        FLAT: with_flat_torque(joint, muscle, low.amplitude),
    }
    tasks = [(level, low.width) for _ in joints for level in (low.level, 2 * low.level)]
    pairs = [one for one in joints.values() for _ in range(2)]
    made = pulses(pairs, muscle, tasks, float(low.time[-1]), timestep)
    return dict(zip(joints, zip(made[::2], made[1::2], strict=True), strict=True))


def ratio_over_time(low: Pulse, high: Pulse) -> tuple[_Values, _Values]:
    """Travel of ``high`` over that of ``low`` from when both are seen to the first amplitude."""
    end = int(min(high.travel.argmax(), low.travel.argmax()))
    start = int(np.argmax(low.travel > _VISIBLE * low.amplitude))
    part = slice(start, end + 1)
    return low.time[part], np.asarray(high.travel[part] / low.travel[part])


def ratio_at(low: Pulse, high: Pulse, time: float) -> float:
    """Travel of ``high`` over that of ``low`` at a time [s]."""
    first, second = (float(np.interp(time, one.time, one.travel)) for one in (low, high))
    return second / first
