"""Published facts about human joints, as published and as measured in simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from mjhill.identification.measures import measure, remark
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.lab.rig import UnmeasuredError
from mjhill.literature.facts import Entry, name_of, read_entries


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
        note: Why it could not, or how another reading of the same measurement comes out; often
            empty.
        held_out: Whether no fit uses it.
    """

    joint: str
    quantity: str
    unit: str
    low: float
    high: float
    source: str
    measured: float | None
    note: str = ""
    held_out: bool = False

    @property
    def deviation(self) -> float | None:
        """Standard deviations of the joint from the published mean, half of the interval each."""
        if self.measured is None:
            return None
        return (2 * self.measured - self.low - self.high) / (self.high - self.low)

    @property
    def within(self) -> bool | None:
        """Whether the joint is inside the interval; None where it could not be measured."""
        return None if self.measured is None else self.low <= self.measured <= self.high


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


def _check_muscle(entry: Entry, joint: Joint) -> None:
    if entry.muscle not in joint.muscles:
        raise ValueError(
            f"{name_of(entry)}: unknown muscle {entry.muscle!r}; there are: "
            f"{', '.join(joint.muscles)}"
        )


def _fact(entry: Entry, joint: Joint) -> Fact:
    measured: float | None
    try:
        measured, note = float(measure(entry, [joint])[0]), remark(entry, joint)
    except UnmeasuredError as reason:
        measured, note = None, str(reason)
    return Fact(
        entry.joint,
        entry.quantity,
        entry.unit,
        entry.low,
        entry.high,
        entry.source,
        measured,
        note,
        entry.held_out,
    )
