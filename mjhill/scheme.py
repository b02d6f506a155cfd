"""The numerical scheme: rates of the muscle's states that stay right at MuJoCo's timestep.

MuJoCo advances ``act`` by ``timestep * act_dot`` under its single-step integrators, and by the
fourth-order Runge-Kutta rule under RK4. The contractile element relaxes in well under 0.1 ms at
low activation, so its plain derivative is unstable under either. Single-step integrators
get the rate that lands each state on an accurate solution of its own equation; RK4 gets a
derivative whose relaxation is no faster than RK4 can follow.

Pure scalar functions, under the same rules as ``elements``.
"""

from __future__ import annotations

from math import exp

from mjhill.elements import (
    activation_rate,
    active_length_factor,
    contractile_velocity,
    excitation_rate,
    hypothetical_force,
    series_force,
    velocity_scale,
)


def relaxed(z: float) -> float:
    """(exp(z) - 1)/z for z <= 0, by the (1, 2) Padé approximant of exp.

    The approximant is L-stable (it is that of Radau IIA), exact to z² at 0 and -1/z far from
    it: one step of a stiff equation ends on its equilibrium.
    """
    return (1.0 - z / 6.0) / (1.0 - z * (2.0 / 3.0) + z * z / 6.0)


def advance_excitation(
    u: float, n: float, a: float, tau_nex: float, tau_act: float, tau_deact: float, dt: float
) -> tuple[float, float]:
    """Excitation and activation after dt [s] at constant input u.

    n is exact. a is exact for an n that is linear in time over the step.
    """
    n_next = u + (n - u) * exp(-dt / tau_nex)
    z = dt / (tau_act if n >= a else tau_deact)
    decay = exp(-z)
    settled = 1.0 - decay
    a_next = decay * a + settled * n + (n_next - n) * (1.0 - settled / z)
    return n_next, a_next


def advance_stretch(
    stretch: float,
    length_rate: float,
    hypothetical: float,
    max_velocity: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    stretch_max: float,
    shape: float,
    limit: float,
    dt: float,
    substeps: int,
) -> float:
    """Stretch of the series element after dt [s] at constant length rate and active state.

    Exponential Rosenbrock-Euler.
    """
    part = dt / substeps
    for _ in range(substeps):
        force, stiffness = series_force(stretch, stretch_max, shape, limit)
        velocity, slope = contractile_velocity(
            force, hypothetical, hill, plateau, slope_ratio, viscosity
        )
        z = part * max_velocity * slope * stiffness
        stretch += part * (length_rate + max_velocity * velocity) * relaxed(z)
    return stretch


def capped_stretch_rate(
    stretch: float,
    length_rate: float,
    hypothetical: float,
    max_velocity: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    stretch_max: float,
    shape: float,
    limit: float,
    dt: float,
) -> float:
    """Rate of the stretch with its relaxation slowed, where it is faster, to 2/dt.

    RK4 is unstable past 2.78/dt. The equilibrium, moving or not, stays where it is, so what
    is lost is a lag of half a step in an element that carries little force when it is fast.
    """
    force, stiffness = series_force(stretch, stretch_max, shape, limit)
    velocity, slope = contractile_velocity(
        force, hypothetical, hill, plateau, slope_ratio, viscosity
    )
    z = -dt * max_velocity * slope * stiffness
    return (length_rate + max_velocity * velocity) * (2.0 / z if z > 2.0 else 1.0)


def muscle_rates(
    staged: bool,
    u: float,
    n: float,
    a: float,
    s: float,
    length: float,
    length_rate: float,
    dt: float,
    tau_nex: float,
    tau_act: float,
    tau_deact: float,
    stimulated: float,
    floor: float,
    optimal: float,
    width_short: float,
    width_long: float,
    stretch_max: float,
    shape: float,
    limit: float,
    max_velocity: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    velocity_share: float,
) -> tuple[float, float, float]:
    """Rates of n, a and s [1/s, 1/s, length/s] for MuJoCo to advance by a step of dt [s].

    ``staged`` is for RK4, whose stages each see a state of their own. Otherwise the length goes
    on at its present rate and the active state is that of mid-step. Electrical stimulation
    puts the input straight into activation (sect. 4.1.2).
    """
    source = u if stimulated > 0 else n
    if staged:
        n_rate = (u - n) / dt if stimulated > 0 else excitation_rate(u, n, tau_nex)
        a_rate = activation_rate(source, a, tau_act, tau_deact)
        a_now, length_now = a, length
    else:
        n_next, a_next = advance_excitation(u, source, a, tau_nex, tau_act, tau_deact, dt)
        n_rate, a_rate = (n_next - n) / dt, (a_next - a) / dt
        a_now, length_now = 0.5 * (a + a_next), length + 0.5 * dt * length_rate
    factor = active_length_factor(length_now, optimal, width_short, width_long)
    hypothetical = hypothetical_force(a_now, factor, floor)
    speed = max_velocity * velocity_scale(hypothetical, velocity_share)
    stretch = length - s
    if staged:
        stretch_rate = capped_stretch_rate(
            stretch, length_rate, hypothetical, speed, hill, plateau, slope_ratio,
            viscosity, stretch_max, shape, limit, dt,
        )  # fmt: skip
    else:
        # short steps need one; in long ones a second takes what there is to take, and what is
        # left is MuJoCo's own half step
        substeps = 2 if dt > 0.2 * tau_act else 1
        stretch_next = advance_stretch(
            stretch, length_rate, hypothetical, speed, hill, plateau, slope_ratio,
            viscosity, stretch_max, shape, limit, dt, substeps,
        )  # fmt: skip
        stretch_rate = (stretch_next - stretch) / dt
    return n_rate, a_rate, length_rate - stretch_rate
