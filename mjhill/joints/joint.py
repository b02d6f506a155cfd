"""A joint of the paper: inertia, passive elasticity, muscles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from mjhill.frozen import FrozenDict
from mjhill.muscles import Muscle, OperatingPoint, convert, model_of
from mjhill.muscles.hill import Hill
from mjhill.muscles.model import Values
from mjhill.muscles.parts import exponential_area
from mjhill.quantity import FORCE, check_quantities, freeze, quantity, sources


@dataclass(frozen=True, kw_only=True)
class Passive:
    """Exponential passive elasticity of a joint beyond its linear stiffness.

    Torque at deviation q from the rest angle: ``-sgn(q) k1 (exp(k2 |q|) - 1)``, with k1 and k2
    of the side entered (Winters & Stark 1987, sect. 3.2: linear term plus exponential term).
    On a slide joint, read force [N] and length [m].
    """

    k1_pos: float = quantity("k1+", FORCE, "scale, positive side", (0, 1e6), low_allowed=True)
    k2_pos: float = quantity("k2+", ("1/rad", "1/m"), "rate, positive side", (0, 1e4))
    k1_neg: float = quantity("k1-", FORCE, "scale, negative side", (0, 1e6), low_allowed=True)
    k2_neg: float = quantity("k2-", ("1/rad", "1/m"), "rate, negative side", (0, 1e4))
    exponent_limit: float = quantity(
        "z_max", "-", "k2 |q| past which the torque goes on straight", (1, 500), default=20.0
    )
    sources: Mapping[str, str] = sources()

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            ValueError: A parameter is not a finite number inside its bounds.
        """
        check_quantities(self)
        freeze(self, "sources")


def passive_energy(passive: Passive, deviation: Values) -> Values:
    """Energy in a joint's exponential elasticity [J] at deviations from its rest [rad or m]."""
    stored = np.zeros_like(deviation)
    for k1, k2, sign in (
        (passive.k1_pos, passive.k2_pos, 1.0),
        (passive.k1_neg, passive.k2_neg, -1.0),
    ):
        beyond = np.maximum(sign * deviation, 0.0)
        stored += k1 * (exponential_area(k2 * beyond, passive.exponent_limit) / k2 - beyond)
    return stored


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint of the paper: passive plant and an antagonistic pair of muscles.

    Attributes:
        name: Name of the joint and of its model.
        positive: The movement that raises the angle, such as ``flexion``.
        range: Anatomical range of motion [rad]; not a stop.
        home_angle: Angle of the ``home`` pose [rad].
        muscles: Muscles by name, the one that pulls towards positive angles first.
        gears: Actuator gear of each muscle: length = gear * angle.
        postures: Angle [rad] from which a step of each muscle starts, at rest; the paper's Table 2
            does not state it.
        sources: Where each value comes from, by parameter name.
    """

    name: str
    positive: str
    inertia: float = quantity("J", "kg·m²", "moment of inertia", (0, 1e4))
    damping: float = quantity("B", "N·m·s/rad", "passive viscosity", (0, 1e4), low_allowed=True)
    stiffness: float = quantity(
        "k_lin", "N·m/rad", "linear passive stiffness", (0, 1e6), low_allowed=True
    )
    rest_angle: float = quantity(
        "θ_rest", "rad", "angle of no passive torque", (-10, 10), low_allowed=True
    )
    passive: Passive
    range: tuple[float, float]
    home_angle: float
    muscles: Mapping[str, Muscle]
    gears: Mapping[str, float]
    postures: Mapping[str, float] = field(default_factory=FrozenDict)
    sources: Mapping[str, str] = sources()

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            ValueError: A parameter is not a finite number inside its bounds.
        """
        check_quantities(self)
        freeze(self, "muscles", "gears", "postures", "sources")
        object.__setattr__(self, "range", tuple(self.range))
        for what in ("gears", "postures"):
            names = set(getattr(self, what))
            if names != set(self.muscles) and (names or what == "gears"):
                raise ValueError(
                    f"{what} must name the muscles {sorted(self.muscles)}, got {sorted(names)}"
                )

    @property
    def hill_muscles(self) -> Mapping[str, Hill]:
        """The muscles, for what needs those of the model ``hill``.

        Raises:
            ValueError: A muscle is of another model.
        """
        hills = {name: muscle for name, muscle in self.muscles.items() if isinstance(muscle, Hill)}
        for name, muscle in self.muscles.items():
            if name not in hills:
                raise ValueError(
                    f"{self.name}: {name!r} is a muscle of the model {model_of(muscle).name!r}, "
                    "and this needs one of the model 'hill'"
                )
        return FrozenDict(hills)

    def with_muscles(self, model: str) -> Joint:
        """The joint with muscles of another model, such as ``hill-rigid``.

        A model with linear elements has them about the home angle; see ``OperatingPoint``.

        Raises:
            ValueError: There is no model of this name, or a muscle cannot be made one of it.
        """
        muscles = {
            name: convert(muscle, model, OperatingPoint(length=self.gears[name] * self.home_angle))
            for name, muscle in self.muscles.items()
        }
        return replace(self, muscles=muscles)
