"""Joints that lack one of their nonlinearities, to see what comes from it."""

from __future__ import annotations

from dataclasses import replace

from mjhill.elements import active_length_factor
from mjhill.joints.joint import Joint
from mjhill.lab.rig import direction
from mjhill.simulate.reference import plant_torque

AS_IT_IS, FAST = "as it is", "without torque-velocity relation"
LINEAR, FLAT = "with linear elasticity", "with flat torque-angle relation"
SERIES = "with linear series element"

_WIDE = 1e3  # widths [rad] that leave nothing of the active torque-angle relation
_FAST = 50.0  # V_max in units of its own, at which force hardly depends on velocity
_STRAIGHT = 0.01  # shape at which the series element is linear to half a percent


def with_linear_elasticity(joint: Joint, muscle: str, travel: float) -> Joint:
    """The joint with the passive torque of a travel [rad] the muscle's way spread evenly over it.

    The travel is from the angle of rest.
    """
    torque = plant_torque(joint, joint.rest_angle + direction(joint, muscle) * travel)
    linear = replace(joint.passive, k1_pos=0.0, k1_neg=0.0)
    return replace(joint, stiffness=abs(torque / travel), passive=linear)


def with_flat_torque(joint: Joint, muscle: str, travel: float) -> Joint:
    """The joint with the muscle's isometric torque of a travel [rad] from rest at every angle."""
    own = joint.muscles[muscle]
    length = joint.gears[muscle] * (joint.rest_angle + direction(joint, muscle) * travel)
    share = active_length_factor(length, own.optimal_length, own.width_short, own.width_long)
    force = share * own.max_isometric_force
    flat = replace(own, max_isometric_force=force, width_short=_WIDE, width_long=_WIDE)
    return replace(joint, muscles={**joint.muscles, muscle: flat})


def with_fast_muscles(joint: Joint) -> Joint:
    """The joint with 50 times the V_max, so that force hardly depends on velocity."""
    muscles = {
        name: replace(muscle, max_velocity=_FAST * muscle.max_velocity)
        for name, muscle in joint.muscles.items()
    }
    return replace(joint, muscles=muscles)


def with_linear_series(joint: Joint) -> Joint:
    """The joint with linear series elements of the same stretch at full force."""
    muscles = {
        name: replace(muscle, series_shape=_STRAIGHT) for name, muscle in joint.muscles.items()
    }
    return replace(joint, muscles=muscles)
