"""What a fit takes for noise: its size, and how much of it hangs together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_LEAST = 1e-4  # of the spread of what is predicted: no simulation is nearer to a joint
_WINDOW = 5.0  # correlation times over which the autocorrelation of residuals is summed
_DIFFERENCES = 4  # of samples, after which next to nothing but noise is left of a smooth signal
_ROUNDS = 20  # in which the noise of the output is told from that of the input
_NOTHING = 1e-10  # of the largest variance
_NORMAL = 0.6745  # median of the size of a standard normal number

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Noise:
    """The noise of T residuals: white, and what a noisy input adds.

    Attributes:
        scale: Weight of a residual, one over the standard deviation of the white noise.
        basis: Orthonormal shapes in which the input's noise appears, shape (T, K).
        shares: Share by which the residuals shrink along each, shape (K,).
        together: Number of residuals that count as one, as they hang together.
    """

    scale: float
    basis: _Values
    shares: _Values
    together: float = 1.0

    def whiten(self, residuals: _Values) -> _Values:
        """Residuals in units of their standard deviations, independent, shape (..., T)."""
        along = residuals @ self.basis
        return np.asarray(self.scale * (residuals - (along * self.shares) @ self.basis.T))


def white(scale: float, count: int) -> Noise:
    """White noise alone, of T residuals."""
    return Noise(scale, np.zeros((count, 0)), np.zeros(0))


def noise_of(left: _Values, errors: _Values, parameters: float, spread: float) -> Noise:
    """The noise that residuals show.

    White noise of the output and the effect of that of the input are told apart by the size of
    the latter. Residuals that hang together still count as fewer: as many as there are
    correlation times in them.

    Args:
        left: The residuals, shape (T,).
        errors: What each of K independent disturbances of the input adds to them, each of its
            standard deviation, shape (T, K).
        parameters: Number of parameters that were fitted.
        spread: Largest less smallest of what is predicted, in the unit of the residuals.
    """
    count = max(left.size - parameters, 0.5 * left.size)
    basis, sizes = _shapes(errors)
    noise = np.inf
    for _ in range(_ROUNDS):
        before = noise
        shares = 1.0 - 1.0 / np.hypot(1.0, sizes / noise) if noise < np.inf else 0.0 * sizes
        rest = Noise(1.0, basis, shares).whiten(left)
        noise = max(float(np.sqrt(rest @ rest / count)), _LEAST * spread)
        if abs(noise - before) < 1e-3 * noise:
            break
    together = correlation_time(rest)
    return Noise(1.0 / (noise * float(np.sqrt(together))), basis, shares, together)


def _shapes(errors: _Values) -> tuple[_Values, _Values]:
    """Orthonormal shapes, (T, K), and sizes, (K,), of errors; those of no size are left out."""
    squares, turned = np.linalg.eigh(errors.T @ errors)
    kept = squares > _NOTHING * squares.max(initial=0.0)
    sizes = np.sqrt(squares[kept])
    return errors @ turned[:, kept] / sizes, sizes


def correlation_time(left: _Values) -> float:
    """Number of residuals that are worth one, at least 1, from their autocorrelation.

    1 + 2 (r1 + r2 + ...), r the correlation from sample to sample, to the next but one, and so on,
    summed over a window of five times the result (Sokal 1997, sect. 3). Unlike the correlation of
    neighbours alone, it does not depend on how finely a smooth disturbance was sampled.
    """
    power = np.abs(np.fft.rfft(left, 2 * left.size)) ** 2
    covariance = np.fft.irfft(power)[: left.size]
    if not covariance[0] > 0:
        return 1.0
    times = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
    inside = np.arange(left.size) < _WINDOW * times
    window = left.size - 1 if inside.all() else int(np.argmin(inside))
    return max(float(times[window]), 1.0)


def white_noise(values: _Values) -> float:
    """Standard deviation of the white noise in samples of a signal, shape (T,), in its unit.

    From the median of their fourth differences. It is 0 if most of them are 0, as in a signal of
    plateaus that was not measured but set.
    """
    differences = np.diff(values, _DIFFERENCES)
    power = float(sum(c**2 for c in np.poly1d([1, -1]) ** _DIFFERENCES))  # of their variance
    return float(np.median(np.abs(differences))) / (_NORMAL * float(np.sqrt(power)))
