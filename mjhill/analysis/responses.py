"""Responses measured: rise, overshoot, settling, decay, second-order fit.

Times [s] and values are arrays of shape (T,); time ascends and starts at the input. A measure
that the run was too short to show is None.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_Values = NDArray[np.float64]


class SecondOrder(NamedTuple):
    """A joint as a spring and a damper: torque = J q'' + damping q' + stiffness q.

    Attributes:
        stiffness: [N·m/rad or N/m].
        damping: [N·m·s/rad or N·s/m].
        inertia: J [kg·m² or kg], as given or as found.
    """

    stiffness: float
    damping: float
    inertia: float


def time_to(time: _Values, values: _Values, level: float) -> float | None:
    """Time from the start until ``values`` first reach ``level`` from below, interpolated."""
    reached = np.flatnonzero(values >= level)
    if len(reached) == 0:
        return None
    i = int(reached[0])
    if i == 0:
        return 0.0
    share = (level - values[i - 1]) / (values[i] - values[i - 1])
    return float(time[i - 1] + share * (time[i] - time[i - 1]) - time[0])


def progress_of_step(values: _Values) -> _Values:
    """A step response scaled to 0 at its start and 1 at its end.

    Raises:
        ValueError: It ends where it starts.
    """
    travel = values[-1] - values[0]
    if travel == 0:
        raise ValueError("the response ends where it starts, so there is no step to measure")
    return np.asarray((values - values[0]) / travel)


def rise_time(time: _Values, values: _Values) -> float | None:
    """Time [s] of a step response from 10 to 90 % of its travel."""
    share = progress_of_step(values)
    low, high = time_to(time, share, 0.1), time_to(time, share, 0.9)
    return None if low is None or high is None else high - low


def overshoot(values: _Values) -> float:
    """How far a step response goes past its end, as a share of its travel [-]."""
    return max(0.0, float(progress_of_step(values).max()) - 1.0)


def settling_time(time: _Values, values: _Values, band: float = 0.05) -> float:
    """Time [s] after which a step response stays within ``band`` of its travel from its end."""
    outside = np.flatnonzero(np.abs(progress_of_step(values) - 1.0) > band)
    return float(time[outside[-1] + 1] - time[0])


def half_life(time: _Values, values: _Values) -> float | None:
    """Time [s] from the peak of a positive deflection until half of it is left."""
    peak = int(np.argmax(values))
    return time_to(time[peak:], -values[peak:], -0.5 * float(values[peak]))


def second_order_fit(
    time: _Values, deflection: _Values, velocity: _Values, load: _Values, inertia: float | None
) -> SecondOrder:
    """Stiffness and damping that best explain a deflection under a load.

    Least squares on the equation of motion integrated once over time, so that nothing is
    differentiated: J v + B q + K ∫q dt = ∫load dt.

    Args:
        time: Sample times [s].
        deflection: q, 0 at the start [rad or m].
        velocity: q' [rad/s or m/s].
        load: What is added to the steady load; held from each sample to the next [N·m or N].
        inertia: J [kg·m² or kg]; None to find it too.
    """
    step = np.diff(time)
    area = np.concatenate([[0.0], np.cumsum(0.5 * step * (deflection[1:] + deflection[:-1]))])
    impulse = np.concatenate([[0.0], np.cumsum(step * load[:-1])])
    gained = velocity - velocity[0]
    if inertia is None:
        unknowns, known = np.stack([area, deflection, gained], axis=1), impulse
    else:
        unknowns, known = np.stack([area, deflection], axis=1), impulse - inertia * gained
    found, *_ = np.linalg.lstsq(unknowns, known, rcond=None)
    stiffness, damping, *rest = found.tolist()
    return SecondOrder(stiffness, damping, rest[0] if inertia is None else inertia)
