"""A short external torque on a joint that its muscles hold, and the joint's response."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees

from mjhill.analysis.swing import Swing, first_swing
from mjhill.joints.joint import Joint
from mjhill.lab.rig import Rig, UnmeasuredError, at_rest, build_rig, record_run
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal, pulse

_TRIES, _CLOSE = 8, 0.01  # of the search for a size; its relative tolerance
_GUESS = 0.1  # time to the peak that the first guess assumes [s]


@dataclass(frozen=True)
class ImpulseResponse:
    """Response of a joint to one impulse at one co-contraction.

    Attributes:
        cocontraction: Co-contraction [-].
        impulse: Torque impulse [N·m·s].
        swing: The response as that of a second-order system, positive along the impulse.
        run: The recording.
    """

    cocontraction: float
    impulse: float
    swing: Swing
    run: Recording = field(repr=False)


@dataclass(frozen=True)
class Impulse:
    """How an impulse acts; its size is given to the methods.

    Attributes:
        angle: Posture of the joint [rad].
        sign: 1 towards positive angles, -1 towards negative ones.
        added_inertia: Inertia of a body fixed to the limb [kg·m²].
        width: Duration of the torque [s].
        duration: Duration of a run [s].
    """

    angle: float
    sign: float
    added_inertia: float
    width: float
    duration: float

    def rig(self, joint: Joint) -> Rig:
        """Rig of the joint with the body."""
        return build_rig(joint, exact=True, added_inertia=self.added_inertia)

    def torque(self, size: float) -> Signal:
        """External torque [N·m] over time of an impulse of a size [N·m·s], which starts at 0 s."""
        return (self.sign * size / self.width) * pulse(1.0, 0.0, self.width)

    def response(
        self, joint: Joint, cocontraction: float, excitations: Mapping[str, float], size: float
    ) -> ImpulseResponse:
        """Response of a joint, held by its muscles, to an impulse of a size [N·m·s]."""
        rig, name = self.rig(joint), joint.name
        start = at_rest(rig, self.angle, excitations)
        run = record_run(rig, start, self.duration, torque=self.torque(size))
        deflection = self.sign * (run[f"{name}.angle"] - self.angle)
        velocity, load = (self.sign * run[f"{name}.{what}"] for what in ("velocity", "applied"))
        inertia = joint.inertia + self.added_inertia
        swing = first_swing(run.time, deflection, velocity, load, inertia)
        return ImpulseResponse(cocontraction, size, swing, run)

    def size_for(self, joint: Joint, excitations: Mapping[str, float], peak: float) -> float:
        """Size [N·m·s] of the impulse that deflects a joint by ``peak`` [rad].

        Raises:
            UnmeasuredError: The search finds none.
        """
        guess = (joint.inertia + self.added_inertia) * peak / _GUESS
        for _ in range(_TRIES):
            reached = self.response(joint, 0.0, excitations, guess).swing.peak
            if abs(reached - peak) <= _CLOSE * peak:
                return guess
            guess *= peak / max(reached, 0.01 * peak)
        raise UnmeasuredError(f"no impulse deflects {joint.name} by {degrees(peak):.3g}°")
