"""Joints without one of their nonlinearities, to see what that nonlinearity causes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from mjhill.elements import active_length_factor, series_force, velocity_scale
from mjhill.joints.joint import Joint
from mjhill.lab.rig import direction
from mjhill.muscles.hill import Hill
from mjhill.muscles.readings import isometric_share, steady_stretch
from mjhill.simulate.reference import plant_torque

AS_IT_IS, FAST = "as it is", "without torque-velocity relation"
LINEAR, FLAT = "with linear elasticity", "with flat torque-angle relation"
SERIES = "with linear series element"

_WIDE = 1e3  # widths [rad] that leave nothing of the active torque-angle relation
_FAST = 50.0  # factor on V_max at which force hardly depends on velocity
_STRAIGHT_SERIES = 0.01  # shape: the series stiffness changes by 1 % up to F_max
_STRAIGHT_HILL, _FLAT_PLATEAU = 10.0, 3.0  # the bounds of a muscle's parameters
_VISCOSITY = 1.0  # parallel to the contractile element [F_max/V_max], the bound again


def with_linear_elasticity(joint: Joint, muscle: str, travel: float) -> Joint:
    """The joint with a constant passive stiffness.

    It is the mean stiffness over a travel [rad] from the angle of rest in the muscle's direction.
    """
    torque = plant_torque(joint, joint.rest_angle + direction(joint, muscle) * travel)
    linear = replace(joint.passive, k1_pos=0.0, k1_neg=0.0)
    return replace(joint, stiffness=abs(torque / travel), passive=linear)


def with_flat_torque(joint: Joint, muscle: str, travel: float) -> Joint:
    """The joint with the same isometric torque of a muscle at every angle.

    It is the torque after a travel [rad] from the angle of rest in the muscle's direction.
    """
    own = joint.hill_muscles[muscle]
    length = joint.gears[muscle] * (joint.rest_angle + direction(joint, muscle) * travel)
    share = active_length_factor(length, own.optimal_length, own.width_short, own.width_long)
    force = share * own.max_isometric_force
    flat = replace(own, max_isometric_force=force, width_short=_WIDE, width_long=_WIDE)
    return replace(joint, muscles={**joint.muscles, muscle: flat})


def with_fast_muscles(joint: Joint) -> Joint:
    """The joint with 50 times the V_max, so that force hardly depends on velocity."""
    return _changed(joint, lambda _, one: replace(one, max_velocity=_FAST * one.max_velocity))


def with_linear_series(joint: Joint) -> Joint:
    """The joint with linear series elements of the same stretch at full force."""
    return _changed(joint, lambda _, one: replace(one, series_shape=_STRAIGHT_SERIES))


def with_linear_elements(
    joint: Joint,
    excitations: Mapping[str, float],
    angle: float,
    *,
    series: bool = True,
    contractile: bool = True,
) -> Joint:
    """The joint with elements that are linear about an operating point.

    The series element keeps the stiffness that it has at these excitations, and the contractile
    element its slope of torque over velocity. The latter comes from a viscosity that does not
    depend on activation, beside a Hill relation that is nearly straight. A rest of the slope, at
    most about a third at half excitation, still scales with activation. A linear series element
    still goes slack.

    Args:
        joint: The joint.
        excitations: Excitation of each muscle [-].
        angle: The posture [rad].
        series: Whether to make the series element linear.
        contractile: Whether to make the contractile element linear.
    """

    def linear(name: str, muscle: Hill) -> Hill:
        length = joint.gears[name] * angle
        if series:
            muscle = _linear_series(muscle, excitations[name], length)
        if contractile:
            muscle = _linear_contractile(muscle, excitations[name], length)
        return muscle

    return _changed(joint, linear)


def contractile_viscosity(muscle: Hill, excitation: float, length: float) -> float:
    """Slope of force over velocity of the contractile element at rest [N·m·s/rad or N·s/m]."""
    share = isometric_share(muscle, excitation, length)
    fastest = muscle.max_velocity * velocity_scale(share, muscle.velocity_activation)
    slope = share * (1 + muscle.hill_shape) / muscle.hill_shape + muscle.viscosity
    return muscle.max_isometric_force * slope / fastest


def series_stiffness(muscle: Hill, excitation: float, length: float) -> float:
    """Stiffness of the series element of a muscle in steady state [N·m/rad or N/m]."""
    stretch = steady_stretch(muscle, excitation, length)
    _, slope = series_force(
        stretch, muscle.series_stretch, muscle.series_shape, muscle.series_limit
    )
    return muscle.max_isometric_force * slope


def _changed(joint: Joint, change: Callable[[str, Hill], Hill]) -> Joint:
    muscles = {name: change(name, muscle) for name, muscle in joint.hill_muscles.items()}
    return replace(joint, muscles=muscles)


def _linear_series(muscle: Hill, excitation: float, length: float) -> Hill:
    stretch = muscle.max_isometric_force / series_stiffness(muscle, excitation, length)
    return replace(muscle, series_shape=_STRAIGHT_SERIES, series_stretch=stretch)


def _linear_contractile(muscle: Hill, excitation: float, length: float) -> Hill:
    straight = replace(
        muscle,
        hill_shape=_STRAIGHT_HILL,
        eccentric_plateau=_FLAT_PLATEAU,
        eccentric_slope_ratio=1.0,
        velocity_activation=0.0,
        viscosity=_VISCOSITY,
    )
    # the slope is inversely proportional to V_max, so V_max sets it
    factor = contractile_viscosity(straight, excitation, length) / contractile_viscosity(
        muscle, excitation, length
    )
    return replace(straight, max_velocity=straight.max_velocity * factor)
