"""External torque sinusoids on a joint that holds a bias or co-contracts (sect. 4.3.2, Fig. 8b).

One muscle holds a share of its largest torque against an equal constant external torque, or both
muscles contract against each other, while a small sinusoidal torque acts on the joint. The paper
gives neither amplitude nor posture. Here the amplitude deflects the relaxed joint by 2°. The
posture is the home angle if the joint stays there under every condition, else the angle at which it
is most stable. For comparison, at the middle co-contraction, sinusoidal excitations drive the same
joint: each muscle's excitation varies by a quarter of its mean, one muscle against the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import degrees, pi, radians, sqrt
from typing import Any, ClassVar

import mujoco
import mujoco.batch
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.analysis.frequency import decibel, octaves, response_at
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.engine.install import installed
from mjhill.experiments.drawing import every, shades, tidy
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.joints.joint import Joint
from mjhill.lab.batch import CONTROL_AND_TORQUE, check_batch
from mjhill.lab.postures import (
    Condition,
    NotHeld,
    balancing_excitations,
    check_angle,
    check_ascending,
    check_between,
    stable_excitations,
    stablest_angle,
    static_stiffness,
)
from mjhill.lab.rig import (
    Rig,
    UnmeasuredError,
    as_joint,
    as_muscle,
    at_rest,
    build_rig,
    direction,
    net_torque,
)

_COHERENT = 0.5  # least coherence of a response that is used; below it drift is as large
_APART = 6.0  # least difference of two responses that differ [dB], a factor of two
_BAND = (0.3, 30.0)  # of most joints [Hz]
_VARIATION = 0.25  # amplitude of a neural oscillation, in units of the mean excitation
_ROWS = ("gain [dB re 1°/(N·m)]", "phase [°]", "coherence [-]")

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Oscillation:
    """A joint held at an angle, and what oscillates there: a torque or the excitations.

    Attributes:
        label: Its name, such as ``bias of 10 %``.
        excitations: Mean excitation of each muscle [-]; a constant external torque balances them.
        torque: Amplitude of the external torque [N·m].
        amplitudes: Amplitude of each muscle's excitation, with its sign [-]; None for a torque.
    """

    label: str
    excitations: Mapping[str, float]
    torque: float = 0.0
    amplitudes: Mapping[str, float] | None = None


@dataclass(frozen=True)
class Curve:
    """Frequency response of the joint angle to one oscillation.

    Attributes:
        oscillation: What oscillates.
        bias: Constant external torque that holds the joint [N·m].
        frequency: Frequencies [Hz], shape (F,).
        gain: Angle over torque [rad/(N·m)]; over ``amplitudes`` for a neural one [rad]; shape (F,).
        phase: Phase of the angle minus that of the oscillation, unwrapped [rad], shape (F,).
        coherence: Share of variance at the driving frequency [-], shape (F,).
    """

    oscillation: Oscillation
    bias: float
    frequency: _Values
    gain: _Values
    phase: _Values
    coherence: _Values

    @property
    def low_gain(self) -> float:
        """Gain at the lowest frequency."""
        return float(self.gain[0])

    @property
    def resonance(self) -> float | None:
        """Frequency of the largest velocity per torque [Hz]; None at an end of the band.

        In a second-order system this is the undamped natural frequency, whatever the damping.
        """
        speed = np.log(self.frequency * self.gain)
        top = int(speed.argmax())
        if top in (0, len(speed) - 1):
            return None
        # a parabola through the three highest points, in logarithms
        around = slice(top - 1, top + 2)
        second, first, _ = np.polyfit(np.log(self.frequency[around]), speed[around], 2)
        return float(np.exp(-first / (2 * second)))

    def attenuation(self) -> _Values:
        """How far each gain is below that at the lowest frequency [dB], shape (F,)."""
        return -decibel(self.gain, self.low_gain)


@dataclass(frozen=True)
class ExternalSinusoid(Result):
    """Frequency responses of a held joint.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle that holds the bias.
        angle: The posture [rad].
        amplitude: Amplitude of the torque [N·m].
        bias: Responses under bias torques, ascending.
        cocontraction: Responses at co-contractions, ascending.
        neural: Response to excitations at the middle co-contraction; None if none is held.
        not_held: Conditions in which the joint does not stay, and why.
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
    not_held: tuple[NotHeld, ...]

    def measures(self) -> Iterator[Measure]:
        """Gain at the lowest frequency, resonance and least coherence of every response."""
        yield Measure("posture", degrees(self.angle), "°")
        yield Measure("amplitude of the torque", self.amplitude, "N·m")
        for curve in (*self.bias, *self.cocontraction):
            label, low = curve.oscillation.label, curve.frequency[0]
            note = "" if curve.resonance else "not within the band"
            yield Measure(f"gain at {low:.3g} Hz, {label}", degrees(curve.low_gain), "°/(N·m)")
            yield Measure(f"resonance, {label}", curve.resonance, "Hz", note=note)
            yield Measure(f"least coherence, {label}", float(curve.coherence.min()), "-")
        for lost in self.not_held:
            yield Measure(f"response under {lost.label}", None, "°/(N·m)", note=lost.reason)

    def claims(self) -> Iterator[Claim]:
        """The three claims of the section."""
        what = "the gain at low frequencies falls and the resonance frequency rises."
        yield self._stiffens(f"With increasing bias torque {what}", self.bias)
        yield self._stiffens(f"With increasing voluntary resistance {what}", self.cocontraction)
        yield self._differs()

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
                f"{curve.oscillation.label}: {degrees(curve.low_gain):.3g}°/(N·m), "
                f"resonance {resonance}"
                for curve, resonance in zip(curves, shown, strict=True)
            ),
        )

    def _differs(self) -> Claim:
        sentence = "The response to an external oscillation differs from that to a neural one."
        if self.neural is None:
            return Claim(sentence, self.section, None, "no co-contraction is held")
        external = self.cocontraction[len(self.cocontraction) // 2]
        fall = [curve.attenuation() for curve in (external, self.neural)]
        coherent = self.neural.coherence > _COHERENT
        apart = np.flatnonzero(coherent & (fall[1] - fall[0] > _APART))
        at = int(apart[0]) if len(apart) else len(fall[0]) - 1
        lag = [-degrees(curve.phase[at]) for curve in (external, self.neural)]
        return Claim(
            sentence,
            self.section,
            len(apart) > 0,
            f"{external.oscillation.label}: from {external.frequency[0]:.3g} to "
            f"{external.frequency[at]:.3g} Hz the gain falls by {fall[0][at]:.1f} dB with a torque "
            f"and by {fall[1][at]:.1f} dB with excitations ({_APART:g} dB apart is a factor of "
            f"two); there the angle lags the torque by {lag[0]:.0f}° and the excitations by "
            f"{lag[1]:.0f}°",
        )

    def draw(self, figure: Any) -> None:
        """Gain, phase and coherence under bias torques and at co-contractions."""
        grid = figure.subplots(3, 2, sharex=True, sharey="row", height_ratios=(2, 1.6, 1))
        _draw_column(grid[:, 0], self.bias, f"bias held by the {spoken(self.muscle)}")
        _draw_column(grid[:, 1], self.cocontraction, "co-contraction")
        if self.neural is not None:
            # its gain is scaled to that of the torque at the lowest frequency
            external = self.cocontraction[len(self.cocontraction) // 2]
            highest = max(self.neural.oscillation.excitations.values())
            label = f"neural at {highest:g}, from the same gain"
            scale = external.low_gain / self.neural.low_gain
            style = {"color": MUSCLE_COLOURS[0], "ls": "--", "label": label}
            _draw_curve(grid[:, 1], self.neural, scale, **style)
        for row, label in zip(grid, _ROWS, strict=True):
            row[0].set_ylabel(label)
        low, high = grid[0, 0].get_ylim()
        grid[0, 0].set_ylim(low - 0.45 * (high - low), high)  # room for the legends
        for axes in grid[0]:
            if axes.lines:
                axes.legend(frameon=False, fontsize=8, loc="lower left")
        grid[1, 0].yaxis.set_major_locator(every(90))
        grid[2, 0].set_ylim(0, 1.05)
        figure.align_ylabels(grid)


def external_sinusoid(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    bias: Sequence[float] = (0.0, 0.1, 0.2, 0.4),
    cocontraction: Sequence[float] = (0.02, 0.2, 0.5),
    band: tuple[float, float] | None = None,
    angle: float | None = None,
    deflection: float = radians(2.0),
    progress: Callable[[float], None] | None = None,
) -> ExternalSinusoid:
    """Apply sinusoidal torques of many frequencies to a held joint.

    Args:
        joint: A joint or its name.
        muscle: The muscle that holds the bias; by default the first.
        bias: Excitations of that muscle, ascending [-].
        cocontraction: Co-contractions [-], ascending.
        band: Lowest and highest frequency [Hz]; by default 0.3 to 30, extended where needed to
            reach from half to ten times the natural frequency of the relaxed joint, with a lower
            end of at least a twentieth of it.
        angle: The posture [rad]; by default the home angle or, if the joint does not stay there
            under every condition, the angle at which it is most stable.
        deflection: Deflection of the relaxed joint by the torque's amplitude [rad].
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint or the muscle is unknown or an option is out of range.
        UnmeasuredError: The joint stays in none of the conditions, or not when relaxed.
    """
    joint = as_joint(joint)
    muscle = as_muscle(joint, muscle)
    bias = check_ascending("bias", bias, -1e-9, 1.0)
    cocontraction = check_ascending("cocontraction", cocontraction, 0.0, 1.0)
    check_angle(joint, angle)
    check_between("deflection", deflection, 0.0, 0.5 * (joint.range[1] - joint.range[0]), "rad")
    alone = {f"bias of {u:.0%}": _only(joint, muscle, u) for u in bias}
    both: dict[str, Condition] = {
        f"co-contraction {u:g}": partial(balancing_excitations, joint, u) for u in cocontraction
    }
    if angle is None:
        angle = stablest_angle(joint, list((alone | both).values()))
    relaxed = static_stiffness(joint, {}, angle)
    if relaxed <= 0:
        raise UnmeasuredError(f"relaxed, {joint.name} drifts away from {degrees(angle):.3g}°")
    frequency = _frequencies(joint, band, relaxed)
    held, not_held = _oscillations(joint, alone | both, angle, relaxed * deflection)
    middle = [held[label] for label in both if label in held]
    neural = [_neural(joint, one) for one in middle[len(middle) // 2 :][:1]]
    rig = build_rig(joint, exact=True)
    found = frequency_responses(rig, angle, [*held.values(), *neural], frequency)
    curves = {curve.oscillation.label: curve for curve in found}
    if progress is not None:
        progress(1.0)
    biased, contracted = (tuple(curves[x] for x in some if x in held) for some in (alone, both))
    neural_curve, amplitude = curves.get("neural"), relaxed * deflection
    return ExternalSinusoid(
        joint.name, muscle, angle, amplitude, biased, contracted, neural_curve, not_held
    )


def frequency_responses(
    rig: Rig, angle: float, oscillations: Sequence[Oscillation], frequency: ArrayLike
) -> list[Curve]:
    """Curve of each oscillation; one batch simulates every frequency of every oscillation.

    An oscillation grows smoothly over one cycle of the lowest frequency. The last whole cycles of
    the equally long rest are measured.

    Args:
        rig: The rig.
        angle: Angle at which the joint is held [rad].
        oscillations: What oscillates.
        frequency: Frequencies [Hz], shape (F,), ascending.

    Raises:
        UnmeasuredError: MuJoCo warned that a simulation went bad.
    """
    band = np.asarray(frequency, dtype=np.float64)
    timestep, count = rig.timestep, len(band)
    rise = round(1 / (band[0] * timestep))
    steps = 2 * rise + 1
    batch = mujoco.batch.Batch(rig.model, nsim=len(oscillations) * count)
    muscles = list(rig.joint.muscles)
    inputs = np.empty((len(oscillations) * count, steps, len(muscles) + 1))
    # constant over each step, with the value at mid-step
    waves = _waves(band, (np.arange(steps) + 0.5) * timestep, rise * timestep)
    biases = []
    for number, one in enumerate(oscillations):
        rows = slice(number * count, (number + 1) * count)
        start = at_rest(rig, angle, one.excitations)
        batch.qpos[rows], batch.qvel[rows], batch.act[rows] = angle, 0.0, start.act
        biases.append(-net_torque(rig.joint, one.excitations, angle))
        for column, name in enumerate(muscles):
            amplitude = (one.amplitudes or {}).get(name, 0.0)
            inputs[rows, :, column] = one.excitations.get(name, 0.0) + amplitude * waves
        inputs[rows, :, -1] = biases[-1] + one.torque * waves
    with installed():
        angles = batch.rollout(steps, inputs, CONTROL_AND_TORQUE)["qpos"][:, :, 0]
    check_batch(batch, rig.joint)
    # the batch gives the angles after each step
    time = (np.arange(steps) + 1) * timestep
    late, waves = slice(rise, None), _waves(band, time, rise * timestep)
    return [
        _curve(one, bias, band, time[late], waves[:, late], rows[:, late])
        for one, bias, rows in zip(
            oscillations, biases, angles.reshape(len(oscillations), count, steps), strict=True
        )
    ]


def _waves(band: _Values, time: _Values, rise: float) -> _Values:
    """Sinusoids that grow to amplitude 1 over a rise [s], shape (F, T)."""
    size = 0.5 - 0.5 * np.cos(pi * np.minimum(time / rise, 1.0))
    return np.asarray(size * np.sin(2 * pi * band[:, np.newaxis] * time))


def _curve(
    one: Oscillation, bias: float, band: _Values, time: _Values, waves: _Values, angles: _Values
) -> Curve:
    size = one.torque if one.amplitudes is None else 1.0
    found = [
        response_at(time, size * wave, angle, float(frequency))
        for frequency, wave, angle in zip(band, waves, angles, strict=True)
    ]
    return Curve(
        one,
        bias,
        band,
        gain=np.array([response.gain for response in found]),
        phase=np.unwrap([response.phase for response in found]),
        coherence=np.array([response.coherence for response in found]),
    )


def _frequencies(joint: Joint, band: tuple[float, float] | None, stiffness: float) -> _Values:
    """Three frequencies an octave [Hz]; a cycle of the highest has at least ten timesteps."""
    fastest = 0.1 / build_rig(joint).timestep
    if band is None:
        natural = sqrt(stiffness / joint.inertia) / (2 * pi)
        low = max(min(_BAND[0], 0.5 * natural), 0.05 * natural)
        band = low, min(max(_BAND[1], 10 * natural), fastest)
    if not 0.05 <= band[0] < band[1] <= fastest:
        raise ValueError(
            f"band must ascend within 0.05 to {fastest:g} Hz, got {band[0]} to {band[1]} Hz"
        )
    return octaves(*band)


def _only(joint: Joint, muscle: str, excitation: float) -> Condition:
    """One active muscle, whatever the angle."""
    return lambda angle: {**dict.fromkeys(joint.muscles, 0.0), muscle: excitation}


def _oscillations(
    joint: Joint, conditions: dict[str, Condition], angle: float, torque: float
) -> tuple[dict[str, Oscillation], tuple[NotHeld, ...]]:
    """A torque oscillation for each condition in which the joint stays, and the others."""
    held, lost = {}, []
    for label, condition in conditions.items():
        try:
            excitations = stable_excitations(joint, condition, angle)
        except UnmeasuredError as error:
            lost.append(NotHeld(label, str(error)))
        else:
            held[label] = Oscillation(label, excitations, torque)
    if not held:
        raise UnmeasuredError("; ".join(one.reason for one in lost))
    return held, tuple(lost)


def _neural(joint: Joint, held: Oscillation) -> Oscillation:
    """The same condition with oscillating excitations, first towards positive angles."""
    amplitudes = {m: _VARIATION * u * direction(joint, m) for m, u in held.excitations.items()}
    return Oscillation("neural", held.excitations, amplitudes=amplitudes)


def _draw_column(column: Any, curves: Sequence[Curve], title: str) -> None:
    for curve, shade in zip(curves, shades(len(curves)), strict=True):
        label = curve.oscillation.label.removeprefix("bias of ").removeprefix("co-contraction ")
        if curve.resonance:
            label += f", resonance {curve.resonance:.2g} Hz"
        _draw_curve(column, curve, color=shade, label=label)
    column[0].set_title(title, fontsize=10)
    column[-1].set_xlabel("frequency [Hz]")
    column[-1].set_xscale("log")
    column[-1].xaxis.set_major_formatter("{x:g}")
    for axes in column:
        tidy(axes)


def _draw_curve(column: Any, curve: Curve, scale: float = 1.0, **style: Any) -> None:
    shown = curve.coherence > _COHERENT
    column[0].plot(curve.frequency[shown], decibel(scale * np.degrees(curve.gain[shown])), **style)
    column[1].plot(curve.frequency[shown], np.degrees(curve.phase[shown]), **style)
    column[2].plot(curve.frequency, curve.coherence, **style)
