"""The distribution-moment muscle (Zahalak 1981): states n, a, s, m0, m2.

Bonds between the filaments are told by the first three moments of their distribution n(x), which
is taken to be Gaussian: three ordinary differential equations in the place of Huxley's partial
one, in series with the same series element as in ``hill``. Moment M1 is the force, which the series
element carries too, so it follows from s and is no state of its own.

Eq. 10 of Winters & Stark (1987): dM_i/dt = b_i - F_i(M0, M1, M2) - i v M_(i-1), i = 0, 1, 2. (The
scan of the paper prints M_i and i = 1, 2, 3.)
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from mjhill.elements import activation_rate, excitation_rate, series_force, series_stretch_at
from mjhill.muscles import hill
from mjhill.muscles.bonds import Bonds, rates_for
from mjhill.muscles.model import MuscleModel, OperatingPoint, Series, State, Track, Values
from mjhill.muscles.moments import closure, steady_moments
from mjhill.muscles.moments_scheme import advance, moment_rates
from mjhill.muscles.parts import ACTIVATION, EXCITATION, active_share, time_constants
from mjhill.muscles.scheme import activation_rates
from mjhill.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class DistributionMoment(Bonds):
    """A muscle of bonds told by their moments, with a series element.

    On a joint, force is a torque [N·m] and length an angle [rad]; on a tendon, force [N] and
    length [m]. The last four parameters follow from the ratios of the rates; see
    ``mjhill.muscles.moments.closure``.

    Attributes:
        sources: Where each value comes from, by parameter name.
    """

    isometric_moment: float = quantity(
        "M1_0", "-", "M1 at rest at full activation, where the force is F_max",
        (1e-6, 1), array="biasprm",
    )  # fmt: skip
    closure_constant: float = quantity(
        "k_0", "-", "c = H/(H + k (1 - H)), k = k_0 + k_1 H + k_2 H², is the factor on f at an "
        "isometric force H [F_max]", (1e-3, 1e6), array="biasprm",
    )  # fmt: skip
    closure_linear: float = quantity(
        "k_1", "-", "see k_0", (-1e6, 1e6), low_allowed=True, array="biasprm",
    )  # fmt: skip
    closure_square: float = quantity(
        "k_2", "-", "see k_0", (-1e6, 1e6), low_allowed=True, array="biasprm",
    )  # fmt: skip


def attachment_factor(
    share: float, closure_constant: float, closure_linear: float, closure_square: float
) -> float:
    """Factor on f that gives a share of the isometric force [F_max]."""
    bend = closure_constant + share * (closure_linear + share * closure_square)
    return share / (share + max(bend, 1e-3) * (1.0 - share))


def rates(
    staged: bool,
    u: float,
    n: float,
    a: float,
    s: float,
    m0: float,
    m2: float,
    length: float,
    length_rate: float,
    timestep: float,
    excitation_tau: float,
    activation_tau: float,
    deactivation_tau: float,
    electrical_stimulation: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    bond_reach: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    isometric_moment: float,
    closure_constant: float,
    closure_linear: float,
    closure_square: float,
) -> tuple[float, float, float, float, float]:
    """Rates of n, a, s, m0 and m2 for MuJoCo to advance by a timestep; see ``hill.rates``."""
    n_rate, a_rate, a_then = activation_rates(
        staged, u, n, a, timestep, excitation_tau, activation_tau, deactivation_tau,
        electrical_stimulation,
    )  # fmt: skip
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    if staged:
        factor = attachment_factor(share, closure_constant, closure_linear, closure_square)
        s_rate, m0_rate, m2_rate = moment_rates(
            length - s, length_rate, m0, m2, factor, series_stretch, series_shape, series_limit,
            bond_reach, attachment_rate, detachment_rate, pushing_detachment_rate,
            stretched_detachment_rate, isometric_moment,
        )  # fmt: skip
        return n_rate, a_rate, s_rate, m0_rate, m2_rate
    travel = timestep * length_rate
    length_then = length - travel
    then = active_share(
        a_then, length_then, activation_floor, optimal_length, width_short, width_long
    )
    factor = attachment_factor(
        0.5 * (share + then), closure_constant, closure_linear, closure_square
    )
    after, m0_after, m2_after = advance(
        length_then - s, travel, m0, m2, factor, timestep, series_stretch, series_shape,
        series_limit, bond_reach, attachment_rate, detachment_rate, pushing_detachment_rate,
        stretched_detachment_rate, isometric_moment,
    )  # fmt: skip
    frequency = 1.0 / timestep
    return (
        n_rate,
        a_rate,
        (length - after - s) * frequency,
        (m0_after - m0) * frequency,
        (m2_after - m2) * frequency,
    )


def force(
    staged: bool,
    s: float,
    s_rate: float,
    length: float,
    timestep: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    max_isometric_force: float,
) -> float:
    """Tension [N·m or N]: that of the series element at its present stretch."""
    present = s if staged else s + timestep * s_rate
    share, _ = series_force(length - present, series_stretch, series_shape, series_limit)
    return share * max_isometric_force


def derivatives(
    u: float,
    n: float,
    a: float,
    s: float,
    m0: float,
    m2: float,
    length: float,
    length_rate: float,
    excitation_tau: float,
    activation_tau: float,
    deactivation_tau: float,
    electrical_stimulation: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    bond_reach: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    isometric_moment: float,
    closure_constant: float,
    closure_linear: float,
    closure_square: float,
) -> tuple[float, float, float, float, float]:
    """True rates of n, a, s, m0 and m2."""
    source = u if electrical_stimulation > 0 else n
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    s_rate, m0_rate, m2_rate = moment_rates(
        length - s, length_rate, m0, m2,
        attachment_factor(share, closure_constant, closure_linear, closure_square),
        series_stretch, series_shape, series_limit, bond_reach, attachment_rate, detachment_rate,
        pushing_detachment_rate, stretched_detachment_rate, isometric_moment,
    )  # fmt: skip
    return (
        excitation_rate(u, n, excitation_tau),
        activation_rate(source, a, activation_tau, deactivation_tau),
        s_rate,
        m0_rate,
        m2_rate,
    )


def steady(
    u: float,
    length: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    isometric_moment: float,
    closure_constant: float,
    closure_linear: float,
    closure_square: float,
) -> tuple[float, float, float, float, float]:
    """States n, a, s, m0 and m2 at rest."""
    share = active_share(u, length, activation_floor, optimal_length, width_short, width_long)
    factor = attachment_factor(share, closure_constant, closure_linear, closure_square)
    m0, m1, m2 = steady_moments(
        factor, attachment_rate, detachment_rate, pushing_detachment_rate,
        stretched_detachment_rate,
    )  # fmt: skip
    stretch = series_stretch_at(m1 / isometric_moment, series_stretch, series_shape, series_limit)
    return u, u, length - stretch, m0, m2


def shortening_velocity(
    a: float,
    s: float,
    m0: float,
    m2: float,
    length: float,
    length_rate: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    bond_reach: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    isometric_moment: float,
    closure_constant: float,
    closure_linear: float,
    closure_square: float,
) -> float:
    """True velocity of the bonds' element [rad/s or m/s], positive when it shortens."""
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    s_rate, _, _ = moment_rates(
        length - s, length_rate, m0, m2,
        attachment_factor(share, closure_constant, closure_linear, closure_square),
        series_stretch, series_shape, series_limit, bond_reach, attachment_rate, detachment_rate,
        pushing_detachment_rate, stretched_detachment_rate, isometric_moment,
    )  # fmt: skip
    return -s_rate


