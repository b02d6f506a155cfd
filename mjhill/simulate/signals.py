"""Inputs as functions of time: constants, steps, pulses, sinusoids and their sums."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True)
class _Constant:
    level: float

    def __call__(self, time: float) -> float:
        return self.level


@dataclass(frozen=True)
class _Step:
    level: float
    start: float

    def __call__(self, time: float) -> float:
        return self.level if time >= self.start else 0.0


@dataclass(frozen=True)
class _Pulse:
    level: float
    start: float
    end: float

    def __call__(self, time: float) -> float:
        return self.level if self.start <= time < self.end else 0.0


@dataclass(frozen=True)
class _Sinusoid:
    amplitude: float
    frequency: float
    phase: float

    def __call__(self, time: float) -> float:
        return self.amplitude * math.sin(2 * math.pi * self.frequency * time + self.phase)


@dataclass(frozen=True)
class _Sum:
    parts: tuple[Callable[[float], float], ...]  # flat, so that a long train is not deeply nested

    def __call__(self, time: float) -> float:
        first, *others = self.parts
        total = first(time)
        for part in others:
            total += part(time)
        return total


@dataclass(frozen=True)
class _Multiple:
    factor: float
    value: Callable[[float], float]

    def __call__(self, time: float) -> float:
        return self.factor * self.value(time)


@dataclass(frozen=True)
class Signal:
    """A scalar input that knows where it jumps.

    The reference solver restarts at ``breaks``, so a jump is never stepped over. Signals made by
    the functions of this module, their sums and multiples can be compared, hashed, copied and
    pickled; one made of a function of yours as far as that function can.

    Attributes:
        value: The input as a function of time [s].
        breaks: Times [s] at which the value or its slope is discontinuous, ascending.
    """

    value: Callable[[float], float]
    breaks: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Keep the breaks as a tuple."""
        object.__setattr__(self, "breaks", tuple(self.breaks))

    def __call__(self, time: float) -> float:
        """The value at ``time`` [s]; at a jump, the value after it."""
        return self.value(time)

    def __add__(self, other: Self | float) -> Signal:
        """The sum of two signals, or of a signal and a constant."""
        second = as_signal(other)
        breaks = tuple(sorted({*self.breaks, *second.breaks}))
        parts = self.value.parts if isinstance(self.value, _Sum) else (self.value,)
        return Signal(_Sum((*parts, second.value)), breaks)

    __radd__ = __add__

    def __mul__(self, factor: float) -> Signal:
        """The signal scaled by a constant."""
        return Signal(_Multiple(factor, self.value), self.breaks)

    __rmul__ = __mul__


def constant(level: float) -> Signal:
    """The same ``level`` at all times."""
    _check_finite("level", level)
    return Signal(_Constant(level))


def step(level: float, start: float = 0.0) -> Signal:
    """0 before ``start`` [s], ``level`` from then on."""
    _check_finite("level", level)
    _check_finite("start", start)
    return Signal(_Step(level, start), (start,))


def pulse(level: float, start: float, width: float) -> Signal:
    """``level`` from ``start`` [s] for ``width`` [s], 0 elsewhere.

    Raises:
        ValueError: ``width`` is not positive, or an argument is not finite.
    """
    _check_finite("level", level)
    _check_finite("start", start)
    _check_positive("width", width)
    end = start + width
    return Signal(_Pulse(level, start, end), (start, end))


def sinusoid(amplitude: float, frequency: float, phase: float = 0.0) -> Signal:
    """``amplitude * sin(2 pi frequency t + phase)``; frequency [Hz], phase [rad].

    Raises:
        ValueError: ``frequency`` is not positive, or an argument is not finite.
    """
    _check_finite("amplitude", amplitude)
    _check_finite("phase", phase)
    _check_positive("frequency", frequency)
    return Signal(_Sinusoid(amplitude, frequency, phase))


def as_signal(value: Signal | float) -> Signal:
    """A number as a constant signal; a signal as it is.

    Raises:
        TypeError: ``value`` is neither a signal nor a number.
        ValueError: ``value`` is not finite.
    """
    if isinstance(value, Signal):
        return value
    if isinstance(value, (int, float)):
        return constant(float(value))
    raise TypeError(
        f"an input must be a number or a mjhill.Signal, got {type(value).__name__}; "
        "wrap a function of time as mjhill.Signal(function, breaks=(...))"
    )


def as_signals(
    inputs: Mapping[str, Signal | float], known: Iterable[str], what: str
) -> dict[str, Signal]:
    """Signals by name, each name checked against the ``known`` ones.

    Raises:
        ValueError: A name is unknown, or a constant is not finite.
        TypeError: A value is neither a signal nor a number.
    """
    names = list(known)
    for name in inputs:
        if name not in names:
            raise ValueError(f"unknown {what} {name!r}; there are: {', '.join(names) or 'none'}")
    return {name: as_signal(value) for name, value in inputs.items()}


def _check_finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise ValueError(f"{name} must be finite, got {value}")


def _check_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name} must be positive and finite, got {value}")
