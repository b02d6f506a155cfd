"""The fastest turn to a new angle: a saccade of the eye, its like of the head.

The neural input of a fast voluntary movement is near a pulse of maximal height, 30 to 200 ms long,
and bursts that clamp the joint where it is to stay (Winters & Stark 1987, sect. 4.2.1). Here the
agonist is fully on for a pulse, in heavier joints the antagonist then brakes fully for a second
one, and after that the level that holds the new angle follows at once. The movement is symmetric
about the angle of rest, from one held angle to the other, the antagonist of each muscle off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import degrees

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mjhill.analysis.responses import time_to
from mjhill.joints.joint import Joint
from mjhill.lab.postures import holding_excitations
from mjhill.lab.rig import (
    Rig,
    UnmeasuredError,
    angle_series,
    antagonist,
    at_rest,
    build_rig,
    direction,
    record_run,
)
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal

_FALL_BACK = 0.05  # most that a braked turn may come back after its peak, of the amplitude
_PULSE_ERROR, _SEARCH_ERROR = 1e-6, 2e-4  # of a pulse's width [s]


@dataclass(frozen=True)
class Turn:
    """A turn that goes its amplitude and no farther.

    Attributes:
        pulse: How long the agonist is fully on [s].
        brake: How long the antagonist is fully on after that [s].
        velocity: Along the turn, at ``time`` [rad/s], shape (T,).
        progress: Angle from the start, in units of the amplitude [-], shape (T,).
        run: The recording.
    """

    pulse: float
    brake: float
    velocity: NDArray[np.float64]
    progress: NDArray[np.float64]
    run: Recording

    @property
    def peak_velocity(self) -> float:
        """Largest velocity [rad/s]."""
        return float(self.velocity.max())

    def duration(self, threshold: float) -> float:
        """Time [s] from where the velocity rises past ``threshold`` [rad/s] to its fall below.

        Raises:
            UnmeasuredError: It does not pass it, or has not fallen below it by the end.
        """
        time, peak = self.run.time, int(self.velocity.argmax())
        rise = time_to(time, self.velocity, threshold)
        fall = time_to(time[peak:], -self.velocity[peak:], -threshold)
        if rise is None or fall is None:
            raise UnmeasuredError(
                f"its velocity does not pass {threshold:.3g} rad/s and fall again"
            )
        return float(time[peak] + fall - rise)


@dataclass(frozen=True)
class _Task:
    """From a held start, along a direction, by an amplitude [rad] in a duration [s]."""

    bench: Rig
    agonist: str
    antagonist: str
    start: mujoco.MjData
    amplitude: float
    duration: float
    hold: dict[str, float]

    def inputs(self, pulse: float, brake: float) -> dict[str, Signal]:
        """Input of each muscle; a pulse that ends inside a step ends in a level in between."""
        step, hold = self.bench.timestep, self.hold

        def share(time: float, end: float) -> float:
            return min(max((end - time) / step + 0.5, 0.0), 1.0)

        def on(time: float) -> float:
            return share(time, pulse) + (1.0 - share(time, pulse + brake)) * hold[self.agonist]

        def braking(time: float) -> float:
            ended = share(time, pulse + brake)
            return ended - share(time, pulse) + (1.0 - ended) * hold[self.antagonist]

        ends = (pulse, pulse + brake)
        return {self.agonist: Signal(on, ends), self.antagonist: Signal(braking, ends)}

    def progress(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle from the start in units of the amplitude [-]."""
        along = direction(self.bench.joint, self.agonist)
        return np.asarray(along * (angle - angle[0]) / self.amplitude)

    def trial(self, pulse: float, brake: float) -> NDArray[np.float64]:
        """Progress at every step."""
        inputs = self.inputs(pulse, brake)
        return self.progress(angle_series(self.bench, self.start, self.duration, inputs))

    def excess(self, pulse: float, brake: float) -> float:
        """How far the turn goes past its amplitude, negative where it falls short [-]."""
        return float(self.trial(pulse, brake).max()) - 1.0

    def fall_back(self, pulse: float, brake: float) -> float:
        """How far the turn comes back after its peak [-]."""
        progress = self.trial(pulse, brake)
        return float(progress.max() - progress[progress.argmax() :].min())


