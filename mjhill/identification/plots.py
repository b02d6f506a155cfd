"""Plots of fitted joints beside the literature and beside measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from mjhill.analysis.second_order import step_response
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.draw.plot import take_literally
from mjhill.files import replacing
from mjhill.identification.evidence import Evidence, evidence_on
from mjhill.identification.movement import Prediction
from mjhill.joints.joint import Joint
from mjhill.simulate.reference import plant_torque

_DPI = 110
_FACT = "#1f5fa8"


def plot_literature(joint: Joint, path: str | Path, start: str = "relaxed") -> None:
    """Draw a joint's steps beside Table 2, and its passive torque beside published ones.

    Args:
        joint: The joint.
        path: The file.
        start: How the joint starts a step, one of ``STARTS``.

    Raises:
        ValueError: The path does not end in .png.
        OSError: It cannot be written.
    """
    evidence = evidence_on(joint, start=start)
    figure, panels = _figure(2 if evidence.steps else 1)
    if evidence.steps:
        _draw_steps(panels[0], evidence)
    _draw_passive(panels[-1], evidence)
    figure.suptitle(f"{joint.name}: identified, beside the literature")
    _save(figure, path)


def plot_facts(rows: Sequence[Mapping[str, Any]], path: str | Path) -> None:
    """Draw how far each fact is from what was published, in standard deviations.

    Args:
        rows: Those of ``fact_rows``.
        path: The file.

    Raises:
        ValueError: The path does not end in .png.
        OSError: It cannot be written.
    """
    from matplotlib.figure import Figure

    order = list(dict.fromkeys(row["joint"] for row in rows))
    rows = sorted(rows, key=lambda row: order.index(row["joint"]))
    figure = Figure(figsize=(9.5, 1.6 + 0.27 * len(rows)), dpi=_DPI, layout="constrained")
    axes = figure.subplots()
    for size, shade in ((2, "#eeeeee"), (1, "#d8d8d8")):
        axes.axvspan(-size, size, color=shade, linewidth=0, zorder=0)
    axes.axvline(0, color="grey", linewidth=0.8, zorder=1)
    for use, face in (("fitted", _FACT), ("held out", "white")):
        places = [
            (row["deviation"], line)
            for line, row in enumerate(rows)
            if row["use"] == use and row["deviation"] is not None
        ]
        if places:
            deviations, lines = zip(*places, strict=True)
            axes.scatter(deviations, lines, s=38, color=face, edgecolors=_FACT, label=use, zorder=3)
    for line, row in enumerate(rows):
        ours = "not measured" if row["ours"] is None else f"{row['ours']:.3g}"
        text = f"{ours} ({row['low']:.3g} to {row['high']:.3g}) {row['unit']}"
        axes.text(1.02, line, text, transform=axes.get_yaxis_transform(), va="center", fontsize=8)
        if line and row["joint"] != rows[line - 1]["joint"]:
            axes.axhline(line - 0.5, color="grey", linewidth=0.5)
    reach = max([2.0, *(abs(row["deviation"]) for row in rows if row["deviation"] is not None)])
    axes.set_xlim(-1.15 * reach, 1.15 * reach)
    names = [f"{row['joint']}: {row['quantity']}" for row in rows]
    axes.set_yticks(range(len(rows)), names, fontsize=8)
    axes.set_ylim(max(len(rows), 1) - 0.5, -0.5)
    axes.set_xlabel("difference from the published mean [published standard deviations]")
    axes.set_title("Published facts. Right: simulated (published mean ± SD)", fontsize=10)
    if rows:
        figure.legend(loc="outside lower left", fontsize="small", frameon=False, ncols=2)
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
    axes.set(title="Steps of excitation", xlabel="time [s]", ylabel="angle from the start [°]")
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
    inputs.set(ylim=(0, 4), yticks=[0, 1], ylabel="excitation [-]")
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
