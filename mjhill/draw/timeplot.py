"""Curves of a recording over time, drawn once, with a cursor that moves over them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import Colour, DrawnMuscle
from mjhill.draw.panels import Box, Panel
from mjhill.draw.plot import take_literally
from mjhill.simulate.recording import Recording

_JOINT_COLOURS = ((0.17, 0.17, 0.20), (0.45, 0.33, 0.60), (0.30, 0.52, 0.50), (0.60, 0.50, 0.30))


@dataclass(frozen=True)
class Curve:
    """One line of a plot.

    Attributes:
        label: What it is.
        time: Times [s], shape (T,).
        values: Values in the plot's unit, shape (T,).
        colour: RGB in [0, 1].
    """

    label: str
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    colour: Colour


@dataclass(frozen=True)
class Plot:
    """One pair of axes.

    Attributes:
        title: Quantity and unit.
        curves: The lines.
        floor: Lowest value that must be seen.
        ceiling: Highest value that must be seen.
        named: Whether the curves are told apart by a legend of their own.
    """

    title: str
    curves: tuple[Curve, ...]
    floor: float | None = None
    ceiling: float | None = None
    named: bool = False


def make_plots(recording: Recording, muscles: Sequence[DrawnMuscle]) -> tuple[Plot, ...]:
    """Angle of each joint, activation and force of each muscle, as far as recorded."""
    time = recording.time

    def curves(names: Iterable[tuple[str, str, Colour]], factor: float = 1.0) -> tuple[Curve, ...]:
        return tuple(
            Curve(label, time, factor * recording[name], colour) for label, name, colour in names
        )

    def joints(quantity: str) -> list[tuple[str, str, Colour]]:
        names = [name for name in recording if name.endswith(f".{quantity}")]
        colours = (_JOINT_COLOURS[i % len(_JOINT_COLOURS)] for i in range(len(names)))
        return [
            (name.removesuffix(f".{quantity}"), name, colour)
            for name, colour in zip(names, colours, strict=True)
        ]

    def of_muscles(quantity: str) -> list[tuple[str, str, Colour]]:
        return [(m.name, f"{m.name}.{quantity}", m.colour) for m in muscles]

    angles, positions = joints("angle"), joints("position")
    units = dict.fromkeys(recording.units[f"{m.name}.force"] for m in muscles)
    plots = (
        Plot(_titled(angles, "angle", "deg"), curves(angles, 180 / np.pi), named=len(angles) > 1),
        Plot(_titled(positions, "position", "m"), curves(positions), named=len(positions) > 1),
        Plot("activation [-]", curves(of_muscles("a")), 0.0, 1.0),
        Plot(f"force [{', '.join(units)}]", curves(of_muscles("force")), 0.0),
    )
    return tuple(plot for plot in plots if plot.curves)


def common_limits(plots: Iterable[Plot]) -> dict[str, tuple[float, float]]:
    """Limits of plots by title, so that those of one title can be compared."""
    limits: dict[str, tuple[float, float]] = {}
    for plot in plots:
        values = [curve.values[np.isfinite(curve.values)] for curve in plot.curves]
        known = [
            v for v in (plot.floor, plot.ceiling, *limits.get(plot.title, ())) if v is not None
        ]
        lowest = min([*known, *(float(v.min()) for v in values if v.size)], default=0.0)
        highest = max([*known, *(float(v.max()) for v in values if v.size)], default=1.0)
        limits[plot.title] = (lowest, max(highest, lowest + 1e-9))
    return {title: _padded(*pair) for title, pair in limits.items()}


def _padded(lowest: float, highest: float) -> tuple[float, float]:
    margin = 0.05 * (highest - lowest) if highest - lowest > 1e-6 else 0.5
    return lowest - margin, highest + margin


def _titled(joints: Sequence[tuple[str, str, Colour]], quantity: str, unit: str) -> str:
    return f"{joints[0][0]} {quantity} [{unit}]" if len(joints) == 1 else f"{quantity} [{unit}]"


Image = NDArray[np.uint8]

_DPI = 100.0
_INK = "#2b2b33"
_SOFT = "#6a6a75"
_LEAST = 9.0  # height of the letters of a small video's axes [px]
_FAINT = 0.22  # opacity of what is yet to come
_GLYPHS = "0123456789.- +tsenaif"


@dataclass(frozen=True)
class Side:
    """What is drawn once for one panel.

    Attributes:
        panel: Where it goes.
        title: The view's title.
        muscles: The legend's muscles.
        units: Unit of force of each muscle.
        plots: The plots, from top to bottom.
        note: Shown beside the clock.
    """

    panel: Panel
    title: str
    muscles: tuple[DrawnMuscle, ...]
    units: tuple[str, ...]
    plots: tuple[Plot, ...]
    note: str = ""


@dataclass(frozen=True)
class Layers:
    """The two still images of a video and where time runs in them.

    Attributes:
        past: The curves in full, shape (H, W, 3).
        future: The curves faded, shape (H, W, 3).
        axes: For each panel the boxes of its axes [px].
    """

    past: Image
    future: Image
    axes: tuple[tuple[Box, ...], ...]


def draw_layers(sides: Sequence[Side], size: tuple[int, int], span: tuple[float, float]) -> Layers:
    """Draw titles, legends and curves over the time ``span`` [s] into a frame of ``size`` [px]."""
    figure, canvas = _figure(*size)
    axes: list[tuple[Box, ...]] = []
    lines: list[Any] = []
    limits = common_limits(plot for side in sides for plot in side.plots)
    for side in sides:
        _draw_texts(figure, size, side)
        boxes = _axes_boxes(side.panel, len(side.plots))
        for k, (plot, box) in enumerate(zip(side.plots, boxes, strict=True)):
            last = k == len(side.plots) - 1
            plane = _draw_axes(figure, size, side.panel, plot, box, last=last)
            plane.set_xlim(*span)
            plane.set_ylim(*limits[plot.title])
            lines += plane.get_lines()
        axes.append(boxes)
    past = _pixels(canvas)
    for line in lines:
        line.set_alpha(_FAINT)
    return Layers(past, _pixels(canvas), tuple(axes))


def draw_glyphs(height: int) -> dict[str, Image]:
    """An image of each character that a number needs, ``height`` [px] high, all of one width."""
    pixels = max(1.0, 0.62 * height)
    width = max(1, round(0.605 * pixels))  # DejaVu Sans Mono's advance is 0.602 em
    figure, canvas = _figure(width * len(_GLYPHS), height)
    for i, character in enumerate(_GLYPHS):
        _text(figure, (i + 0.5) / len(_GLYPHS), 0.28, character, pixels, ha="center", mono=True)
    image = _pixels(canvas)
    return {c: image[:, i * width : (i + 1) * width] for i, c in enumerate(_GLYPHS)}


def _figure(width: int, height: int) -> tuple[Any, Any]:
    # no pyplot: it would keep the figure and choose a backend for the whole process
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
    return figure, FigureCanvasAgg(figure)


def _pixels(canvas: Any) -> Image:
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[:, :, :3])


def _text(
    figure: Any, x: float, y: float, words: str, pixels: float, *, mono: bool = False, **style: Any
) -> None:
    family = "DejaVu Sans Mono" if mono else "DejaVu Sans"  # matplotlib brings both
    options = {"color": _INK, "va": "baseline", "parse_math": False, **style}
    figure.text(x, y, words, fontsize=pixels * 72 / _DPI, family=family, **options)


def _draw_texts(figure: Any, size: tuple[int, int], side: Side) -> None:
    """Title and legend, which never change."""
    from matplotlib.patches import Rectangle

    width, height = size
    panel, unit = side.panel, side.panel.unit

    def write(left: float, box: Box, words: str, pixels: float, **style: Any) -> None:
        baseline = box.top + box.height / 2 + 0.36 * pixels * unit  # centres the capitals
        _text(figure, left / width, 1 - baseline / height, words, pixels * unit, **style)

    title = _shortened(side.title, 34 if not side.note else 26)
    write(panel.title.left + 14 * unit, panel.title, title, 20, weight="bold")
    end = panel.title.left + panel.title.width - 150 * unit
    write(end, panel.title, side.note, 14, color=_SOFT, ha="right")
    if panel.rows:
        write(panel.rows[0].activation.left, panel.header, "activation", 13, color=_SOFT)
        words = "force, bar to maximum isometric"
        write(panel.rows[0].force.left, panel.header, words, 13, color=_SOFT)
    for row, muscle, force_unit in zip(panel.rows, side.muscles, side.units, strict=False):
        y = 1 - (row.swatch.top + row.swatch.height) / height
        corner = (row.swatch.left / width, y)
        figure.add_artist(
            Rectangle(
                corner, row.swatch.width / width, row.swatch.height / height, color=muscle.colour
            )
        )
        line = Box(0, row.activation.top, 0, row.activation.height)
        write(row.swatch.left + 22 * unit, line, _shortened(muscle.name), 15)
        write(row.force.left + row.force.width + 84 * unit, line, force_unit, 14, color=_SOFT)


def _draw_axes(
    figure: Any, size: tuple[int, int], panel: Panel, plot: Plot, box: Box, *, last: bool
) -> Any:
    width, height = size
    bottom = 1 - (box.top + box.height) / height
    plane = figure.add_axes((box.left / width, bottom, box.width / width, box.height / height))
    points = 72 / _DPI * panel.unit

    def letters(pixels: float) -> float:
        return points * max(pixels, min(_LEAST / panel.unit, 18.0))

    for curve in plot.curves:
        plane.plot(
            curve.time, curve.values, color=curve.colour, linewidth=2.4 * points, label=curve.label
        )
    style = {"family": "DejaVu Sans", "color": _INK, "parse_math": False}
    plane.set_title(plot.title, loc="left", fontsize=letters(15), pad=7 * points, **style)
    if last:
        plane.set_xlabel("time [s]", fontsize=letters(14), labelpad=4 * points, **style)
    plane.tick_params(
        labelsize=letters(13), length=4 * points, width=points, colors=_SOFT, labelbottom=last
    )
    plane.locator_params(axis="y", nbins=4)
    plane.locator_params(axis="x", nbins=6)
    plane.grid(color="#dddde3", linewidth=points)
    plane.set_axisbelow(True)
    for name, spine in plane.spines.items():
        spine.set_visible(name in ("left", "bottom"))
        spine.set(color=_SOFT, linewidth=points)
    if plot.named:
        key = plane.legend(fontsize=letters(12), loc="upper right", frameon=False, ncols=2)
        take_literally(key)
    return plane


def _axes_boxes(panel: Panel, number: int) -> tuple[Box, ...]:
    area, pixels = panel.curves, panel.pixels
    left, right, above, below = pixels(72), pixels(26), pixels(40), pixels(54)
    width = max(1, area.width - left - right)
    room = max(number, area.height - number * above - below)
    height = max(1, room // max(1, number))
    return tuple(
        Box(area.left + left, area.top + above + k * (height + above), width, height)
        for k in range(number)
    )


def _shortened(name: str, length: int = 19) -> str:
    return name if len(name) <= length else f"{name[: length - 1]}…"


def column(box: Box, span: tuple[float, float]) -> Callable[[float], int]:
    """The column of a time [s] in axes that show ``span`` [s]."""
    start, end = span
    scale = (box.width - 1) / max(end - start, 1e-12)
    return lambda time: box.left + round(min(max(time - start, 0.0), end - start) * scale)
