"""A joint identified from the literature: Table 2, passive torques, ranges of motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import degrees
from pathlib import Path
from typing import Any

from mjhill.identification.evidence import Evidence, evidence_on
from mjhill.identification.free import free_parameters, joint_at
from mjhill.identification.identified import Identified
from mjhill.identification.solve import solve
from mjhill.joints import read_joints
from mjhill.parameters import Joint

_NEAR = 1.3  # ratio of T1 to T2 below which the two say little singly


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
    evidence = evidence_on(start)
    if not (evidence.steps or evidence.torques or evidence.ends):
        raise ValueError(f"nothing published on {joint!r} comes with mjhill; give a measurement")
    solution = solve(lambda points: evidence.residuals(free, points), len(free), progress)
    fitted = joint_at(start, free, solution.deviations)
    return Identified(fitted, tuple(free), tuple(solution.estimates(free)))


def step_rows(joint: Joint) -> list[dict[str, Any]]:
    """Table 2 beside a joint's own steps, one row a cell; angles in degrees, times in ms."""
    evidence = evidence_on(joint)
    rows = []
    for (muscle, row), fit in zip(evidence.steps, evidence.fits(joint), strict=True):
        wanted = [1e3 * constant for constant in row.time_constants]
        found = [1e3 * constant for constant in fit.time_constants]
        rows.append(
            {
                "movement": row.movement,
                "muscle": muscle,
                "input": row.level,
                "MAG [°]": degrees(row.magnitude),
                "ours [°]": degrees(fit.magnitude),
                "off [%]": 100 * (fit.magnitude / row.magnitude - 1),
                "T1 [ms]": wanted[0],
                "T2 [ms]": wanted[1],
                "our T1 [ms]": found[0],
                "our T2 [ms]": found[1],
                "T1 + T2 off [%]": 100 * (sum(found) / sum(wanted) - 1),
                "fit leaves [%]": 100 * fit.misfit,
                "split": "ill-conditioned" if min(map(_ratio, (wanted, found))) < _NEAR else "",
                "note": row.note,
            }
        )
    return rows


def _ratio(constants: list[float]) -> float:
    return constants[0] / max(constants[1], 1e-9)


def published_rows(joint: Joint) -> list[dict[str, Any]]:
    """Published passive torques and ranges of motion beside a joint's own, one row each."""
    return list(_published_rows(evidence_on(joint)))


def _published_rows(evidence: Evidence) -> Iterator[dict[str, Any]]:
    joint = evidence.joint
    for torque in evidence.torques:
        yield _published_row(
            joint,
            f"passive torque at {degrees(torque.angle):.0f}° [N·m]",
            (torque.low, torque.high),
            torque.measured(joint),
            torque.source,
        )
    for end in evidence.ends:
        yield _published_row(
            joint,
            f"full effort of {end.muscle} ends at [°]",
            (degrees(end.low), degrees(end.high)),
            degrees(end.measured(joint)),
            end.source,
        )


def _published_row(
    joint: Joint, quantity: str, span: tuple[float, float], ours: float, source: str
) -> dict[str, Any]:
    low, high = span
    outside = max(low - ours, ours - high, 0.0)
    return {
        "joint": joint.name,
        "quantity": quantity,
        "low": low,
        "high": high,
        "ours": ours,
        "outside by": outside or None,
        "source": source,
    }
