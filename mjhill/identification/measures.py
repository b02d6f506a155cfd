"""Published facts measured in simulation, on many joints at once.

Every measure takes N joints with the same muscles and gears and the muscle concerned, then its own
arguments, and returns a value in SI units for each joint.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import radians
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.ballistic import (
    BallisticMovements,
    Pulses,
    ballistic_movements,
    free_velocities,
    isokinetic_velocities,
)
from mjhill.lab.impedance import (
    READINGS,
    Impedance,
    held_impedance,
    passive_stiffness,
    stiffness_slope,
)
from mjhill.lab.rig import UnmeasuredError
from mjhill.lab.twitch import twitches
from mjhill.literature.facts import PER_SI, Entry
from mjhill.muscles.readings import series_stiffness, stretch_at

_MOST_RECOIL = 0.5  # of a free velocity
_Values = NDArray[np.float64]
Memory = dict[str, Pulses]
"""Pulses that the last movements of a kind needed; the next search starts there."""


def _ballistic(
    joints: Sequence[Joint], muscle: str, memory: Memory, degrees: float, options: dict[str, Any]
) -> BallisticMovements:
    duration = options.pop("time")
    kind = f"{muscle} {degrees} {options}"
    guess = memory.get(kind)

    def move(guess: Pulses | None) -> BallisticMovements:
        return ballistic_movements(
            joints, muscle, amplitude=radians(degrees), duration=duration, guess=guess, **options
        )

    try:
        found = move(guess)
    except UnmeasuredError:
        if guess is None:
            raise
        found = move(None)
    pulses = found.pulses
    memory[kind] = Pulses(pulses.agonist[:1], pulses.brake[:1], pulses.kind)
    return found


def _ballistic_peak_velocity(
    joints: Sequence[Joint], muscle: str, memory: Memory, *, degrees: float, **options: Any
) -> _Values:
    return _ballistic(joints, muscle, memory, degrees, options).peak_velocity


def _ballistic_duration(
    joints: Sequence[Joint],
    muscle: str,
    memory: Memory,
    *,
    degrees: float,
    threshold: float,
    **options: Any,
) -> _Values:
    return _ballistic(joints, muscle, memory, degrees, options).duration(radians(threshold))


def _angle(degrees: float | None) -> float | None:
    return None if degrees is None else radians(degrees)


def _twitch_contraction(
    joints: Sequence[Joint], muscle: str, _: Memory, *, degrees: float | None = None
) -> _Values:
    return twitches(joints, muscle, angle=_angle(degrees)).contraction


def _twitch_half_relaxation(
    joints: Sequence[Joint], muscle: str, _: Memory, *, degrees: float | None = None
) -> _Values:
    return twitches(joints, muscle, angle=_angle(degrees)).half_relaxation


def _twitch_share(
    joints: Sequence[Joint], muscle: str, _: Memory, *, degrees: float | None = None
) -> _Values:
    return twitches(joints, muscle, angle=_angle(degrees)).share


def _free_velocity(
    joints: Sequence[Joint], muscle: str, _: Memory, *, degrees: float | None = None
) -> _Values:
    return free_velocities(joints, muscle, angle=_angle(degrees))


def _isokinetic_velocity(
    joints: Sequence[Joint], muscle: str, _: Memory, *, share: float
) -> _Values:
    return isokinetic_velocities(joints, muscle, share=share)


def _each(measure: Callable[..., float]) -> Callable[..., _Values]:
    """A measure of one joint, made one of many."""

    def measured(joints: Sequence[Joint], muscle: str, _: Memory, **arguments: Any) -> _Values:
        return np.array([measure(joint, muscle, **arguments) for joint in joints])

    return measured


def _passive_stiffness(joint: Joint, _: str, *, degrees: float) -> float:
    return passive_stiffness(joint, radians(degrees))


def _held(
    joint: Joint, muscle: str, *, share: float, degrees: float, band: Sequence[float]
) -> Impedance:
    low, high = band
    return held_impedance(joint, muscle, share=share, angle=radians(degrees), band=(low, high))


def _held_stiffness(joint: Joint, muscle: str, *, reading: str, **protocol: Any) -> float:
    return _held(joint, muscle, **protocol).stiffness(reading)


def _held_damping_ratio(joint: Joint, muscle: str, **protocol: Any) -> float:
    return _held(joint, muscle, **protocol).damping_ratio


def _stiffness_slope(
    joint: Joint, muscle: str, *, shares: Sequence[float], reading: str, **protocol: Any
) -> float:
    levels = [_held(joint, muscle, share=share, **protocol) for share in shares]
    return stiffness_slope(levels, reading)


def _series_stretch(joint: Joint, muscle: str, *, torque: float) -> float:
    hill, gear = joint.hill_muscles[muscle], abs(joint.gears[muscle])
    return stretch_at(hill, torque / gear) / gear


def _series_stiffness(joint: Joint, muscle: str, *, torque: float) -> float:
    hill, gear = joint.hill_muscles[muscle], abs(joint.gears[muscle])
    return gear**2 * series_stiffness(hill, stretch_at(hill, torque / gear))


MEASURES: Mapping[str, Callable[..., _Values]] = MappingProxyType(
    {
        "ballistic_peak_velocity": _ballistic_peak_velocity,
        "ballistic_duration": _ballistic_duration,
        "twitch_contraction": _twitch_contraction,
        "twitch_half_relaxation": _twitch_half_relaxation,
        "twitch_share": _twitch_share,
        "free_velocity": _free_velocity,
        "isokinetic_velocity": _isokinetic_velocity,
        "series_stretch": _each(_series_stretch),
        "series_stiffness": _each(_series_stiffness),
        "passive_stiffness": _each(_passive_stiffness),
        "held_stiffness": _each(_held_stiffness),
        "held_damping_ratio": _each(_held_damping_ratio),
        "stiffness_slope": _each(_stiffness_slope),
    }
)


def measure(entry: Entry, joints: Sequence[Joint], memory: Memory | None = None) -> _Values:
    """What a fact is for each of N joints, in the unit of the entry, shape (N,).

    Args:
        entry: The fact.
        joints: N joints with the same muscles and gears; other numbers may differ.
        memory: Where searches start and end; give the same one for joints that are almost alike.

    Raises:
        UnmeasuredError: It cannot be measured on one of them.
    """
    known = {} if memory is None else memory
    value = MEASURES[entry.measure](joints, entry.muscle, known, **entry.arguments)
    return np.asarray(PER_SI[entry.unit] * value)


def _recoil(entry: Entry, joint: Joint) -> str:
    angle = _angle(entry.arguments.get("degrees"))
    recoil, full = (
        float(free_velocities([joint], entry.muscle, angle=angle, excitation=u)[0])
        for u in (0.0, 1.0)
    )
    said = f"passive elasticity alone moves it at {PER_SI[entry.unit] * recoil:.3g} {entry.unit}"
    if recoil > _MOST_RECOIL * full:
        raise UnmeasuredError(
            f"{said}, which is more than {_MOST_RECOIL:.0%} of what {entry.muscle} does"
        )
    return said


def remark(entry: Entry, joint: Joint) -> str:
    """What else there is to say of a measured fact: other readings of an impedance, how good a fit.

    Empty where there is nothing.

    Args:
        entry: The fact.
        joint: The joint.

    Raises:
        UnmeasuredError: A free velocity is that of a spring: passive elasticity alone moves the
            joint at more than half of it.
    """
    if entry.measure == "free_velocity":
        return _recoil(entry, joint)
    arguments = dict(entry.arguments)
    if "band" not in arguments:
        return ""
    reading = arguments.pop("reading", None)
    shares = arguments.pop("shares", None) or [arguments.pop("share")]
    held = [_held(joint, entry.muscle, share=share, **arguments) for share in shares]
    least = f"the second-order fit explains {min(one.explained for one in held):.0%}"
    if reading is None:
        return least
    other = next(one for one in READINGS if one != reading)
    try:
        value = stiffness_slope(held, other) if len(held) > 1 else held[0].stiffness(other)
    except UnmeasuredError as reason:
        return f"{least}; {reason}"
    return f"{other.replace('_', '-')} reading: {PER_SI[entry.unit] * value:.3g}; {least}"
