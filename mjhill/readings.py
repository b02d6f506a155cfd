"""What a muscle is doing, from its parameters and states: the equations for whole muscles."""

from __future__ import annotations

from mjhill.elements import (
    active_length_factor,
    contractile_velocity,
    hypothetical_force,
    series_force,
    series_stretch_at,
    velocity_scale,
)
from mjhill.parameters import Muscle


def tension(muscle: Muscle, stretch: float) -> float:
    """Force of the muscle [N·m or N] at a stretch of its series element; never negative."""
    force, _ = series_force(
        stretch, muscle.series_stretch, muscle.series_shape, muscle.series_limit
    )
    return muscle.max_isometric_force * force


def isometric_share(muscle: Muscle, activation: float, length: float) -> float:
    """Isometric force at an activation and a length [F_max]."""
    factor = active_length_factor(
        length, muscle.optimal_length, muscle.width_short, muscle.width_long
    )
    return hypothetical_force(activation, factor, muscle.activation_floor)


def shortening_velocity(muscle: Muscle, activation: float, length: float, stretch: float) -> float:
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


def steady_stretch(muscle: Muscle, activation: float, length: float) -> float:
    """Stretch of the series element [rad or m] once the muscle is still."""
    return series_stretch_at(
        isometric_share(muscle, activation, length),
        muscle.series_stretch,
        muscle.series_shape,
        muscle.series_limit,
    )
