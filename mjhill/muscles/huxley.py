"""Huxley's muscle (1957): states n, a, s, d and the share of sites with a bond in each bin.

The contractile part is the distribution n(x, t) of bonds between filaments, in series with the
series element of ``hill``: dn/dt - v dn/dx = f (1 - n) - g n (eq. 8 of Winters & Stark 1987), whose
force is the first moment of n (eq. 9). State d is the displacement of the last step [h]: with it
the next one is foreseen. ``bins`` has the scheme.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from mjhill.elements import (
    activation_rate,
    excitation_rate,
    series_force,
    series_stretch_at,
)
from mjhill.muscles import dm, hill
from mjhill.muscles.bins import LOW, advance_bins, settled_share
from mjhill.muscles.bonds import Bonds, attachment_share, rates_for
from mjhill.muscles.model import MuscleModel, OperatingPoint, State, Values
from mjhill.muscles.parts import ACTIVATION, EXCITATION, active_share, time_constants
from mjhill.muscles.scheme import activation_rates
from mjhill.quantity import flag, quantity

NAMED = 4  # states before the bins
BREAKING = 1e5  # rate at the ends of the window, for the reference solver [1/s]
HOLDING = 1e4  # rate at which its bonds and series element come to carry the same [1/s]


@dataclass(frozen=True, kw_only=True)
class Huxley(Bonds):
    """A muscle of bonds in bins, with a series element.

    On a joint, force is a torque [N·m] and length an angle [rad]; on a tendon, force [N] and
    length [m].

    Attributes:
        sources: Where each value comes from, by parameter name.
    """

    bins: float = quantity(
        # with fewer, a bin is so wide that force depends on where it lies
        "N", "-", "bins of the distribution of bonds",
        (50, 100_000), default=100.0, low_allowed=True, array="dynprm",
    )  # fmt: skip
    longest_bond: float = quantity(
        "x_top", "-", "stretch at which all bonds are broken [h]; more where g3 is small",
        (2, 50), default=5.0, low_allowed=True, array="dynprm",
    )  # fmt: skip
    activation_scales_force: bool = flag(default=False, array="dynprm")

    def __post_init__(self) -> None:
        """Check the bounds, and that the bins are a whole number.

        Raises:
            ValueError: A parameter is not a finite number inside its bounds, bins are not whole or
                too wide for the window.
        """
        super().__post_init__()
        if self.bins != round(self.bins):
            raise ValueError(f"bins must be a whole number, got {self.bins}")
        fewest = int(np.ceil(10 * (self.longest_bond - LOW)))
        if self.bins < fewest:
            raise ValueError(
                f"bins must be {fewest} or more for a window up to longest_bond = "
                f"{self.longest_bond:g}, got {self.bins:g}; wider bins than a tenth of the reach "
                "do not resolve it"
            )


def factors(
    share: float,
    activation_scales_force: float,
    attachment_rate: float,
    detachment_rate: float,
) -> tuple[float, float]:
    """Factor on f, and M1 at F_max, at an isometric force [F_max]."""
    full = 0.5 * attachment_rate / (attachment_rate + detachment_rate)
    if activation_scales_force > 0:
        return 1.0, full / share
    return attachment_share(share, attachment_rate, detachment_rate), full


def rates(
    states: list[float],
    state_rates: list[float],
    staged: bool,
    u: float,
    n: float,
    a: float,
    s: float,
    d: float,
    length: float,
    length_rate: float,
    timestep: float,
    excitation_tau: float,
    activation_tau: float,
    deactivation_tau: float,
    electrical_stimulation: float,
    activation_floor: float,
    longest_bond: float,
    activation_scales_force: float,
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
) -> None:
    """Rates of all states for MuJoCo to advance by a timestep; see ``hill.rates``."""
    n_rate, a_rate, a_then = activation_rates(
        staged, u, n, a, timestep, excitation_tau, activation_tau, deactivation_tau,
        electrical_stimulation,
    )  # fmt: skip
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    then = active_share(
        a_then, length - timestep * length_rate, activation_floor, optimal_length, width_short,
        width_long,
    )  # fmt: skip
    factor, _ = factors(
        0.5 * (share + then), activation_scales_force, attachment_rate, detachment_rate
    )
    _, moment = factors(share, activation_scales_force, attachment_rate, detachment_rate)
    displacement = advance_bins(
        states, state_rates, 4, s, length, d, timestep, longest_bond, factor, series_stretch,
        series_shape, series_limit, bond_reach, attachment_rate, detachment_rate,
        pushing_detachment_rate, stretched_detachment_rate, moment,
    )  # fmt: skip
    frequency = 1.0 / timestep
    for j in range(4, len(states)):
        state_rates[j] = (state_rates[j] - states[j]) * frequency
    state_rates[0] = n_rate
    state_rates[1] = a_rate
    state_rates[2] = -displacement * bond_reach * frequency
    state_rates[3] = (displacement - d) * frequency


def derivatives(
    states: Values,
    state_rates: Values,
    u: float,
    n: float,
    a: float,
    s: float,
    length: float,
    length_rate: float,
    excitation_tau: float,
    activation_tau: float,
    deactivation_tau: float,
    electrical_stimulation: float,
    activation_floor: float,
    longest_bond: float,
    activation_scales_force: float,
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
) -> None:
    """True rates, by the method of lines in bins that ride with the filament."""
    share = active_share(a, length, activation_floor, optimal_length, width_short, width_long)
    factor, moment = factors(share, activation_scales_force, attachment_rate, detachment_rate)
    shares = states[NAMED:]
    x, width = positions(s, len(shares), longest_bond, bond_reach)
    covered = np.clip((1.0 - x) / width + 0.5, 0.0, 1.0) * (x > 0)
    goal = covered * factor * attachment_rate / (factor * attachment_rate + detachment_rate)
    beyond = np.maximum(x - 1.0, 0.0)
    broken = np.where(
        x < 0, pushing_detachment_rate, detachment_rate * x + stretched_detachment_rate * beyond
    )
    carried, slope = series_force(length - s, series_stretch, series_shape, series_limit)
    bonds = max(float(shares.sum()) * width, 1e-9) / bond_reach
    # bonds that leave the window are broken, at either end within a bin's way in microseconds
    outside = (x < LOW + width) | (x > longest_bond - width)
    apart = float((x * np.where(outside, 0.0, shares)).sum()) * width - moment * carried
    entering = np.where(goal > 0, broken + factor * attachment_rate * x, broken)
    for rate in (entering, broken / (1.0 - goal)):  # if it shortens, and if it lengthens
        change = rate * (goal - shares)
        reacted = float((x * change).sum()) * width + HOLDING * apart
        s_rate = (moment * slope * length_rate - reacted) / (moment * slope + bonds)
        if s_rate < 0:
            break
    change -= np.where(outside, BREAKING, 0.0) * shares
    source = u if electrical_stimulation > 0 else n
    state_rates[:NAMED] = (
        excitation_rate(u, n, excitation_tau),
        activation_rate(source, a, activation_tau, deactivation_tau),
        s_rate,
        0.0,
    )
    state_rates[NAMED:] = change


def positions(s: float, count: int, longest_bond: float, bond_reach: float) -> tuple[Values, float]:
    """Middle of each bin [h], shape (count,), and their width [h]."""
    window = longest_bond - LOW
    width = window / count
    x = LOW + ((np.arange(count) + 0.5) * width + (s / bond_reach) % window)
    return np.where(x >= longest_bond, x - window, x), width


def steady(
    u: float,
    length: float,
    activation_floor: float,
    bins: float,
    longest_bond: float,
    activation_scales_force: float,
    optimal_length: float,
    width_short: float,
    width_long: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    bond_reach: float,
    attachment_rate: float,
    detachment_rate: float,
) -> Values:
    """States at rest, shape (4 + bins,)."""
    share = active_share(u, length, activation_floor, optimal_length, width_short, width_long)
    factor, moment = factors(share, activation_scales_force, attachment_rate, detachment_rate)
    force = share
    for _trial in range(100):  # bins lie elsewhere as the series element is stretched
        s = length - series_stretch_at(force, series_stretch, series_shape, series_limit)
        x, width = positions(s, round(bins), longest_bond, bond_reach)
        shares = np.array(
            [
                settled_share(at, width, factor, attachment_rate, detachment_rate)
                if at > 0
                else 0.0
                for at in x.tolist()
            ]
        )
        carried = float((x * shares).sum()) * width / moment
        if abs(carried - force) < 1e-13:
            break
        force = 0.5 * (force + carried)
    return np.concatenate(([u, u, s, 0.0], shares))


def shortening_velocity(
    states: Values,
    u: float,
    n: float,
    a: float,
    s: float,
    length: float,
    length_rate: float,
    excitation_tau: float,
    activation_tau: float,
    deactivation_tau: float,
    electrical_stimulation: float,
    activation_floor: float,
    longest_bond: float,
    activation_scales_force: float,
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
) -> float:
    """True velocity of the bonds' element [rad/s or m/s], positive when it shortens."""
    changes = np.zeros(len(states))
    derivatives(
        states, changes, u, n, a, s, length, length_rate, excitation_tau, activation_tau,
        deactivation_tau, electrical_stimulation, activation_floor, longest_bond,
        activation_scales_force, optimal_length, width_short, width_long, series_stretch,
        series_shape, series_limit, bond_reach, attachment_rate, detachment_rate,
        pushing_detachment_rate, stretched_detachment_rate,
    )  # fmt: skip
    return -float(changes[2])


