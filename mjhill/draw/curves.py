"""Curves: which series of a recording are shown, as what, and within which limits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import Colour, DrawnMuscle
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
    """Angle of each joint, activation and force of each muscle; what there is of these."""
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
