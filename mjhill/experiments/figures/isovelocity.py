"""The figure of torque-velocity curves: what they depend on (Fig. 6)."""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.figures.drawing import tidy
from mjhill.experiments.paper.isovelocity_claims import Curves
from mjhill.experiments.trials.torque_velocity import Sweep

Values = NDArray[np.float64]

_OWN: dict[str, Any] = {"color": "black", "lw": 2.5, "label": "contractile element"}
_LOOKS: tuple[dict[str, Any], ...] = tuple(
    {"color": MUSCLE_COLOURS[k], "marker": marker, "ms": 4.5, "lw": 1.3}
    for k, marker in ((0, "o"), (1, "s"), (2, "^"), (3, "v"))
)
_RELAXED, _CONTRACTED, _COMPLIANT, _ = _LOOKS


def draw(figure: Any, sweep: Sweep, curves: Curves) -> None:
    """Initial condition, place of reading, clamp, series element; torque of isometric torque."""
    grid = figure.subplots(2, 2, sharex=True, sharey=True)
    first = round(degrees(sweep.angles[0]))
    velocity = np.degrees(sweep.velocities)

    def scaled(torque: Values, isometric: float) -> tuple[Values, Values]:
        """Velocities and torques of a curve, with its isometric point."""
        k = int(np.searchsorted(sweep.velocities, 0.0))
        return np.insert(velocity, k, 0.0), np.insert(torque / isometric, k, 1.0)

    at = float(curves.isometric[0])

    def compared(axes: Any, title: str, *pairs: tuple[str, Values, dict[str, Any]]) -> None:
        axes.plot(*scaled(curves.own[0], at), **_OWN)
        for label, torque, look in pairs:
            axes.plot(*scaled(torque, at), label=label, **look)
        axes.set_title(f"{title}, read at {first}°", fontsize=11)

    compared(
        grid[0, 0],
        "initial condition",
        ("started relaxed", curves.relaxed.at[0], _RELAXED),
        ("started contracted", curves.tensed.at[0], _CONTRACTED),
    )
    _draw_places(grid[0, 1], sweep, curves, scaled)
    compared(
        grid[1, 0],
        "clamp",
        ("started contracted, stiff", curves.tensed.at[0], _CONTRACTED),
        ("started contracted, compliant", curves.tensed_compliant.at[0], _COMPLIANT),
    )
    compared(
        grid[1, 1],
        "hardly any series element",
        ("started relaxed", curves.relaxed_bare.at[0], _RELAXED),
        ("started contracted", curves.tensed_bare.at[0], _CONTRACTED),
    )
    for axes in grid.flat:
        axes.axvline(0, color="0.6", lw=0.8)
        axes.set_ylim(-0.05, 1.5)
        axes.legend(frameon=False, fontsize=9, loc="upper right")
        tidy(axes)
    for axes in grid[1]:
        axes.set_xlabel("velocity of shortening [°/s]")
    for axes in grid[:, 0]:
        axes.set_ylabel("torque, of isometric torque [-]")


def _draw_places(axes: Any, sweep: Sweep, curves: Curves, scaled: Any) -> None:
    axes.plot(*scaled(curves.own[0], float(curves.isometric[0])), **_OWN)
    axes.plot(*scaled(curves.tensed.peak, curves.largest), label="peak", **_LOOKS[0])
    for look, angle, torque, isometric in zip(
        _LOOKS[1:], sweep.angles, curves.tensed.at, curves.isometric.tolist(), strict=False
    ):
        axes.plot(*scaled(torque, isometric), label=f"at {round(degrees(angle))}°", **look)
    axes.set_title("where it is read, started contracted", fontsize=11)
