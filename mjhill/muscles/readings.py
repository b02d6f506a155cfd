"""What a muscle is doing, from its parameters and states: the equations for whole muscles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mjhill.elements import (
    active_length_factor,
    contractile_velocity,
    hypothetical_force,
    series_force,
    series_stretch_at,
    velocity_scale,
)
from mjhill.joints.joint import Passive
from mjhill.muscles.hill import Hill

_Values = NDArray[np.float64]


def tension(muscle: Hill, stretch: float) -> float:
    """Force of the muscle [N·m or N] at a stretch of its series element; never negative."""
    return tension_and_stiffness(muscle, stretch)[0]


def series_stiffness(muscle: Hill, stretch: float) -> float:
    """Slope of the muscle's force over the stretch of its series element [N·m/rad or N/m]."""
    return tension_and_stiffness(muscle, stretch)[1]


def tension_and_stiffness(muscle: Hill, stretch: float) -> tuple[float, float]:
    """``tension`` and ``series_stiffness`` at a stretch, which come together."""
    force, stiffness = series_force(
        stretch, muscle.series_stretch, muscle.series_shape, muscle.series_limit
    )
    return muscle.max_isometric_force * force, muscle.max_isometric_force * stiffness


def series_energy(muscle: Hill, stretch: _Values) -> _Values:
    """Energy in the series element [J] at stretches of it [rad or m]: its force integrated."""
    taut = np.maximum(stretch, 0.0)
    rate = muscle.series_shape / muscle.series_stretch
    grown: _Values = _area(rate * taut, muscle.series_shape * muscle.series_limit) / rate
    scale = muscle.max_isometric_force / float(np.expm1(muscle.series_shape))
    return scale * (grown - taut)


def passive_energy(passive: Passive, deviation: _Values) -> _Values:
    """Energy in a joint's exponential elasticity [J] at deviations from its rest [rad or m]."""
    stored = np.zeros_like(deviation)
    for k1, k2, sign in (
        (passive.k1_pos, passive.k2_pos, 1.0),
        (passive.k1_neg, passive.k2_neg, -1.0),
    ):
        beyond = np.maximum(sign * deviation, 0.0)
        stored += k1 * (_area(k2 * beyond, passive.exponent_limit) / k2 - beyond)
    return stored


def _area(z: _Values, limit: float) -> _Values:
    """Integral from 0 to z of exp(z), which goes on straight past the limit."""
    past = np.maximum(z - limit, 0.0)
    area: _Values = np.expm1(np.minimum(z, limit)) + np.exp(limit) * (past + 0.5 * past**2)
    return area


def velocity_limit(muscle: Hill, activation: float, length: float) -> float:
    """Shortening velocity without load at an activation and a length [rad/s or m/s]."""
    hypothetical = isometric_share(muscle, activation, length)
    return muscle.max_velocity * velocity_scale(hypothetical, muscle.velocity_activation)


def isometric_share(muscle: Hill, activation: float, length: float) -> float:
    """Isometric force at an activation and a length [F_max]."""
    factor = active_length_factor(
        length, muscle.optimal_length, muscle.width_short, muscle.width_long
    )
    return hypothetical_force(activation, factor, muscle.activation_floor)


def shortening_velocity(muscle: Hill, activation: float, length: float, stretch: float) -> float:
    """Velocity of the contractile element [rad/s or m/s], positive when it shortens."""
    hypothetical = isometric_share(muscle, activation, length)
    velocity, _, _, _ = contractile_velocity(
        tension(muscle, stretch) / muscle.max_isometric_force,
        hypothetical,
        muscle.hill_shape,
        muscle.eccentric_plateau,
        muscle.eccentric_slope_ratio,
        muscle.viscosity,
    )
    return velocity * muscle.max_velocity * velocity_scale(hypothetical, muscle.velocity_activation)


def steady_stretch(muscle: Hill, activation: float, length: float) -> float:
    """Stretch of the series element [rad or m] once the muscle is still."""
    return series_stretch_at(
        isometric_share(muscle, activation, length),
        muscle.series_stretch,
        muscle.series_shape,
        muscle.series_limit,
    )
