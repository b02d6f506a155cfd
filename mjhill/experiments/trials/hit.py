"""A joint hit by a short torque, and how hits at several levels compare."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import degrees, log

from mjhill.experiments.trials.swing import Swing, first_swing
from mjhill.joints.joint import Joint
from mjhill.lab.rig import Rig, UnmeasuredError, rig, run, still
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal, pulse

_TRIES, _CLOSE = 8, 0.01  # of the search for an impulse, and how near is near enough
_GUESS = 0.1  # in which a first guess has the joint at its peak [s]
_STRONG = 2.0  # factor between the lowest and the highest level of what depends strongly on it
_SHRUNK = 0.5  # of a dependence that is to be called smaller: no more than half


@dataclass(frozen=True)
class Hit:
    """One hit of a joint at one level.

    Attributes:
        level: Co-contraction [-].
        impulse: [N·m·s].
        swing: The response as a second-order system, positive along the impulse.
        run: The recording.
    """

    level: float
    impulse: float
    swing: Swing
    run: Recording = field(repr=False)


@dataclass(frozen=True)
class Hammer:
    """What hits, and how.

    Attributes:
        angle: Where the joint is held [rad].
        sign: 1 for hits towards positive angles, -1 for hits towards negative ones.
        added_inertia: Of a body fixed to the limb [kg·m²].
        width: Of a hit [s].
        duration: Of a run [s].
    """

    angle: float
    sign: float
    added_inertia: float
    width: float
    duration: float

    def bench(self, joint: Joint) -> Rig:
        """The joint and the body."""
        return rig(joint, exact=True, added_inertia=self.added_inertia)

    def torque(self, impulse: float) -> Signal:
        """The torque [N·m] of a hit [N·m·s] from time 0."""
        return (self.sign * impulse / self.width) * pulse(1.0, 0.0, self.width)

    def hit(self, joint: Joint, level: float, inputs: Mapping[str, float], impulse: float) -> Hit:
        """Hit a joint that its inputs hold."""
        bench, name = self.bench(joint), joint.name
        start = still(bench, self.angle, inputs)
        done = run(bench, start, self.duration, torque=self.torque(impulse))
        deflection = self.sign * (done[f"{name}.angle"] - self.angle)
        velocity, load = (self.sign * done[f"{name}.{what}"] for what in ("velocity", "applied"))
        inertia = joint.inertia + self.added_inertia
        swing = first_swing(done.time, deflection, velocity, load, inertia)
        return Hit(level, impulse, swing, done)

    def impulse(
        self, joint: Joint, level: float, inputs: Mapping[str, float], peak: float
    ) -> float:
        """The impulse [N·m·s] that deflects a joint by ``peak`` [rad].

        Raises:
            UnmeasuredError: The search finds none.
        """
        guess = (joint.inertia + self.added_inertia) * peak / _GUESS
        for _ in range(_TRIES):
            reached = self.hit(joint, level, inputs, guess).swing.peak
            if abs(reached - peak) <= _CLOSE * peak:
                return guess
            guess *= peak / max(reached, 0.01 * peak)
        raise UnmeasuredError(f"no impulse deflects {joint.name} by {degrees(peak):.3g}°")


def at(hits: Sequence[Hit], text: Callable[[Swing], str]) -> str:
    """What to say of each hit."""
    return ", ".join(f"{text(hit.swing)} at {hit.level:g}" for hit in hits)


def impedance(swing: Swing) -> str:
    """K and B in words."""
    return f"K {swing.stiffness:.3g} N·m/rad and B {swing.damping:.3g} N·m·s/rad"


def falls(hits: Sequence[Hit]) -> bool:
    """Whether the peak falls from level to level."""
    return all(a.swing.peak > b.swing.peak for a, b in pairwise(hits))


def strongly_rises(values: Sequence[float]) -> bool:
    """Whether numbers rise from each to the next, and to twice the first or more."""
    return all(a < b for a, b in pairwise(values)) and values[-1] >= _STRONG * values[0]


def stiffens(hits: Sequence[Hit]) -> bool:
    """Whether K and B rise from level to level."""
    pairs = [(a.swing, b.swing) for a, b in pairwise(hits)]
    return all(a.stiffness < b.stiffness and a.damping < b.damping for a, b in pairs)


def rises(hits: Sequence[Hit]) -> tuple[float, float]:
    """K and B at the highest level over those at the lowest."""
    low, high = hits[0].swing, hits[-1].swing
    return high.stiffness / low.stiffness, high.damping / low.damping


def shrinks(steep: float, flat: float) -> bool:
    """Whether a rise that was there has become a small one."""
    return steep > 1 and flat > 0 and abs(log(flat)) <= _SHRUNK * log(steep)
