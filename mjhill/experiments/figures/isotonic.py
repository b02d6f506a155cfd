"""The figure of quick releases: the runs, and torque against velocity."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.trials.quick_release import RELEASE
from mjhill.simulate.recording import Recording

_APART = 0.08  # least distance of two labels, as a share of the axis
_MARKERS = ("o", "^", "v", "o")

_Values = NDArray[np.float64]


def draw_releases(
    axis: Any, joint: str, recordings: Mapping[str, Recording], *, start: float, angle: float
) -> None:
    """Angle over time from the release, up to a little past the reading; angles in rad."""
    read, shades = degrees(angle), np.linspace(0.35, 1.0, len(recordings))
    times = {}
    for (name, recording), shade in zip(recordings.items(), shades, strict=True):
        angles, time = np.degrees(recording[f"{joint}.angle"]), 1e3 * (recording.time - RELEASE)
        axis.plot(time, angles, color=(*MUSCLE_COLOURS[0], shade), lw=1.6)
        before = angles < read if start < angle else angles > read
        if not before.all():
            times[name] = float(time[np.argmin(before)])
    end, last = 1.2 * max(times.values()), -np.inf
    for name, passed in times.items():
        if passed - last > _APART * end:
            axis.annotate(name, (passed, read), (2, -10), textcoords="offset points",
                          fontsize="small")  # fmt: skip
            last = passed
    axis.axhline(read, color="0.4", lw=1, ls="--")
    axis.set_xlim(-0.06 * end, end)
    half = 0.8 * degrees(abs(angle - start))
    middle = 0.5 * degrees(angle + start)
    axis.set_ylim(middle - half, middle + half)
    axis.set_xlabel("time from the release [ms]")
    axis.set_ylabel("angle [°]")
    axis.grid(alpha=0.3)


def draw_torques(
    axis: Any, own_velocity: _Values, own_torque: _Values, velocity: _Values,
    torques: Mapping[str, _Values],
) -> None:  # fmt: skip
    """The element's own relation and the points read, by what is subtracted from them."""
    axis.plot(own_velocity, own_torque, "k-", lw=2, label="contractile element")
    for (name, torque), marker, colour in zip(
        torques.items(), _MARKERS, MUSCLE_COLOURS, strict=False
    ):
        filled = colour if name == list(torques)[-1] else "none"
        axis.plot(velocity, torque, marker, ms=6, color=colour, mfc=filled, label=name)
    axis.set_ylabel("torque [N·m]")
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    axis.grid(alpha=0.3)
    axis.legend(fontsize="small")
