"""Sinusoidal excitations of two antagonists, out of phase (the paper's Fig. 8a).

The agonist, which pulls towards positive angles, gets the excitation ``offset + amplitude sin``,
its antagonist ``offset - amplitude sin``. The paper gives neither number. Here excitations stay in
[0, 1], so that they are not distorted, about a quarter of full co-contraction. Responses are
measured after the transient.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, degrees, pi
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.frequency import (
    SecondOrderFrequency,
    decibel,
    octaves,
    response_at,
    second_order_band,
)
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import every
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.joints.joint import Joint
from mjhill.lab.batch import joint_angles
from mjhill.lab.postures import resting_angle
from mjhill.lab.rig import Rig, antagonist, as_joint, at_rest, build_rig, record_run
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import constant, sinusoid

_SECOND_ORDER = (2.0, 5.0)  # the paper's limit of a second-order approximation [Hz]
_ABOUT = 1.01 * 2 ** (1 / 3)  # the spacing of the frequencies; 5.04 Hz is the one near 5
_SINUSOIDAL = 0.9  # least share of variance at the driving frequency of a sinusoid
_DECIBELS, _DEGREES = 3.0, 30.0  # largest errors of a second-order fit
_SETTLE, _CYCLES, _WINDOW = 6.0, 2, 2.0  # transient [s]; least cycles and time measured [s]
_FILMED, _CYCLES_FILMED = 2.0, 5  # [Hz], [-]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Sweep:
    """Frequency response at one offset and amplitude.

    Attributes:
        offset: Mean excitation of both muscles [-].
        amplitude: Amplitude of the sinusoids [-].
        frequency: Frequencies [Hz], shape (F,).
        gain: Angle over the excitation of the agonist [rad], shape (F,).
        phase: Phase of the angle, unwrapped [rad], shape (F,).
        coherence: Share of the angle's variance at the driving frequency [-], shape (F,).
        fit: Second-order fit of the widest band, from the lowest frequency, that it describes.
        highest: Highest frequency of that band [Hz]; 0 if there is none.
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
        """Frequency at which the gain is 3 dB below that of the lowest frequency [Hz].

        None if it is above the highest frequency.
        """
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


