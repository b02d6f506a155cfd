"""The isometric twitch: the response of a muscle to one short full excitation (4.1.1, Fig. 5a)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from math import degrees
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.responses import half_life
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import legend_above, tidy, torque_unit
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometer import (
    active_torque,
    balancing_control,
    electrically_stimulated,
    stiff_machine,
)
from mjhill.lab.rig import (
    UnmeasuredError,
    as_joint,
    at_rest,
    build_rig,
    direction,
    record_run,
    strongest_angle,
)
from mjhill.lab.twitch import ACTION_POTENTIAL
from mjhill.literature.facts import read_entries
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal

_TWITCH_TIME = 1.0  # length of a run [s]
_TETANUS_TIME = 1.5  # [s]
_OVER = 0.05  # share of its peak that is left of a twitch that is over, at most
_DISTINCT = 2e-3  # two times differ if they are farther apart [s]; two samples
_MEASURES = {  # by measure in facts.toml: attribute, name, unit, factor from SI
    "twitch_contraction": ("contraction", "time to peak", "ms", 1e3),
    "twitch_half_relaxation": ("half_relaxation", "half relaxation", "ms", 1e3),
    "twitch_share": ("share", "peak, of tetanus", "%", 1e2),
}


@dataclass(frozen=True)
class MuscleTwitch:
    """A twitch of one muscle, at the joint angle of its largest force.

    Attributes:
        angle: The joint angle [rad].
        contraction: Time from the middle of the impulse to the peak of torque [s].
        half_relaxation: Time from the peak until torque is half of it [s].
        peak: Largest torque above that at rest [N·m].
        share: Peak, as a share of the largest torque under lasting full excitation [-].
        torque: Torque above that at rest, at ``recording.time`` [N·m], shape (T,).
        recording: The run.
    """

    angle: float
    contraction: float
    half_relaxation: float
    peak: float
    share: float
    torque: NDArray[np.float64]
    recording: Recording


def muscle_twitch(joint: Joint, muscle: str, *, width: float = ACTION_POTENTIAL) -> MuscleTwitch:
    """The twitch of a muscle after full excitation for ``width`` [s], on a dynamometer.

    By default the excitation is that of one action potential.
    The gauge reads 0 at rest, so that passive torque does not count.

    Raises:
        UnmeasuredError: Torque is still above half of its peak at the end of the run.
    """
    machine, angle = stiff_machine(joint), strongest_angle(joint, muscle)
    setup = build_rig(joint, machine=machine)
    signals: dict[str, Signal | float] = {
        "dynamometer": balancing_control(joint, machine, angle),
        # over each step its mean: the impulse need not last whole steps
        muscle: Signal(lambda t: min(max((width - t) / setup.timestep + 0.5, 0.0), 1.0)),
    }
    recording = record_run(setup, at_rest(setup, angle), _TWITCH_TIME, excitation=signals)
    reading = -direction(joint, muscle) * recording["dynamometer.force"]
    torque = reading - reading[0]
    half = half_life(recording.time, torque)
    if half is None:
        raise UnmeasuredError(f"{muscle} has not half relaxed {_TWITCH_TIME:g} s after the pulse")
    constant_path = np.full(round(_TETANUS_TIME / setup.timestep), angle)
    _, tetanus = active_torque(joint, machine, constant_path, muscle)
    top = int(torque.argmax())
    peak = float(torque[top])
    share = peak / float(tetanus.max())
    contraction = float(recording.time[top]) - 0.5 * width
    return MuscleTwitch(angle, contraction, half, peak, share, torque, recording)


@dataclass(frozen=True)
class Twitch(Result):
    """The twitch of each muscle of a joint.

    Attributes:
        joint: Name of the joint.
        twitches: Twitch after a neural impulse, by muscle.
        electrical: Twitch after an electrical impulse, which bypasses neural excitation, by muscle.
        width: Length of the impulse [s].
        stiffness: Stiffness of the dynamometer [N·m/rad].
        published: Published interval and source by muscle and measure, in the measure's unit.
        recordings: The twitches after a neural impulse, by muscle.
    """

    title: ClassVar[str] = "Isometric twitch"
    section: ClassVar[str] = "4.1.1, Fig. 5a"
    joint: str
    twitches: Mapping[str, MuscleTwitch]
    electrical: Mapping[str, MuscleTwitch]
    width: float
    stiffness: float
    published: Mapping[tuple[str, str], tuple[float, float, str]]
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    def measures(self) -> Iterator[Measure]:
        """Peak and times of each twitch."""
        for muscle, found in self.twitches.items():
            name, note = f"{muscle} twitch", f"at {round(degrees(found.angle))}°"
            yield Measure(f"{name}, peak torque", found.peak, "N·m", note=note)
            for measure, (attribute, words, unit, factor) in _MEASURES.items():
                low, high, source = self.published.get((muscle, measure), (None, None, ""))
                interval = None if low is None or high is None else (low, high)
                value = factor * getattr(found, attribute)
                yield Measure(f"{name}, {words}", value, unit, interval, source, note)
                value = factor * getattr(self.electrical[muscle], attribute)
                yield Measure(f"{name}, {words}, electrical stimulation", value, unit, note=note)
        yield Measure("stiffness of the dynamometer", self.stiffness, "N·m/rad")

    def claims(self) -> Iterator[Claim]:
        """The shape of a twitch, published twitches, and what electrical stimulation changes."""
        yield self._shape()
        yield self._agreement("twitch_contraction", "times of the peaks")
        yield self._agreement("twitch_share", "peak torques, as shares of tetanus,")
        pairs = {m: (found, self.electrical[m]) for m, found in self.twitches.items()}
        yield Claim(
            "Electrical stimulation bypasses neural excitation, so the muscle responds faster.",
            "4.1.2",
            all(one.contraction - other.contraction > _DISTINCT for one, other in pairs.values()),
            "; ".join(
                f"{muscle}: peak after {1e3 * other.contraction:.0f} instead of "
                f"{1e3 * one.contraction:.0f} ms and {other.peak / one.peak:.1f} times as high"
                for muscle, (one, other) in pairs.items()
            ),
        )

    def _shape(self) -> Claim:
        """Whether every twitch has one peak and ends."""
        left = {m: abs(float(found.torque[-1] / found.peak)) for m, found in self.twitches.items()}
        peaks = {m: _peaks(found.torque) for m, found in self.twitches.items()}
        return Claim(
            "The response to a neural impulse is a twitch: torque rises to one peak and dies away.",
            "4.1.1",
            all(left[m] < _OVER and peaks[m] == 1 for m in self.twitches),
            "; ".join(
                f"{m}: peaks: {peaks[m]}, left after {_TWITCH_TIME:g} s: {left[m]:.1%}"
                for m in self.twitches
            ),
        )

    def _agreement(self, measure: str, what: str) -> Claim:
        """Whether a measure of every twitch is inside the published interval."""
        attribute, _, unit, factor = _MEASURES[measure]
        inside, evidence = [], []
        for muscle, found in self.twitches.items():
            if (muscle, measure) not in self.published:
                continue
            low, high, source = self.published[muscle, measure]
            value = factor * getattr(found, attribute)
            inside.append(low <= value <= high)
            evidence.append(
                f"{muscle}: {value:.3g} {unit}, published {low:g} to {high:g} ({source})"
            )
        evidence.append("the numbers of 1970 are not in the paper; later ones replace them")
        return Claim(
            f"The {what} are almost those measured in human muscle (Buchthal & Schmalbruch 1970).",
            "4.1.1, Fig. 5a",
            all(inside) if inside else None,
            "; ".join(evidence) if inside else f"mjhill has no published twitch of {self.joint}",
        )

    def draw(self, figure: Any) -> None:
        """Torque over time, and as a share of its peak; the second muscle's downward."""
        from matplotlib.lines import Line2D

        absolute, scaled = figure.subplots(1, 2)
        highest = max(found.peak for found in self.electrical.values())
        factor, unit = torque_unit(highest)
        handles = []
        for index, muscle in enumerate(self.twitches):
            up, colour = 1 if index == 0 else -1, MUSCLE_COLOURS[index]
            handles.append(Line2D([], [], color=colour, label=spoken(muscle)))
            for found, style in ((self.twitches[muscle], "-"), (self.electrical[muscle], "--")):
                time, torque = 1e3 * found.recording.time, up * found.torque
                absolute.plot(time, factor * torque, color=colour, ls=style)
                scaled.plot(time, torque / found.peak, color=colour, ls=style)
        handles.append(Line2D([], [], color="0.4", ls="--", label="electrical stimulation"))
        absolute.set_ylabel(f"torque above rest [{unit}]")
        absolute.set_title(f"impulse of {1e3 * self.width:.3g} ms", fontsize=11)
        scaled.set_ylabel("torque, of its peak [-]")
        scaled.set_title("time course", fontsize=11)
        for axes in (absolute, scaled):
            axes.set_xlabel("time [ms]")
            axes.set_xlim(0, 1e3 * self._shown())
            axes.axhline(0, color="0.6", lw=0.8)
            tidy(axes)
        legend_above(figure, handles)

    def _shown(self) -> float:
        """Time to show: a little longer than the slowest twitch [s]."""
        over = [
            float(one.recording.time[np.flatnonzero(one.torque > 0.01 * one.peak)[-1]])
            for one in self.twitches.values()
        ]
        return min(1.2 * max(over), _TWITCH_TIME)


