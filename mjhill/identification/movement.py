"""A joint fitted to measurements of its movement, or of the torque that holds it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.fit import Identified, Solution, intervals, solve
from mjhill.identification.free import Free, free_parameters, joint_at
from mjhill.identification.measurement import Measurement
from mjhill.joints.joint import Joint
from mjhill.joints.reader import read_joints
from mjhill.lab.batch import driving_torques, joint_angles

QUANTITIES = ("angle", "torque")  # what can be predicted
_OTHER = {"angle": "torque", "torque": "angle"}
_HELD = 0.02  # [rad], a joint that moves less is taken as held still
_SMOOTHING = 10.0  # [Hz], cut-off of the path of a driven joint, usual for human movement
_LONGEST_STEP = 1e-3  # [s]
_LEAST_NOISE = 1e-4  # of the spread of what is predicted: no simulation is nearer to a joint
_START_SPAN = 0.05  # [s] from whose samples the start is guessed
_LEAST_SPREAD = 1e-6  # [rad] and [rad/s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """A measurement, and the run that is to predict it.

    Attributes:
        measurement: The measurement.
        quantity: What is predicted: ``angle`` [rad] or ``torque`` [N·m].
        time: Times of the samples from the first [s], shape (T,).
        grid: Times of the steps [s], shape (S,).
        excitation: Input of each muscle over each step, shape (S, muscles).
        torque: External torque over each step [N·m], shape (S,).
        path: Angle at each step [rad] where the torque is predicted, shape (S,); else None.
        start: Angle [rad] and velocity [rad/s] at time 0, shape (2,).
        start_spread: Their standard deviations, shape (2,).
    """

    measurement: Measurement
    quantity: str
    time: _Values
    grid: _Values
    excitation: _Values
    torque: _Values
    path: _Values | None
    start: _Values
    start_spread: _Values

    @property
    def measured(self) -> _Values:
        """The quantity as measured, shape (T,)."""
        return np.asarray(getattr(self.measurement, self.quantity))

    @property
    def spread(self) -> float:
        """Largest less smallest of it, in its unit."""
        return float(np.ptp(self.measured))

    def predict(self, joints: Sequence[Joint], offsets: _Values) -> _Values:
        """What joints do, shape (joints, T), with deviations of their starts, (2, joints)."""
        timestep, before = float(self.grid[1]), self.excitation[0]
        if self.path is not None:
            run = driving_torques(
                joints,
                path=self.path,
                before=before,
                excitation=self.excitation,
                timestep=timestep,
            )
        else:
            start, velocity = self.start[:, None] + self.start_spread[:, None] * offsets
            run = joint_angles(
                joints,
                start=start,
                velocity=velocity,
                before=before,
                excitation=self.excitation[:-1],
                torque=self.torque[:-1],
                steps=len(self.grid) - 1,
                timestep=timestep,
            )
        return np.array([np.interp(self.time, self.grid, row) for row in run])

    def weight(self, predicted: _Values) -> float:
        """Weight of a residual, from what a prediction leaves.

        Residuals that hang together count as fewer: a series with correlation r from sample to
        sample is worth (1 - r)/(1 + r) of its samples.
        """
        left = predicted - self.measured
        noise = max(float(np.sqrt(np.mean(left**2))), _LEAST_NOISE * self.spread)
        size = float(left @ left)
        correlation = min(max(float(left[1:] @ left[:-1]) / size, 0.0), 0.999) if size else 0.0
        return float(np.sqrt((1 - correlation) / (1 + correlation))) / noise


def make_trial(joint: Joint, measurement: Measurement, predict: str | None = None) -> Trial:
    """A measurement of a joint made ready.

    Args:
        joint: The joint.
        measurement: The measurement.
        predict: ``angle`` or ``torque``; by default torque where the joint is held still.

    Raises:
        ValueError: What is to be predicted never changes.
    """
    held = np.ptp(measurement.angle) < _HELD
    quantity = predict or ("torque" if held else "angle")
    if np.ptp(getattr(measurement, quantity)) == 0:
        raise ValueError(
            f"{measurement.source}: the {quantity} never changes, so there is nothing to "
            f"predict; predict the {_OTHER[quantity]} instead"
        )
    time = measurement.time - measurement.time[0]
    timestep = min(_LONGEST_STEP, float(np.median(np.diff(time))))
    steps = int(np.ceil(time[-1] / timestep - 1e-6))  # free of rounding
    grid: _Values = np.arange(steps + 1, dtype=np.float64) * timestep
    inputs = [measurement.excitation[name] for name in joint.muscles]
    return Trial(
        measurement,
        quantity,
        time,
        grid,
        # held instead, samples would come half an interval late: 5 ms at 100 Hz
        np.stack([np.interp(grid, time, values) for values in inputs], axis=1),
        np.interp(grid, time, measurement.torque),
        _smooth_path(time, measurement.angle, grid) if quantity == "torque" else None,
        *_start(time, measurement.angle),
    )


def _smooth_path(time: _Values, angle: _Values, grid: _Values) -> _Values:
    from scipy.signal import butter, sosfiltfilt

    path = np.interp(grid, time, angle)
    if np.ptp(path) < _HELD:
        return np.full_like(path, float(np.mean(path)))
    timestep = float(grid[1])
    cutoff = min(_SMOOTHING, 0.4 / float(np.median(np.diff(time))))
    sections = butter(2, cutoff, fs=1 / timestep, output="sos")
    # ends go on for a period and a half of the cut-off, else the last torques are far off
    beyond = min(round(1.5 / (cutoff * timestep)), len(path) - 1)
    return np.asarray(sosfiltfilt(sections, path, padlen=beyond))


def _start(time: _Values, angle: _Values) -> tuple[_Values, _Values]:
    """Angle [rad] and velocity [rad/s] at time 0, and their spreads, from the first samples.

    By a parabola, as the joint may already be speeding up. Its distance to a straight line is
    doubted too: noise is not all that it can miss, and the bounds of a fit are hard.
    """
    # six samples or more, though the first come late where times are uneven
    first = time <= max(_START_SPAN, time[:6].max())
    parabola, covariance = np.polyfit(time[first], angle[first], 2, cov=True)
    line = np.polyfit(time[first], angle[first], 1)
    spread = np.abs(parabola[1:] - line) + 2 * np.sqrt(np.diag(covariance)[1:])
    return parabola[:0:-1], spread[::-1] + _LEAST_SPREAD


_FIRST_NOISE = 0.02  # of the spread of what is predicted, until the fit says better
_ROUNDS = 4


@dataclass(frozen=True)
class Prediction:
    """A measurement beside what the fitted joint does under its inputs.

    Attributes:
        measurement: The measurement.
        quantity: What is predicted: ``angle`` [rad] or ``torque`` [N·m].
        measured: That quantity as measured, shape (T,).
        predicted: As predicted.
    """

    measurement: Measurement
    quantity: str
    measured: _Values
    predicted: _Values

    @property
    def error(self) -> float:
        """Root mean square of the difference, in the quantity's unit."""
        return float(np.sqrt(np.mean((self.predicted - self.measured) ** 2)))

    @property
    def explained(self) -> float:
        """Share of the measured variance that the prediction accounts for [-]."""
        return 1.0 - float(np.var(self.predicted - self.measured) / np.var(self.measured))


