"""Release of a joint that is coupled to a spring (sect. 4.3.1, Fig. 10).

After Lacquaniti et al. (1982): the limb is coupled to an external spring, held away from the angle
at which the spring is slack, and suddenly released, while both muscles contract. The paper gives
neither springs nor posture nor deflection. Here:

- the spring is slack where the muscles are in balance, which is the home angle if the joint stays
  there at every co-contraction with the softest spring;
- the deflection is 10°;
- one radian stretches the springs to half, once and twice the largest torque of the weaker muscle;
- a constant torque holds the joint until the muscles are steady, and is then removed at once.

The fit is one of limb and spring together, over one period of the limb on the spring alone, the
same at every co-contraction. The stiffness of the joint is the fitted one less that of the spring.
The paper does not say how long its fits are. Longer fits see more of the muscles' yielding, as less
K and more B.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import degrees, pi, radians, sqrt
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from mjhill.analysis.swing import Swing, first_swing
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import shades, tidy
from mjhill.experiments.external_impulse import strongly_rises, swing_measures
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.joints.joint import Joint
from mjhill.lab.postures import (
    NotHeld,
    balancing_excitations,
    check_angle,
    check_ascending,
    check_between,
    held_cocontractions,
    stablest_angle,
)
from mjhill.lab.rig import Spring, as_joint, at_rest, build_rig, net_torque, record_run
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import step

_TORQUES = (0.5, 1.0, 2.0)  # of the springs at 1 rad [largest torque of the weaker muscle]
_CLOSE = 0.1  # largest misfit of a good fit, in units of the peak
_HELD = 0.1  # time before the release in a recording [s]
_SHOWN = 0.7  # time axis of the figure [s]
_MARKS = "osD^v"


@dataclass(frozen=True)
class Release:
    """One release.

    Attributes:
        spring: Stiffness of the spring [N·m/rad].
        cocontraction: Co-contraction [-].
        hold: Torque that is removed, positive along the deflection [N·m].
        swing: Limb and spring as a second-order system, positive along the way back.
        run: The recording; the release is at 0.1 s.
    """

    spring: float
    cocontraction: float
    hold: float
    swing: Swing
    run: Recording = field(repr=False)

    @property
    def stiffness(self) -> float:
        """Stiffness of the joint without the spring [N·m/rad]."""
        return self.swing.stiffness - self.spring


@dataclass(frozen=True)
class SpringRelease(Result):
    """Releases from several springs at several co-contractions.

    Attributes:
        joint: Name of the joint.
        angle: The posture, at which the springs are slack [rad].
        deflection: Angle of the release, from the posture [rad].
        excitations: Excitation of each muscle [-], by co-contraction at which the joint stays.
        not_held: Co-contractions at which the joint does not stay, and why.
        releases: Every release, by spring and then by co-contraction.
        recordings: All runs.
    """

    title: ClassVar[str] = "Release from external springs"
    section: ClassVar[str] = "4.3.1, Fig. 10"
    size: ClassVar[tuple[float, float]] = (9.0, 6.5)
    joint: str
    angle: float
    deflection: float
    excitations: Mapping[float, Mapping[str, float]]
    not_held: tuple[NotHeld, ...]
    releases: tuple[Release, ...]
    recordings: Mapping[str, Recording] = field(default_factory=dict, repr=False)

    def by_spring(self) -> dict[float, tuple[Release, ...]]:
        """The releases from each spring [N·m/rad], by rising co-contraction."""
        springs = dict.fromkeys(release.spring for release in self.releases)
        return {k: tuple(one for one in self.releases if one.spring == k) for k in springs}

    def measures(self) -> Iterator[Measure]:
        """The second-order fit of every release, and the stiffness of the joint in it."""
        yield Measure("posture", degrees(self.angle), "°")
        yield Measure("deflection before the release", degrees(self.deflection), "°")
        for one in self.releases:
            label = f"spring of {one.spring:.3g} N·m/rad at {one.cocontraction:g}"
            yield Measure(f"stiffness of the joint alone, {label}", one.stiffness, "N·m/rad")
            yield from swing_measures(f"joint and spring, {label}", one.swing)
        for lost in self.not_held:
            yield Measure(f"release at {lost.label}", None, "°", note=lost.reason)

    def claims(self) -> Iterator[Claim]:
        """The two claims of the section."""
        yield self._damping_claim()
        rising = all(
            strongly_rises([one.stiffness for one in releases])
            and strongly_rises([one.swing.damping for one in releases])
            for releases in self.by_spring().values()
        )
        yield Claim(
            "Stiffness and viscosity of the joint are strong functions of co-contraction (here: "
            "both rise with it, to twice as much or more).",
            "4.3.1, Fig. 10b",
            rising if len(self.excitations) > 1 else None,
            f"at co-contraction {_list(self.excitations)}: "
            + "; ".join(
                f"spring of {spring:.3g} N·m/rad, K {_list(one.stiffness for one in releases)} "
                f"N·m/rad and B {_list(one.swing.damping for one in releases)} N·m·s/rad"
                for spring, releases in self.by_spring().items()
            ),
        )

    def _damping_claim(self) -> Claim:
        ratios = [one.swing.damping_ratio for one in self.releases]
        found = [ratio for ratio in ratios if ratio is not None]
        both = zip(self.releases, ratios, strict=True)
        over = [one for one, ratio in both if ratio is None or ratio >= 1]
        span = f"{min(found):.2f} to {max(found):.2f}" if found else "not found"
        misfits = [one.swing.misfit for one in self.releases]
        whole = [one.swing.misfit_of_run for one in self.releases]
        which = ", ".join(f"{one.spring:.3g} N·m/rad at {one.cocontraction:g}" for one in over)
        return Claim(
            "Responses under a variety of loads are approximated well as those of an underdamped "
            "second-order system.",
            self.section,
            not over and max(misfits) <= _CLOSE,
            f"damping ratios {span}, misfits over a period of limb and spring {min(misfits):.1%} "
            f"to {max(misfits):.1%} of the peak (up to {_CLOSE:.0%} is good), of the whole run "
            f"{min(whole):.1%} to {max(whole):.1%}; not underdamped in {len(over)} of {len(ratios)}"
            f"{': ' if over else ''}{which}",
        )

    def film(self) -> Recording:
        """The release from the middle spring at the middle co-contraction."""
        releases = list(self.by_spring().values())[len(self.by_spring()) // 2]
        return releases[len(releases) // 2].run

    def draw(self, figure: Any) -> None:
        """Angles and torques after a release, K and B against co-contraction."""
        grid = figure.subplots(2, 2)
        springs = self.by_spring()
        middle = list(springs)[len(springs) // 2]
        self._draw_runs(grid[0, 0], grid[1, 0], springs[middle])
        grid[0, 0].set_title(f"a  release from a spring of {middle:.3g} N·m/rad", fontsize=10)
        self._draw_fits(grid[0, 1], "K of the joint [N·m/rad]", lambda one: one.stiffness)
        self._draw_fits(grid[1, 1], "B [N·m·s/rad]", lambda one: one.swing.damping)
        grid[0, 1].set_title("b  second-order fits", fontsize=10)
        grid[0, 1].legend(title="spring [N·m/rad]", title_fontsize=8, frameon=False, fontsize=8)
        grid[1, 1].set_xlabel("co-contraction [-]")
        figure.align_ylabels(grid)

    def _draw_runs(self, upper: Any, lower: Any, releases: tuple[Release, ...]) -> None:
        """Deflection and muscle torques with one spring at every co-contraction."""
        muscles = next(iter(self.excitations.values()))
        for one, shade in zip(releases, shades(len(releases)), strict=True):
            time = 1e3 * one.run.time
            moved = np.degrees(one.run[f"{self.joint}.angle"] - self.angle)
            upper.plot(time, moved, color=shade, label=f"{one.cocontraction:g}")
            # a paler line means a lower co-contraction, as in the upper axes
            opacity = 1.0 - float(shade)
            for name, colour in zip(muscles, MUSCLE_COLOURS, strict=False):
                label = spoken(name) if one is releases[-1] else None
                force = one.run[f"{name}.force"]
                lower.plot(time, force, color=colour, alpha=opacity, label=label)
        upper.legend(title="co-contraction", title_fontsize=8, frameon=False, fontsize=8)
        upper.set_ylabel("deflection [°]")
        lower.set_ylabel("muscle torque [N·m]")
        lower.set_xlabel("time [ms]")
        lower.set_ylim(0, 1.3 * lower.get_ylim()[1])  # room for the legend
        lower.legend(frameon=False, fontsize=8, ncols=2, loc="upper right")
        for axes in (upper, lower):
            axes.set_xlim(0, 1e3 * min(_SHOWN, releases[0].run.time[-1]))
            tidy(axes)

    def _draw_fits(self, axes: Any, label: str, value: Callable[[Release], float]) -> None:
        springs = self.by_spring()
        for number, (spring, releases) in enumerate(springs.items()):
            cocontractions = [one.cocontraction for one in releases]
            values = [value(one) for one in releases]
            shade, mark = shades(len(springs))[number], _MARKS[number % len(_MARKS)]
            axes.plot(cocontractions, values, marker=mark, ms=5, color=shade, label=f"{spring:.3g}")
        axes.set_ylabel(label)
        axes.set_xlim(0, None)
        axes.set_ylim(min(0.0, axes.get_ylim()[0]), None)
        tidy(axes)


def spring_release(
    joint: str | Joint = "elbow",
    *,
    cocontraction: Sequence[float] = (0.02, 0.2, 0.5),
    springs: Sequence[float] | None = None,
    angle: float | None = None,
    deflection: float = radians(10.0),
    duration: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> SpringRelease:
    """Release a joint from springs at several co-contractions.

    Args:
        joint: A joint or its name.
        cocontraction: Co-contractions [-], ascending.
        springs: Stiffnesses [N·m/rad], ascending; by default half, once and twice the largest
            torque of the weaker muscle per radian.
        angle: Angle at which the springs are slack and the muscles in balance [rad]; by default
            the home angle or, if the joint does not stay there, the angle at which it is most
            stable.
        deflection: Angle of the release from there, towards the middle of the range [rad].
        duration: Duration of a run after the release [s].
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown or an option is out of range.
        UnmeasuredError: The joint stays at none of the co-contractions.
    """
    joint = as_joint(joint)
    wanted = check_ascending("cocontraction", cocontraction, 0.0, 1.0)
    weakest = min(muscle.max_isometric_force for muscle in joint.muscles.values())
    if springs is None:
        springs = [torque * weakest for torque in _TORQUES]
    stiffnesses = check_ascending("springs", springs, 0.0, 1e6, least=1)
    check_angle(joint, angle)
    check_between("deflection", deflection, 0.0, 0.5 * (joint.range[1] - joint.range[0]), "rad")
    check_between("duration", duration, 0.1, 60.0, "s")
    conditions = [partial(balancing_excitations, joint, u) for u in wanted]
    if angle is None:
        angle = stablest_angle(joint, conditions, stiffnesses[0])
    held, not_held = held_cocontractions(joint, wanted, angle, stiffnesses[0])
    away = deflection if angle < 0.5 * sum(joint.range) else -deflection
    pairs = [(spring, u) for spring in stiffnesses for u in held]
    releases = []
    for spring, u in pairs:
        releases.append(release(joint, spring, u, held[u], angle, away, duration))
        if progress is not None:
            progress(len(releases) / len(pairs))
    runs = {f"{one.spring:.3g} N·m/rad at {one.cocontraction:g}": one.run for one in releases}
    return SpringRelease(
        joint.name, angle, away, held, not_held, tuple(releases), MappingProxyType(runs)
    )


def release(
    joint: Joint,
    spring: float,
    cocontraction: float,
    excitations: Mapping[str, float],
    angle: float,
    away: float,
    duration: float,
) -> Release:
    """Hold a joint on a spring and release it.

    Args:
        joint: The joint.
        spring: Stiffness of the spring [N·m/rad].
        cocontraction: Co-contraction [-].
        excitations: Excitation of each muscle at that co-contraction [-].
        angle: Angle at which the spring is slack [rad].
        away: Angle at which the joint is held, from there [rad], not 0.
        duration: Duration of the run after the release [s].
    """
    rig = build_rig(joint, exact=True, spring=Spring(spring, angle))
    hold = spring * away - net_torque(joint, excitations, angle + away)
    start = at_rest(rig, angle + away, excitations)
    run = record_run(rig, start, _HELD + duration, torque=hold + step(-hold, _HELD))
    first, sign = round(_HELD / rig.timestep), float(np.sign(away))
    back = -sign * (run[f"{joint.name}.angle"][first:] - angle - away)
    velocity = -sign * run[f"{joint.name}.velocity"][first:]
    period = 2 * pi * sqrt(joint.inertia / spring)
    load = np.full(len(back), sign * hold)
    swing = first_swing(run.time[first:], back, velocity, load, joint.inertia, period)
    return Release(spring, cocontraction, sign * hold, swing, run)


def _list(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
