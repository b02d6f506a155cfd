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
            the interval: near 0 the value is the prior's, near 1 the data's.
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
        jacobian: Slopes of the residuals, then of the priors, shape (R + P, P).
        cost: Half the sum of squares, priors included.
    """

    deviations: NDArray[np.float64]
    covariance: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    cost: float

    @property
    def ends(self) -> NDArray[np.float64]:
        """Ends of the intervals of 95 % by the covariance, in deviations, shape (P, 2)."""
        reach = CONFIDENT * np.sqrt(np.diag(self.covariance))
        return np.stack([self.deviations - reach, self.deviations + reach], axis=1)

    def estimates(
        self, free: Sequence[Free], ends: NDArray[np.float64] | None = None
    ) -> list[Estimate]:
        """The parameters with their confidence.

        Args:
            free: The parameters; what was fitted besides, such as where a trial starts, comes
                after them in the solution.
            ends: Ends of their intervals in deviations, by default those of the covariance.
        """
        known = self.ends if ends is None else ends
        return [
            _estimate(item, z, low, high)
            for item, z, (low, high) in zip(
                free, self.deviations.tolist(), known.tolist(), strict=False
            )
        ]


def _estimate(free: Free, deviation: float, low: float, high: float) -> Estimate:
    spread = (high - low) / (2 * CONFIDENT)
    return Estimate(
        free.name,
        free.value(deviation),
        free.value(low),
        free.value(high),
        (free.low, free.high),
        max(0.0, 1.0 - spread**2),
        abs(deviation) > DEVIATIONS - _NEAR,
    )


def with_priors(residuals: Residuals) -> Residuals:
    """Residuals and, after them, the deviations themselves, which the priors want to be zero."""
    return lambda points: np.concatenate([residuals(points), points])


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
        RuntimeError: The fit did not settle.
    """
    all_residuals = with_priors(residuals)

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
    return Solution(point[:, 0], covariance, jacobian, 0.5 * float((found**2).sum()))
