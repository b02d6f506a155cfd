"""Impedance of a joint that holds a posture: torque over angle for small oscillations.

Excitations are constant, so activations are; there are no reflexes. About the held state the
equations of a muscle are linear but for one kink: at rest, Hill's relation is steeper for
lengthening than for shortening. A small oscillation goes equally to both sides of it, so the
slope is the mean of the two.

Studies read two stiffnesses from an impedance. Zahalak & Heyman (1979, J. Biomech. Eng. 101:28)
forced sinusoidal oscillations: ``storage`` is the part in phase with the angle, less that of the
inertia. Hunter & Kearney (1982), Weiss, Hunter & Kearney (1988, J. Biomech. 21:539) and others
moved joints at random and fitted inertia, viscosity and stiffness to the torque: ``second_order``
is that fit, for an angle of even spectrum over the band. A muscle yields when it is moved slowly and is as stiff as its tendon
when it is moved fast, so the two differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.responses import SecondOrder
from mjhill.joints.joint import Joint
from mjhill.lab.rig import UnmeasuredError, muscle_torque
from mjhill.muscles.hill import Hill
from mjhill.muscles.readings import (
    isometric_share,
    series_stiffness,
    shortening_velocity,
    steady_stretch,
)
from mjhill.simulate.reference import plant_torque

READINGS = ("storage", "second_order")  # of the stiffness in an impedance
_FREQUENCIES = 59  # in a band
_NUDGE = 1e-6  # of an angle [rad], or of a stretch in units of its largest

_Complex = NDArray[np.complex128]
_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Impedance:
    """The impedance of a joint while a muscle holds a torque.

    Attributes:
        torque: What the muscle holds, without sign [N·m].
        frequencies: Evenly spaced over the band [Hz], shape (F,).
        impedance: Torque over angle there [N·m/rad], complex, shape (F,).
        storage: Stiffness in phase with the angle, without the inertia's, mean over the band
            [N·m/rad].
        second_order: Inertia, viscosity and stiffness whose impedance is nearest.
        explained: Share of the torque's variance that these account for [-].
    """

    torque: float
    frequencies: _Values
    impedance: _Complex
    storage: float
    second_order: SecondOrder
    explained: float

    def stiffness(self, reading: str) -> float:
        """Stiffness by a reading, ``storage`` or ``second_order`` [N·m/rad].

        Raises:
            ValueError: There is no such reading.
        """
        if reading not in READINGS:
            raise ValueError(f"unknown reading {reading!r}; there are: {', '.join(READINGS)}")
        return self.storage if reading == "storage" else self.second_order.stiffness

    @property
    def damping_ratio(self) -> float:
        """B over 2 sqrt(I K) of the second-order fit [-]."""
        fit = self.second_order
        return fit.damping / (2 * sqrt(fit.inertia * fit.stiffness))


def passive_stiffness(joint: Joint, deflection: float) -> float:
    """Mean slope [N·m/rad] of the passive torque, ``deflection`` [rad] either way from rest."""
    ends = (joint.rest_angle - deflection, joint.rest_angle + deflection)
    low, high = (plant_torque(joint, angle) for angle in ends)
    return (low - high) / (2 * deflection)


def joint_impedance(
    joint: Joint, excitations: Mapping[str, float], angle: float, frequencies: _Values
) -> _Complex:
    """Torque over angle of small oscillations about a held posture [N·m/rad], shape (F,).

    Args:
        joint: The joint; its muscles are of the model ``hill``.
        excitations: Constant excitation by muscle [-]; 0 for those without an entry.
        angle: The posture [rad]; an external torque holds the joint there.
        frequencies: Of the oscillations [Hz], shape (F,).

    Raises:
        ValueError: A muscle is of another model.
    """
    s = 2j * pi * np.asarray(frequencies)
    ends = [plant_torque(joint, angle + nudge) for nudge in (-_NUDGE, _NUDGE)]
    total = joint.inertia * s**2 + joint.damping * s + (ends[0] - ends[1]) / (2 * _NUDGE)
    for name, muscle in joint.hill_muscles.items():
        gear = joint.gears[name]
        total += gear**2 * _muscle_impedance(muscle, excitations.get(name, 0.0), gear * angle, s)
    return np.asarray(total)


def _muscle_impedance(muscle: Hill, activation: float, length: float, s: _Complex) -> _Complex:
    """Tension over length of a muscle: its contractile element in series with the other."""
    stretch, nudge = steady_stretch(muscle, activation, length), _NUDGE * muscle.series_stretch
    series = series_stiffness(muscle, stretch)
    slower, faster = (
        abs(shortening_velocity(muscle, activation, length, stretch + change))
        for change in (nudge, -nudge)
    )
    viscosity = 0.5 * series * nudge * (1 / slower + 1 / faster)
    ends = [isometric_share(muscle, activation, length + change) for change in (-_NUDGE, _NUDGE)]
    by_length = muscle.max_isometric_force * (ends[1] - ends[0]) / (2 * _NUDGE)
    return np.asarray(series * (by_length + viscosity * s) / (series + viscosity * s))


def held_impedance(
    joint: Joint,
    muscle: str,
    *,
    share: float,
    angle: float,
    band: tuple[float, float] = (1.0, 30.0),
) -> Impedance:
    """Impedance while a muscle holds ``share`` of its largest torque at ``angle`` [rad].

    Args:
        joint: The joint; its muscles are of the model ``hill``.
        muscle: The muscle that is active; the others are at rest.
        share: Its excitation [-].
        angle: The posture [rad]; an external torque holds the joint there.
        band: Lowest and highest frequency [Hz].

    Raises:
        UnmeasuredError: The joint yields, so no second-order system is like it.
        ValueError: A muscle is of another model than ``hill``, or the band does not ascend.
    """
    low, high = band
    if not 0 < low < high:
        raise ValueError(f"band must be two ascending frequencies above 0 Hz, got {band}")
    frequencies = np.linspace(low, high, _FREQUENCIES)
    impedance = joint_impedance(joint, {muscle: share}, angle, frequencies)
    fit = _second_order(frequencies, impedance)
    if min(fit) <= 0:
        raise UnmeasuredError(
            f"with {muscle} at {share:g} and {degrees(angle):.3g}° no inertia, viscosity and "
            f"stiffness above 0 are like it: {fit.inertia:.3g} kg·m², {fit.damping:.3g} N·m·s/rad, "
            f"{fit.stiffness:.3g} N·m/rad"
        )
    left = impedance - _system(fit, frequencies)
    storage = impedance.real + joint.inertia * (2 * pi * frequencies) ** 2
    return Impedance(
        abs(muscle_torque(joint, muscle, share, angle)),
        frequencies,
        impedance,
        float(storage.mean()),
        fit,
        float(1 - np.sum(np.abs(left) ** 2) / np.sum(np.abs(impedance) ** 2)),
    )


def _system(fit: SecondOrder, frequencies: _Values) -> _Complex:
    s = 2j * pi * frequencies
    return np.asarray(fit.inertia * s**2 + fit.damping * s + fit.stiffness)


def _second_order(frequencies: _Values, impedance: _Complex) -> SecondOrder:
    """The second-order system whose impedance is nearest in least squares."""
    omega = 2 * pi * frequencies
    terms = np.stack([np.ones_like(omega), -(omega**2)], axis=1)
    (stiffness, inertia), *_ = np.linalg.lstsq(terms, impedance.real, rcond=None)
    damping = omega @ impedance.imag / (omega @ omega)
    return SecondOrder(float(stiffness), float(damping), float(inertia))


def stiffness_slope(
    joint: Joint,
    muscle: str,
    *,
    shares: Sequence[float],
    angle: float,
    band: tuple[float, float] = (1.0, 30.0),
    reading: str = "second_order",
) -> float:
    """Rise of stiffness with held torque, dK/dT [1/rad], a line through several levels.

    Raises:
        UnmeasuredError: As ``held_impedance``, at any of the levels.
        ValueError: As ``held_impedance``, or there is no such reading.
    """
    held = [held_impedance(joint, muscle, share=share, angle=angle, band=band) for share in shares]
    stiffness = [one.stiffness(reading) for one in held]
    slope, _ = np.polyfit([one.torque for one in held], stiffness, 1)
    return float(slope)
