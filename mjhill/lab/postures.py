"""Postures: where a joint stays, the excitations that hold it there, its static stiffness.

At a co-contraction u, the muscles on the side that must pull harder have excitation u. Those on the
other side have the excitation that balances them and the passive torque.
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

_TILT = 1e-4  # step to either side, for a slope [rad]
_POSTURES = 121  # tried over the range of motion if the joint does not stay at its home angle

Condition = Callable[[float], dict[str, float]]
"""Excitation of each muscle as a function of the angle [rad]; may raise UnmeasuredError."""


@dataclass(frozen=True)
class NotHeld:
    """A condition in which the joint does not stay at the posture.

    Attributes:
        label: The condition, such as ``co-contraction 0.5``.
        reason: Why the joint does not stay.
    """

    label: str
    reason: str


def resting_angle(joint: Joint, excitations: Mapping[str, float] | None = None) -> float:
    """Angle [rad] at which a free joint stays under constant excitations, by default 0.

    Relaxed muscles keep a little tension, which moves the joint slightly away from the angle
    without passive torque. That angle is returned if no angle in the range is in balance.
    """

    def net(angle: float) -> float:
        return net_torque(joint, excitations or {}, angle)

    low, high = joint.range
    if net(low) * net(high) > 0:
        return joint.rest_angle
    return float(brentq(net, low, high, xtol=1e-12))


def static_stiffness(joint: Joint, excitations: Mapping[str, float], angle: float) -> float:
    """Slope [N·m/rad] of the steady restoring torque; the joint drifts away if it is negative."""
    ends = (
        net_torque(joint, excitations, angle - _TILT),
        net_torque(joint, excitations, angle + _TILT),
    )
    return (ends[0] - ends[1]) / (2 * _TILT)


def balancing_excitations(joint: Joint, cocontraction: float, angle: float) -> dict[str, float]:
    """Excitations at a co-contraction [-] with which a joint is in balance at an angle [rad].

    Raises:
        UnmeasuredError: The co-contraction is too low to hold the joint there.
    """

    def excitations(share: float, weaker: float) -> dict[str, float]:
        return {
            name: share * cocontraction if direction(joint, name) == weaker else cocontraction
            for name in joint.muscles
        }

    weaker = 1.0 if net_torque(joint, excitations(1.0, 1.0), angle) >= 0 else -1.0
    if weaker * net_torque(joint, excitations(0.0, weaker), angle) > 0:
        raise UnmeasuredError(
            f"an excitation of {cocontraction:g} is too low to hold {joint.name} at "
            f"{degrees(angle):.3g}°"
        )
    share = brentq(lambda x: net_torque(joint, excitations(x, weaker), angle), 0, 1, xtol=1e-14)
    return excitations(float(share), weaker)


def tonic_excitations(
    joint: Joint, agonist: str, angle: float, tonic: float = 0.0
) -> dict[str, float]:
    """Smallest excitations of an agonist and its antagonist that hold a joint at an angle [rad].

    Neither is below ``tonic`` [-], and only one above; other muscles are off.

    Raises:
        UnmeasuredError: Full excitation does not hold the joint there.
    """
    other = antagonist(joint, agonist)
    both = {**dict.fromkeys(joint.muscles, 0.0), agonist: tonic, other: tonic}
    rest = net_torque(joint, both, angle)
    if rest == 0:
        return both
    holder = agonist if rest * direction(joint, agonist) < 0 else other
    if rest * net_torque(joint, {**both, holder: 1.0}, angle) > 0:
        raise UnmeasuredError(
            f"full excitation of {holder} does not hold {joint.name} at {degrees(angle):.3g}°"
        )
    root = brentq(lambda u: net_torque(joint, {**both, holder: u}, angle), tonic, 1.0, xtol=1e-12)
    return {**both, holder: float(root)}


def stable_excitations(
    joint: Joint, condition: Condition, angle: float, support: float = 0.0
) -> dict[str, float]:
    """Excitations of a condition, if the joint is in stable balance with them.

    Args:
        joint: The joint.
        condition: Excitations as a function of the angle.
        angle: The posture [rad].
        support: Stiffness of an external spring [N·m/rad].

    Raises:
        UnmeasuredError: There are no such excitations, or the balance is not stable.
    """
    excitations = condition(angle)
    stiffness = static_stiffness(joint, excitations, angle) + support
    if stiffness <= 0:
        raise UnmeasuredError(
            f"{joint.name} drifts away from {degrees(angle):.3g}°: the static stiffness with "
            f"these excitations is {stiffness:.2g} N·m/rad, and it must be positive"
        )
    return excitations


def held_cocontractions(
    joint: Joint, cocontractions: Sequence[float], angle: float, support: float = 0.0
) -> tuple[dict[float, dict[str, float]], tuple[NotHeld, ...]]:
    """Excitations at each co-contraction at which the joint stays, and those at which it does not.

    Raises:
        UnmeasuredError: The joint stays at none of them.
    """
    held, lost = {}, []
    for u in cocontractions:
        try:
            held[u] = stable_excitations(
                joint, partial(balancing_excitations, joint, u), angle, support
            )
        except UnmeasuredError as error:
            lost.append(NotHeld(f"co-contraction {u:g}", str(error)))
    if not held:
        raise UnmeasuredError("; ".join(one.reason for one in lost))
    return held, tuple(lost)


def stablest_angle(joint: Joint, conditions: Sequence[Condition], support: float = 0.0) -> float:
    """One posture [rad] for several conditions.

    This is the home angle if the joint stays there in each condition. Else it is the angle in the
    range of motion at which the joint stays in the most conditions; among several such angles, the
    one whose smallest static stiffness is largest.
    """

    def worth(angle: float) -> tuple[int, float]:
        found = []
        for condition in conditions:
            try:
                excitations = stable_excitations(joint, condition, angle, support)
            except UnmeasuredError:
                continue
            found.append(static_stiffness(joint, excitations, angle))
        return len(found), min(found, default=0.0)

    if worth(joint.home_angle)[0] == len(conditions):
        return joint.home_angle
    angles = [joint.home_angle, *np.linspace(*joint.range, _POSTURES).tolist()]
    return float(max(angles, key=worth))


def check_angle(joint: Joint, angle: float | None) -> None:
    """Refuse a posture [rad] outside the range of motion.

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
        ValueError: There are too few, they do not ascend, or one is outside.
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
