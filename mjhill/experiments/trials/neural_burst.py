"""A short neural transient during a movement and what the torque makes of it (Fig. 9c)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from mjhill.experiments.result import Claim, Measure
from mjhill.experiments.trials.hit import Hammer
from mjhill.joints.joint import Joint
from mjhill.lab.rig import UnmeasuredError, direction, run, still
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import pulse

_START, _WIDTH = 0.05, 0.04  # after a stretch, as a reflex of medium latency [s]
_COMPARED = 0.4  # from the hit on, in which input and torque are compared [s]
_LATEST = 0.2  # most that the torque is shifted against the input [s]
_FOLLOWS = sqrt(0.5)  # correlation at which input accounts for half of the variance of torque
_MOVES = 0.1  # of the largest change of torque, for a change that counts


@dataclass(frozen=True)
class Burst:
    """Input and torque of a muscle that is stretched by a hit and then gets a burst of input.

    Attributes:
        muscle: Which muscle gets it.
        start: Of the burst, after the start of the hit [s].
        width: Of the burst [s].
        height: What it adds to the input [-].
        correlation: Of torque with input over 0.4 s [-].
        shifted_correlation: The largest when torque is taken later than input [-].
        shift: By how much later that is [s].
        before: Largest change of the muscle's torque before the burst, over the largest of all [-].
        other: Largest change of the other muscles' torque, whose input is constant, over the same.
        delay: From the middle of the burst to the peak of what it adds to the torque [s].
        run: The recording.
        without: The recording of the same hit without a burst.
    """

    muscle: str
    start: float
    width: float
    height: float
    correlation: float
    shifted_correlation: float
    shift: float
    before: float
    other: float
    delay: float
    run: Recording = field(repr=False)
    without: Recording = field(repr=False)

    def measures(self) -> Iterator[Measure]:
        """How torque and input go together."""
        note = f"{self.muscle}, {1e3 * self.width:.0f} ms of input"
        yield Measure("correlation of torque with input", self.correlation, "-", note=note)
        yield Measure("the same, torque later", self.shifted_correlation, "-", note=note)
        yield Measure("by how much later", self.shift, "s", note=note)
        yield Measure("burst to peak of what it adds to the torque", self.delay, "s", note=note)
        yield Measure("change of torque before the burst, of the largest", self.before, "-")
        yield Measure("change of the other muscle's torque, of the largest", self.other, "-")

    def claim(self) -> Claim:
        """Whether torque follows input."""
        return Claim(
            "The muscles' torques do not follow transients of their neural inputs.",
            "4.3.1, Fig. 9c",
            self.correlation < _FOLLOWS and max(self.before, self.other) > _MOVES,
            f"{1e3 * self.width:.0f} ms of input and the torque of {self.muscle} correlate with "
            f"{self.correlation:.2f} ({_FOLLOWS:.2f} would be half of the variance; at best "
            f"{self.shifted_correlation:.2f}, {1e3 * self.shift:.0f} ms later), what it adds peaks "
            f"{1e3 * self.delay:.0f} ms after its middle; before it, with constant input, the "
            f"torque has changed by {self.before:.0%} of the largest change, that of the other "
            f"muscle, whose input stays constant, changes by {self.other:.0%}",
        )


def hit_with_burst(
    hammer: Hammer, joint: Joint, levels: Mapping[str, float], *, impulse: float, height: float
) -> Burst:
    """A hit, and 50 ms later a burst of 40 ms in the muscle that it stretches.

    Args:
        hammer: What hits.
        joint: The joint.
        levels: Inputs that hold it.
        impulse: Of the hit [N·m·s].
        height: What the burst adds to the input, less where the input would pass 1 [-].

    Raises:
        UnmeasuredError: The input is 1 already.
    """
    bench, torque = hammer.bench(joint), hammer.torque(impulse)
    muscle = next(name for name in levels if direction(joint, name) == -hammer.sign)
    height = min(height, 1.0 - levels[muscle])
    if height <= 0:
        raise UnmeasuredError(f"the input of {muscle} is full, so that no burst can be added to it")
    burst = levels[muscle] + pulse(height, _START, _WIDTH)
    runs = [
        run(
            bench,
            still(bench, hammer.angle, levels),
            hammer.duration,
            excitation=inputs,
            torque=torque,
        )
        for inputs in ({muscle: burst}, {})
    ]
    count = min(round(_COMPARED / bench.timestep), len(runs[0]))
    change = {name: runs[0][f"{name}.force"] - runs[0][f"{name}.force"][0] for name in levels}
    torque_change, control = change[muscle][:count], runs[0][f"{muscle}.u"][:count]
    largest = float(np.abs(change[muscle]).max())
    others = max(float(np.abs(change[name]).max()) for name in levels if name != muscle)
    added = (runs[0][f"{muscle}.force"] - runs[1][f"{muscle}.force"])[:count]
    shifts = range(round(_LATEST / bench.timestep) + 1)
    shifted = [_correlation(control[: count - k], torque_change[k:]) for k in shifts]
    best = int(np.argmax(shifted))
    return Burst(
        muscle=muscle,
        start=_START,
        width=_WIDTH,
        height=height,
        correlation=shifted[0],
        shifted_correlation=shifted[best],
        shift=best * bench.timestep,
        before=float(np.abs(torque_change[: round(_START / bench.timestep)]).max()) / largest,
        other=others / largest,
        delay=float(np.abs(added).argmax()) * bench.timestep - _START - 0.5 * _WIDTH,
        run=runs[0],
        without=runs[1],
    )


def _correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    return float(np.corrcoef(first, second)[0, 1])
