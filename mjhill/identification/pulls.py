"""What pulls a fit: which evidence keeps it from other evidence, or pushes it to a bound.

A fit is a balance. Seen from its solution, where residuals are nearly linear, the step that would
meet one piece of evidence makes others worse; the one that gets worse the most holds it back.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

_LEAST = 0.05  # share of the largest pull, below which one is not named
_NAMED = 2

_Values = NDArray[np.float64]


def held_back(
    labels: Sequence[str], residuals: _Values, jacobian: _Values, fixed: Iterable[int]
) -> dict[str, str]:
    """For each piece of evidence, what gets worse the most where it is met better.

    Args:
        labels: What each residual is about, R of them; several may have one label.
        residuals: At the solution, shape (R,).
        jacobian: Their slopes there, shape (R, P).
        fixed: Columns of parameters that cannot move, as they are on a bound.
    """
    slopes = np.delete(jacobian, list(fixed), axis=1)
    covariance = np.linalg.pinv(slopes.T @ slopes)
    found = {}
    for label in dict.fromkeys(labels):
        own = np.array([one == label for one in labels])
        step = -covariance @ (slopes[own].T @ residuals[own])
        worse = residuals * (slopes @ step)
        found[label] = _largest(labels, np.where(own, 0.0, worse))
    return found


def pushed(labels: Sequence[str], residuals: _Values, slopes: _Values, upper: bool) -> str:
    """What would be met better with a parameter beyond its bound.

    Args:
        labels: What each residual is about.
        residuals: At the solution, shape (R,).
        slopes: Of the residuals with the parameter, shape (R,).
        upper: Whether it is the upper bound.
    """
    better = -residuals * slopes
    return _largest(labels, better if upper else -better)


def _largest(labels: Sequence[str], amounts: _Values) -> str:
    sums = dict.fromkeys(labels, 0.0)
    for label, amount in zip(labels, amounts.tolist(), strict=True):
        sums[label] += amount
    order = sorted(sums, key=lambda label: -sums[label])[:_NAMED]
    least = max(_LEAST * sums[order[0]], 0.0)
    return "; ".join(label for label in order if sums[label] > least)
