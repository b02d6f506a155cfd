"""Where a free joint stays."""

from __future__ import annotations

from collections.abc import Mapping

from scipy.optimize import brentq

from mjhill.experiments.bench.rig import muscle_torque
from mjhill.parameters import Joint
from mjhill.reference import plant_torque


def resting_angle(joint: Joint, levels: Mapping[str, float] | None = None) -> float:
    """Angle [rad] at which a free joint stays under constant inputs, by default none.

    Relaxed muscles keep a trace of tension, which moves it a little from the angle without passive
    torque. A joint that nothing holds inside its range is taken to stay at that angle.

    Args:
        joint: The joint.
        levels: Input of each muscle; by default 0.
    """

    def net(angle: float) -> float:
        inputs = {**dict.fromkeys(joint.muscles, 0.0), **(levels or {})}
        muscles = sum(muscle_torque(joint, name, u, angle) for name, u in inputs.items())
        return plant_torque(joint, angle) + muscles

    low, high = joint.range
    if net(low) * net(high) > 0:
        return joint.rest_angle
    return float(brentq(net, low, high, xtol=1e-12))
