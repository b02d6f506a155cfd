"""A least-squares fit of parameters within their bounds, with priors and intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco.minimize
import numpy as np
from numpy.typing import NDArray

from mjhill.identification.free import DEVIATIONS, Free
from mjhill.joints.joint import Joint

_DIFFERENCE = 1e-5  # of a parameter, in its standard deviations, for derivatives
_STIFFEST = 1e4  # regularisation at which a fit that finds nothing better ends
_ITERATIONS = 200
_UNLIKE = 1e-3  # fall of the cost, a logarithm of likelihood, in which two points still differ
_NEAR = 1e-6  # of a bound, in standard deviations
CONFIDENT = 1.96  # standard deviations to either side that hold 95 % of a normal distribution

# residuals at K points, (P, K) -> (R, K), each in units of its own standard deviation
Residuals = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter.

    Attributes:
        name: Its name, such as ``elbow_flexor.max_velocity``.
        value: Its value, in the parameter's unit.
        low: Lower end of the interval that holds it with 95 % confidence, given the bounds,
            the data and their errors, and that the model is right.
        high: Upper end.
        bounds: What physiology allows.
        informed: Share of the prior's variance that the data took away, 0 to 1, from the width of
            the interval: near 0 the value is the prior's, near 1 the data's. The variance of a
            prior of weight w is that of the bounds over w².
        at_bound: Whether it ended on a bound.
        pushed_by: What would be met better beyond that bound; empty where that was not looked for.
    """

    name: str
    value: float
    low: float
    high: float
    bounds: tuple[float, float]
    informed: float
    at_bound: bool
    pushed_by: str = ""


@dataclass(frozen=True)
class Solution:
    """The best deviations of the free parameters and what is known of them.

    Attributes:
        deviations: Shape (P,).
        covariance: Of the deviations, shape (P, P); linear about the solution.
        jacobian: Slopes of the residuals, then of the priors, shape (R + P, P).
        cost: Half the sum of squares, priors included.
        residuals: Residuals, then those of the priors, shape (R + P,).
    """

    deviations: NDArray[np.float64]
    covariance: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    cost: float
    residuals: NDArray[np.float64]

    @property
    def ends(self) -> NDArray[np.float64]:
        """Ends of the intervals of 95 % by the covariance, in deviations, shape (P, 2)."""
        reach = CONFIDENT * np.sqrt(np.diag(self.covariance))
        return np.stack([self.deviations - reach, self.deviations + reach], axis=1)

    def estimates(
        self,
        free: Sequence[Free],
        ends: NDArray[np.float64] | None = None,
        prior: float = 1.0,
    ) -> list[Estimate]:
        """The parameters with their confidence.

        Args:
            free: The parameters; what was fitted besides, such as where a trial starts, comes
                after them in the solution.
            ends: Ends of their intervals in deviations, by default those of the covariance.
            prior: Weight that the priors had.
        """
        known = self.ends if ends is None else ends
        return [
            _estimate(item, z, low, high, prior)
            for item, z, (low, high) in zip(
                free, self.deviations.tolist(), known.tolist(), strict=False
            )
        ]


def _estimate(free: Free, deviation: float, low: float, high: float, prior: float) -> Estimate:
    spread = prior * (high - low) / (2 * CONFIDENT)
    return Estimate(
        free.name,
        free.value(deviation),
        free.value(low),
        free.value(high),
        (free.low, free.high),
        max(0.0, 1.0 - spread**2),
        abs(deviation) > DEVIATIONS - _NEAR,
    )


def with_priors(residuals: Residuals, prior: float = 1.0) -> Residuals:
    """Residuals and, after them, the deviations themselves, which the priors want to be zero."""
    return lambda points: np.concatenate([residuals(points), prior * points])


