"""Step responses as those of an overdamped second-order system (the paper's eqs. 1-2, Table 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_Values = NDArray[np.float64]
_EQUAL = 1e-4  # relative difference below which two time constants are taken as one
_STARTS = (0.4, 0.9)  # of the ratio; the misfit can have two minima


@dataclass(frozen=True)
class SecondOrderStep:
    """A second-order system's answer to a step: magnitude and two real time constants.

    Attributes:
        magnitude: MAG, where the response ends [unit of the response].
        time_constants: T1 >= T2 [s].
        misfit: Root mean square of what the fit leaves, as a share of the magnitude [-].
    """

    magnitude: float
    time_constants: tuple[float, float]
    misfit: float

    @property
    def duration(self) -> float:
        """T1 + T2 [s], the mean delay of the response, which a fit finds reliably."""
        return sum(self.time_constants)


def step_response(time: _Values, slow: float, fast: float) -> _Values:
    """Response of a unit second-order system with two real time constants [s], from 0 to 1."""
    if slow - fast <= _EQUAL * slow:
        scaled = time / (0.5 * (slow + fast))
        return np.asarray(1.0 - (1.0 + scaled) * np.exp(-scaled))
    parts = slow * np.exp(-time / slow) - fast * np.exp(-time / fast)
    return np.asarray(1.0 - parts / (slow - fast))


def fit_step(time: _Values, response: _Values) -> SecondOrderStep:
    """The overdamped second-order step response nearest to ``response`` in least squares.

    Args:
        time: Sample times [s], shape (T,), from 0.
        response: Deviation from the start, shape (T,), long enough to settle.

    Raises:
        ValueError: The response ends where it starts.
    """
    from scipy.optimize import least_squares

    end = float(response[-1])
    if end == 0:
        raise ValueError("the response ends where it starts, so there is no step to fit")
    share = response / end

    def model(point: _Values) -> tuple[_Values, float]:
        unit = step_response(time, *_constants(point))
        return unit, float(unit @ share / (unit @ unit))

    def misfit(point: _Values) -> _Values:
        unit, magnitude = model(point)
        return magnitude * unit - share

    delay = max(float(np.trapezoid(1.0 - share, time)), 1e-3)
    fits = [
        least_squares(
            misfit, [delay, ratio], bounds=([1e-5, 1e-4], [np.inf, 1.0]), x_scale=[delay, 1]
        )
        for ratio in _STARTS
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    _, magnitude = model(best.x)
    misfit_rms = float(np.sqrt(2 * best.cost / len(time)) / abs(magnitude))
    return SecondOrderStep(magnitude * end, _constants(best.x), misfit_rms)


def _constants(point: _Values) -> tuple[float, float]:
    """T1 and T2 from their sum and 4 T1 T2 over its square, which is 1 where they are equal."""
    total, ratio = point.tolist()
    root = float(np.sqrt(1.0 - ratio))
    return 0.5 * total * (1.0 + root), 0.5 * total * (1.0 - root)