def from_measurements(
    joint: str,
    measurements: Sequence[Measurement],
    *,
    predict: str | Sequence[str] | None = None,
    only: Sequence[str] = (),
    parameters: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Identified, list[Prediction]]:
    """Fit the free parameters of a joint to measurements of one subject.

    Each measurement starts with muscles steady at its first inputs, at an angle and a velocity
    that are fitted besides. Its inputs go straight from sample to sample. The priors are those of
    ``mjhill.identification.fit``: a parameter that the data say nothing about stays in the
    middle of its bounds, and ``Estimate.informed`` is near 0.

    Args:
        joint: The joint's name.
        measurements: One or more.
        predict: ``angle``: move the joint by the measured torque and compare angles; ``torque``:
            drive it along the measured angle and compare torques. One for all measurements or
            one for each. By default torque where the angle stays within 0.02 rad, angle
            elsewhere.
        only: Names of the parameters to fit, by default all that have bounds; the others keep
            the value of the parameter file.
        parameters: The parameter file; by default the one that comes with mjhill.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint or a parameter is unknown, there is no measurement, ``predict``
            is neither or of another number, or what is to be predicted never changes.
        RuntimeError: The fit did not settle.
    """
    if not measurements:
        raise ValueError("there is no measurement to fit; give at least one")
    quantities = _quantities(predict, len(measurements))
    free = _chosen(free_parameters(joint, parameters), only, joint)
    start = read_joints(parameters)[joint]
    trials = [
        make_trial(start, measurement, quantity)
        for measurement, quantity in zip(measurements, quantities, strict=True)
    ]
    solution, ends = _solve(start, free, trials, progress)
    fitted = joint_at(start, free, solution.deviations[: len(free)])
    predictions = []
    for trial, offset in zip(trials, _offsets(solution.deviations, len(free)), strict=True):
        predicted = trial.predict([fitted], offset)[0]
        predictions.append(Prediction(trial.measurement, trial.quantity, trial.measured, predicted))
    return Identified(fitted, tuple(free), tuple(solution.estimates(free, ends))), predictions


