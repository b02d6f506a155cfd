"""A joint identified from measurements of its movement, or of the torque that holds it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.free import Free, free_parameters, joint_at
from mjhill.identification.identified import Identified
from mjhill.identification.intervals import intervals
from mjhill.identification.measurement import Measurement
from mjhill.identification.solve import Solution, solve
from mjhill.identification.trial import QUANTITIES, Trial, make_trial
from mjhill.joints.joint import Joint
from mjhill.joints.reader import read_joints

_FIRST_NOISE = 0.02  # of the spread of what is predicted, until the fit says better
_ROUNDS = 4

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
    predict: str | Sequence[str] | None = None,
    only: Sequence[str] = (),
    parameters: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Identified, list[Prediction]]:
    """Fit the free parameters of a joint to measurements of one subject.

    Each measurement starts with muscles steady at its first inputs, at an angle and a velocity
    that are fitted besides. Its inputs go straight from sample to sample. The priors are those of
    ``mjhill.identification.free``: a parameter that the data say nothing about stays in the
    middle of its bounds, and ``Estimate.informed`` tells.

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
