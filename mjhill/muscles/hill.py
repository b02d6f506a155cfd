"""The Hill muscle of Winters & Stark (1987), with a series element: states n, a, s.

Excitation u drives n (NEX), n drives activation a (ACT); a contractile element of length s
shortens at the velocity that Hill's relation gives it (CE) under the force of the series element
(SE), which is stretched by the actuator's length less s. Equation numbers are the paper's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mjhill.elements import activation_rate, excitation_rate, series_force, series_stretch_at
from mjhill.muscles.model import (
    STRONGEST,
    MuscleModel,
    Series,
    State,
    Track,
    Values,
    same_parameters,
)
from mjhill.muscles.parts import (
    ACTIVATION,
    EXCITATION,
    Contractile,
    SeriesElement,
    active_share,
    exponential_area,
    lengthening,
    time_constants,
    unloaded_velocity,
    velocity_at_force,
    viscous_loss,
)
from mjhill.muscles.scheme import activation_rates, advance_stretch, staged_stretch


@dataclass(frozen=True, kw_only=True)
class Hill(SeriesElement, Contractile):
    """One muscle: neural excitation, activation, contractile and series element.

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
    s: float,
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
    max_velocity: float,
    hill_shape: float,
    eccentric_plateau: float,
    eccentric_slope_ratio: float,
    viscosity: float,
    velocity_activation: float,
) -> tuple[float, float, float]:
    """Rates of n, a and s [1/s, 1/s, length/s] for MuJoCo to advance by a timestep.

    Under RK4 (``staged``) each stage sees a state of its own: s belongs to the length.

    Under single-step integrators s is one step old. Its rate brings it up to the present length
    along the displacement of the step before; ``stretch`` gives it to the force. (MuJoCo's
    ``actearly`` does the same with an activation.) To go on from the present along the present
    velocity instead would miss what the joint accelerates by in a step. That acts as added
    inertia and is most of the error at long timesteps.
    """
    n_rate, a_rate, a_then = activation_rates(
        staged, u, n, a, timestep, excitation_tau, activation_tau, deactivation_tau,
        electrical_stimulation,
    )  # fmt: skip
    now = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    if staged:
        _, rate = staged_stretch(
            length - s, length_rate, now, max_velocity, velocity_activation, hill_shape,
            eccentric_plateau, eccentric_slope_ratio, viscosity, series_stretch, series_shape,
            series_limit, timestep,
        )  # fmt: skip
        return n_rate, a_rate, length_rate - rate
    length_then = length - timestep * length_rate
    then = active_share(
        a_then, length_then, activation_floor, optimal_length, width_short, width_long
    )
    after = advance_stretch(
        length_then - s, length_rate, then, now, max_velocity, velocity_activation, hill_shape,
        eccentric_plateau, eccentric_slope_ratio, viscosity, series_stretch, series_shape,
        series_limit, timestep,
    )  # fmt: skip
    return n_rate, a_rate, (length - after - s) * (1.0 / timestep)


def stretch(
    staged: bool,
    a: float,
    s: float,
    s_rate: float,
    length: float,
    length_rate: float,
    timestep: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    max_velocity: float,
    hill_shape: float,
    eccentric_plateau: float,
    eccentric_slope_ratio: float,
    viscosity: float,
    velocity_activation: float,
) -> float:
    """Stretch of the series element now, whose force acts; see ``rates``."""
    if not staged:
        return length - (s + timestep * s_rate)
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    present, _ = staged_stretch(
        length - s, length_rate, share, max_velocity, velocity_activation, hill_shape,
        eccentric_plateau, eccentric_slope_ratio, viscosity, series_stretch, series_shape,
        series_limit, timestep,
    )  # fmt: skip
    return present


