"""Shortening against a constant external torque (the paper's sect. 4.2.2; Wilkie 1950).

A muscle in full tetanus holds the joint against an equal external torque. This torque drops at once
to a load, which then stays constant. Velocity and torque are read as the joint passes one angle,
the same for every load. They are compared with the torque-velocity relation of the contractile
element at that angle and full activation: first the load alone, then with the dynamics of the limb
subtracted, as a laboratory would do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.joints.joint import Joint
from mjhill.lab.rig import (
    Rig,
    UnmeasuredError,
    as_joint,
    as_muscle,
    at_rest,
    build_rig,
    direction,
    net_torque,
    record_run,
    strongest_angle,
)
from mjhill.muscles.hill import Hill
from mjhill.muscles.readings import shortening_velocity, steady_stretch, tension
from mjhill.simulate.recording import Recording
from mjhill.simulate.reference import plant_torque
from mjhill.simulate.signals import Signal

RELEASE = 0.05  # time at which the load drops [s]
NAIVE, INERTIA, PASSIVE, BOTH = (
    "load alone",
    "with inertia subtracted",
    "with elasticity and viscosity subtracted",
    "with all of them subtracted",
)

_MARGIN = 0.25  # least distance of the reading angle from the ends of the range [range]
_RECOIL = 1.5  # from start to reading [series stretch at full force]; the element has recoiled
_CLOSE = 0.05  # a small error of torque [isometric torque]
_FEWEST = 3  # least number of points of a curve
_APART = 0.08  # least distance of two labels in the figure [length of the axis]
_MARKERS = ("o", "^", "v", "o")

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Point:
    """Reading of one load as the joint passes the angle; positive in the muscle's direction.

    Attributes:
        load: External torque against the muscle [N·m].
        velocity: Velocity of the joint [rad/s].
        inertial: Inertia times acceleration [N·m].
        viscous: Passive viscosity times velocity [N·m].
        elastic: Passive torque against the muscle [N·m].
        shortening: Shortening velocity of the contractile element [rad/s].
    """

    load: float
    velocity: float
    inertial: float
    viscous: float
    elastic: float
    shortening: float


@dataclass(frozen=True)
class Isotonic(Result):
    """Torque-velocity relation of a muscle, measured from outside.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle.
        start: Angle of the release [rad].
        angle: Angle of the reading [rad].
        held: Torque held before the release [N·m].
        points: The readings, by rising load.
        velocities: Velocities of the contractile element in full activation at the angle of the
            reading [rad/s], ascending, shape (N,).
        torques: Its torques at these velocities [N·m], shape (N,).
        missed: Loads with which the joint did not pass the angle [N·m].
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
        """Isometric torque at the angle of the reading in full activation [N·m]."""
        return float(self.torques[0])

    def estimates(self) -> dict[str, _Values]:
        """The contractile element's torque [N·m], by what is subtracted, shape (N,)."""
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
        """Root mean square error of the estimates at the joint's velocity [isometric torque]."""
        own = np.interp([point.velocity for point in self.points], self.velocities, self.torques)
        return {
            name: float(np.sqrt(np.mean((torque - own) ** 2)) / self.isometric)
            for name, torque in self.estimates().items()
        }

    def measures(self) -> Iterator[Measure]:
        """Every point, then the errors."""
        torques = self.estimates()
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
            yield Measure(f"error of the torque, {name}", 100 * error, "% of isometric")

    def claims(self) -> Iterator[Claim]:
        """What sect. 4.2.2 says of isotonic loading."""
        errors = self.errors()
        share = max(abs(p.inertial) / self.isometric for p in self.points)
        yield Claim(
            "External torque and velocity are not the contractile element's, basically because "
            f"of the inertia (here: an r.m.s. error over {_CLOSE:.0%} of isometric torque, and "
            "inertia explains more of it than elasticity and viscosity do).",
            self.section,
            errors[NAIVE] > _CLOSE and errors[INERTIA] < errors[PASSIVE],
            "errors: "
            + ", ".join(f"{error:.1%} {name}" for name, error in errors.items())
            + f"; the inertial torque is up to {share:.1%} of isometric",
        )
        slip = max(abs(p.shortening - p.velocity) / p.velocity for p in self.points)
        yield Claim(
            "The contractile element's torque-velocity relation can be approximated once the "
            f"dynamics of the limb are subtracted (here: to {_CLOSE:.0%} of isometric torque, and "
            "better than without).",
            self.section,
            errors[BOTH] < min(_CLOSE, errors[NAIVE]),
            f"errors: {errors[BOTH]:.1%} {BOTH}, {errors[NAIVE]:.1%} {NAIVE}; the element "
            f"shortens by up to {slip:.1%} faster or slower than the joint moves, because the "
            "series element changes its length",
        )

    def film(self) -> Recording | None:
        """The lightest load."""
        return next(iter(self.recordings.values()), None)

    def draw(self, figure: Any) -> None:
        """Runs on the left, torque against velocity on the right."""
        left, right = figure.subplots(1, 2)
        self._draw_releases(left)
        self._draw_torques(right)

    def _draw_releases(self, axes: Any) -> None:
        """Angle over time from the release to shortly after the reading."""
        read, opacities = degrees(self.angle), np.linspace(0.35, 1.0, len(self.recordings))
        times = {}
        for (name, run), opacity in zip(self.recordings.items(), opacities, strict=True):
            angles, time = np.degrees(run[f"{self.joint}.angle"]), 1e3 * (run.time - RELEASE)
            axes.plot(time, angles, color=(*MUSCLE_COLOURS[0], opacity), lw=1.6)
            before = angles < read if self.start < self.angle else angles > read
            if not before.all():
                times[name] = float(time[np.argmin(before)])
        end, last = 1.2 * max(times.values()), -np.inf
        for name, passed in times.items():
            if passed - last > _APART * end:
                axes.annotate(name, (passed, read), (2, -10), textcoords="offset points",
                              fontsize="small")  # fmt: skip
                last = passed
        axes.axhline(read, color="0.4", lw=1, ls="--")
        axes.set_xlim(-0.06 * end, end)
        half = 0.8 * degrees(abs(self.angle - self.start))
        middle = 0.5 * degrees(self.angle + self.start)
        axes.set_ylim(middle - half, middle + half)
        axes.set_xlabel("time from the release [ms]")
        axes.set_ylabel("angle [°]")
        axes.grid(alpha=0.3)

    def _draw_torques(self, axes: Any) -> None:
        """The relation of the contractile element, and the estimates."""
        axes.plot(
            np.degrees(self.velocities), self.torques, "k-", lw=2, label="contractile element"
        )
        velocity = np.degrees([point.velocity for point in self.points])
        for (name, torque), marker, colour in zip(
            self.estimates().items(), _MARKERS, MUSCLE_COLOURS, strict=False
        ):
            filled = colour if name == BOTH else "none"
            axes.plot(velocity, torque, marker, ms=6, color=colour, mfc=filled, label=name)
        axes.set_ylabel("torque [N·m]")
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
        axes.set_xlabel(f"velocity at {degrees(self.angle):.0f}° [°/s]")


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
        angle: Angle of the reading [rad]; by default that at which the muscle is strongest, at
            least a quarter of the range of motion from its ends.
        start: Angle of the release [rad]; by default so far before ``angle`` that the series
            element has recoiled there, 1.5 times its stretch at full force.
        duration: Duration of each run [s], in which the joint must pass the angle.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint or muscle is unknown, or an option is out of range.
        UnmeasuredError: The joint passes the angle with fewer than three loads.
    """
    joint = as_joint(joint)
    muscle = as_muscle(joint, muscle)
    _check(loads, duration)
    angle, start = _angles(joint, muscle, angle, start)
    rig = build_rig(joint)
    held = direction(joint, muscle) * net_torque(joint, {muscle: 1.0}, start)
    if held <= 0:
        raise UnmeasuredError(f"{muscle} does not pull against a load at {degrees(start):.0f}°")
    points, missed, recordings = [], [], {}
    for k, share in enumerate(loads):
        recording = _release(rig, muscle, start, held, share * held, duration)
        recordings[f"{share:.0%}"] = recording
        point = _reading(joint, muscle, recording, angle, share * held)
        if point:
            points.append(point)
        else:
            missed.append(share * held)
        if progress:
            progress((k + 1) / len(loads))
    if len(points) < _FEWEST:
        raise UnmeasuredError(
            f"{muscle} moves {joint.name} past {degrees(angle):.0f}° within {duration:g} s with "
            f"only {len(points)} loads; give lighter loads or another angle"
        )
    curve = torque_velocity_curve(joint.hill_muscles[muscle], joint.gears[muscle] * angle)
    return Isotonic(
        joint.name, muscle, start, angle, held, tuple(points), *curve, tuple(missed), recordings
    )


def torque_velocity_curve(muscle: Hill, length: float) -> tuple[_Values, _Values]:
    """Torque-velocity relation of a shortening contractile element in full activation.

    Args:
        muscle: The muscle.
        length: Its length [rad].

    Returns:
        Velocities [rad/s], ascending from 0, and torques [N·m], both of shape (400,).
    """
    isometric = steady_stretch(muscle, 1.0, length)
    stretches = np.linspace(isometric, 0.0, 400).tolist()
    velocities = [shortening_velocity(muscle, 1.0, length, stretch) for stretch in stretches]
    return np.array(velocities), np.array([tension(muscle, stretch) for stretch in stretches])


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
    """Angles of the reading and of the release [rad], checked."""
    (low, high), sign = joint.range, direction(joint, muscle)
    margin = _MARGIN * (high - low)
    if angle is None:
        angle = min(max(strongest_angle(joint, muscle), low + margin), high - margin)
    if start is None:
        start = angle - sign * _RECOIL * joint.hill_muscles[muscle].series_stretch
        start = min(max(start, low), high)
    if not (low <= angle <= high and low <= start <= high and sign * (angle - start) > 0):
        raise ValueError(
            f"angle and start must be in the range of {joint.name}, {degrees(low):.0f} to "
            f"{degrees(high):.0f}°, and {muscle} must pull from start to angle, got angle "
            f"{degrees(angle):.0f}° and start {degrees(start):.0f}°"
        )
    return angle, start


def _release(
    rig: Rig, muscle: str, start: float, held: float, load: float, duration: float
) -> Recording:
    """The run in which the torque against the muscle drops from ``held`` to ``load`` [N·m]."""
    sign = direction(rig.joint, muscle)
    torque = Signal(lambda time: -sign * (held if time < RELEASE else load), (RELEASE,))
    begin = at_rest(rig, start, {muscle: 1.0})
    return record_run(rig, begin, duration, excitation={muscle: 1.0}, torque=torque)


def _reading(
    joint: Joint, muscle: str, recording: Recording, angle: float, load: float
) -> Point | None:
    """The reading as the joint passes the angle; None if it does not pass it."""
    sign = direction(joint, muscle)
    beyond = sign * (recording[f"{joint.name}.angle"] - angle)
    if beyond.max() < 0:
        return None
    first = int(np.argmax(beyond >= 0))
    share = beyond[first] / (beyond[first] - beyond[first - 1])
    velocity = sign * recording[f"{joint.name}.velocity"]
    acceleration = np.gradient(velocity, recording.time)

    def at_angle(values: _Values) -> float:
        return float(values[first] + share * (values[first - 1] - values[first]))

    return Point(
        load,
        at_angle(velocity),
        joint.inertia * at_angle(acceleration),
        joint.damping * at_angle(velocity),
        -sign * plant_torque(joint, angle),
        at_angle(recording[f"{muscle}.velocity"]),
    )
