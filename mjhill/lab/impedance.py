"""Impedance of a joint that holds a posture: torque over angle for small oscillations.

Excitations are constant, so activations are; there are no reflexes. Studies read two stiffnesses
from such an impedance:

- ``storage``, the part of the torque in phase with the angle, less that of the known inertia.
  Zahalak & Heyman (1979, J. Biomech. Eng. 101:28, abstract) forced small oscillations of 1 to
  15 Hz on forearms; K is the stiffness that they fit to gains and phases. Its mean over the band
  stands for that here, which is our reading.
- ``second_order``, the K of inertia, viscosity and stiffness that are most like the joint. Weiss,
  Hunter & Kearney (1988, J. Biomech. 21:539, abstract) moved ankles at random, computed impulse
  responses of the compliance, and fitted gain, natural frequency and damping ratio to each; I, B
  and K follow from these. So the damping ratio has the fitted inertia, not a known one.

A muscle yields when it is moved slowly and is as stiff as its series element when it is moved
fast, so the two differ, and both depend on the band. Where no second-order system is like the
joint, ``explained`` is low.

Oscillations are small here: the equations are linear. Hill's relation is curved, so wider ones
find less; ``tests/test_impedance.py`` simulates some. The abstracts give no amplitudes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import degrees, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.analysis.frequency import fit_compliance
from mjhill.analysis.responses import SecondOrder
from mjhill.joints.joint import Joint
from mjhill.lab.rig import UnmeasuredError, as_muscle, muscle_torque
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
        held: What is held, for messages.
        torque: What the muscle holds, without sign [N·m].
        inertia: The joint's own [kg·m²].
        frequencies: Evenly spaced over the band [Hz], shape (F,).
        impedance: Torque over angle there [N·m/rad], complex, shape (F,).
    """

    held: str
    torque: float
    inertia: float
    frequencies: _Values
    impedance: _Complex

    @property
    def storage(self) -> float:
        """Stiffness in phase with the angle, mean over the band, inertia left out [N·m/rad]."""
        in_phase = self.impedance.real + self.inertia * (2 * pi * self.frequencies) ** 2
        return float(in_phase.mean())

    @property
    def second_order(self) -> SecondOrder:
        """Inertia, viscosity and stiffness whose compliance is nearest over the band.

        Raises:
            UnmeasuredError: One of them is not above 0.
        """
        fit, _ = self._fit
        if min(fit) <= 0:
            raise UnmeasuredError(
                f"{self.held}, no inertia, viscosity and stiffness above 0 are like it: "
                f"{fit.inertia:.3g} kg·m², {fit.damping:.3g} N·m·s/rad, "
                f"{fit.stiffness:.3g} N·m/rad"
            )
        return fit

    @property
    def explained(self) -> float:
        """Share of the compliance's variance that the second-order system accounts for [-]."""
        return self._fit[1]

    @property
    def damping_ratio(self) -> float:
        """B over 2 sqrt(I K), all three of the second-order fit [-].

        Raises:
            UnmeasuredError: One of the three is not above 0.
        """
        fit = self.second_order
        return fit.damping / (2 * sqrt(fit.inertia * fit.stiffness))

    def stiffness(self, reading: str) -> float:
        """Stiffness by a reading, ``storage`` or ``second_order`` [N·m/rad].

        Raises:
            ValueError: There is no such reading.
            UnmeasuredError: The second-order fit has none above 0.
        """
        if reading not in READINGS:
            raise ValueError(f"unknown reading {reading!r}; there are: {', '.join(READINGS)}")
        return self.storage if reading == "storage" else self.second_order.stiffness

    @cached_property
    def _fit(self) -> tuple[SecondOrder, float]:
        return fit_compliance(self.frequencies, 1 / self.impedance)


def passive_stiffness(joint: Joint, deflection: float) -> float:
    """Mean slope [N·m/rad] of the passive torque, ``deflection`` [rad] either way from rest.

    It is that of slow movement. A study that shakes a relaxed joint finds more, see
    ``held_impedance`` at share 0.
    """
    ends = (joint.rest_angle - deflection, joint.rest_angle + deflection)
    low, high = (plant_torque(joint, angle) for angle in ends)
    return (low - high) / (2 * deflection)


