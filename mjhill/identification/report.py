"""An identification as rows of tables."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import Any

from mjhill.identification.facts import Fact
from mjhill.identification.identified import Identified
from mjhill.identification.movement import Prediction


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
            "within": {True: "yes", False: "no", None: ""}[fact.within],
            "source": fact.source,
        }
        for fact in facts
    ]