def twitch(
    joint: str | Joint = "ankle",
    *,
    width: float = ACTION_POTENTIAL,
    progress: Callable[[float], None] | None = None,
) -> Twitch:
    """The isometric twitch of each muscle of a joint, each at the angle of its largest force.

    Args:
        joint: The joint or its name.
        width: Length of the impulse, a full excitation [s].
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown, or the impulse is not positive and below half a run.
        UnmeasuredError: Torque is still above half of its peak at the end of the run.
    """
    subject = as_joint(joint)
    if not 0 < width < 0.5 * _TWITCH_TIME:
        raise ValueError(f"width must be in (0, {0.5 * _TWITCH_TIME:g}) s, got {width}")
    found: list[dict[str, MuscleTwitch]] = []
    for kind in (subject, electrically_stimulated(subject)):
        found.append({})
        for muscle in kind.muscles:
            found[-1][muscle] = muscle_twitch(kind, muscle, width=width)
            if progress:
                progress(sum(map(len, found)) / (2 * len(subject.muscles)))
    neural, electrical = found
    return Twitch(
        subject.name, neural, electrical, width, stiff_machine(subject).stiffness,
        _published(subject), {muscle: one.recording for muscle, one in neural.items()},
    )  # fmt: skip


def _published(joint: Joint) -> dict[tuple[str, str], tuple[float, float, str]]:
    """Published interval and source by muscle and measure."""
    return {
        (entry.muscle, entry.measure): (entry.low, entry.high, entry.source)
        for entry in read_entries()
        if entry.joint == joint.name and entry.measure in _MEASURES
    }


def _peaks(torque: NDArray[np.float64]) -> int:
    """Number of peaks of a torque; ripples below 1 % of the largest do not count."""
    rise = np.diff(np.round(torque / (0.01 * torque.max())))
    signs = np.sign(rise[rise != 0])
    return int(((signs[:-1] > 0) & (signs[1:] < 0)).sum())
