"""The results of a fit as files: tables, a page, plots and a parameter file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mjhill.files import check_writable, replacing
from mjhill.identification.facts import facts
from mjhill.identification.fit import Identified
from mjhill.identification.plots import plot_facts, plot_literature, plot_predictions
from mjhill.identification.provenance import header, pinned_text, source_text
from mjhill.identification.rows import (
    estimate_rows,
    fact_counts,
    fact_rows,
    prediction_rows,
    published_rows,
    step_rows,
)
from mjhill.joints.joint import Joint
from mjhill.joints.reader import parameter_file, read_joints

_DIGITS = 4  # significant, of fitted values in a parameter file


def output_files(
    joints: Iterable[str], folder: str | Path, *, measured: bool = False
) -> dict[str, Path]:
    """The files that ``write`` makes in a folder, by what they hold.

    Args:
        joints: Names of the fitted joints.
        folder: The folder.
        measured: Whether all joints are fitted to measurements; then there is no page and no plot
            of facts.
    """
    folder = Path(folder)
    page = {} if measured else {"page": folder / "report.md", "facts": folder / "facts.png"}
    return {
        "parameters": folder / "joints.toml",
        "numbers": folder / "identify.json",
        **page,
        **{name: folder / f"{name}.png" for name in joints},
    }


def write(
    results: Identified | Sequence[Identified],
    folder: str | Path,
    *,
    parameters: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> dict[str, list[dict[str, Any]]]:
    """Write fitted joints: parameter file, tables (JSON), a page (Markdown) and plots (PNG).

    A fit to the literature is reported with its agreement with Table 2, with published torques
    and ranges, and with facts that no fit used. These are computed from the parameter file as
    written, with its four digits. A fit to measurements is reported with its predictions. Each
    file appears whole or not at all; for their names see ``output_files``.

    Args:
        results: One or more results of ``identify``, each of another joint.
        folder: The folder; created if it does not exist.
        parameters: The parameter file that was given to ``identify``.
        progress: Called with the share done of measuring the facts, 0 to 1.

    Returns:
        The tables, by title: rows of equal keys.

    Raises:
        ValueError: There is no result, or the parameter file lacks one of the joints.
        OSError: A file cannot be written.
    """
    results = [results] if isinstance(results, Identified) else list(results)
    if not results:
        raise ValueError("there is no result to write; give at least one result of identify")
    measured = [result for result in results if result.predictions]
    names = [result.joint.name for result in results]
    files = output_files(names, folder, measured=len(measured) == len(results))
    Path(folder).mkdir(parents=True, exist_ok=True)
    for path in files.values():
        check_writable(path)
    write_parameters(files["parameters"], results, parameters)
    written = read_joints(files["parameters"])
    fitted = {
        name: written[name] for name, one in zip(names, results, strict=True) if not one.predictions
    }
    starts = {one.joint.name: one.start for one in results}
    report = _literature_tables(fitted, starts, progress) if fitted else {}
    for name, joint in fitted.items():
        plot_literature(joint, files[name], starts[name])
    if report.get("Facts"):
        plot_facts(report["Facts"], files["facts"])
    for result in measured:
        plot_predictions(result.joint.name, result.predictions, files[result.joint.name])
        report.setdefault("Measurements", []).extend(prediction_rows(result.predictions))
    report["Parameters"] = [row for result in results for row in estimate_rows(result)]
    if fitted:
        _write_text(files["page"], markdown(report))
    _write_text(files["numbers"], json.dumps(report, ensure_ascii=False, indent=1))
    return report


def _literature_tables(
    joints: Mapping[str, Joint],
    starts: Mapping[str, str],
    progress: Callable[[float], None] | None,
) -> dict[str, list[dict[str, Any]]]:
    measured = facts(joints, progress)
    return {
        "Table 2": [
            row for name, joint in joints.items() for row in step_rows(joint, starts[name])
        ],
        "Passive torques and ranges of motion": [
            row for joint in joints.values() for row in published_rows(joint)
        ],
        "Facts": fact_rows(measured),
        "Facts counted": fact_counts(measured) if measured else [],
    }


def _write_text(path: Path, text: str) -> None:
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


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
corrected where the note says so; a row without a direction holds for both.""",
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


def parameter_text(results: Iterable[Identified], parameters: str | Path | None = None) -> str:
    """The text of a parameter file with the values of some joints replaced by fitted ones.

    A value that was fitted to measurements gets a source that says so, and comment lines at the
    top say how it was made.

    Args:
        results: The fitted joints.
        parameters: The file to start from; by default the one that comes with mjhill.
    """
    import tomlkit

    results = list(results)
    document = tomlkit.parse(Path(parameters or parameter_file()).read_text(encoding="utf-8"))
    for result in results:
        table = document[result.joint.name]
        for free, estimate in zip(result.free, result.estimates, strict=True):
            value = rounded(estimate.value, free.low, free.high)
            for path, here in free.values(value).items():
                entry = _entry(table, path)
                entry["value"] = here
                if result.predictions:
                    entry["source"] = source_text(result, estimate, str(entry["source"]))
        for free, value in result.pinned:
            for path, here in free.values(value).items():
                entry = _entry(table, path)
                entry["value"] = here
                entry["source"] = pinned_text(str(entry["source"]), entry.pop("bounds"))
    return header(results, parameters) + tomlkit.dumps(document)


def _entry(table: Any, path: Iterable[str]) -> Any:
    for key in path:
        table = table[key]
    return table


def write_parameters(
    path: str | Path, results: Iterable[Identified], parameters: str | Path | None = None
) -> None:
    """Write ``parameter_text`` to a file, whole or not at all.

    Raises:
        OSError: The folder is missing or cannot be written.
    """
    _write_text(Path(path), parameter_text(results, parameters))


def rounded(value: float, low: float, high: float) -> float:
    """A value to four significant digits, still inside its bounds."""
    return min(max(float(f"{value:.{_DIGITS}g}"), low), high)
