"""A joint whose series and contractile elements are linear, for what nonlinearity does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from mjhill.elements import series_force, velocity_scale
from mjhill.joints.joint import Joint
from mjhill.muscles.hill import Hill
from mjhill.muscles.readings import isometric_share, steady_stretch

_STRAIGHT_SERIES = 0.01  # shape: its stiffness changes by 1 % up to F_max
_STRAIGHT_HILL, _FLAT_PLATEAU = 10.0, 3.0  # the bounds of what a muscle may have
_VISCOSITY = 1.0  # beside the contractile element [F_max/V_max], likewise


def linear_elements(
    joint: Joint,
    levels: Mapping[str, float],
    angle: float,
    *,
    series: bool = True,
    contractile: bool = True,
) -> Joint:
    """The joint with elements that do at any input what they do at some.

    The series element keeps the stiffness that it has at these inputs, the contractile element the
    slope of its torque over velocity. The latter is done with a viscosity that does not depend on
    activation and a Hill relation that is nearly straight; what is left of it, at most about a
    third of the slope at half input, still scales with activation. A linear series element still
    goes slack.

    Args:
        joint: The joint.
        levels: Inputs by muscle name.
        angle: The posture [rad].
        series: Whether the series element is made linear.
        contractile: Whether the contractile element is.
    """
    muscles = {}
    for name, muscle in joint.muscles.items():
        length = joint.gears[name] * angle
        changed = muscle
        if series:
            changed = _linear_series(changed, levels[name], length)
        if contractile:
            changed = _linear_contractile(changed, levels[name], length)
        muscles[name] = changed
    return replace(joint, muscles=MappingProxyType(muscles))


def contractile_viscosity(muscle: Hill, level: float, length: float) -> float:
    """Torque over velocity of the contractile element about rest [N·m·s/rad or N·s/m]."""
    share = isometric_share(muscle, level, length)
    fastest = muscle.max_velocity * velocity_scale(share, muscle.velocity_activation)
    slope = share * (1 + muscle.hill_shape) / muscle.hill_shape + muscle.viscosity
    return muscle.max_isometric_force * slope / fastest


def series_stiffness(muscle: Hill, level: float, length: float) -> float:
    """Stiffness of the series element of a still muscle [N·m/rad or N/m]."""
    stretch = steady_stretch(muscle, level, length)
    _, slope = series_force(
        stretch, muscle.series_stretch, muscle.series_shape, muscle.series_limit
    )
    return muscle.max_isometric_force * slope


def _linear_series(muscle: Hill, level: float, length: float) -> Hill:
    stretch = muscle.max_isometric_force / series_stiffness(muscle, level, length)
    return replace(muscle, series_shape=_STRAIGHT_SERIES, series_stretch=stretch)


def _linear_contractile(muscle: Hill, level: float, length: float) -> Hill:
    straight = replace(
        muscle,
        hill_shape=_STRAIGHT_HILL,
        eccentric_plateau=_FLAT_PLATEAU,
        eccentric_slope_ratio=1.0,
        velocity_activation=0.0,
        viscosity=_VISCOSITY,
    )
    # viscosity goes with one over the largest velocity, so that sets it
    factor = contractile_viscosity(straight, level, length) / contractile_viscosity(
        muscle, level, length
    )
    return replace(straight, max_velocity=straight.max_velocity * factor)
