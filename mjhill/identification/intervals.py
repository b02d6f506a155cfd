"""Intervals of confidence where a fit is too bent for its covariance to tell them.

The covariance knows the residuals at the solution only. Where they bend, as where a muscle at rest
begins to matter, values far outside its interval can agree with the data as well, once the other
parameters follow. So each end is moved outwards as long as such values are found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.free import DEVIATIONS
from mjhill.identification.solve import CONFIDENT, Residuals, Solution, with_priors

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


def intervals(residuals: Residuals, solution: Solution, count: int) -> _Values:
    """Ends of the intervals of 95 % of the first parameters, in deviations, shape (count, 2).

    Never narrower than those of the covariance.

    Args:
        residuals: What was solved.
        solution: Its solution.
        count: Number of parameters whose intervals are wanted.
    """
    evaluate = with_priors(residuals)
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
    point[others] -= np.linalg.lstsq(bent, place.found, rcond=None)[0]
    return np.clip(point, -DEVIATIONS, DEVIATIONS)


def _between(inside: _Place, outside: _Place, level: float) -> float:
    """Where the cost comes to the level between two places, if it is a parabola."""
    a, b = inside.point[inside.index], outside.point[outside.index]
    low, high, wanted = (
        np.sqrt(max(cost - (level - _RISE), 0.0)) for cost in (inside.cost, outside.cost, level)
    )
    return float(a + (b - a) * (wanted - low) / (high - low))
