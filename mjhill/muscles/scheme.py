"""The numerical scheme: rates of the muscle's states that stay right at MuJoCo's timestep.

MuJoCo advances ``act`` by ``timestep * act_dot`` under its single-step integrators, and by the
fourth-order Runge-Kutta rule under RK4. The contractile element relaxes in well under 0.1 ms at
low activation, so its plain derivative is unstable under either. Single-step integrators
get the rate that lands each state on an accurate solution of its own equation; RK4 gets a
derivative whose relaxation is no faster than RK4 can follow.

Pure scalar functions, under the same rules as ``elements``.
"""

from __future__ import annotations

from math import exp, log, sqrt

from mjhill.elements import (
    activation_rate,
    contractile_velocity,
    excitation_rate,
    series_force,
    velocity_scale,
)

NEGLIGIBLE = 3e-3  # bend of the equation within a step that needs no correction [F_max]
TOLERANCE = 1e-3  # correction of a substep that is taken [F_max]
PATIENCE = 60  # substeps tried


def averages(p: float, q: float) -> tuple[float, float]:
    """Weighted averages of a decay exp(z t) over t in (0, 1), z = -p/q, for p >= 0 and q > 0.

    By the (1, 2) Padé approximant of exp, that of Radau IIA: L-stable, so a step of a stiff
    equation ends on its equilibrium.

    Returns:
        (exp(z) - 1)/z, by which a constant rate counts; (exp(z) - 1 - z)/z²/q, by which counts a
        rate that grows from 0 linearly, given in units of 1/q.
    """
    share = 1.0 / (q * (q + p * (2.0 / 3.0)) + p * p * (1.0 / 6.0))
    return share * q * (q + p * (1.0 / 6.0)), share * (q * 0.5 + p * (1.0 / 6.0))


def advance_excitation(u: float, n: float, tau_nex: float, dt: float) -> float:
    """Excitation after dt [s] at constant excitation u; exact."""
    return u + (n - u) * exp(-dt / tau_nex)


def advance_activation(n: float, n_next: float, a: float, tau: float, dt: float) -> float:
    """Activation after dt [s]; exact for an excitation linear in time from n to n_next."""
    decay = exp(-(dt / tau))
    settled = 1.0 - decay
    return decay * a + settled * n + (n_next - n) * (1.0 - settled * tau * (1.0 / dt))


def activation_rates(
    staged: bool,
    u: float,
    n: float,
    a: float,
    dt: float,
    tau_nex: float,
    tau_act: float,
    tau_deact: float,
    stimulated: float,
) -> tuple[float, float, float]:
    """Rates [1/s] of n and a for MuJoCo to advance by dt [s], and a one step before.

    ``staged`` is for RK4, whose stages each see a state of their own; then the third is a.
    Otherwise a one step before is found by going back from the present one. Electrical
    stimulation puts the excitation u straight into activation (sect. 4.1.2).
    """
    source = u if stimulated > 0 else n
    if staged:
        # where stages relax faster than 1/dt they overshoot: n and a would leave [0, 1]
        n_rate = (u - n) / dt if stimulated > 0 else excitation_rate(u, n, max(tau_nex, dt))
        return n_rate, activation_rate(source, a, max(tau_act, dt), max(tau_deact, dt)), a
    n_next = advance_excitation(u, source, tau_nex, dt)
    # not n: at the onset of a release from steady state n is still equal to a
    tau = tau_act if source + n_next >= 2.0 * a else tau_deact
    a_next = advance_activation(source, n_next, a, tau, dt)
    a_then = a - (n - a) * (dt / tau)
    if stimulated > 0:  # n is the excitation of the step before, so it can be undone exactly
        decays = dt / (tau_act if n >= a else tau_deact)
        a_then = n + (a - n) * exp(min(decays, 500.0))  # past 700 it overflows
        a_then = min(max(a_then, 0.0), 1.0)
    frequency = 1.0 / dt
    return (n_next - n) * frequency, (a_next - a) * frequency, a_then


def stretch_rate(
    stretch: float,
    length_rate: float,
    hypothetical: float,
    max_velocity: float,
    share: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    stretch_max: float,
    shape: float,
    limit: float,
) -> tuple[float, float, float, float, float, float]:
    """Rate [length/s] of the stretch of the series element at a constant rate of length.

    Returns:
        the rate; two numbers p and q such that its derivative by the stretch is -p/q [1/s]; q
        times its derivative by the hypothetical force; the stiffness of the series element
        [F_max per unit of stretch] and its force [F_max].
    """
    force, stiffness = series_force(stretch, stretch_max, shape, limit)
    velocity, p, q, r = contractile_velocity(
        force, hypothetical, hill, plateau, slope_ratio, viscosity
    )
    speed = max_velocity * velocity_scale(hypothetical, share)
    drift = speed * r + q * max_velocity * share * velocity
    return length_rate + speed * velocity, speed * stiffness * p, q, drift, stiffness, force


