"""Fast movements: the fastest ballistic movement to a new angle, and largest velocities.

The excitation of a fast voluntary movement is near a pulse of maximal height, 30 to 200 ms long,
and bursts that clamp the joint at its new angle (Winters & Stark 1987, sect. 4.2.1); a saccade is
a pulse and then a step that holds the eye there. So here the agonist is on, then perhaps the
antagonist, each for as long as the movement needs; then the smallest excitations that hold the new
angle.

Many joints that differ in their parameters are measured together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.responses import time_to
from mjhill.joints.joint import Joint
from mjhill.lab.batch import Rigs
from mjhill.lab.postures import tonic_excitations
from mjhill.lab.rig import UnmeasuredError, antagonist, direction, timestep_of
from mjhill.muscles import contractile_of
from mjhill.muscles.readings import velocity_at_share

FALL_BACK = 0.05  # of the amplitude: a braked movement comes back by no more after its peak
_FREE_TIME = 1.0  # [s]; the slowest joint has crossed its range by then
_LANES = 20  # pulses that are tried at once
_ROUNDS = 3  # of a search, each 20 times as fine
_HALVINGS = 12
_NUDGE = 1e-5  # of a pulse's width, for derivatives [s]
_NEWTON = 8  # steps at most
_CLOSE, _NEAR = 3e-6, 1e-3  # to the amplitude: where they end, and what is near enough [-]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Pulses:
    """Widths of the pulses of a movement, for N joints.

    Attributes:
        agonist: How long the agonist is on [s], shape (N,).
        brake: How long the antagonist is on after that [s], shape (N,).
        kind: ``unbraked``; ``braked``; ``stopped``, where the whole run is braked and the joint
            does not come back by 5 %; or ``swings``, where it does so without a brake.
    """

    agonist: _Values
    brake: _Values
    kind: str


@dataclass(frozen=True)
class BallisticMovements:
    """Movements of N joints that go their amplitude and no farther.

    Attributes:
        pulses: Widths of their pulses.
        time: Times from the start [s], shape (T,).
        progress: Angle from the start, in units of the amplitude [-], shape (N, T).
        velocity: Along the movement [rad/s], shape (N, T).
    """

    pulses: Pulses
    time: _Values
    progress: _Values
    velocity: _Values

    @property
    def peak_velocity(self) -> _Values:
        """Largest velocity [rad/s], shape (N,)."""
        return peaks(self.velocity)

    def duration(self, threshold: float) -> _Values:
        """Time [s] from where the velocity rises past ``threshold`` [rad/s] to its fall below.

        Raises:
            UnmeasuredError: A velocity does not pass it, or has not fallen below it by the end.
        """
        return np.array([_duration(self.time, row, threshold) for row in self.velocity])


def _duration(time: _Values, velocity: _Values, threshold: float) -> float:
    peak = int(velocity.argmax())
    rise = time_to(time, velocity, threshold)
    fall = time_to(time[peak:], -velocity[peak:], -threshold)
    if rise is None or fall is None:
        raise UnmeasuredError(f"its velocity does not pass {threshold:.3g} rad/s and fall again")
    return float(time[peak] + fall - rise)


def peaks(values: _Values) -> _Values:
    """Largest value of each row, by a parabola through the samples about it, (N, T) -> (N,)."""
    top = np.clip(values.argmax(axis=1), 1, values.shape[1] - 2)
    rows = np.arange(len(values))
    before, here, after = (values[rows, top + k] for k in (-1, 0, 1))
    bend = before - 2 * here + after
    slope = 0.5 * (after - before)
    gain = np.divide(-0.5 * slope**2, bend, out=np.zeros_like(bend), where=bend < 0)
    inside = np.abs(slope) <= -bend
    return np.asarray(np.where(inside, here + gain, values.max(axis=1)))


def _first_peak(values: _Values) -> tuple[_Values, NDArray[np.intp]]:
    """The first peak of each row, by a parabola about its sample, and that; (N, T) -> (N,), (N,).

    Where a row has no peak, its last value.
    """
    rise = np.diff(values, axis=1)
    turns = (rise[:, :-1] > 0) & (rise[:, 1:] <= 0)
    some, where = turns.any(axis=1), turns.argmax(axis=1) + 1
    rows = np.arange(len(values))
    up, down = rise[rows, where - 1], -rise[rows, where]
    gain = np.divide((up - down) ** 2, 8 * (up + down), out=np.zeros_like(up), where=some)
    last = values.shape[1] - 1
    return np.where(some, values[rows, where] + gain, values[:, last]), np.where(some, where, last)


class _Movement:
    """A movement of N joints by an amplitude [rad], each from where it is held."""

    def __init__(
        self,
        joints: Sequence[Joint],
        muscle: str,
        *,
        amplitude: float,
        duration: float,
        height: float,
        tonic: float,
    ) -> None:
        self.joints, self.muscle, self.amplitude, self.height = joints, muscle, amplitude, height
        names = list(joints[0].muscles)
        self.agonist, self.antagonist = (
            names.index(name) for name in (muscle, antagonist(joints[0], muscle))
        )
        self.along = direction(joints[0], muscle)
        ends = [_ends(joint, muscle, amplitude) for joint in joints]
        self.start = np.array([first for first, _ in ends])
        self.before, self.hold = (
            np.array(
                [
                    [*tonic_excitations(joint, muscle, both[end], tonic).values()]
                    for joint, both in zip(joints, ends, strict=True)
                ]
            )
            for end in (0, 1)
        )
        self.timestep = timestep_of(joints[0])
        self.steps = round(duration / self.timestep)
        self.duration = duration
        self._rigs: dict[int, Rigs] = {}

    def run(self, pulse: _Values, brake: _Values) -> tuple[_Values, _Values]:
        """Progress [-] and velocity [rad/s], (M N,) -> (M N, steps + 1): M runs of each joint."""
        copies = len(pulse) // len(self.joints)
        if copies not in self._rigs:
            rigs = Rigs([*self.joints] * copies, timestep=self.timestep)
            self._rigs[copies] = rigs
        start, before = np.tile(self.start, copies), np.tile(self.before, (copies, 1))
        found = self._rigs[copies].run(
            start=start,
            before=before,
            excitation=self._excitations(pulse, brake, np.tile(self.hold, (copies, 1))),
            steps=self.steps,
            record=("qpos", "qvel"),
        )
        still = np.zeros((len(pulse), 1))
        progress = self.along * (found["qpos"][:, :, 0] - start[:, None]) / self.amplitude
        velocity = self.along * found["qvel"][:, :, 0]
        return np.hstack([still, progress]), np.hstack([still, velocity])

    def _excitations(self, pulse: _Values, brake: _Values, hold: _Values) -> _Values:
        """Excitation over each step; in the one in which a pulse ends, its mean."""
        middle = (np.arange(self.steps) + 0.5) * self.timestep

        def on(end: _Values) -> _Values:
            return np.asarray(np.clip((end[:, None] - middle) / self.timestep + 0.5, 0.0, 1.0))

        driven, ended = on(pulse), 1.0 - on(pulse + brake)
        result = ended[:, :, None] * hold[:, None, :]
        result[:, :, self.agonist] += self.height * driven
        result[:, :, self.antagonist] += self.height * (1.0 - ended - driven)
        return result

    def errors(self, pulse: _Values, brake: _Values) -> _Values:
        """How far each passes its amplitude, and comes back more than allowed [-], (2, M N)."""
        progress, _ = self.run(pulse, brake)
        top, where = _first_peak(progress)
        later = np.arange(progress.shape[1]) >= where[:, None]
        back, _ = _first_peak(np.where(later, -progress, -top[:, None]))
        return np.stack([top - 1.0, top + back - FALL_BACK])

    # --- one joint: a search from nothing

    def search(self, *, braked: bool) -> Pulses:
        """Pulses of the first joint, to about a step's tenth."""
        long = self.duration
        if self.errors(np.full(1, long), np.zeros(1))[0, 0] < 0:
            raise UnmeasuredError(
                f"an excitation of {self.height:g} does not move it by "
                f"{degrees(self.amplitude):g}° in {long:g} s"
            )
        swings = self.errors(np.zeros(1), np.zeros(1))[0, 0] > 0
        if not braked:
            if swings:
                raise UnmeasuredError("it swings past the new angle even without a pulse")
            return Pulses(np.array([self._pulse(0.0, 0.0)]), np.zeros(1), "unbraked")
        narrow = 0.0 if swings else self._pulse(0.0, 0.0)
        if self._falls(np.array([narrow]))[0] >= 0:
            return Pulses(np.array([narrow]), self._brakes(np.array([narrow])), "swings")
        wide = self._pulse(long, narrow)
        if self._falls(np.array([wide]))[0] <= 0:
            return Pulses(np.array([wide]), np.full(1, long), "stopped")
        pulse = _first_crossing(self._falls, narrow, wide)
        return Pulses(np.array([pulse]), self._brakes(np.array([pulse])), "braked")

    def _pulse(self, brake: float, low: float) -> float:
        """Width of the pulse [s] with which the joint goes its amplitude, for a brake [s]."""
        return _first_crossing(
            lambda pulse: self.errors(pulse, np.full_like(pulse, brake))[0], low, self.duration
        )

    def _brakes(self, pulse: _Values) -> _Values:
        """Widths of the brake [s] that stop movements at the amplitude, shape (M,)."""
        low, high = np.zeros_like(pulse), np.full_like(pulse, self.duration)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            far = self.errors(pulse, middle)[0] > 0
            low, high = np.where(far, middle, low), np.where(far, high, middle)
        return np.asarray(0.5 * (low + high))

    def _falls(self, pulse: _Values) -> _Values:
        return np.asarray(self.errors(pulse, self._brakes(pulse))[1])

    # --- many joints: Newton's method from a guess

    def solve(self, guess: Pulses) -> Pulses:
        """The pulses of every joint."""
        count, both = len(self.joints), guess.kind == "braked"
        widths = np.stack([np.broadcast_to(w, count) for w in (guess.agonist, guess.brake)])
        best, least = widths.copy(), np.full(count, np.inf)
        rows = 2 if both else 1
        for _ in range(_NEWTON):
            nudged = np.repeat(widths[:, None], rows + 1, axis=1)  # (2, copies, N)
            for k in range(rows):
                nudged[k, k + 1] += _NUDGE
            found = self.errors(nudged[0].ravel(), nudged[1].ravel()).reshape(2, rows + 1, count)
            here = found[:rows, 0]
            error = np.abs(here).max(axis=0)
            best, least = np.where(error < least, widths, best), np.minimum(error, least)
            if least.max() < _CLOSE:
                break
            slopes = (found[:rows, 1:] - here[:, None]) / _NUDGE  # (rows, columns, N)
            inverse = np.linalg.pinv(slopes.transpose(2, 0, 1))
            change = np.einsum("nij,jn->in", inverse, here)
            most = 0.3 * widths[:rows] + self.timestep
            widths[:rows] = np.maximum(widths[:rows] - np.clip(change, -most, most), 0.0)
        if least.max() > _NEAR:
            raise UnmeasuredError("no pulses were found that move it there and stop it")
        return Pulses(best[0], best[1], guess.kind)


