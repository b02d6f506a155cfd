"""What can be measured of a joint, by the names that ``facts.toml`` uses.

Every measure takes the joint and the muscle concerned, then its own arguments, and returns SI.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import radians
from types import MappingProxyType

from mjhill.experiments.trials.free_velocity import free_velocity
from mjhill.experiments.trials.impedance import held_impedance, passive_stiffness, stiffness_slope
from mjhill.experiments.trials.turn import Turn, turn
from mjhill.experiments.twitch import muscle_twitch
from mjhill.joints.joint import Joint

Measure = Callable[..., float]


def _turn(joint: Joint, muscle: str, degrees: float, time: float, braked: bool) -> Turn:
    return turn(joint, muscle, amplitude=radians(degrees), duration=time, braked=braked)


def _turn_peak_velocity(
    joint: Joint, muscle: str, *, degrees: float, time: float, braked: bool = False
) -> float:
    return _turn(joint, muscle, degrees, time, braked).peak_velocity


def _turn_duration(
    joint: Joint,
    muscle: str,
    *,
    degrees: float,
    time: float,
    threshold: float,
    braked: bool = False,
) -> float:
    return _turn(joint, muscle, degrees, time, braked).duration(radians(threshold))


def _twitch_contraction(joint: Joint, muscle: str) -> float:
    return muscle_twitch(joint, muscle).contraction


def _twitch_half_relaxation(joint: Joint, muscle: str) -> float:
    return muscle_twitch(joint, muscle).half_relaxation


def _twitch_share(joint: Joint, muscle: str) -> float:
    return muscle_twitch(joint, muscle).share


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
        "turn_peak_velocity": _turn_peak_velocity,
        "turn_duration": _turn_duration,
        "twitch_contraction": _twitch_contraction,
        "twitch_half_relaxation": _twitch_half_relaxation,
        "twitch_share": _twitch_share,
        "free_velocity": free_velocity,
        "passive_stiffness": _passive_stiffness,
        "held_stiffness": _held_stiffness,
        "held_damping_ratio": _held_damping_ratio,
        "stiffness_slope": _stiffness_slope,
    }
)