def advance_stretch(
    stretch: float,
    length_rate: float,
    before: float,
    after: float,
    max_velocity: float,
    share: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    stretch_max: float,
    shape: float,
    limit: float,
    dt: float,
) -> float:
    """Stretch of the series element after dt [s] at constant length rate.

    The hypothetical force goes linearly from ``before`` to ``after``. Exponential
    Rosenbrock-Euler, where the equation hardly bends within the step; else ``divided_stretch``.
    """
    change, _, q, bend = linear_change(
        stretch, length_rate, before, after - before, max_velocity, share, hill, plateau,
        slope_ratio, viscosity, stretch_max, shape, limit, dt,
    )  # fmt: skip
    if bend < NEGLIGIBLE * q and stretch >= 0:
        return stretch + change
    return divided_stretch(
        stretch, length_rate, before, after, max_velocity, share, hill, plateau, slope_ratio,
        viscosity, stretch_max, shape, limit, dt,
    )  # fmt: skip


def linear_change(
    stretch: float,
    length_rate: float,
    hypothetical: float,
    gain: float,
    max_velocity: float,
    share: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    stretch_max: float,
    shape: float,
    limit: float,
    dt: float,
) -> tuple[float, float, float, float]:
    """Change of a stretch >= 0 in dt [s] by the equation made linear, and how far that is off.

    The hypothetical force rises by ``gain`` in that time.

    Returns:
        the change; q times the rate [length/s] that the linear equation has at its end; q; q
        times an estimate of the change of force left out [F_max].
    """
    rate, p, q, drift, stiffness, force = stretch_rate(
        stretch, length_rate, hypothetical, max_velocity, share, hill, plateau, slope_ratio,
        viscosity, stretch_max, shape, limit,
    )  # fmt: skip
    constant, growing = averages(dt * p, q)
    change = dt * (rate * constant + drift * gain * growing)
    rise = stiffness * change
    excess = force - hypothetical
    # q is the force over which the slope of force-velocity changes by its own size
    steps = abs(change) * (shape / stretch_max)  # in which force grows e-fold
    bend = (abs(rise) + abs(gain)) * abs(rise) * (2.0 + steps)
    if steps > 5.0:  # any force is left out
        bend += q
    if excess * (excess + rise - gain) < 0:  # the slope jumps where shortening turns to lengthening
        bend += q * abs(rise * (slope_ratio - 1.0))
    return change, rate * q + drift * gain - p * change, q, bend


def divided_stretch(
    stretch: float,
    length_rate: float,
    before: float,
    after: float,
    max_velocity: float,
    share: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    stretch_max: float,
    shape: float,
    limit: float,
    dt: float,
) -> float:
    """As ``advance_stretch``, each substep corrected from the rate at its end.

    Second order, L-stable. Where the correction is large, because force leaves the eccentric
    plateau or the element goes slack, the step is divided.
    """
    elapsed, part = 0.0, 1.0  # in units of dt
    held = False  # whether the hypothetical force is
    for _trial in range(PATIENCE):
        now = before + (after - before) * elapsed
        if stretch < 0:  # slack is taken up at its mean rate, to the moment it is taut
            rate, _, _, _, _, _ = stretch_rate(
                stretch, length_rate, 0.5 * (now + after), max_velocity, share, hill, plateau,
                slope_ratio, viscosity, stretch_max, shape, limit,
            )  # fmt: skip
            left = (1.0 - elapsed) * dt
            if stretch + rate * left < 0:
                return stretch + rate * left
            elapsed -= stretch / (rate * dt)
            part = 1.0 - elapsed
            stretch = 0.0
            continue
        gain, time = (after - before) * part, part * dt
        change, end, q, _ = linear_change(
            stretch, length_rate, now, 0.0 if held else gain, max_velocity, share, hill, plateau,
            slope_ratio, viscosity, stretch_max, shape, limit, time,
        )  # fmt: skip
        _, p, _, _, stiffness, force = stretch_rate(
            stretch, length_rate, now, max_velocity, share, hill, plateau, slope_ratio,
            viscosity, stretch_max, shape, limit,
        )  # fmt: skip
        rate, new_p, new_q, _, new_stiffness, new_force = stretch_rate(
            stretch + change, length_rate, now + gain, max_velocity, share, hill, plateau,
            slope_ratio, viscosity, stretch_max, shape, limit,
        )  # fmt: skip
        # a muscle that gives way cannot shorten: its plateau has risen away above the force
        if not held and force > now and new_force > now + gain and change > length_rate * time:
            held = True
            continue
        # what the linear equation has missed at the end of the part
        missed = time * (rate - end / q)
        _, growing = averages(time * p / q, 1.0)
        _, slower = averages(time * min(p / q, new_p / new_q), 1.0)
        held = False
        error = abs(missed) * slower * max(stiffness, new_stiffness)
        if error > TOLERANCE:
            part *= max(0.1, 0.8 * sqrt(TOLERANCE / error))
            continue
        stretch += change + missed * growing
        elapsed += part
        if elapsed >= 1.0 - 1e-9:
            return stretch
        part = min(1.0 - elapsed, 4.0 * part)
    return settled_stretch(
        stretch, length_rate, after, max_velocity, share, hill, plateau, slope_ratio, viscosity,
        stretch_max, shape, limit, (1.0 - elapsed) * dt,
    )  # fmt: skip


