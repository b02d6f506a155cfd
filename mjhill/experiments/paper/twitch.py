"""The isometric twitch: a muscle's answer to one short full input (sect. 4.1.1, Fig. 5a)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from math import degrees
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.figures.drawing import legend_above, tidy, torque_unit
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.experiments.trials.muscle_twitch import PULSE, TWITCH_TIME, MuscleTwitch, muscle_twitch
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometry import stiff_machine, stimulated
from mjhill.lab.rig import as_joint
from mjhill.literature.facts import read_entries
from mjhill.simulate.recording import Recording

_OVER = 0.05  # of its peak: what a twitch that is over has left at most
_TOLD_APART = 2e-3  # [s]; two samples
_MEASURES = {  # of the file of published facts: field, name, unit, factor from SI
    "twitch_contraction": ("contraction", "time to peak", "ms", 1e3),
    "twitch_half_relaxation": ("half_relaxation", "half relaxation", "ms", 1e3),
    "twitch_share": ("share", "peak, of tetanus", "%", 1e2),
}


@dataclass(frozen=True)
class Twitch(Result):
    """The twitch of each muscle of a joint.

    Attributes:
        joint: Name of the joint.
        twitches: By muscle, to a neural impulse.
        electrical: By muscle, to an electrical impulse, which bypasses neural excitation.
        width: Of the impulse [s].
        stiffness: Of the dynamometer [N·m/rad].
        published: Interval and source by muscle and measure, in the unit of the measure.
        recordings: The twitches to a neural impulse, by muscle.
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
        """A twitch, its agreement with published ones, and what electrical stimulation does."""
        yield self._shape()
        yield self._agreement("contraction", "twitch_contraction", "times of the peaks")
        yield self._agreement("share", "twitch_share", "peak torques, as shares of tetanus,")
        first, second = self.twitches, self.electrical
        evidence = "; ".join(
            f"{muscle}: peak after {1e3 * second[muscle].contraction:.0f} instead of "
            f"{1e3 * found.contraction:.0f} ms and {second[muscle].peak / found.peak:.1f} times as "
            "high"
            for muscle, found in first.items()
        )
        yield Claim(
            "Electrical stimulation bypasses neural excitation, so the muscle responds faster.",
            "4.1.2",
            all(
                found.contraction - second[muscle].contraction > _TOLD_APART
                for muscle, found in first.items()
            ),
            evidence,
        )

    def _shape(self) -> Claim:
        left = {
            muscle: abs(float(found.torque[-1] / found.peak))
            for muscle, found in self.twitches.items()
        }
        peaks = {muscle: _peaks(found.torque) for muscle, found in self.twitches.items()}
        evidence = "; ".join(
            f"{muscle}: peaks: {peaks[muscle]}, left after {TWITCH_TIME:g} s: {left[muscle]:.1%}"
            for muscle in self.twitches
        )
        return Claim(
            "The response to a neural impulse is a twitch: torque rises to one peak and dies away.",
            "4.1.1",
            all(left[muscle] < _OVER and peaks[muscle] == 1 for muscle in self.twitches),
            evidence,
        )

    def _agreement(self, attribute: str, measure: str, what: str) -> Claim:
        """Whether a measure of every twitch is inside the interval that is published."""
        _, _, unit, factor = _MEASURES[measure]
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
        return Claim(
            f"The {what} are almost those measured in human muscle (Buchthal & Schmalbruch 1970).",
            "4.1.1, Fig. 5a",
            all(inside) if inside else None,
            "; ".join(evidence)
            + "; the numbers of 1970 are not in the paper, others stand for them"
            if inside
            else f"no published twitch of {self.joint} is at hand",
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
                time, torque = 1e3 * found.run.time, up * found.torque
                absolute.plot(time, factor * torque, color=colour, ls=style)
                scaled.plot(time, torque / found.peak, color=colour, ls=style)
        handles.append(Line2D([], [], color="0.4", ls="--", label="electrical stimulation"))
        absolute.set_ylabel(f"torque above rest [{unit}]")
        absolute.set_title(f"impulse of {1e3 * self.width:g} ms", fontsize=11)
        scaled.set_ylabel("torque, of its peak [-]")
        scaled.set_title("time course", fontsize=11)
        for axes in (absolute, scaled):
            axes.set_xlabel("time [ms]")
            axes.set_xlim(0, 1e3 * self._shown())
            axes.axhline(0, color="0.6", lw=0.8)
            tidy(axes)
        legend_above(figure, handles)

    def _shown(self) -> float:
        """When the slowest twitch is over, and a little more [s]."""
        over = [
            float(one.run.time[np.flatnonzero(one.torque > 0.01 * one.peak)[-1]])
            for one in self.twitches.values()
        ]
        return min(1.2 * max(over), TWITCH_TIME)


def twitch(
    joint: str | Joint = "ankle",
    *,
    width: float = PULSE,
    progress: Callable[[float], None] | None = None,
) -> Twitch:
    """The isometric twitch of each muscle of a joint, each at the angle of its largest force.

    Args:
        joint: The joint, or the name of one.
        width: Of the impulse, full neural input [s].
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown, or the impulse is not positive and below half a run.
        UnmeasuredError: A muscle has not half relaxed by the end of the run.
    """
    subject = as_joint(joint)
    if not 0 < width < 0.5 * TWITCH_TIME:
        raise ValueError(f"width must be in (0, {0.5 * TWITCH_TIME:g}) s, got {width}")
    subjects = (subject, stimulated(subject))
    found: list[dict[str, MuscleTwitch]] = [{}, {}]
    for count, (kind, muscle) in enumerate(
        ((kind, muscle) for kind in (0, 1) for muscle in subject.muscles), 1
    ):
        found[kind][muscle] = muscle_twitch(subjects[kind], muscle, width=width)
        if progress:
            progress(count / (2 * len(subject.muscles)))
    return Twitch(
        subject.name, found[0], found[1], width, stiff_machine(subject).stiffness,
        _published(subject), {muscle: one.run for muscle, one in found[0].items()},
    )  # fmt: skip


def _published(joint: Joint) -> dict[tuple[str, str], tuple[float, float, str]]:
    """Published intervals by muscle and measure."""
    return {
        (entry.muscle, entry.measure): (entry.low, entry.high, entry.source)
        for entry in read_entries()
        if entry.joint == joint.name and entry.measure in _MEASURES
    }


def _peaks(torque: NDArray[np.float64]) -> int:
    """How often a torque turns from rising to falling, ripples below 1 % of the peak left out."""
    rise = np.diff(np.round(torque / (0.01 * torque.max())))
    signs = np.sign(rise[rise != 0])
    return int(((signs[:-1] > 0) & (signs[1:] < 0)).sum())
