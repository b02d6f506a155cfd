"""Isometric twitches of joints that are locked, many at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.ballistic import peaks
from mjhill.lab.batch import Rigs
from mjhill.lab.rig import UnmeasuredError, direction, strongest_angle, timestep_of

# [s]; an excitation of 1 is the largest firing rate (Winters & Stark 1987, sect. 4.1.2), so one
# action potential has the area of one over that rate: 60 Hz, at which plantarflexors fuse (Sale et
# al. 1982)
ACTION_POTENTIAL = 1 / 60
_TWITCH_TIME = 1.0  # length of a run [s]
_TETANUS_TIME = 1.5  # [s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Twitches:
    """Torques after one action potential to a muscle of N locked joints.

    Attributes:
        contraction: Time from the middle of the action potential to the peak [s], shape (N,).
        half_relaxation: Time from the peak until torque is half of it [s], shape (N,).
        share: Peak as a share of the largest torque under lasting full excitation [-], shape (N,).
        time: Times from the start of the action potential [s], shape (T,).
        torque: Torque above that at rest [N·m], shape (N, T).
    """

    contraction: _Values
    half_relaxation: _Values
    share: _Values
    time: _Values
    torque: _Values


def twitches(
    joints: Sequence[Joint],
    muscle: str,
    *,
    angle: float | None = None,
    width: float = ACTION_POTENTIAL,
) -> Twitches:
    """The twitch of a muscle of N joints that do not move.

    Args:
        joints: N joints with the same muscles and gears; other numbers may differ.
        muscle: The muscle.
        angle: Where they are [rad]; by default each where its muscle is strongest.
        width: How long the excitation is 1 [s]; that of one action potential by default.

    Raises:
        UnmeasuredError: A torque does not rise, or has not half relaxed by the end of the run.
    """
    timestep = timestep_of(joints[0])
    steps = round(_TETANUS_TIME / timestep)
    rigs = Rigs([*joints] * 2, timestep=timestep, locked=True)
    start = [strongest_angle(one, muscle) if angle is None else angle for one in joints]
    pulse = np.clip(width / timestep - np.arange(steps), 0.0, 1.0)
    excitation = np.zeros((2, len(joints), steps, len(joints[0].muscles)))
    excitation[:, :, :, list(joints[0].muscles).index(muscle)] = [[pulse], [np.ones(steps)]]
    found = rigs.run(
        start=np.tile(start, 2),
        excitation=excitation.reshape(2 * len(joints), steps, -1),
        steps=steps,
        record=("qfrc_actuator",),
    )["qfrc_actuator"][:, :, 0]
    torque, tetanus = (direction(joints[0], muscle) * (found - found[:, :1])).reshape(
        2, len(joints), steps
    )
    torque = torque[:, : round(_TWITCH_TIME / timestep)]
    top = peaks(torque)
    if not (top > 0).all():
        raise UnmeasuredError(f"the torque of {muscle} does not rise after the impulse")
    time: _Values = np.arange(torque.shape[1], dtype=np.float64) * timestep
    at = np.array([_time_of_peak(row, timestep) for row in torque])
    half = np.array([_time_of_half(time, row, peak) for row, peak in zip(torque, top, strict=True)])
    if np.isnan(half).any():
        raise UnmeasuredError(f"{muscle} has not half relaxed {_TWITCH_TIME:g} s after the impulse")
    return Twitches(at - 0.5 * width, half - at, top / tetanus.max(axis=1), time, torque)


def _time_of_peak(values: _Values, timestep: float) -> float:
    top = min(max(int(values.argmax()), 1), len(values) - 2)
    before, here, after = values[top - 1 : top + 2].tolist()
    bend = before - 2 * here + after
    return timestep * (top + (0.5 * (before - after) / bend if bend < 0 else 0.0))


def _time_of_half(time: _Values, values: _Values, peak: float) -> float:
    top = int(values.argmax())
    below = np.flatnonzero(values[top:] <= 0.5 * peak)
    if not len(below):
        return float("nan")
    k = top + int(below[0])
    share = (values[k - 1] - 0.5 * peak) / (values[k - 1] - values[k])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))