def _first_crossing(function: Callable[[_Values], _Values], low: float, high: float) -> float:
    """Where a function first becomes positive between two places, else the second."""
    for _ in range(_ROUNDS):
        places = np.linspace(low, high, _LANES)
        values = function(places)
        above = np.flatnonzero(values > 0)
        if not len(above):
            return high
        if above[0] == 0:
            return low
        first = int(above[0])
        low, high = float(places[first - 1]), float(places[first])
        share = values[first - 1] / (values[first - 1] - values[first])
    return low + float(share) * (high - low)


def ballistic_movements(
    joints: Sequence[Joint],
    muscle: str,
    *,
    amplitude: float,
    duration: float,
    braked: bool = False,
    height: float = 1.0,
    tonic: float = 0.0,
    guess: Pulses | None = None,
) -> BallisticMovements:
    """The fastest movement by ``amplitude`` [rad] that ``muscle`` makes with pulses of a height.

    Without a brake, the pulse is just wide enough to reach the new angle and not pass it. With a
    brake, the pulse is the widest for which the brake stops the joint at the new angle and the
    joint then comes back by no more than 5 %.

    Args:
        joints: N joints with the same muscles and gears; other numbers may differ.
        muscle: The agonist.
        amplitude: How far the joint moves [rad].
        duration: Length of the run, within which it must arrive [s].
        braked: Whether the antagonist brakes.
        height: Excitation in pulse and brake [-].
        tonic: Least excitation of both muscles before and after the movement [-].
        guess: Pulses to start from, of joints that are almost the same.

    Raises:
        UnmeasuredError: A joint cannot make such a movement.
    """
    options = {
        "amplitude": amplitude, "duration": duration, "height": height, "tonic": tonic,
    }  # fmt: skip
    if guess is None:
        guess = _Movement(joints[:1], muscle, **options).search(braked=braked)
    movement = _Movement(joints, muscle, **options)
    pulses = movement.solve(guess)
    progress, velocity = movement.run(pulses.agonist, pulses.brake)
    time: _Values = np.arange(movement.steps + 1, dtype=np.float64) * movement.timestep
    return BallisticMovements(pulses, time, progress, velocity)


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


