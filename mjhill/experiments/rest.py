"""Where a joint stays when its muscles are relaxed."""

from __future__ import annotations

from scipy.optimize import brentq

from mjhill.experiments.rig import muscle_torque
from mjhill.parameters import Joint
from mjhill.reference import plant_torque


def relaxed_angle(joint: Joint) -> float:
    """Angle [rad] at which a free joint stays without input.

    Relaxed muscles keep a trace of tension, which moves it a little from the angle without passive
    torque.
    """

    def net(angle: float) -> float:
        muscles = sum(muscle_torque(joint, name, 0.0, angle) for name in joint.muscles)
        return plant_torque(joint, angle) + muscles

    low, high = joint.range
    if net(low) * net(high) > 0:  # no elasticity holds it in its range
        return joint.rest_angle
    return float(brentq(net, low, high, xtol=1e-12))
