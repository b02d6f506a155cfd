"""Where a free joint stays."""

from __future__ import annotations

from collections.abc import Mapping

from scipy.optimize import brentq

from mjhill.joints.joint import Joint
from mjhill.lab.rig import net_torque


def resting_angle(joint: Joint, levels: Mapping[str, float] | None = None) -> float:
    """Angle [rad] at which a free joint stays under constant inputs, by default none.

    Relaxed muscles keep a trace of tension, which moves it a little from the angle without passive
    torque. A joint that nothing holds inside its range is taken to stay at that angle.

    Args:
        joint: The joint.
        levels: Input of each muscle; by default 0.
    """

    def net(angle: float) -> float:
        return net_torque(joint, levels or {}, angle)

    low, high = joint.range
    if net(low) * net(high) > 0:
        return joint.rest_angle
    return float(brentq(net, low, high, xtol=1e-12))
