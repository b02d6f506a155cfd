"""Numbers as a reader wants them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

_DIGITS = 4  # significant
_PLAIN = (1e-3, 1e5)  # sizes that are written without a power of ten
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MINUS, _TIMES, _THIN = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}", "\N{NARROW NO-BREAK SPACE}"
_ALIKE = 0.005  # a difference that is not worth a word [-]
_FACTOR = 3.0  # from which on a ratio says more than per cent


def number(value: float) -> str:
    """A number to four digits: ``12.35``, ``−0.5``, ``1.7 × 10⁻⁵``."""
    value = float(value)
    if value == 0:
        return "0"
    exponent = ""
    if not _PLAIN[0] <= abs(value) < _PLAIN[1]:
        mantissa, _, power = f"{value:.{_DIGITS - 1}e}".partition("e")
        value = float(mantissa)
        exponent = f"{_THIN}{_TIMES}{_THIN}10{str(int(power)).translate(_SUPERSCRIPT)}"
    digits = max(0, _DIGITS - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{digits}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", _MINUS) + exponent


def with_unit(text: str, unit: str) -> str:
    """A number and its unit, which is nothing for ``-``."""
    if not text or unit in {"", "-"}:
        return text
    return f"{text}{'' if unit == '°' else _THIN}{unit}"


def published(ends: Sequence[float] | None, unit: str) -> str:
    """What is published: a number or a range with its unit, nothing where nothing is."""
    if not ends:
        return ""
    low, high = (number(end) for end in ends)
    return with_unit(low if low == high else f"{low} to {high}", unit)


def difference(value: float | None, ends: Sequence[float] | None) -> str:
    """How a measured value stands to what is published: ``within``, ``12 % above``."""
    if value is None or not ends:
        return ""
    low, high = ends
    if low != high and low <= value <= high:
        return "within"
    nearest = min(ends, key=lambda end: abs(value - end))
    if nearest == 0:
        return "" if value else "equal"
    share = (value - nearest) / abs(nearest)
    if abs(share) < _ALIKE:
        return "equal"
    side = "above" if share > 0 else "below"
    ratio = value / nearest
    if ratio > _FACTOR:
        return f"{number(float(f'{ratio:.2g}'))} times"
    return f"{abs(share):.0%} {side}".replace("%", f"{_THIN}%")


def duration(seconds: float) -> str:
    """A time as one says it: ``0.42 s``, ``14 s``, ``3 min 20 s``."""
    if seconds < 60:
        return f"{seconds:.2g} s" if seconds < 9.95 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if rest else f"{minutes} min"


def option(value: Any) -> str:
    """The value of an option."""
    if isinstance(value, list):
        return ", ".join(option(item) for item in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return number(value)