def _quantities(predict: str | Sequence[str] | None, count: int) -> list[str | None]:
    """What is predicted of each measurement."""
    if predict is None:
        return [None] * count
    given = [predict] if isinstance(predict, str) else list(predict)
    for quantity in given:
        if quantity not in QUANTITIES:
            raise ValueError(f"predict must be one of {', '.join(QUANTITIES)}, got {quantity!r}")
    if len(given) not in (1, count):
        raise ValueError(
            f"predict must be given once, or once for each of the {count} measurements, got "
            f"{len(given)}: {', '.join(given)}"
        )
    return [*given] * (count if len(given) == 1 else 1)


def _chosen(free: list[Free], only: Sequence[str], joint: str) -> list[Free]:
    # where a step of Table 2 starts is no property of the subject
    free = [item for item in free if item.path[0] != "postures"]
    names = [item.name for item in free]
    for name in only:
        if name not in names:
            raise ValueError(
                f"{joint}: unknown free parameter {name!r}; there are: {', '.join(names)}"
            )
    return [item for item in free if not only or item.name in only]


def _solve(
    start: Joint,
    free: list[Free],
    trials: list[Trial],
    progress: Callable[[float], None] | None,
) -> tuple[Solution, _Values]:
    """Fit, take the noise from what is left, and fit again until it no longer changes.

    With the ends of the parameters' intervals of confidence.
    """
    count = len(free) + 2 * len(trials)  # where each trial starts, and how fast, besides
    weights = [1.0 / (_FIRST_NOISE * trial.spread) for trial in trials]

    def residuals(points: _Values) -> _Values:
        joints = [joint_at(start, free, point[: len(free)]) for point in points.T]
        parts = [
            weight * (trial.predict(joints, offset) - trial.measured)
            for trial, weight, offset in zip(
                trials, weights, _offsets(points, len(free)), strict=True
            )
        ]
        return np.ascontiguousarray(np.concatenate(parts, axis=1).T)

    point = np.zeros(count)
    for stage in range(_ROUNDS):
        done = stage / _ROUNDS
        report = (lambda share, d=done: progress(d + share / _ROUNDS)) if progress else None
        solution = solve(residuals, count, report, start=point)
        point = solution.deviations
        joint = joint_at(start, free, point[: len(free)])
        found = [
            trial.weight(trial.predict([joint], offset)[0])
            for trial, offset in zip(trials, _offsets(point, len(free)), strict=True)
        ]
        if np.allclose(found, weights, rtol=0.02) or stage == _ROUNDS - 1:
            break
        weights = found
    return solution, intervals(residuals, solution, len(free))


def _offsets(points: _Values, free: int) -> _Values:
    """Start of each trial, in deviations: angle and velocity at K points, (trials, 2, K)."""
    return points[free:].reshape(-1, 2, points[0].size)