@dataclass(frozen=True)
class NeuralSinusoid(Result):
    """Frequency responses to sinusoidal excitations.

    Attributes:
        joint: Name of the joint.
        muscle: The agonist.
        amplitudes: Sweeps at one offset, by rising amplitude.
        offsets: Sweeps at one amplitude, by rising offset.
        recordings: A run at 2 Hz.
    """

    title: ClassVar[str] = "Neural sinusoids out of phase"
    section: ClassVar[str] = "4.2.3, Fig. 8a"
    size: ClassVar[tuple[float, float]] = (9.0, 6.6)
    joint: str
    muscle: str
    amplitudes: tuple[Sweep, ...]
    offsets: tuple[Sweep, ...]
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    def sweeps(self) -> dict[str, Sweep]:
        """Every sweep once, by name."""
        return {sweep.name: sweep for sweep in (*self.amplitudes, *self.offsets)}

    def measures(self) -> Iterator[Measure]:
        """Gain, bandwidth, second-order fit and distortion of every sweep."""
        for name, sweep in self.sweeps().items():
            lowest, gain = f"{sweep.frequency[0]:g} Hz", degrees(sweep.gain[0])
            yield Measure(f"{name}: gain at {lowest}", gain, "° per unit excitation")
            past = "" if sweep.bandwidth else "above the highest frequency"
            yield Measure(f"{name}: bandwidth (-3 dB)", sweep.bandwidth, "Hz", note=past)
            seen = sweep.highest or None
            none = "" if seen else "not even at the lowest frequencies"
            yield Measure(f"{name}: second order up to", seen, "Hz", note=none)
            if seen:
                fit = sweep.fit
                yield Measure(f"{name}: natural frequency", fit.natural_frequency, "Hz")
                yield Measure(f"{name}: damping ratio", fit.damping_ratio, "-")
            yield Measure(f"{name}: least coherence", float(sweep.coherence.min()), "-")

    def claims(self) -> Iterator[Claim]:
        """What sect. 4.2.3 says of neural sinusoids."""
        sweeps = self.sweeps()
        least = {name: float(sweep.coherence.min()) for name, sweep in sweeps.items()}
        yield Claim(
            "The angle is, to a first approximation, a sinusoid (here: at least "
            f"{_SINUSOIDAL:.0%} of its variance is at the driving frequency).",
            self.section,
            min(least.values()) >= _SINUSOIDAL,
            "; ".join(f"{name}: least {share:.1%}" for name, share in least.items()),
        )
        ends = {name: sweep.highest for name, sweep in sweeps.items()}
        low, high = _SECOND_ORDER[0] / _ABOUT, _SECOND_ORDER[1] * _ABOUT
        yield Claim(
            "A second-order approximation will do only below about 2 to 5 Hz.",
            self.section,
            all(low <= end <= high for end in ends.values()),
            f"one fit is within {_DECIBELS:g} dB and {_DEGREES:g}° up to "
            + "; ".join(f"{end:.2g} Hz at {name}" for name, end in ends.items()),
        )
        last = {name: degrees(sweep.phase[-1]) for name, sweep in sweeps.items()}
        slope = {name: sweep.last_slope for name, sweep in sweeps.items()}
        top = self.amplitudes[0].frequency[-1]
        yield Claim(
            "The whole response needs a system of higher order (here: at the highest frequency it "
            f"lags by more than the 180° of second order plus the allowed {_DEGREES:g}°).",
            self.section,
            max(last.values()) < -180 - _DEGREES,
            f"at {top:g} Hz: "
            + "; ".join(f"{n}: {last[n]:.0f}°, {slope[n]:.0f} dB a decade" for n in sweeps),
        )
        yield self._depends("amplitude", self.amplitudes)
        yield self._depends("offset", self.offsets)

    def _depends(self, what: str, sweeps: Sequence[Sweep]) -> Claim:
        gains = np.array([decibel(sweep.gain) for sweep in sweeps])
        phases = np.degrees([sweep.phase for sweep in sweeps])
        gain_range, phase_range = np.ptp(gains, axis=0), np.ptp(phases, axis=0)
        k, m = int(gain_range.argmax()), int(phase_range.argmax())
        frequency = sweeps[0].frequency
        return Claim(
            f"The response depends on the {what} of the sinusoids.",
            self.section,
            bool(gain_range[k] > _DECIBELS or phase_range[m] > _DEGREES),
            f"from {sweeps[0].name} to {sweeps[-1].name} gains differ by up to "
            f"{gain_range[k]:.1f} dB (at {frequency[k]:.2g} Hz) and phases by up to "
            f"{phase_range[m]:.0f}° (at {frequency[m]:.2g} Hz)",
        )

    def film(self) -> Recording | None:
        """The run at 2 Hz."""
        return next(iter(self.recordings.values()), None)

    def draw(self, figure: Any) -> None:
        """Bode plots by amplitude and by offset, with second-order fits."""
        columns = {"amplitude": self.amplitudes, "offset": self.offsets}
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
                axis.axvspan(*_SECOND_ORDER, color="0.5", alpha=0.12, lw=0)
        axes[0, 0].set_ylabel("gain [dB re 1° per unit excitation]")
        axes[1, 0].set_ylabel("phase [°]")
        axes[1, 0].yaxis.set_major_locator(every(90))
        axes[2, 0].set_ylabel("coherence")
        axes[2, 0].set_ylim(0, 1.1)


