"""Frequency responses: gain, phase and coherence, and their second-order fits.

Frequencies are in Hz. Phases are in rad, negative if the output is late. A gain is in units of the
output over units of the input.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log10, pi, radians
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.analysis.responses import SecondOrder

_Values = NDArray[np.float64]
_WIDEST = 1e3  # largest factor of a natural frequency from the band, of a damping ratio from 1
_DAMPING_STARTS = (0.3, 1.0, 3.0)  # the misfit can have several minima


@dataclass(frozen=True)
class Response:
    """Response to one sinusoid.

    Attributes:
        gain: Amplitude of the output over that of the input.
        phase: Phase of the output minus that of the input, in (-π, π] [rad].
        coherence: Share of the output's variance about a straight line that is at the driving
            frequency, times the same share of the input [-]. The rest is distortion. (Coherence
            from spectra averaged over segments would be 1 for any periodic response.)
    """

    gain: float
    phase: float
    coherence: float


@dataclass(frozen=True)
class SecondOrderFrequency:
    """The response ``gain / (1 - r² + 2 i ζ r)``, r the frequency over the natural frequency.

    Attributes:
        gain: Gain at frequency 0.
        natural_frequency: Undamped natural frequency [Hz].
        damping_ratio: ζ [-].
    """

    gain: float
    natural_frequency: float
    damping_ratio: float

    def response(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Complex response at frequencies [Hz]."""
        ratio = np.asarray(frequency, dtype=np.float64) / self.natural_frequency
        return np.asarray(self.gain / (1.0 - ratio**2 + 2j * self.damping_ratio * ratio))

    def errors(
        self, frequency: ArrayLike, gain: ArrayLike, phase: ArrayLike
    ) -> tuple[_Values, _Values]:
        """Measured gains [dB] and phases [rad] minus those of the fit."""
        ratio = _complex(gain, phase) / self.response(frequency)
        return 20 * np.log10(np.abs(ratio)), np.angle(ratio)


def response_at(time: _Values, source: _Values, output: _Values, frequency: float) -> Response:
    """Gain, phase and coherence at one frequency, over the last whole cycles of a record.

    A straight line is fitted together with the sinusoid, so that a slow drift does no harm.

    Args:
        time: Evenly spaced sample times after the transient [s], shape (T,).
        source: The input signal, shape (T,).
        output: The output signal, shape (T,).
        frequency: The driving frequency [Hz].

    Raises:
        ValueError: The record is shorter than a cycle, has fewer than four samples a cycle, or the
            input does not contain the frequency.
    """
    step = float(time[1] - time[0])
    cycles = int(len(time) * step * frequency + 1e-6)
    if cycles < 1 or step * frequency > 0.25:
        raise ValueError(
            f"a response at {frequency:g} Hz needs at least one cycle and four samples in it, got "
            f"{len(time)} samples every {step:g} s"
        )
    last = slice(len(time) - round(cycles / (frequency * step)), None)
    turning = 2 * pi * frequency * time[last]
    line = np.stack([np.ones_like(turning), time[last] - time[last].mean()], axis=1)
    basis = np.column_stack([np.cos(turning), np.sin(turning), line])
    (cause, cause_share), (effect, effect_share) = (
        _component(basis, values[last]) for values in (source, output)
    )
    if abs(cause) <= 1e-12 * float(np.abs(source).max(initial=0.0)):
        raise ValueError(f"the input signal does not contain {frequency:g} Hz")
    ratio = effect / cause
    return Response(abs(ratio), float(np.angle(ratio)), cause_share * effect_share)


