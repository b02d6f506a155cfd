"""Published facts about human joints that no fit uses as data, beside what a joint does.

They are in ``facts.toml``, each with the measure that shows it and its source; its head says
which are not independent of the bounds that the fit was given.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mjhill.identification.measures import MEASURES
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.lab.rig import UnmeasuredError

_DATA = Path(__file__).parent / "facts.toml"
_PER_SI = MappingProxyType(
    {"°/s": 180 / pi, "ms": 1e3, "%": 1e2, "rad/s": 1, "N·m/rad": 1, "1/rad": 1, "-": 1}
)


@dataclass(frozen=True)
class Fact:
    """A quantity as published and as measured in simulation.

    Attributes:
        joint: Name of the joint.
        quantity: What it is.
        unit: Unit of the numbers.
        low: Lower end of the published interval.
        high: Upper end.
        source: Where the interval comes from.
        measured: What the joint does; None where that cannot be measured.
        note: Why it could not; else empty.
    """

    joint: str
    quantity: str
    unit: str
    low: float
    high: float
    source: str
    measured: float | None
    note: str = ""

    @property
    def within(self) -> bool | None:
        """Whether the joint is inside the interval; None where it could not be measured."""
        return None if self.measured is None else self.low <= self.measured <= self.high


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


def facts(
    joints: Mapping[str, Joint] | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Fact]:
    """Measure every published fact about some joints, in the order of the file.

    Args:
        joints: Joints by name; by default those that come with mjhill. One that no fact is
            about adds none.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: A joint has a name that mjhill does not know, or lacks a muscle that a fact
            is about.
    """
    chosen: Mapping[str, Joint] = JOINTS if joints is None else joints
    unknown = [name for name in chosen if name not in JOINTS]
    if unknown:
        raise ValueError(f"unknown joint {unknown[0]!r}; there are: {', '.join(JOINTS)}")
    entries = [entry for entry in read_entries() if entry.joint in chosen]
    for entry in entries:
        _check_muscle(entry, chosen[entry.joint])
    found = []
    for count, entry in enumerate(entries, 1):
        found.append(_fact(entry, chosen[entry.joint]))
        if progress is not None:
            progress(count / len(entries))
    return found


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
        ("unit", entry.unit, _PER_SI),
    ):
        if name not in known:
            raise ValueError(f"{_name(entry)}: unknown {what} {name!r}; there are: {list(known)}")
    if not entry.low < entry.high:
        raise ValueError(
            f"{_name(entry)}: low must be below high, got {entry.low:g} and {entry.high:g}"
        )


def _check_muscle(entry: Entry, joint: Joint) -> None:
    if entry.muscle not in joint.muscles:
        raise ValueError(
            f"{_name(entry)}: unknown muscle {entry.muscle!r}; there are: "
            f"{', '.join(joint.muscles)}"
        )


def _name(entry: Entry) -> str:
    return f"{entry.joint}, {entry.quantity}"


def _fact(entry: Entry, joint: Joint) -> Fact:
    measured, note = None, ""
    try:
        value = MEASURES[entry.measure](joint, entry.muscle, **entry.arguments)
        measured = _PER_SI[entry.unit] * value
    except UnmeasuredError as reason:
        note = str(reason)
    return Fact(
        entry.joint,
        entry.quantity,
        entry.unit,
        entry.low,
        entry.high,
        entry.source,
        measured,
        note,
    )
