"""Bode plots: gain, phase and coherence against frequency, with second-order fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import every
from mjhill.lab.frequency import SecondOrderFrequency, decibel

_Values = NDArray[np.float64]


class Swept(Protocol):
    """What is drawn: a frequency response, and the second-order fit of its lower part."""

    @property
    def name(self) -> str:
        """For the legend."""

    @property
    def frequency(self) -> _Values:
        """[Hz]."""

    @property
    def gain(self) -> _Values:
        """Angle over the drive [rad per unit]."""

    @property
    def phase(self) -> _Values:
        """[rad]."""

    @property
    def coherence(self) -> _Values:
        """[-]."""

    @property
    def fit(self) -> SecondOrderFrequency:
        """Second-order fit."""

    @property
    def highest(self) -> float:
        """Frequency up to which it holds [Hz]."""


def draw_bode(
    figure: Any,
    columns: Mapping[str, Sequence[Swept]],
    *,
    gain_label: str,
    band: tuple[float, float] | None = None,
) -> None:
    """One column of axes for each series of sweeps: gain, phase, coherence.

    Args:
        figure: A Matplotlib figure.
        columns: Sweeps by what differs in them.
        gain_label: Label of the gain's axis, in dB of a degree.
        band: Frequencies to shade [Hz].
    """
    ratios = {"height_ratios": [3, 3, 1.2]}
    axes = figure.subplots(
        3, len(columns), sharex=True, sharey="row", squeeze=False, gridspec_kw=ratios
    )
    for column, (what, sweeps) in enumerate(columns.items()):
        gain, phase, coherence = axes[:, column]
        for sweep, colour in zip(sweeps, MUSCLE_COLOURS, strict=False):
            _draw_sweep(gain, phase, coherence, sweep, colour)
        gain.plot([], [], "--", color="0.3", lw=1.2, label="second-order fit")
        gain.set_title(f"by {what}", fontsize="medium")
        gain.legend(fontsize="small", loc="lower left")
        coherence.set_xlabel("frequency [Hz]")
        coherence.set_xscale("log")
        _mark_octaves(coherence, sweeps[0].frequency)
        for axis in axes[:, column]:
            axis.grid(alpha=0.3)
            if band:
                axis.axvspan(*band, color="0.5", alpha=0.12, lw=0)
    axes[0, 0].set_ylabel(gain_label)
    axes[1, 0].set_ylabel("phase [°]")
    axes[1, 0].yaxis.set_major_locator(every(90))
    axes[2, 0].set_ylabel("coherence")
    axes[2, 0].set_ylim(0, 1.1)


def _draw_sweep(gain: Any, phase: Any, coherence: Any, sweep: Swept, colour: Any) -> None:
    frequency = sweep.frequency
    gain.plot(
        frequency, decibel(np.degrees(sweep.gain)), "o-", ms=3.5, color=colour, label=sweep.name
    )
    phase.plot(frequency, np.degrees(sweep.phase), "o-", ms=3.5, color=colour)
    coherence.plot(frequency, sweep.coherence, "o-", ms=2.5, color=colour)
    shown = frequency[frequency <= 2 * sweep.highest]
    if len(shown):
        fitted = sweep.fit.response(shown)
        gain.plot(shown, decibel(np.degrees(np.abs(fitted))), "--", color=colour, lw=1.2)
        phase.plot(shown, np.degrees(np.unwrap(np.angle(fitted))), "--", color=colour, lw=1.2)


def _mark_octaves(axis: Any, frequency: _Values) -> None:
    from matplotlib.ticker import NullLocator

    low, high = np.log2(frequency[0]), np.log2(frequency[-1])
    marks = 2.0 ** np.arange(np.ceil(low - 1e-9), np.floor(high + 1e-9) + 1)
    axis.set_xticks(marks, [f"{mark:g}" for mark in marks])
    axis.xaxis.set_minor_locator(NullLocator())
