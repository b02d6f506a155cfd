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


def relaxed(p: float, q: float) -> float:
    """(exp(z) - 1)/z at z = -p/q, for p >= 0 and q > 0, by the (1, 2) Padé approximant of exp.

    The approximant is L-stable (it is that of Radau IIA), exact to z² at 0 and -1/z far from
    it: one step of a stiff equation ends on its equilibrium.
    """
    return q * (q + p * (1.0 / 6.0)) / (q * (q + p * (2.0 / 3.0)) + p * p * (1.0 / 6.0))


def advance_excitation(
    u: float, n: float, a: float, tau_nex: float, tau: float, dt: float
) -> tuple[float, float]:
    """Excitation and activation after dt [s] at constant input u.

    n is exact. a, of time constant tau, is exact for an n that is linear in time over the step.
    """
    n_next = u + (n - u) * exp(-dt / tau_nex)
    decay = exp(-dt / tau)
    settled = 1.0 - decay
    a_next = decay * a + settled * n + (n_next - n) * (1.0 - settled * tau * (1.0 / dt))
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

    Exponential Rosenbrock-Euler. A slack element is first taken up at its constant rate, so
    that it meets its stiffness when it is taut, not a step later.
    """
    part = dt if substeps == 1 else dt / substeps
    for _ in range(substeps):
        left = part
        if stretch < 0:
            velocity, _, _ = contractile_velocity(
                0.0, hypothetical, hill, plateau, slope_ratio, viscosity
            )
            rate = length_rate + max_velocity * velocity
            if stretch + rate * part < 0:
                stretch += rate * part
                continue
            left = part + stretch / rate
            stretch = 0.0
        force, stiffness = series_force(stretch, stretch_max, shape, limit)
        velocity, p, q = contractile_velocity(
            force, hypothetical, hill, plateau, slope_ratio, viscosity
        )
        rate = length_rate + max_velocity * velocity
        stretch += left * rate * relaxed(left * max_velocity * stiffness * p, q)
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
    velocity, p, q = contractile_velocity(
        force, hypothetical, hill, plateau, slope_ratio, viscosity
    )
    p *= dt * max_velocity * stiffness
    return (length_rate + max_velocity * velocity) * (2.0 * q / p if p > 2.0 * q else 1.0)


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

    ``staged`` is for RK4, whose stages each see a state of their own: s belongs to the length.

    Under single-step integrators s is one step old, and its rate brings it up to the present
    length along the way that length has really come; ``present_length`` gives it to the force.
    (MuJoCo's ``actearly`` does the same with an activation.) Going on from the present along
    the present velocity instead would miss what the joint accelerates by in a step, which acts
    as added inertia and is most of the error at long steps.

    Electrical stimulation puts the input straight into activation (sect. 4.1.2).
    """
    source = u if stimulated > 0 else n
    frequency = 1.0 / dt
    if staged:
        n_rate = (u - n) * frequency if stimulated > 0 else excitation_rate(u, n, tau_nex)
        a_rate = activation_rate(source, a, tau_act, tau_deact)
        a_then, length_then = a, length
    else:
        tau = tau_act if source >= a else tau_deact
        a_then, length_then = a - 0.5 * (dt / tau) * (source - a), length - 0.5 * dt * length_rate
        n_next, a_next = advance_excitation(u, source, a, tau_nex, tau, dt)
        n_rate, a_rate = (n_next - n) * frequency, (a_next - a) * frequency
    factor = active_length_factor(length_then, optimal, width_short, width_long)
    hypothetical = hypothetical_force(a_then, factor, floor)
    speed = max_velocity * velocity_scale(hypothetical, velocity_share)
    if staged:
        stretch_rate = capped_stretch_rate(
            length - s, length_rate, hypothetical, speed, hill, plateau, slope_ratio,
            viscosity, stretch_max, shape, limit, dt,
        )  # fmt: skip
        return n_rate, a_rate, length_rate - stretch_rate
    # short steps need one substep; in long ones a second takes what there is to take
    substeps = 2 if dt > 0.2 * tau_act else 1
    stretch = advance_stretch(
        length - dt * length_rate - s, length_rate, hypothetical, speed, hill, plateau,
        slope_ratio, viscosity, stretch_max, shape, limit, dt, substeps,
    )  # fmt: skip
    return n_rate, a_rate, (length - stretch - s) * frequency


def present_length(staged: bool, s: float, s_rate: float, dt: float) -> float:
    """Length of the contractile element now, from its state and rate; see ``muscle_rates``."""
    return s if staged else s + dt * s_rate
