"""Antagonists driven out of phase by sinusoids of neural input (the paper's Fig. 8a).

The muscle that pulls towards positive angles gets ``offset + amplitude sin``, its antagonist
``offset - amplitude sin``. The paper states neither; here inputs stay inside [0, 1], so that the
drive itself is not distorted, around a quarter of full co-contraction. Responses are taken once the
transient has died away.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.experiments.figures.bode import draw_bode
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.experiments.trials.sweep import DECIBELS, DEGREES, Sweep, responses, swept
from mjhill.joints.joint import Joint
from mjhill.lab.frequency import decibel, octaves
from mjhill.lab.rest import resting_angle
from mjhill.lab.rig import Rig, antagonist, as_joint, rig, run, still
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import constant, sinusoid

_SECOND_ORDER = (2.0, 5.0)  # band of the paper, below which second order will do [Hz]
_ABOUT = 1.01 * 2 ** (1 / 3)  # the spacing of the frequencies; 5.04 Hz is the one near 5
_SINUSOIDAL = 0.9  # least share of variance at the driving frequency
_FILMED, _CYCLES_FILMED = 2.0, 5  # [Hz], [-]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class NeuralSinusoid(Result):
    """Frequency responses to neural input.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle that leads.
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
            lowest = f"{sweep.frequency[0]:g} Hz"
            yield Measure(f"{name}: gain at {lowest}", degrees(sweep.gain[0]), "° per unit input")
            past = "" if sweep.bandwidth else "past the highest frequency"
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
        yield self._second_order_claim()
        last = {name: degrees(sweep.phase[-1]) for name, sweep in sweeps.items()}
        slope = {name: sweep.last_slope for name, sweep in sweeps.items()}
        top = self.amplitudes[0].frequency[-1]
        yield Claim(
            "The whole response needs a system of higher order (here: it is late by more than the "
            f"180° of second order, and the {DEGREES:g}° allowed, at the highest frequency).",
            self.section,
            max(last.values()) < -180 - DEGREES,
            f"at {top:g} Hz: "
            + "; ".join(f"{n}: {last[n]:.0f}°, {slope[n]:.0f} dB a decade" for n in sweeps),
        )
        yield self._depends("amplitude", self.amplitudes)
        yield self._depends("offset", self.offsets)

    def _second_order_claim(self) -> Claim:
        ends = {name: sweep.highest for name, sweep in self.sweeps().items()}
        low, high = _SECOND_ORDER[0] / _ABOUT, _SECOND_ORDER[1] * _ABOUT
        return Claim(
            "A second-order approximation will do only below about 2 to 5 Hz.",
            self.section,
            all(low <= end <= high for end in ends.values()),
            f"one fit is within {DECIBELS:g} dB and {DEGREES:g}° up to "
            + "; ".join(f"{end:.2g} Hz at {name}" for name, end in ends.items()),
        )

    def _depends(self, what: str, sweeps: Sequence[Sweep]) -> Claim:
        levels = np.array([decibel(sweep.gain) for sweep in sweeps])
        turns = np.degrees([sweep.phase for sweep in sweeps])
        spread, turned = np.ptp(levels, axis=0), np.ptp(turns, axis=0)
        worst, late = int(spread.argmax()), int(turned.argmax())
        frequency = sweeps[0].frequency
        return Claim(
            f"The response depends on the {what} of the sinusoids.",
            self.section,
            bool(spread[worst] > DECIBELS or turned[late] > DEGREES),
            f"from {sweeps[0].name} to {sweeps[-1].name} gains differ by up to "
            f"{spread[worst]:.1f} dB (at {frequency[worst]:.2g} Hz) and phases by up to "
            f"{turned[late]:.0f}° (at {frequency[late]:.2g} Hz)",
        )

    def draw(self, figure: Any) -> None:
        """Bode plots by amplitude and by offset."""
        draw_bode(
            figure,
            {"amplitude": self.amplitudes, "offset": self.offsets},
            gain_label="gain [dB re 1° per unit input]",
            band=_SECOND_ORDER,
        )

    def film(self) -> Recording | None:
        """The run at 2 Hz."""
        return next(iter(self.recordings.values()), None)


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
        frequencies: [Hz], ascending, at least four; by default 0.25 to 16, three an octave.
        offset: Mean input in the sweeps that differ in amplitude [-].
        amplitudes: Amplitudes about that offset [-], ascending.
        amplitude: Amplitude in the sweeps that differ in offset [-].
        offsets: Mean inputs [-], ascending.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown, an input would leave [0, 1], or the frequencies are not
            ascending between 0 and a tenth of the simulation's.
    """
    joint = as_joint(joint)
    bench = rig(joint)
    band = octaves(0.25, 16.0) if frequencies is None else np.asarray(frequencies, dtype=np.float64)
    by_amplitude = [(offset, float(a)) for a in amplitudes]
    by_offset = [(float(o), amplitude) for o in offsets]
    _check(band, by_amplitude, by_offset, bench.timestep)
    conditions = list(dict.fromkeys([*by_amplitude, *by_offset]))
    muscle = next(iter(joint.muscles))
    pair = (muscle, antagonist(joint, muscle))
    starts = [resting_angle(joint, dict.fromkeys(pair, level)) for level, _ in conditions]
    table = np.empty((len(band), len(conditions), 3))
    for k, frequency in enumerate(band.tolist()):
        table[k] = responses(joint, pair, conditions, starts, frequency, bench.timestep)
        if progress:
            progress((k + 1) / len(band))
    sweeps = {one: swept(*one, band, table[:, i]) for i, one in enumerate(conditions)}
    middle = by_amplitude[len(by_amplitude) // 2]
    filmed = _filmed(bench, pair, *middle, starts[conditions.index(middle)])
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


def _filmed(
    bench: Rig, pair: tuple[str, str], offset: float, amplitude: float, start: float
) -> Recording:
    excitation = {
        name: constant(offset) + sinusoid(sign * amplitude, _FILMED)
        for name, sign in zip(pair, (1, -1), strict=True)
    }
    begin = still(bench, start, dict.fromkeys(pair, offset))
    return run(bench, begin, _CYCLES_FILMED / _FILMED, excitation=excitation)