def solve(
    residuals: Residuals,
    count: int,
    progress: Callable[[float], None] | None = None,
    start: NDArray[np.float64] | None = None,
    prior: float = 1.0,
    difference: float = _DIFFERENCE,
    tolerance: float = 1e-8,
    stiffest: float = _STIFFEST,
) -> Solution:
    """Fit ``count`` free parameters.

    Args:
        residuals: What the data say; the priors are added here.
        count: P, the number of free parameters.
        progress: Called with the share done, 0 to 1, guessed from the steps so far.
        start: Deviations to start from, shape (P,); by default the middles of the bounds.
        prior: Weight of the priors.
        difference: Change of a parameter for slopes of the residuals, in standard deviations.
        tolerance: Step, in standard deviations, at which the fit has settled.
        stiffest: Regularisation at which a fit that finds nothing better ends.

    Raises:
        RuntimeError: The fit did not settle.
    """
    all_residuals = with_priors(residuals, prior)

    def report(trace: list[mujoco.minimize.IterLog]) -> None:
        if progress:
            progress(1.0 - 0.85 ** len(trace))

    bounds = [np.full(count, -DEVIATIONS), np.full(count, DEVIATIONS)]
    point, trace = mujoco.minimize.least_squares(
        np.zeros(count) if start is None else start,
        all_residuals,
        bounds,
        eps=difference,
        mu_max=stiffest,
        xtol=tolerance,
        max_iter=_ITERATIONS,
        verbose=mujoco.minimize.Verbosity.SILENT,
        iter_callback=report,
    )
    if len(trace) >= _ITERATIONS and trace[-2].reduction > _UNLIKE:
        raise RuntimeError(f"the fit did not settle in {_ITERATIONS} iterations")
    point = point.reshape(count, 1)
    found = all_residuals(point)
    jacobian, _ = mujoco.minimize.jacobian_fd(
        all_residuals, point, found, np.float64(difference), 0, [b.reshape(-1, 1) for b in bounds]
    )
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    cost = 0.5 * float((found**2).sum())
    return Solution(point[:, 0], covariance, jacobian, cost, found[:, 0])


_WIDE = 0.02  # standard deviations of a prior, over which a slope is first taken
_NARROW = 1e-4  # of these, the least


def over_uncertainty(residuals: Residuals, solution: Solution) -> Solution:
    """A solution with slopes taken over the range in which it is uncertain.

    Residuals of a simulation have kinks and small jumps, where its steps are divided otherwise.
    A slope over a much shorter range than the uncertainty shows these, and not the data.

    Args:
        residuals: What was solved.
        solution: Its solution.
    """
    evaluate = with_priors(residuals)
    point = solution.deviations
    reach = np.full(point.size, _WIDE)
    for _ in range(2):
        low = np.maximum(point - reach, -DEVIATIONS)
        high = np.minimum(point + reach, DEVIATIONS)
        found = evaluate(
            np.concatenate([np.diag(end - point) for end in (low, high)], axis=1) + point[:, None]
        )
        jacobian = (found[:, point.size :] - found[:, : point.size]) / (high - low)
        covariance = np.linalg.inv(jacobian.T @ jacobian)
        reach = np.maximum(np.sqrt(np.diag(covariance)), _NARROW)
    return replace(solution, covariance=covariance, jacobian=jacobian)


_RISE = 0.5 * CONFIDENT**2  # of the cost, at the end of an interval
_STRETCH = 1.5  # by which an end is moved at a time
_STRETCHES = 8
_CORRECTIONS = 6  # of the other parameters, at each place

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class _Place:
    """A place in the space of parameters, on the way to one end of one interval.

    Attributes:
        index: The parameter whose end is looked for.
        side: 0 for the lower end, 1 for the upper.
        before: Deviations at the place before this one, shape (P,).
        point: Deviations here, shape (P,).
        found: Residuals here, shape (R,).
        bends: Rank-one changes of the solution's Jacobian, as shapes (R,) and (P,).
    """

    index: int
    side: int
    before: _Values
    point: _Values
    found: _Values
    bends: tuple[tuple[_Values, _Values], ...] = ()

    @property
    def cost(self) -> float:
        """Half the sum of squares."""
        return 0.5 * float(self.found @ self.found)


def intervals(residuals: Residuals, solution: Solution, count: int, prior: float = 1.0) -> _Values:
    """Ends of the intervals of 95 % of the first parameters, in deviations, shape (count, 2).

    Never narrower than those of the covariance.

    Args:
        residuals: What was solved.
        solution: Its solution.
        count: Number of parameters whose intervals are wanted.
        prior: Weight of the priors.
    """
    evaluate = with_priors(residuals, prior)
    ends = solution.ends[:count]
    origin = solution.deviations
    start = evaluate(origin[:, None])[:, 0]
    level = 0.5 * float(start @ start) + _RISE
    places = []
    for index, side in np.argwhere(np.abs(ends) < DEVIATIONS).tolist():
        # the others follow as the covariance says
        way = solution.covariance[:, index] / solution.covariance[index, index]
        end = origin + way * (ends[index, side] - origin[index])
        places.append(_Place(index, side, origin, end, start))
    for stretch in range(_STRETCHES if places else 0):
        tried = [_further(place, origin) for place in places]
        reached = _corrected(evaluate, solution, start, tried)
        going = []
        for place, new in zip(places, reached, strict=True):
            if new.cost < level:
                ends[new.index, new.side] = new.point[new.index]
                if abs(new.point[new.index]) < DEVIATIONS:
                    going.append(new)
            elif stretch:
                ends[new.index, new.side] = _between(place, new, level)
        if not going:
            break
        places = going
    return ends


