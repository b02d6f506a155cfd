"""Published facts about human joints, as published and as measured in simulation.

Every measure takes the joint and the muscle concerned, then its own arguments, and returns SI.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import radians
from types import MappingProxyType
from typing import Any

from mjhill.experiments.twitch import muscle_twitch
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.lab.ballistic import (
    BallisticMovement,
    ballistic_movement,
    free_velocity,
    velocity_intercept,
)
from mjhill.lab.impedance import held_impedance, passive_stiffness, stiffness_slope
from mjhill.lab.rig import UnmeasuredError
from mjhill.literature.facts import PER_SI, Entry, name_of, read_entries

Measure = Callable[..., float]


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


def _ballistic(joint: Joint, muscle: str, degrees: float, **options: Any) -> BallisticMovement:
    duration = options.pop("time")
    return ballistic_movement(
        joint, muscle, amplitude=radians(degrees), duration=duration, **options
    )


def _ballistic_peak_velocity(joint: Joint, muscle: str, **options: Any) -> float:
    return _ballistic(joint, muscle, **options).peak_velocity


def _ballistic_duration(joint: Joint, muscle: str, *, threshold: float, **options: Any) -> float:
    return _ballistic(joint, muscle, **options).duration(radians(threshold))


def _twitch_contraction(joint: Joint, muscle: str) -> float:
    return muscle_twitch(joint, muscle).contraction


def _twitch_half_relaxation(joint: Joint, muscle: str) -> float:
    return muscle_twitch(joint, muscle).half_relaxation


def _twitch_share(joint: Joint, muscle: str) -> float:
    return muscle_twitch(joint, muscle).share


def _free_velocity(joint: Joint, muscle: str, *, degrees: float | None = None) -> float:
    return free_velocity(joint, muscle, angle=None if degrees is None else radians(degrees))


def _passive_stiffness(joint: Joint, _: str, *, degrees: float) -> float:
    return passive_stiffness(joint, radians(degrees))


def _held_stiffness(joint: Joint, muscle: str, *, share: float, degrees: float) -> float:
    return held_impedance(joint, muscle, share=share, angle=radians(degrees)).stiffness


def _held_damping_ratio(joint: Joint, muscle: str, *, share: float, degrees: float) -> float:
    return held_impedance(joint, muscle, share=share, angle=radians(degrees)).damping_ratio


def _stiffness_slope(
    joint: Joint, muscle: str, *, shares: Sequence[float], degrees: float
) -> float:
    return stiffness_slope(joint, muscle, shares=shares, angle=radians(degrees))


MEASURES: Mapping[str, Measure] = MappingProxyType(
    {
        "ballistic_peak_velocity": _ballistic_peak_velocity,
        "ballistic_duration": _ballistic_duration,
        "twitch_contraction": _twitch_contraction,
        "twitch_half_relaxation": _twitch_half_relaxation,
        "twitch_share": _twitch_share,
        "free_velocity": _free_velocity,
        "velocity_intercept": velocity_intercept,
        "passive_stiffness": _passive_stiffness,
        "held_stiffness": _held_stiffness,
        "held_damping_ratio": _held_damping_ratio,
        "stiffness_slope": _stiffness_slope,
    }
)


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
    measured, note = None, ""
    try:
        value = MEASURES[entry.measure](joint, entry.muscle, **entry.arguments)
        measured = PER_SI[entry.unit] * value
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
