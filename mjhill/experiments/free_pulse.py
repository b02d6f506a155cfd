"""A free joint moved by a pulse of excitation (the paper's Fig. 7).

The joint starts at rest, at the angle at which it stays relaxed. A pulse of one muscle is varied in
width at full excitation and in excitation at one width; the antagonist stays relaxed.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import degrees
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.joints.joint import Joint
from mjhill.lab.batch import joint_angles
from mjhill.lab.postures import resting_angle, tonic_excitations
from mjhill.lab.rig import (
    UnmeasuredError,
    antagonist,
    as_joint,
    as_muscle,
    at_rest,
    build_rig,
    direction,
    record_run,
)
from mjhill.lab.variants import (
    AS_IT_IS,
    FAST,
    FLAT,
    LINEAR,
    SERIES,
    with_fast_muscles,
    with_flat_torque,
    with_linear_elasticity,
    with_linear_series,
)
from mjhill.muscles.readings import isometric_share
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal, pulse

_NEAR = 0.1  # relative difference up to which a ratio counts as a number
_HALF = 0.5  # a torque below that share of the isometric torque is low
_EARLY = 0.5  # a time in the early movement [time to peak velocity]
_VISIBLE = 1e-3  # least travel of which a ratio is taken [largest travel]

# of the movement by three bursts
_GOAL = 0.6  # where the joint shall stop [travel without clamping bursts]
_INSIDE = 0.8  # at most [way from rest to the end of the range of motion]
_SECOND = 0.5  # excitation of the agonist's second burst
_BRAKE_WIDTHS = np.linspace(0.1, 1.2, 45)  # tried for the antagonist [first burst]
_SECOND_WIDTHS = np.linspace(0.2, 1.0, 9)  # tried for the agonist's second burst [first burst]
_THERE, _END = 2.0, 6.0  # when the joint shall be there, and the end [first burst]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Pulse:
    """A pulse and the movement that it causes.

    Attributes:
        excitation: Excitation during the pulse [-].
        width: Duration of the pulse [s].
        time: Times [s], shape (T,).
        travel: Angle from the start, positive in the muscle's direction [rad], shape (T,).
    """

    excitation: float
    width: float
    time: _Values
    travel: _Values

    @property
    def name(self) -> str:
        """Excitation and width."""
        return f"{self.excitation:.0%} for {1e3 * self.width:g} ms"

    @property
    def velocity(self) -> _Values:
        """Velocity in the muscle's direction [rad/s], shape (T,)."""
        return np.asarray(np.gradient(self.travel, self.time))

    @property
    def peak_velocity(self) -> float:
        """Largest velocity [rad/s]."""
        return float(self.velocity.max())

    @property
    def amplitude(self) -> float:
        """Largest travel [rad]."""
        return float(self.travel.max())

    @property
    def time_to_peak_velocity(self) -> float:
        """Time to the largest velocity [s]."""
        return float(self.time[self.velocity.argmax()])

    @property
    def time_to_amplitude(self) -> float:
        """Time to the largest travel [s]."""
        return float(self.time[self.travel.argmax()])

    def measures(self) -> Iterator[Measure]:
        """Peaks and their times."""
        yield Measure(f"{self.name}: peak velocity", degrees(self.peak_velocity), "°/s")
        yield Measure(f"{self.name}: amplitude", degrees(self.amplitude), "°")
        yield Measure(f"{self.name}: time to peak velocity", 1e3 * self.time_to_peak_velocity, "ms")
        yield Measure(f"{self.name}: time to amplitude", 1e3 * self.time_to_amplitude, "ms")


