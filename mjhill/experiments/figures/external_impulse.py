"""The figure of the torque impulse: deflections, a burst beside the torques, K and B (Fig. 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import shades, tidy
from mjhill.experiments.result import spoken

if TYPE_CHECKING:
    from mjhill.experiments.paper.external_impulse import ExternalImpulse
    from mjhill.experiments.trials.hit import Hit

_SHOWN = 0.6  # [s]


def draw(result: ExternalImpulse, figure: Any) -> None:
    """Draw the result into a Matplotlib figure."""
    grid = figure.subplots(3, 2)
    for axes, hits, name in zip(grid[0], (result.small, result.large), "ab", strict=True):
        _deflections(axes, result, hits, name)
    _burst(grid[1, 0], grid[2, 0], result)
    _impedance(grid[1, 1], result, "stiffness", "K [N·m/rad]")
    _impedance(grid[2, 1], result, "damping", "B [N·m·s/rad]")
    grid[1, 1].set_title("second-order fits of the first swing", fontsize=10)
    grid[1, 1].legend(frameon=False, fontsize=8)
    grid[2, 1].set_xlabel("co-contraction [-]")
    figure.align_ylabels(grid)


def _deflections(axes: Any, result: ExternalImpulse, hits: tuple[Hit, ...], name: str) -> None:
    for hit, shade in zip(hits, shades(len(hits)), strict=True):
        moved = np.degrees(result.sign * (hit.run[f"{result.joint}.angle"] - result.angle))
        axes.plot(1e3 * hit.run.time, moved, color=shade, label=f"{hit.level:g}")
    axes.set_xlim(0, 1e3 * min(_SHOWN, hits[0].run.time[-1]))
    axes.set_title(f"{name}  impulse of {hits[0].impulse:.2g} N·m·s", fontsize=10)
    axes.set_xlabel("time [ms]")
    axes.set_ylabel("deflection [°]")
    axes.legend(title="co-contraction", title_fontsize=8, frameon=False, fontsize=8)
    tidy(axes)


def _burst(upper: Any, lower: Any, result: ExternalImpulse) -> None:
    """Input and torque of both muscles, one above the other; dashed without the burst."""
    burst, time = result.burst, 1e3 * result.burst.run.time
    names = [name.removesuffix(".u") for name in burst.run if name.endswith(".u")]
    for name, colour in zip(names, MUSCLE_COLOURS, strict=False):
        upper.plot(time, burst.run[f"{name}.u"], color=colour, label=spoken(name))
        lower.plot(time, burst.without[f"{name}.force"], color=colour, ls="--", lw=1)
        lower.plot(time, burst.run[f"{name}.force"], color=colour)
    upper.set_title("c  a burst of input during the response", fontsize=10)
    upper.set_ylabel("input [-]")
    upper.set_ylim(0, None)
    upper.legend(frameon=False, fontsize=8)
    lower.set_ylabel("torque [N·m]")
    lower.set_xlabel("time [ms]; dashed: without the burst")
    for axes in (upper, lower):
        axes.set_xlim(0, 1e3 * min(_SHOWN, burst.run.time[-1]))
        tidy(axes)


def _impedance(axes: Any, result: ExternalImpulse, what: str, label: str) -> None:
    series = (
        (result.small, "small impulse", "-", "0.0"),
        (result.large, "large impulse", "-", "0.55"),
        (result.linear, "linear elements", "--", "0.0"),
    )
    for hits, name, style, shade in series:
        values = [getattr(hit.swing, what) for hit in hits]
        levels = [hit.level for hit in hits]
        axes.plot(levels, values, style, marker="o", ms=4, color=shade, label=name)
    axes.set_ylabel(label)
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)
    tidy(axes)