def fit_second_order(
    frequency: ArrayLike, gain: ArrayLike, phase: ArrayLike
) -> SecondOrderFrequency:
    """The second-order response nearest to measured gains and phases.

    Least squares on the logarithm of the complex response, in which 1 dB counts as much as 6.6°.

    Args:
        frequency: [Hz], shape (F,), at least two.
        gain: Shape (F,), positive.
        phase: [rad], shape (F,), wrapped or not.

    Raises:
        ValueError: There are fewer than two frequencies, or a frequency or gain is not positive.
    """
    from scipy.optimize import least_squares

    band, gains = np.asarray(frequency, dtype=np.float64), np.asarray(gain, dtype=np.float64)
    if band.ndim != 1 or len(band) < 2 or not (band.min() > 0 and gains.min() > 0):
        raise ValueError(
            "a second-order fit needs at least two frequencies, all positive like the gains, got "
            f"frequencies {band.tolist()} and gains {gains.tolist()}"
        )
    measured, top = _complex(gains, phase), float(gains[band.argmin()])
    middle, wide = float(np.exp(np.log(band).mean())), np.log(_WIDEST)
    bounds = (
        [-np.inf, np.log(band.min()) - wide, -wide],
        [np.inf, np.log(band.max()) + wide, wide],
    )

    def misfit(point: _Values) -> _Values:
        ratio = measured / SecondOrderFrequency(*np.exp(point).tolist()).response(band)
        return np.concatenate([np.log(np.abs(ratio)), np.angle(ratio)])

    fits = [
        least_squares(misfit, np.log([top, middle, ratio]), bounds=bounds)
        for ratio in _DAMPING_STARTS
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return SecondOrderFrequency(*np.exp(best.x).tolist())


def fit_compliance(frequency: ArrayLike, compliance: ArrayLike) -> tuple[SecondOrder, float]:
    """Inertia, viscosity and stiffness whose compliance is nearest in least squares.

    By Parseval's theorem this is the fit to an impulse response that has these frequencies alone
    (Weiss, Hunter & Kearney 1988, J. Biomech. 21:539, abstract).

    Args:
        frequency: Evenly spaced [Hz], shape (F,), at least two.
        compliance: Deflection over torque [rad/(N·m)], complex, shape (F,).

    Returns:
        The system, whose numbers may be negative, and the share of the variance of the compliance
        that it accounts for [-].
    """
    from scipy.optimize import least_squares  # takes long to import

    s = 2j * pi * np.asarray(frequency, dtype=np.complex128)
    terms: NDArray[Any] = np.stack([np.ones_like(s), s, s**2], axis=1)
    scale = float(np.abs(compliance).max())
    measured: NDArray[Any] = np.asarray(compliance) / scale

    def parts(values: NDArray[Any]) -> _Values:
        return np.concatenate([values.real, values.imag])

    def misfit(point: _Values) -> _Values:
        return parts(1 / (terms @ point) - measured)

    def slopes(point: _Values) -> _Values:
        return parts(-terms / (terms @ point)[:, np.newaxis] ** 2)

    # linear problems nearby: least error of stiffness, relative and carried over to compliance;
    # the misfit can have two minima
    weights = np.abs(measured), np.abs(measured) ** 2
    fits = []
    for weight in weights:
        weighted = parts(terms * weight[:, np.newaxis])
        start, *_ = np.linalg.lstsq(weighted, parts(weight / measured), rcond=None)
        fits.append(least_squares(misfit, start, jac=slopes, method="lm", x_scale="jac"))
    best = min(fits, key=lambda fit: float(fit.cost))
    stiffness, damping, inertia = (best.x / scale).tolist()
    explained = 1.0 - 2 * float(best.cost) / float(np.sum(np.abs(measured) ** 2))
    return SecondOrder(stiffness, damping, inertia), explained


def second_order_band(
    frequency: ArrayLike,
    gain: ArrayLike,
    phase: ArrayLike,
    *,
    decibels: float = 3.0,
    degrees: float = 30.0,
) -> tuple[SecondOrderFrequency, float]:
    """The widest band, starting at the lowest frequency, that one second-order fit describes.

    Args:
        frequency: [Hz], shape (F,), ascending, at least four.
        gain: Shape (F,).
        phase: [rad], shape (F,).
        decibels: Largest error of a gain in the band [dB].
        degrees: Largest error of a phase in the band [°].

    Returns:
        The fit and the highest frequency of its band [Hz]. If there is no such band: the fit to
        the first three frequencies, and 0.
    """
    band, gains, phases = (np.asarray(x, dtype=np.float64) for x in (frequency, gain, phase))
    kept, highest = fit_second_order(band[:3], gains[:3], phases[:3]), 0.0
    # three parameters always fit fewer than three frequencies
    for count in range(3, len(band) + 1):
        part = slice(0, count)
        fit = fit_second_order(band[part], gains[part], phases[part])
        gain_errors, phase_errors = fit.errors(band[part], gains[part], phases[part])
        fits = np.abs(gain_errors).max() <= decibels and np.abs(phase_errors).max() <= radians(
            degrees
        )
        if not fits:
            break
        kept, highest = fit, float(band[count - 1])
    return kept, highest


def decibel(gain: ArrayLike, reference: float = 1.0) -> _Values:
    """Gains in dB relative to a reference."""
    return 20 * np.log10(np.asarray(gain, dtype=np.float64)) - 20 * log10(reference)


def octaves(low: float, high: float, per_octave: int = 3) -> _Values:
    """Frequencies [Hz] from ``low`` to ``high``, both included, evenly spaced on a log scale.

    Raises:
        ValueError: The band is empty or not positive.
    """
    if not 0 < low < high:
        raise ValueError(f"a band of frequencies needs 0 < low < high, got {low} and {high} Hz")
    return np.geomspace(low, high, max(2, round(per_octave * np.log2(high / low)) + 1))


def _component(basis: _Values, values: _Values) -> tuple[complex, float]:
    """Complex amplitude of cos and sin in ``values``, and their share of the variance.

    The other columns of ``basis`` span the straight line about which the variance is taken.
    """
    found, *_ = np.linalg.lstsq(basis, values, rcond=None)
    line = basis[:, 2:]
    about, *_ = np.linalg.lstsq(line, values, rcond=None)
    variance = float(np.var(values - line @ about))
    left = float(np.var(values - basis @ found))
    share = 1.0 - left / variance if variance > 0 else 0.0
    return complex(found[0], -found[1]), share


def _complex(gain: ArrayLike, phase: ArrayLike) -> NDArray[np.complex128]:
    turned = np.exp(1j * np.asarray(phase, dtype=np.float64))
    return np.asarray(np.asarray(gain, dtype=np.float64) * turned)