def force(
    staged: bool,
    a: float,
    s: float,
    s_rate: float,
    length: float,
    length_rate: float,
    timestep: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    max_velocity: float,
    hill_shape: float,
    eccentric_plateau: float,
    eccentric_slope_ratio: float,
    viscosity: float,
    velocity_activation: float,
    max_isometric_force: float,
) -> float:
    """Tension [N·m or N]: that of the series element at its present stretch."""
    present = stretch(
        staged, a, s, s_rate, length, length_rate, timestep, activation_floor, optimal_length,
        width_short, width_long, series_stretch, series_shape, series_limit, max_velocity,
        hill_shape, eccentric_plateau, eccentric_slope_ratio, viscosity, velocity_activation,
    )  # fmt: skip
    share, _ = series_force(present, series_stretch, series_shape, series_limit)
    return share * max_isometric_force


def shortening_velocity(
    a: float,
    s: float,
    length: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    max_velocity: float,
    hill_shape: float,
    eccentric_plateau: float,
    eccentric_slope_ratio: float,
    viscosity: float,
    velocity_activation: float,
) -> float:
    """True velocity of the contractile element [rad/s or m/s], positive when it shortens."""
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    carried, _ = series_force(length - s, series_stretch, series_shape, series_limit)
    return velocity_at_force(
        carried, share, max_velocity, hill_shape, eccentric_plateau, eccentric_slope_ratio,
        viscosity, velocity_activation,
    )  # fmt: skip


def taut_length(s: float, length: float) -> float:
    """True stretch of the series element [rad or m]; slack below 0."""
    return length - s


def derivatives(
    u: float,
    n: float,
    a: float,
    s: float,
    length: float,
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
    max_velocity: float,
    hill_shape: float,
    eccentric_plateau: float,
    eccentric_slope_ratio: float,
    viscosity: float,
    velocity_activation: float,
) -> tuple[float, float, float]:
    """True rates of n, a and s [1/s, 1/s, length/s]."""
    shortening = shortening_velocity(
        a, s, length, activation_floor, optimal_length, width_short, width_long, series_stretch,
        series_shape, series_limit, max_velocity, hill_shape, eccentric_plateau,
        eccentric_slope_ratio, viscosity, velocity_activation,
    )  # fmt: skip
    source = u if electrical_stimulation > 0 else n
    return (
        excitation_rate(u, n, excitation_tau),
        activation_rate(source, a, activation_tau, deactivation_tau),
        -shortening,
    )


def tension(
    s: float,
    length: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    max_isometric_force: float,
) -> float:
    """True tension [N·m or N] at a contractile length s."""
    share, _ = series_force(length - s, series_stretch, series_shape, series_limit)
    return max_isometric_force * share


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
) -> tuple[float, float, float]:
    """States n, a and s at rest: both elements carry the same force."""
    stretched = steady_stretch(
        u, length, activation_floor, optimal_length, width_short, width_long, series_stretch,
        series_shape, series_limit,
    )  # fmt: skip
    return u, u, length - stretched


def steady_stretch(
    a: float,
    length: float,
    activation_floor: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
) -> float:
    """Stretch of the series element at rest [rad or m]."""
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    return series_stretch_at(share, series_stretch, series_shape, series_limit)


def at_full_force(
    max_isometric_force: Values,
    series_stretch: Values,
    series_shape: Values,
    max_velocity: Values,
    hill_shape: Values,
    viscosity: Values,
) -> tuple[Values, Values, Values]:
    """Stiffness, rate of yielding and viscosity about rest at full activation."""
    # slope of the series element at F_max [F_max per unit of stretch]
    slope = series_shape / series_stretch / -np.expm1(-series_shape)
    # slope of force-velocity at rest, see contractile_velocity
    yielding = max_velocity * hill_shape / (1 + hill_shape * (1 + viscosity))
    return max_isometric_force * slope, yielding * slope, np.zeros_like(slope)


def compliance(series_stretch: float) -> float:
    """Stretch of the series element at F_max [rad or m]."""
    return series_stretch


def fault(
    s: float,
    length: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    width_short: float,
    width_long: float,
) -> str | None:
    """What is impossible about a contractile length: it slackens or tears the series element."""
    stretched = length - s
    slackest = 10 * (series_stretch + width_short + width_long)
    share, _ = series_force(stretched, series_stretch, series_shape, series_limit)
    if stretched >= -slackest and share <= STRONGEST:
        return None
    return (
        f"its contractile length s = {s:g} would stretch the series element by {stretched:g}, to "
        f"{share:.3g} F_max; allowed are {STRONGEST:g} F_max at most, and a stretch of "
        f"{-slackest:.3g} at least"
    )


