"""External torque sinusoids on a joint that holds a bias or co-contracts (sect. 4.3.2, Fig. 8b).

One muscle holds a share of its largest torque against an equal constant torque from outside, or
both muscles contract against each other, while a small sinusoidal torque shakes the joint. The
paper states neither amplitude nor posture: here the torque is the one that deflects the relaxed
joint by 2°; the posture is the home angle if the joint stays there under every condition, else
where it is the steadiest. Beside it, at the middle co-contraction, the same joint is shaken by its
own muscles, whose inputs swing by a quarter of themselves, one against the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import degrees, radians
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.experiments.figures.external_sinusoid import draw
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.experiments.trials.sinusoids import Curve, shaken
from mjhill.joints.joint import Joint
from mjhill.lab.drives import bias_of, frequencies, held_drives, neural_drive
from mjhill.lab.frequency import decibel
from mjhill.lab.posture import (
    Unheld,
    balanced,
    check_angle,
    check_ascending,
    check_between,
    static_stiffness,
    steadiest,
)
from mjhill.lab.rig import UnmeasuredError, as_joint, as_muscle, rig

_COHERENT = 0.5  # least coherence of a neural response that is looked at
_APART = 6.0  # between two responses that differ [dB]: one is half of the other


@dataclass(frozen=True)
class ExternalSinusoid(Result):
    """Frequency responses of a held joint.

    Attributes:
        joint: Name of the joint.
        muscle: Which holds the bias.
        angle: The posture [rad].
        amplitude: Of the torque [N·m].
        bias: Responses under bias torques, ascending.
        cocontraction: Responses at co-contraction levels, ascending.
        neural: Response to the muscles' own inputs at the middle level; None where none is held.
        unheld: Conditions that the joint does not stay in, and why.
    """

    title: ClassVar[str] = "External torque sinusoids"
    section: ClassVar[str] = "4.3.2, Fig. 8b"
    size: ClassVar[tuple[float, float]] = (9.0, 7.5)
    joint: str
    muscle: str
    angle: float
    amplitude: float
    bias: tuple[Curve, ...]
    cocontraction: tuple[Curve, ...]
    neural: Curve | None
    unheld: tuple[Unheld, ...]

    def measures(self) -> Iterator[Measure]:
        """Of every response: gain at the lowest frequency, resonance, least coherence."""
        yield Measure("posture", degrees(self.angle), "°")
        yield Measure("amplitude of the torque", self.amplitude, "N·m")
        for curve in (*self.bias, *self.cocontraction):
            label, low = curve.drive.label, curve.frequency[0]
            note = "" if curve.resonance else "not within the band"
            yield Measure(f"gain at {low:.3g} Hz, {label}", degrees(curve.low_gain), "°/(N·m)")
            yield Measure(f"resonance, {label}", curve.resonance, "Hz", note=note)
            yield Measure(f"least coherence, {label}", float(curve.coherence.min()), "-")
        for one in self.unheld:
            yield Measure(f"response under {one.label}", None, "°/(N·m)", note=one.reason)

    def claims(self) -> Iterator[Claim]:
        """The three claims of the section."""
        what = "the gain at low frequencies falls and the resonance frequency rises."
        yield self._stiffens(f"With increasing bias torque {what}", self.bias)
        yield self._stiffens(f"With increasing voluntary resistance {what}", self.cocontraction)
        yield self._differs()

    def draw(self, figure: Any) -> None:
        """Gain, phase and coherence under bias torques and at co-contraction levels."""
        draw(self, figure)

    def _stiffens(self, sentence: str, curves: tuple[Curve, ...]) -> Claim:
        falls = all(a.low_gain > b.low_gain for a, b in pairwise(curves))
        found = [curve.resonance for curve in curves]
        seen = [one for one in found if one is not None]
        rises = all(a < b for a, b in pairwise(seen))
        undecided = len(curves) < 2 or (falls and rises and len(seen) < len(found))
        shown = ("not within the band" if one is None else f"{one:.3g} Hz" for one in found)
        return Claim(
            sentence,
            self.section,
            None if undecided else falls and rises,
            "; ".join(
                f"{curve.drive.label}: {degrees(curve.low_gain):.3g}°/(N·m), resonance {resonance}"
                for curve, resonance in zip(curves, shown, strict=True)
            ),
        )

    def _differs(self) -> Claim:
        sentence = "The response to an external oscillation differs from that to a neural one."
        if self.neural is None:
            return Claim(sentence, self.section, None, "no co-contraction is held")
        external = self.cocontraction[len(self.cocontraction) // 2]
        fall = [_fallen(curve) for curve in (external, self.neural)]
        heard = self.neural.coherence > _COHERENT
        apart = np.flatnonzero(heard & (fall[1] - fall[0] > _APART))
        at = int(apart[0]) if len(apart) else len(fall[0]) - 1
        lag = [-degrees(curve.phase[at]) for curve in (external, self.neural)]
        return Claim(
            sentence,
            self.section,
            len(apart) > 0,
            f"{external.drive.label}: from {external.frequency[0]:.3g} to "
            f"{external.frequency[at]:.3g} Hz the gain falls by {fall[0][at]:.1f} dB with a torque "
            f"and by {fall[1][at]:.1f} dB with an input ({_APART:g} dB apart is a factor of two), "
            f"there the angle lags the torque by {lag[0]:.0f}° and the input by {lag[1]:.0f}°",
        )


def _fallen(curve: Curve) -> NDArray[np.float64]:
    """By how much each gain is below that at the lowest frequency [dB]."""
    return -decibel(curve.gain, curve.low_gain)


def external_sinusoid(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    shares: Sequence[float] = (0.0, 0.1, 0.2, 0.4),
    levels: Sequence[float] = (0.02, 0.2, 0.5),
    band: tuple[float, float] | None = None,
    angle: float | None = None,
    deflection: float = radians(2.0),
    progress: Callable[[float], None] | None = None,
) -> ExternalSinusoid:
    """Shake a held joint at many frequencies.

    Args:
        joint: A joint or its name.
        muscle: Which holds the bias; the first without it.
        shares: Bias torques, of the largest that the muscle has in the posture, ascending [-].
        levels: Co-contraction [-], ascending.
        band: Lowest and highest frequency [Hz]; without it 0.3 to 30, or further so that it goes
            from half the natural frequency of the relaxed joint or below to ten times it; of a
            fast joint, not below a twentieth of it.
        angle: The posture [rad]; without it the home angle or, where the joint does not stay
            there under every condition, the angle where it is the steadiest.
        deflection: What the torque's amplitude deflects the relaxed joint by [rad].
        progress: Called now and then with the share done, 0 to 1.

    Raises:
        ValueError: The joint or the muscle is unknown or an option is out of range.
        UnmeasuredError: The joint stays in none of the conditions, or not where it is relaxed.
    """
    joint = as_joint(joint)
    muscle = as_muscle(joint, muscle)
    shares = check_ascending("shares", shares, -1e-9, 1.0)
    levels = check_ascending("levels", levels, 0.0, 1.0)
    check_angle(joint, angle)
    check_between("deflection", deflection, 0.0, 0.5 * (joint.range[1] - joint.range[0]), "rad")
    bias = {f"bias of {share:.0%}": (share, bias_of(joint, muscle, share)) for share in shares}
    both = {f"co-contraction {x:g}": (x, partial(balanced, joint, x)) for x in levels}
    if angle is None:
        angle = steadiest(joint, [condition for _, condition in (bias | both).values()])
    relaxed = static_stiffness(joint, {}, angle)
    if relaxed <= 0:
        raise UnmeasuredError(f"relaxed, {joint.name} drifts away from {degrees(angle):.3g}°")
    frequency = frequencies(joint, band, relaxed)
    held, unheld = held_drives(joint, bias | both, angle, relaxed * deflection)
    drives = list(held.values())
    contracting = [held[label] for label in both if label in held]
    if contracting:
        drives.append(neural_drive(joint, contracting[len(contracting) // 2]))
    curves = {
        curve.drive.label: curve
        for curve in shaken(rig(joint, exact=True), angle, drives, frequency)
    }
    if progress is not None:
        progress(1.0)
    return ExternalSinusoid(
        joint=joint.name,
        muscle=muscle,
        angle=angle,
        amplitude=relaxed * deflection,
        bias=tuple(curves[label] for label in bias if label in held),
        cocontraction=tuple(curves[label] for label in both if label in held),
        neural=curves.get("neural"),
        unheld=unheld,
    )