def joint_impedance(
    joint: Joint, excitations: Mapping[str, float], angle: float, frequencies: ArrayLike
) -> _Complex:
    """Torque over angle of small oscillations about a held posture [N·m/rad], shape (F,).

    The equations of joint and muscles made linear. Where ``eccentric_slope_ratio`` is not 1,
    Hill's relation has a kink at rest. An oscillation goes to both sides of it, and the viscosity
    is the mean of those of the two sides.

    Args:
        joint: The joint; its muscles are of the model ``hill``.
        excitations: Constant excitation by muscle [-]; 0 for those without an entry.
        angle: The posture [rad]; an external torque holds the joint there.
        frequencies: Of the oscillations [Hz], shape (F,).

    Raises:
        ValueError: A muscle is of another model.
    """
    s = 2j * pi * np.asarray(frequencies, dtype=np.complex128)
    ends = [plant_torque(joint, angle + nudge) for nudge in (-_NUDGE, _NUDGE)]
    slope = (ends[0] - ends[1]) / (2 * _NUDGE)
    total = np.asarray(joint.inertia * s**2 + joint.damping * s + slope)
    for name, muscle in joint.hill_muscles.items():
        gear = joint.gears[name]
        total += gear**2 * _muscle_impedance(muscle, excitations.get(name, 0.0), gear * angle, s)
    return total


def _muscle_impedance(muscle: Hill, activation: float, length: float, s: _Complex) -> _Complex:
    """Tension over length of a muscle: its contractile element in series with the other."""
    stretch, nudge = steady_stretch(muscle, activation, length), _NUDGE * muscle.series_stretch
    series = series_stiffness(muscle, stretch)
    lengthening, shortening = (
        abs(shortening_velocity(muscle, activation, length, stretch + change))
        for change in (nudge, -nudge)
    )
    viscosity = 0.5 * series * nudge * (1 / lengthening + 1 / shortening)
    ends = [isometric_share(muscle, activation, length + change) for change in (-_NUDGE, _NUDGE)]
    by_length = muscle.max_isometric_force * (ends[1] - ends[0]) / (2 * _NUDGE)
    return np.asarray(series * (by_length + viscosity * s) / (series + viscosity * s))


def held_impedance(
    joint: Joint,
    muscle: str,
    *,
    share: float,
    angle: float | None = None,
    band: tuple[float, float] = (1.0, 15.0),
) -> Impedance:
    """Impedance while a muscle holds ``share`` of its largest torque at a posture.

    Args:
        joint: The joint; its muscles are of the model ``hill``.
        muscle: The muscle that is active; the others are at rest.
        share: Its excitation [-]; 0 for a relaxed joint.
        angle: The posture [rad], by default the angle of rest; an external torque holds the joint
            there.
        band: Lowest and highest frequency [Hz].

    Raises:
        ValueError: A muscle is of another model than ``hill``, there is none of that name, or the
            share or the band is out of range.
    """
    low, high = band
    if not 0 < low < high:
        raise ValueError(f"band must be two ascending frequencies above 0 Hz, got {band}")
    if not 0 <= share <= 1:
        raise ValueError(f"share must be in [0, 1], got {share:g}")
    muscle = as_muscle(joint, muscle)
    angle = joint.rest_angle if angle is None else angle
    frequencies = np.linspace(low, high, _FREQUENCIES)
    return Impedance(
        held=f"{joint.name} at {degrees(angle):.3g}° with {muscle} at {share:g}",
        torque=abs(muscle_torque(joint, muscle, share, angle)),
        inertia=joint.inertia,
        frequencies=frequencies,
        impedance=joint_impedance(joint, {muscle: share}, angle, frequencies),
    )


def stiffness_slope(held: Sequence[Impedance], reading: str) -> float:
    """Rise of stiffness with held torque, dK/dT [1/rad], a line through several levels.

    Args:
        held: Impedances at two or more levels of torque.
        reading: ``storage`` or ``second_order``.

    Raises:
        UnmeasuredError: The second-order fit has no stiffness above 0 at one of the levels.
        ValueError: There is no such reading.
    """
    stiffness = [one.stiffness(reading) for one in held]
    slope, _ = np.polyfit([one.torque for one in held], stiffness, 1)
    return float(slope)
