"""Shortening against a constant external torque (the paper's sect. 4.2.2; Wilkie 1950).

A muscle in full tetanus holds the joint against an equal external torque; that drops at once to a
load, which then stays. Velocity and torque are read as the joint passes one angle, the same for
every load, and set beside the torque-velocity relation of the contractile element at that angle and
full activation: first the bare load, then with what a laboratory would subtract.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.experiments.figures.isotonic import draw_releases, draw_torques
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.experiments.trials.quick_release import (
    RELEASE,
    Point,
    own_curve,
    reading,
    released,
)
from mjhill.joints.joint import Joint
from mjhill.lab.rig import (
    UnmeasuredError,
    as_joint,
    as_muscle,
    direction,
    net_torque,
    rig,
    strongest_angle,
)
from mjhill.simulate.recording import Recording

_MARGIN = 0.25  # least distance of the reading angle from the ends of the range, in ranges
_RECOIL = (
    1.5  # stretches of the series element at full force from start to reading: it has recoiled
)
_CLOSE = 0.05  # of the isometric torque, near enough
_FEWEST = 3  # points that make a curve
NAIVE, INERTIA, PASSIVE, BOTH = (
    "load alone",
    "with inertia subtracted",
    "with elasticity and viscosity subtracted",
    "with all of them subtracted",
)

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Isotonic(Result):
    """Torque-velocity relation of a muscle, read from outside.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle.
        start: Angle at which it is released [rad].
        angle: Angle at which it is read [rad].
        held: Torque held before the release [N·m].
        points: What was read, by rising load.
        velocities: Of the contractile element in full activation at that angle [rad/s], ascending.
        torques: Its torque at these [N·m], the same shape.
        missed: Loads that did not pass the angle [N·m].
        recordings: The run of each load, from before the release.
    """

    title: ClassVar[str] = "Isotonic quick release"
    section: ClassVar[str] = "4.2.2"
    size: ClassVar[tuple[float, float]] = (9.0, 4.4)
    joint: str
    muscle: str
    start: float
    angle: float
    held: float
    points: tuple[Point, ...]
    velocities: _Values
    torques: _Values
    missed: tuple[float, ...] = ()
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    @property
    def isometric(self) -> float:
        """Isometric torque at the reading angle in full activation [N·m]."""
        return float(self.torques[0])

    def read(self) -> dict[str, _Values]:
        """Torque taken for the contractile element's [N·m], by what is subtracted."""
        names = ("load", "inertial", "viscous", "elastic")
        load, inertial, viscous, elastic = (
            np.array([getattr(point, name) for point in self.points]) for name in names
        )
        passive = viscous + elastic
        return {
            NAIVE: load,
            INERTIA: load + inertial,
            PASSIVE: load + passive,
            BOTH: load + inertial + passive,
        }

    def errors(self) -> dict[str, float]:
        """R.m.s. distance from the contractile element's torque at the joint's velocity.

        In units of the isometric torque at that angle [-].
        """
        own = np.interp([point.velocity for point in self.points], self.velocities, self.torques)
        return {
            name: float(np.sqrt(np.mean((torque - own) ** 2)) / self.isometric)
            for name, torque in self.read().items()
        }

    def measures(self) -> Iterator[Measure]:
        """Every point, then the errors."""
        torques = self.read()
        yield Measure("torque held before the release", self.held, "N·m")
        yield Measure("angle of the release", degrees(self.start), "°")
        yield Measure("angle of the reading", degrees(self.angle), "°")
        for k, point in enumerate(self.points):
            head = f"load {point.load / self.held:.0%} of that held"
            yield Measure(f"{head}: velocity", degrees(point.velocity), "°/s")
            yield Measure(f"{head}: torque", point.load, "N·m")
            yield Measure(f"{head}: torque {BOTH}", float(torques[BOTH][k]), "N·m")
        for load in self.missed:
            name, note = f"load {load / self.held:.0%} of that held: velocity", "not passed"
            yield Measure(name, None, "°/s", note=note)
        for name, error in self.errors().items():
            yield Measure(f"off the contractile element, {name}", 100 * error, "% of isometric")

    def claims(self) -> Iterator[Claim]:
        """What sect. 4.2.2 says of isotonic loading."""
        errors = self.errors()
        share = max(abs(p.inertial) / self.isometric for p in self.points)
        yield Claim(
            "External torque and velocity are not the contractile element's, basically because "
            f"of the inertia (here: r.m.s. over {_CLOSE:.0%} of isometric torque off, and inertia "
            "accounts for more of it than elasticity and viscosity do).",
            self.section,
            errors[NAIVE] > _CLOSE and errors[INERTIA] < errors[PASSIVE],
            ", ".join(f"{error:.1%} off {name}" for name, error in errors.items())
            + f"; the inertial torque is up to {share:.1%} of isometric",
        )
        slip = max(abs(p.shortening - p.velocity) / p.velocity for p in self.points)
        yield Claim(
            "The contractile element's torque-velocity relation can be approximated once the "
            f"dynamics of the limb are subtracted (here: to {_CLOSE:.0%} of isometric torque, and "
            "better than without).",
            self.section,
            errors[BOTH] < min(_CLOSE, errors[NAIVE]),
            f"{errors[BOTH]:.1%} off {BOTH}, {errors[NAIVE]:.1%} off {NAIVE}; the element "
            f"shortens by up to {slip:.1%} faster or slower than the joint turns, because the "
            "series element gives",
        )

    def draw(self, figure: Any) -> None:
        """Runs on the left, torque against velocity on the right."""
        left, right = figure.subplots(1, 2)
        draw_releases(left, self.joint, self.recordings, start=self.start, angle=self.angle)
        velocities = np.degrees([point.velocity for point in self.points])
        draw_torques(right, np.degrees(self.velocities), self.torques, velocities, self.read())
        right.set_xlabel(f"velocity at {degrees(self.angle):.0f}° [°/s]")

    def film(self) -> Recording | None:
        """The lightest load."""
        return next(iter(self.recordings.values()), None)


