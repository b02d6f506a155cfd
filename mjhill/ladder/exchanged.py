"""Joints of ``hill`` with nonlinearities exchanged for what they are at the home angle."""

from __future__ import annotations

from dataclasses import replace
from math import exp, log1p

from mjhill.elements import active_length_factor
from mjhill.joints.joint import Joint
from mjhill.muscles.hill import Hill
from mjhill.simulate.reference import plant_torque

_NUDGE = 1e-5  # [rad]
_WIDE = 1000.0  # width [rad] of active force that leaves nothing of it; its largest


def with_flat_force(joint: Joint) -> Joint:
    """The joint with active force that does not depend on length; at home it is that of ``hill``.

    Raises:
        ValueError: A muscle is of another model than ``hill``.
    """
    muscles = {
        name: _flat(muscle, joint.gears[name] * joint.home_angle)
        for name, muscle in joint.hill_muscles.items()
    }
    return replace(joint, muscles=muscles)


def _flat(muscle: Hill, length: float) -> Hill:
    """F_max takes in the factor at a length; all that is in its units changes so as to stay."""
    factor = active_length_factor(
        length, muscle.optimal_length, muscle.width_short, muscle.width_long
    )
    shape = log1p(factor * (exp(muscle.series_shape) - 1))
    share = muscle.velocity_activation
    fastest = 1 - share + share * factor  # of V_max, at full activation
    return replace(
        muscle,
        max_isometric_force=factor * muscle.max_isometric_force,
        optimal_length=length,
        width_short=_WIDE,
        width_long=_WIDE,
        activation_floor=muscle.activation_floor / factor,
        series_shape=shape,
        series_stretch=muscle.series_stretch * shape / muscle.series_shape,
        series_limit=muscle.series_limit * muscle.series_shape / shape,
        max_velocity=fastest * muscle.max_velocity,
        velocity_activation=share * factor / fastest,
        viscosity=muscle.viscosity / factor,
    )


def with_linear_passive(joint: Joint) -> Joint:
    """The joint with passive torque that is linear in the angle: its tangent at the home angle."""
    home = joint.home_angle
    before, after = (plant_torque(joint, home + nudge) for nudge in (-_NUDGE, _NUDGE))
    stiffness = (before - after) / (2 * _NUDGE)
    return replace(
        joint,
        stiffness=stiffness,
        rest_angle=home + plant_torque(joint, home) / stiffness,
        passive=replace(joint.passive, k1_pos=0.0, k1_neg=0.0),
    )


def with_linear_elements(joint: Joint) -> Joint:
    """The joint with linear passive torque and muscles of the model ``hill-linear``.

    Raises:
        ValueError: A muscle cannot be made one of that model.
    """
    return with_linear_passive(joint).with_muscles("hill-linear")
