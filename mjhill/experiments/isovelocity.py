"""Torque-velocity curves from a machine that clamps joint velocity (sect. 4.1.3, Fig. 6)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, exp, radians
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import tidy
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometer import compliant_machine, record_path, stiff_machine
from mjhill.lab.rig import Dynamometer, UnmeasuredError, as_joint, as_muscle, build_rig
from mjhill.lab.torque_velocity import (
    Curve,
    Sweep,
    machine_paths,
    make_sweep,
    measure_curve,
    measure_isometric,
    own_curve,
)
from mjhill.simulate.recording import Recording

_SHARES = (  # of the contractile element's largest velocity
    *(-0.4, -0.2, -0.1, -0.05, -0.025),
    *(0.025, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.7, 0.9),
)
_COMPLIANT = radians(5.0)  # deflection of a padded arm and the soft tissue under it [rad]
_RIGID = 0.02  # stretch of a series element that is nearly removed, as a share of its own
_STABLE = 0.8  # of the stiffness at which a step becomes unstable

_DIFFERENT = 0.05  # of the largest isometric torque: about the spread of a repeated test
_LOW = 0.2  # of the contractile element's largest velocity: up to this a velocity is low
_SEEN = 0.01  # of the largest isometric torque: a smaller deviation needs no explanation
_MAIN = 0.5  # share of a deviation that its main cause explains, at least
_SECTION = "4.1.3, Fig. 6"

_OWN: dict[str, Any] = {"color": "black", "lw": 2.5, "label": "contractile element"}
_LOOKS: tuple[dict[str, Any], ...] = tuple(
    {"color": MUSCLE_COLOURS[k], "marker": marker, "ms": 4.5, "lw": 1.3}
    for k, marker in enumerate("os^v")
)
_RELAXED, _CONTRACTED, _SOFT, _ = _LOOKS

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Curves:
    """Torque-velocity curves of one muscle at V velocities, read at A angles.

    Attributes:
        shares: Velocities over the largest of the contractile element [-], shape (V,).
        largest: Largest isometric torque on the travel [N·m].
        isometric: Isometric torque at the angles [N·m], shape (A,).
        own_best: Largest torque of the fully active contractile element on the travel [N·m],
            shape (V,).
        own: Its torque at the angles [N·m], shape (A, V).
        relaxed: Started relaxed.
        contracted: Started from steady full contraction.
        relaxed_compliant: Started relaxed, on the compliant machine.
        contracted_compliant: Started contracted, on the compliant machine.
        relaxed_rigid: Started relaxed, the series element nearly removed.
        contracted_rigid: Started contracted, the series element nearly removed.
        rigid: Stretch of the nearly removed series element, as a share of its own [-].
    """

    shares: _Values
    largest: float
    isometric: _Values
    own_best: _Values
    own: _Values
    relaxed: Curve
    contracted: Curve
    relaxed_compliant: Curve
    contracted_compliant: Curve
    relaxed_rigid: Curve
    contracted_rigid: Curve
    rigid: float

    def measured(self) -> Iterator[tuple[str, Curve]]:
        """The measured curves, each with its condition."""
        yield "started relaxed", self.relaxed
        yield "started contracted", self.contracted
        yield "started relaxed, compliant machine", self.relaxed_compliant
        yield "started contracted, compliant machine", self.contracted_compliant
        yield "started relaxed, hardly any series element", self.relaxed_rigid
        yield "started contracted, hardly any series element", self.contracted_rigid


@dataclass(frozen=True)
class Isovelocity(Result):
    """Torque-velocity curves of one muscle, as measured and of its contractile element alone.

    Attributes:
        joint: Name of the joint.
        sweep: The movements.
        curves: The curves.
        machines: The stiff and the compliant dynamometer.
        recordings: A contraction at a medium velocity, started relaxed.
    """

    title: ClassVar[str] = "Isovelocity contraction"
    section: ClassVar[str] = _SECTION
    size: ClassVar[tuple[float, float]] = (9.0, 7.6)
    joint: str
    sweep: Sweep
    curves: Curves
    machines: tuple[Dynamometer, Dynamometer]
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    def measures(self) -> Iterator[Measure]:
        """Torques at the velocity nearest 1/5 of the largest, and the machines."""
        curves, sweep = self.curves, self.sweep
        yield Measure(f"{sweep.muscle}, largest isometric torque", curves.largest, "N·m")
        k = int(np.abs(curves.shares - 0.2).argmin())
        at = f"{sweep.muscle} at {degrees(sweep.velocities[k]):.0f}°/s"
        places = [f"torque at {round(degrees(angle))}°" for angle in sweep.angles]
        for name, curve in curves.measured():
            yield Measure(f"{at}, peak torque, {name}", float(curve.peak[k]), "N·m")
            for place, torque in zip(places, curve.at[:, k].tolist(), strict=True):
                yield Measure(f"{at}, {place}, {name}", torque, "N·m")
        for place, torque in zip(places, curves.own[:, k].tolist(), strict=True):
            yield Measure(f"{at}, {place}, contractile element's own", torque, "N·m")
        for name, machine in zip(("stiff", "compliant"), self.machines, strict=True):
            yield Measure(f"stiffness of the {name} machine", machine.stiffness, "N·m/rad")

    def claims(self) -> Iterator[Claim]:
        """What the measured curves depend on and why; all for velocities of shortening."""
        yield self._differ()
        yield self._initial_condition()
        yield self._place()
        yield self._clamp()
        yield self._low_velocity()
        yield self._cause()

    def _largest(self, difference: _Values) -> tuple[float, str]:
        """Largest difference of torques [N·m] in shortening, over the largest isometric torque.

        Returns:
            The difference [-], and it in words.
        """
        sizes = np.abs(np.atleast_2d(difference)).max(axis=0) / self.curves.largest
        sizes = np.where(self.sweep.shortening, sizes, 0.0)
        worst = int(sizes.argmax())
        size, own = float(sizes[worst]), self.curves.own_best[worst] / self.curves.largest
        velocity = f"{degrees(self.sweep.velocities[worst]):.0f}°/s"
        return size, f"{size:.1%} (at {velocity}, where the contractile element gives {own:.0%})"

    def _differ(self) -> Claim:
        one, other = self.curves.relaxed, self.curves.contracted
        relaxed, contracted = (self._largest(curve.at - self.curves.own) for curve in (one, other))
        return Claim(
            "Measured torque-velocity curves differ from the contractile element's own.",
            _SECTION,
            max(relaxed[0], contracted[0]) > _DIFFERENT,
            "from the fully active contractile element at the same angle, in units of the largest "
            f"isometric torque: started relaxed up to {relaxed[1]}, started contracted up to "
            f"{contracted[1]}; {_DIFFERENT:.0%} count as different",
        )

    def _initial_condition(self) -> Claim:
        relaxed, contracted = self.curves.relaxed, self.curves.contracted
        size, where = self._largest(contracted.at - relaxed.at)
        peak, at_peak = self._largest(contracted.peak - relaxed.peak)
        return Claim(
            "The curves depend on the initial condition of the contraction.",
            "4.1.3, Fig. 6b",
            max(size, peak) > _DIFFERENT,
            "contracted minus relaxed start, of the largest isometric torque: torque at an angle "
            f"up to {where}, peak torque up to {at_peak}",
        )

    def _place(self) -> Claim:
        curves, sweep = self.curves, self.sweep
        own = np.ptp(curves.own / curves.isometric[:, np.newaxis], axis=0)
        sizes, where = [], []
        for curve in (curves.relaxed, curves.contracted):
            scaled = curve.at / curves.isometric[:, np.newaxis]
            spread = np.ptp(np.vstack([scaled, curve.peak / curves.largest]), axis=0) - own
            beyond = np.where(sweep.shortening, spread, 0.0)
            sizes.append(float(beyond.max()))
            velocity = degrees(sweep.velocities[beyond.argmax()])
            where.append(f"{sizes[-1]:.1%} at {velocity:.0f}°/s")
        return Claim(
            "They depend on where in the course of torque it is read: its peak, or at some angle.",
            "4.1.3, Fig. 6c",
            max(sizes) > _DIFFERENT,
            "spread of peak and torques at angles, each over its isometric value, beyond that of "
            f"the contractile element: started relaxed up to {where[0]}, contracted up to "
            f"{where[1]}",
        )

    def _clamp(self) -> Claim:
        curves = self.curves
        relaxed, contracted = (
            self._largest(np.vstack([soft.at - hard.at, soft.peak - hard.peak]))
            for soft, hard in (
                (curves.relaxed_compliant, curves.relaxed),
                (curves.contracted_compliant, curves.contracted),
            )
        )
        return Claim(
            "They depend on how well the machine clamps the velocity.",
            "4.1.3",
            max(relaxed[0], contracted[0]) > _DIFFERENT,
            "compliant minus stiff machine, of the largest isometric torque: started relaxed up "
            f"to {relaxed[1]}, contracted up to {contracted[1]}",
        )

    def _low_velocity(self) -> Claim:
        curves = self.curves
        low = self.sweep.shortening & (curves.shares <= _LOW)
        relaxed, contracted = (
            self._largest(np.where(low, curve.peak - curves.own_best, 0.0))
            for curve in (curves.relaxed, curves.contracted)
        )
        return Claim(
            "At low velocities peak torque departs from Hill's curve, as some laboratories find.",
            "4.1.3",
            max(relaxed[0], contracted[0]) > _DIFFERENT if low.any() else None,
            f"up to {_LOW:.0%} of the largest velocity, from the contractile element's best, of "
            f"the largest isometric torque: started relaxed up to {relaxed[1]}, contracted up to "
            f"{contracted[1]}; at a peak the series element neither stretches nor recoils",
        )

    def _cause(self) -> Claim:
        def error(*found: Curve) -> float:
            shortening = self.sweep.shortening
            off = np.concatenate([(c.at - c.contractile)[:, shortening].ravel() for c in found])
            return float(np.sqrt(np.mean(off**2))) / self.curves.largest

        whole = error(self.curves.relaxed, self.curves.contracted)
        rigid = error(self.curves.relaxed_rigid, self.curves.contracted_rigid)
        return Claim(
            "The series element is the main cause.",
            "4.1.3",
            rigid < (1 - _MAIN) * whole if whole > _SEEN else None,
            "deviation from the contractile element at the angle and activation of the moment, "
            f"RMS of the largest isometric torque: {whole:.1%}, and {rigid:.1%} with a series "
            f"element that stretches {self.curves.rigid:.0%} as much",
        )

    def draw(self, figure: Any) -> None:
        """Curves over their isometric torque: initial condition, place, clamp, series element."""
        curves = self.curves
        grid = figure.subplots(2, 2, sharex=True, sharey=True)
        relaxed = ("started relaxed", curves.relaxed, _RELAXED)
        contracted = ("started contracted", curves.contracted, _CONTRACTED)
        self._draw_compared(grid[0, 0], "initial condition", relaxed, contracted)
        self._draw_places(grid[0, 1])
        self._draw_compared(
            grid[1, 0],
            "clamp",
            ("started contracted, stiff", curves.contracted, _CONTRACTED),
            ("started contracted, compliant", curves.contracted_compliant, _SOFT),
        )
        self._draw_compared(
            grid[1, 1],
            "hardly any series element",
            ("started relaxed", curves.relaxed_rigid, _RELAXED),
            ("started contracted", curves.contracted_rigid, _CONTRACTED),
        )
        for axes in grid.flat:
            axes.axvline(0, color="0.6", lw=0.8)
            axes.set_ylim(-0.05, 1.5)
            axes.legend(frameon=False, fontsize=9, loc="upper right")
            tidy(axes)
        for axes in grid[1]:
            axes.set_xlabel("velocity of shortening [°/s]")
        for axes in grid[:, 0]:
            axes.set_ylabel("torque, of isometric torque [-]")

    def _draw_compared(
        self, axes: Any, title: str, *compared: tuple[str, Curve, dict[str, Any]]
    ) -> None:
        isometric = float(self.curves.isometric[0])
        axes.plot(*self._scaled(self.curves.own[0], isometric), **_OWN)
        for label, curve, look in compared:
            axes.plot(*self._scaled(curve.at[0], isometric), label=label, **look)
        place = round(degrees(self.sweep.angles[0]))
        axes.set_title(f"{title}, read at {place}°", fontsize=11)

    def _draw_places(self, axes: Any) -> None:
        curves, found = self.curves, self.curves.contracted
        axes.plot(*self._scaled(curves.own[0], float(curves.isometric[0])), **_OWN)
        axes.plot(*self._scaled(found.peak, curves.largest), label="peak", **_LOOKS[0])
        for look, angle, torque, isometric in zip(
            _LOOKS[1:], self.sweep.angles, found.at, curves.isometric.tolist(), strict=False
        ):
            label = f"at {round(degrees(angle))}°"
            axes.plot(*self._scaled(torque, isometric), label=label, **look)
        axes.set_title("where it is read, started contracted", fontsize=11)

    def _scaled(self, torque: _Values, isometric: float) -> tuple[_Values, _Values]:
        """Velocities [°/s] and relative torques of a curve, with its isometric point."""
        velocities = self.sweep.velocities
        k = int(np.searchsorted(velocities, 0.0))
        return np.insert(np.degrees(velocities), k, 0.0), np.insert(torque / isometric, k, 1.0)

    def film(self) -> Recording | None:
        """The recorded contraction."""
        return next(iter(self.recordings.values()), None)


def isovelocity(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    velocities: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Isovelocity:
    """Torque-velocity curves of a fully excited muscle, on a machine that clamps velocity.

    The machine moves the joint through the middle four fifths of its range of motion. It reaches
    its velocity within 40 ms or a tenth of its travel. Excitation starts with the movement, or,
    where the muscle starts contracted, long before. Torque is the gauge's reading minus that of
    the same movement with all muscles relaxed. The experiment compares two machines, which full
    contraction turns by 0.2° and by 5°, and a muscle whose series element stretches 2 % as much.

    Args:
        joint: The joint or its name.
        muscle: The muscle that contracts; by default the joint's first.
        velocities: Joint velocities, positive where the muscle shortens [rad/s]; by default ten
            from 2.5 to 90 % of the contractile element's largest, and five of lengthening.
        angles: Joint angles at which torque is read [rad]; by default the quarters of the travel.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: A joint or muscle is unknown, a velocity cannot be clamped, no velocity
            shortens the muscle, or torque cannot be read at an angle.
        UnmeasuredError: The series element is too stiff to compare it with a stiffer one.
    """
    subject = as_joint(joint)
    chosen = as_muscle(subject, muscle)
    parameters = subject.hill_muscles[chosen]
    top = parameters.max_velocity / abs(subject.gears[chosen])
    wanted = _numbers("velocities", top * np.array(_SHARES) if velocities is None else velocities)
    if not (wanted > 0).any():
        raise ValueError(f"velocities must have one above 0, which shortens {chosen}")
    sweep = make_sweep(
        subject, chosen, wanted, None if angles is None else _numbers("angles", angles)
    )
    stiff, compliant = stiff_machine(subject), compliant_machine(subject, _COMPLIANT)
    share = _rigid_share(subject, chosen, stiff)
    rigid_muscle = replace(parameters, series_stretch=share * parameters.series_stretch)
    rigid = replace(subject, muscles={**subject.muscles, chosen: rigid_muscle})
    found: list[Curve] = []
    for one, machine in ((subject, stiff), (subject, compliant), (rigid, stiff)):
        for before in (0.0, 1.0):
            found.append(measure_curve(one, machine, sweep, before=before))
            if progress:
                progress(len(found) / 8)
    largest, isometric = measure_isometric(subject, stiff, sweep)
    own_best, own = own_curve(subject, sweep)
    relaxed, contracted, *others = found
    curves = Curves(
        shares=sweep.velocities / top,
        largest=largest,
        isometric=isometric,
        own_best=own_best,
        own=own,
        relaxed=relaxed,
        contracted=contracted,
        relaxed_compliant=others[0],
        contracted_compliant=others[1],
        relaxed_rigid=others[2],
        contracted_rigid=others[3],
        rigid=share,
    )
    recordings = _recording(subject, stiff, sweep)
    if progress:
        progress(1.0)
    return Isovelocity(subject.name, sweep, curves, (stiff, compliant), recordings)


def _numbers(what: str, values: ArrayLike) -> _Values:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 1 or len(numbers) == 0:
        raise ValueError(f"{what} must be a list of numbers, got {values!r}")
    return numbers


def _rigid_share(joint: Joint, muscle: str, machine: Dynamometer) -> float:
    """Smallest share of its stretch to which a series element can be reduced.

    A step of MuJoCo's implicitfast, which uses the machine's damping d at its end, is stable up to
    h² k < 4 J + 2 h d, with k the stiffness of muscle and machine together.

    Raises:
        UnmeasuredError: The share is above 20 %.
    """
    one, timestep = joint.hill_muscles[muscle], build_rig(joint).timestep
    limit = (4 * joint.inertia + 2 * timestep * machine.damping) / timestep**2
    steepest = one.eccentric_plateau * one.max_isometric_force * one.series_shape
    steepest *= joint.gears[muscle] ** 2 / ((1 - exp(-one.series_shape)) * one.series_stretch)
    share = max(_RIGID, steepest / (_STABLE * limit - machine.stiffness))
    if share > 0.2:
        raise UnmeasuredError(
            f"{muscle} has so stiff a series element that a timestep of {timestep:g} s does not "
            f"allow a much stiffer one: {share:.0%} of its stretch would have to stay"
        )
    return share


def _recording(joint: Joint, machine: Dynamometer, sweep: Sweep) -> dict[str, Recording]:
    """A contraction at the middle of the velocities of shortening, started relaxed."""
    shortening = sweep.velocities[sweep.shortening]
    one = replace(sweep, velocities=shortening[len(shortening) // 2 :][:1])
    path, _ = machine_paths(one, build_rig(joint).timestep)
    recording = record_path(joint, machine, path[0], sweep.muscle, before=0.0, excitation=1.0)
    return {f"{degrees(one.velocities[0]):.0f}°/s, started relaxed": recording}
