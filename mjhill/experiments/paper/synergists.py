"""Several synergists and the one muscle that stands for them (sect. 3.2, Fig. 3).

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

import mjhill
from mjhill.experiments.figures.synergists import draw
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.joints.joint import Joint
from mjhill.lab.rig import Rig, as_joint, at_rest, build_rig, record_run
from mjhill.muscles.equivalent import anatomical_muscle, equivalent_muscle, torque_at_velocity
from mjhill.muscles.hill import Hill
from mjhill.simulate.recording import Recording

_DATA = Path(mjhill.__file__).parent / "literature" / "synergists.toml"
_NEAR = 0.05  # of the largest torque or of a movement: as near as "approximately the same" is
_DURATION = 0.6  # of a free movement [s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Synergists(Result):
    """Synergists and their equivalent muscle.

    Attributes:
        joint: Name of the joint.
        muscle: The muscle of the joint that they make up.
        heads: The synergists by name.
        equivalent: Their equivalent.
        together: Angle of the joint when all heads pull at full input [rad], shape (T,).
        alone: The same with the equivalent in their place, shape (T,).
        time: Times of both [s], shape (T,).
        recordings: Both runs.
    """

    title: ClassVar[str] = "Equivalent muscle of several synergists"
    section: ClassVar[str] = "3.2, Fig. 3"
    size: ClassVar[tuple[float, float]] = (9.0, 4.4)
    joint: str
    muscle: str
    heads: Mapping[str, Hill]
    equivalent: Hill
    together: _Values
    alone: _Values
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
        """What sect. 3.2 says of the combination, and that it serves."""
        heads = list(self.heads.values())
        speeds = np.linspace(0, max(head.max_velocity for head in heads), 200)
        total = torque_at_velocity(heads, speeds)
        off = np.abs(torque_at_velocity([self.equivalent], speeds) - total).max() / total[0]
        yield Claim(
            "The equivalent torque-velocity relation sums the individual torques at each velocity.",
            self.section,
            bool(off <= _NEAR),
            f"Hill's relation fitted to the sum is within {off:.1%} of its largest torque; "
            f"{_NEAR:.0%} is near",
        )
        stretches = np.array([head.series_stretch for head in heads])
        strengths = np.array([head.max_isometric_force for head in heads])
        weighted, plain = float(strengths @ stretches / strengths.sum()), float(stretches.mean())
        ours = self.equivalent.series_stretch
        yield Claim(
            "The equivalent series element is an average in which stronger muscles weigh more.",
            self.section,
            abs(ours - weighted) < abs(ours - plain),
            f"it stretches by {degrees(ours):.1f}° at the largest torque; the heads by "
            f"{degrees(weighted):.1f}° weighted by strength, by {degrees(plain):.1f}° unweighted",
        )
        apart = float(np.abs(self.together - self.alone).max())
        movement = float(np.ptp(self.together))
        yield Claim(
            "One equivalent muscle can stand for the synergists of a movement.",
            self.section,
            apart <= _NEAR * movement,
            f"at full input the joint with the heads and the joint with their equivalent are at "
            f"most {degrees(apart):.2f}° apart in a movement of {degrees(movement):.0f}°",
        )

    def draw(self, figure: Any) -> None:
        """Torque over velocity and over stretch, as in Fig. 3a and b."""
        draw(self.heads, self.equivalent, figure)


def synergists(
    joint: str | Joint = "elbow", *, progress: Callable[[float], None] | None = None
) -> Synergists:
    """Combine the synergists behind a muscle of a joint, and try the result in MuJoCo.

    Args:
        joint: The joint or its name.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown, or the anatomy of its synergists is not there.
    """
    joint = as_joint(joint)
    muscle, heads = _anatomy(joint)
    equivalent = equivalent_muscle(list(heads.values()))
    told = progress or (lambda _: None)
    many = _free_movement(_with(joint, muscle, heads), tuple(heads))
    told(0.5)
    one = _free_movement(_with(joint, muscle, {"equivalent": equivalent}), ("equivalent",))
    told(1.0)
    angle = f"{joint.name}.angle"
    return Synergists(
        joint.name, muscle, heads, equivalent, many[angle], one[angle], many.time,
        {"heads": many, "equivalent": one},
    )  # fmt: skip


def _anatomy(joint: Joint) -> tuple[str, dict[str, Hill]]:
    tables = tomllib.loads(_DATA.read_text(encoding="utf-8"))
    if joint.name not in tables:
        raise ValueError(
            f"the anatomy of the synergists of {joint.name!r} is not there; there are: "
            f"{', '.join(tables)}"
        )
    ((muscle, table),) = tables[joint.name].items()
    shared = {name: entry["value"] for name, entry in table["shared"].items()}
    return muscle, {
        name: anatomical_muscle(**shared, **{key: item["value"] for key, item in entries.items()})
        for name, entries in table["muscles"].items()
    }


def _with(joint: Joint, muscle: str, others: Mapping[str, Hill]) -> Joint:
    """A joint in which some muscles stand in place of one."""
    muscles = {name: one for name, one in joint.muscles.items() if name != muscle}
    gears = {name: joint.gears[name] for name in muscles}
    return replace(
        joint,
        muscles={**muscles, **others},
        gears={**gears, **dict.fromkeys(others, joint.gears[muscle])},
        postures={},
    )


def _free_movement(joint: Joint, pulling: tuple[str, ...]) -> Recording:
    """The joint from rest under full input of some of its muscles."""
    bench: Rig = build_rig(joint)
    inputs = dict.fromkeys(pulling, 1.0)
    return record_run(bench, at_rest(bench, joint.rest_angle), _DURATION, excitation=inputs)
