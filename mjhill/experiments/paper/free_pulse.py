"""A free joint moved by a pulse of neural input (the paper's Fig. 7).

The joint starts still, where it stays when relaxed. A pulse of one muscle is varied in width at
full strength and in strength at one width; its antagonist stays off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from mjhill.experiments.figures.free_pulse import draw_pulses
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.experiments.trials.bursts import clamped
from mjhill.experiments.trials.pulses import Pulse, doublings, pulses, ratio_at
from mjhill.joints.joint import Joint
from mjhill.lab.rest import resting_angle
from mjhill.lab.rig import as_joint, as_muscle, rig, run, still
from mjhill.lab.variants import AS_IT_IS, FAST, FLAT, LINEAR, SERIES
from mjhill.muscles.readings import isometric_share
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import pulse

_NEAR = 0.1  # share by which a ratio may miss its number and still count as it
_HALF = 0.5  # of the isometric torque; below it a torque is low
_EARLY = 0.5  # of the time to peak velocity


@dataclass(frozen=True)
class FreePulse(Result):
    """Free movements by pulses.

    Attributes:
        joint: Name of the joint.
        muscle: The agonist.
        strengths: Pulses of one width, each twice as strong as the one before.
        widths: Pulses of full strength, ascending in width.
        pairs: The two strongest of ``strengths`` in the joint and in joints that lack one of its
            nonlinearities, by what is lacking.
        torque_share: Torque of the muscle at the peak velocity of the strongest pulse, in units of
            its isometric torque at that activation and angle [-].
        recordings: The strongest pulse, and one clamped by two more bursts.
    """

    title: ClassVar[str] = "Free movement by a pulse"
    section: ClassVar[str] = "4.2.1, Fig. 7"
    size: ClassVar[tuple[float, float]] = (9.0, 5.6)
    joint: str
    muscle: str
    strengths: tuple[Pulse, ...]
    widths: tuple[Pulse, ...]
    pairs: Mapping[str, tuple[Pulse, Pulse]]
    torque_share: float
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    @property
    def early(self) -> float:
        """Half the time to the peak velocity of the strongest pulse [s]."""
        return _EARLY * self.strengths[-1].time_to_peak_velocity

    def early_ratios(self) -> dict[str, float]:
        """Travel of the strongest pulse over that of half its strength, early in the movement."""
        return {name: ratio_at(*pair, self.early) for name, pair in self.pairs.items()}

    def late_ratios(self) -> dict[str, float]:
        """Amplitude of the strongest pulse over that of half its strength."""
        return {name: high.amplitude / low.amplitude for name, (low, high) in self.pairs.items()}

    def doubled(self) -> Iterator[tuple[Pulse, Pulse]]:
        """Pulses with twice the strength or twice the width of another."""
        yield from pairwise(self.strengths)
        for one in self.widths:
            for other in self.widths:
                if np.isclose(other.width, 2 * one.width):
                    yield one, other

    def measures(self) -> Iterator[Measure]:
        """Peaks of every pulse, and how much twice the strength adds."""
        for one in self.strengths[:-1] + self.widths:
            yield from one.measures()
        when = f"{1e3 * self.early:.0f} ms after the start"
        for name, ratio in self.early_ratios().items():
            yield Measure(f"travel at twice the strength {when}, {name}", ratio, "times")
        for name, ratio in self.late_ratios().items():
            yield Measure(f"amplitude at twice the strength, {name}", ratio, "times")
        note = "of isometric torque at that activation and angle"
        name = "torque of the muscle at peak velocity"
        yield Measure(name, 100 * self.torque_share, "%", note=note)

    def claims(self) -> Iterator[Claim]:
        """What sect. 4.2.1 says of pulses."""
        doubled = list(self.doubled())
        ratios = [
            (high.peak_velocity / low.peak_velocity, high.amplitude / low.amplitude)
            for low, high in doubled
        ]
        yield Claim(
            "Superposition does not hold: twice the neural energy doubles neither the peak "
            "velocity nor the amplitude.",
            self.section,
            all(abs(ratio - 2) > 2 * _NEAR for pair in ratios for ratio in pair),
            "; ".join(
                f"{low.name} to {high.name}: velocity x {velocity:.2f}, amplitude x {travel:.2f}"
                for (low, high), (velocity, travel) in zip(doubled, ratios, strict=True)
            ),
        )
        yield _times(doubled)
        yield Claim(
            "Torque of the muscle is relatively low while the joint is fast (here: under half of "
            "what it would be isometrically).",
            self.section,
            self.torque_share < _HALF,
            f"{self.torque_share:.0%} of isometric torque at the peak velocity of "
            f"{self.strengths[-1].name}",
        )
        yield self._early_claim()
        yield self._late_claim()

    def _early_claim(self) -> Claim:
        ratios = self.early_ratios()
        off = {name: abs(ratio - 2) for name, ratio in ratios.items()}
        return Claim(
            "Early in the movement the torque-velocity relation is the primary source of this.",
            self.section,
            off[FAST] < min(off[name] for name in (AS_IT_IS, SERIES, LINEAR, FLAT)),
            f"travel at twice the strength {1e3 * self.early:.0f} ms after the start: "
            + _listed(ratios),
        )

    def _late_claim(self) -> Claim:
        ratios = self.late_ratios()
        off = {name: abs(ratio - 2) for name, ratio in ratios.items()}
        return Claim(
            "Towards its end the primary sources are the parallel elasticity and the active "
            "torque-angle relation, the former above all.",
            self.section,
            # what is nearest to twice as far is what lacks most of the cause
            sorted(off, key=lambda name: off[name])[:2] == [LINEAR, FLAT],
            "amplitude at twice the strength: " + _listed(ratios),
        )

    def draw(self, figure: Any) -> None:
        """Angle and velocity by strength and by width, and travel at twice the strength."""
        draw_pulses(figure, self.strengths, self.widths, self.pairs)

    def film(self) -> Recording | None:
        """A movement by three bursts, as in Fig. 7a."""
        return self.recordings.get("clamped")


def free_pulse(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    widths: Sequence[float] = (0.03, 0.06, 0.1, 0.2),
    levels: Sequence[float] = (0.25, 0.5, 1.0),
    width: float = 0.1,
    duration: float = 1.5,
    progress: Callable[[float], None] | None = None,
) -> FreePulse:
    """Pulses of one muscle of a free joint at rest.

    Args:
        joint: The joint or its name.
        muscle: The agonist; by default the one that pulls towards positive angles.
        widths: Of the pulses of full strength [s], ascending; the paper's are 30 to 200 ms.
        levels: Strengths of the pulses of one width [-], each twice the one before.
        width: Of the pulses that differ in strength [s].
        duration: Of each run [s], by when the joint must be on its way back.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint or muscle is unknown, or an option is out of bounds.
        UnmeasuredError: A movement has not come to its end in ``duration``.
    """
    joint = as_joint(joint)
    muscle = as_muscle(joint, muscle)
    _check(widths, levels, width, duration)
    told, bench = progress or (lambda _: None), rig(joint)
    tasks = [(float(level), width) for level in levels] + [(1.0, float(w)) for w in widths]
    made = pulses([joint] * len(tasks), muscle, tasks, duration, bench.timestep)
    told(0.3)
    strengths, wide = tuple(made[: len(levels)]), tuple(made[len(levels) :])
    pairs = doublings(joint, muscle, strengths[-2], bench.timestep)
    told(0.5)
    strongest = strengths[-1]
    single = run(
        bench,
        still(bench, resting_angle(joint)),
        min(duration, 2 * strongest.time_to_amplitude),
        excitation={muscle: pulse(strongest.level, 0.0, width)},
    )
    told(0.7)
    burst = strongest.time_to_peak_velocity
    recordings = {"single": single, "clamped": clamped(joint, muscle, burst, strongest.amplitude)}
    told(1.0)
    share = _torque_share(joint, muscle, single, burst)
    return FreePulse(joint.name, muscle, strengths, wide, pairs, share, recordings)


def _check(widths: Sequence[float], levels: Sequence[float], width: float, duration: float) -> None:
    if not (np.isfinite(duration) and duration > 0):
        raise ValueError(f"duration must be positive, got {duration} s")
    every = [*widths, width]
    if list(widths) != sorted(set(widths)) or not all(0 < one < duration for one in every):
        raise ValueError(
            f"widths must ascend and, like width, be in (0, {duration:g}) s, got {list(widths)} "
            f"and {width}"
        )
    twice = all(np.isclose(high, 2 * low) for low, high in pairwise(levels))
    if len(levels) < 2 or not twice or not 0 < levels[0] <= levels[-1] <= 1:
        raise ValueError(
            f"levels must be at least two, in (0, 1], each twice the one before, got {list(levels)}"
        )


def _torque_share(joint: Joint, muscle: str, recording: Recording, time: float) -> float:
    """Force of a muscle at a time [s], in units of its isometric force there."""
    at = int(np.searchsorted(recording.time, time))
    parameters = joint.muscles[muscle]
    length = joint.gears[muscle] * float(recording[f"{joint.name}.angle"][at])
    isometric = isometric_share(parameters, float(recording[f"{muscle}.a"][at]), length)
    force = float(recording[f"{muscle}.force"][at])
    return force / (isometric * parameters.max_isometric_force)


def _times(doubled: Sequence[tuple[Pulse, Pulse]]) -> Claim:
    ratios = [
        (
            high.time_to_peak_velocity / low.time_to_peak_velocity,
            high.time_to_amplitude / low.time_to_amplitude,
        )
        for low, high in doubled
    ]
    return Claim(
        "Twice the neural energy does not halve the times to these peaks.",
        FreePulse.section,
        min(ratio for pair in ratios for ratio in pair) > 0.5 * (1 + _NEAR),
        "; ".join(
            f"{low.name} to {high.name}: time to peak velocity x {velocity:.2f}, to amplitude "
            f"x {travel:.2f}"
            for (low, high), (velocity, travel) in zip(doubled, ratios, strict=True)
        ),
    )


def _listed(ratios: Mapping[str, float]) -> str:
    return ", ".join(f"x {ratio:.2f} {name}" for name, ratio in ratios.items())
