"""An external torque impulse at several co-contraction levels (sect. 4.3.1, Fig. 9).

A body is fixed to the limb, as after Houk (1963), and a short torque hits the joint, which its two
muscles hold in balance. The paper states neither inertia nor impulse nor posture: here the body has
the limb's own inertia; the impulse is the one that deflects the joint by 5° at the lowest level,
and one three times as large; the posture is the home angle if the joint stays there at every level,
else where it is the steadiest. The reflexes of Fig. 9c are stood in for by one burst of input.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import degrees, radians
from types import MappingProxyType
from typing import Any, ClassVar

from mjhill.experiments.figures.external_impulse import draw
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.experiments.trials.hit import (
    Hammer,
    Hit,
    at,
    falls,
    impedance,
    rises,
    shrinks,
    stiffens,
    strongly_rises,
)
from mjhill.experiments.trials.neural_burst import Burst, hit_with_burst
from mjhill.experiments.trials.swing import swing_measures
from mjhill.joints.joint import Joint
from mjhill.lab.linear_elements import linear_elements
from mjhill.lab.posture import (
    Unheld,
    balanced,
    check_angle,
    check_ascending,
    check_between,
    held_levels,
    steadiest,
)
from mjhill.lab.rig import as_joint
from mjhill.simulate.recording import Recording


@dataclass(frozen=True)
class ExternalImpulse(Result):
    """Responses to impulses.

    Attributes:
        joint: Name of the joint.
        angle: The posture [rad].
        sign: 1 where the impulse is towards positive angles, -1 where towards negative ones.
        added_inertia: Of the body [kg·m²].
        levels: Inputs of the muscles at each level that is held [-].
        unheld: Levels that the muscles cannot hold, and why.
        small: Hits by the small impulse, one a level.
        large: Hits by the large one.
        linear: Hits by the small one of a joint with linear series and contractile elements.
        burst: A hit by the large one, and a neural burst, at the middle level.
        recordings: All runs.
    """

    title: ClassVar[str] = "Torque impulse at several co-contraction levels"
    section: ClassVar[str] = "4.3.1, Fig. 9"
    size: ClassVar[tuple[float, float]] = (9.0, 8.0)
    joint: str
    angle: float
    sign: float
    added_inertia: float
    levels: Mapping[float, Mapping[str, float]]
    unheld: tuple[Unheld, ...]
    small: tuple[Hit, ...]
    large: tuple[Hit, ...]
    linear: tuple[Hit, ...]
    burst: Burst
    recordings: Mapping[str, Recording] = field(default_factory=dict, repr=False)

    def measures(self) -> Iterator[Measure]:
        """Of every hit: deflection, its time, the second-order fit."""
        yield Measure("posture", degrees(self.angle), "°")
        yield Measure("added inertia", self.added_inertia, "kg·m²")
        for name, hits in (("small", self.small), ("large", self.large)):
            yield Measure(f"impulse, {name}", hits[0].impulse, "N·m·s")
            for hit in hits:
                yield from swing_measures(f"{name} at {hit.level:g}", hit.swing)
        for hit in self.linear:
            label = f"linear elements at {hit.level:g}"
            yield Measure(f"stiffness K, {label}", hit.swing.stiffness, "N·m/rad")
            yield Measure(f"viscosity B, {label}", hit.swing.damping, "N·m·s/rad")
        yield from self.burst.measures()
        for one in self.unheld:
            yield Measure(f"response at {one.label}", None, "°", note=one.reason)

    def claims(self) -> Iterator[Claim]:
        """The five claims of the section."""
        yield self._claim(
            "The response to an impulse depends strongly on co-contraction: "
            "it falls as that rises (here: to half or less).",
            strongly_rises([1 / hit.swing.peak for hit in self.small]),
            "peaks " + at(self.small, lambda s: f"{degrees(s.peak):.2f}°"),
        )
        yield self._claim(
            "Stiffness and viscosity of the response rise with co-contraction.",
            stiffens(self.small),
            at(self.small, impedance),
        )
        yield self._claim(
            "A larger impulse gives a similar picture.",
            falls(self.large) and stiffens(self.large),
            f"{self.large[0].impulse / self.small[0].impulse:.3g} times the impulse: peaks "
            + at(self.large, lambda s: f"{degrees(s.peak):.2f}°")
            + "; "
            + at(self.large, impedance),
        )
        yield self.burst.claim()
        steep, flat = rises(self.small), rises(self.linear)
        yield self._claim(
            "The cause is the nonlinearity of series and contractile element: linear ones show no "
            "such effect, as their stiffness does not depend on the operating range.",
            all(map(shrinks, steep, flat)),
            f"from the lowest to the highest level K rises by a factor of {steep[0]:.3g} and B by "
            f"{steep[1]:.3g}; with linear elements by {flat[0]:.3g} and {flat[1]:.3g}",
        )

    def draw(self, figure: Any) -> None:
        """Deflections, the burst beside the torques, K and B against co-contraction."""
        draw(self, figure)

    def film(self) -> Recording:
        """The large impulse at the middle level."""
        return self.large[len(self.large) // 2].run

    def _claim(self, sentence: str, holds: bool, evidence: str) -> Claim:
        """A claim about several levels, undecided where only one is held."""
        decided = len(self.small) > 1
        return Claim(sentence, self.section, holds if decided else None, evidence)


def external_impulse(
    joint: str | Joint = "elbow",
    *,
    levels: Sequence[float] = (0.02, 0.2, 0.5),
    angle: float | None = None,
    added_inertia: float | None = None,
    deflection: float = radians(5.0),
    larger: float = 3.0,
    width: float = 0.02,
    burst: float = 0.3,
    duration: float = 1.5,
    progress: Callable[[float], None] | None = None,
) -> ExternalImpulse:
    """Hit a joint at several co-contraction levels.

    Args:
        joint: A joint or its name.
        levels: Co-contraction [-], ascending.
        angle: The posture [rad]; without it the home angle or, where the joint does not stay
            there at every level, the angle where it is the steadiest.
        added_inertia: Of a body fixed to the limb [kg·m²]; the limb's own without it.
        deflection: Peak deflection that the small impulse gives at the lowest level [rad].
        larger: The large impulse over the small one.
        width: Of the impulse [s].
        burst: What a neural burst of 40 ms adds to the input of the stretched muscle [-].
        duration: Of a run [s].
        progress: Called now and then with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown or an option is out of range.
        UnmeasuredError: The joint stays at none of the levels.
    """
    joint = as_joint(joint)
    levels = check_ascending("levels", levels, 0.0, 1.0)
    check_angle(joint, angle)
    check_between("deflection", deflection, 0.0, 0.5 * (joint.range[1] - joint.range[0]), "rad")
    check_between("larger", larger, 1.0, 100.0, "")
    check_between("burst", burst, 0.0, 1.0, "")
    check_between("duration", duration, 0.3, 60.0, "s")
    check_between("width", width, 0.0, 0.25 * duration, "s")
    body = joint.inertia if added_inertia is None else added_inertia
    check_between("added_inertia", body + joint.inertia, 0.0, 1e4, "kg·m² with the limb's")
    if angle is None:
        angle = steadiest(joint, [partial(balanced, joint, level) for level in levels])
    held, unheld = held_levels(joint, levels, angle)
    sign = 1.0 if angle < 0.5 * sum(joint.range) else -1.0  # where there is the more room
    middle = list(held)[len(held) // 2]
    flat = linear_elements(joint, held[middle], angle)

    hammer = Hammer(angle, sign, body, width, duration)
    lowest = next(iter(held))
    impulse = hammer.impulse(joint, lowest, held[lowest], deflection)
    sets: dict[str, list[Hit]] = {"small": [], "large": [], "linear": []}
    for done, (level, inputs) in enumerate(held.items()):
        sets["small"].append(hammer.hit(joint, level, inputs, impulse))
        sets["large"].append(hammer.hit(joint, level, inputs, larger * impulse))
        sets["linear"].append(hammer.hit(flat, level, inputs, impulse))
        if progress is not None:
            progress((done + 1) / (len(held) + 1))
    answer = hit_with_burst(hammer, joint, held[middle], impulse=larger * impulse, height=burst)
    if progress is not None:
        progress(1.0)
    recordings = {f"{n} at {h.level:g}": h.run for n, hits in sets.items() for h in hits}
    return ExternalImpulse(
        joint=joint.name,
        angle=angle,
        sign=sign,
        added_inertia=body,
        levels=held,
        unheld=unheld,
        small=tuple(sets["small"]),
        large=tuple(sets["large"]),
        linear=tuple(sets["linear"]),
        burst=answer,
        recordings=MappingProxyType({**recordings, "burst": answer.run}),
    )
