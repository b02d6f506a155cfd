"""Torque-velocity curves of a joint as a velocity-clamping machine finds them (4.1.3, Fig. 6)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, exp, radians
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.experiments.figures.isovelocity import draw
from mjhill.experiments.paper.isovelocity_claims import Curves, claims
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.experiments.trials.torque_velocity import (
    Curve,
    Sweep,
    isometric,
    make_sweep,
    measure,
    own_curve,
    paths,
)
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometry import machine_giving_way, recorded, stiff_machine
from mjhill.lab.rig import (
    Dynamometer,
    UnmeasuredError,
    as_joint,
    as_muscle,
    build_rig,
)
from mjhill.simulate.recording import Recording

SHARES = (  # of the contractile element's largest velocity
    *(-0.4, -0.2, -0.1, -0.05, -0.025),
    *(0.025, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.7, 0.9),
)
COMPLIANT = radians(5.0)  # that a padded arm and the soft tissue under it give way [rad]
NEARLY_NONE = 0.02  # of the series element's stretch
_STABLE = 0.8  # of the stiffness at which a step becomes unstable


@dataclass(frozen=True)
class Isovelocity(Result):
    """Torque-velocity curves of one muscle, as measured and as its contractile element has them.

    Attributes:
        joint: Name of the joint.
        sweep: What was done.
        curves: What was measured, and the contractile element's own.
        machines: The stiff and the compliant dynamometer.
        recordings: A contraction in the middle of the velocities, started relaxed.
    """

    title: ClassVar[str] = "Isovelocity contraction"
    section: ClassVar[str] = "4.1.3, Fig. 6"
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
        k = curves.nearest(0.2)
        at = f"{sweep.muscle} at {degrees(sweep.velocities[k]):.0f}°/s"
        for name, curve in curves.measured():
            yield Measure(f"{at}, peak torque, {name}", float(curve.peak[k]), "N·m")
            for angle, torque in zip(sweep.angles, curve.at[:, k], strict=True):
                where = f"torque at {round(degrees(angle))}°"
                yield Measure(f"{at}, {where}, {name}", float(torque), "N·m")
        for angle, torque in zip(sweep.angles, curves.own[:, k], strict=True):
            where = f"torque at {round(degrees(angle))}°"
            yield Measure(f"{at}, {where}, contractile element's own", float(torque), "N·m")
        for name, machine in zip(("stiff", "compliant"), self.machines, strict=True):
            yield Measure(f"stiffness of the {name} machine", machine.stiffness, "N·m/rad")

    def claims(self) -> Iterator[Claim]:
        """What the measured curves depend on, and why."""
        return claims(self.sweep, self.curves)

    def draw(self, figure: Any) -> None:
        """Measured curves beside the contractile element's own."""
        draw(figure, self.sweep, self.curves)

    def film(self) -> Recording | None:
        """The contraction recorded."""
        return next(iter(self.recordings.values()), None)


def isovelocity(
    joint: str | Joint = "elbow",
    *,
    muscle: str | None = None,
    velocities: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Isovelocity:
    """Torque-velocity curves of a muscle under full input, on a machine that clamps velocity.

    The machine takes the joint through the middle four fifths of its range of motion. It is up to
    speed within 40 ms or a tenth of its way. Full input starts with the movement, or, where
    the muscle starts contracted, long before. Torque is the gauge's reading less that of the same
    movement with all muscles relaxed. Two machines are compared, which full contraction turns by
    0.2° and by 5°, and a muscle whose series element stretches a fiftieth as much.

    Args:
        joint: The joint, or the name of one.
        muscle: The muscle that contracts; the joint's first without it.
        velocities: Of the joint, positive where the muscle shortens [rad/s]; without them ten from
            2.5 to 90 % of the largest of the contractile element, and five of lengthening.
        angles: At which torque is read [rad]; the quarters of the way without them.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: A joint or muscle is unknown, a velocity cannot be clamped, no velocity
            shortens the muscle, or torque cannot be read at an angle.
        UnmeasuredError: The series element is so stiff that it cannot be told from none.
    """
    subject = as_joint(joint)
    chosen = as_muscle(subject, muscle)
    parameters = subject.muscles[chosen]
    top = parameters.max_velocity / abs(subject.gears[chosen])
    wanted = _numbers("velocities", top * np.array(SHARES) if velocities is None else velocities)
    if not (wanted > 0).any():
        raise ValueError(f"velocities must have one above 0, which shortens {chosen}")
    read = None if angles is None else _numbers("angles", angles)
    sweep = make_sweep(subject, chosen, wanted, read)
    stiff, compliant = stiff_machine(subject), machine_giving_way(subject, COMPLIANT)
    bare = _bare_share(subject, chosen, stiff)
    rigid = replace(parameters, series_stretch=bare * parameters.series_stretch)
    taken = replace(subject, muscles={**subject.muscles, chosen: rigid})
    found: list[Curve] = []
    for one, machine in ((subject, stiff), (subject, compliant), (taken, stiff)):
        for before in (0.0, 1.0):
            found.append(measure(one, machine, sweep, before=before))
            if progress:
                progress(len(found) / 8)
    largest, held = isometric(subject, stiff, sweep)
    relaxed, tensed, relaxed_compliant, tensed_compliant, relaxed_bare, tensed_bare = found
    best, own = own_curve(subject, sweep)
    curves = Curves(
        sweep.velocities / top, largest, held, best, own, relaxed, tensed,
        relaxed_compliant, tensed_compliant, relaxed_bare, tensed_bare, bare,
    )  # fmt: skip
    recording = _recording(subject, stiff, sweep)
    if progress:
        progress(1.0)
    return Isovelocity(subject.name, sweep, curves, (stiff, compliant), recording)


def _numbers(what: str, values: ArrayLike) -> NDArray[np.float64]:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 1 or len(numbers) == 0:
        raise ValueError(f"{what} must be a list of numbers, got {values!r}")
    return numbers


def _bare_share(joint: Joint, muscle: str, machine: Dynamometer) -> float:
    """Least share of its stretch that a series element keeps, such that the steps can follow it.

    A step of MuJoCo's implicitfast, which takes the machine's damping d at its end, is stable up to
    h² k < 4 J + 2 h d, with k the stiffness of muscle and machine together.

    Raises:
        UnmeasuredError: It is not much less than it has.
    """
    one, timestep = joint.muscles[muscle], build_rig(joint).timestep
    limit = (4 * joint.inertia + 2 * timestep * machine.damping) / timestep**2
    steepest = one.eccentric_plateau * one.max_isometric_force * one.series_shape
    steepest *= joint.gears[muscle] ** 2 / ((1 - exp(-one.series_shape)) * one.series_stretch)
    share = max(NEARLY_NONE, steepest / (_STABLE * limit - machine.stiffness))
    if share > 0.2:
        raise UnmeasuredError(
            f"{muscle} has so stiff a series element that steps of {timestep:g} s do not allow to "
            f"leave it out: {share:.0%} of its stretch would have to stay"
        )
    return share


def _recording(joint: Joint, machine: Dynamometer, sweep: Sweep) -> dict[str, Recording]:
    """A contraction at the middle of the velocities of shortening, started relaxed."""
    shortening = sweep.velocities[sweep.shortening]
    one = replace(sweep, velocities=shortening[len(shortening) // 2 :][:1])
    path, _ = paths(one, build_rig(joint).timestep)
    recording = recorded(joint, machine, path[0], sweep.muscle, before=0.0, level=1.0)
    return {f"{degrees(one.velocities[0]):.0f}°/s, started relaxed": recording}
