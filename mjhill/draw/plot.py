"""Plots of recordings, as pictures on disk."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.files import check_writable, replacing
from mjhill.simulate.recording import Recording

_Colour = str | tuple[float, float, float]

_JOINT_COLOURS: tuple[_Colour, ...] = ("black", "0.55", (0.84, 0.37, 0.0), (0.34, 0.71, 0.91))
_STYLES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.4)), (0, (5, 1.5, 1, 1.5)))
_DEGREES = {"rad": "°", "rad/s": "°/s"}
_WIDTH, _ROW_HEIGHT, _DPI = 9.0, 1.75, 120  # [inch], [inch], [1/inch]


@dataclass(frozen=True)
class _Line:
    """One curve: times [s] and values, shape (T,) each; ``name`` is of a joint or a muscle."""

    name: str
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    colour: _Colour
    style: Any
    width: float = 1.5


@dataclass(frozen=True)
class _Axis:
    """One of the stacked axes; ``key`` is the legend of styles and colours used only here."""

    label: str
    lines: tuple[_Line, ...]
    key: tuple[tuple[str, Any, _Colour], ...] = ()


def plot_recording(
    recording: Recording,
    path: str | Path,
    *,
    joints: Sequence[str] | None = None,
    muscles: Sequence[str] | None = None,
    title: str | None = None,
) -> Path:
    """Draw a recording as stacked time series: first joints, then muscles.

    Args:
        recording: What to draw. Series that it lacks are left out, such as the velocity of the
            contractile element of a native muscle.
        path: The picture, ``.png``; it is written completely or not at all.
        joints: Names of the joints to draw; by default all.
        muscles: Names of the muscles to draw; by default all.
        title: Heading; by default the model's name.

    Returns:
        The path written.

    Raises:
        ValueError: A joint or muscle is not in the recording, there is nothing to draw, or the
            path does not end in .png.
        OSError: The picture cannot be written.
    """
    chosen = _choose(recording, joints, muscles)
    axes = [*_joint_axes(recording, chosen[0], "-"), *_muscle_axes(recording, chosen[1])]
    heading = title if title is not None else str(recording.about.get("model", ""))
    return _draw(axes, _muscle_colours(recording, chosen[1]), (), heading, path)


def plot_overlay(
    recordings: Mapping[str, Recording],
    path: str | Path,
    *,
    joints: Sequence[str] | None = None,
    muscles: Sequence[str] | None = None,
    title: str | None = None,
) -> Path:
    """Draw up to four recordings over each other, one line style each.

    Drawn are the joints and activation and force of each muscle, under the names of the first
    recording; the others have the same joints and muscles.

    Args:
        recordings: Recordings by the label that the legend shows.
        path: The picture, ``.png``; it is written completely or not at all.
        joints: Names of the joints to draw; by default all.
        muscles: Names of the muscles to draw; by default all.
        title: Heading; by default none.

    Returns:
        The path written.

    Raises:
        ValueError: There are no recordings or more than four, a joint or muscle is not in one
            of them, there is nothing to draw, or the path does not end in .png.
        OSError: The picture cannot be written.
    """
    if not 1 <= len(recordings) <= len(_STYLES):
        raise ValueError(f"an overlay takes 1 to {len(_STYLES)} recordings, got {len(recordings)}")
    chosen = _choose(next(iter(recordings.values())), joints, muscles)
    merged: dict[str, _Axis] = {}
    for style, recording in zip(_STYLES, recordings.values(), strict=False):
        _choose(recording, *chosen)
        axes = [
            *_joint_axes(recording, chosen[0], style),
            *_series_axes(recording, chosen[1], (("a", "activation a"), ("force", "force")), style),
        ]
        for axis in axes:
            before = merged.get(axis.label, _Axis(axis.label, (), axis.key))
            merged[axis.label] = replace(before, lines=before.lines + axis.lines)
    labels = tuple(zip(recordings, _STYLES, strict=False))
    colours = _muscle_colours(next(iter(recordings.values())), chosen[1])
    return _draw(list(merged.values()), colours, labels, title or "", path)


def _choose(
    recording: Recording, joints: Sequence[str] | None, muscles: Sequence[str] | None
) -> tuple[list[str], list[str]]:
    """The requested joints and muscles; by default all."""
    chosen = []
    for kind, wanted in (("joint", joints), ("muscle", muscles)):
        known = _known(recording, kind)
        for name in wanted or ():
            if name not in known:
                there = ", ".join(known) or "none"
                raise ValueError(f"the recording has no {kind} {name!r}; there are: {there}")
        chosen.append(known if wanted is None else list(wanted))
    return chosen[0], chosen[1]


def _known(recording: Recording, kind: str) -> list[str]:
    """Names of the joints or of the muscles of a recording."""
    endings = {"joint": (".angle", ".position"), "muscle": (".force",)}[kind]
    return [name.rpartition(".")[0] for name in recording if name.endswith(endings)]


def _muscle_colours(recording: Recording, muscles: Sequence[str]) -> dict[str, _Colour]:
    """Colours of muscles; they depend only on the recording, not on the choice of muscles."""
    known = _known(recording, "muscle")
    return {name: MUSCLE_COLOURS[known.index(name) % len(MUSCLE_COLOURS)] for name in muscles}


def _joint_axes(recording: Recording, joints: Sequence[str], style: Any) -> Iterator[_Axis]:
    rows = (
        ("angle", "angle"),
        ("position", "position"),
        ("velocity", "joint velocity"),
        ("applied", "external load"),
    )
    for suffix, label in rows:
        lines: dict[str, list[_Line]] = {}
        for index, joint in enumerate(joints):
            colour = _JOINT_COLOURS[index % len(_JOINT_COLOURS)]
            if f"{joint}.{suffix}" in recording:
                values, unit = _shown(recording, f"{joint}.{suffix}")
                line = _Line(joint, recording.time, values, colour, style)
                lines.setdefault(unit, []).append(line)
        for unit, found in lines.items():
            key = [(line.name, "-", line.colour) for line in found] if len(found) > 1 else []
            yield _Axis(f"{label} [{unit}]", tuple(found), tuple(key))


def _muscle_axes(recording: Recording, muscles: Sequence[str]) -> Iterator[_Axis]:
    shares = (("u", _STYLES[2], 1.2), ("n", _STYLES[1], 1.2), ("a", _STYLES[0], 1.5))
    lines, key = [], []
    for suffix, style, width in shares:
        found = [
            _Line(muscle, recording.time, recording[f"{muscle}.{suffix}"], colour, style, width)
            for muscle, colour in _muscle_colours(recording, muscles).items()
            if f"{muscle}.{suffix}" in recording
        ]
        lines += found
        key += [(suffix, style, "0.3")] if found else []
    if lines:
        yield _Axis("u, n, a [-]", tuple(lines), tuple(key))
    rows = (("force", "force"), ("velocity", "CE shortening"), ("stretch", "SE stretch"))
    yield from _series_axes(recording, muscles, rows, "-")


def _series_axes(
    recording: Recording, muscles: Sequence[str], rows: Sequence[tuple[str, str]], style: Any
) -> Iterator[_Axis]:
    """One axis for each quantity and unit that the muscles have."""
    for suffix, label in rows:
        lines: dict[str, list[_Line]] = {}
        for muscle, colour in _muscle_colours(recording, muscles).items():
            if f"{muscle}.{suffix}" in recording:
                values, unit = _shown(recording, f"{muscle}.{suffix}")
                line = _Line(muscle, recording.time, values, colour, style)
                lines.setdefault(unit, []).append(line)
        for unit, found in lines.items():
            shown = "muscle torque" if (label, unit) == ("force", "N·m") else label
            yield _Axis(f"{shown} [{unit}]", tuple(found))


def _shown(recording: Recording, name: str) -> tuple[NDArray[np.float64], str]:
    """Values and unit as drawn: angles in degrees."""
    values, unit = recording[name], recording.units[name]
    return (np.degrees(values), _DEGREES[unit]) if unit in _DEGREES else (values, unit)


def _draw(
    axes: Sequence[_Axis],
    colours: Mapping[str, _Colour],
    labels: Sequence[tuple[str, Any]],
    title: str,
    path: str | Path,
) -> Path:
    """Stack the axes; a legend of muscles and recordings stands above them."""
    path = Path(path)
    if path.suffix != ".png":
        raise ValueError(f"a plot must end in .png, got {str(path)!r}")
    if not axes:
        raise ValueError("nothing to draw: choose at least one joint or muscle")
    check_writable(path)
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(_WIDTH, 0.8 + _ROW_HEIGHT * len(axes)), layout="constrained")
    grid = figure.subplots(len(axes), 1, sharex=True, squeeze=False)[:, 0]
    for plot, axis in zip(grid, axes, strict=True):
        _draw_axis(plot, axis)
    grid[-1].set_xlabel("time [s]")
    figure.align_ylabels(grid)
    handles = [Line2D([], [], color=colour, lw=3, label=m) for m, colour in colours.items()]
    handles += [Line2D([], [], color="black", ls=s, label=label) for label, s in labels]
    if handles:
        # the heading is part of the legend, so that they never overlap
        legend = figure.legend(
            handles=handles, loc="outside upper center", ncols=4, frameon=False,
            title=title, title_fontsize=12,
        )  # fmt: skip
        legend.get_title().set_multialignment("center")
    elif title:
        figure.suptitle(title, fontsize=12)
    take_literally(figure)
    with replacing(path) as partial:
        figure.savefig(partial, dpi=_DPI)
    return path


def take_literally(artist: Any) -> None:
    """Show dollar signs in the texts of a figure or legend as they are: no formulas."""
    from matplotlib.text import Text

    for text in artist.findobj(Text):
        text.set_parse_math(False)


def _draw_axis(plot: Any, axis: _Axis) -> None:
    from matplotlib.lines import Line2D

    for line in axis.lines:
        plot.plot(line.time, line.values, color=line.colour, ls=line.style, lw=line.width)
    plot.set_ylabel(axis.label)
    plot.margins(x=0)
    if axis.label.endswith("[-]"):  # excitation and activation: show a constant as a flat line
        low = min(0.0, *(float(line.values.min()) for line in axis.lines))
        high = max(0.0, *(float(line.values.max()) for line in axis.lines))
        margin = 0.05 * (high - low or 1.0)
        plot.set_ylim(low - margin, high + margin)
    plot.grid(color="0.9", lw=0.8)
    plot.spines[["top", "right"]].set_visible(False)
    handles = [Line2D([], [], color=c, ls=s, label=label) for label, s, c in axis.key]
    if handles:
        plot.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
