"""One release of a joint from a spring."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi, sqrt

import numpy as np

from mjhill.experiments.trials.swing import Swing, first_swing
from mjhill.joints.joint import Joint
from mjhill.lab.rig import Spring, net_torque, rig, run, still
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import step

_HELD = 0.1  # before the release, in the recording [s]


@dataclass(frozen=True)
class Release:
    """One release.

    Attributes:
        spring: Stiffness of the spring [N·m/rad].
        level: Co-contraction [-].
        hold: Torque that is taken away, positive along the deflection [N·m].
        swing: Of limb and spring as a second-order system, positive along the way back.
        run: The recording; the release is at 0.1 s.
    """

    spring: float
    level: float
    hold: float
    swing: Swing
    run: Recording = field(repr=False)

    @property
    def stiffness(self) -> float:
        """Of the joint without the spring [N·m/rad]."""
        return self.swing.stiffness - self.spring


def release(
    joint: Joint,
    spring: float,
    level: float,
    inputs: Mapping[str, float],
    angle: float,
    away: float,
    duration: float,
) -> Release:
    """Hold a joint on a spring and let it go.

    Args:
        joint: The joint.
        spring: Stiffness of the spring [N·m/rad].
        level: Co-contraction [-].
        inputs: Of the muscles at that level.
        angle: Where the spring is slack [rad].
        away: From there to where the joint is held [rad], not 0.
        duration: Of the run after the release [s].
    """
    bench = rig(joint, exact=True, spring=Spring(spring, angle))
    hold = spring * away - net_torque(joint, inputs, angle + away)
    start = still(bench, angle + away, inputs)
    done = run(bench, start, _HELD + duration, torque=hold + step(-hold, _HELD))
    first, sign = round(_HELD / bench.timestep), float(np.sign(away))
    back = -sign * (done[f"{joint.name}.angle"][first:] - angle - away)
    speed = -sign * done[f"{joint.name}.velocity"][first:]
    period = 2 * pi * sqrt(joint.inertia / spring)
    load = np.full(len(back), sign * hold)
    swing = first_swing(done.time[first:], back, speed, load, joint.inertia, period)
    return Release(spring, level, sign * hold, swing, done)
