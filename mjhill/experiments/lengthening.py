"""A contracted muscle that is stretched at constant velocity: what a Hill model does (sect. 5)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees, isfinite, radians
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import tidy, torque_unit
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometer import (
    active_torque,
    check_velocity,
    clamped_path,
    contractile_torque,
    ramp_time,
    record_path,
    stiff_machine,
    travel_time,
)
from mjhill.lab.rig import Dynamometer, as_joint, as_muscle, build_rig, direction
from mjhill.simulate.recording import Recording

_SHARES = (0.02, 0.05, 0.1, 0.2, 0.5)  # of the contractile element's largest velocity
_PLATEAU = 1.3  # the paper's, of isometric torque
_NEAR = 0.05  # of isometric torque: a difference that counts at the plateau, and as a yield
_LASTING = 0.01  # of isometric torque: a difference that counts after the stretch

_BEFORE = 0.1  # isometric time before a stretch [s]
_AFTER = 1.5  # isometric time after it [s]
_SETTLING = 5e-3  # of the machine, once it has reached its velocity [s]
_ISOMETRIC_TIME = 0.3  # of a muscle that is steady from the start [s]
_GRID = 25  # angles at which isometric torque is measured
_FILMED_AFTER = 0.5  # time after a stretch in its film [s]
_DRAWN_AFTER = 0.4  # time after a stretch in the figure [s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Stretch:
    """One stretch of a muscle that is steadily contracted.

    Attributes:
        excitation: Excitation of the muscle [-].
        velocity: Joint velocity, positive [rad/s].
        time: Time from the start of the stretch [s], shape (T,).
        stretched: How far the machine has moved [rad], shape (T,).
        torque: Active torque [N·m], shape (T,).
        relative: Torque over the isometric one at the same angle and excitation [-], shape (T,).
        steady_from: When the machine has settled at its velocity [s].
        stop: When it stops [s].
        contractile: Torque of the contractile element alone at this velocity, at the end of the
            stretch, over its isometric torque [-].
    """

    excitation: float
    velocity: float
    time: _Values
    stretched: _Values
    torque: _Values
    relative: _Values
    steady_from: float
    stop: float
    contractile: float

    @property
    def during(self) -> _Values:
        """Relative torque while the machine moves at constant velocity."""
        return self.relative[(self.time >= self.steady_from) & (self.time < self.stop)]

    @property
    def end(self) -> float:
        """Relative torque at the end of the stretch [-]."""
        return float(self.during[-1])

    @property
    def fall(self) -> float:
        """Largest fall of relative torque from a peak during the stretch [-]."""
        return float((np.maximum.accumulate(self.during) - self.during).max())

    @property
    def residual(self) -> float:
        """Relative torque above the isometric one 1.5 s after the stretch [-]."""
        return float(self.relative[-1]) - 1.0

    def recovery(self, band: float) -> float | None:
        """Time after the stretch from which torque stays within ``band`` of isometric [s].

        None where it has not come back by the end of the run.
        """
        after = self.time >= self.stop
        outside = np.flatnonzero(np.abs(self.relative[after] - 1.0) > band)
        if not len(outside):
            return 0.0
        back = self.time[after][outside[-1] + 1 :]
        return float(back[0] - self.stop) if len(back) else None


def _path(start: float, end: float, velocity: float, timestep: float) -> tuple[_Values, _Values]:
    """Time from the start of a stretch [s] and angle of the machine [rad], shape (T,) each."""
    duration = _BEFORE + travel_time(end - start, velocity) + _AFTER
    time = np.asarray(timestep * np.arange(round(duration / timestep)) - _BEFORE, dtype=np.float64)
    return time, clamped_path(start, end, velocity, np.maximum(time, 0.0))


def _stretch(
    joint: Joint,
    machine: Dynamometer,
    muscle: str,
    *,
    start: float,
    end: float,
    velocity: float,
    excitation: float,
) -> Stretch:
    """Stretch a muscle at constant excitation once, from one angle [rad] to another.

    The other muscles stay relaxed. Isometric torque is measured at 25 angles on the way.
    """
    timestep, travel = build_rig(joint).timestep, end - start
    time, path = _path(start, end, velocity, timestep)
    steady = {"before": excitation, "excitation": excitation}
    _, torque = active_torque(joint, machine, path, muscle, **steady)
    grid = np.linspace(start, end, _GRID)
    constant_paths = np.repeat(grid[:, np.newaxis], round(_ISOMETRIC_TIME / timestep), axis=1)
    _, isometric = active_torque(joint, machine, constant_paths, muscle, **steady)
    stretched = np.abs(path - start)
    reference = np.interp(stretched, np.abs(grid - start), isometric[:, -1])
    moving, still = (
        contractile_torque(joint, muscle, excitation, end, v) for v in (-velocity, 0.0)
    )
    return Stretch(
        excitation, velocity, time, stretched, torque[0], torque[0] / reference,
        ramp_time(travel, velocity) + _SETTLING, travel_time(travel, velocity), moving / still,
    )  # fmt: skip


@dataclass(frozen=True)
class Lengthening(Result):
    """Stretches of one muscle at several excitations and velocities.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle.
        start: Angle at which each stretch starts [rad].
        end: Angle at which it ends [rad].
        stretches: Stretches by excitation, both ascending, then by ascending velocity.
        stiffness: Stiffness of the dynamometer [N·m/rad].
        recordings: A stretch at the highest excitation and a medium velocity.
    """

    title: ClassVar[str] = "Lengthening contraction"
    section: ClassVar[str] = "3.2, 5"
    size: ClassVar[tuple[float, float]] = (9.0, 7.6)
    joint: str
    muscle: str
    start: float
    end: float
    stretches: Mapping[float, tuple[Stretch, ...]]
    stiffness: float
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    def measures(self) -> Iterator[Measure]:
        """Torque at the end of each stretch, and its return."""
        for one in self._all():
            velocity = degrees(one.velocity)
            at = f"{self.muscle} at {one.excitation:g}, stretched at {velocity:.0f}°/s"
            yield Measure(f"{at}, torque at its end", one.end, "-", note="of isometric torque")
            back = one.recovery(_LASTING)
            after = None if back is None else 1e3 * back
            note = "" if after is not None else f"not within {_AFTER:g} s"
            yield Measure(f"{at}, back to within 1 % of isometric after", after, "ms", note=note)
            yield Measure(f"{at}, above isometric {_AFTER:g} s later", 1e2 * one.residual, "%")
        yield Measure("stretch", degrees(abs(self.end - self.start)), "°")
        yield Measure("stiffness of the dynamometer", self.stiffness, "N·m/rad")

    def claims(self) -> Iterator[Claim]:
        """The plateau of the model, and what it lacks compared with real muscle."""
        yield self._plateau()
        worst = max(self._all(), key=lambda one: one.fall)
        yield Claim(
            "A Hill-type model does not show the transients of stretched muscle: it never yields.",
            "5",
            worst.fall < _NEAR,
            f"during the stretch torque never falls by more than {worst.fall:.1%} of isometric "
            f"(at excitation {worst.excitation:g}, {degrees(worst.velocity):.0f}°/s)",
        )
        last = max(self._all(), key=lambda one: abs(one.residual))
        times = [one.recovery(_LASTING) for one in self._all()]
        seen = [time for time in times if time is not None]
        back = f"at most {1e3 * max(seen):.0f} ms" if len(seen) == len(times) else "not always"
        yield Claim(
            "It does not keep extra force after a stretch, as real muscle does.",
            "5",
            abs(last.residual) < _LASTING,
            f"time to come back to within 1 % of isometric: {back}; {_AFTER:g} s after the "
            f"stretch it is {abs(last.residual):.2%} off at most",
        )

    def _plateau(self) -> Claim:
        """Whether torque rises with velocity to 1.3 of isometric and no higher."""
        ends = [[one.end for one in found] for found in self.stretches.values()]
        rises = all((np.diff(values) > 0).all() for values in ends)
        evidence = "; ".join(
            f"excitation {excitation:g}: "
            + ", ".join(f"{one.end:.2f} at {degrees(one.velocity):.0f}°/s" for one in found)
            for excitation, found in self.stretches.items()
        )
        return Claim(
            "As the velocity of the stretch grows, torque reaches a plateau 30 % above isometric: "
            "Hill's hyperbola inverted.",
            "3.2",
            rises and all(abs(values[-1] - _PLATEAU) <= _NEAR for values in ends),
            f"torque at the end of the stretch, of isometric torque: {evidence}",
        )

    def draw(self, figure: Any) -> None:
        """Torque over time and stretch, its return, and torque over velocity."""
        grid = figure.subplots(2, 2)
        excitation = max(self.stretches)
        found = self.stretches[excitation]
        factor, unit = torque_unit(max(float(one.torque.max()) for one in found))
        for one, colour in zip(found, _colours(len(found)), strict=True):
            look = {"color": colour, "label": f"{degrees(one.velocity):.0f}°/s"}
            shown = (one.time > 0) & (one.time < one.stop + _DRAWN_AFTER)
            grid[0, 0].plot(one.time[shown], factor * one.torque[shown], **look)
            during = (one.time >= 0) & (one.time < one.stop)
            grid[0, 1].plot(np.degrees(one.stretched[during]), one.relative[during], **look)
            after = (one.time >= one.stop) & (one.time < one.stop + _DRAWN_AFTER)
            grid[1, 0].plot(1e3 * (one.time[after] - one.stop), one.relative[after], **look)
        grid[0, 0].set_xscale("log")
        grid[0, 0].set_xlim(left=1e-3)
        start = "time from the start of the stretch [s]"
        _label(grid[0, 0], f"excitation {excitation:g}", start, f"torque [{unit}]")
        relative = "torque, of isometric [-]"
        _label(grid[0, 1], "during the stretch", "stretch [°]", relative)
        _label(grid[1, 0], "after the stretch", "time from its end [ms]", relative)
        slowest = max(one.recovery(0.01) or _DRAWN_AFTER for one in found)
        grid[1, 0].set_xlim(0, 1e3 * min(_DRAWN_AFTER, 1.5 * slowest))
        self._draw_velocities(grid[1, 1])
        figure.legend(
            *grid[0, 1].get_legend_handles_labels(), loc="outside upper center", ncols=6,
            frameon=False, title=spoken(self.muscle),
        )  # fmt: skip

    def _draw_velocities(self, axes: Any) -> None:
        for index, (excitation, found) in enumerate(self.stretches.items()):
            velocity = [degrees(one.velocity) for one in found]
            colour = MUSCLE_COLOURS[(3, 5)[index % 2]]
            look = {"color": colour, "marker": "os^vD"[index % 5], "ls": "none", "ms": 6}
            label = f"excitation {excitation:g}"
            axes.plot(velocity, [one.end for one in found], label=label, **look)
            axes.plot(velocity, [one.contractile for one in found], color=colour, lw=1.2)
        axes.axhline(_PLATEAU, color="0.4", ls="--", lw=1, label="plateau")
        axes.plot([], [], color="0.4", lw=1.2, label="contractile element")
        axes.set_ylim(bottom=1.0)
        axes.legend(frameon=False, fontsize=9, loc="lower right")
        _label(axes, "at the end", "velocity of stretch [°/s]", "torque, of isometric [-]")

    def film(self) -> Recording | None:
        """The recorded stretch."""
        return next(iter(self.recordings.values()), None)

    def _all(self) -> list[Stretch]:
        return [one for found in self.stretches.values() for one in found]


def lengthening(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    velocities: Sequence[float] | None = None,
    excitations: Sequence[float] = (0.3, 1.0),
    amplitude: float = radians(30.0),
    progress: Callable[[float], None] | None = None,
) -> Lengthening:
    """Stretch a steadily contracted muscle about mid-range at several velocities and excitations.

    On a stiff dynamometer. Torque is its gauge's reading minus that of the same movement with all
    muscles relaxed. It is compared with the isometric torque at the same angle and excitation.

    Args:
        joint: The joint or its name.
        muscle: The muscle; by default the joint's first.
        velocities: Joint velocities while the muscle is stretched, positive [rad/s]; by default
            2 to 50 % of the contractile element's largest.
        excitations: Excitations of the muscle, in (0, 1] [-].
        amplitude: How far the joint is turned [rad].
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: A joint or muscle is unknown, an excitation or the amplitude is out of range,
            or a velocity cannot be clamped.
    """
    subject = as_joint(joint)
    chosen = as_muscle(subject, muscle)
    start, end = _ends(subject, chosen, amplitude)
    top = subject.hill_muscles[chosen].max_velocity / abs(subject.gears[chosen])
    speeds = sorted([top * share for share in _SHARES] if velocities is None else velocities)
    _check(speeds, excitations, amplitude, build_rig(subject).timestep)
    machine, found = stiff_machine(subject), {}
    for count, u in enumerate(sorted(excitations), 1):
        found[u] = tuple(
            _stretch(subject, machine, chosen, start=start, end=end, velocity=v, excitation=u)
            for v in speeds
        )
        if progress:
            progress(count / len(excitations))
    filmed = found[max(found)][len(speeds) // 2]
    name = f"{degrees(filmed.velocity):.0f}°/s at excitation {filmed.excitation:g}"
    recording = _recording(subject, machine, chosen, filmed, start, end)
    return Lengthening(
        subject.name, chosen, start, end, found, machine.stiffness, {name: recording}
    )


def _ends(joint: Joint, muscle: str, amplitude: float) -> tuple[float, float]:
    """Angles [rad] about mid-range between which a muscle is stretched."""
    low, high = joint.range
    if not 0 < amplitude <= high - low:
        raise ValueError(
            f"amplitude must be in (0, {high - low:.3g}] rad, the range of {joint.name}, "
            f"got {amplitude}"
        )
    middle, half = 0.5 * (low + high), 0.5 * amplitude * direction(joint, muscle)
    return middle + half, middle - half


def _check(
    velocities: Sequence[float], excitations: Sequence[float], amplitude: float, timestep: float
) -> None:
    if not velocities:
        raise ValueError("velocities must not be empty; give at least one, or leave them out")
    for velocity in velocities:
        check_velocity(velocity, amplitude, timestep)
        if velocity < 0:
            raise ValueError(f"velocities must be positive, got {velocity} rad/s")
    if not excitations or not all(isfinite(u) and 0 < u <= 1 for u in excitations):
        raise ValueError(f"excitations must be one or more in (0, 1], got {list(excitations)}")


def _recording(
    joint: Joint, machine: Dynamometer, muscle: str, one: Stretch, start: float, end: float
) -> Recording:
    """Recording of one of the stretches, made again."""
    time, path = _path(start, end, one.velocity, build_rig(joint).timestep)
    shown, u = path[time < one.stop + _FILMED_AFTER], one.excitation
    return record_path(joint, machine, shown, muscle, before=u, excitation=u)


def _label(axes: Any, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=11)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    tidy(axes)


def _colours(count: int) -> list[tuple[float, ...]]:
    """From pale to dark with ascending velocity."""
    dark, pale = np.array(MUSCLE_COLOURS[0]), np.array([0.72, 0.85, 0.95])
    shares = np.linspace(0.0, 1.0, count) if count > 1 else np.ones(1)
    return [tuple((1 - share) * pale + share * 0.75 * dark) for share in shares]
