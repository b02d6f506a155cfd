"""An identification as rows of tables, and as a page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import degrees
from typing import Any

from mjhill.identification.agreement import published_rows, step_rows
from mjhill.identification.facts import Fact
from mjhill.identification.identified import Identified
from mjhill.identification.movement import Prediction
from mjhill.joints.joint import Joint


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
        for item in result.estimates
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
                "rms error": degrees(item.error) if angle else item.error,
                "unit": "°" if angle else "N·m",
                "variance explained [%]": 100 * item.explained,
            }
        )
    return rows


def fact_rows(facts: Sequence[Fact]) -> list[dict[str, Any]]:
    """Facts that no fit used, beside what a joint does, one row each."""
    return [
        {
            "joint": fact.joint,
            "quantity": fact.quantity,
            "unit": fact.unit,
            "low": fact.low,
            "high": fact.high,
            "ours": fact.measured,
            "within": {True: "yes", False: "no", None: "not measured"}[fact.within],
            "note": fact.note,
            "source": fact.source,
        }
        for fact in facts
    ]


def brief(joint: Joint, held_out: Sequence[Fact]) -> dict[str, Any]:
    """How well a joint meets the literature, in one row.

    Args:
        joint: The joint.
        held_out: Facts that no fit used; those about other joints are not looked at.
    """
    steps, published = step_rows(joint), published_rows(joint)
    own = [fact for fact in held_out if fact.joint == joint.name]

    def worst(key: str) -> float | None:
        return max((abs(row[key]) for row in steps), default=None)

    def inside(agreeing: Iterable[bool], count: int) -> str:
        return f"{sum(agreeing)} of {count}" if count else ""

    return {
        "joint": joint.name,
        "MAG off at most [%]": worst("off [%]"),
        "T1 + T2 off at most [%]": worst("T1 + T2 off [%]"),
        "passive torques and ranges inside": inside(
            (row["outside by"] is None for row in published), len(published)
        ),
        "held-out facts inside": inside((fact.within is True for fact in own), len(own)),
    }


def markdown(report: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """The tables of a report as a page."""
    parts = [_PREFACE]
    for title, rows in report.items():
        parts.append(f"## {title}\n\n{_EXPLANATIONS.get(title, '')}\n\n{_markdown_table(rows)}\n")
    return "\n".join(parts)


def _markdown_table(rows: Sequence[Mapping[str, Any]]) -> str:
    columns = list(rows[0]) if rows else []
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(_cell(row[key]) for key in columns) + " |" for row in rows]
    return "\n".join(lines)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.3g}"
    # nothing may end the cell or begin markup
    text = " ".join(str(value).split())
    return text.replace("|", "\\|").replace("<", "&lt;").replace("](", "]\\(")


_PREFACE = """# Joints beside the literature

Written by `mjhill identify`, which fits the parameters that have bounds in
`mjhill/joints/joints.toml` to Table 2 of Winters & Stark (1987) and to published passive torques
and ranges of motion (`table2.csv` and `published.csv` in `mjhill/literature`). The bounds are what
measurements on
relaxed joints and muscle geometry allow; nothing leaves them. Each fit has a prior, the middle of
the bounds, so it has one answer and says how much of it came from the data. `mjhill info NAME`
gives every source.
"""

_EXPLANATIONS = {
    "Table 2": """A step of input to one muscle, the other at rest, from a posture that Table 2
does not state and the fit finds. MAG, T1 and T2 are those of the overdamped second-order response
nearest to the simulated one. T1 and T2 singly say little where they are nearly equal or the
response swings, marked ill-conditioned: their sum is what counts. Published T1 and T2 are
corrected where the note says so; a row without a direction stands for both.""",
    "Passive torques and ranges of motion": """Low and high span what is published, the fit's data
beside Table 2. Where the two contradict each other, as where Table 2 wants a joint to go further
than its range, the fit is in between and `outside by` says by how much it misses.""",
    "Not used by the fit": """Published facts measured in simulation. Most of what is off has one of
two causes. Table 2 wants slow joints: at 50 % input its time constants leave no room for the
largest velocities that others report. And the input of a twitch or a small saccade is one short
pulse of at most 1, through the time constants of eq. 12.""",
    "Parameters": """SI units. The interval holds the value with 95 % confidence, given the bounds,
the data and their stated errors, and that the model is right; `from the data` is the share of the
prior's variance that the data took away, by the width of the interval.""",
}