def turn(
    joint: Joint, muscle: str, *, amplitude: float, duration: float, braked: bool = False
) -> Turn:
    """The fastest turn by ``amplitude`` [rad] that ``muscle`` makes.

    Without a brake, the pulse is as wide as takes the joint to the new angle and not past it:
    pulse and hold match. With one, the pulse is the widest whose brake stops the joint at the
    new angle from where it comes back by no more than 5 % of the amplitude.

    Args:
        joint: The joint.
        muscle: The agonist.
        amplitude: How far it turns [rad].
        duration: By when it is to be there, and the length of the run [s].
        braked: Whether the antagonist brakes.

    Raises:
        UnmeasuredError: The joint cannot make such a turn.
    """
    bench = build_rig(joint)
    first, last = _ends(joint, muscle, amplitude)
    start = at_rest(bench, first, holding_excitations(joint, muscle, first))
    hold = holding_excitations(joint, muscle, last)
    other = antagonist(joint, muscle)
    task = _Task(bench, muscle, other, start, amplitude, duration, hold)
    if task.excess(duration, 0.0) < 0:
        raise UnmeasuredError(
            f"full input does not turn it by {degrees(amplitude):g}° in {duration:g} s"
        )
    pulse, brake = _braked(task) if braked else (_unbraked(task), 0.0)
    recording = record_run(bench, start, duration, excitation=task.inputs(pulse, brake))
    velocity = direction(joint, muscle) * recording[f"{joint.name}.velocity"]
    return Turn(pulse, brake, velocity, task.progress(recording[f"{joint.name}.angle"]), recording)


def _ends(joint: Joint, muscle: str, amplitude: float) -> tuple[float, float]:
    """Start and end [rad] of a turn about the angle of rest, moved into the range of motion."""
    low, high = joint.range
    if amplitude > high - low:
        raise UnmeasuredError(
            f"a turn of {degrees(amplitude):g}° is wider than the range of {joint.name}, "
            f"{degrees(high - low):g}°"
        )
    half = 0.5 * amplitude
    middle = min(max(joint.rest_angle, low + half), high - half)
    along = direction(joint, muscle)
    return middle - along * half, middle + along * half


def _unbraked(task: _Task) -> float:
    if task.excess(0.0, 0.0) > 0:
        raise UnmeasuredError("it swings past the new angle even without a pulse")
    return _root(lambda pulse: task.excess(pulse, 0.0), 0.0, task.duration, _PULSE_ERROR)


def _braked(task: _Task) -> tuple[float, float]:
    """Widths of pulse and brake [s]: the wider the pulse, the harder the brake, the more falls."""
    long = task.duration
    narrow = 0.0 if task.excess(0.0, 0.0) > 0 else _unbraked(task)
    wide = _root(lambda pulse: task.excess(pulse, long), narrow, long, _PULSE_ERROR)

    def brake(pulse: float) -> float:
        return _root(lambda width: -task.excess(pulse, width), 0.0, long, _PULSE_ERROR)

    def fall(pulse: float) -> float:
        return task.fall_back(pulse, brake(pulse)) - _FALL_BACK

    pulse = _root(fall, narrow, wide, _SEARCH_ERROR)
    return pulse, brake(pulse)


def _root(function: Callable[[float], float], low: float, high: float, error: float) -> float:
    """Where a function that rises from below 0 to above passes 0, or the end that it is past."""
    known = cache(function)  # brentq asks again for both ends
    if known(low) >= 0:
        return low
    if known(high) <= 0:
        return high
    return float(brentq(known, low, high, xtol=error))