@dataclass(frozen=True)
class FreePulse(Result):
    """Free movements by pulses.

    Attributes:
        joint: Name of the joint.
        muscle: The agonist.
        strengths: Pulses of one width, each with twice the excitation of the one before.
        widths: Pulses of full excitation, by rising width.
        pairs: The two strongest of ``strengths`` in the joint and in joints without one of its
            nonlinearities, by what is missing.
        torque_share: Torque of the muscle at the peak velocity of the strongest pulse, over its
            isometric torque at that activation and angle [-].
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
        """Travel of the strongest pulse over that of half its excitation, early in the movement."""
        return {name: ratio_at(*pair, self.early) for name, pair in self.pairs.items()}

    def late_ratios(self) -> dict[str, float]:
        """Amplitude of the strongest pulse over that of half its excitation."""
        return {name: high.amplitude / low.amplitude for name, (low, high) in self.pairs.items()}

    def _doubled_ratios(self, *names: str) -> dict[str, tuple[float, ...]]:
        """Ratios of attributes of two pulses, one with twice the excitation or twice the width."""
        wide = itertools.product(self.widths, self.widths)
        twice = [(one, other) for one, other in wide if np.isclose(other.width, 2 * one.width)]
        return {
            f"{low.name} to {high.name}": tuple(getattr(high, n) / getattr(low, n) for n in names)
            for low, high in [*pairwise(self.strengths), *twice]
        }

    def measures(self) -> Iterator[Measure]:
        """Peaks of every pulse, and how much twice the excitation adds."""
        for one in self.strengths[:-1] + self.widths:
            yield from one.measures()
        when = f"{1e3 * self.early:.0f} ms after the start"
        for name, ratio in self.early_ratios().items():
            yield Measure(f"travel at twice the excitation {when}, {name}", ratio, "times")
        for name, ratio in self.late_ratios().items():
            yield Measure(f"amplitude at twice the excitation, {name}", ratio, "times")
        note = "of isometric torque at that activation and angle"
        name = "torque of the muscle at peak velocity"
        yield Measure(name, 100 * self.torque_share, "%", note=note)

    def claims(self) -> Iterator[Claim]:
        """What sect. 4.2.1 says of pulses."""
        sizes = self._doubled_ratios("peak_velocity", "amplitude")
        yield Claim(
            "Superposition does not hold: twice the neural energy doubles neither the peak "
            "velocity nor the amplitude.",
            self.section,
            all(abs(ratio - 2) > 2 * _NEAR for pair in sizes.values() for ratio in pair),
            "; ".join(
                f"{name}: velocity x {velocity:.2f}, amplitude x {travel:.2f}"
                for name, (velocity, travel) in sizes.items()
            ),
        )
        times = self._doubled_ratios("time_to_peak_velocity", "time_to_amplitude")
        yield Claim(
            "Twice the neural energy does not halve the times to these peaks.",
            self.section,
            min(ratio for pair in times.values() for ratio in pair) > 0.5 * (1 + _NEAR),
            "; ".join(
                f"{name}: time to peak velocity x {velocity:.2f}, to amplitude x {travel:.2f}"
                for name, (velocity, travel) in times.items()
            ),
        )
        yield Claim(
            "Torque of the muscle is relatively low while the joint is fast (here: under half of "
            "what it would be isometrically).",
            self.section,
            self.torque_share < _HALF,
            f"{self.torque_share:.0%} of isometric torque at the peak velocity of "
            f"{self.strengths[-1].name}",
        )
        early, late = self.early_ratios(), self.late_ratios()
        off = {name: abs(ratio - 2) for name, ratio in early.items()}
        yield Claim(
            "Early in the movement the torque-velocity relation is the primary source of this.",
            self.section,
            off[FAST] < min(off[name] for name in (AS_IT_IS, SERIES, LINEAR, FLAT)),
            f"travel at twice the excitation {1e3 * self.early:.0f} ms after the start: "
            + _listed(early),
        )
        yield Claim(
            "Towards its end the primary sources are the parallel elasticity and the active "
            "torque-angle relation, the former above all.",
            self.section,
            # the joint that comes nearest to twice the amplitude lacks the main cause
            sorted(late, key=lambda name: abs(late[name] - 2))[:2] == [LINEAR, FLAT],
            "amplitude at twice the excitation: " + _listed(late),
        )

    def film(self) -> Recording | None:
        """A movement by three bursts, as in Fig. 7a."""
        return self.recordings.get("clamped")

    def draw(self, figure: Any) -> None:
        """Angle and velocity by excitation and by width, and travel at twice the excitation."""
        axes = figure.subplot_mosaic([["a", "b", "ratio"], ["c", "d", "ratio"]])
        end = 1.6e3 * max(one.time_to_amplitude for one in (*self.strengths, *self.widths))
        excitations = [f"{one.excitation:.0%}" for one in self.strengths]
        widths = [f"{1e3 * one.width:g} ms" for one in self.widths]
        _draw_column(axes["a"], axes["c"], self.strengths, excitations, end)
        _draw_column(axes["b"], axes["d"], self.widths, widths, end)
        axes["a"].set_title(f"for {1e3 * self.strengths[0].width:g} ms", fontsize="medium")
        axes["b"].set_title("at 100%", fontsize="medium")
        axes["a"].set_ylabel("angle from rest [°]")
        axes["c"].set_ylabel("velocity [°/s]")
        for left, right in ("ab", "cd"):
            axes[right].sharey(axes[left])
            axes[left].autoscale(axis="y")
        _draw_ratios(axes["ratio"], self.pairs)
        axes["ratio"].set_title(" over ".join(excitations[-1:-3:-1]), fontsize="medium")
        lines = {line.get_label(): line for line in axes["ratio"].get_lines()}
        figure.legend(lines.values(), lines, loc="outside lower center", ncols=3, fontsize="small")


def free_pulse(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    widths: Sequence[float] = (0.03, 0.06, 0.1, 0.2),
    excitations: Sequence[float] = (0.25, 0.5, 1.0),
    width: float = 0.1,
    duration: float = 1.5,
    progress: Callable[[float], None] | None = None,
) -> FreePulse:
    """Pulses of one muscle of a free joint at rest.

    Args:
        joint: The joint or its name.
        muscle: The agonist; by default the one that pulls towards positive angles.
        widths: Widths of the pulses of full excitation [s], ascending; the paper's are 30 to
            200 ms.
        excitations: Excitations of the pulses of one width [-], each twice the one before.
        width: Width of the pulses that differ in excitation [s].
        duration: Duration of each run [s]; the joint must be on its way back at the end.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint or muscle is unknown, or an option is out of range.
        UnmeasuredError: A joint still moves away at the end of ``duration``.
    """
    joint = as_joint(joint)
    muscle = as_muscle(joint, muscle)
    _check(widths, excitations, width, duration)
    report, rig = progress or (lambda _: None), build_rig(joint)
    tasks = [(float(u), width) for u in excitations] + [(1.0, float(w)) for w in widths]
    made = _pulses([joint] * len(tasks), muscle, tasks, duration, rig.timestep)
    report(0.3)
    strengths, wide = tuple(made[: len(excitations)]), tuple(made[len(excitations) :])
    pairs = _doublings(joint, muscle, strengths[-2], rig.timestep)
    report(0.5)
    strongest = strengths[-1]
    single = record_run(
        rig,
        at_rest(rig, resting_angle(joint)),
        min(duration, 2 * strongest.time_to_amplitude),
        excitation={muscle: pulse(strongest.excitation, 0.0, width)},
    )
    report(0.7)
    peak = strongest.time_to_peak_velocity
    clamped = _three_bursts(joint, muscle, peak, strongest.amplitude)
    report(1.0)
    share = _torque_share(joint, muscle, single, peak)
    recordings = {"single": single, "clamped": clamped}
    return FreePulse(joint.name, muscle, strengths, wide, pairs, share, recordings)


def ratio_over_time(low: Pulse, high: Pulse) -> tuple[_Values, _Values]:
    """Travel of ``high`` over that of ``low``, while both are visible, to the first amplitude.

    Returns:
        Times [s] and ratios [-], both of shape (N,).
    """
    end = int(min(high.travel.argmax(), low.travel.argmax()))
    start = int(np.argmax(low.travel > _VISIBLE * low.amplitude))
    part = slice(start, end + 1)
    return low.time[part], np.asarray(high.travel[part] / low.travel[part])


def ratio_at(low: Pulse, high: Pulse, time: float) -> float:
    """Travel of ``high`` over that of ``low`` at a time [s]."""
    first, second = (float(np.interp(time, one.time, one.travel)) for one in (low, high))
    return second / first


def _check(
    widths: Sequence[float], excitations: Sequence[float], width: float, duration: float
) -> None:
    if not (np.isfinite(duration) and duration > 0):
        raise ValueError(f"duration must be positive, got {duration} s")
    every = [*widths, width]
    if list(widths) != sorted(set(widths)) or not all(0 < one < duration for one in every):
        raise ValueError(
            f"widths must ascend and, like width, be in (0, {duration:g}) s, got {list(widths)} "
            f"and {width}"
        )
    twice = all(np.isclose(high, 2 * low) for low, high in pairwise(excitations))
    if len(excitations) < 2 or not twice or not 0 < excitations[0] <= excitations[-1] <= 1:
        raise ValueError(
            "excitations must be at least two, in (0, 1], each twice the one before, got "
            f"{list(excitations)}"
        )


def _pulses(
    joints: Sequence[Joint],
    muscle: str,
    tasks: Sequence[tuple[float, float]],
    duration: float,
    timestep: float,
) -> list[Pulse]:
    """A pulse of each excitation and width [s] in each joint, which starts at rest and relaxed."""
    steps = round(duration / timestep)
    middle = (np.arange(steps) + 0.5) * timestep
    excitation = np.zeros((len(joints), steps, len(joints[0].muscles)))
    for i, (u, width) in enumerate(tasks):
        # the step in which a pulse ends has the mean excitation
        share = np.clip((width - middle) / timestep + 0.5, 0.0, 1.0)
        excitation[i, :, list(joints[0].muscles).index(muscle)] = u * share
    rest = [resting_angle(joint) for joint in joints]
    angles = joint_angles(joints, start=rest, excitation=excitation, steps=steps, timestep=timestep)
    travels = direction(joints[0], muscle) * (angles - angles[:, :1])
    if (travels.argmax(axis=1) == steps).any():
        raise UnmeasuredError(
            f"{joints[0].name} still moves away {duration:g} s after the start of a pulse of "
            f"{muscle}; give a longer duration"
        )
    time = np.asarray(np.arange(steps + 1) * timestep)
    return [Pulse(*task, time, travel) for task, travel in zip(tasks, travels, strict=True)]


def _doublings(
    joint: Joint, muscle: str, low: Pulse, timestep: float
) -> dict[str, tuple[Pulse, Pulse]]:
    """A pulse and one of twice the excitation, in the joint and without each nonlinearity.

    Linear elasticity and flat torque are those with the same torque at the amplitude of ``low``.
    """
    joints = {
        AS_IT_IS: joint,
        FAST: with_fast_muscles(joint),
        SERIES: with_linear_series(joint),
        LINEAR: with_linear_elasticity(joint, muscle, low.amplitude),
        FLAT: with_flat_torque(joint, muscle, low.amplitude),
    }
    tasks = [(u, low.width) for _ in joints for u in (low.excitation, 2 * low.excitation)]
    pairs = [one for one in joints.values() for _ in range(2)]
    made = _pulses(pairs, muscle, tasks, float(low.time[-1]), timestep)
    return dict(zip(joints, zip(made[::2], made[1::2], strict=True), strict=True))


def _torque_share(joint: Joint, muscle: str, recording: Recording, time: float) -> float:
    """Force of a muscle at a time [s], over its isometric force at that moment."""
    at = int(np.searchsorted(recording.time, time))
    parameters = joint.hill_muscles[muscle]
    length = joint.gears[muscle] * float(recording[f"{joint.name}.angle"][at])
    isometric = isometric_share(parameters, float(recording[f"{muscle}.a"][at]), length)
    force = float(recording[f"{muscle}.force"][at])
    return force / (isometric * parameters.max_isometric_force)


def _three_bursts(joint: Joint, muscle: str, width: float, travel: float) -> Recording:
    """A movement from the angle of rest that ends at a new angle: agonist, antagonist, agonist.

    After the agonist's pulse in a fast voluntary movement, both muscles have clamping bursts
    (sect. 4.2.1). Their widths are not published. Here they are those that bring the joint to rest
    best; constant excitations then hold it.

    Args:
        joint: The joint.
        muscle: The agonist.
        width: Width of its first burst, of full excitation [s].
        travel: Travel by that burst alone [rad].
    """
    rig, sign, other = build_rig(joint), direction(joint, muscle), antagonist(joint, muscle)
    end = joint.range[1] if sign > 0 else joint.range[0]
    target = joint.rest_angle + sign * min(_GOAL * travel, _INSIDE * abs(end - joint.rest_angle))
    try:
        hold = tonic_excitations(joint, muscle, target)
    except UnmeasuredError:  # the joint then drifts back
        hold = dict.fromkeys(joint.muscles, 0.0)
    steps = round(_END * width / rig.timestep)
    times = ((np.arange(steps) + 0.5) * rig.timestep).tolist()
    trials = [
        _bursts(width, width * brake, width * second, hold[muscle], hold[other])
        for brake, second in itertools.product(_BRAKE_WIDTHS.tolist(), _SECOND_WIDTHS.tolist())
    ]
    excitation = np.zeros((len(trials), steps, len(joint.muscles)))
    for i, signals in enumerate(trials):
        for name, signal in zip((muscle, other), signals, strict=True):
            excitation[i, :, list(joint.muscles).index(name)] = [signal(time) for time in times]
    angles = joint_angles(
        [joint] * len(trials),
        start=joint.rest_angle,
        excitation=excitation,
        steps=steps,
        timestep=rig.timestep,
    )
    late = angles[:, round(_THERE * width / rig.timestep) :]
    best = trials[int(np.square(late - target).mean(axis=1).argmin())]
    excitations = dict(zip((muscle, other), best, strict=True))
    start = at_rest(rig, joint.rest_angle)
    return record_run(rig, start, _END * width, excitation=excitations)


def _bursts(
    width: float, brake: float, second: float, hold: float, other_hold: float
) -> tuple[Signal, Signal]:
    """Excitations of agonist and antagonist over time, and then those that hold the joint."""
    first, third = width + brake, width + brake + second

    def agonist(time: float) -> float:
        if time < width:
            return 1.0
        if time < first:
            return 0.0
        return _SECOND if time < third else hold

    def opposing(time: float) -> float:
        if time < third:
            return 1.0 if width <= time < first else 0.0
        return other_hold

    ends = (width, first, third)
    return Signal(agonist, ends), Signal(opposing, ends)


def _draw_column(
    angle: Any, velocity: Any, drawn: Sequence[Pulse], names: Sequence[str], end: float
) -> None:
    for one, name, colour in zip(drawn, names, MUSCLE_COLOURS, strict=False):
        time = 1e3 * one.time
        angle.plot(time, np.degrees(one.travel), color=colour, lw=1.8)
        velocity.plot(time, np.degrees(one.velocity), color=colour, lw=1.8, label=name)
    for axis in (angle, velocity):
        axis.set_xlim(0, end)
        axis.grid(alpha=0.3)
    velocity.set_xlabel("time [ms]")
    velocity.legend(fontsize="small", loc="upper right")


def _draw_ratios(axis: Any, pairs: Mapping[str, tuple[Pulse, Pulse]]) -> None:
    colours = ("black", *MUSCLE_COLOURS)
    for (name, pair), colour in zip(pairs.items(), colours, strict=False):
        time, ratio = ratio_over_time(*pair)
        axis.plot(1e3 * time, ratio, color=colour, lw=1.8, label=name)
    axis.axhline(2, color="black", lw=1, ls="--", label="superposition")
    axis.set_ylabel("ratio of angles from rest")
    axis.set_xlabel("time [ms]")
    axis.set_xlim(left=0)
    axis.set_ylim(1, 2.2)
    axis.grid(alpha=0.3)


def _listed(ratios: Mapping[str, float]) -> str:
    return ", ".join(f"x {ratio:.2f} {name}" for name, ratio in ratios.items())
