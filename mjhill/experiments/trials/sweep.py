"""Sweeps of the frequency at which two antagonists are driven out of phase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.ensemble import angles
from mjhill.lab.frequency import (
    SecondOrderFrequency,
    decibel,
    response_at,
    second_order_band,
)

DECIBELS, DEGREES = 3.0, 30.0  # how far a second-order fit may be off
_SETTLE, _CYCLES, _WINDOW = 6.0, 2, 2.0  # transient left out [s]; least cycles and time read [s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Sweep:
    """Frequency response at one offset and amplitude.

    Attributes:
        offset: Mean input of both muscles [-].
        amplitude: Of the sinusoids [-].
        frequency: [Hz], shape (F,).
        gain: Angle over the input of the agonist [rad per unit input], shape (F,).
        phase: Of the angle [rad], unwrapped, shape (F,).
        coherence: Share of the angle's variance at the driving frequency [-], shape (F,).
        fit: Second-order fit of the widest band from the lowest frequency that it describes.
        highest: Highest frequency of that band [Hz]; 0 where there is none.
    """

    offset: float
    amplitude: float
    frequency: _Values
    gain: _Values
    phase: _Values
    coherence: _Values
    fit: SecondOrderFrequency
    highest: float

    @property
    def name(self) -> str:
        """Offset and amplitude."""
        return f"{self.offset:g} ± {self.amplitude:g}"

    @property
    def bandwidth(self) -> float | None:
        """Where the gain is 3 dB under that of the lowest frequency [Hz]; None past the highest."""
        below = decibel(self.gain, float(self.gain[0])) + 3.0
        if below.min() > 0:
            return None
        k = int(np.argmax(below < 0))
        share = below[k - 1] / (below[k - 1] - below[k])
        low, high = self.frequency[k - 1 : k + 1]
        return float(low * (high / low) ** share)

    @property
    def last_slope(self) -> float:
        """Slope of the gain over the four highest frequencies [dB a decade]."""
        last = slice(-4, None)
        slope, _ = np.polyfit(np.log10(self.frequency[last]), decibel(self.gain[last]), 1)
        return float(slope)


def responses(
    joint: Joint,
    pair: tuple[str, str],
    conditions: Sequence[tuple[float, float]],
    starts: Sequence[float],
    frequency: float,
    timestep: float,
) -> _Values:
    """Gain, phase and coherence of every condition at one frequency, shape (conditions, 3)."""
    cycles = max(_CYCLES, ceil(_WINDOW * frequency))
    steps = round((_SETTLE + cycles / frequency) / timestep)
    time = np.asarray(np.arange(steps + 1) * timestep)
    # held over each step at the value of mid-step
    wave = np.sin(2 * pi * frequency * (time[:-1] + 0.5 * timestep))
    columns = [list(joint.muscles).index(name) for name in pair]
    inputs = np.zeros((len(conditions), steps, len(joint.muscles)))
    before = np.zeros((len(conditions), len(joint.muscles)))
    for i, (offset, amplitude) in enumerate(conditions):
        before[i, columns] = offset
        for column, sign in zip(columns, (1, -1), strict=True):
            inputs[i, :, column] = offset + sign * amplitude * wave
    moved = angles(
        [joint] * len(conditions),
        start=starts,
        before=before,
        excitation=inputs,
        steps=steps,
        timestep=timestep,
    )
    late = time >= _SETTLE - 0.5 * timestep
    drive = np.sin(2 * pi * frequency * time[late])
    rows = []
    for (_, amplitude), angle in zip(conditions, moved[:, late], strict=True):
        response = response_at(time[late], amplitude * drive, angle, frequency)
        rows.append((response.gain, response.phase, response.coherence))
    return np.array(rows)


def swept(offset: float, amplitude: float, band: _Values, table: _Values) -> Sweep:
    """A sweep from its gains, phases and coherences, shape (F, 3), at the frequencies of a band."""
    gain, phase, coherence = table[:, 0], np.unwrap(table[:, 1]), table[:, 2]
    fit, highest = second_order_band(band, gain, phase, decibels=DECIBELS, degrees=DEGREES)
    return Sweep(offset, amplitude, band, gain, phase, coherence, fit, highest)
