"""Fast movements: the fastest ballistic movement to a new angle, and largest velocities.

The excitation of a fast voluntary movement is near a pulse of maximal height, 30 to 200 ms long,
and bursts that clamp the joint at its new angle (Winters & Stark 1987, sect. 4.2.1); a saccade is
one. Here the agonist is fully excited for a pulse. In heavier joints the antagonist then brakes
fully for a second pulse. After that the excitation that holds the new angle follows at once. The
movement is symmetric about the angle of rest, from one held angle to the other, the antagonist of
each muscle off.
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
from mjhill.lab.postures import tonic_excitations
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

_FALL_BACK = 0.05  # of the amplitude: a braked movement comes back by no more after its peak
_FREE_TIME = 1.0  # [s]; the slowest joint has crossed its range by then
_RECOIL = 0.5  # of a free velocity, from which passive elasticity is too much of it
_PULSE_ERROR, _SEARCH_ERROR = 1e-6, 2e-4  # of a pulse's width [s]


@dataclass(frozen=True)
class BallisticMovement:
    """A movement that goes its amplitude and no farther.

    Attributes:
        pulse: How long the agonist is fully on [s].
        brake: How long the antagonist is fully on after that [s].
        velocity: Along the movement, at the times of ``run`` [rad/s], shape (T,).
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
    """A movement to be found: from a held start, by an amplitude [rad], within a duration [s]."""

    rig: Rig
    agonist: str
    antagonist: str
    start: mujoco.MjData
    amplitude: float
    duration: float
    hold: dict[str, float]
    height: float

    def excitations(self, pulse: float, brake: float) -> dict[str, Signal]:
        """Excitation of each muscle; within a step, the mean of a pulse that ends there."""
        step, hold = self.rig.timestep, self.hold

        def share(time: float, end: float) -> float:
            return min(max((end - time) / step + 0.5, 0.0), 1.0)

        def on(time: float) -> float:
            held = (1.0 - share(time, pulse + brake)) * hold[self.agonist]
            return self.height * share(time, pulse) + held

        def braking(time: float) -> float:
            ended = share(time, pulse + brake)
            return (
                self.height * (ended - share(time, pulse)) + (1.0 - ended) * hold[self.antagonist]
            )

        ends = (pulse, pulse + brake)
        return {self.agonist: Signal(on, ends), self.antagonist: Signal(braking, ends)}

    def progress(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle from the start in units of the amplitude [-]."""
        along = direction(self.rig.joint, self.agonist)
        return np.asarray(along * (angle - angle[0]) / self.amplitude)

    def trial(self, pulse: float, brake: float) -> NDArray[np.float64]:
        """Progress at every step."""
        excitations = self.excitations(pulse, brake)
        return self.progress(angle_series(self.rig, self.start, self.duration, excitations))

    def excess(self, pulse: float, brake: float) -> float:
        """How far the movement passes its amplitude, negative where it falls short [-]."""
        return float(self.trial(pulse, brake).max()) - 1.0

    def fall_back(self, pulse: float, brake: float) -> float:
        """How far the movement comes back after its peak [-]."""
        progress = self.trial(pulse, brake)
        return float(progress.max() - progress[progress.argmax() :].min())


def ballistic_movement(
    joint: Joint,
    muscle: str,
    *,
    amplitude: float,
    duration: float,
    braked: bool = False,
    height: float = 1.0,
    tonic: float = 0.0,
) -> BallisticMovement:
    """The fastest movement by ``amplitude`` [rad] that ``muscle`` makes with pulses of a height.

    Without a brake, the pulse is just wide enough to reach the new angle and not pass it. With a
    brake, the pulse is the widest for which the brake stops the joint at the new angle and the
    joint then comes back by no more than 5 % of the amplitude.

    Args:
        joint: The joint.
        muscle: The agonist.
        amplitude: How far the joint moves [rad].
        duration: Length of the run, within which it must arrive [s].
        braked: Whether the antagonist brakes.
        height: Excitation in pulse and brake [-].
        tonic: Least excitation of both muscles before and after the movement [-].

    Raises:
        UnmeasuredError: The joint cannot make such a movement.
    """
    rig = build_rig(joint)
    first, last = _ends(joint, muscle, amplitude)
    start = at_rest(rig, first, tonic_excitations(joint, muscle, first, tonic))
    hold = tonic_excitations(joint, muscle, last, tonic)
    other = antagonist(joint, muscle)
    task = _Task(rig, muscle, other, start, amplitude, duration, hold, height)
    if task.excess(duration, 0.0) < 0:
        raise UnmeasuredError(
            f"an excitation of {height:g} does not move it by {degrees(amplitude):g}° in "
            f"{duration:g} s"
        )
    pulse, brake = _braked(task) if braked else (_unbraked(task), 0.0)
    recording = record_run(rig, start, duration, excitation=task.excitations(pulse, brake))
    velocity = direction(joint, muscle) * recording[f"{joint.name}.velocity"]
    progress = task.progress(recording[f"{joint.name}.angle"])
    return BallisticMovement(pulse, brake, velocity, progress, recording)


def _ends(joint: Joint, muscle: str, amplitude: float) -> tuple[float, float]:
    """Start and end [rad] of a movement about the angle of rest, shifted into the range."""
    low, high = joint.range
    if amplitude > high - low:
        raise UnmeasuredError(
            f"a movement of {degrees(amplitude):g}° is wider than the range of {joint.name}, "
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
    """Widths of pulse and brake [s]; a wider pulse needs a longer brake and comes back further."""
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
    """Where a rising function passes 0; an end of the interval if it does not inside."""
    known = cache(function)  # brentq evaluates both ends again
    if known(low) >= 0:
        return low
    if known(high) <= 0:
        return high
    return float(brentq(known, low, high, xtol=error))


def free_velocity(joint: Joint, muscle: str, *, angle: float | None = None) -> float:
    """Peak velocity [rad/s] at full excitation of a joint that carries no load.

    The joint starts still, both muscles relaxed. Past the end of the range, where ligaments and
    bone would stop it, its velocity does not count.

    Args:
        joint: The joint.
        muscle: The muscle.
        angle: Where the joint starts [rad]; by default at its angle of rest.

    Raises:
        UnmeasuredError: The muscle does not move the joint, or the passive elasticity alone moves
            it from there at more than half of that velocity.
    """
    start = joint.rest_angle if angle is None else angle
    relaxed, full = (_peak_velocity(joint, muscle, start, u) for u in (0.0, 1.0))
    if full <= 0:
        raise UnmeasuredError(f"{muscle} does not move it from {degrees(start):.3g}°")
    if relaxed > _RECOIL * full:
        raise UnmeasuredError(
            f"from {degrees(start):.3g}° its elasticity alone moves it at {relaxed:.3g} rad/s, and "
            f"{muscle} at {full:.3g} rad/s"
        )
    return full


def _peak_velocity(joint: Joint, muscle: str, start: float, excitation: float) -> float:
    """Peak velocity [rad/s] in a muscle's direction inside the range of motion."""
    along, (low, high), rig = direction(joint, muscle), joint.range, build_rig(joint)
    run = record_run(rig, at_rest(rig, start), _FREE_TIME, excitation={muscle: excitation})
    angle, velocity = run[f"{joint.name}.angle"], along * run[f"{joint.name}.velocity"]
    return float(velocity[(angle >= low) & (angle <= high)].max(initial=0.0))


def velocity_intercept(joint: Joint, muscle: str) -> float:
    """Velocity [rad/s] at which Hill's relation of a muscle carries no load, fully active.

    What torque-velocity curves measured under loads are extrapolated to.
    """
    return joint.hill_muscles[muscle].max_velocity / abs(joint.gears[muscle])
