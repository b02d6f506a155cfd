"""How fast a muscle turns a joint that carries nothing."""

from __future__ import annotations

from mjhill.joints.joint import Joint
from mjhill.lab.rig import UnmeasuredError, at_rest, build_rig, direction, record_run

_TIME = 1.0  # [s]; the slowest joint has crossed its range by then


def free_velocity(joint: Joint, muscle: str) -> float:
    """Peak velocity [rad/s] under full input from the far end of the range of motion.

    The joint starts still, both muscles relaxed; what it does past the other end, where ligaments
    and bone would stop it, does not count.

    Raises:
        UnmeasuredError: The muscle does not move it.
    """
    along, (low, high) = direction(joint, muscle), joint.range
    bench = build_rig(joint)
    start = at_rest(bench, low if along > 0 else high)
    recording = record_run(bench, start, _TIME, excitation={muscle: 1.0})
    angle, velocity = recording[f"{joint.name}.angle"], along * recording[f"{joint.name}.velocity"]
    peak = float(velocity[(angle >= low) & (angle <= high)].max())
    if peak <= 0:
        raise UnmeasuredError(f"{muscle} does not move it from the far end of its range")
    return peak
