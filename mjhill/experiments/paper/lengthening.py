"""A contracted muscle stretched at constant velocity: what a Hill-type model does (sect. 5)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees, isfinite, radians
from typing import Any, ClassVar

import numpy as np

from mjhill.experiments.figures.lengthening import draw
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.experiments.trials.stretch import AFTER, Stretch, stretch, stretch_path
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometry import recorded, stiff_machine
from mjhill.lab.rig import as_joint, as_muscle, build_rig, direction
from mjhill.lab.velocity_clamp import check_velocity
from mjhill.simulate.recording import Recording

SHARES = (0.02, 0.05, 0.1, 0.2, 0.5)  # of the contractile element's largest velocity
LEVELS = (0.3, 1.0)
AMPLITUDE = radians(30.0)
PLATEAU = 1.3  # the paper's, of isometric torque
_NEAR = 0.05  # of isometric torque: what counts as at the plateau, and as a yield
_SHOWN_AFTER = 0.5  # of a stretch, in its film [s]
_LASTING = 0.01  # of isometric torque: what counts as lasting


@dataclass(frozen=True)
class Lengthening(Result):
    """Stretches of one muscle at several inputs and velocities.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle stretched.
        start: Angle at which each stretch starts [rad].
        end: Angle at which it ends [rad].
        levels: Neural inputs [-], ascending.
        stretches: By input, in the order of ascending velocity.
        stiffness: Of the dynamometer [N·m/rad].
        recordings: A stretch at the highest input, in the middle of the velocities.
    """

    title: ClassVar[str] = "Lengthening contraction"
    section: ClassVar[str] = "3.2, 5"
    size: ClassVar[tuple[float, float]] = (9.0, 7.6)
    joint: str
    muscle: str
    start: float
    end: float
    levels: tuple[float, ...]
    stretches: Mapping[float, tuple[Stretch, ...]]
    stiffness: float
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    def measures(self) -> Iterator[Measure]:
        """Torque at the end of each stretch and how it comes back."""
        for one in self._all():
            at = f"{self.muscle} at {one.level:g}, stretched at {degrees(one.velocity):.0f}°/s"
            yield Measure(f"{at}, torque at its end", one.end, "-", note="of isometric torque")
            back = one.recovery(_LASTING)
            after = None if back is None else 1e3 * back
            note = "" if after is not None else f"not within {AFTER:g} s"
            yield Measure(f"{at}, back to within 1 % of isometric after", after, "ms", note=note)
            yield Measure(f"{at}, above isometric {AFTER:g} s later", 1e2 * one.residual, "%")
        yield Measure("stretch", degrees(abs(self.end - self.start)), "°")
        yield Measure("stiffness of the dynamometer", self.stiffness, "N·m/rad")

    def claims(self) -> Iterator[Claim]:
        """The plateau of the model, and what of real muscle it lacks."""
        yield self._plateau()
        worst = max(self._all(), key=lambda one: one.fall)
        yield Claim(
            "A Hill-type model does not show the transients of stretched muscle: it never yields.",
            "5",
            worst.fall < _NEAR,
            f"while the stretch goes on torque never falls by more than {worst.fall:.1%} of "
            f"isometric (at {worst.level:g}, {degrees(worst.velocity):.0f}°/s)",
        )
        last = max(self._all(), key=lambda one: abs(one.residual))
        times = [one.recovery(_LASTING) for one in self._all()]
        seen = [time for time in times if time is not None]
        back = f"at most {1e3 * max(seen):.0f} ms" if len(seen) == len(times) else "not always"
        yield Claim(
            "Nor does it keep extra force after a stretch, as real muscle does.",
            "5",
            abs(last.residual) < _LASTING,
            f"time to come back to within 1 % of isometric: {back}; {AFTER:g} s after the stretch "
            f"it is {abs(last.residual):.2%} off at most",
        )

    def _plateau(self) -> Claim:
        """Whether torque rises with velocity towards 1.3 of isometric and no farther."""
        ends = {level: [one.end for one in found] for level, found in self.stretches.items()}
        rises = all((np.diff(values) > 0).all() for values in ends.values())
        top = [values[-1] for values in ends.values()]
        evidence = "; ".join(
            f"input {level:g}: "
            + ", ".join(f"{one.end:.2f} at {degrees(one.velocity):.0f}°/s" for one in found)
            for level, found in self.stretches.items()
        )
        return Claim(
            "Stretched ever faster, torque goes to a plateau 30 % above isometric, Hill's "
            "hyperbola inverted.",
            "3.2",
            rises and all(abs(value - PLATEAU) <= _NEAR for value in top),
            f"torque at the end of the stretch, of isometric torque: {evidence}",
        )

    def draw(self, figure: Any) -> None:
        """Torque over time and stretch, its return, and torque over velocity."""
        draw(figure, self.muscle, self.stretches)

    def film(self) -> Recording | None:
        """The stretch recorded."""
        return next(iter(self.recordings.values()), None)

    def _all(self) -> list[Stretch]:
        return [one for level in self.levels for one in self.stretches[level]]


def lengthening(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    velocities: Sequence[float] | None = None,
    levels: Sequence[float] = LEVELS,
    amplitude: float = AMPLITUDE,
    progress: Callable[[float], None] | None = None,
) -> Lengthening:
    """Stretch a steadily contracted muscle about mid-range at several velocities and inputs.

    On a stiff dynamometer. Torque is its gauge's reading less that of the same movement with all
    muscles relaxed, and is compared with the isometric torque at the same angle and input.

    Args:
        joint: The joint, or the name of one.
        muscle: The muscle; the joint's first without it.
        velocities: Of the joint while the muscle is stretched, positive [rad/s]; without them 2
            to 50 % of the largest of the contractile element.
        levels: Neural inputs, in (0, 1].
        amplitude: How far the joint is turned [rad].
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: A joint or muscle is unknown, an input or the amplitude is out of range, or a
            velocity cannot be clamped.
    """
    subject = as_joint(joint)
    chosen = as_muscle(subject, muscle)
    start, end = _ends(subject, chosen, amplitude)
    top = subject.muscles[chosen].max_velocity / abs(subject.gears[chosen])
    speeds = sorted([top * share for share in SHARES] if velocities is None else velocities)
    _check(speeds, levels, amplitude, build_rig(subject).timestep)
    machine, found = stiff_machine(subject), {}
    ordered = tuple(sorted(levels))
    for count, level in enumerate(ordered, 1):
        found[level] = tuple(
            stretch(subject, machine, chosen, start=start, end=end, velocity=speed, level=level)
            for speed in speeds
        )
        if progress:
            progress(count / len(ordered))
    recording = _recording(subject, chosen, found[ordered[-1]][len(speeds) // 2], start, end)
    return Lengthening(
        subject.name, chosen, start, end, ordered, found, machine.stiffness, recording
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
    velocities: Sequence[float], levels: Sequence[float], amplitude: float, timestep: float
) -> None:
    if not velocities:
        raise ValueError("velocities must have at least one")
    for velocity in velocities:
        check_velocity(velocity, amplitude, timestep)
        if velocity < 0:
            raise ValueError(f"velocities must be positive, got {velocity} rad/s")
    if not levels or not all(isfinite(level) and 0 < level <= 1 for level in levels):
        raise ValueError(f"levels must be inputs in (0, 1], got {list(levels)}")


def _recording(
    joint: Joint, muscle: str, one: Stretch, start: float, end: float
) -> dict[str, Recording]:
    """A run of one of the stretches."""
    machine, timestep = stiff_machine(joint), build_rig(joint).timestep
    time, path = stretch_path(start, end, one.velocity, timestep)
    shown = path[time < one.stop + _SHOWN_AFTER]
    recording = recorded(joint, machine, shown, muscle, before=one.level, level=one.level)
    return {f"{degrees(one.velocity):.0f}°/s at input {one.level:g}": recording}
