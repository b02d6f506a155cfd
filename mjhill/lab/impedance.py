"""Stiffness and damping of a joint: at rest, and while a muscle holds a torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.responses import SecondOrder, second_order_fit
from mjhill.analysis.swing import second_order_response
from mjhill.joints.joint import Joint
from mjhill.lab.rig import (
    Rig,
    UnmeasuredError,
    at_rest,
    build_rig,
    direction,
    muscle_torque,
    net_torque,
    record_run,
)
from mjhill.simulate.recording import Recording
from mjhill.simulate.reference import plant_torque
from mjhill.simulate.signals import pulse

_DEFLECTION = radians(1.0)  # what a hit is to move the joint by [rad]
_CLOSE = 0.05  # of it, near enough
_TRIES = 8
_HIT, _WINDOW = 0.02, 0.1  # width of the hit and length of the fit, from the start of the hit [s]
_EXPLAINED = 0.9  # least share of the deflection's variance that a fit must account for [-]


@dataclass(frozen=True)
class Impedance:
    """A joint that holds a torque, as a spring and a damper for 100 ms after a small hit.

    Attributes:
        torque: What the muscle holds, without sign [N·m].
        stiffness: K [N·m/rad].
        damping: B [N·m·s/rad].
        damping_ratio: B over 2 sqrt(J K) [-].
        explained: Share of the deflection's variance that the fit accounts for [-].
        run: The recording.
    """

    torque: float
    stiffness: float
    damping: float
    damping_ratio: float
    explained: float
    run: Recording


def passive_stiffness(joint: Joint, deflection: float) -> float:
    """Mean slope [N·m/rad] of the passive torque, ``deflection`` [rad] either way from rest."""
    ends = (joint.rest_angle - deflection, joint.rest_angle + deflection)
    low, high = (plant_torque(joint, angle) for angle in ends)
    return (low - high) / (2 * deflection)


def held_impedance(joint: Joint, muscle: str, *, share: float, angle: float) -> Impedance:
    """Impedance while a muscle holds ``share`` of its largest torque at ``angle`` [rad].

    An equal and opposite constant torque from outside holds the joint there; a hit of 20 ms
    that stretches the muscle deflects it by 1°.

    Raises:
        UnmeasuredError: The posture is not stable, or the joint does not move like a second-order
            system.
    """
    bench = build_rig(joint, exact=True)
    recording, hit, load = _hit_by_a_degree(bench, muscle, share, angle)
    # along the hit all is positive
    sign = -direction(joint, muscle)
    time, applied = recording.time, sign * (recording[f"{joint.name}.applied"] - load)
    deflection = sign * (recording[f"{joint.name}.angle"] - angle)
    velocity = sign * recording[f"{joint.name}.velocity"]
    fit = second_order_fit(time, deflection, velocity, applied, joint.inertia)
    if fit.stiffness <= 0:
        raise UnmeasuredError(
            f"with {muscle} at {share:g} the joint yields instead of coming back: the fitted "
            f"stiffness is {fit.stiffness:.3g} N·m/rad"
        )
    explained = _explained(fit, time, deflection, applied)
    if explained < _EXPLAINED:
        raise UnmeasuredError(
            f"with {muscle} at {share:g} a second-order system accounts for only "
            f"{explained:.0%} of the deflection after a hit of {hit:.3g} N·m"
        )
    torque = abs(muscle_torque(joint, muscle, share, angle))
    ratio = fit.damping / (2 * sqrt(joint.inertia * fit.stiffness))
    return Impedance(torque, fit.stiffness, fit.damping, ratio, explained, recording)


def stiffness_slope(joint: Joint, muscle: str, *, shares: Sequence[float], angle: float) -> float:
    """Rise of stiffness with held torque, dK/dT [1/rad], a line through several levels.

    Raises:
        UnmeasuredError: As ``held_impedance``, at any of the levels.
    """
    held = [held_impedance(joint, muscle, share=share, angle=angle) for share in shares]
    slope, _ = np.polyfit([one.torque for one in held], [one.stiffness for one in held], 1)
    return float(slope)


def _hit_by_a_degree(
    bench: Rig, muscle: str, share: float, angle: float
) -> tuple[Recording, float, float]:
    """The run in which a hit deflects the joint by 1°, the hit and the steady load [N·m]."""
    joint, levels = bench.joint, {muscle: share}
    load = -net_torque(joint, levels, angle)
    sign = -direction(joint, muscle)
    hit = joint.inertia * _DEFLECTION / _HIT**2
    for _ in range(_TRIES):
        start = at_rest(bench, angle, levels)
        recording = record_run(
            bench, start, _WINDOW, torque=sign * hit * pulse(1.0, 0.0, _HIT) + load
        )
        reached = float((sign * (recording[f"{joint.name}.angle"] - angle)).max())
        if abs(reached - _DEFLECTION) <= _CLOSE * _DEFLECTION:
            return recording, hit, load
        hit *= _DEFLECTION / max(reached, 0.01 * _DEFLECTION)
    raise UnmeasuredError(
        f"with {muscle} at {share:g} no hit of {_HIT * 1e3:g} ms deflects it by 1°"
    )


def _explained(
    fit: SecondOrder,
    time: NDArray[np.float64],
    deflection: NDArray[np.float64],
    load: NDArray[np.float64],
) -> float:
    """Share of a deflection's variance that the fitted system accounts for under the load."""
    fitted = second_order_response(fit, time, load)
    return float(1.0 - np.var(deflection - fitted) / np.var(deflection))
