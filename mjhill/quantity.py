"""Physical parameters: values with units, bounds and sources."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import MISSING, dataclass, field, fields
from numbers import Real
from typing import Any

from mjhill.frozen import FrozenDict

# units of a muscle on a hinge, and of one on a slide or tendon
FORCE, LENGTH, VELOCITY = ("N·m", "N"), ("rad", "m"), ("rad/s", "m/s")


@dataclass(frozen=True)
class Quantity:
    """What a parameter is: symbol, unit, meaning, bounds.

    Attributes:
        symbol: Its symbol in the equations.
        units: Its unit on a hinge, and on a slide or tendon.
        meaning: One phrase.
        low: Lower bound.
        high: Upper bound, allowed.
        low_allowed: Whether the lower bound is itself allowed.
    """

    symbol: str
    units: tuple[str, str]
    meaning: str
    low: float
    high: float
    low_allowed: bool = False

    def check(self, name: str, value: float) -> None:
        """Accept a value inside the bounds.

        Raises:
            ValueError: The value is not a finite number inside the bounds.
        """
        if not isinstance(value, Real):
            raise ValueError(f"{name} must be a number, got {value!r}")
        above = self.low <= value if self.low_allowed else self.low < value
        if not (math.isfinite(value) and above and value <= self.high):
            bracket = "[" if self.low_allowed else "("
            unit = "" if self.units[0] == "-" else " " + " or ".join(dict.fromkeys(self.units))
            wanted = f"{bracket}{self.low:g}, {self.high:g}]{unit}"
            raise ValueError(f"{name} must be in {wanted}, got {value!r}")


def quantity(
    symbol: str,
    unit: str | tuple[str, str],
    meaning: str,
    bounds: tuple[float, float],
    *,
    default: Any = MISSING,
    low_allowed: bool = False,
    array: str = "",
) -> Any:
    """A field of a parameter class that is a ``Quantity``.

    Args:
        symbol: Its symbol in the equations.
        unit: Its unit, or that on a hinge and that on a slide or tendon.
        meaning: One phrase.
        bounds: Lower and upper bound.
        default: Its default; without one it must be given.
        low_allowed: Whether the lower bound is itself allowed.
        array: The array of an actuator that holds it, such as ``gainprm``; for muscles.
    """
    units = (unit, unit) if isinstance(unit, str) else unit
    described = Quantity(symbol, units, meaning, *bounds, low_allowed)
    return field(default=default, metadata={"quantity": described, "array": array})


def flag(*, default: bool, array: str = "") -> Any:
    """A field of a parameter class that is True or False; ``array`` as for ``quantity``."""
    return field(default=default, metadata={"flag": True, "array": array})


def quantities(cls: type) -> Iterator[tuple[str, Quantity]]:
    """Name and description of each physical parameter of a parameter class, in order."""
    for item in fields(cls):
        if "quantity" in item.metadata:
            yield item.name, item.metadata["quantity"]


def flags(cls: type) -> Iterator[str]:
    """Name of each field of a parameter class that is True or False."""
    return (item.name for item in fields(cls) if "flag" in item.metadata)


def check_quantities(parameters: Any) -> None:
    """Check every ``Quantity`` and flag of an object, and keep them as floats and bools.

    Raises:
        ValueError: One is not a finite number inside its bounds, or not True or False.
    """
    for name, described in quantities(type(parameters)):
        described.check(name, getattr(parameters, name))
        object.__setattr__(parameters, name, float(getattr(parameters, name)))
    for name in flags(type(parameters)):
        value = getattr(parameters, name)
        if value not in (False, True):
            raise ValueError(f"{name} must be False or True, got {value!r}")
        object.__setattr__(parameters, name, bool(value))


def sources() -> Any:
    """A field that says where each value comes from, by parameter name."""
    return field(default_factory=FrozenDict, compare=False, repr=False)


def freeze(parameters: Any, *names: str) -> None:
    """Replace mappings by copies that cannot be changed, so that equal objects stay equal."""
    for name in names:
        object.__setattr__(parameters, name, FrozenDict(getattr(parameters, name)))