def settled_stretch(
    stretch: float,
    length_rate: float,
    hypothetical: float,
    max_velocity: float,
    share: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    stretch_max: float,
    shape: float,
    limit: float,
    dt: float,
) -> float:
    """As ``advance_stretch``, to first order, from anywhere: never past the equilibrium.

    Backward Euler, by bisection: the rate falls as the stretch grows, so there is one solution.
    Where ``divided_stretch`` has lost its patience, any other step may end at any force.
    """
    slack_rate, _, _, _, _, _ = stretch_rate(
        -stretch_max, length_rate, hypothetical, max_velocity, share, hill, plateau, slope_ratio,
        viscosity, stretch_max, shape, limit,
    )  # fmt: skip
    if stretch + dt * slack_rate <= 0.0:
        return stretch + dt * slack_rate
    low, high = 0.0, max(stretch, 0.0) + dt * max(slack_rate, 0.0)
    for _halving in range(60):
        middle = 0.5 * (low + high)
        rate, _, _, _, _, _ = stretch_rate(
            middle, length_rate, hypothetical, max_velocity, share, hill, plateau, slope_ratio,
            viscosity, stretch_max, shape, limit,
        )  # fmt: skip
        if middle < stretch + dt * rate:
            low = middle
        else:
            high = middle
    return high


def staged_stretch(
    stretch: float,
    length_rate: float,
    hypothetical: float,
    max_velocity: float,
    share: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
    stretch_max: float,
    shape: float,
    limit: float,
    dt: float,
) -> tuple[float, float]:
    """Stretch whose force to use, and rate of the stretch, in a stage of RK4 of step dt [s].

    RK4 is unstable where the stretch relaxes faster than 2.78/dt. Where it does so faster than
    2/dt, the rate is the mean one over the time that slows it down to that, and the force is
    that of the stretch a little later, when the lag which this adds is made up: a joint that
    moves on feels the force of the true equation, and one that is pulled away its true impulse.
    """
    rate, p, q, _, _, _ = stretch_rate(
        stretch, length_rate, hypothetical, max_velocity, share, hill, plateau, slope_ratio,
        viscosity, stretch_max, shape, limit,
    )  # fmt: skip
    now = dt * p / q
    _, p, q, _, _, _ = stretch_rate(
        stretch + 0.5 * dt * rate, length_rate, hypothetical, max_velocity, share, hill, plateau,
        slope_ratio, viscosity, stretch_max, shape, limit,
    )  # fmt: skip
    if now <= 2.0 and dt * p <= 2.0 * q:
        return stretch, rate
    settled = advance_stretch(
        stretch, length_rate, hypothetical, hypothetical, max_velocity, share, hill, plateau,
        slope_ratio, viscosity, stretch_max, shape, limit, 0.5 * dt,
    )  # fmt: skip
    _, p, q, _, _, _ = stretch_rate(
        settled, length_rate, hypothetical, max_velocity, share, hill, plateau, slope_ratio,
        viscosity, stretch_max, shape, limit,
    )  # fmt: skip
    then = dt * p / q
    fastest = max(now, then)
    if fastest <= 2.0:
        return stretch, rate
    # (1 - exp(-z t))/(z t) = 2/z, to 6 %
    whole = 0.5 * dt * (1.0 - 4.0 / (fastest * fastest))
    later = advance_stretch(
        stretch, length_rate, hypothetical, hypothetical, max_velocity, share, hill, plateau,
        slope_ratio, viscosity, stretch_max, shape, limit, whole,
    )  # fmt: skip
    ahead = 0.5 * dt * min(max(0.125 * (then - 2.0), 0.0), 1.0)
    if now > 2.0:
        ahead = max(ahead, dt * log(0.5 * now) / now)
    present = stretch
    if ahead > 0.0:
        present = advance_stretch(
            stretch, length_rate, hypothetical, hypothetical, max_velocity, share, hill, plateau,
            slope_ratio, viscosity, stretch_max, shape, limit, ahead,
        )  # fmt: skip
    return present, (later - stretch) / whole
