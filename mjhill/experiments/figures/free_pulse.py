"""The figure of free movements by pulses (after the paper's Fig. 7b)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.trials.pulses import Pulse, ratio_over_time


def draw_pulses(
    figure: Any,
    strengths: Sequence[Pulse],
    widths: Sequence[Pulse],
    pairs: Mapping[str, tuple[Pulse, Pulse]],
) -> None:
    """Angle and velocity by strength and by width, and the ratio of the two of each pair."""
    axes = figure.subplot_mosaic([["a", "b", "ratio"], ["c", "d", "ratio"]])
    end = 1.6e3 * max(one.time_to_amplitude for one in (*strengths, *widths))
    levels = [f"{one.level:.0%}" for one in strengths]
    lengths = [f"{1e3 * one.width:g} ms" for one in widths]
    _draw_column(axes["a"], axes["c"], strengths, levels, end)
    _draw_column(axes["b"], axes["d"], widths, lengths, end)
    axes["a"].set_title(f"for {1e3 * strengths[0].width:g} ms", fontsize="medium")
    axes["b"].set_title("at 100%", fontsize="medium")
    axes["a"].set_ylabel("angle from rest [°]")
    axes["c"].set_ylabel("velocity [°/s]")
    for left, right in ("ab", "cd"):
        axes[right].sharey(axes[left])
        axes[left].autoscale(axis="y")
    _draw_ratios(axes["ratio"], pairs)
    axes["ratio"].set_title(" over ".join(levels[-1:-3:-1]), fontsize="medium")
    lines = {line.get_label(): line for line in axes["ratio"].get_lines()}
    figure.legend(lines.values(), lines, loc="outside lower center", ncols=3, fontsize="small")


def _draw_column(
    angle: Any, velocity: Any, drawn: Sequence[Pulse], names: Sequence[str], end: float
) -> None:
    for one, name, colour in zip(drawn, names, MUSCLE_COLOURS, strict=False):
        time = 1e3 * one.time
        angle.plot(time, np.degrees(one.travel), color=colour, lw=1.8)
        velocity.plot(time, np.degrees(one.velocity), color=colour, lw=1.8, label=name)
    for axis in (angle, velocity):
        axis.set_xlim(0, end)
        axis.grid(alpha=0.3)
    velocity.set_xlabel("time [ms]")
    velocity.legend(fontsize="small", loc="upper right")


def _draw_ratios(axis: Any, pairs: Mapping[str, tuple[Pulse, Pulse]]) -> None:
    colours = ("black", *MUSCLE_COLOURS)
    for (name, pair), colour in zip(pairs.items(), colours, strict=False):
        time, ratio = ratio_over_time(*pair)
        axis.plot(1e3 * time, ratio, color=colour, lw=1.8, label=name)
    axis.axhline(2, color="black", lw=1, ls="--", label="superposition")
    axis.set_ylabel("ratio of angles from rest")
    axis.set_xlabel("time [ms]")
    axis.set_xlim(left=0)
    axis.set_ylim(1, 2.2)
    axis.grid(alpha=0.3)
