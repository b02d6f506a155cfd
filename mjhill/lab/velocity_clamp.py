"""Movement at a constant velocity: the machine's path, and the contractile element alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mjhill.elements import velocity_scale
from mjhill.joints.joint import Joint
from mjhill.muscles.hill import Hill
from mjhill.muscles.readings import isometric_share

RAMP = 0.04  # by when the machine is up to speed [s], or sooner:
RAMP_SHARE = 0.1  # within that share of its way [-]
_FEWEST = 20  # steps over a way that is to be seen

Values = NDArray[np.float64]


def ramp_time(way: float, velocity: float) -> float:
    """How long the machine takes to come up to a velocity [rad/s] on its way [rad]; in s."""
    return min(RAMP, 2 * RAMP_SHARE * abs(way / velocity))


def travel_time(way: float, velocity: float) -> float:
    """How long the machine takes for its way [rad], from rest, at a velocity [rad/s]; in s."""
    return abs(way / velocity) + 0.5 * ramp_time(way, velocity)


def clamped_path(start: float, end: float, velocity: float, time: Values) -> Values:
    """Angle [rad] of a machine that goes from start to end at a speed, stops and stays.

    Its velocity grows linearly until it is up to speed and falls at once at the end.

    Args:
        start: Angle at time 0 [rad].
        end: Angle at which it stops [rad].
        velocity: Its speed, without sign [rad/s].
        time: [s], shape (T,), from 0.
    """
    way = end - start
    ramp = ramp_time(way, velocity)
    gone = np.where(time < ramp, 0.5 * velocity * time**2 / ramp, velocity * (time - 0.5 * ramp))
    return np.asarray(start + np.sign(way) * np.minimum(gone, abs(way)))


def check_velocity(velocity: float, way: float, timestep: float) -> None:
    """Refuse a velocity [rad/s] at which no machine could clamp the joint on a way [rad].

    Raises:
        ValueError: It is 0 or not finite, or so high that the way is over within 20 steps.
    """
    fastest = abs(way) / (_FEWEST * timestep)
    if not (np.isfinite(velocity) and 0 < abs(velocity) <= fastest):
        raise ValueError(
            f"a clamp velocity must not be 0 and at most {fastest:.4g} rad/s either way, at which "
            f"{abs(way):.3g} rad are over within {_FEWEST} steps, got {velocity}"
        )


def contractile_force(muscle: Hill, activation: float, length: float, velocity: float) -> float:
    """Force that a contractile element carries at a velocity [N·m or N] (eqs. 3-5), never below 0.

    The inverse of ``readings.shortening_velocity``.

    Args:
        muscle: The muscle.
        activation: Its activation [-].
        length: Its length [rad or m].
        velocity: Of shortening [rad/s or m/s].
    """
    share = isometric_share(muscle, activation, length)
    scale = muscle.max_velocity * velocity_scale(share, muscle.velocity_activation)
    v, hill = velocity / scale, muscle.hill_shape
    if v >= 0:
        force = share * hill * (1 - v) / (hill + v) - muscle.viscosity * v
    else:
        plateau = muscle.eccentric_plateau - 1
        c = plateau * hill / ((1 + hill) * muscle.eccentric_slope_ratio)
        force = share * (1 + plateau * v / (v - c)) - muscle.viscosity * v
    return muscle.max_isometric_force * max(force, 0.0)


def own_torque(
    joint: Joint, muscle: str, activation: float, angle: float, velocity: float
) -> float:
    """Torque [N·m] of a muscle that were its contractile element alone, without sign.

    Args:
        joint: The joint.
        muscle: The muscle.
        activation: Its activation [-].
        angle: Of the joint [rad].
        velocity: Of the joint, positive where the muscle shortens [rad/s].
    """
    gear = joint.gears[muscle]
    length, speed = gear * angle, abs(gear) * velocity
    return abs(gear) * contractile_force(joint.muscles[muscle], activation, length, speed)
