"""What a muscle does at a moment, from its parameters and states.

For muscles with Hill's contractile element; what is about the series element needs ``Hill``.
"""

from __future__ import annotations

from mjhill.elements import series_force, series_stretch_at
from mjhill.muscles.hill import MODEL, Hill, series_energy
from mjhill.muscles.hill import steady_stretch as _steady_stretch
from mjhill.muscles.parts import (
    Contractile,
    active_share,
    force_at_velocity,
    velocity_at_force,
    velocity_limit,
)

__all__ = [
    "contractile_force",
    "isometric_share",
    "series_energy",
    "series_stiffness",
    "shortening_velocity",
    "steady_stretch",
    "stretch_at",
    "tension",
    "velocity_at_share",
    "velocity_limit",
]


def tension(muscle: Hill, stretch: float) -> float:
    """Force of the muscle [N·m or N] at a stretch of its series element; never negative."""
    return _series(muscle, stretch)[0]


def series_stiffness(muscle: Hill, stretch: float) -> float:
    """Slope of the muscle's force over the stretch of its series element [N·m/rad or N/m]."""
    return _series(muscle, stretch)[1]


def stretch_at(muscle: Hill, force: float) -> float:
    """Stretch of the series element [rad or m] that carries a force [N·m or N]."""
    share = force / muscle.max_isometric_force
    return series_stretch_at(share, muscle.series_stretch, muscle.series_shape, muscle.series_limit)


def _series(muscle: Hill, stretch: float) -> tuple[float, float]:
    share, slope = series_force(
        stretch, muscle.series_stretch, muscle.series_shape, muscle.series_limit
    )
    return muscle.max_isometric_force * share, muscle.max_isometric_force * slope


def isometric_share(muscle: Contractile, activation: float, length: float) -> float:
    """Isometric force at an activation and a length [F_max]."""
    return float(MODEL.ask(active_share, muscle, a=activation, length=length))


def shortening_velocity(muscle: Hill, activation: float, length: float, stretch: float) -> float:
    """Velocity of the contractile element [rad/s or m/s], positive when it shortens."""
    share = tension(muscle, stretch) / muscle.max_isometric_force
    active = isometric_share(muscle, activation, length)
    return float(MODEL.ask(velocity_at_force, muscle, force=share, share=active))


def velocity_at_share(muscle: Contractile, share: float) -> float:
    """Velocity [rad/s or m/s] at which a fully active muscle has a share of its isometric force."""
    return float(MODEL.ask(velocity_at_force, muscle, force=share, share=1.0))


def contractile_force(
    muscle: Contractile, activation: float, length: float, velocity: float
) -> float:
    """Force [N·m or N] of a contractile element that shortens at a velocity, never below 0."""
    share = isometric_share(muscle, activation, length)
    force = MODEL.ask(force_at_velocity, muscle, velocity=velocity, share=share)
    return muscle.max_isometric_force * float(force)


def steady_stretch(muscle: Hill, activation: float, length: float) -> float:
    """Stretch of the series element [rad or m] once the muscle is still."""
    return float(MODEL.ask(_steady_stretch, muscle, a=activation, length=length))
