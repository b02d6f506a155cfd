"""The free parameters of a joint: their bounds, and joints with other values of them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, log
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.joints.reader import parameter_file, read_joints

DEVIATIONS = 2.0  # from the middle of the bounds to either
_NOT_FITTED = ("gear", "range", "home_angle")  # conventions, which no data determine


@dataclass(frozen=True)
class Free:
    """One free parameter.

    Attributes:
        path: Keys of its entry in a joint's table, such as
            ``("muscles", "elbow_flexor", "max_velocity")``.
        low: Lower bound, in the parameter's unit.
        high: Upper bound.
        mirrors: Paths of parameters that have the same value, and 1, or -1 for the opposite one.
    """

    path: tuple[str, ...]
    low: float
    high: float
    mirrors: tuple[tuple[tuple[str, ...], float], ...] = ()

    @property
    def name(self) -> str:
        """Its name in tables: ``elbow_flexor.max_velocity``, ``passive.k1_pos``, ``damping``."""
        return ".".join(self.path[1:] if self.path[0] == "muscles" else self.path)

    def values(self, value: float) -> dict[tuple[str, ...], float]:
        """The paths that have this value, or its opposite, and what they have."""
        return {self.path: value, **{path: sign * value for path, sign in self.mirrors}}

    def value(self, deviation: float) -> float:
        """The value [the parameter's unit] some standard deviations from the middle."""
        share = 0.5 + 0.5 * deviation / DEVIATIONS
        if self.low > 0:
            value = exp((1 - share) * log(self.low) + share * log(self.high))
        else:
            value = (1 - share) * self.low + share * self.high
        return min(max(value, self.low), self.high)

    def deviation(self, value: float) -> float:
        """Standard deviations of a value from the middle: ``value`` inverted."""
        if self.low > 0:
            share = log(value / self.low) / log(self.high / self.low)
        else:
            share = (value - self.low) / (self.high - self.low)
        return DEVIATIONS * (2 * share - 1)


def free_parameters(joint: str, path: str | Path | None = None) -> list[Free]:
    """The free parameters of a joint, in the order of the parameter file.

    Args:
        joint: Its name.
        path: The parameter file; by default the one that comes with mjhill.

    Raises:
        ValueError: The file is not in order, there is no such joint, bounds are not two ascending
            numbers that the value lies between or those of what cannot be fitted, or there are
            none.
    """
    known = read_joints(path)
    if joint not in known:
        raise ValueError(f"unknown joint {joint!r}; there are: {', '.join(known)}")
    tables = tomllib.loads(parameter_file(path).read_text(encoding="utf-8"))
    found = list(_entries(tables[joint], ()))
    if tables[joint].get("symmetric"):
        found = list(_tied(found, list(known[joint].muscles)))
    for free, value in found:
        if free.path[-1] in _NOT_FITTED:
            raise ValueError(f"{joint}: {free.name} cannot be fitted; remove its bounds")
        if not free.low < free.high or not free.low <= value <= free.high:
            raise ValueError(
                f"{joint}: {free.name} must have ascending bounds about its value {value:g}, "
                f"got [{free.low:g}, {free.high:g}]"
            )
    if not found:
        raise ValueError(f"{joint}: no parameter has bounds, so there is none to fit; add some")
    return [free for free, _ in found]


def _entries(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[tuple[Free, float]]:
    for name, entry in table.items():
        if not isinstance(entry, dict):
            continue
        if "bounds" in entry:
            low, high = entry["bounds"]
            yield Free((*path, name), float(low), float(high)), entry["value"]
        elif "value" not in entry:
            yield from _entries(entry, (*path, name))


def _tied(
    entries: Iterable[tuple[Free, float]], muscles: Sequence[str]
) -> Iterator[tuple[Free, float]]:
    """The parameters of a symmetric joint: those of its first muscle and positive side."""
    first, second = muscles
    for free, value in entries:
        name = free.path[-1]
        if second in free.path or name.endswith("_neg"):
            continue
        if first in free.path:
            other = tuple(second if key == first else key for key in free.path)
            yield replace(free, mirrors=((other, -1.0 if "postures" in other else 1.0),)), value
        elif name.endswith("_pos"):
            other = (*free.path[:-1], name.replace("_pos", "_neg"))
            yield replace(free, mirrors=((other, 1.0),)), value
        else:
            yield free, value


def pin(
    free: Iterable[Free], fixed: Mapping[str, float]
) -> tuple[list[Free], list[tuple[Free, float]]]:
    """The parameters that stay free, and those that are fixed, with their values.

    Args:
        free: The free parameters.
        fixed: Values by name; a name such as ``hill_shape`` is that of every muscle.

    Raises:
        ValueError: A name is none of a free parameter, a value is outside the bounds, or no
            parameter stays free.
    """
    found = list(free)
    for name, value in fixed.items():
        same = [item for item in found if name in (item.name, item.path[-1])]
        if not same:
            raise ValueError(
                f"no free parameter is called {name!r}; there are: "
                f"{', '.join(item.name for item in found)}"
            )
        for item in same:
            if not item.low <= value <= item.high:
                raise ValueError(
                    f"{item.name} must be fixed within its bounds, {item.low:g} to {item.high:g}, "
                    f"got {value:g}"
                )
    pinned = [
        (item, fixed.get(item.name, fixed.get(item.path[-1], 0.0)))
        for item in found
        if item.name in fixed or item.path[-1] in fixed
    ]
    names = {item.name for item, _ in pinned}
    rest = [item for item in found if item.name not in names]
    if not rest:
        raise ValueError("all parameters are fixed, so there is none to fit")
    return rest, pinned


def joint_at(joint: Joint, free: Sequence[Free], deviations: NDArray[np.float64]) -> Joint:
    """A joint with its free parameters at some deviations, shape (P,), from their middles."""
    return joint_with(
        joint, [(item, item.value(z)) for item, z in zip(free, deviations.tolist(), strict=True)]
    )


def joint_with(joint: Joint, parameters: Iterable[tuple[Free, float]]) -> Joint:
    """A joint with other values of some parameters, in their units."""
    values: dict[tuple[str, ...], float] = {}
    for item, value in parameters:
        values |= item.values(value)

    def under(*path: str) -> dict[str, Any]:
        return {key[-1]: value for key, value in values.items() if key[:-1] == path}

    muscles = {
        name: replace(muscle, **under("muscles", name)) for name, muscle in joint.muscles.items()
    }
    return replace(
        joint,
        **under(),
        passive=replace(joint.passive, **under("passive")),
        muscles=MappingProxyType(muscles),
        postures=MappingProxyType({**joint.postures, **under("postures")}),
    )


def value_of(joint: Joint, free: Free) -> float:
    """The value that a free parameter has in a joint, in the parameter's unit."""
    node: Any = joint
    for key in free.path:
        node = node[key] if isinstance(node, Mapping) else getattr(node, key)
    return float(node)