def free_velocities(
    joints: Sequence[Joint], muscle: str, *, angle: float | None = None, excitation: float = 1.0
) -> _Values:
    """Peak velocity [rad/s] of joints that carry no load, shape (N,).

    The joints start still, both muscles relaxed. Past the end of the range, where ligaments and
    bone would stop them, their velocity does not count.

    Args:
        joints: N joints with the same muscles and gears; other numbers may differ.
        muscle: The muscle.
        angle: Where they start [rad]; by default at the angle of rest.
        excitation: Of the muscle [-]; 0 for what passive elasticity alone does.

    Raises:
        UnmeasuredError: The simulation went bad.
    """
    starts = np.array([joint.rest_angle if angle is None else angle for joint in joints])
    inputs = np.zeros((1, 1, len(joints[0].muscles)))
    inputs[0, 0, list(joints[0].muscles).index(muscle)] = excitation
    timestep = timestep_of(joints[0])
    run = Rigs(joints, timestep=timestep).run(
        start=starts,
        excitation=inputs,
        steps=round(_FREE_TIME / timestep),
        record=("qpos", "qvel"),
    )
    low, high = np.array([joint.range for joint in joints]).T[:, :, None]
    angles = run["qpos"][:, :, 0]
    velocities = direction(joints[0], muscle) * run["qvel"][:, :, 0]
    return peaks(np.where((angles >= low) & (angles <= high), velocities, 0.0))


def isokinetic_velocities(joints: Sequence[Joint], muscle: str, *, share: float) -> _Values:
    """Velocity [rad/s] at which a muscle has a share of its isometric torque, shape (N,).

    Fully active, at one angle, as a dynamometer measures it; the series element keeps its length.
    A share of 0 is the velocity that torque-velocity curves measured under loads are extrapolated
    to.

    Args:
        joints: N joints with the same muscles and gears.
        muscle: The muscle, of a model with Hill's contractile element.
        share: Torque over isometric torque [-], 0 to 1.
    """
    return np.array(
        [
            velocity_at_share(contractile_of(joint.muscles[muscle]), share)
            / abs(joint.gears[muscle])
            for joint in joints
        ]
    )