def isotonic(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    loads: Sequence[float] = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8),
    angle: float | None = None,
    start: float | None = None,
    duration: float = 1.5,
    progress: Callable[[float], None] | None = None,
) -> Isotonic:
    """Quick releases of a muscle in tetanus to several constant loads.

    Args:
        joint: The joint or its name.
        muscle: The muscle; by default the one that pulls towards positive angles.
        loads: Shares of the torque held before the release [-], ascending.
        angle: Where velocity and torque are read [rad]; by default where the muscle is strongest,
            at least a quarter of the range of motion from its ends.
        start: Where the joint is held [rad]; by default so far before ``angle`` that the series
            element has recoiled there, 1.5 times its stretch at full force.
        duration: Of each run [s], by when the joint must have passed the angle.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint or muscle is unknown, or an option is out of bounds.
        UnmeasuredError: Fewer than three loads pass the angle.
    """
    joint = as_joint(joint)
    muscle = as_muscle(joint, muscle)
    _check(loads, duration)
    sign = direction(joint, muscle)
    angle, start = _angles(joint, muscle, angle, start)
    bench = rig(joint)
    held = sign * net_torque(joint, {muscle: 1.0}, start)
    if held <= 0:
        raise UnmeasuredError(f"{muscle} does not pull against a load at {degrees(start):.0f}°")
    points, missed, recordings = [], [], {}
    for k, share in enumerate(loads):
        recording = released(bench, muscle, start, held, share * held, duration)
        recordings[f"{share:.0%}"] = recording
        point = reading(joint, muscle, recording, angle, share * held)
        if point:
            points.append(point)
        else:
            missed.append(share * held)
        if progress:
            progress((k + 1) / len(loads))
    if len(points) < _FEWEST:
        raise UnmeasuredError(
            f"only {len(points)} loads let {muscle} pass {degrees(angle):.0f}° within "
            f"{duration:g} s; give lighter loads or another angle"
        )
    velocities, torques = own_curve(joint.muscles[muscle], joint.gears[muscle] * angle)
    return Isotonic(
        joint.name,
        muscle,
        start,
        angle,
        held,
        tuple(points),
        velocities,
        torques,
        tuple(missed),
        recordings,
    )


def _check(loads: Sequence[float], duration: float) -> None:
    if len(loads) < _FEWEST or list(loads) != sorted({u for u in loads if 0 <= u < 1}):
        raise ValueError(
            f"loads must be at least {_FEWEST}, ascending, in [0, 1) of the torque held, "
            f"got {list(loads)}"
        )
    if not (np.isfinite(duration) and duration > RELEASE):
        raise ValueError(
            f"duration must be above {RELEASE:g} s, when the load drops, got {duration} s"
        )


def _angles(
    joint: Joint, muscle: str, angle: float | None, start: float | None
) -> tuple[float, float]:
    """The reading angle and the start [rad], checked."""
    (low, high), sign = joint.range, direction(joint, muscle)
    span = high - low
    if angle is None:
        strongest = strongest_angle(joint, muscle)
        angle = min(max(strongest, low + _MARGIN * span), high - _MARGIN * span)
    if start is None:
        start = angle - sign * _RECOIL * joint.muscles[muscle].series_stretch
        start = min(max(start, low), high)
    if not (low <= angle <= high and low <= start <= high and sign * (angle - start) > 0):
        raise ValueError(
            f"angle and start must be in the range of {joint.name}, {degrees(low):.0f} to "
            f"{degrees(high):.0f}°, and {muscle} pull from start to angle, got angle "
            f"{degrees(angle):.0f}° and start {degrees(start):.0f}°"
        )
    return angle, start
