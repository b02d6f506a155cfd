"""Postures that muscles hold together: inputs in balance, static stiffness, where a joint stays.

At a co-contraction level, the muscles of the side that has to work harder have the level as their
input, those of the other side as much as balances them and the passive torque.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import degrees

import numpy as np
from scipy.optimize import brentq

from mjhill.joints.joint import Joint
from mjhill.lab.rig import UnmeasuredError, antagonist, direction, net_torque

_TILT = 1e-4  # either way, for a slope [rad]
_POSTURES = 121  # looked at over the range of motion, where the home angle will not do

Condition = Callable[[float], dict[str, float]]  # inputs at an angle [rad], or UnmeasuredError


@dataclass(frozen=True)
class Unheld:
    """A condition that a joint does not stay in.

    Attributes:
        label: The condition, such as ``co-contraction 0.5``.
        reason: Why.
    """

    label: str
    reason: str


def static_stiffness(joint: Joint, inputs: Mapping[str, float], angle: float) -> float:
    """Slope [N·m/rad] of the steady torque that brings a joint back; negative: it drifts off."""
    ends = (net_torque(joint, inputs, angle - _TILT), net_torque(joint, inputs, angle + _TILT))
    return (ends[0] - ends[1]) / (2 * _TILT)


def balanced(joint: Joint, level: float, angle: float) -> dict[str, float]:
    """Inputs at a co-contraction level with which a joint is in balance at an angle [rad].

    Raises:
        UnmeasuredError: The level is too low to hold the joint there.
    """

    def inputs(share: float, yielding: float) -> dict[str, float]:
        return {
            name: share * level if direction(joint, name) == yielding else level
            for name in joint.muscles
        }

    yielding = 1.0 if net_torque(joint, inputs(1.0, 1.0), angle) >= 0 else -1.0
    if yielding * net_torque(joint, inputs(0.0, yielding), angle) > 0:
        raise UnmeasuredError(
            f"an input of {level:g} is too little to hold {joint.name} at {degrees(angle):.3g}°"
        )
    share = brentq(lambda x: net_torque(joint, inputs(x, yielding), angle), 0, 1, xtol=1e-14)
    return inputs(float(share), yielding)


def holding(joint: Joint, agonist: str, angle: float) -> dict[str, float]:
    """Inputs of the least effort that hold a joint at an angle [rad]: one muscle's, or none.

    Raises:
        UnmeasuredError: Full input does not hold it there.
    """
    levels = dict.fromkeys(joint.muscles, 0.0)
    rest = net_torque(joint, levels, angle)
    if rest == 0:
        return levels
    needs_agonist = rest * direction(joint, agonist) < 0
    holder = agonist if needs_agonist else antagonist(joint, agonist)
    if rest * net_torque(joint, {holder: 1.0}, angle) > 0:
        raise UnmeasuredError(
            f"full input of {holder} does not hold {joint.name} at {degrees(angle):.3g}°"
        )
    root = brentq(lambda u: net_torque(joint, {holder: u}, angle), 0.0, 1.0, xtol=1e-12)
    return {**levels, holder: float(root)}


def stay(
    joint: Joint, condition: Condition, angle: float, support: float = 0.0
) -> dict[str, float]:
    """Inputs of a condition that a joint does not drift out of by itself.

    Args:
        joint: The joint.
        condition: The inputs as a function of angle.
        angle: The posture [rad].
        support: Stiffness of a spring that helps [N·m/rad].

    Raises:
        UnmeasuredError: There are no such inputs, or the balance is not stable.
    """
    inputs = condition(angle)
    stiffness = static_stiffness(joint, inputs, angle) + support
    if stiffness <= 0:
        raise UnmeasuredError(
            f"{joint.name} drifts away from {degrees(angle):.3g}°: the torque of its active "
            f"muscles changes with angle such that the static stiffness is {stiffness:.2g} N·m/rad"
        )
    return inputs


def held_levels(
    joint: Joint, levels: Sequence[float], angle: float, support: float = 0.0
) -> tuple[dict[float, dict[str, float]], tuple[Unheld, ...]]:
    """Inputs at the levels at which the joint stays, and the levels at which it does not.

    Raises:
        UnmeasuredError: It stays at none.
    """
    held, unheld = {}, []
    for level in levels:
        try:
            held[level] = stay(joint, partial(balanced, joint, level), angle, support)
        except UnmeasuredError as error:
            unheld.append(Unheld(f"co-contraction {level:g}", str(error)))
    if not held:
        raise UnmeasuredError("; ".join(one.reason for one in unheld))
    return held, tuple(unheld)


def steadiest(joint: Joint, conditions: Sequence[Condition], support: float = 0.0) -> float:
    """The posture [rad] for all of several conditions.

    The home angle if the joint stays there in each; else the angle of the range of motion at which
    it stays in the most, and of those the one whose least static stiffness is the largest.
    """

    def worth(angle: float) -> tuple[int, float]:
        found = []
        for condition in conditions:
            try:
                inputs = stay(joint, condition, angle, support)
            except UnmeasuredError:
                continue
            found.append(static_stiffness(joint, inputs, angle))
        return len(found), min(found, default=0.0)

    if worth(joint.home_angle)[0] == len(conditions):
        return joint.home_angle
    angles = [joint.home_angle, *np.linspace(*joint.range, _POSTURES).tolist()]
    return float(max(angles, key=worth))


def check_angle(joint: Joint, angle: float | None) -> None:
    """Refuse a posture outside the range of motion.

    Raises:
        ValueError: It is outside.
    """
    low, high = joint.range
    if angle is not None and not low <= angle <= high:
        raise ValueError(
            f"angle must be in the range of {joint.name}, {low:g} to {high:g} rad, got {angle!r}"
        )


def check_ascending(
    name: str, values: Iterable[float], low: float, high: float, least: int = 2
) -> tuple[float, ...]:
    """Values that ascend within (low, high].

    Raises:
        ValueError: They are too few, do not ascend, or one is outside.
    """
    found = tuple(float(value) for value in values)
    ascending = all(a < b for a, b in pairwise(found))
    if len(found) < least or not ascending or not all(low < value <= high for value in found):
        raise ValueError(
            f"{name} must be {least} or more ascending numbers in ({low:g}, {high:g}], got {found}"
        )
    return found


def check_between(name: str, value: float, low: float, high: float, unit: str) -> None:
    """Refuse a number outside (low, high].

    Raises:
        ValueError: It is outside.
    """
    if not low < value <= high:
        raise ValueError(f"{name} must be in ({low:g}, {high:g}] {unit}, got {value!r}")
