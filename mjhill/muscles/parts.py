"""Parameters that several models share: activation, and the contractile element.

Equation numbers are those of Winters & Stark (1987).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mjhill.elements import (
    active_length_factor,
    contractile_force,
    contractile_velocity,
    hypothetical_force,
    velocity_scale,
)
from mjhill.muscles.model import Muscle, State, Values
from mjhill.quantity import LENGTH, VELOCITY, flag, quantity

EXCITATION = State("n", "-", "excitation after the lag of the motor neurons", share=True)
ACTIVATION = State("a", "-", "activation", share=True)


@dataclass(frozen=True, kw_only=True)
class Activated(Muscle):
    """A muscle with neural excitation (NEX) and activation (ACT), sect. 3.1."""

    # below a microsecond nothing is left to resolve, and n - a over it is rounding
    excitation_tau: float = quantity(
        "τ_nex", "s", "neural excitation, time constant (12)",
        (1e-6, 1), low_allowed=True, array="dynprm",
    )  # fmt: skip
    activation_tau: float = quantity(
        "τ_act", "s", "activation, time constant (12)",
        (1e-6, 1), low_allowed=True, array="dynprm",
    )  # fmt: skip
    deactivation_tau: float = quantity(
        "τ_deact", "s", "deactivation, time constant (12)",
        (1e-6, 1), low_allowed=True, array="dynprm",
    )  # fmt: skip
    electrical_stimulation: bool = flag(default=False, array="dynprm")
    activation_floor: float = quantity(
        "a_min", "-", "least active state a g; keeps a relaxed muscle taut",
        (1e-6, 0.1), default=1e-3, low_allowed=True, array="dynprm",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class LengthDependent(Activated):
    """A muscle whose active force depends on its length (ATA), sect. 3.2."""

    optimal_length: float = quantity(
        "L_opt", LENGTH, "length at which active force is largest",
        (-100, 100), low_allowed=True, array="gainprm",
    )  # fmt: skip
    width_short: float = quantity(
        "w_short", LENGTH, "Gaussian width of active force below the optimum",
        (0, 1000), array="gainprm",
    )  # fmt: skip
    width_long: float = quantity(
        "w_long", LENGTH, "Gaussian width of active force above the optimum",
        (0, 1000), array="gainprm",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Contractile(LengthDependent):
    """A muscle with Hill's contractile element: force over velocity (CE), sect. 2.2 and 3.2."""

    max_velocity: float = quantity(
        # the slowest muscles shorten by a tenth of their length in a second; a muscle that
        # is far slower than its joint holds it like a rope, at any force
        "V_max", VELOCITY, "shortening velocity without load (eq. 3)",
        (1e-4, 1e4), low_allowed=True, array="biasprm",
    )  # fmt: skip
    hill_shape: float = quantity(
        # below 0.05 a muscle holds or slips like a clutch, which no timestep resolves
        "A", "-", "Hill's a/F0, curvature of force-velocity (eq. 3)",
        (0.05, 10), low_allowed=True, array="biasprm",
    )  # fmt: skip
    eccentric_plateau: float = quantity(
        "P", "-", "force in fast lengthening, in units of isometric force",
        (1, 3), default=1.3, array="biasprm",
    )  # fmt: skip
    eccentric_slope_ratio: float = quantity(
        "R", "-", "slope of force-velocity just in lengthening over just in shortening",
        (1e-3, 20), default=1.0, low_allowed=True, array="biasprm",
    )  # fmt: skip
    viscosity: float = quantity(
        "β", "-", "viscosity beside the contractile element, in units of F_max/V_max",
        (1e-6, 1), default=1e-3, low_allowed=True, array="biasprm",
    )  # fmt: skip
    velocity_activation: float = quantity(
        "κ", "-", "share of V_max that scales with active state: V_max (1 - κ + κ a g)",
        (0, 1), default=0.0, low_allowed=True, array="biasprm",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class SeriesElement:
    """An exponential series element (SE), eqs. 6-7, beside what else a muscle has."""

    series_stretch: float = quantity(
        # a nanometre; where it is shorter, products of its stiffness overflow
        "x_max", LENGTH, "stretch of the series element at F_max (eq. 7)",
        (1e-9, 100), low_allowed=True, array="gainprm",
    )  # fmt: skip
    series_shape: float = quantity(
        # above 10 stiffness rises by four powers of ten within the working range
        "S", "-", "shape of the exponential series element (eq. 7)",
        (0.01, 10), default=3.0, low_allowed=True, array="gainprm",
    )  # fmt: skip
    series_limit: float = quantity(
        "r", "-", "stretch, in units of x_max, past which the series element goes on straight",
        (1, 10), default=2.0, low_allowed=True, array="gainprm",
    )  # fmt: skip


def time_constants(
    excitation_tau: Values,
    activation_tau: Values,
    deactivation_tau: Values,
    electrical_stimulation: Values,
) -> dict[str, Values]:
    """Time constants of n and a [s]; electrical stimulation leaves n out."""
    return {
        "excitation_tau": np.where(electrical_stimulation > 0, np.inf, excitation_tau),
        "activation_tau": activation_tau,
        "deactivation_tau": deactivation_tau,
    }


def active_share(
    a: float,
    length: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
) -> float:
    """Isometric force at an activation and a length [F_max] (below eq. 5)."""
    factor = active_length_factor(length, optimal_length, width_short, width_long)
    return hypothetical_force(a, factor, activation_floor)


def velocity_at_force(
    force: float,
    share: float,
    max_velocity: float,
    hill_shape: float,
    eccentric_plateau: float,
    eccentric_slope_ratio: float,
    viscosity: float,
    velocity_activation: float,
) -> float:
    """Velocity [length/s] of a contractile element that carries a force [F_max].

    ``share`` is its isometric force [F_max], see ``active_share``.
    """
    velocity, _, _, _ = contractile_velocity(
        force, share, hill_shape, eccentric_plateau, eccentric_slope_ratio, viscosity
    )
    return velocity * max_velocity * velocity_scale(share, velocity_activation)


def force_at_velocity(
    velocity: float,
    share: float,
    max_velocity: float,
    hill_shape: float,
    eccentric_plateau: float,
    eccentric_slope_ratio: float,
    viscosity: float,
    velocity_activation: float,
) -> float:
    """Force [F_max] of a contractile element that shortens at a velocity [length/s].

    ``velocity_at_force`` the other way round; never below 0.
    """
    return contractile_force(
        velocity / (max_velocity * velocity_scale(share, velocity_activation)),
        share, hill_shape, eccentric_plateau, eccentric_slope_ratio, viscosity,
    )  # fmt: skip


def lengthening(
    max_isometric_force: float,
    activation_floor: float,
    eccentric_plateau: float,
    viscosity: float,
    max_velocity: float,
    velocity_activation: float,
) -> tuple[float, float]:
    """Largest force in slow lengthening, and what each unit of lengthening rate adds to it."""
    # the least that V_max can scale to
    slowest = max_velocity * (1.0 - velocity_activation * (1.0 - activation_floor))
    return max_isometric_force * eccentric_plateau, max_isometric_force * viscosity / slowest


def unloaded_velocity(max_velocity: float) -> float:
    """V_max [length/s]."""
    return max_velocity


def velocity_limit(muscle: Contractile, activation: float, length: float) -> float:
    """Shortening velocity without load at an activation and a length [rad/s or m/s]."""
    share = active_share(
        activation, length, muscle.activation_floor, muscle.optimal_length, muscle.width_short,
        muscle.width_long,
    )  # fmt: skip
    return muscle.max_velocity * velocity_scale(share, muscle.velocity_activation)


def viscous_loss(muscle: Contractile, time: Values, recorded: Mapping[str, Values]) -> Values:
    """Energy [J] lost in the viscosity beside the contractile element, shape (T,).

    Viscosity times F_max times v²/V_max, summed.
    """
    velocity, scale = recorded["velocity"], np.full(len(time), muscle.max_velocity)
    if muscle.velocity_activation:
        pairs = zip(recorded["a"].tolist(), recorded["length"].tolist(), strict=True)
        scale = np.array([velocity_limit(muscle, *pair) for pair in pairs])
    mean = 0.5 * (scale[1:] + scale[:-1])
    pull = muscle.viscosity * muscle.max_isometric_force * velocity[1:] / mean
    return np.concatenate(([0.0], np.cumsum(pull * velocity[1:] * np.diff(time))))


def exponential_area(z: Values, limit: float) -> Values:
    """Integral from 0 to z of exp(z), which goes on straight past the limit."""
    past = np.maximum(z - limit, 0.0)
    return np.asarray(np.expm1(np.minimum(z, limit)) + np.exp(limit) * (past + 0.5 * past**2))
