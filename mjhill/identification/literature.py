"""A joint identified from the literature: Table 2, passive torques, ranges of motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.evidence import Evidence, evidence_on
from mjhill.identification.free import free_parameters, joint_at
from mjhill.identification.identified import Identified
from mjhill.identification.intervals import intervals
from mjhill.identification.solve import solve
from mjhill.joints.joint import Joint
from mjhill.joints.reader import read_joints


def from_literature(
    joint: str,
    parameters: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> Identified:
    """Fit the free parameters of a joint to Table 2 and to published torques and ranges.

    Deterministic; it starts from the middle of the bounds, not from the values in the file.

    Args:
        joint: The joint's name.
        parameters: The parameter file; by default the one that comes with mjhill.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The file has no such joint, or the literature nothing on it.
        RuntimeError: The fit did not settle.
    """
    free = free_parameters(joint, parameters)
    start = read_joints(parameters)[joint]
    evidence = _evidence(start)

    def residuals(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return evidence.residuals(free, points)

    solution = solve(residuals, len(free), progress)
    ends = intervals(residuals, solution, len(free))
    fitted = joint_at(start, free, solution.deviations)
    return Identified(fitted, tuple(free), tuple(solution.estimates(free, ends)))


def check_evidence(joints: Iterable[str], parameters: str | Path | None = None) -> None:
    """Refuse joints that the literature says nothing on, before long work on others.

    Raises:
        ValueError: There is such a joint; the message names it.
    """
    known = read_joints(parameters)
    for name in joints:
        _evidence(known[name])


def _evidence(joint: Joint) -> Evidence:
    evidence = evidence_on(joint)
    if not (evidence.steps or evidence.torques or evidence.ends):
        raise ValueError(
            f"nothing published on {joint.name!r} comes with mjhill; give a measurement"
        )
    return evidence
