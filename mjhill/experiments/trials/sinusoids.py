"""A held joint shaken by sinusoids of many frequencies: gain, phase and coherence of its angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import mujoco
import mujoco.batch
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.engine.install import installed
from mjhill.lab.drives import Drive
from mjhill.lab.frequency import response_at
from mjhill.lab.rig import Rig, check_batch, net_torque, still

_INPUTS = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED)
_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """The answer of the joint's angle to one drive at every frequency.

    Attributes:
        drive: What oscillates.
        bias: Constant external torque that holds the joint [N·m].
        frequency: [Hz], shape (F,).
        gain: Angle over torque [rad/(N·m)] or, of a neural drive, over a unit of it [rad].
        phase: Of the angle before the drive, unwrapped [rad].
        coherence: Share of variance at the driving frequency [-].
    """

    drive: Drive
    bias: float
    frequency: _Values
    gain: _Values
    phase: _Values
    coherence: _Values

    @property
    def low_gain(self) -> float:
        """Gain at the lowest frequency."""
        return float(self.gain[0])

    @property
    def resonance(self) -> float | None:
        """Frequency of the largest velocity per torque [Hz]; None at an end of the band.

        That is the undamped natural frequency of a second-order system however damped it is.
        """
        speed = np.log(self.frequency * self.gain)
        top = int(speed.argmax())
        if top in (0, len(speed) - 1):
            return None
        # a parabola through the three highest, in logarithms
        around = slice(top - 1, top + 2)
        second, first, _ = np.polyfit(np.log(self.frequency[around]), speed[around], 2)
        return float(np.exp(-first / (2 * second)))


def shaken(bench: Rig, angle: float, drives: Sequence[Drive], frequency: ArrayLike) -> list[Curve]:
    """The curves of several drives, every frequency of every drive in one batch.

    The drive rises smoothly over one cycle of the slowest frequency; measured are the last whole
    cycles of the equally long rest.

    Args:
        bench: The joint.
        angle: Where it is held [rad].
        drives: What oscillates, a curve each.
        frequency: [Hz], shape (F,), ascending.

    Raises:
        UnmeasuredError: MuJoCo warned that a run went bad.
    """
    band = np.asarray(frequency, dtype=np.float64)
    step, count = bench.timestep, len(band)
    rise = round(1 / (band[0] * step))
    steps = 2 * rise + 1
    batch = mujoco.batch.Batch(bench.model, nsim=len(drives) * count)
    muscles = list(bench.joint.muscles)
    inputs = np.empty((len(drives) * count, steps, len(muscles) + 1))
    # an input is held over its step at the value of mid-step
    waves = _waves(band, (np.arange(steps) + 0.5) * step, rise * step)
    biases = []
    for number, drive in enumerate(drives):
        rows = slice(number * count, (number + 1) * count)
        start = still(bench, angle, drive.inputs)
        batch.qpos[rows], batch.qvel[rows], batch.act[rows] = angle, 0.0, start.act
        biases.append(-net_torque(bench.joint, drive.inputs, angle))
        for column, name in enumerate(muscles):
            swing = (drive.excitation or {}).get(name, 0.0)
            inputs[rows, :, column] = drive.inputs.get(name, 0.0) + swing * waves
        inputs[rows, :, -1] = biases[-1] + drive.torque * waves
    with installed():
        angles = batch.rollout(steps, inputs, _INPUTS)["qpos"][:, :, 0]
    check_batch(batch, bench.joint)
    # recorded after each step
    time = (np.arange(steps) + 1) * step
    shown, waves = slice(rise, None), _waves(band, time, rise * step)
    return [
        _curve(drive, bias, band, time[shown], waves[:, shown], rows[:, shown])
        for drive, bias, rows in zip(
            drives, biases, angles.reshape(len(drives), count, steps), strict=True
        )
    ]


def _waves(band: _Values, time: _Values, rise: float) -> _Values:
    """Sinusoids of amplitude 1 that take a time to rise [s], shape (F, T)."""
    size = 0.5 - 0.5 * np.cos(pi * np.minimum(time / rise, 1.0))
    return np.asarray(size * np.sin(2 * pi * band[:, np.newaxis] * time))


def _curve(
    drive: Drive, bias: float, band: _Values, time: _Values, waves: _Values, angles: _Values
) -> Curve:
    size = drive.torque if drive.excitation is None else 1.0
    found = [
        response_at(time, size * wave, angle, float(frequency))
        for frequency, wave, angle in zip(band, waves, angles, strict=True)
    ]
    return Curve(
        drive=drive,
        bias=bias,
        frequency=band,
        gain=np.array([one.gain for one in found]),
        phase=np.unwrap([one.phase for one in found]),
        coherence=np.array([one.coherence for one in found]),
    )
