"""The results of a fit as files: tables, a page, plots and a parameter file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from mjhill.analysis.second_order import step_response
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.draw.plot import take_literally
from mjhill.files import check_writable, replacing
from mjhill.identification.facts import Fact, facts
from mjhill.identification.fit import Identified
from mjhill.identification.literature_fit import Evidence, evidence_on, published_rows, step_rows
from mjhill.identification.movement import Prediction
from mjhill.joints.joint import Joint
from mjhill.joints.reader import parameter_file, read_joints
from mjhill.simulate.reference import plant_torque

_DPI = 110
_DIGITS = 4  # significant, of fitted values in a parameter file


def output_files(
    joints: Iterable[str], folder: str | Path, *, measured: bool = False
) -> dict[str, Path]:
    """The files that ``write`` makes in a folder, by what they hold.

    Args:
        joints: Names of the fitted joints.
        folder: The folder.
        measured: Whether all joints are fitted to measurements; then there is no page.
    """
    folder = Path(folder)
    page = {} if measured else {"page": folder / "report.md"}
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
    report = _literature_tables(fitted, progress) if fitted else {}
    for name, joint in fitted.items():
        plot_literature(joint, files[name])
    for result in measured:
        plot_predictions(result.joint.name, result.predictions, files[result.joint.name])
        report.setdefault("Measurements", []).extend(prediction_rows(result.predictions))
    report["Parameters"] = [row for result in results for row in estimate_rows(result)]
    if fitted:
        _write_text(files["page"], markdown(report))
    _write_text(files["numbers"], json.dumps(report, ensure_ascii=False, indent=1))
    return report


def _literature_tables(
    joints: Mapping[str, Joint], progress: Callable[[float], None] | None
) -> dict[str, list[dict[str, Any]]]:
    return {
        "Table 2": [row for joint in joints.values() for row in step_rows(joint)],
        "Passive torques and ranges of motion": [
            row for joint in joints.values() for row in published_rows(joint)
        ],
        "Not used by the fit": fact_rows(facts(joints, progress)),
    }


def _write_text(path: Path, text: str) -> None:
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


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
        for item in result.all_estimates
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
                "inputs": item.inputs,
                "rms error": degrees(item.error) if angle else item.error,
                "unit": "°" if angle else "N·m",
                "variance explained [%]": 100 * item.explained,
            }
        )
    return rows


def fact_rows(facts: Sequence[Fact]) -> list[dict[str, Any]]:
    """Facts that no fit used, as published and as measured in simulation, one row each."""
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
    """How well a joint agrees with the literature, in one row.

    Args:
        joint: The joint.
        held_out: Facts that no fit used; those about other joints are ignored.
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


def plot_literature(joint: Joint, path: str | Path) -> None:
    """Draw a joint's steps beside Table 2, and its passive torque beside published ones.

    Raises:
        ValueError: The path does not end in .png.
        OSError: It cannot be written.
    """
    evidence = evidence_on(joint)
    figure, panels = _figure(2 if evidence.steps else 1)
    if evidence.steps:
        _draw_steps(panels[0], evidence)
    _draw_passive(panels[-1], evidence)
    figure.suptitle(f"{joint.name}: identified, beside the literature")
    _save(figure, path)


def plot_predictions(joint: str, predictions: Sequence[Prediction], path: str | Path) -> None:
    """Draw each measurement, the fitted joint's prediction of it, and the excitations.

    Raises:
        ValueError: The path does not end in .png.
        OSError: It cannot be written.
    """
    figure, panels = _figure(len(predictions))
    for axes, prediction in zip(panels, predictions, strict=True):
        _draw_prediction(axes, prediction)
    figure.suptitle(f"{joint}: measured and predicted")
    _save(figure, path)


def _figure(count: int) -> tuple[Any, list[Any]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(5.2 * count, 8.0), 4.2), dpi=_DPI, layout="constrained")
    return figure, list(figure.subplots(1, count, squeeze=False)[0])


