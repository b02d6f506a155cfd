"""The Hill muscle with every element linear: states n, a, s.

Activation is a force in parallel with a dashpot, both in series with a spring that pushes as well
as pulls. One time constant serves rise and fall of activation, and force does not depend on
length. So responses to several inputs add up; where those of ``hill`` do not, a nonlinearity is
the cause.
"""

from __future__ import annotations

from dataclasses import dataclass

from mjhill.elements import activation_rate, excitation_rate
from mjhill.muscles.hill import Hill
from mjhill.muscles.model import Muscle, MuscleModel, OperatingPoint, Series, State, Track, Values
from mjhill.muscles.parts import ACTIVATION, EXCITATION, velocity_limit
from mjhill.muscles.readings import isometric_share, series_stiffness, steady_stretch
from mjhill.muscles.scheme import activation_rates, averages
from mjhill.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class HillLinear(Muscle):
    """One muscle of linear elements.

    On a joint, force is a torque [N·m] and length an angle [rad]; on a tendon, force [N] and
    length [m]. Its force at full activation, ``max_isometric_force``, is the same at every length.

    Attributes:
        sources: Where each value comes from, by parameter name.
    """

    excitation_tau: float = quantity(
        "τ_nex", "s", "neural excitation, time constant",
        (1e-6, 1), low_allowed=True, array="dynprm",
    )  # fmt: skip
    activation_tau: float = quantity(
        "τ_act", "s", "activation and deactivation, time constant",
        (1e-6, 1), low_allowed=True, array="dynprm",
    )  # fmt: skip
    stiffness: float = quantity(
        "k", ("N·m/rad", "N/m"), "stiffness of the series element", (0, 1e12), array="gainprm",
    )  # fmt: skip
    damping: float = quantity(
        "b", ("N·m·s/rad", "N·s/m"), "viscosity of the contractile element", (0, 1e12),
        array="biasprm",
    )  # fmt: skip


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
    stiffness: float,
    damping: float,
    max_isometric_force: float,
) -> tuple[float, float, float]:
    """Rates of n, a and s for MuJoCo to advance by a timestep; s as in ``hill``."""
    n_rate, a_rate, a_then = activation_rates(
        staged, u, n, a, timestep, excitation_tau, activation_tau, activation_tau, 0.0
    )
    before = length - timestep * length_rate - s
    rate = length_rate + (max_isometric_force * a_then - stiffness * before) / damping
    constant, growing = averages(timestep * stiffness, damping)
    change = timestep * (rate * constant + max_isometric_force * (a - a_then) * growing)
    return n_rate, a_rate, (length - before - change - s) * (1.0 / timestep)


def force(s: float, s_rate: float, length: float, timestep: float, stiffness: float) -> float:
    """Force [N·m or N] of the series element at its present stretch; below 0 it pushes."""
    return stiffness * (length - s - timestep * s_rate)


def derivatives(
    u: float,
    n: float,
    a: float,
    s: float,
    length: float,
    excitation_tau: float,
    activation_tau: float,
    stiffness: float,
    damping: float,
    max_isometric_force: float,
) -> tuple[float, float, float]:
    """True rates of n, a and s [1/s, 1/s, length/s]."""
    shortening = shortening_velocity(a, s, length, stiffness, damping, max_isometric_force)
    return (
        excitation_rate(u, n, excitation_tau),
        activation_rate(n, a, activation_tau, activation_tau),
        -shortening,
    )


def shortening_velocity(
    a: float, s: float, length: float, stiffness: float, damping: float, max_isometric_force: float
) -> float:
    """True velocity of the contractile element [rad/s or m/s], positive when it shortens."""
    return (max_isometric_force * a - stiffness * (length - s)) / damping


def tension(s: float, length: float, stiffness: float) -> float:
    """True force [N·m or N] at a contractile length s."""
    return stiffness * (length - s)


