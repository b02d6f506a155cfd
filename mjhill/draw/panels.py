"""Panels: where picture, legend and curves of each view lie in a video frame, in pixels."""

from __future__ import annotations

from dataclasses import dataclass

MAX_ROWS = 8  # muscles in a legend; more would leave no room for the picture
_DESIGN_WIDTH, _DESIGN_HEIGHT = 640, 720  # the column at which one unit is one pixel


@dataclass(frozen=True)
class Box:
    """A rectangle of pixels; the frame's origin is its top left corner.

    Attributes:
        left: Column of the first pixel.
        top: Row of the first pixel.
        width: Number of columns.
        height: Number of rows.
    """

    left: int
    top: int
    width: int
    height: int

    @property
    def region(self) -> tuple[slice, slice]:
        """The index of the box in an image of shape (H, W, 3)."""
        return (
            slice(self.top, self.top + self.height),
            slice(self.left, self.left + self.width),
        )


@dataclass(frozen=True)
class LegendRow:
    """Places of what one muscle shows in the legend.

    Attributes:
        swatch: The muscle's own colour; its name stands to the right.
        activation: The bar of activation; its number stands to the right.
        force: The bar of force, full at the maximum isometric force; number to the right.
    """

    swatch: Box
    activation: Box
    force: Box


@dataclass(frozen=True)
class Panel:
    """Places of what one view shows.

    Attributes:
        unit: Pixels per unit of the design, which scales text and lines [px].
        title: Title on the left, clock on the right.
        picture: The rendered scene.
        header: The legend's heading.
        rows: The legend, one row a muscle, at most ``MAX_ROWS``.
        curves: The time series.
    """

    unit: float
    title: Box
    picture: Box
    header: Box
    rows: tuple[LegendRow, ...]
    curves: Box

    def pixels(self, length: float) -> int:
        """A length of the design [units] in pixels, at least 1."""
        return max(1, round(length * self.unit))


def arrange(size: tuple[int, int], index: int, count: int, muscles: int) -> Panel:
    """The panel of view ``index`` of ``count``, side by side in a frame of ``size`` [px].

    A wide panel has its curves to the right of the picture, a narrow one below it.
    """
    width, height = size
    left, right = index * width // count, (index + 1) * width // count
    wide = right - left >= 1.2 * height
    column = (right - left) // 2 if wide else right - left
    unit = min(column / _DESIGN_WIDTH, height / _DESIGN_HEIGHT)
    rows = min(muscles, MAX_ROWS)
    row_height, title_height = max(2, round(30 * unit)), max(2, round(46 * unit))
    legend_height = row_height * (rows + 1) + row_height // 3 if rows else 0
    room = height - title_height - legend_height
    picture_height = room if wide else round(0.47 * room)
    legend_top = title_height + picture_height
    gap = max(1, round(4 * unit)) if count > 1 else 0  # pictures side by side are of one size
    if wide:
        curves = Box(left + column, 0, right - left - column, height)
    else:
        top = legend_top + legend_height
        curves = Box(left, top, column, height - top)
    return Panel(
        unit,
        Box(left, 0, column, title_height),
        Box(left, title_height, column - gap, picture_height),
        Box(left, legend_top, column, row_height),
        tuple(
            _legend_row(left, legend_top + row_height * (i + 1), row_height, unit)
            for i in range(rows)
        ),
        curves,
    )


def _legend_row(left: int, top: int, height: int, unit: float) -> LegendRow:
    def bar(start: float, width: float, inset: float) -> Box:
        margin = round(inset * height)
        return Box(
            left + round(start * unit),
            top + margin,
            max(2, round(width * unit)),
            max(1, height - 2 * margin),
        )

    return LegendRow(bar(14, 14, 0.26), bar(196, 130, 0.22), bar(394, 116, 0.22))
