"""Published facts about human joints.

They are in ``facts.toml``, each with the measure that shows it and its source. The head of that
file says which are held out of the fit, by what rule, and what that is worth.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
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
        ValueError: The file is not TOML, or an entry is incomplete, names a measure or unit that
            does not exist, or has an interval that does not ascend.
        FileNotFoundError: There is no such file.
    """
    text = Path(path).read_text(encoding="utf-8")
    try:
        entries = [Entry(**{"arguments": {}, **table}) for table in tomllib.loads(text)["fact"]]
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: not a file of facts: {error}") from None
    for entry in entries:
        _check_entry(entry)
    return entries


def _check_entry(entry: Entry) -> None:
    for what, name, known in (
        ("measure", entry.measure, MEASURES),
        ("unit", entry.unit, PER_SI),
    ):
        if name not in known:
            raise ValueError(f"{name_of(entry)}: unknown {what} {name!r}; there are: {list(known)}")
    if not entry.low < entry.high:
        raise ValueError(
            f"{name_of(entry)}: low must be below high, got {entry.low:g} and {entry.high:g}"
        )


def name_of(entry: Entry) -> str:
    """Joint and quantity of an entry, for messages."""
    return f"{entry.joint}, {entry.quantity}"
