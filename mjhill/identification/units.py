"""Units of measured columns, as laboratories write them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

SI: Mapping[str, str] = {"time": "s", "angle": "rad", "torque": "N·m", "excitation": "-"}
_EXAMPLES: Mapping[str, str] = {
    "time": "s, ms",
    "angle": "deg, rad, mrad",
    "torque": "N·m, N·mm, lbf·ft",
    "excitation": "- or 1 (a share of the maximum), %",
}
_PLAIN: Mapping[str, tuple[str, ...]] = {  # spellings of the SI unit that need no library
    "time": ("s",),
    "angle": ("rad",),
    "torque": ("N·m",),
    "excitation": ("-", "1", "none", "fraction", "normalized", "normalised", "mvc"),
}
_LOOKALIKES = str.maketrans(
    {
        **dict.fromkeys("⋅·∙•\N{MULTIPLICATION SIGN}", "*"),
        **dict.fromkeys("\N{MINUS SIGN}\N{EN DASH}", "-"),
        "º": "°",
    }
)
# letters and signs of multiplication: no digits, which a reader of expressions would compute with
_UNIT = re.compile(r"(?:[^\W\d_]|[°%]|[ *.\-])+")
_LONGEST = 30
_NEWTON_METRE = re.compile(r"(?P<prefix>[mk]?)N[ *.\-]*(?P<metre>[cm]?m)s?", re.IGNORECASE)
_POUND = re.compile(r"(?<![a-z])(?:lbs?|lbfs)(?![a-z])")
_POUND_JOINED = re.compile(r"(ft|in)(?:lbf?s?)|(?:lbf?s?)(ft|in)")


def factor_to_si(unit: str, quantity: str) -> float:
    """One unit in the SI unit of a quantity; no unit is that of SI.

    Args:
        unit: As written in a header, such as ``deg``, ``N*mm``, ``FT-LBS`` or ``%``.
        quantity: ``time``, ``angle``, ``torque`` or ``excitation``.

    Raises:
        ValueError: It is no unit of that quantity; the message says which units are.
    """
    text = unit.strip()
    if not text or text.casefold() in _PLAIN[quantity] or text in _PLAIN[quantity]:
        return 1.0
    if quantity == "angle" and text.casefold() == "grad":
        raise ValueError(f"{unit!r} is degrees to some and gon to others; write deg or gon")
    if len(text) <= _LONGEST and _UNIT.fullmatch(text.translate(_LOOKALIKES)):
        for spelling in _spellings(text.translate(_LOOKALIKES), quantity):
            factor = _factor(spelling, quantity)
            if factor is not None:
                return factor
    raise ValueError(
        f"unknown unit {unit!r} of {quantity}; it must be one such as {_EXAMPLES[quantity]}"
    )


def _spellings(text: str, quantity: str) -> Iterator[str]:
    """What a unit may mean, as pint would write it, the likeliest first."""
    text = text.rstrip(".").strip()
    if quantity == "excitation":  # percent of the maximum voluntary contraction
        text = re.sub(r"\s*(mvc|max)$", "", text, flags=re.IGNORECASE)
    product = re.sub(r"\s*[*.\-]\s*|\s+", "*", text)
    if quantity == "torque":
        match = _NEWTON_METRE.fullmatch(text)
        if match:  # also NM and nm, which are no nanometres here; but mN and MN differ
            yield f"{match['prefix']}N*{match['metre'].lower()}"
        # the pound of a torque is the force
        pounds = _POUND_JOINED.sub(r"\1\2*lbf", product.lower())
        yield _POUND.sub("lbf", pounds)
    yield product
    yield product.lower()


def _factor(spelling: str, quantity: str) -> float | None:
    """One unit in SI; None where it is none of the quantity."""
    registry = _registry()
    si = registry.Quantity(1.0, SI[quantity].translate(_LOOKALIKES).strip("-"))
    try:
        given = registry.Quantity(1.0, registry.parse_units(spelling))
        # angles and shares have no dimension, but roots that differ: radian, and none
        same = given.to_root_units().units == si.to_root_units().units
        return float(given.to(si.units).magnitude) if same else None
    except Exception:  # pint raises nearly anything at what it cannot read
        return None


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()
