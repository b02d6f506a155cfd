"""One page that needs nothing but itself: styles, figures and videos are all inside."""

from __future__ import annotations

import base64
from datetime import datetime
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from mjhill.experiments.result import spoken
from mjhill.report import words
from mjhill.report.store import FIGURE, FILM

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
    for name in ("number", "with_unit", "duration", "option"):
        environment.filters[name] = getattr(words, name)
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
                else words.with_unit(words.number(measure["value"]), measure["unit"]),
                "theirs": words.published(measure["published"], measure["unit"]),
                "difference": words.difference(measure["value"], measure["published"]),
            }
            for measure in part["measures"]
        ],
    }


def _data_uri(path: Path, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"
