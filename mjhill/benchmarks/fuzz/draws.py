"""Random numbers and random muscles, over the whole range that ``mjhill.Hill`` accepts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mjhill.joints.joint import Passive
from mjhill.muscles.hill import Hill
from mjhill.quantity import Quantity, quantities

EDGE = 0.04  # probability that a parameter is one of its bounds
SMALLEST = 1e-300  # in place of a bound of 0 that is not itself allowed

Random = np.random.Generator

# ordinary values; a tame parameter is within a factor of three of them
_ORDINARY = {
    "hill_shape": 0.25,
    "series_shape": 3.0,
    "excitation_tau": 0.03,
    "activation_tau": 0.01,
    "deactivation_tau": 0.04,
    "eccentric_slope_ratio": 2.0,
    "viscosity": 3e-3,
    "activation_floor": 3e-3,
}


def log_uniform(random: Random, low: float, high: float) -> float:
    """A positive number whose logarithm is uniform."""
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


def chance(random: Random, share: float) -> bool:
    """True with a probability."""
    return bool(random.random() < share)


def sign(random: Random) -> float:
    """1 or -1."""
    return float(random.choice([-1.0, 1.0]))


def anywhere(random: Random, quantity: Quantity) -> float:
    """A value from the whole range of a parameter, sometimes one of its bounds."""
    low, high = quantity.low, quantity.high
    if chance(random, EDGE):
        least = low if quantity.low_allowed else low + (abs(low) * 1e-15 or SMALLEST)
        return least if chance(random, 0.5) else high
    if low < 0:  # a length: either sign, small ones too
        return sign(random) * log_uniform(random, 1e-4, high)
    if low == 0 or high / low > 100:
        return log_uniform(random, max(low, 1e-12 * high), high)
    return float(random.uniform(math.nextafter(low, high), high))


def random_muscle(random: Random, force: float, length: float, wildness: float) -> Hill:
    """A muscle of a size; each parameter may, with a probability, be anywhere in its range.

    Args:
        random: Source of the random numbers.
        force: Typical maximum isometric force of a tame muscle [N·m or N].
        length: Typical length over which a tame muscle works [rad or m].
        wildness: Probability that a parameter may be anywhere in its range.
    """
    values: dict[str, Any] = {}
    for name, quantity in quantities(Hill):
        if chance(random, wildness):
            values[name] = anywhere(random, quantity)
        else:
            values[name] = _tame(random, name, quantity, force, length)
    return Hill(**values, electrical_stimulation=chance(random, 0.2))


def _tame(random: Random, name: str, quantity: Quantity, force: float, length: float) -> float:
    sizes = {
        "max_isometric_force": force,
        "width_short": length,
        "width_long": length,
        "max_velocity": 6.0 * length,
        "series_stretch": 0.2 * length,
    }
    centre = sizes.get(name, _ORDINARY.get(name))
    if centre is not None:
        value = centre * log_uniform(random, 1 / 3, 3)
    elif name == "optimal_length":
        value = length * float(random.uniform(-0.5, 0.5))
    elif name == "eccentric_plateau":
        value = float(random.uniform(1.1, 1.8))
    elif name == "series_limit":
        value = float(random.uniform(1.2, 3))
    else:  # velocity_activation
        value = float(random.choice([0.0, random.uniform(0, 0.75)]))
    least = quantity.low if quantity.low_allowed else math.nextafter(quantity.low, math.inf)
    return min(max(value, least), quantity.high)


def random_passive(random: Random, torque: float, length: float, wildness: float) -> Passive:
    """A passive elasticity of a size; each parameter may be anywhere in its range."""
    tame = {
        "k1_pos": torque * log_uniform(random, 1e-3, 0.3),
        "k2_pos": log_uniform(random, 0.5, 8) / length,
        "k1_neg": torque * log_uniform(random, 1e-3, 0.3),
        "k2_neg": log_uniform(random, 0.5, 8) / length,
        "exponent_limit": 20.0,
    }
    values: dict[str, Any] = {}
    for name, quantity in quantities(Passive):
        value = anywhere(random, quantity) if chance(random, wildness) else tame[name]
        values[name] = min(value, quantity.high)
    return Passive(**values)
