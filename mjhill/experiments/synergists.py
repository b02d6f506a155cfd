"""Several synergists and the one muscle that replaces them (sect. 3.2, Fig. 3).

The anatomy is in ``literature/synergists.toml``: so far the three heads of the elbow's extensor.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import degrees
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill import literature
from mjhill.experiments.drawing import tidy
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.joints.joint import Joint
from mjhill.lab.rig import as_joint, at_rest, build_rig, record_run
from mjhill.muscles.equivalent import (
    anatomical_muscle,
    equivalent_muscle,
    stretch_at_force,
    torque_at_velocity,
)
from mjhill.muscles.hill import Hill
from mjhill.simulate.recording import Recording

_DATA = Path(literature.__file__).parent / "synergists.toml"
_NEAR = 0.05  # share of the largest torque or of a movement that counts as approximately equal
_DURATION = 0.6  # of a free movement [s]

# blue, orange, green, purple of Okabe & Ito 2008; dashes, because some curves lie on others
_STYLES = (
    ("#0072b2", "-"),
    ("#e69f00", "-"),
    ("#009e73", (0, (3, 2))),
    ("#cc79a7", (0, (1, 1))),
)

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Synergists(Result):
    """Synergists and their equivalent muscle.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle of the joint that the synergists form together.
        heads: The synergists by name.
        equivalent: Their equivalent muscle.
        with_heads: Joint angle when all heads are fully excited [rad], shape (T,).
        with_equivalent: Joint angle when the equivalent is, in place of the heads, shape (T,).
        time: Time of both [s], shape (T,).
        recordings: Both runs.
    """

    title: ClassVar[str] = "Equivalent muscle of several synergists"
    section: ClassVar[str] = "3.2, Fig. 3"
    size: ClassVar[tuple[float, float]] = (9.0, 4.4)
    joint: str
    muscle: str
    heads: Mapping[str, Hill]
    equivalent: Hill
    with_heads: _Values
    with_equivalent: _Values
    time: _Values
    recordings: Mapping[str, Recording] = field(default_factory=dict, repr=False)

    def measures(self) -> Iterator[Measure]:
        """Torque, speed and stretch of each head and of the equivalent."""
        for name, muscle in {**self.heads, "equivalent": self.equivalent}.items():
            yield Measure(f"{name}: largest torque", muscle.max_isometric_force, "N·m")
            yield Measure(f"{name}: V_max", degrees(muscle.max_velocity), "°/s")
            yield Measure(f"{name}: Hill's A", muscle.hill_shape, "-")
            yield Measure(
                f"{name}: stretch at the largest torque", degrees(muscle.series_stretch), "°"
            )

    def claims(self) -> Iterator[Claim]:
        """What sect. 3.2 says about the equivalent muscle, and whether it can replace the heads."""
        heads = list(self.heads.values())
        speeds = np.linspace(0, max(head.max_velocity for head in heads), 200)
        total = torque_at_velocity(heads, speeds)
        off = np.abs(torque_at_velocity([self.equivalent], speeds) - total).max() / total[0]
        yield Claim(
            "The equivalent torque-velocity relation sums the individual torques at each velocity.",
            self.section,
            bool(off <= _NEAR),
            f"Hill's relation, fitted to the sum, differs from it by up to {off:.1%} of its "
            f"largest torque; {_NEAR:.0%} is allowed",
        )
        stretches = np.array([head.series_stretch for head in heads])
        strengths = np.array([head.max_isometric_force for head in heads])
        weighted, plain = float(strengths @ stretches / strengths.sum()), float(stretches.mean())
        found = self.equivalent.series_stretch
        yield Claim(
            "The equivalent series element is an average in which stronger muscles weigh more.",
            self.section,
            abs(found - weighted) < abs(found - plain),
            f"it stretches by {degrees(found):.1f}° at the largest torque; the mean of the heads "
            f"is {degrees(weighted):.1f}° weighted by strength, {degrees(plain):.1f}° unweighted",
        )
        apart = float(np.abs(self.with_heads - self.with_equivalent).max())
        movement = float(np.ptp(self.with_heads))
        yield Claim(
            "One equivalent muscle can replace the synergists in a movement.",
            self.section,
            apart <= _NEAR * movement,
            f"at full excitation the joint with the heads and the joint with their equivalent "
            f"differ by at most {degrees(apart):.2f}° in a movement of {degrees(movement):.0f}°",
        )

    def draw(self, figure: Any) -> None:
        """Torque over velocity and over stretch, as in Fig. 3a and b."""
        speed_axis, stretch_axis = figure.subplots(1, 2, sharey=True)
        for index, (name, muscle) in enumerate(self.heads.items()):
            colour, dashes = _STYLES[index % len(_STYLES)]
            _draw(speed_axis, stretch_axis, muscle, label=name, color=colour, linestyle=dashes)
        _draw(speed_axis, stretch_axis, self.equivalent, label="equivalent muscle", color="black")
        heads = list(self.heads.values())
        speeds = np.linspace(0, max(muscle.max_velocity for muscle in heads), 16)
        dots = {"color": "0.45", "markersize": 5, "label": "sum of heads", "clip_on": False}
        speed_axis.plot(np.degrees(speeds), torque_at_velocity(heads, speeds), "o", **dots)
        speed_axis.set_title("(a) torque and velocity")
        speed_axis.set_xlabel("shortening velocity [°/s]")
        speed_axis.set_ylabel("torque [N·m]")
        stretch_axis.set_title("(b) series elements")
        stretch_axis.set_xlabel("stretch [°]")
        for axis in (speed_axis, stretch_axis):
            tidy(axis)
            axis.set(xlim=(0, None), ylim=(0, None))
        spacing = {"columnspacing": 1.2, "handlelength": 1.5, "handletextpad": 0.5}
        figure.legend(loc="outside lower center", ncols=5, frameon=False, **spacing)


def synergists(
    joint: str | Joint = "elbow", *, progress: Callable[[float], None] | None = None
) -> Synergists:
    """Replace the synergists of a joint by one equivalent muscle, and compare both in MuJoCo.

    Args:
        joint: The joint or its name.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown, or mjhill lacks the anatomy of its synergists.
    """
    joint = as_joint(joint)
    report = progress or (lambda _: None)
    muscle, heads = _anatomy(joint)
    equivalent = equivalent_muscle(list(heads.values()))
    several = _free_movement(joint, muscle, heads)
    report(0.5)
    one = _free_movement(joint, muscle, {"equivalent": equivalent})
    report(1.0)
    angle = f"{joint.name}.angle"
    return Synergists(
        joint.name, muscle, heads, equivalent, several[angle], one[angle], several.time,
        {"heads": several, "equivalent": one},
    )  # fmt: skip


def _anatomy(joint: Joint) -> tuple[str, dict[str, Hill]]:
    """Name of the muscle that the synergists of a joint form, and the synergists by name."""
    tables = tomllib.loads(_DATA.read_text(encoding="utf-8"))
    if joint.name not in tables:
        raise ValueError(
            f"no anatomy for the synergists of {joint.name!r}; there is one for: "
            f"{', '.join(tables)}"
        )
    ((muscle, table),) = tables[joint.name].items()
    shared = {name: entry["value"] for name, entry in table["shared"].items()}
    return muscle, {
        name: anatomical_muscle(**shared, **{key: item["value"] for key, item in entries.items()})
        for name, entries in table["muscles"].items()
    }


def _free_movement(joint: Joint, muscle: str, others: Mapping[str, Hill]) -> Recording:
    """The joint from rest, other muscles in place of one of its own and fully excited."""
    muscles = {name: one for name, one in joint.muscles.items() if name != muscle}
    gears = {name: joint.gears[name] for name in muscles}
    changed = replace(
        joint,
        muscles={**muscles, **others},
        gears={**gears, **dict.fromkeys(others, joint.gears[muscle])},
        postures={},
    )
    setup = build_rig(changed)
    start = at_rest(setup, joint.rest_angle)
    return record_run(setup, start, _DURATION, excitation=dict.fromkeys(others, 1.0))


def _draw(speed_axis: Any, stretch_axis: Any, muscle: Hill, **style: Any) -> None:
    """Draw the torque of a muscle over velocity and over the stretch of its series element."""
    speeds, shares = np.linspace(0, muscle.max_velocity, 200), np.linspace(0, 1, 100)
    torque = torque_at_velocity([muscle], speeds)
    speed_axis.plot(np.degrees(speeds), torque, linewidth=2.2, **style)
    stretch, torque = stretch_at_force(muscle, shares), shares * muscle.max_isometric_force
    stretch_axis.plot(np.degrees(stretch), torque, linewidth=2.2, **{**style, "label": None})
