"""A joint beside the literature, as rows of tables."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees
from typing import Any

from mjhill.identification.evidence import Evidence, evidence_on
from mjhill.joints.joint import Joint

_NEAR = 1.3  # ratio of T1 to T2 below which the two say little singly


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
