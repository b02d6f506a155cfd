"""The figure of lengthening contractions."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import Any

import numpy as np

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.figures.drawing import tidy, torque_unit
from mjhill.experiments.result import spoken
from mjhill.experiments.trials.stretch import Stretch

_AFTER = 0.4  # shown of a run after the stretch [s]


def draw(figure: Any, muscle: str, stretches: Mapping[float, tuple[Stretch, ...]]) -> None:
    """Torque over time and over stretch, its return, and torque over velocity."""
    grid = figure.subplots(2, 2)
    level = max(stretches)
    found = stretches[level]
    colours = _colours(len(found))
    factor, unit = torque_unit(max(float(one.torque.max()) for one in found))
    for one, colour in zip(found, colours, strict=True):
        label = f"{degrees(one.velocity):.0f}°/s"
        shown = (one.time > 0) & (one.time < one.stop + _AFTER)
        grid[0, 0].plot(one.time[shown], factor * one.torque[shown], color=colour, label=label)
        during = (one.time >= 0) & (one.time < one.stop)
        stretched = np.degrees(one.stretched[during])
        grid[0, 1].plot(stretched, one.relative[during], color=colour, label=label)
        after = (one.time >= one.stop) & (one.time < one.stop + _AFTER)
        since = 1e3 * (one.time[after] - one.stop)
        grid[1, 0].plot(since, one.relative[after], color=colour, label=label)
    grid[0, 0].set_xscale("log")
    grid[0, 0].set_xlim(left=1e-3)
    _label(
        grid[0, 0], f"input {level:g}", "time from the start of the stretch [s]", f"torque [{unit}]"
    )
    relative = "torque, of isometric [-]"
    _label(grid[0, 1], "while it is stretched", "stretch [°]", relative)
    _label(grid[1, 0], "after the stretch", "time from its end [ms]", relative)
    grid[1, 0].set_xlim(
        0, 1e3 * min(_AFTER, 1.5 * max(one.recovery(0.01) or _AFTER for one in found))
    )
    _draw_velocities(grid[1, 1], stretches)
    figure.legend(
        *grid[0, 1].get_legend_handles_labels(), loc="outside upper center", ncols=6,
        frameon=False, title=spoken(muscle),
    )  # fmt: skip


def _draw_velocities(axes: Any, stretches: Mapping[float, tuple[Stretch, ...]]) -> None:
    for index, (level, found) in enumerate(stretches.items()):
        velocity = [degrees(one.velocity) for one in found]
        colour = MUSCLE_COLOURS[(3, 5)[index % 2]]
        look = {"color": colour, "marker": "os^vD"[index % 5], "ls": "none", "ms": 6}
        axes.plot(velocity, [one.end for one in found], label=f"input {level:g}", **look)
        axes.plot(velocity, [one.own for one in found], color=colour, lw=1.2)
    axes.axhline(1.3, color="0.4", ls="--", lw=1, label="plateau")
    axes.plot([], [], color="0.4", lw=1.2, label="contractile element")
    axes.set_ylim(bottom=1.0)
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    _label(axes, "at the end", "velocity of stretch [°/s]", "torque, of isometric [-]")


def _label(axes: Any, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=11)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    tidy(axes)


def _colours(count: int) -> list[tuple[float, ...]]:
    """From pale to dark with velocity."""
    dark, pale = np.array(MUSCLE_COLOURS[0]), np.array([0.72, 0.85, 0.95])
    shares = np.linspace(0.0, 1.0, count) if count > 1 else np.ones(1)
    return [tuple((1 - share) * pale + share * 0.75 * dark) for share in shares]
