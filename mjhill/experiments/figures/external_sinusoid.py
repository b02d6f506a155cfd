"""The figure of external sinusoids: gain, phase and coherence over frequency (Fig. 8b)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import every, shades, tidy
from mjhill.experiments.result import spoken
from mjhill.lab.frequency import decibel

if TYPE_CHECKING:
    from mjhill.experiments.paper.external_sinusoid import ExternalSinusoid

_ROWS = ("gain [dB re 1°/(N·m)]", "phase [°]", "coherence [-]")


def draw(result: ExternalSinusoid, figure: Any) -> None:
    """Draw the result into a Matplotlib figure."""
    grid = figure.subplots(3, 2, sharex=True, sharey="row", height_ratios=(2, 1.6, 1))
    _column(grid[:, 0], result.bias, f"bias held by the {spoken(result.muscle)}")
    _column(grid[:, 1], result.cocontraction, "co-contraction")
    if result.neural is not None:
        _neural(grid[:, 1], result)
    for row, label in zip(grid, _ROWS, strict=True):
        row[0].set_ylabel(label)
    low, high = grid[0, 0].get_ylim()
    grid[0, 0].set_ylim(low - 0.45 * (high - low), high)  # room for the legends
    for axes in grid[0]:
        if axes.lines:
            axes.legend(frameon=False, fontsize=8, loc="lower left")
    grid[1, 0].yaxis.set_major_locator(every(90))
    grid[2, 0].set_ylim(0, 1.05)
    figure.align_ylabels(grid)


def _column(column: Any, curves: Any, title: str) -> None:
    for curve, shade in zip(curves, shades(len(curves)), strict=True):
        label = curve.drive.label.removeprefix("bias of ").removeprefix("co-contraction ")
        if curve.resonance:
            label += f", resonance {curve.resonance:.2g} Hz"
        _lines(column, curve, color=shade, label=label)
    column[0].set_title(title, fontsize=10)
    column[-1].set_xlabel("frequency [Hz]")
    column[-1].set_xscale("log")
    column[-1].xaxis.set_major_formatter("{x:g}")
    for axes in column:
        tidy(axes)


def _neural(column: Any, result: ExternalSinusoid) -> None:
    """The neural response, its gain moved to that of the torque at the lowest frequency."""
    external = result.cocontraction[len(result.cocontraction) // 2]
    assert result.neural is not None
    label = f"neural at {result.neural.drive.level:g}, from the same gain"
    scale = external.low_gain / result.neural.low_gain
    _lines(column, result.neural, scale, color=MUSCLE_COLOURS[0], ls="--", label=label)


def _lines(column: Any, curve: Any, scale: float = 1.0, **style: Any) -> None:
    heard = curve.coherence > 0.5  # a fainter response is as much drift as answer
    column[0].plot(curve.frequency[heard], decibel(scale * np.degrees(curve.gain[heard])), **style)
    column[1].plot(curve.frequency[heard], np.degrees(curve.phase[heard]), **style)
    column[2].plot(curve.frequency, curve.coherence, **style)