def at_full_force(
    max_isometric_force: Values,
    series_stretch: Values,
    series_shape: Values,
    bond_reach: Values,
    attachment_rate: Values,
    detachment_rate: Values,
) -> tuple[Values, Values, Values]:
    """Stiffness, rate of yielding and viscosity about rest at full activation.

    Bonds are stiff for as long as they last: their spring is in series with the series element.
    """
    slope = series_shape / series_stretch / -np.expm1(-series_shape)
    bonds = 2.0 / bond_reach  # of the true distribution: M0/M1 is 2 at rest
    together = slope * bonds / (slope + bonds)
    yielding = 0.5 * (attachment_rate + detachment_rate)
    return max_isometric_force * together, yielding, np.zeros_like(slope)


def lengthening(max_isometric_force: Values) -> tuple[Values, Values]:
    """Largest force in slow lengthening, and what each unit of lengthening rate adds to it."""
    # with Huxley's ratios of rates and g3 it peaks at 2.1 F_max
    return 2.1 * max_isometric_force, 0.0 * max_isometric_force


def unloaded_velocity(bond_reach: Values, attachment_rate: Values, detachment_rate: Values) -> Any:
    """V_max [length/s], with Huxley's ratios of rates."""
    return 2.0009684 * bond_reach * (attachment_rate + detachment_rate)


def from_hill(muscle: hill.Hill, _at: OperatingPoint) -> DistributionMoment:
    """The muscle whose bonds have the unloaded velocity and isometric force of a ``Hill``."""
    bonds = rates_for(muscle.width_short, muscle.width_long, muscle.max_velocity)
    full, constant, linear, square = closure(
        bonds.attachment_rate, bonds.detachment_rate, bonds.pushing_detachment_rate,
        bonds.stretched_detachment_rate,
    )  # fmt: skip
    shared = {item.name for item in fields(DistributionMoment)} & {
        item.name for item in fields(muscle)
    }
    return DistributionMoment(
        **{name: getattr(muscle, name) for name in shared},
        **asdict(bonds),
        isometric_moment=full,
        closure_constant=constant,
        closure_linear=linear,
        closure_square=square,
    )


def series(track: Track) -> Series:
    """What a recording shows of a muscle; docs/energy.md has the equations."""
    ahead = 0.0 if track.staged else track.timestep
    return hill.elastic_series(
        track, track.length - (track.states["s"] + ahead * track.state_rates["s"])
    )


MODEL = MuscleModel(
    name="dm",
    tag=198709.0,
    meaning="moments of the distribution of bonds, with a series element",
    parameters=DistributionMoment,
    states=(
        EXCITATION,
        ACTIVATION,
        State("s", "length", "length of the bonds' element"),
        State("m0", "-", "share of sites that have a bond"),
        State("m2", "-", "second moment of the bonds [h²]"),
    ),
    rates=rates,
    force=force,
    derivatives=derivatives,
    tension=hill.tension,
    steady=steady,
    series=series,
    readings={"velocity": ("rate", shortening_velocity), "stretch": ("length", hill.taut_length)},
    at_full_force=at_full_force,
    lengthening=lengthening,
    compliance=hill.compliance,
    max_velocity=unloaded_velocity,
    time_constants=time_constants,
    from_hill=from_hill,
    fault=hill.fault,
    staged=False,
    sources="Zahalak 1981, Math. Biosci. 55:89-114; Winters & Stark 1987, eq. 10",
)
