"""Release of a joint that is coupled to a spring (sect. 4.3.1, Fig. 10).

After Lacquaniti et al. (1982): the limb, coupled to an external spring, is held away from where the
spring is slack and suddenly let go, both muscles contracting. The paper states neither springs nor
posture nor deflection: here the spring is slack where the muscles are in balance, the home angle if
the joint stays there at every level with the softest spring; it is stretched by 10°; the springs
would take half, once and twice the largest torque of the weaker muscle per radian. A constant
torque holds the joint until the muscles are still, and is taken away at once.

The fit is one of limb and spring, over a period of the limb on the spring alone, the same at every
level; the joint's own stiffness is the fitted one less the spring's. How long the paper's fits are
it does not say; longer ones see more of the muscles' yielding, as less K and more B.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import degrees, radians
from types import MappingProxyType
from typing import Any, ClassVar

from mjhill.experiments.figures.spring_release import draw
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.experiments.trials.hit import strongly_rises
from mjhill.experiments.trials.spring_trial import Release, release
from mjhill.experiments.trials.swing import swing_measures
from mjhill.joints.joint import Joint
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

_SHARES = (0.5, 1.0, 2.0)  # torque of the springs at 1 rad [largest of the weaker muscle]
_CLOSE = 0.1  # misfit, as a share of the peak, up to which a fit is a good one


@dataclass(frozen=True)
class SpringRelease(Result):
    """Releases from several springs at several levels.

    Attributes:
        joint: Name of the joint.
        angle: The posture, where the springs are slack [rad].
        deflection: From where the joint is released, from the posture [rad].
        levels: Inputs of the muscles at each level that is held [-].
        unheld: Levels that the muscles cannot hold, and why.
        releases: Every release, by spring and then by level.
        recordings: All runs.
    """

    title: ClassVar[str] = "Release from external springs"
    section: ClassVar[str] = "4.3.1, Fig. 10"
    size: ClassVar[tuple[float, float]] = (9.0, 6.5)
    joint: str
    angle: float
    deflection: float
    levels: Mapping[float, Mapping[str, float]]
    unheld: tuple[Unheld, ...]
    releases: tuple[Release, ...]
    recordings: Mapping[str, Recording] = field(default_factory=dict, repr=False)

    def by_spring(self) -> dict[float, tuple[Release, ...]]:
        """The releases from each spring [N·m/rad], levels ascending."""
        springs = dict.fromkeys(release.spring for release in self.releases)
        return {k: tuple(one for one in self.releases if one.spring == k) for k in springs}

    def measures(self) -> Iterator[Measure]:
        """Of every release: the second-order fit, and the joint's part of the stiffness."""
        yield Measure("posture", degrees(self.angle), "°")
        yield Measure("deflection before the release", degrees(self.deflection), "°")
        for one in self.releases:
            label = f"spring of {one.spring:.3g} N·m/rad at {one.level:g}"
            yield Measure(f"stiffness of the joint alone, {label}", one.stiffness, "N·m/rad")
            yield from swing_measures(f"joint and spring, {label}", one.swing)
        for unheld in self.unheld:
            yield Measure(f"release at {unheld.label}", None, "°", note=unheld.reason)

    def claims(self) -> Iterator[Claim]:
        """The two claims of the section."""
        ratios = [one.swing.damping_ratio for one in self.releases]
        found = [ratio for ratio in ratios if ratio is not None]
        both = zip(self.releases, ratios, strict=True)
        over = [one for one, ratio in both if ratio is None or ratio >= 1]
        span = f"{min(found):.2f} to {max(found):.2f}" if found else "not found"
        misfits = [one.swing.misfit for one in self.releases]
        whole = [one.swing.misfit_of_run for one in self.releases]
        which = ", ".join(f"{one.spring:.3g} N·m/rad at {one.level:g}" for one in over)
        yield Claim(
            "Responses under a variety of loads are approximated well as those of an underdamped "
            "second-order system.",
            self.section,
            not over and max(misfits) <= _CLOSE,
            f"damping ratios {span}, misfits over a period of limb and spring {min(misfits):.1%} "
            f"to {max(misfits):.1%} of the peak (up to {_CLOSE:.0%} is good), of the whole run "
            f"{min(whole):.1%} to {max(whole):.1%}; not underdamped in {len(over)} of {len(ratios)}"
            f"{': ' if over else ''}{which}",
        )
        rising = all(_rises(releases) for releases in self.by_spring().values())
        yield Claim(
            "Stiffness and viscosity of the joint are strong functions of co-contraction (here: "
            "both rise with it, to twice as much or more).",
            "4.3.1, Fig. 10b",
            rising if len(self.levels) > 1 else None,
            f"at co-contraction {_list(self.levels)}: "
            + "; ".join(
                f"spring of {spring:.3g} N·m/rad, K {_list(one.stiffness for one in releases)} "
                f"N·m/rad and B {_list(one.swing.damping for one in releases)} N·m·s/rad"
                for spring, releases in self.by_spring().items()
            ),
        )

    def draw(self, figure: Any) -> None:
        """Angles and torques after a release, K and B against co-contraction."""
        draw(self, figure)

    def film(self) -> Recording:
        """The release from the middle spring at the middle level."""
        releases = list(self.by_spring().values())[len(self.by_spring()) // 2]
        return releases[len(releases) // 2].run


def _list(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _rises(releases: Sequence[Release]) -> bool:
    """Whether K and B rise strongly with the level."""
    stiffness = [one.stiffness for one in releases]
    return strongly_rises(stiffness) and strongly_rises([one.swing.damping for one in releases])


def spring_release(
    joint: str | Joint = "elbow",
    *,
    levels: Sequence[float] = (0.02, 0.2, 0.5),
    springs: Sequence[float] | None = None,
    angle: float | None = None,
    deflection: float = radians(10.0),
    duration: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> SpringRelease:
    """Release a joint from springs at several co-contraction levels.

    Args:
        joint: A joint or its name.
        levels: Co-contraction [-], ascending.
        springs: Stiffnesses [N·m/rad], ascending; without them half, once and twice the largest
            torque of the weaker muscle per radian.
        angle: Where the springs are slack and the muscles in balance [rad]; without it the home
            angle or, where the joint does not stay there, the angle where it is the steadiest.
        deflection: How far it is held away from there, towards the middle of its range [rad].
        duration: Of a run after the release [s].
        progress: Called now and then with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown or an option is out of range.
        UnmeasuredError: The joint stays at none of the levels.
    """
    joint = as_joint(joint)
    levels = check_ascending("levels", levels, 0.0, 1.0)
    weakest = min(muscle.max_isometric_force for muscle in joint.muscles.values())
    wanted = [share * weakest for share in _SHARES] if springs is None else springs
    stiffnesses = check_ascending("springs", wanted, 0.0, 1e6, least=1)
    check_angle(joint, angle)
    check_between("deflection", deflection, 0.0, 0.5 * (joint.range[1] - joint.range[0]), "rad")
    check_between("duration", duration, 0.1, 60.0, "s")
    soft = stiffnesses[0]
    if angle is None:
        angle = steadiest(joint, [partial(balanced, joint, level) for level in levels], soft)
    held, unheld = held_levels(joint, levels, angle, soft)
    sign = 1.0 if angle < 0.5 * sum(joint.range) else -1.0
    pairs = [(spring, level) for spring in stiffnesses for level in held]
    releases = []
    for spring, level in pairs:
        away = sign * deflection
        releases.append(release(joint, spring, level, held[level], angle, away, duration))
        if progress is not None:
            progress(len(releases) / len(pairs))
    return SpringRelease(
        joint=joint.name,
        angle=angle,
        deflection=sign * deflection,
        levels=held,
        unheld=unheld,
        releases=tuple(releases),
        recordings=MappingProxyType(
            {f"{one.spring:.3g} N·m/rad at {one.level:g}": one.run for one in releases}
        ),
    )