def series(track: Track) -> Series:
    """What a recording shows of a muscle; docs/energy.md has the equations."""
    return elastic_series(track, _stretches(track))


def elastic_series(track: Track, stretched: Values) -> Series:
    """What a recording shows of a muscle with this series element, from its stretch [rad or m]."""
    muscle, time = track.muscle, track.time
    states, s_rate = track.states, track.state_rates["s"]
    shortened = stretched - track.length
    velocity = np.concatenate(([-s_rate[0]], np.diff(shortened) / np.diff(time)))
    yield "n", "-", states["n"]
    yield "a", "-", states["a"]
    yield "velocity", "rate", velocity
    yield "stretch", "length", stretched
    yield "force", "force", track.force
    pairs = [
        series_force(x, muscle.series_stretch, muscle.series_shape, muscle.series_limit)
        for x in stretched.tolist()
    ]
    pull, stiffness = (muscle.max_isometric_force * column for column in np.array(pairs).T)
    if np.abs(pull - track.force).max() > _NOTICED * muscle.max_isometric_force:
        yield "tension", "force", pull
    else:
        pull = track.force
    energy = series_energy(muscle, stretched)
    yield "length", "length", track.length
    yield "length_rate", "rate", track.length_rate
    yield "contractile_length", "length", -shortened
    yield "series_stiffness", "stiffness", stiffness
    yield "series_energy", "energy", energy
    contractile = track.work(pull, shortened)
    whole = track.work(track.force, -track.length)
    first, rate = float(velocity[0]), float(track.length_rate[0])
    yield "contractile_power", "power", track.power(contractile, float(pull[0]) * first)
    yield "series_power", "power", track.power(-energy, -float(pull[0]) * (rate + first))
    yield "power", "power", track.power(whole, -float(track.force[0]) * rate)
    yield "contractile_work", "energy", contractile
    yield "work", "energy", whole


_NOTICED = 1e-9  # of F_max: difference of tension and applied force that is not rounding
_ORDER = ("staged", "a", "s", "s_rate", "length", "length_rate", "timestep")


def _stretches(track: Track) -> Values:
    """Stretch of the series element at each sample, as the callbacks have it, shape (T,)."""
    stretched = MODEL.bound(stretch, track.muscle, _ORDER)
    columns = (
        track.states["a"], track.states["s"], track.state_rates["s"], track.length,
        track.length_rate,
    )  # fmt: skip
    if not track.staged:  # plain arithmetic, which arrays can do too
        return np.asarray(stretched(False, *columns, track.timestep))
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return np.array([stretched(True, *row, track.timestep) for row in rows])


def series_energy(muscle: Hill, stretched: Values) -> Values:
    """Energy in the series element [J] at stretches of it [rad or m]: its force integrated."""
    taut = np.maximum(stretched, 0.0)
    rate = muscle.series_shape / muscle.series_stretch
    grown = exponential_area(rate * taut, muscle.series_shape * muscle.series_limit) / rate
    scale = muscle.max_isometric_force / float(np.expm1(muscle.series_shape))
    return np.asarray(scale * (grown - taut))


MODEL = MuscleModel(
    name="hill",
    tag=198701.0,
    meaning="Hill's contractile element with a series element",
    parameters=Hill,
    states=(EXCITATION, ACTIVATION, State("s", "length", "length of the contractile element")),
    rates=rates,
    force=force,
    derivatives=derivatives,
    tension=tension,
    steady=steady,
    series=series,
    readings={"velocity": ("rate", shortening_velocity), "stretch": ("length", taut_length)},
    at_full_force=at_full_force,
    lengthening=lengthening,
    compliance=compliance,
    max_velocity=unloaded_velocity,
    time_constants=time_constants,
    from_hill=same_parameters(Hill),
    fault=fault,
    viscous_loss=viscous_loss,
    sources="Winters & Stark 1987, Biol. Cybern. 55:403-420, sect. 3, eqs. 3-7 and 12",
)
