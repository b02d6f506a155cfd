"""How far fitted joints are from the literature and from measurements, as rows of tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import degrees
from typing import Any

from mjhill.identification.evidence import Evidence, evidence_on
from mjhill.identification.facts import Fact
from mjhill.identification.fit import Identified
from mjhill.identification.free import Free
from mjhill.identification.movement import Prediction
from mjhill.joints.joint import Joint
from mjhill.literature.published import EndAngle, PassiveTorque

MAGNITUDE_MET, DELAY_MET = 5.0, 15.0
"""Largest difference of MAG and of T1 + T2 from Table 2 that counts as met [%]."""
DEVIATION_MET = 2.0
"""Largest difference from anything else that counts as met [standard deviations]."""

_NEAR = 1.3  # ratio of T1 to T2 below which only their sum is well determined


def step_rows(joint: Joint, start: str = "relaxed") -> list[dict[str, Any]]:
    """Table 2 beside the joint's own steps, one row for each step; degrees and ms.

    Args:
        joint: The joint.
        start: How it starts a step, one of ``STARTS``.
    """
    evidence = evidence_on(joint, start=start)
    rows = []
    for (muscle, row), fit in zip(evidence.steps, evidence.fits(joint), strict=True):
        wanted = [1e3 * constant for constant in row.time_constants]
        found = [1e3 * constant for constant in fit.time_constants]
        rows.append(
            {
                "movement": row.movement,
                "muscle": muscle,
                "excitation": row.level,
                "start [°]": degrees(joint.postures[muscle]),
                "recoil [%]": 100 * abs(joint.postures[muscle] - joint.rest_angle) / row.magnitude,
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
            torque.label,
            (torque.low, torque.high),
            torque.measured(joint),
            torque.source,
        )
    for end in evidence.ends:
        yield _published_row(
            joint,
            end.label,
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


def agreement_rows(result: Identified, joint: Joint, facts: Sequence[Fact]) -> list[dict[str, Any]]:
    """What of the literature a fitted joint meets and what it does not, one row each.

    Met is MAG within 5 %, T1 + T2 within 15 %, and all else within two standard deviations.
    ``against`` says what gets worse where a piece of evidence that the fit used is met better;
    it is given for what is not met or more than one standard deviation off.

    Args:
        result: The fit.
        joint: The fitted joint, with the digits that are written.
        facts: Facts as measured; those about other joints are ignored.
    """
    rows = []
    for row in step_rows(joint, result.start):
        step = f"{row['muscle']} at {row['excitation']:g}"
        times = [row["T1 [ms]"] + row["T2 [ms]"], row["our T1 [ms]"] + row["our T2 [ms]"]]
        for name, unit, pair, off, most in (
            ("MAG", "°", (row["MAG [°]"], row["ours [°]"]), row["off [%]"], MAGNITUDE_MET),
            ("T1 + T2", "ms", times, row["T1 + T2 off [%]"], DELAY_MET),
        ):
            label = f"{name} of {step}"
            against = result.held_back.get(label, "") if abs(off) > most else ""
            wanted, ours = (f"{value:.3g}" for value in pair)
            rows.append(_agreement(f"{label} [{unit}]", wanted, ours, f"{off:+.1f} %",
                                   abs(off) <= most, against))  # fmt: skip
    evidence = evidence_on(joint, start=result.start)
    published: list[PassiveTorque | EndAngle] = [*evidence.torques, *evidence.ends]
    spread = [(one.label, one.deviation(joint)) for one in published]
    for row, (label, off) in zip(published_rows(joint), spread, strict=True):
        rows.append(_spread_agreement(result, label, label, row["low"], row["high"], row["ours"],
                                      off, ""))  # fmt: skip
    for fact in facts:
        if fact.joint == joint.name:
            rows.append(_spread_agreement(
                result, fact.quantity, f"{fact.quantity} [{fact.unit}]", fact.low, fact.high,
                fact.measured, fact.deviation, "held out" if fact.held_out else "",
            ))  # fmt: skip
    return rows


def _spread_agreement(
    result: Identified,
    label: str,
    quantity: str,
    low: float,
    high: float,
    ours: float | None,
    off: float | None,
    use: str,
) -> dict[str, Any]:
    published = f"{low:.3g} to {high:.3g}"
    if ours is None or off is None:
        return _agreement(quantity, published, "not measured", "", False, use)
    against = result.held_back.get(label, "") if abs(off) > 1 else ""
    return _agreement(
        quantity,
        published,
        f"{ours:.3g}",
        f"{off:+.2f} SD",
        abs(off) <= DEVIATION_MET,
        use or against,
    )


def _agreement(
    quantity: str, published: str, ours: str, off: str, met: bool, against: str
) -> dict[str, Any]:
    return {
        "quantity": quantity,
        "published": published,
        "ours": ours,
        "off": off,
        "met": "yes" if met else "no",
        "against": against,
    }


def bound_rows(result: Identified) -> list[dict[str, Any]]:
    """The parameters that ended on a bound: where it comes from, and what pushes there."""
    rows = []
    for free, item in zip(result.free, result.estimates, strict=True):
        if item.at_bound:
            upper = abs(item.value - item.bounds[1]) < abs(item.value - item.bounds[0])
            rows.append(
                {
                    "joint": result.joint.name,
                    "parameter": item.name,
                    "bound": item.bounds[1] if upper else item.bounds[0],
                    "side": "upper" if upper else "lower",
                    "better beyond it": item.pushed_by,
                    "the bound is": _source(result.joint, free),
                }
            )
    return rows


def _source(joint: Joint, free: Free) -> str:
    """What the parameter file says of a parameter."""
    *path, name = free.path
    node: Any = joint
    for key in path:
        if key == "postures":
            return joint.sources[f"postures.{name}"]
        node = node[key] if isinstance(node, Mapping) else getattr(node, key)
    return str(node.sources[name]).partition(": ")[2]


def estimate_rows(result: Identified) -> list[dict[str, Any]]:
    """The parameters of an identified joint, one row each, in SI units."""
    return [
        {
            "joint": result.joint.name,
            "parameter": item.name,
            "value": item.value,
            "95 % from": item.low,
            "to": item.high,
            "bounds from": item.bounds[0],
            "up to": item.bounds[1],
            "from the data [%]": 100 * item.informed,
            "at": "bound" if item.at_bound else "",
        }
        for item in result.all_estimates
    ]


def prediction_rows(predictions: Sequence[Prediction]) -> list[dict[str, Any]]:
    """How well each measurement is predicted, one row each."""
    rows = []
    for item in predictions:
        angle = item.quantity == "angle"
        rows.append(
            {
                "measurement": item.measurement.source,
                "samples": len(item.measurement),
                "predicted": item.quantity,
                "inputs": item.inputs,
                "rms error": degrees(item.error) if angle else item.error,
                "unit": "°" if angle else "N·m",
                "variance explained [%]": 100 * item.explained,
                "notes": list(item.notes),
            }
        )
    return rows


def fact_rows(facts: Sequence[Fact]) -> list[dict[str, Any]]:
    """Facts as published and as measured in simulation, one row each.

    A deviation is in standard deviations from the published mean.
    """
    return [
        {
            "joint": fact.joint,
            "quantity": fact.quantity,
            "unit": fact.unit,
            "low": fact.low,
            "high": fact.high,
            "ours": fact.measured,
            "deviation": fact.deviation,
            "use": "held out" if fact.held_out else "fitted",
            "note": fact.note,
            "source": fact.source,
        }
        for fact in facts
    ]


def fact_counts(facts: Sequence[Fact]) -> list[dict[str, Any]]:
    """How many facts lie within one and two standard deviations: fitted, held out, and all."""

    def row(use: str, chosen: Sequence[Fact]) -> dict[str, Any]:
        sizes = [abs(fact.deviation) for fact in chosen if fact.deviation is not None]
        return {
            "facts": use,
            "count": len(chosen),
            "within 1 SD": sum(size <= 1 for size in sizes),
            "within 2 SD": sum(size <= 2 for size in sizes),
            "largest [SD]": max(sizes, default=None),
        }

    fitted = [fact for fact in facts if not fact.held_out]
    held_out = [fact for fact in facts if fact.held_out]
    return [row("fitted", fitted), row("held out", held_out), row("all", facts)]


def brief(joint: Joint, facts: Sequence[Fact]) -> dict[str, Any]:
    """How well a joint agrees with the literature, in one row.

    Args:
        joint: The joint.
        facts: Facts as measured; those about other joints are ignored.
    """
    steps, published = step_rows(joint), published_rows(joint)
    own = [fact for fact in facts if fact.joint == joint.name]

    def worst(key: str) -> float | None:
        return max((abs(row[key]) for row in steps), default=None)

    def inside(agreeing: Iterable[bool], count: int) -> str:
        return f"{sum(agreeing)} of {count}" if count else ""

    def facts_inside(chosen: Sequence[Fact]) -> str:
        sizes = [abs(fact.deviation) for fact in chosen if fact.deviation is not None]
        return inside((size <= 2 for size in sizes), len(chosen))

    return {
        "joint": joint.name,
        "MAG off at most [%]": worst("off [%]"),
        "T1 + T2 off at most [%]": worst("T1 + T2 off [%]"),
        "passive torques and ranges inside": inside(
            (row["outside by"] is None for row in published), len(published)
        ),
        "fitted facts within 2 SD": facts_inside([fact for fact in own if not fact.held_out]),
        "held-out facts within 2 SD": facts_inside([fact for fact in own if fact.held_out]),
    }
