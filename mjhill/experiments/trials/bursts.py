"""Three bursts that take a joint somewhere and clamp it there: agonist, antagonist, agonist.

After the agonist's pulse of a fast voluntary movement come clamping bursts of both muscles (Winters
& Stark 1987, sect. 4.2.1). Their widths are not published; here they are those that bring the
joint to rest best.
"""

from __future__ import annotations

import itertools

import numpy as np

from mjhill.joints.joint import Joint
from mjhill.lab.ensemble import angles
from mjhill.lab.posture import holding
from mjhill.lab.rig import (
    UnmeasuredError,
    antagonist,
    direction,
    rig,
    run,
    still,
)
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal

_SHARE = 0.6  # of the unclamped travel, where the joint is to stay
_INSIDE = 0.8  # most of the way from rest to the end of the range of motion
_SECOND_LEVEL = 0.5  # of the agonist's second burst
# in units of the first burst
_WIDTHS = np.linspace(0.1, 1.2, 45)  # tried, of the antagonist's burst
_SECOND_WIDTHS = np.linspace(0.2, 1.0, 9)  # tried, of the agonist's second burst
_THERE, _END = 2.0, 6.0  # by when the joint is to be there, and the end


def clamped(joint: Joint, muscle: str, width: float, travel: float) -> Recording:
    """A movement by three bursts from the angle of rest, then a level that holds, recorded.

    Args:
        joint: The joint.
        muscle: The agonist.
        width: Of its first, full burst [s].
        travel: How far about that alone takes the joint [rad].
    """
    bench, sign, other = rig(joint), direction(joint, muscle), antagonist(joint, muscle)
    end = joint.range[1] if sign > 0 else joint.range[0]
    goal = min(_SHARE * travel, _INSIDE * abs(end - joint.rest_angle))
    target = joint.rest_angle + sign * goal
    try:
        hold = holding(joint, muscle, target)
    except UnmeasuredError:  # it then drifts back
        hold = dict.fromkeys(joint.muscles, 0.0)
    steps = round(_END * width / bench.timestep)
    times = ((np.arange(steps) + 0.5) * bench.timestep).tolist()
    trials = [
        _bursts(width, width * brake, width * second, hold[muscle], hold[other])
        for brake, second in itertools.product(_WIDTHS.tolist(), _SECOND_WIDTHS.tolist())
    ]
    inputs = np.zeros((len(trials), steps, len(joint.muscles)))
    for i, signals in enumerate(trials):
        for name, signal in zip((muscle, other), signals, strict=True):
            inputs[i, :, list(joint.muscles).index(name)] = [signal(time) for time in times]
    gone = angles(
        [joint] * len(trials),
        start=joint.rest_angle,
        excitation=inputs,
        steps=steps,
        timestep=bench.timestep,
    )
    late = gone[:, round(_THERE * width / bench.timestep) :]
    best = trials[int(np.square(late - target).mean(axis=1).argmin())]
    excitation = dict(zip((muscle, other), best, strict=True))
    return run(bench, still(bench, joint.rest_angle), _END * width, excitation=excitation)


def _bursts(
    width: float, brake: float, second: float, hold: float, other_hold: float
) -> tuple[Signal, Signal]:
    """Inputs of the agonist and the antagonist over time, the levels that hold after them."""
    first, third = width + brake, width + brake + second

    def agonist(time: float) -> float:
        if time < width:
            return 1.0
        if time < first:
            return 0.0
        return _SECOND_LEVEL if time < third else hold

    def opposing(time: float) -> float:
        if time < third:
            return 1.0 if width <= time < first else 0.0
        return other_hold

    ends = (width, first, third)
    return Signal(agonist, ends), Signal(opposing, ends)
