"""The page of a reproduction: what holds, beside what the paper says."""

from __future__ import annotations

import base64
import math
import os
import platform
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from mjhill.experiments.result import spoken
from mjhill.files import replacing
from mjhill.report.runner import Outcome
from mjhill.report.store import FIGURE, FILM, write_json

_DIGITS = 4  # significant
_PLAIN = (1e-3, 1e5)  # sizes that are written without a power of ten
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MINUS, _TIMES, _THIN = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}", "\N{NARROW NO-BREAK SPACE}"
_ALIKE = 0.005  # a difference that is not worth a word [-]
_FACTOR = 3.0  # from which on a ratio says more than per cent


def number(value: float) -> str:
    """A number to four digits: ``12.35``, ``−0.5``, ``1.7 × 10⁻⁵``."""
    value = float(value)
    if value == 0:
        return "0"
    exponent = ""
    if not _PLAIN[0] <= abs(value) < _PLAIN[1]:
        mantissa, _, power = f"{value:.{_DIGITS - 1}e}".partition("e")
        value = float(mantissa)
        exponent = f"{_THIN}{_TIMES}{_THIN}10{str(int(power)).translate(_SUPERSCRIPT)}"
    digits = max(0, _DIGITS - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{digits}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", _MINUS) + exponent


def with_unit(text: str, unit: str) -> str:
    """A number and its unit, which is nothing for ``-``."""
    if not text or unit in {"", "-"}:
        return text
    return f"{text}{'' if unit == '°' else _THIN}{unit}"


def published(ends: Sequence[float] | None, unit: str) -> str:
    """What is published: a number or a range with its unit, nothing where nothing is."""
    if not ends:
        return ""
    low, high = (number(end) for end in ends)
    return with_unit(low if low == high else f"{low} to {high}", unit)


def difference(value: float | None, ends: Sequence[float] | None) -> str:
    """How a measured value stands to what is published: ``within``, ``12 % above``."""
    if value is None or not ends:
        return ""
    low, high = ends
    if low != high and low <= value <= high:
        return "within"
    nearest = min(ends, key=lambda end: abs(value - end))
    if nearest == 0:
        return "" if value else "equal"
    share = (value - nearest) / abs(nearest)
    if abs(share) < _ALIKE:
        return "equal"
    side = "above" if share > 0 else "below"
    ratio = value / nearest
    if ratio > _FACTOR:
        return f"{number(float(f'{ratio:.2g}'))} times"
    return f"{abs(share):.0%} {side}".replace("%", f"{_THIN}%")


def duration(seconds: float) -> str:
    """A time as one says it: ``0.42 s``, ``14 s``, ``3 min 20 s``."""
    if seconds < 60:
        return f"{seconds:.2g} s" if seconds < 9.95 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if rest else f"{minutes} min"


def option(value: Any) -> str:
    """The value of an option."""
    if isinstance(value, list):
        return ", ".join(option(item) for item in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return number(value)


_HERE = Path(__file__).parent
_VERDICTS = {
    True: {"kind": "holds", "word": "Holds", "sign": "✓"},
    False: {"kind": "fails", "word": "Does not hold", "sign": "✗"},
    None: {"kind": "open", "word": "Not decided", "sign": "?"},
}


def page(report: dict[str, Any], folder: Path) -> str:
    """The page of a report, the figures and videos of its parts taken from a folder.

    Args:
        report: As ``report_of`` gives it.
        folder: Where the files of the parts are.
    """
    environment = Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for filter_ in (number, with_unit, duration, option):
        environment.filters[filter_.__name__] = filter_
    environment.filters["spoken"] = spoken
    return environment.get_template("template.html").render(
        style=(_HERE / "style.css").read_text(encoding="utf-8"),
        report=report,
        made=datetime.fromisoformat(report["made"]).strftime("%-d %B %Y, %H:%M UTC"),
        seconds=sum(part["seconds"] for part in report["parts"]),
        experiments=_experiments(report["parts"], folder),
        verdicts=_VERDICTS,
        count=report["claims"],
    )


def _experiments(parts: list[dict[str, Any]], folder: Path) -> list[dict[str, Any]]:
    """The parts by experiment, with all that the page says of them."""
    experiments: dict[str, dict[str, Any]] = {}
    for part in parts:
        experiment = experiments.setdefault(
            part["id"],
            {
                "id": part["id"],
                "title": part["title"],
                "section": part["section"],
                "parts": [],
                "claims": {},
            },
        )
        shown = _part(part, folder)
        experiment["parts"].append(shown)
        for claim in shown["claims"]:
            # on several joints it is one claim with several verdicts
            alike = experiment["claims"].setdefault(
                (claim["sentence"], claim["section"]), {**claim, "cells": []}
            )
            alike["cells"].append({**claim, "joint": part["joint"]})
    for experiment in experiments.values():
        verdicts = [claim["holds"] for part in experiment["parts"] for claim in part["claims"]]
        experiment["held"], experiment["decided"] = verdicts.count(True), len(verdicts)
        experiment["claims"] = list(experiment["claims"].values())
    return list(experiments.values())


def _part(part: dict[str, Any], folder: Path) -> dict[str, Any]:
    film = part["film"] or {}
    return {
        **part,
        "image": _data_uri(folder / f"{part['name']}{FIGURE}", "image/png"),
        "video": _data_uri(folder / f"{part['name']}{FILM}", "video/mp4")
        if "speed" in film
        else "",
        "problem": film.get("problem", ""),
        "claims": [
            {
                **claim,
                "verdict": _VERDICTS[claim["holds"]],
                "anchor": f"{part['name']}-claim-{index}",
            }
            for index, claim in enumerate(part["claims"], 1)
        ],
        "measures": [
            {
                **measure,
                "ours": ""
                if measure["value"] is None
                else with_unit(number(measure["value"]), measure["unit"]),
                "theirs": published(measure["published"], measure["unit"]),
                "difference": difference(measure["value"], measure["published"]),
            }
            for measure in part["measures"]
        ],
    }


def _data_uri(path: Path, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"


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