def _further(place: _Place, origin: _Values) -> _Place:
    """Straight on from a place, to where the next end is tried."""
    index = place.index
    way = place.point - place.before
    target = origin[index] + _STRETCH * (place.point[index] - origin[index])
    target = min(max(target, -DEVIATIONS), DEVIATIONS)
    point = place.point + (target - place.point[index]) / way[index] * way
    point = np.clip(point, -DEVIATIONS, DEVIATIONS)
    point[index] = target
    return replace(place, before=place.point, point=point)


def _corrected(
    evaluate: Residuals, solution: Solution, start: _Values, places: Sequence[_Place]
) -> list[_Place]:
    """Places with the other parameters improved, by Gauss-Newton with Broyden's Jacobians."""
    best: list[_Place] = []
    tried = [place.point for place in places]
    for _ in range(_CORRECTIONS + 1):
        found = evaluate(np.stack(tried, axis=1)).T
        now = []
        for k, (point, values) in enumerate(zip(tried, found, strict=True)):
            # the first is seen from the solution, where the Jacobian is known
            last = best[k] if best else replace(places[k], point=solution.deviations, found=start)
            change = point - last.point
            off = values - last.found - _times(solution.jacobian, last.bends, change)
            length = float(change @ change)
            bends = last.bends if length == 0 else (*last.bends, (off / length, change))
            new = replace(places[k], point=point, found=values, bends=bends)
            now.append(new if not best or new.cost < last.cost else replace(last, bends=bends))
        best = now
        tried = [_improved(solution.jacobian, place) for place in best]
    return [replace(place, bends=()) for place in best]


def _times(jacobian: _Values, bends: Sequence[tuple[_Values, _Values]], change: _Values) -> _Values:
    product = jacobian @ change
    for left, right in bends:
        product = product + left * float(right @ change)
    return np.asarray(product)


def _improved(jacobian: _Values, place: _Place) -> _Values:
    """A point with less cost, were the residuals linear; the parameter in question is kept."""
    others = np.delete(np.arange(place.point.size), place.index)
    bent = jacobian[:, others]
    for left, right in place.bends:
        bent = bent + np.outer(left, right[others])
    point = place.point.copy()
    # by the normal equations: fast, and exact enough for a step that counts only if it helps
    point[others] -= np.linalg.lstsq(bent.T @ bent, bent.T @ place.found, rcond=None)[0]
    return np.clip(point, -DEVIATIONS, DEVIATIONS)


def _between(inside: _Place, outside: _Place, level: float) -> float:
    """Where the cost comes to the level between two places, if it is a parabola."""
    a, b = inside.point[inside.index], outside.point[outside.index]
    low, high, wanted = (
        np.sqrt(max(cost - (level - _RISE), 0.0)) for cost in (inside.cost, outside.cost, level)
    )
    return float(a + (b - a) * (wanted - low) / (high - low))


@dataclass(frozen=True)
class Identified:
    """A joint with its free parameters fitted.

    Attributes:
        joint: The fitted joint.
        free: The parameters that were free.
        estimates: Their values and confidence, in the same order.
        predictions: What the fitted joint does in each measurement, see ``Prediction``; none for
            a fit to the literature.
        pinned: Parameters that were fixed, and their values.
        start: How the joint started a step of Table 2, ``relaxed`` or ``held``.
        held_back: For each piece of published evidence, what gets worse where it is met better.
        delay: By how much the excitations act later than measured [s], if that was fitted.
    """

    joint: Joint
    free: tuple[Free, ...]
    estimates: tuple[Estimate, ...]
    predictions: tuple[Any, ...] = ()
    pinned: tuple[tuple[Free, float], ...] = ()
    start: str = "relaxed"
    held_back: Mapping[str, str] = field(default_factory=dict)
    delay: Estimate | None = None

    @property
    def all_estimates(self) -> tuple[Estimate, ...]:
        """The estimates, with that of the delay."""
        return self.estimates if self.delay is None else (*self.estimates, self.delay)

    def __str__(self) -> str:
        """A line for each parameter: value, interval of 95 % confidence, share from the data.

        Then one for each note on a measurement.
        """
        lines = [f"{self.joint.name}, fitted: value, 95 % interval, share from the data"]
        for one in self.all_estimates:
            lines.append(
                f"{one.name}: {one.value:.4g}, {one.low:.3g} to {one.high:.3g}, {one.informed:.0%}"
            )
        for prediction in self.predictions:
            source = prediction.measurement.source
            lines += [f"note: {source}: {note}" for note in prediction.notes]
        return "\n".join(lines)
