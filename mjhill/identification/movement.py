"""A joint identified from measurements of its movement, or of the torque that holds it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.ensemble import angles, driving_torques
from mjhill.identification.free import Free, free_parameters, joint_at
from mjhill.identification.identified import Identified
from mjhill.identification.measurement import Measurement
from mjhill.identification.solve import Solution, solve
from mjhill.joints import read_joints
from mjhill.parameters import Joint

PREDICTIONS = ("angle", "torque")
_OTHER = {"angle": "torque", "torque": "angle"}
_HELD = 0.02  # [rad], a joint that moves less is taken as held still
_SMOOTHING = 10.0  # [Hz], cut-off of the path of a driven joint, usual for human movement
_LONGEST_STEP = 1e-3  # [s]
_FIRST_NOISE = 0.02  # of the spread of what is predicted, until the fit says better
_LEAST_NOISE = 1e-4  # of that spread: no simulation is nearer to a joint
_ROUNDS = 4
_START_SPAN = 0.05  # [s] from whose samples the start is guessed
_LEAST_SPREAD = 1e-6  # [rad] and [rad/s]

_Values = NDArray[np.float64]


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
    predict: str | None = None,
    only: Sequence[str] = (),
    parameters: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Identified, list[Prediction]]:
    """Fit the free parameters of a joint to measurements of one subject.

    Each measurement starts with muscles steady at its first inputs, at an angle and a velocity
    that are fitted besides. Its inputs hold from sample to sample. The priors are those of
    ``mjhill.identification.free``: a parameter that the data say nothing about stays in the
    middle of its bounds, and ``Estimate.informed`` tells.

    Args:
        joint: The joint's name.
        measurements: One or more.
        predict: ``angle``: move the joint by the measured torque and compare angles; ``torque``:
            drive it along the measured angle and compare torques. By default torque where the
            angle stays within 0.02 rad, angle elsewhere.
        only: Names of the parameters to fit, by default all that have bounds; the others keep
            the value of the parameter file.
        parameters: The parameter file; by default the one that comes with mjhill.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint or a parameter is unknown, there is no measurement, ``predict``
            is neither, or what is to be predicted never changes.
        RuntimeError: The fit did not settle.
    """
    if not measurements:
        raise ValueError("there is no measurement to fit; give at least one")
    if predict not in (None, *PREDICTIONS):
        raise ValueError(f"predict must be one of {', '.join(PREDICTIONS)}, got {predict!r}")
    free = _chosen(free_parameters(joint, parameters), only, joint)
    start = read_joints(parameters)[joint]
    trials = [_Trial(start, measurement, predict) for measurement in measurements]
    solution = _solve(start, free, trials, progress)
    fitted = joint_at(start, free, solution.deviations[: len(free)])
    predictions = []
    for trial, offset in zip(trials, _offsets(solution.deviations, len(free)), strict=True):
        predicted = trial.predict([fitted], offset)[0]
        predictions.append(Prediction(trial.measurement, trial.quantity, trial.measured, predicted))
    return Identified(fitted, tuple(free), tuple(solution.estimates(free))), predictions


def _chosen(free: list[Free], only: Sequence[str], joint: str) -> list[Free]:
    names = [item.name for item in free]
    for name in only:
        if name not in names:
            raise ValueError(
                f"{joint}: unknown free parameter {name!r}; there are: {', '.join(names)}"
            )
    # where a step of Table 2 starts is no property of the subject
    return [f for f in free if (f.name in only if only else f.path[0] != "postures")]


def _solve(
    start: Joint,
    free: list[Free],
    trials: list[_Trial],
    progress: Callable[[float], None] | None,
) -> Solution:
    """Fit, take the noise from what is left, and fit again until it no longer changes."""
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
        before = weights
        weights = [
            trial.weight(trial.predict([joint], offset)[0])
            for trial, offset in zip(trials, _offsets(point, len(free)), strict=True)
        ]
        if np.allclose(weights, before, rtol=0.02):
            break
    return solution


def _offsets(points: _Values, free: int) -> _Values:
    """Start of each trial, in deviations: angle and velocity at K points, (trials, 2, K)."""
    return points[free:].reshape(-1, 2, points[0].size)


class _Trial:
    """A measurement made ready: its inputs on a grid of steps, what is to be predicted."""

    def __init__(self, joint: Joint, measurement: Measurement, predict: str | None) -> None:
        held = np.ptp(measurement.angle) < _HELD
        self.measurement = measurement
        self.quantity = predict or ("torque" if held else "angle")
        self.measured = getattr(measurement, self.quantity)
        self.spread = float(np.ptp(self.measured))
        if self.spread == 0:
            raise ValueError(
                f"{measurement.source}: the {self.quantity} never changes, so there is nothing to "
                f"predict; predict the {_OTHER[self.quantity]} instead"
            )
        self._time = measurement.time - measurement.time[0]
        interval = float(np.median(np.diff(self._time)))
        self._timestep = min(_LONGEST_STEP, interval)
        steps = int(np.ceil(self._time[-1] / self._timestep - 1e-6))  # free of rounding
        self._grid = np.arange(steps + 1) * self._timestep
        latest = np.searchsorted(self._time, self._grid + 1e-9, side="right") - 1
        excitation = np.stack([measurement.excitation[name] for name in joint.muscles], axis=1)
        self._before, self._excitation = excitation[0], excitation[latest]
        self._torque = measurement.torque[latest]
        self._path = self._smooth_path(interval) if self.quantity == "torque" else None
        # six samples or more, though the first come late where times are uneven
        first = self._time <= max(_START_SPAN, self._time[:6].max())
        self._start, self._start_spread = _start(self._time[first], measurement.angle[first])

    def predict(self, joints: Sequence[Joint], offsets: _Values) -> _Values:
        """What joints do, shape (joints, T), with deviations of their starts, (2, joints)."""
        if self._path is not None:
            run = driving_torques(
                joints,
                path=self._path,
                before=self._before,
                excitation=self._excitation,
                timestep=self._timestep,
            )
        else:
            start, velocity = self._start[:, None] + self._start_spread[:, None] * offsets
            run = angles(
                joints,
                start=start,
                velocity=velocity,
                before=self._before,
                excitation=self._excitation[:-1],
                torque=self._torque[:-1],
                steps=len(self._grid) - 1,
                timestep=self._timestep,
            )
        return np.array([np.interp(self._time, self._grid, row) for row in run])

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

    def _smooth_path(self, interval: float) -> _Values:
        from scipy.signal import butter, sosfiltfilt

        path = np.interp(self._grid, self._time, self.measurement.angle)
        if np.ptp(path) < _HELD:
            return np.full_like(path, float(np.mean(path)))
        cutoff = min(_SMOOTHING, 0.4 / interval)
        sections = butter(2, cutoff, fs=1 / self._timestep, output="sos")
        # ends go on for a period and a half of the cut-off, else the last torques are far off
        beyond = min(round(1.5 / (cutoff * self._timestep)), len(path) - 1)
        return np.asarray(sosfiltfilt(sections, path, padlen=beyond))


def _start(time: _Values, angle: _Values) -> tuple[_Values, _Values]:
    """Angle [rad] and velocity [rad/s] at time 0, and their spreads, from the first samples.

    By a parabola, as the joint may already be speeding up. Its distance to a straight line is
    doubted too: noise is not all that it can miss, and the bounds of a fit are hard.
    """
    parabola, covariance = np.polyfit(time, angle, 2, cov=True)
    line = np.polyfit(time, angle, 1)
    spread = np.abs(parabola[1:] - line) + 2 * np.sqrt(np.diag(covariance)[1:])
    return parabola[:0:-1], spread[::-1] + _LEAST_SPREAD
