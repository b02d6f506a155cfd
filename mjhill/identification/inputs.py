"""How the inputs of a measurement go on between its samples, and how late they act."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

WAYS = ("hold", "join")  # each value lasts until the next sample; straight lines

_FLAT = 8.0  # median changes, beyond which a change is not one of noise
_JUMP = 0.05  # of the range, at least
_BEFORE = 1.0  # [s] for which the first value is taken to have lasted

_Values = NDArray[np.float64]


def is_held(values: _Values) -> bool:
    """Whether a sampled signal consists of plateaus with jumps, shape (T,).

    A jump is a change of at least 5 % of the range that has a plateau on at least one side. The
    rise of a smooth signal has other changes on both sides. Most of what a held signal changes by
    must be jumps. Changes like those of half of the samples, as by noise, are none.
    """
    change = np.abs(np.diff(values))
    span = float(np.ptp(values))
    moving = change > _FLAT * float(np.median(change))
    if not moving.any():
        return False
    padded = np.concatenate([[False], moving, [False]])
    jump = moving & ~(padded[:-2] & padded[2:]) & (change >= _JUMP * span)
    return float(change[jump].sum()) >= 0.5 * max(float(change[moving].sum()), span)


def step_means(
    time: _Values, values: _Values, edges: _Values, *, hold: bool, delay: ArrayLike = 0.0
) -> _Values:
    """Mean of a sampled input over each step.

    Args:
        time: Times of the samples [s], shape (T,), ascending.
        values: The samples, shape (T,).
        edges: Where the steps begin, and the last ends [s], shape (S + 1,). Before the first
            sample the first value holds, after the last one the last.
        hold: Whether a value lasts until the next sample; else straight lines join them.
        delay: By how much the input comes late [s], shape (...).

    Returns:
        The means, shape (..., S).
    """
    known = np.concatenate([[time[0] - _BEFORE], time, [edges[-1] + _BEFORE]])
    level = np.concatenate([values[:1], values, values[-1:]])
    slope = np.zeros(len(level))
    if not hold:
        slope[:-1] = np.diff(level) / np.diff(known)
    parts = np.diff(known) * (level[:-1] + 0.5 * slope[:-1] * np.diff(known))
    area = np.concatenate([[0.0], np.cumsum(parts)])
    at = edges - np.asarray(delay, dtype=np.float64)[..., None]
    index = np.searchsorted(known, at, side="right") - 1
    since = at - known[index]
    areas = area[index] + since * (level[index] + 0.5 * slope[index] * since)
    # rounding must not take an excitation out of its limits
    return np.asarray(np.clip(np.diff(areas) / np.diff(edges), values.min(), values.max()))


def simulated_step(path: str | Path) -> float | None:
    """Timestep [s] of the simulation that a file is a recording of; None if it is none.

    One by RK4 counts as none: it is nearer to the true movement than the steps of a fit are.
    """
    # any file may come; that of a recording is UTF-8
    with Path(path).open(encoding="utf-8-sig", errors="replace") as file:
        first = file.readline()
    try:
        about = json.loads(first.removeprefix("# "))["about"]
        step, integrator = float(about["timestep"]), about["integrator"]
    except (ValueError, TypeError, LookupError):
        return None
    return None if integrator == "mjINT_RK4" or not step > 0 else step