def fault(
    states: Values,
    s: float,
    length: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    width_short: float,
    width_long: float,
) -> str | None:
    """What is impossible about its states: a share outside [0, 1], or a torn series element."""
    shares = np.asarray(states)[NAMED:]
    for j in np.flatnonzero(~((shares >= -1e-6) & (shares <= 1 + 1e-6))).tolist():
        return f"its bin {j} must be in [0, 1], got {shares[j]:g}"
    return hill.fault(
        s, length, series_stretch, series_shape, series_limit, width_short, width_long
    )


def from_hill(muscle: hill.Hill, _at: OperatingPoint) -> Huxley:
    """The muscle whose bonds have the unloaded velocity and isometric force of a ``Hill``."""
    bonds: dict[str, Any] = asdict(
        rates_for(muscle.width_short, muscle.width_long, muscle.max_velocity)
    )
    shared = {item.name for item in fields(Huxley)} & {item.name for item in fields(muscle)}
    return Huxley(**{name: getattr(muscle, name) for name in shared}, **bonds)


MODEL = MuscleModel(
    name="huxley",
    tag=198710.0,
    meaning="the distribution of bonds in bins, with a series element",
    parameters=Huxley,
    states=(
        EXCITATION,
        ACTIVATION,
        State("s", "length", "length of the bonds' element"),
        State("d", "-", "shortening of the bonds' element in the last step [h]"),
    ),
    bins="bins",
    rates=rates,
    force=dm.force,
    derivatives=derivatives,
    tension=hill.tension,
    steady=steady,
    series=dm.series,
    readings={"velocity": ("rate", shortening_velocity), "stretch": ("length", hill.taut_length)},
    at_full_force=dm.at_full_force,
    lengthening=dm.lengthening,
    compliance=hill.compliance,
    max_velocity=dm.unloaded_velocity,
    time_constants=time_constants,
    from_hill=from_hill,
    fault=fault,
    staged=False,
    sources="Huxley 1957, Prog. Biophys. 7:255-318; Winters & Stark 1987, eqs. 8-9",
)