def neural_sinusoid(
    joint: str | Joint = "elbow",
    *,
    frequencies: Sequence[float] | None = None,
    offset: float = 0.25,
    amplitudes: Sequence[float] = (0.05, 0.1, 0.25),
    amplitude: float = 0.1,
    offsets: Sequence[float] = (0.1, 0.25, 0.5),
    progress: Callable[[float], None] | None = None,
) -> NeuralSinusoid:
    """Sweeps of frequency at several amplitudes about one offset, and about several offsets.

    Args:
        joint: The joint or its name.
        frequencies: Frequencies [Hz], ascending, at least four; by default 0.25 to 16, three an
            octave.
        offset: Mean excitation in the sweeps that differ in amplitude [-].
        amplitudes: Amplitudes about that offset [-], ascending.
        amplitude: Amplitude in the sweeps that differ in offset [-].
        offsets: Mean excitations [-], ascending.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown, an excitation would leave [0, 1], or the frequencies are
            not ascending between 0 and a tenth of the simulation's.
    """
    joint = as_joint(joint)
    rig = build_rig(joint)
    band = octaves(0.25, 16.0) if frequencies is None else np.asarray(frequencies, dtype=np.float64)
    by_amplitude = [(offset, float(a)) for a in amplitudes]
    by_offset = [(float(o), amplitude) for o in offsets]
    _check(band, by_amplitude, by_offset, rig.timestep)
    conditions = list(dict.fromkeys([*by_amplitude, *by_offset]))
    muscle = next(iter(joint.muscles))
    pair = (muscle, antagonist(joint, muscle))
    starts = [resting_angle(joint, dict.fromkeys(pair, mean)) for mean, _ in conditions]
    table = np.empty((len(band), len(conditions), 3))
    for k, frequency in enumerate(band.tolist()):
        table[k] = _responses(joint, pair, conditions, starts, frequency, rig.timestep)
        if progress:
            progress((k + 1) / len(band))
    sweeps = {one: _sweep(*one, band, table[:, i]) for i, one in enumerate(conditions)}
    middle = by_amplitude[len(by_amplitude) // 2]
    filmed = _filmed_run(rig, pair, *middle, starts[conditions.index(middle)])
    return NeuralSinusoid(
        joint.name,
        muscle,
        tuple(sweeps[one] for one in by_amplitude),
        tuple(sweeps[one] for one in by_offset),
        {f"{_FILMED:g} Hz": filmed},
    )


def _check(
    band: _Values,
    by_amplitude: Sequence[tuple[float, float]],
    by_offset: Sequence[tuple[float, float]],
    timestep: float,
) -> None:
    top = 0.1 / timestep
    if len(band) < 4 or not (np.diff(band) > 0).all() or not 0 < band[0] <= band[-1] <= top:
        raise ValueError(
            f"frequencies must be at least four, ascending, in (0, {top:g}] Hz, got {band.tolist()}"
        )
    for what, pairs in (("amplitudes", by_amplitude), ("offsets", by_offset)):
        if len(pairs) < 2 or pairs != sorted(set(pairs)):
            raise ValueError(f"{what} must be at least two, ascending, got {len(pairs)}: {pairs}")
    for offset, amplitude in (*by_amplitude, *by_offset):
        if not (amplitude > 0 and offset - amplitude >= 0 and offset + amplitude <= 1):
            raise ValueError(
                f"offset ± amplitude must stay in [0, 1], got {offset:g} ± {amplitude:g}"
            )


def _responses(
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
    # constant over each step, with the value at mid-step
    wave = np.sin(2 * pi * frequency * (time[:-1] + 0.5 * timestep))
    columns = [list(joint.muscles).index(name) for name in pair]
    excitation = np.zeros((len(conditions), steps, len(joint.muscles)))
    before = np.zeros((len(conditions), len(joint.muscles)))
    for i, (offset, amplitude) in enumerate(conditions):
        before[i, columns] = offset
        for column, sign in zip(columns, (1, -1), strict=True):
            excitation[i, :, column] = offset + sign * amplitude * wave
    angles = joint_angles(
        [joint] * len(conditions),
        start=starts,
        before=before,
        excitation=excitation,
        steps=steps,
        timestep=timestep,
    )
    late = time >= _SETTLE - 0.5 * timestep
    source = np.sin(2 * pi * frequency * time[late])
    rows = []
    for (_, amplitude), angle in zip(conditions, angles[:, late], strict=True):
        response = response_at(time[late], amplitude * source, angle, frequency)
        rows.append((response.gain, response.phase, response.coherence))
    return np.array(rows)


def _sweep(offset: float, amplitude: float, band: _Values, table: _Values) -> Sweep:
    """A sweep from gains, phases and coherences, shape (F, 3), at the frequencies of a band."""
    gain, phase, coherence = table[:, 0], np.unwrap(table[:, 1]), table[:, 2]
    fit, highest = second_order_band(band, gain, phase, decibels=_DECIBELS, degrees=_DEGREES)
    return Sweep(offset, amplitude, band, gain, phase, coherence, fit, highest)


def _filmed_run(
    rig: Rig, pair: tuple[str, str], offset: float, amplitude: float, start: float
) -> Recording:
    excitation = {
        name: constant(offset) + sinusoid(sign * amplitude, _FILMED)
        for name, sign in zip(pair, (1, -1), strict=True)
    }
    begin = at_rest(rig, start, dict.fromkeys(pair, offset))
    return record_run(rig, begin, _CYCLES_FILMED / _FILMED, excitation=excitation)


def _draw_sweep(gain: Any, phase: Any, coherence: Any, sweep: Sweep, colour: Any) -> None:
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
