"""What a benchmark measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Result:
    """A table and what to read in it.

    Attributes:
        title: What was measured.
        rows: Rows of the table, all with the same keys. ``goal`` is what was wanted, ``met``
            whether it was reached; None where nothing is wanted of a row.
        notes: One line each: how it was measured, how it compares with the goal.
    """

    title: str
    rows: list[dict[str, Any]]
    notes: tuple[str, ...] = ()
