"""Dashboard: one video frame out of rendered pictures, still layers, bars and numbers.

Nothing here calls matplotlib: a frame is copied together from what was drawn once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import activation_colour
from mjhill.draw.panels import Box, LegendRow
from mjhill.draw.timeplot import Image, Layers, Side, column, draw_glyphs, draw_layers

_TRACK = np.array([0.90, 0.90, 0.92])  # an empty bar
_FORCE = np.array([0.30, 0.30, 0.36])  # a full one
_CURSOR = (43, 43, 51)


@dataclass(frozen=True)
class Reading:
    """What one muscle shows in a frame.

    Attributes:
        activation: Activation [-].
        force: Force [N or N·m].
    """

    activation: float
    force: float


@dataclass(frozen=True)
class Dashboard:
    """Everything of a video that is drawn once.

    Attributes:
        sides: What each panel shows.
        span: Start and end of the time axes [s].
        layers: Frame with the curves in full, and faded.
        glyphs: Characters for each panel.
    """

    sides: tuple[Side, ...]
    span: tuple[float, float]
    layers: Layers
    glyphs: tuple[dict[str, Image], ...]

    def compose(
        self,
        frame: Image,
        time: float,
        pictures: Sequence[Image],
        readings: Sequence[Sequence[Reading]],
    ) -> None:
        """Fill ``frame``, shape (H, W, 3).

        Args:
            frame: The frame to fill.
            time: Time [s].
            pictures: The rendered scene of each panel.
            readings: What each muscle of each panel shows.
        """
        frame[:] = self.layers.future
        for i, side in enumerate(self.sides):
            frame[side.panel.picture.region] = pictures[i]
            self._reveal(frame, i, time)
            self._clock(frame, i, time)
            for row, muscle, reading in zip(
                side.panel.rows, side.muscles, readings[i], strict=False
            ):
                _draw_row(frame, row, reading, muscle.max_force, self.glyphs[i])

    def _reveal(self, frame: Image, index: int, time: float) -> None:
        """Show the curves in full up to ``time``, and the cursor there."""
        panel, boxes = self.sides[index].panel, self.layers.axes[index]
        if not boxes:
            return
        now = column(boxes[0], self.span)(time)
        rows = panel.curves.region[0]
        past = slice(panel.curves.left, now)
        frame[rows, past] = self.layers.past[rows, past]
        thick = panel.pixels(2)
        for box in boxes:
            frame[box.region[0], now - thick // 2 : now - thick // 2 + thick] = _CURSOR

    def _clock(self, frame: Image, index: int, time: float) -> None:
        panel, glyphs = self.sides[index].panel, self.glyphs[index]
        words = f"t {time:.3f} s"
        width = glyphs["0"].shape[1]
        left = panel.title.left + panel.title.width - panel.pixels(14) - width * len(words)
        top = panel.title.top + (panel.title.height - glyphs["0"].shape[0]) // 2
        _write(frame, left, top, words, glyphs)


def make_dashboard(
    sides: Sequence[Side], size: tuple[int, int], span: tuple[float, float]
) -> Dashboard:
    """Draw all that stands still, for frames of ``size`` (width, height) [px]."""
    layers = draw_layers(sides, size, span)
    glyphs = tuple(draw_glyphs(side.panel.pixels(26)) for side in sides)
    return Dashboard(tuple(sides), span, layers, glyphs)


def _draw_row(
    frame: Image,
    row: LegendRow,
    reading: Reading,
    max_force: float,
    glyphs: dict[str, Image],
) -> None:
    scale = activation_colour(np.linspace(0, 1, row.activation.width))
    _draw_bar(frame, row.activation, reading.activation, scale)
    _draw_bar(frame, row.force, reading.force / max_force, np.tile(_FORCE, (row.force.width, 1)))
    gap = glyphs["0"].shape[1] // 2
    for bar, words in (
        (row.activation, f"{reading.activation:.2f}"),
        (row.force, f"{reading.force:7.{_decimals(max_force)}f}"),
    ):
        top = bar.top + (bar.height - glyphs["0"].shape[0]) // 2
        _write(frame, bar.left + bar.width + gap, top, words, glyphs)


def _draw_bar(frame: Image, bar: Box, level: float, colours: NDArray[np.float64]) -> None:
    """A bar filled from the left; what is not filled shows its colours faintly."""
    full = round(min(max(level, 0.0), 1.0) * bar.width) if math.isfinite(level) else 0
    shades = 0.16 * colours + 0.84 * _TRACK
    shades[:full] = colours[:full]
    frame[bar.region] = np.round(255 * shades).astype(np.uint8)[None]


def _write(frame: Image, left: int, top: int, words: str, glyphs: dict[str, Image]) -> None:
    """Copy characters into the frame; what lies outside it is cut off."""
    height, width = frame.shape[:2]
    for i, character in enumerate(words):
        glyph = glyphs[character]
        x, y = left + i * glyph.shape[1], max(top, 0)
        if x < 0 or x >= width or y >= height:
            continue
        space = frame[y : y + glyph.shape[0], x : x + glyph.shape[1]]
        space[:] = glyph[: space.shape[0], : space.shape[1]]


def _decimals(max_force: float) -> int:
    """Decimals that show a force to about a thousandth of its maximum."""
    return min(max(3 - math.ceil(math.log10(max(max_force, 1e-3))), 0), 5)
