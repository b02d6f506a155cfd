"""What a run of the catalogue has come to, as numbers and as one page."""

from __future__ import annotations

import os
import platform
from collections import Counter
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mjhill.files import replacing
from mjhill.report.page import page
from mjhill.report.runner import Outcome
from mjhill.report.store import write_json

_PACKAGES = ("mjhill", "mujoco", "numpy", "scipy", "matplotlib")


def write_report(report: dict[str, Any], folder: str | Path) -> dict[str, Path]:
    """Write ``report.html`` and ``report.json`` beside the parts.

    Args:
        report: As ``report_of`` gives it.
        folder: Where the parts are.

    Returns:
        The paths, by what they hold.

    Raises:
        OSError: They cannot be written.
    """
    folder = Path(folder)
    paths = {"page": folder / "report.html", "numbers": folder / "report.json"}
    with replacing(paths["numbers"]) as partial:
        write_json(partial, report)
    with replacing(paths["page"]) as partial:
        partial.write_text(page(report, folder), encoding="utf-8")
    return paths


def report_of(outcome: Outcome) -> dict[str, Any]:
    """Every number, ready for JSON."""
    parts = [
        {"name": part.name, "command": part.command, **numbers} for part, numbers in outcome.parts
    ]
    return {
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": _versions(),
        "claims": tally(parts),
        "interrupted": outcome.interrupted,
        "parts": parts,
        "missing": [
            {
                "name": part.name,
                "id": part.entry.id,
                "joint": part.joint,
                "command": part.command,
                "reason": failure.reason,
                "details": failure.details,
            }
            for part, failure in outcome.missing.items()
        ],
        "problems": [
            {"name": part.name, "problem": problem} for part, problem in outcome.problems.items()
        ],
    }


def tally(parts: list[dict[str, Any]]) -> dict[str, int]:
    """How many claims hold, do not hold and are not decided."""
    count = Counter(claim["holds"] for part in parts for claim in part["claims"])
    return {"hold": count[True], "do not hold": count[False], "not decided": count[None]}


def _versions() -> dict[str, str]:
    packages = {name: version(name) for name in _PACKAGES}
    machine = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    return {**packages, "Python": platform.python_version(), "on": machine}
