"""The result of a benchmark."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Result:
    """A table with notes.

    Attributes:
        title: What was measured.
        rows: Rows of the table, all with the same keys. ``met`` says whether the ``goal`` was
            reached; both are None in rows without a goal.
        notes: One line each: how it was measured, what the goal means.
    """

    title: str
    rows: list[dict[str, Any]]
    notes: tuple[str, ...] = ()