def _draw_steps(axes: Any, evidence: Evidence) -> None:
    time = evidence.time
    muscles = list(evidence.joint.muscles)
    for (name, row), response in zip(
        evidence.steps, evidence.responses([evidence.joint])[0], strict=True
    ):
        colour = MUSCLE_COLOURS[muscles.index(name) % 2]
        axes.plot(time, np.degrees(response), color=colour, label=f"{name}, {row.level:g}")
        wanted = degrees(row.magnitude) * step_response(time, *row.time_constants)
        axes.plot(time, wanted, color=colour, linestyle="--", linewidth=1)
    axes.plot([], [], color="grey", linestyle="--", linewidth=1, label="Table 2")
    axes.set(title="Steps of input", xlabel="time [s]", ylabel="way from the start [°]")
    axes.set_xlim(0, time[-1])
    axes.set_ylim(bottom=0)
    _finish(axes)


def _draw_passive(axes: Any, evidence: Evidence) -> None:
    joint = evidence.joint
    low, high = joint.range
    angle = np.linspace(low - 0.1, high + 0.1, 300)
    torque = [plant_torque(joint, q) for q in angle.tolist()]
    axes.plot(np.degrees(angle), torque, color="black", label="passive torque")
    for index, item in enumerate(evidence.torques):
        sign = -1 if item.angle > joint.rest_angle else 1
        axes.plot(
            [degrees(item.angle)] * 2, [sign * item.low, sign * item.high],
            color="#2f8f4e", linewidth=5, alpha=0.6, solid_capstyle="butt",
            label="published" if index == 0 else None,
        )  # fmt: skip
    for index, end in enumerate(joint.range):
        label = "range of motion" if index == 0 else None
        axes.axvline(degrees(end), color="grey", linestyle=":", label=label)
    axes.set(title="Relaxed joint", xlabel=f"angle [°], {joint.positive} positive")
    axes.set_ylabel("torque [N·m]")
    axes.axhline(0, color="grey", linewidth=0.5)
    _finish(axes)


def _draw_prediction(axes: Any, prediction: Prediction) -> None:
    time = prediction.measurement.time
    scale, unit = (180 / np.pi, "°") if prediction.quantity == "angle" else (1.0, "N·m")
    axes.plot(time, scale * prediction.measured, color="grey", linewidth=3, label="measured")
    axes.plot(time, scale * prediction.predicted, color="black", label="predicted")
    name = Path(prediction.measurement.source).name
    axes.set(title=name, xlabel="time [s]", ylabel=f"{prediction.quantity} [{unit}]")
    axes.set_xlim(time[0], time[-1])
    inputs = axes.twinx()
    for index, (muscle, values) in enumerate(prediction.measurement.excitation.items()):
        colour = MUSCLE_COLOURS[index % 2]
        inputs.fill_between(time, values, step="post", color=colour, alpha=0.25, linewidth=0)
        axes.fill_between([], [], color=colour, alpha=0.25, label=muscle)
    inputs.set(ylim=(0, 4), yticks=[0, 1], ylabel="input [-]")
    inputs.yaxis.set_label_coords(1.06, 0.125)
    _finish(axes)


def _finish(axes: Any) -> None:
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", frameon=True, framealpha=0.8)


def _save(figure: Any, path: str | Path) -> None:
    path = Path(path)
    if path.suffix != ".png":
        raise ValueError(f"plot {str(path)!r} must end in .png")
    take_literally(figure)
    with replacing(path) as partial:
        figure.savefig(partial)


def parameter_text(results: Iterable[Identified], parameters: str | Path | None = None) -> str:
    """The text of a parameter file with the values of some joints replaced by fitted ones.

    Args:
        results: The fitted joints.
        parameters: The file to start from; by default the one that comes with mjhill.
    """
    import tomlkit

    document = tomlkit.parse(Path(parameters or parameter_file()).read_text(encoding="utf-8"))
    for result in results:
        for free, estimate in zip(result.free, result.estimates, strict=True):
            entry = document[result.joint.name]
            for key in free.path:
                entry = entry[key]  # type: ignore[index]
            entry["value"] = rounded(estimate.value, free.low, free.high)  # type: ignore[index]
    return tomlkit.dumps(document)


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
