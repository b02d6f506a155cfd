"""A plant of hinges and slides with any number of muscles, beyond the joints of the paper.

The reference solver and the sweep of random systems work on these; no MuJoCo in here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from mjhill.frozen import FrozenDict
from mjhill.joints.joint import Joint, Passive
from mjhill.muscles import Muscle


@dataclass(frozen=True, kw_only=True)
class Coordinate:
    """One degree of freedom: a hinge [rad, N·m] or a slide [m, N], independent of the others.

    Attributes:
        inertia: Moment of inertia [kg·m²] or mass [kg].
        damping: Viscosity [N·m·s/rad or N·s/m].
        stiffness: Linear stiffness [N·m/rad or N/m].
        rest: Position without passive force [rad or m].
        passive: Exponential elasticity, if there is one.
        slide: Whether it is a slide.
    """

    inertia: float
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    passive: Passive | None = None
    slide: bool = False


@dataclass(frozen=True)
class Movement:
    """A prescribed movement of a coordinate.

    Attributes:
        position: Position [rad or m] as a function of time [s].
        velocity: Its derivative [rad/s or m/s].
        breaks: Times [s] at which the velocity or a higher derivative jumps, ascending.
    """

    position: Callable[[float], float]
    velocity: Callable[[float], float]
    breaks: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class System:
    """Coordinates, muscles, and the lengths of the muscles as linear functions of position.

    Attributes:
        name: Name of the system.
        coordinates: Coordinates by name.
        muscles: Muscles by name.
        arms: For each muscle its length per unit of position, by coordinate. A muscle that pulls
            towards positive positions has a negative arm.
    """

    name: str
    coordinates: Mapping[str, Coordinate]
    muscles: Mapping[str, Muscle]
    arms: Mapping[str, Mapping[str, float]] = field(default_factory=FrozenDict)

    def __post_init__(self) -> None:
        """Check the names.

        Raises:
            ValueError: A muscle has no arm, or one about an unknown coordinate.
        """
        frozen = {
            "coordinates": FrozenDict(self.coordinates),
            "muscles": FrozenDict(self.muscles),
            "arms": FrozenDict({name: FrozenDict(arms) for name, arms in self.arms.items()}),
        }
        for what, mapping in frozen.items():
            object.__setattr__(self, what, mapping)
        if set(self.arms) != set(self.muscles):
            raise ValueError(
                f"arms must name the muscles {sorted(self.muscles)}, got {sorted(self.arms)}"
            )
        for muscle, arms in self.arms.items():
            unknown = set(arms) - set(self.coordinates)
            if unknown or not arms:
                raise ValueError(
                    f"muscle {muscle!r} needs an arm about one of {sorted(self.coordinates)}, "
                    f"got {sorted(arms)}"
                )

    @staticmethod
    def of(joint: Joint) -> System:
        """A joint of the paper as a system of one coordinate."""
        coordinate = Coordinate(
            inertia=joint.inertia,
            damping=joint.damping,
            stiffness=joint.stiffness,
            rest=joint.rest_angle,
            passive=joint.passive,
        )
        return System(
            name=joint.name,
            coordinates={joint.name: coordinate},
            muscles=joint.muscles,
            arms={name: {joint.name: gear} for name, gear in joint.gears.items()},
        )

    def length(self, muscle: str, positions: Mapping[str, float]) -> float:
        """Length of a muscle [rad or m], 0 where all positions are 0."""
        return sum(arm * positions[name] for name, arm in self.arms[muscle].items())

    def slides(self, muscle: str) -> bool:
        """Whether a muscle acts on slides, so that its length is in metres."""
        return all(self.coordinates[name].slide for name in self.arms[muscle])
