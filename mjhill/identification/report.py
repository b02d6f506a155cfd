"""The results of a fit as files: tables, a page, plots and a parameter file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mjhill.files import check_writable, replacing
from mjhill.identification.evidence import DELAY_SPREAD, FACT, MAGNITUDE_SPREAD
from mjhill.identification.facts import facts
from mjhill.identification.fit import Identified
from mjhill.identification.literature_fit import PRIOR
from mjhill.identification.plots import plot_facts, plot_literature, plot_predictions
from mjhill.identification.provenance import header, pinned_text, source_text
from mjhill.identification.rows import (
    DELAY_MET,
    DEVIATION_MET,
    MAGNITUDE_MET,
    agreement_rows,
    bound_rows,
    estimate_rows,
    fact_counts,
    fact_rows,
    prediction_rows,
    published_rows,
    step_rows,
)
from mjhill.joints.joint import Joint
from mjhill.joints.reader import parameter_file, read_joints
from mjhill.literature.table2 import SHAPE_SPREAD

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
    and ranges, and with facts, fitted and held out. These are computed from the parameter file as
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
    literature = [one for one in results if not one.predictions]
    report = _literature_tables(literature, fitted, progress) if fitted else {}
    for one in literature:
        plot_literature(fitted[one.joint.name], files[one.joint.name], one.start)
    if fitted:
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
    results: Sequence[Identified],
    joints: Mapping[str, Joint],
    progress: Callable[[float], None] | None,
) -> dict[str, list[dict[str, Any]]]:
    measured = facts(joints, progress)
    return {
        "Facts counted": fact_counts(measured),
        **{
            agreement_title(one.joint.name): agreement_rows(one, joints[one.joint.name], measured)
            for one in results
        },
        "Parameters on a bound": [row for one in results for row in bound_rows(one)],
        "Table 2": [row for one in results for row in step_rows(joints[one.joint.name], one.start)],
        "Passive torques and ranges of motion": [
            row for joint in joints.values() for row in published_rows(joint)
        ],
        "Facts": fact_rows(measured),
    }


def agreement_title(joint: str) -> str:
    """The title of the table of ``agreement_rows``."""
    return f"Joint {joint}"


def _write_text(path: Path, text: str) -> None:
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def markdown(report: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """The tables of a report as a page."""
    parts = [_PREFACE]
    for title, rows in report.items():
        if rows:
            about = f"{_EXPLANATIONS[title]}\n\n" if title in _EXPLANATIONS else ""
            parts.append(f"## {title}\n\n{about}{_markdown_table(rows)}\n")
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


_PREFACE = f"""# Joints beside the literature

Written by `mjhill identify`. It fits the parameters that have bounds in a parameter file to four
kinds of published data:

| data | one standard deviation in the fit |
|---|---|
| Table 2 of Winters & Stark (1987): MAG | {100 * MAGNITUDE_SPREAD:g} % |
| its T1 + T2 | {100 * DELAY_SPREAD:g} % |
| its shape of the response | {100 * SHAPE_SPREAD:g} % of MAG |
| passive torques and ranges of motion (`published.csv`) | a quarter of the published interval |
| facts that are not held out (`facts.toml`) | half of the published interval, over {FACT:g} |
| priors: the middle of the bounds | half of the way to a bound, over {PRIOR:g} |

Nothing leaves the bounds, which come from other measurements. The files are in
`mjhill/literature`. A **held-out** fact is not used by the fit: it tests the result on data that
could not influence the parameters. Bounds and weights were chosen by people who had seen all
facts. Every third fact of a joint is held out, and all of the knee; the head of `facts.toml`
states the rule.

In the tables of the joints, `met` means: MAG within {MAGNITUDE_MET:g} % of Table 2, T1 + T2
within {DELAY_MET:g} %, all else within {DEVIATION_MET:g} standard deviations (SD). An interval of
a fact is 2 SD wide, one of a passive torque or a range of motion 4 SD. `against` says why
something is not met, or is more than 1 SD off: it names what gets worse where that is met better.
`bounds of` a parameter is the prior that keeps it near the middle of its bounds.
"""

_EXPLANATIONS = {
    "Facts counted": """How many facts lie within one and two published standard deviations.

![Facts in published standard deviations from the published mean](facts.png)""",
    "Parameters on a bound": """They would leave physiology if they could. `better beyond it` says
what would then be met better: where that is a row of Table 2, the paper and the source of the
bound contradict each other.""",
    "Table 2": """A step of excitation to one muscle from a posture that Table 2 does not state
and the fit finds. The other muscle is at rest (`--start held`: it holds the start, and is then
switched off). `recoil` is the part of MAG that passive elasticity alone gives: the way from the
start to rest. MAG, T1 and T2 are those of the overdamped second-order response nearest to the
simulated one. T1 and T2 singly say little where they are nearly equal or the response swings,
marked ill-conditioned: their sum is what counts. Published T1 and T2 are corrected where the note
says so; a row without a direction holds for both.""",
    "Passive torques and ranges of motion": """Low and high span what is published, 4 standard
deviations.""",
    "Facts": """Low and high are the published mean less and plus one standard deviation, or what
the sources span.""",
    "Parameters": """SI units. The interval holds the value with 95 % confidence, given the
bounds, the data and their stated errors, and that the model is right; `from the data` is the
share of the prior's variance that the data took away, by the width of the interval.""",
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
    document = tomlkit.parse(parameter_file(parameters).read_text(encoding="utf-8"))
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
                before = _entry(table, path)
                source = tomlkit.string(pinned_text(str(before["source"]), before["bounds"]))
                text = f"{path[-1]} = {{ value = {here!r}, source = {source.as_string()} }}"
                _entry(table, path[:-1])[path[-1]] = tomlkit.parse(text)[path[-1]]
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