def steady(
    u: float, length: float, stiffness: float, max_isometric_force: float
) -> tuple[float, float, float]:
    """States n, a and s at rest."""
    return u, u, length - max_isometric_force * u / stiffness


def series_stretch(s: float, length: float) -> float:
    """True stretch of the series element [rad or m]; it pushes below 0."""
    return length - s


def at_full_force(stiffness: Values, damping: Values) -> tuple[Values, Values, Values]:
    """Stiffness, rate of yielding and viscosity, the same everywhere."""
    return stiffness, stiffness / damping, 0 * damping


def lengthening(max_isometric_force: float, damping: float) -> tuple[float, float]:
    """Force at rest, and what each unit of lengthening rate adds to it."""
    return max_isometric_force, damping


def compliance(max_isometric_force: float, stiffness: float) -> float:
    """Stretch of the series element at full force [rad or m]."""
    return max_isometric_force / stiffness


def unloaded_velocity(max_isometric_force: float, damping: float) -> float:
    """Shortening velocity without load at full activation [length/s]."""
    return max_isometric_force / damping


def time_constants(excitation_tau: Values, activation_tau: Values) -> dict[str, Values]:
    """Time constants of n and a [s]."""
    return {"excitation_tau": excitation_tau, "activation_tau": activation_tau}


def series(track: Track) -> Series:
    """What a recording shows of a muscle."""
    s_then = track.states["s"] + track.timestep * track.state_rates["s"]
    work = track.work(track.force, -track.length)
    yield "n", "-", track.states["n"]
    yield "a", "-", track.states["a"]
    yield "velocity", "rate", -track.state_rates["s"]
    yield "stretch", "length", track.length - s_then
    yield "force", "force", track.force
    yield "length", "length", track.length
    yield "length_rate", "rate", track.length_rate
    first = -float(track.force[0]) * float(track.length_rate[0])
    yield "power", "power", track.power(work, first)
    yield "work", "energy", work


def from_hill(muscle: Hill, at: OperatingPoint) -> HillLinear:
    """Its force is that of ``hill`` at the length, its slopes are those at the operating point.

    Activation has the mean of the time constants of ``hill``.

    Raises:
        ValueError: The muscle is electrically stimulated.
    """
    if muscle.electrical_stimulation:
        raise ValueError(
            "a muscle with electrical_stimulation cannot be made one of 'hill-linear', which has "
            "none; set electrical_stimulation=False"
        )
    a, length = at.excitation, at.length
    share = isometric_share(muscle, a, length)
    slope = share * (1 + 1 / muscle.hill_shape) + muscle.viscosity
    return HillLinear(
        max_isometric_force=isometric_share(muscle, 1.0, length) * muscle.max_isometric_force,
        excitation_tau=muscle.excitation_tau,
        activation_tau=0.5 * (muscle.activation_tau + muscle.deactivation_tau),
        stiffness=series_stiffness(muscle, steady_stretch(muscle, a, length)),
        damping=muscle.max_isometric_force * slope / velocity_limit(muscle, a, length),
        sources=muscle.sources,
    )


MODEL = MuscleModel(
    name="hill-linear",
    tag=198707.0,
    meaning="Hill's elements, every one of them linear; its spring pushes too",
    parameters=HillLinear,
    states=(EXCITATION, ACTIVATION, State("s", "length", "length of the contractile element")),
    rates=rates,
    force=force,
    derivatives=derivatives,
    tension=tension,
    steady=steady,
    series=series,
    readings={"velocity": ("rate", shortening_velocity), "stretch": ("length", series_stretch)},
    at_full_force=at_full_force,
    lengthening=lengthening,
    compliance=compliance,
    max_velocity=unloaded_velocity,
    time_constants=time_constants,
    from_hill=from_hill,
    staged=False,
    pulls_only=False,
    sources="Winters & Stark 1987, Biol. Cybern. 55:403-420, sect. 2 and 4.2; elements made linear",
)
