"""Equivalent muscles: one muscle for several synergists (Winters & Stark 1987, sect. 3.2, Fig. 3).

Individual muscles come from anatomy: forces and lengths over a moment arm. The equivalent one
has the sum of their torques at each velocity, and the average of their stretches at each share
of force, stronger muscles weighted more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.elements import active_length_factor, hill_relation, series_stretch_at
from mjhill.muscles.hill import Hill

_Array = NDArray[np.float64]
_TAUS = {  # fastest and slowest fibres, Winters & Stark 1987, eq. 12 [s]
    "excitation_tau": (0.020, 0.050),
    "activation_tau": (0.005, 0.015),
    "deactivation_tau": (0.020, 0.060),
}
_AVERAGED = (
    *_TAUS,
    "eccentric_plateau",
    "eccentric_slope_ratio",
    "velocity_activation",
    "viscosity",
    "activation_floor",
    "series_limit",
)


def anatomical_muscle(
    *,
    max_force: float,
    fibre_length: float,
    tendon_length: float,
    moment_arm: float,
    optimal_length: float,
    fast_fibres: float,
    fibre_speed: float,
    pennation: float = 0.0,
) -> Hill:
    """A muscle of a joint from its anatomy.

    Width: that of a fibre's force-length relation, sqrt(0.45) fibre lengths (Thelen 2003).
    Series stretch: 3.3 % of the tendon (OpenSim's Arm26) and 3 % of the fibres (estimate).
    Hill's A: 0.1 + 0.4 x fast fibres (Umberger et al. 2003). Time constants: between the ends
    of eq. 12 by the share of fast fibres; that they depend on it is the paper's, that they do
    so linearly an estimate.

    Args:
        max_force: Maximum isometric force of the fibres [N].
        fibre_length: Optimal fibre length [m].
        tendon_length: Slack length of the tendon [m].
        moment_arm: Moment arm at the optimum [m].
        optimal_length: Length at which the muscle is strongest, gear times angle [rad].
        fast_fibres: Share of fast fibres, 0 to 1.
        fibre_speed: Unloaded shortening velocity [fibre lengths/s].
        pennation: Angle between fibres and tendon [rad].

    Raises:
        ValueError: A length, force or speed is not positive, or the share is outside 0 to 1.
    """
    positive = {
        "max_force": max_force,
        "fibre_length": fibre_length,
        "tendon_length": tendon_length,
        "moment_arm": moment_arm,
        "fibre_speed": fibre_speed,
    }
    for name, value in positive.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive, got {value}")
    if not 0 <= fast_fibres <= 1:
        raise ValueError(f"fast_fibres must be in [0, 1], got {fast_fibres}")
    width = math.sqrt(0.45) * fibre_length / moment_arm
    taus: dict[str, Any] = {
        name: slow + (fast - slow) * fast_fibres for name, (fast, slow) in _TAUS.items()
    }
    return Hill(
        max_isometric_force=max_force * math.cos(pennation) * moment_arm,
        optimal_length=optimal_length,
        width_short=width,
        width_long=width,
        max_velocity=fibre_speed * fibre_length / moment_arm,
        hill_shape=0.1 + 0.4 * fast_fibres,
        series_stretch=(0.033 * tendon_length + 0.03 * fibre_length) / moment_arm,
        **taus,
    )


def equivalent_muscle(muscles: Sequence[Hill]) -> Hill:
    """One muscle that does what several synergists of a joint do together.

    Torque-velocity curves are summed at each velocity of the joint and Hill's relation is
    fitted to the sum; torque-length curves likewise, with the skewed Gaussian. Stretches are
    averaged at each share of the force, and time constants too, weighted by strength. The
    lengths of all must grow in the same direction of the joint.

    Raises:
        ValueError: No muscle is given, or some are electrically stimulated and some are not.
    """
    if not muscles:
        raise ValueError("an equivalent muscle needs at least one muscle, got none")
    if len({muscle.electrical_stimulation for muscle in muscles}) > 1:
        raise ValueError("electrical_stimulation must be the same in all muscles")
    strengths = np.array([muscle.max_isometric_force for muscle in muscles])
    weights = strengths / strengths.sum()
    averages = {
        name: float(weights @ [getattr(muscle, name) for muscle in muscles]) for name in _AVERAGED
    }
    max_torque, optimum, width_short, width_long = _fit_lengths(muscles)
    max_velocity, hill = _fit_velocities(muscles)
    stretch, shape = _fit_stretches(muscles, weights)
    source = f"derived: {len(muscles)} muscles combined after Winters & Stark 1987, sect. 3.2"
    values = {
        "max_isometric_force": max_torque,
        "optimal_length": optimum,
        "width_short": width_short,
        "width_long": width_long,
        "max_velocity": max_velocity,
        "hill_shape": hill,
        "series_stretch": stretch,
        "series_shape": shape,
        **averages,
    }
    return Hill(
        **values,
        electrical_stimulation=muscles[0].electrical_stimulation,
        sources=MappingProxyType(dict.fromkeys(values, source)),
    )


def torque_at_velocity(muscles: Sequence[Hill], velocities: _Array) -> _Array:
    """Summed torque of muscles at full activation, each at its optimum [N·m or N].

    Args:
        muscles: The muscles.
        velocities: Shortening velocities of the joint or tendon, shape (N,), not negative.

    Returns:
        Torques, shape (N,); past its maximum velocity a muscle is slack and gives none.
    """
    total = np.zeros_like(velocities)
    for muscle in muscles:
        v: Any = np.minimum(velocities / muscle.max_velocity, 1.0)
        total += muscle.max_isometric_force * hill_relation(v, muscle.hill_shape)
    return total


def torque_at_length(muscles: Sequence[Hill], lengths: _Array) -> _Array:
    """Summed isometric torque of muscles at full activation, shape of ``lengths``."""
    return np.array(
        [
            sum(
                muscle.max_isometric_force
                * active_length_factor(
                    length, muscle.optimal_length, muscle.width_short, muscle.width_long
                )
                for muscle in muscles
            )
            for length in lengths.tolist()
        ]
    )


def stretch_at_force(muscle: Hill, shares: _Array) -> _Array:
    """Stretch of a series element at shares of the maximum force, shape of ``shares``."""
    return np.array(
        [
            series_stretch_at(
                share, muscle.series_stretch, muscle.series_shape, muscle.series_limit
            )
            for share in shares.tolist()
        ]
    )


def _fit_velocities(muscles: Sequence[Hill]) -> tuple[float, float]:
    """V_max and Hill's A of the summed torque-velocity curve."""
    from scipy.optimize import curve_fit

    fastest = max(muscle.max_velocity for muscle in muscles)
    velocities = np.linspace(0, fastest, 400)
    torque = torque_at_velocity(muscles, velocities)

    def hill(velocity: _Array, v_max: float, a: float) -> _Array:
        v: Any = np.minimum(velocity / v_max, 1.0)
        return np.asarray(hill_relation(v, a))

    start = (fastest, float(np.mean([muscle.hill_shape for muscle in muscles])))
    slowest = min(muscle.max_velocity for muscle in muscles)
    bounds = ((0.5 * slowest, 1e-3), (2 * fastest, 10.0))
    fitted, _ = curve_fit(hill, velocities, torque / torque[0], p0=start, bounds=bounds)
    return float(fitted[0]), float(fitted[1])


def _fit_lengths(muscles: Sequence[Hill]) -> tuple[float, float, float, float]:
    """Maximum, optimum and widths of the summed torque-length curve."""
    from scipy.optimize import curve_fit

    low = min(muscle.optimal_length - muscle.width_short for muscle in muscles)
    high = max(muscle.optimal_length + muscle.width_long for muscle in muscles)
    lengths = np.linspace(low, high, 400)
    torque = torque_at_length(muscles, lengths)
    peak = float(torque.max())

    def gaussian(length: _Array, top: float, optimum: float, short: float, long: float) -> _Array:
        deviation = length - optimum
        return top * np.exp(-((deviation / np.where(deviation < 0, short, long)) ** 2))

    start = (1.0, float(lengths[torque.argmax()]), high - low, high - low)
    fitted, _ = curve_fit(gaussian, lengths, torque / peak, p0=start)
    top, optimum, short, long = fitted.tolist()
    return peak * top, optimum, abs(short), abs(long)


def _fit_stretches(muscles: Sequence[Hill], weights: _Array) -> tuple[float, float]:
    """Stretch at maximum force and shape of the averaged series element."""
    from scipy.optimize import curve_fit

    shares = np.linspace(0.0, 1.0, 200)
    average = weights @ np.array([stretch_at_force(muscle, shares) for muscle in muscles])

    def stretch(share: _Array, shape: float) -> _Array:
        return np.asarray(average[-1] / shape * np.log1p(share * np.expm1(shape)))

    mean = float(weights @ [muscle.series_shape for muscle in muscles])
    fitted, _ = curve_fit(stretch, shares, average, p0=(mean,), bounds=(1e-2, 20.0))
    return float(average[-1]), float(fitted[0])
