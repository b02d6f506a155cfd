"""The figure of the release from springs: angles, torques, K and B (Fig. 10)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import shades, tidy
from mjhill.experiments.result import spoken

if TYPE_CHECKING:
    from mjhill.experiments.paper.spring_release import SpringRelease
    from mjhill.experiments.trials.spring_trial import Release

_SHOWN = 0.7  # [s]
_MARKS = "osD^v"


def draw(result: SpringRelease, figure: Any) -> None:
    """Draw the result into a Matplotlib figure."""
    grid = figure.subplots(2, 2)
    springs = result.by_spring()
    middle = list(springs)[len(springs) // 2]
    _trajectories(grid[0, 0], grid[1, 0], result, springs[middle])
    grid[0, 0].set_title(f"a  release from a spring of {middle:.3g} N·m/rad", fontsize=10)
    _summary(grid[0, 1], result, "K of the joint [N·m/rad]", lambda one: one.stiffness)
    _summary(grid[1, 1], result, "B [N·m·s/rad]", lambda one: one.swing.damping)
    grid[0, 1].set_title("b  second-order fits", fontsize=10)
    grid[0, 1].legend(title="spring [N·m/rad]", title_fontsize=8, frameon=False, fontsize=8)
    grid[1, 1].set_xlabel("co-contraction [-]")
    figure.align_ylabels(grid)


def _trajectories(
    upper: Any, lower: Any, result: SpringRelease, releases: tuple[Release, ...]
) -> None:
    """Deflection and muscle torques of one spring at every level."""
    for one, shade in zip(releases, shades(len(releases)), strict=True):
        time = 1e3 * one.run.time
        moved = np.degrees(one.run[f"{result.joint}.angle"] - result.angle)
        upper.plot(time, moved, color=shade, label=f"{one.level:g}")
        # a paler line is one of a lower level, as above
        opacity = 1.0 - float(shade)
        for (name, _), colour in zip(_muscles(result), MUSCLE_COLOURS, strict=False):
            label = spoken(name) if one is releases[-1] else None
            force = one.run[f"{name}.force"]
            lower.plot(time, force, color=colour, alpha=opacity, label=label)
    upper.legend(title="co-contraction", title_fontsize=8, frameon=False, fontsize=8)
    upper.set_ylabel("deflection [°]")
    lower.set_ylabel("muscle torque [N·m]")
    lower.set_xlabel("time [ms]")
    lower.set_ylim(0, 1.3 * lower.get_ylim()[1])  # room for the legend
    lower.legend(frameon=False, fontsize=8, ncols=2, loc="upper right")
    for axes in (upper, lower):
        axes.set_xlim(0, 1e3 * min(_SHOWN, releases[0].run.time[-1]))
        tidy(axes)


def _muscles(result: SpringRelease) -> list[tuple[str, float]]:
    return list(next(iter(result.levels.values())).items())


def _summary(axes: Any, result: SpringRelease, label: str, value: Any) -> None:
    springs = result.by_spring()
    for number, (spring, releases) in enumerate(springs.items()):
        levels = [one.level for one in releases]
        values = [value(one) for one in releases]
        shade, mark = shades(len(springs))[number], _MARKS[number % len(_MARKS)]
        axes.plot(levels, values, marker=mark, ms=5, color=shade, label=f"{spring:.3g}")
    axes.set_ylabel(label)
    axes.set_xlim(0, None)
    axes.set_ylim(min(0.0, axes.get_ylim()[0]), None)
    tidy(axes)
