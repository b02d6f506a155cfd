"""A quick release to a constant load, and what is read of it at one angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.rig import Rig, direction, run, still
from mjhill.muscles.hill import Hill
from mjhill.muscles.readings import shortening_velocity, steady_stretch, tension
from mjhill.simulate.recording import Recording
from mjhill.simulate.reference import plant_torque
from mjhill.simulate.signals import Signal

RELEASE = 0.05  # when the load drops [s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Point:
    """What is read of one load as the joint passes the angle, all along the muscle's way.

    Attributes:
        load: External torque against the muscle [N·m].
        velocity: Of the joint [rad/s].
        inertial: Inertia times acceleration [N·m].
        viscous: Passive viscosity times velocity [N·m].
        elastic: Passive torque against the muscle [N·m].
        shortening: Velocity of the contractile element itself [rad/s].
    """

    load: float
    velocity: float
    inertial: float
    viscous: float
    elastic: float
    shortening: float


def released(
    bench: Rig, muscle: str, start: float, held: float, load: float, duration: float
) -> Recording:
    """The run in which the torque against the muscle drops from ``held`` to ``load`` [N·m]."""
    sign = direction(bench.joint, muscle)
    torque = Signal(lambda time: -sign * (held if time < RELEASE else load), (RELEASE,))
    begin = still(bench, start, {muscle: 1.0})
    return run(bench, begin, duration, excitation={muscle: 1.0}, torque=torque)


def reading(
    joint: Joint, muscle: str, recording: Recording, angle: float, load: float
) -> Point | None:
    """What is read as the joint passes the angle; None where it does not."""
    sign = direction(joint, muscle)
    beyond = sign * (recording[f"{joint.name}.angle"] - angle)
    if beyond.max() < 0:
        return None
    first = int(np.argmax(beyond >= 0))
    share = beyond[first] / (beyond[first] - beyond[first - 1])
    velocity = sign * recording[f"{joint.name}.velocity"]
    acceleration = np.gradient(velocity, recording.time)

    def at(values: _Values) -> float:
        return float(values[first] + share * (values[first - 1] - values[first]))

    return Point(
        load,
        at(velocity),
        joint.inertia * at(acceleration),
        joint.damping * at(velocity),
        -sign * plant_torque(joint, angle),
        at(recording[f"{muscle}.velocity"]),
    )


def own_curve(muscle: Hill, length: float) -> tuple[_Values, _Values]:
    """Velocity [rad/s], ascending, and torque of the shortening element in full activation."""
    isometric = steady_stretch(muscle, 1.0, length)
    stretches = np.linspace(isometric, 0.0, 400).tolist()
    velocities = [shortening_velocity(muscle, 1.0, length, stretch) for stretch in stretches]
    return np.array(velocities), np.array([tension(muscle, stretch) for stretch in stretches])
