"""Bounded least squares with priors, and how sure its answer is.

The solver is ``mujoco.minimize``, Gauss-Newton with box bounds, which asks for many points at
once: all the simulations of a Jacobian run as one batch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco.minimize
import numpy as np
from numpy.typing import NDArray

from mjhill.identification.free import DEVIATIONS, Free

_DIFFERENCE = 1e-5  # of a parameter, in its standard deviations, for derivatives
_ITERATIONS = 200
_NEAR = 1e-6  # of a bound, in standard deviations

# residuals at K points, (P, K) -> (R, K), each in units of its own standard deviation
Residuals = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter.

    Attributes:
        name: Its name, such as ``elbow_flexor.max_velocity``.
        value: Its value, in the parameter's unit.
        low: Lower end of the interval that holds it with 95 % confidence, given the bounds,
            the data and their stated errors.
        high: Upper end.
        bounds: What physiology allows.
        informed: Share of the prior's variance that the data took away, 0 to 1: near 0 the value
            is the prior's, near 1 the data's.
        at_bound: Whether it ended on a bound.
    """

    name: str
    value: float
    low: float
    high: float
    bounds: tuple[float, float]
    informed: float
    at_bound: bool


@dataclass(frozen=True)
class Solution:
    """The best deviations of the free parameters and what is known of them.

    Attributes:
        deviations: Shape (P,).
        covariance: Of the deviations, shape (P, P); linear about the solution.
        cost: Half the sum of squares, priors included.
    """

    deviations: NDArray[np.float64]
    covariance: NDArray[np.float64]
    cost: float

    def estimates(self, free: Sequence[Free]) -> list[Estimate]:
        """The parameters with their confidence."""
        spreads = np.sqrt(np.diag(self.covariance)).tolist()
        known = zip(self.deviations.tolist(), spreads, strict=True)
        # what was fitted besides, such as where a trial starts, comes after the parameters
        return [_estimate(item, z, spread) for item, (z, spread) in zip(free, known, strict=False)]


def _estimate(free: Free, deviation: float, spread: float) -> Estimate:
    return Estimate(
        free.name,
        free.value(deviation),
        free.value(deviation - 1.96 * spread),
        free.value(deviation + 1.96 * spread),
        (free.low, free.high),
        max(0.0, 1.0 - spread**2),
        abs(deviation) > DEVIATIONS - _NEAR,
    )


def solve(
    residuals: Residuals,
    count: int,
    progress: Callable[[float], None] | None = None,
    start: NDArray[np.float64] | None = None,
) -> Solution:
    """Fit ``count`` free parameters.

    Args:
        residuals: What the data say; the priors are added here.
        count: P, the number of free parameters.
        progress: Called with the share done, 0 to 1, guessed from the steps so far.
        start: Deviations to start from, shape (P,); by default the middles of the bounds.

    Raises:
        RuntimeError: The solver stopped short of an optimum.
    """

    def all_residuals(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([residuals(points), points])

    def report(trace: list[mujoco.minimize.IterLog]) -> None:
        if progress:
            progress(1.0 - 0.85 ** len(trace))

    bounds = [np.full(count, -DEVIATIONS), np.full(count, DEVIATIONS)]
    point, trace = mujoco.minimize.least_squares(
        np.zeros(count) if start is None else start,
        all_residuals,
        bounds,
        eps=_DIFFERENCE,
        max_iter=_ITERATIONS,
        verbose=mujoco.minimize.Verbosity.SILENT,
        iter_callback=report,
    )
    if len(trace) >= _ITERATIONS:
        raise RuntimeError(f"the fit did not settle in {_ITERATIONS} iterations")
    point = point.reshape(count, 1)
    found = all_residuals(point)
    jacobian, _ = mujoco.minimize.jacobian_fd(
        all_residuals, point, found, np.float64(_DIFFERENCE), 0, [b.reshape(-1, 1) for b in bounds]
    )
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    return Solution(point[:, 0], covariance, 0.5 * float((found**2).sum()))
