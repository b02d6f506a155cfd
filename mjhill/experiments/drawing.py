"""What the figures of several experiments share."""

from __future__ import annotations

from typing import Any

import numpy as np


def torque_unit(largest: float) -> tuple[float, str]:
    """Factor from N·m, and unit, in which torques up to ``largest`` [N·m] are easy to read."""
    return (1e3, "mN·m") if abs(largest) < 0.1 else (1.0, "N·m")


def tidy(axes: Any) -> None:
    """Give axes a pale grid and no box."""
    axes.grid(color="0.9", lw=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def shades(count: int) -> list[str]:
    """Greys for ``count`` ascending values; the highest is black."""
    return [f"{grey:.2f}" for grey in np.linspace(0.72, 0.0, count)] if count > 1 else ["0.0"]


def every(step: float) -> Any:
    """A locator with one tick per step."""
    from matplotlib.ticker import MultipleLocator

    return MultipleLocator(step)


def legend_above(figure: Any, handles: Any, columns: int = 4) -> None:
    """Put one legend for the whole figure above it, where it hides no data."""
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, frameon=False)
