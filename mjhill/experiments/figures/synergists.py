"""The figure of synergists and their equivalent: torque over velocity and over stretch (Fig. 3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjhill.experiments.figures.drawing import tidy
from mjhill.muscles.equivalent import stretch_at_force, torque_at_velocity
from mjhill.muscles.hill import Hill

# blue, orange, green, purple of Okabe & Ito 2008; dashes where heads hide one another
_STYLES = (
    ("#0072b2", "-"),
    ("#e69f00", "-"),
    ("#009e73", (0, (3, 2))),
    ("#cc79a7", (0, (1, 1))),
)


def draw(heads: Mapping[str, Hill], equivalent: Hill, figure: Any) -> None:
    """Draw the two panels into a figure."""
    speed_axis, stretch_axis = figure.subplots(1, 2, sharey=True)
    for index, (name, muscle) in enumerate(heads.items()):
        colour, dashes = _STYLES[index % len(_STYLES)]
        _draw(speed_axis, stretch_axis, muscle, label=name, color=colour, linestyle=dashes)
    _draw(speed_axis, stretch_axis, equivalent, label="equivalent muscle", color="black")
    speeds = np.linspace(0, max(muscle.max_velocity for muscle in heads.values()), 16)
    total = torque_at_velocity(list(heads.values()), speeds)
    speed_axis.plot(
        np.degrees(speeds),
        total,
        "o",
        color="0.45",
        markersize=5,
        label="sum of heads",
        clip_on=False,
    )
    speed_axis.set_title("(a) torque and velocity")
    speed_axis.set_xlabel("shortening velocity [°/s]")
    speed_axis.set_ylabel("torque [N·m]")
    stretch_axis.set_title("(b) series elements")
    stretch_axis.set_xlabel("stretch [°]")
    for axis in (speed_axis, stretch_axis):
        tidy(axis)
        axis.set(xlim=(0, None), ylim=(0, None))
    spacing = {"columnspacing": 1.2, "handlelength": 1.5, "handletextpad": 0.5}
    figure.legend(loc="outside lower center", ncols=5, frameon=False, **spacing)


def _draw(speed_axis: Any, stretch_axis: Any, muscle: Hill, **style: Any) -> None:
    speeds, shares = np.linspace(0, muscle.max_velocity, 200), np.linspace(0, 1, 100)
    torque = torque_at_velocity([muscle], speeds)
    speed_axis.plot(np.degrees(speeds), torque, linewidth=2.2, **style)
    stretch, torque = stretch_at_force(muscle, shares), shares * muscle.max_isometric_force
    stretch_axis.plot(np.degrees(stretch), torque, linewidth=2.2, **{**style, "label": None})
