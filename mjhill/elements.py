"""The equations of the muscle and the joint, each once.

Pure scalar functions: floats in, floats out, no arrays, no MuJoCo. The compiled back-end gives
the same source to another compiler, so a function here calls only ``exp``, ``log``, ``sqrt`` and
others like it.

Tension and shortening velocity are positive. Forces are in units of the maximum isometric
force, velocities of the contractile element in units of its maximum velocity. Equation numbers
are those of Winters & Stark (1987), Biol. Cybern. 55:403-420.
"""

from __future__ import annotations

from math import exp, log, sqrt


def excitation_rate(u: float, n: float, tau: float) -> float:
    """Rate [1/s] of neural excitation n, driven by the excitation u (sect. 3.1, NEX)."""
    return (u - n) / tau


def activation_rate(n: float, a: float, tau_act: float, tau_deact: float) -> float:
    """Rate [1/s] of activation a driven by excitation n (sect. 3.1, ACT)."""
    if n >= a:
        return (n - a) / tau_act
    return (n - a) / tau_deact


def active_length_factor(
    length: float, optimal: float, width_short: float, width_long: float
) -> float:
    """Share of the isometric force available at a length: skewed Gaussian (sect. 3.2, ATA).

    Slope at the optimum is 0 on both sides, so the two halves join smoothly.
    """
    deviation = length - optimal
    z = deviation / (width_short if deviation < 0 else width_long)
    return exp(-z * z)


def hypothetical_force(a: float, factor: float, floor: float) -> float:
    """Isometric force at activation a and length factor (below eq. 5), at least ``floor``.

    The floor departs from the paper: at zero force its eq. 4 divides zero by zero. A muscle
    at the floor still takes up its slack, so it is taut when it is called upon.
    """
    return max(a * factor, floor)


def velocity_scale(hypothetical: float, share: float) -> float:
    """Factor on the maximum velocity: ``share`` of it scales with the active state.

    Not in the paper, off at share 0; Winters' later models scale V_max with activation.
    """
    return 1.0 - share + share * hypothetical


def contractile_velocity(
    force: float,
    hypothetical: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
) -> tuple[float, float, float, float]:
    """Shortening velocity of the contractile element under a force, and its slopes as ratios.

    Shortening: force = H hill (1 - v)/(hill + v) - viscosity v, Hill's relation (eqs. 3-5)
    with H the hypothetical force. Lengthening at w = -v: force = H (1 + (plateau - 1) w/(w + c))
    + viscosity w, Hill's relation inverted (sect. 3.2), with c such that the slope at v = 0 is
    ``slope_ratio`` times that of shortening. The viscosity departs from the paper: it gives the
    plateau a finite slope. Either branch is a quadratic in the velocity.

    Returns:
        velocity [V_max], positive when shortening; then three numbers p > 0, q > 0 and r such
        that d velocity/d force = -p/q and d velocity/d hypothetical = r/q [V_max/F_max]: the
        caller divides by more, and only once.
    """
    deficit = hypothetical - force
    if deficit >= 0:
        linear = force + hypothetical * hill + viscosity * hill
        root = sqrt(linear * linear + 4 * viscosity * hill * deficit)
        velocity = 2 * hill * deficit / (linear + root)
        return velocity, velocity + hill, root, hill * (1 - velocity)
    excess = -deficit
    c = (plateau - 1) * hill / ((1 + hill) * slope_ratio)
    linear = hypothetical * (plateau - 1) + viscosity * c - excess
    root = sqrt(linear * linear + 4 * viscosity * c * excess)
    if linear >= 0:  # the form of the root that does not cancel
        lengthening = 2 * c * excess / (linear + root)
    else:
        lengthening = (root - linear) / (2 * viscosity)
    return -lengthening, lengthening + c, root, c + plateau * lengthening


def hill_relation(velocity: float, hill: float) -> float:
    """Force of shortening at a velocity [V_max], in units of isometric force (eq. 3)."""
    return hill * (1 - velocity) / (hill + velocity)


def contractile_force(
    velocity: float,
    hypothetical: float,
    hill: float,
    plateau: float,
    slope_ratio: float,
    viscosity: float,
) -> float:
    """Force of the contractile element at a shortening velocity [V_max], never below 0.

    ``contractile_velocity`` the other way round.
    """
    if velocity >= 0:
        force = hypothetical * hill_relation(velocity, hill) - viscosity * velocity
    else:
        c = (plateau - 1) * hill / ((1 + hill) * slope_ratio)
        force = hypothetical * (1 + (plateau - 1) * velocity / (velocity - c))
        force -= viscosity * velocity
    return max(force, 0.0)


def series_force(
    stretch: float, stretch_max: float, shape: float, limit: float
) -> tuple[float, float]:
    """Force of the series element and its stiffness at a stretch (eqs. 6-7); slack below 0.

    Past ``limit * stretch_max`` it goes on straight, which departs from the paper and keeps a
    pose set far from equilibrium finite.

    Returns:
        force [F_max]; stiffness [F_max per unit of stretch].
    """
    if stretch < 0:
        return 0.0, 0.0
    rate = shape / stretch_max
    z = rate * stretch
    z_limit = shape * limit
    scale = 1.0 / (exp(shape) - 1.0)
    growth = exp(min(z, z_limit))
    force = scale * (growth * (1.0 + max(z - z_limit, 0.0)) - 1.0)
    return force, scale * growth * rate


def series_stretch_at(force: float, stretch_max: float, shape: float, limit: float) -> float:
    """Stretch of the series element that carries a force [F_max]: ``series_force`` inverted."""
    growth = 1.0 + force * (exp(shape) - 1.0)
    growth_limit = exp(shape * limit)
    z = log(growth) if growth <= growth_limit else shape * limit + growth / growth_limit - 1.0
    return z * stretch_max / shape


def passive_torque(
    deviation: float,
    stiffness: float,
    k1_pos: float,
    k2_pos: float,
    k1_neg: float,
    k2_neg: float,
    exponent_limit: float,
) -> float:
    """Torque of the passive elasticity at a deviation from rest (sect. 3.2, PE) [N·m].

    Linear plus exponential, restoring. Past ``exponent_limit`` the exponential goes on
    straight, which departs from the paper and keeps the torque finite.
    """
    if deviation >= 0:
        k1, k2, q = k1_pos, k2_pos, deviation
    else:
        k1, k2, q = k1_neg, k2_neg, -deviation
    z = k2 * q
    growth = exp(min(z, exponent_limit)) * (1.0 + max(z - exponent_limit, 0.0))
    torque = stiffness * q + k1 * (growth - 1.0)
    return -torque if deviation >= 0 else torque
