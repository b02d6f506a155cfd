"""A joint fitted to measurements of its movement, or of the torque that holds it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.fit import Identified, Solution, intervals, over_uncertainty, solve
from mjhill.identification.free import Free, free_parameters, joint_at
from mjhill.identification.inputs import WAYS
from mjhill.identification.measurement import Measurement
from mjhill.identification.noise import Noise, noise_of, white
from mjhill.identification.trial import Trial, make_trial
from mjhill.joints.joint import Joint
from mjhill.joints.reader import read_joints
from mjhill.lab.rig import UnmeasuredError

QUANTITIES = ("angle", "torque")  # what can be predicted
# [s]; from EMG to torque it is 30 to 100 ms in all (Cavanagh & Komi 1979), of which the model has
# a part
DELAY = Free(("delay",), 0.0, 0.1)
_FIRST_NOISE = 0.02  # of the spread of what is predicted, until the fit says better
_ROUNDS = 4
_DIFFERENCE = 1e-3  # standard deviations; shorter ones find the kinks of a simulation
_SETTLED = 1e-6  # standard deviations: a step so short is the last
_STIFFEST = 1e8  # regularisation at which a fit ends; data without noise have steep residuals
_SAME = 0.02  # of the noise, by which it may still change
_FAR = 10.0  # times the spread of what is predicted
_TOGETHER = 4.0  # residuals that count as one, from here on they are not called noise
_SMALL = 1e-3  # of the spread of what is predicted, too little to be remarked on
_OFF = 0.1  # standard deviations of all data together, by which a correction may still change

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """A measurement beside what the fitted joint does under its inputs.

    Attributes:
        measurement: The measurement.
        quantity: What is predicted: ``angle`` [rad] or ``torque`` [N·m].
        measured: That quantity as measured, shape (T,).
        predicted: As predicted.
        inputs: How the inputs were taken to go on between samples, in words.
        together: Number of residuals that count as one, as they hang together; near 1 if only
            noise is left.
    """

    measurement: Measurement
    quantity: str
    measured: _Values
    predicted: _Values
    inputs: str = ""
    together: float = 1.0

    @property
    def error(self) -> float:
        """Root mean square of the difference, in the quantity's unit."""
        return float(np.sqrt(np.mean((self.predicted - self.measured) ** 2)))

    @property
    def explained(self) -> float:
        """Share of the measured variance that the prediction accounts for [-].

        An offset of the prediction counts as unexplained, so it is negative for a prediction
        that is worse than the mean of the measurement.
        """
        return 1.0 - self.error**2 / float(np.var(self.measured))

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done to the numbers of the file, and what is odd about the rest, for people."""
        notes = self.measurement.notes
        if self.together < _TOGETHER or self.error < _SMALL * float(np.ptp(self.measured)):
            return notes
        return (
            *notes,
            f"what is left is no noise, as it hangs together over {self.together:.0f} samples: "
            "maybe inputs are held or joined wrongly, excitations act late (a delay), or a "
            "parameter that is not fitted is wrong; intervals do not show such errors",
        )


def from_measurements(
    joint: str,
    measurements: Sequence[Measurement],
    *,
    predict: str | Sequence[str] | None = None,
    only: Sequence[str] = (),
    inputs: str | None = None,
    delay: bool = False,
    parameters: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Identified, list[Prediction]]:
    """Fit the free parameters of a joint to measurements of one subject.

    Each measurement starts with muscles steady at its first inputs, at an angle and a velocity
    that are fitted besides. The priors are those of ``mjhill.identification.fit``: a parameter
    that the data say nothing about stays in the middle of its bounds, and ``Estimate.informed``
    is near 0.

    Args:
        joint: The joint's name.
        measurements: One or more.
        predict: ``angle``: move the joint by the measured torque and compare angles; ``torque``:
            drive it along the measured angle and compare torques. One for all measurements or
            one for each. By default torque where the angle stays within 0.02 rad, angle
            elsewhere.
        only: Names of the parameters to fit, by default all that have bounds; the others keep
            the value of the parameter file.
        inputs: How excitations and torque go on between samples: ``hold``: each value lasts
            until the next sample; ``join``: in straight lines. By default as each of them looks,
            see ``inputs.is_held``; in a recording of a simulation they are held.
        delay: Whether to fit a delay too, by which the excitations act later than measured, the
            same in all measurements, from 0 to 0.1 s; see ``Identified.delay``.
        parameters: The parameter file; by default the one that comes with mjhill.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint or a parameter is unknown, there is no measurement, ``predict``
            or ``inputs`` is unknown or of another number, or what is to be predicted never
            changes.
        RuntimeError: The fit did not settle.
    """
    if not measurements:
        raise ValueError("there is no measurement to fit; give at least one")
    if inputs not in (None, *WAYS):
        raise ValueError(f"inputs must be one of {', '.join(WAYS)}, got {inputs!r}")
    quantities = _quantities(predict, len(measurements))
    free = _chosen(free_parameters(joint, parameters), only, joint)
    trials = [
        make_trial(measurement, quantity, inputs)
        for measurement, quantity in zip(measurements, quantities, strict=True)
    ]
    return fit_trials(read_joints(parameters)[joint], free, trials, delay=delay, progress=progress)


def fit_trials(
    joint: Joint,
    free: Sequence[Free],
    trials: Sequence[Trial],
    *,
    delay: bool = False,
    progress: Callable[[float], None] | None = None,
) -> tuple[Identified, list[Prediction]]:
    """Fit some parameters of a joint to trials.

    Args:
        joint: The joint; what is not fitted stays.
        free: The parameters.
        trials: The trials.
        delay: As in ``from_measurements``.
        progress: Called with the share done, 0 to 1.

    Raises:
        RuntimeError: The fit did not settle.
    """
    problem = _Problem(joint, tuple(free), tuple(trials), delay)
    solution, ends, predicted, noises = _solve(problem, progress)
    fitted = problem.joints(solution.deviations[:, None])[0]
    predictions = [
        Prediction(
            trial.measurement, trial.quantity, trial.measured, values, trial.inputs, noise.together
        )
        for trial, values, noise in zip(trials, predicted, noises, strict=True)
    ]
    estimates = solution.estimates([*free, DELAY] if delay else free, ends)
    late = estimates.pop() if delay else None
    return Identified(fitted, tuple(free), tuple(estimates), delay=late), predictions


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


@dataclass(frozen=True)
class _Problem:
    """What is fitted to what.

    A point is the deviations of the free parameters, of the delay if it is fitted, and of where
    each trial starts and how fast.
    """

    joint: Joint
    free: tuple[Free, ...]
    trials: tuple[Trial, ...]
    delay: bool

    @property
    def wanted(self) -> int:
        """Number of parameters whose intervals are wanted."""
        return len(self.free) + self.delay

    @property
    def count(self) -> int:
        """Length of a point."""
        return self.wanted + 2 * len(self.trials)

    def joints(self, points: _Values) -> list[Joint]:
        """The joints at K points, shape (count, K)."""
        return [joint_at(self.joint, self.free, point[: len(self.free)]) for point in points.T]

    def _settings(self, points: _Values) -> list[tuple[Trial, _Values, _Values | None]]:
        """Each trial with offsets of its start, shape (2, K), and delays [s], shape (K,)."""
        delays = None
        if self.delay:
            delays = np.array([DELAY.value(z) for z in points[len(self.free)].tolist()])
        offsets = points[self.wanted :].reshape(-1, 2, points.shape[1])
        return [(*pair, delays) for pair in zip(self.trials, offsets, strict=True)]

    def predictions(self, points: _Values) -> list[_Values]:
        """What K points predict of each trial, shape (K, T).

        Where a simulation goes bad, as it may far from a solution, it is far from what was
        measured.
        """
        joints = self.joints(points)
        try:
            return [
                trial.predict(joints, offsets, delays)
                for trial, offsets, delays in self._settings(points)
            ]
        except UnmeasuredError:
            if len(joints) == 1:
                return [(one.measured + _FAR * one.spread)[None] for one in self.trials]
        alone = [self.predictions(point[:, None]) for point in points.T]
        return [np.concatenate(rows) for rows in zip(*alone, strict=True)]

    def known(self, point: _Values) -> list[tuple[_Values, _Values]]:
        """At a point, for each trial: its correction and the errors of its input.

        See ``Trial.correction`` and ``Trial.input_errors``.
        """
        joint = self.joints(point[:, None])[0]
        return [
            (
                trial.correction(joint, offsets, delays),
                trial.input_errors(joint, offsets, delays),
            )
            for trial, offsets, delays in self._settings(point[:, None])
        ]


def _solve(
    problem: _Problem, progress: Callable[[float], None] | None
) -> tuple[Solution, _Values, list[_Values], list[Noise]]:
    """Fit, take the noise from what is left, and fit again until it no longer changes.

    Returns:
        The solution, the ends of the intervals of confidence, what the solution predicts, and
        the noise that it leaves.
    """
    trials, count = problem.trials, problem.count
    noises = [white(1.0 / (_FIRST_NOISE * trial.spread), len(trial.time)) for trial in trials]
    missed = [np.zeros(len(trial.time)) for trial in trials]

    def residuals(points: _Values) -> _Values:
        parts = [
            noise.whiten(predicted + more - trial.measured)
            for trial, noise, more, predicted in zip(
                trials, noises, missed, problem.predictions(points), strict=True
            )
        ]
        return np.ascontiguousarray(np.concatenate(parts, axis=1).T)

    point = np.zeros(count)
    for stage in range(_ROUNDS):
        done = stage / _ROUNDS
        report = (lambda share, d=done: progress(d + share / _ROUNDS)) if progress else None
        solution = solve(
            residuals,
            count,
            report,
            start=point,
            difference=_DIFFERENCE,
            tolerance=_SETTLED,
            stiffest=_STIFFEST,
        )
        point = solution.deviations
        known = problem.known(point)
        predicted = [
            values[0] + more
            for values, (more, _) in zip(problem.predictions(point[:, None]), known, strict=True)
        ]
        found = [
            noise_of(values - trial.measured, errors, count / len(trials), trial.spread)
            for trial, values, (_, errors) in zip(trials, predicted, known, strict=True)
        ]
        same = all(
            _alike(new, old) and new.scale * np.linalg.norm(more - before) < _OFF
            for new, old, (more, _), before in zip(found, noises, known, missed, strict=True)
        )
        if same or stage == _ROUNDS - 1:
            break
        noises, missed = found, [more for more, _ in known]
    solution = over_uncertainty(residuals, solution)
    return solution, intervals(residuals, solution, problem.wanted), predicted, found


def _alike(new: Noise, old: Noise) -> bool:
    return new.basis.shape == old.basis.shape and abs(new.scale / old.scale - 1) < _SAME
