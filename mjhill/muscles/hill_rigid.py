"""The Hill muscle without a series element: its tendon is rigid; states n and a.

The contractile element has the actuator's length and velocity, so force follows them at once.
This is what MuJoCo's native muscle assumes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mjhill.elements import activation_rate, excitation_rate
from mjhill.muscles.model import MuscleModel, Series, Track, Values, same_parameters
from mjhill.muscles.parts import (
    ACTIVATION,
    EXCITATION,
    Contractile,
    active_share,
    force_at_velocity,
    lengthening,
    time_constants,
    unloaded_velocity,
    viscous_loss,
)
from mjhill.muscles.scheme import activation_rates


@dataclass(frozen=True, kw_only=True)
class HillRigid(Contractile):
    """One muscle without a series element: neural excitation, activation, contractile element.

    On a joint, force is a torque [N·m] and length an angle [rad]; on a tendon, force [N] and
    length [m]. Lengths are MuJoCo's actuator length less its value at ``qpos0``: they grow as
    the muscle is stretched. Equation numbers are those of Winters & Stark (1987).

    Attributes:
        sources: Where each value comes from, by parameter name.
    """


def rates(
    staged: bool,
    u: float,
    n: float,
    a: float,
    timestep: float,
    excitation_tau: float,
    activation_tau: float,
    deactivation_tau: float,
    electrical_stimulation: float,
) -> tuple[float, float]:
    """Rates of n and a [1/s] for MuJoCo to advance by a timestep."""
    n_rate, a_rate, _ = activation_rates(
        staged, u, n, a, timestep, excitation_tau, activation_tau, deactivation_tau,
        electrical_stimulation,
    )  # fmt: skip
    return n_rate, a_rate


def tension(
    a: float,
    length: float,
    length_rate: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    max_velocity: float,
    hill_shape: float,
    eccentric_plateau: float,
    eccentric_slope_ratio: float,
    viscosity: float,
    velocity_activation: float,
    max_isometric_force: float,
) -> float:
    """Tension [N·m or N]: that of the contractile element at the actuator's velocity."""
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    return max_isometric_force * force_at_velocity(
        -length_rate, share, max_velocity, hill_shape, eccentric_plateau, eccentric_slope_ratio,
        viscosity, velocity_activation,
    )  # fmt: skip


def derivatives(
    u: float,
    n: float,
    a: float,
    excitation_tau: float,
    activation_tau: float,
    deactivation_tau: float,
    electrical_stimulation: float,
) -> tuple[float, float]:
    """True rates of n and a [1/s]."""
    source = u if electrical_stimulation > 0 else n
    return (
        excitation_rate(u, n, excitation_tau),
        activation_rate(source, a, activation_tau, deactivation_tau),
    )


def steady(u: float) -> tuple[float, float]:
    """States n and a at rest."""
    return u, u


def at_full_force(
    max_isometric_force: Values,
    max_velocity: Values,
    hill_shape: Values,
    viscosity: Values,
    eccentric_slope_ratio: Values,
) -> tuple[Values, Values, Values]:
    """Stiffness, rate of yielding and viscosity about rest at full activation."""
    slope = (1 + 1 / hill_shape) * np.maximum(eccentric_slope_ratio, 1.0) + viscosity
    none = np.zeros_like(slope)
    return none, none, max_isometric_force * slope / max_velocity


def compliance(width_short: float) -> float:
    """Shortening from the optimum by which active force falls to 1/e [rad or m]."""
    return width_short


def series(track: Track) -> Series:
    """What a recording shows of a muscle; docs/energy.md has the equations."""
    work = track.work(track.force, -track.length)
    yield "n", "-", track.states["n"]
    yield "a", "-", track.states["a"]
    yield "velocity", "rate", -track.length_rate
    yield "force", "force", track.force
    yield "length", "length", track.length
    yield "length_rate", "rate", track.length_rate
    first = -float(track.force[0]) * float(track.length_rate[0])
    yield "power", "power", track.power(work, first)
    yield "work", "energy", work


def shortening_velocity(length_rate: float) -> float:
    """Velocity of the contractile element [rad/s or m/s], positive when it shortens."""
    return -length_rate


MODEL = MuscleModel(
    name="hill-rigid",
    tag=198703.0,
    meaning="Hill's contractile element on a rigid tendon, as MuJoCo's native muscle",
    parameters=HillRigid,
    states=(EXCITATION, ACTIVATION),
    rates=rates,
    force=tension,
    derivatives=derivatives,
    tension=tension,
    steady=steady,
    series=series,
    readings={"velocity": ("rate", shortening_velocity)},
    at_full_force=at_full_force,
    lengthening=lengthening,
    compliance=compliance,
    max_velocity=unloaded_velocity,
    time_constants=time_constants,
    from_hill=same_parameters(HillRigid),
    viscous_loss=viscous_loss,
    sources="Winters & Stark 1987, Biol. Cybern. 55:403-420, sect. 3, eqs. 3-5 and 12",
)
