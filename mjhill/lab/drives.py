"""What shakes a held joint: torques and inputs that oscillate, and their frequencies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.frequency import octaves
from mjhill.lab.posture import Condition, Unheld, stay
from mjhill.lab.rig import UnmeasuredError, direction, rig

_BAND = (0.3, 30.0)  # of most joints [Hz]
_SWING = 0.25  # of the neural drive, of each input


@dataclass(frozen=True)
class Drive:
    """A joint held at an angle, and what oscillates about its hold.

    Attributes:
        label: What it is, such as ``bias of 10 %``.
        level: Of the muscles that hold [-].
        inputs: Of every muscle [-]; a constant external torque takes what they leave.
        torque: Amplitude of the external torque [N·m].
        excitation: Amplitude of each muscle's input, with its sign [-].
    """

    label: str
    level: float
    inputs: Mapping[str, float]
    torque: float = 0.0
    excitation: Mapping[str, float] | None = None


def frequencies(
    joint: Joint, band: tuple[float, float] | None, stiffness: float
) -> NDArray[np.float64]:
    """Three to an octave; at least ten steps of the simulation in a cycle of the highest."""
    fastest = 0.1 / rig(joint).timestep
    if band is None:
        natural = sqrt(stiffness / joint.inertia) / (2 * pi)
        low = max(min(_BAND[0], 0.5 * natural), 0.05 * natural)
        band = low, min(max(_BAND[1], 10 * natural), fastest)
    if not 0.05 <= band[0] < band[1] <= fastest:
        raise ValueError(
            f"band must ascend within 0.05 to {fastest:g} Hz, got {band[0]} to {band[1]} Hz"
        )
    return octaves(*band)


def bias_of(joint: Joint, muscle: str, share: float) -> Condition:
    """A muscle that is alone active, whatever the angle."""
    return lambda angle: {**dict.fromkeys(joint.muscles, 0.0), muscle: share}


def held_drives(
    joint: Joint, conditions: dict[str, tuple[float, Condition]], angle: float, torque: float
) -> tuple[dict[str, Drive], tuple[Unheld, ...]]:
    """A drive for each condition that the joint stays in, and the others."""
    held, unheld = {}, []
    for label, (level, condition) in conditions.items():
        try:
            held[label] = Drive(label, level, stay(joint, condition, angle), torque)
        except UnmeasuredError as error:
            unheld.append(Unheld(label, str(error)))
    if not held:
        raise UnmeasuredError("; ".join(one.reason for one in unheld))
    return held, tuple(unheld)


def neural_drive(joint: Joint, drive: Drive) -> Drive:
    """The same hold, shaken by the muscles: towards positive angles first."""
    swings = {name: _SWING * u * direction(joint, name) for name, u in drive.inputs.items()}
    return Drive("neural", drive.level, drive.inputs, excitation=swings)
