"""Table 2 of the paper: steps of excitation of a free joint, as fits of a second-order system.

The printed time constants of some rows contradict the J, B and K printed beside them; those
rows carry corrected ones, and the note in ``table2.csv`` says why.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from math import radians
from pathlib import Path

from mjhill.joints.joint import Joint

_DATA = Path(__file__).parent / "table2.csv"
SHAPE_SPREAD = 0.05  # of MAG, between a response and a second-order one


@dataclass(frozen=True)
class Row:
    """One row of Table 2.

    Attributes:
        movement: As printed, such as ``Elbow flexion``.
        joint: The joint's name.
        muscles: The muscles it holds for: one, or both where the row names no direction.
        level: Excitation [-].
        magnitude: MAG, the movement from start to end [rad].
        time_constants: T1 and T2 [s], corrected.
        printed: T1 and T2 [s], as printed.
        stiffness: K of the fit [N·m/rad], as printed.
        damping: B of the fit [N·m·s/rad], as printed.
        gain: K MAG over excitation and maximum torque [-], as printed; the paper does not
            define it.
        note: What is wrong with the printed values; empty if nothing is.
    """

    movement: str
    joint: str
    muscles: tuple[str, ...]
    level: float
    magnitude: float
    time_constants: tuple[float, float]
    printed: tuple[float, float]
    stiffness: float
    damping: float
    gain: float
    note: str


def table2() -> list[Row]:
    """The 22 rows, in the order of the paper."""
    with _DATA.open(newline="", encoding="utf-8") as file:
        lines = (line for line in file if not line.startswith("#"))
        return [_row(cells) for cells in csv.DictReader(lines)]


def rows_of(joint: Joint) -> list[Row]:
    """The rows of one joint; none for a joint that Table 2 does not have."""
    return [row for row in table2() if row.joint == joint.name]


def _row(cells: dict[str, str]) -> Row:
    def seconds(*names: str) -> tuple[float, float]:
        first, second = (1e-3 * float(cells[name]) for name in names)
        return first, second

    return Row(
        cells["movement"],
        cells["joint"],
        tuple(cells["muscles"].split()),
        float(cells["PH"]),
        radians(float(cells["MAG_deg"])),
        seconds("T1_ms_corrected", "T2_ms_corrected"),
        seconds("T1_ms", "T2_ms"),
        float(cells["K"]),
        float(cells["B"]),
        float(cells["gain"]),
        cells["note"],
    )
