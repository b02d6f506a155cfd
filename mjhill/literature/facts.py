"""Published facts about human joints.

They are in ``facts.toml``, each with the measure that shows it and its source. The head of that
file says which are held out of the fit, by what rule, and what that is worth.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from math import isfinite, pi
from pathlib import Path
from types import MappingProxyType
from typing import Any

_DATA = Path(__file__).parent / "facts.toml"
MEASURES = (  # that an entry can name
    "ballistic_peak_velocity",
    "ballistic_duration",
    "twitch_contraction",
    "twitch_half_relaxation",
    "twitch_share",
    "free_velocity",
    "isokinetic_velocity",
    "series_stretch",
    "series_stiffness",
    "passive_stiffness",
    "held_stiffness",
    "held_damping_ratio",
    "stiffness_slope",
)
PER_SI = MappingProxyType(
    {
        "°": 180 / pi,
        "°/s": 180 / pi,
        "ms": 1e3,
        "%": 1e2,
        "rad/s": 1,
        "N·m/rad": 1,
        "1/rad": 1,
        "-": 1,
    }
)


@dataclass(frozen=True)
class Entry:
    """One entry of the file of facts: what is published, and how it is measured.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle concerned, the agonist of a movement.
        measure: Its name in ``MEASURES``.
        arguments: What that takes beside the joint and the muscle.
        quantity: What is measured, in words.
        unit: Unit of ``low`` and ``high``.
        low: Lower end of the published interval.
        high: Upper end.
        source: Where the interval comes from.
        held_out: Whether no fit uses it.
    """

    joint: str
    muscle: str
    measure: str
    arguments: Mapping[str, Any]
    quantity: str
    unit: str
    low: float
    high: float
    source: str
    held_out: bool = False

    def deviation(self, value: Any) -> Any:
        """Standard deviations of a value, or an array of them, from the published mean."""
        return (value - 0.5 * (self.low + self.high)) / (0.5 * (self.high - self.low))


def read_entries(path: str | Path = _DATA) -> list[Entry]:
    """The entries of a file of facts; by default the one that comes with mjhill.

    Raises:
        ValueError: The file is not TOML, or an entry is incomplete, has no source, names a measure
            or unit that does not exist, or has an interval that does not ascend. The message names
            the file and the fact.
        FileNotFoundError: There is no such file.
    """
    text = Path(path).read_text(encoding="utf-8")
    try:
        tables = tomllib.loads(text)
    except ValueError as error:
        raise ValueError(f"{path}: not a file of facts: {error}") from None
    facts = tables.get("fact")
    if list(tables) != ["fact"] or not isinstance(facts, list):
        raise ValueError(
            f"{path}: not a file of facts: it must have one table [[fact]] for each fact and "
            f"nothing else, got {', '.join(tables) or 'nothing'}"
        )
    return [_entry(table, f"{path}, fact {number}") for number, table in enumerate(facts, 1)]


def _entry(table: dict[str, Any], where: str) -> Entry:
    given = {"arguments": {}, **table}
    keys = [field.name for field in fields(Entry)]
    missing = [f.name for f in fields(Entry) if f.default is MISSING and f.name not in given]
    unknown = [key for key in given if key not in keys]
    if "joint" in given and "quantity" in given:
        where += f" ({given['joint']}, {given['quantity']})"
    if missing:
        remedy = "; say which study it is from" if "source" in missing else ""
        raise ValueError(f"{where}: {', '.join(missing)} missing{remedy}")
    if unknown:
        raise ValueError(f"{where}: unknown key {unknown[0]!r}; there are: {', '.join(keys)}")
    entry = Entry(**given)
    _check_entry(entry, where)
    return entry


def _check_entry(entry: Entry, where: str) -> None:
    if not isinstance(entry.source, str) or not entry.source.strip():
        raise ValueError(
            f"{where}: source must say which study the interval is from, got {entry.source!r}"
        )
    for what, name, known in (
        ("measure", entry.measure, MEASURES),
        ("unit", entry.unit, PER_SI),
    ):
        if name not in known:
            raise ValueError(f"{where}: unknown {what} {name!r}; there are: {', '.join(known)}")
    for name, end in (("low", entry.low), ("high", entry.high)):
        if isinstance(end, bool) or not isinstance(end, int | float) or not isfinite(end):
            raise ValueError(f"{where}: {name} must be a finite number, got {end!r}")
    if not entry.low < entry.high:
        raise ValueError(
            f"{where}: low must be below high, got {entry.low:g} and {entry.high:g}; an interval "
            "needs a width, such as mean - SD to mean + SD"
        )


def name_of(entry: Entry) -> str:
    """Joint and quantity of an entry, for messages."""
    return f"{entry.joint}, {entry.quantity}"
