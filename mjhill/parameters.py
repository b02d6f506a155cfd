"""Parameters of muscles and joints: values, units, bounds and sources."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from numbers import Real
from typing import Any

from mjhill.frozen import FrozenDict

# units of a muscle on a hinge, and of one on a slide or tendon
_FORCE, _LENGTH, _VELOCITY = ("N·m", "N"), ("rad", "m"), ("rad/s", "m/s")


@dataclass(frozen=True)
class Quantity:
    """What a parameter is: symbol, unit, meaning, bounds.

    Attributes:
        symbol: Its symbol in the equations.
        units: Its unit on a hinge, and on a slide or tendon.
        meaning: One phrase.
        low: Lower bound.
        high: Upper bound, allowed.
        low_allowed: Whether the lower bound is itself allowed.
    """

    symbol: str
    units: tuple[str, str]
    meaning: str
    low: float
    high: float
    low_allowed: bool = False

    def check(self, name: str, value: float) -> None:
        """Accept a value inside the bounds.

        Raises:
            ValueError: The value is not a finite number inside the bounds.
        """
        if not isinstance(value, Real):
            raise ValueError(f"{name} must be a number, got {value!r}")
        above = self.low <= value if self.low_allowed else self.low < value
        if not (math.isfinite(value) and above and value <= self.high):
            bracket = "[" if self.low_allowed else "("
            unit = "" if self.units[0] == "-" else " " + " or ".join(dict.fromkeys(self.units))
            wanted = f"{bracket}{self.low:g}, {self.high:g}]{unit}"
            raise ValueError(f"{name} must be in {wanted}, got {value!r}")


def _quantity(
    symbol: str,
    unit: str | tuple[str, str],
    meaning: str,
    bounds: tuple[float, float],
    *,
    default: Any = MISSING,
    low_allowed: bool = False,
) -> Any:
    units = (unit, unit) if isinstance(unit, str) else unit
    quantity = Quantity(symbol, units, meaning, *bounds, low_allowed)
    return field(default=default, metadata={"quantity": quantity})


def quantities(cls: type) -> Iterator[tuple[str, Quantity]]:
    """Name and description of each physical parameter of a parameter class, in order."""
    for item in fields(cls):
        if "quantity" in item.metadata:
            yield item.name, item.metadata["quantity"]


def _check_quantities(parameters: Any) -> None:
    for name, quantity in quantities(type(parameters)):
        quantity.check(name, getattr(parameters, name))
        object.__setattr__(parameters, name, float(getattr(parameters, name)))


def _sources() -> Any:
    return field(default_factory=FrozenDict, compare=False, repr=False)


def _freeze(parameters: Any, *names: str) -> None:
    """Keep a copy of mappings that nobody can change, so that equal objects stay equal."""
    for name in names:
        object.__setattr__(parameters, name, FrozenDict(getattr(parameters, name)))


@dataclass(frozen=True, kw_only=True)
class Muscle:
    """One muscle: neural excitation, activation, contractile and series element.

    On a joint, force is a torque [N·m] and length an angle [rad]; on a tendon, force [N] and
    length [m]. Lengths are MuJoCo's actuator length less its value at ``qpos0``: they grow as
    the muscle is stretched. Equation numbers are those of Winters & Stark (1987).

    Attributes:
        sources: Where each value comes from, by parameter name.
    """

    max_isometric_force: float = _quantity(
        "F_max", _FORCE, "isometric force at full activation and optimal length", (0, 1e6)
    )
    optimal_length: float = _quantity(
        "L_opt", _LENGTH, "length at which active force is largest", (-100, 100), low_allowed=True
    )
    width_short: float = _quantity(
        "w_short", _LENGTH, "Gaussian width of active force below the optimum", (0, 1000)
    )
    width_long: float = _quantity(
        "w_long", _LENGTH, "Gaussian width of active force above the optimum", (0, 1000)
    )
    max_velocity: float = _quantity(
        # the slowest muscles shorten by a tenth of their length in a second; a muscle that
        # is far slower than its joint holds it like a rope, at any force
        "V_max", _VELOCITY, "shortening velocity without load (eq. 3)",
        (1e-4, 1e4), low_allowed=True,
    )  # fmt: skip
    hill_shape: float = _quantity(
        # below 0.05 a muscle holds or slips like a clutch, which no timestep resolves
        "A",
        "-",
        "Hill's a/F0, curvature of force-velocity (eq. 3)",
        (0.05, 10),
        low_allowed=True,
    )
    series_stretch: float = _quantity(
        # a nanometre; where it is shorter, products of its stiffness overflow
        "x_max", _LENGTH, "stretch of the series element at F_max (eq. 7)",
        (1e-9, 100), low_allowed=True,
    )  # fmt: skip
    series_shape: float = _quantity(
        # above 10 stiffness rises by four powers of ten within the working range
        "S", "-", "shape of the exponential series element (eq. 7)",
        (0.01, 10), default=3.0, low_allowed=True,
    )  # fmt: skip
    # below a microsecond nothing is left to resolve, and n - a over it is rounding
    excitation_tau: float = _quantity(
        "τ_nex", "s", "neural excitation, time constant (12)", (1e-6, 1), low_allowed=True
    )
    activation_tau: float = _quantity(
        "τ_act", "s", "activation, time constant (12)", (1e-6, 1), low_allowed=True
    )
    deactivation_tau: float = _quantity(
        "τ_deact", "s", "deactivation, time constant (12)", (1e-6, 1), low_allowed=True
    )
    eccentric_plateau: float = _quantity(
        "P", "-", "force in fast lengthening, in units of isometric force", (1, 3), default=1.3
    )
    eccentric_slope_ratio: float = _quantity(
        "R", "-", "slope of force-velocity just in lengthening over just in shortening",
        (1e-3, 20), default=1.0, low_allowed=True,
    )  # fmt: skip
    velocity_activation: float = _quantity(
        "κ", "-", "share of V_max that scales with active state: V_max (1 - κ + κ a g)",
        (0, 1), default=0.0, low_allowed=True,
    )  # fmt: skip
    viscosity: float = _quantity(
        "β", "-", "viscosity beside the contractile element, in units of F_max/V_max",
        (1e-6, 1), default=1e-3, low_allowed=True,
    )  # fmt: skip
    activation_floor: float = _quantity(
        "a_min", "-", "least active state a g; keeps a relaxed muscle taut",
        (1e-6, 0.1), default=1e-3, low_allowed=True,
    )  # fmt: skip
    series_limit: float = _quantity(
        "r", "-", "stretch, in units of x_max, past which the series element goes on straight",
        (1, 10), default=2.0, low_allowed=True,
    )  # fmt: skip
    electrical_stimulation: bool = False
    sources: Mapping[str, str] = _sources()

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            ValueError: A parameter is not a finite number inside its bounds.
        """
        _check_quantities(self)
        if self.electrical_stimulation not in (False, True):
            raise ValueError(
                f"electrical_stimulation must be False or True, got {self.electrical_stimulation!r}"
            )
        object.__setattr__(self, "electrical_stimulation", bool(self.electrical_stimulation))
        _freeze(self, "sources")


@dataclass(frozen=True, kw_only=True)
class Passive:
    """Exponential passive elasticity of a joint beyond its linear stiffness.

    Torque at deviation q from the rest angle: ``-sgn(q) k1 (exp(k2 |q|) - 1)``, with k1 and k2
    of the side entered (Winters & Stark 1987, sect. 3.2: linear term plus exponential term).
    On a slide joint, read force [N] and length [m].
    """

    k1_pos: float = _quantity("k1+", _FORCE, "scale, positive side", (0, 1e6), low_allowed=True)
    k2_pos: float = _quantity("k2+", ("1/rad", "1/m"), "rate, positive side", (0, 1e4))
    k1_neg: float = _quantity("k1-", _FORCE, "scale, negative side", (0, 1e6), low_allowed=True)
    k2_neg: float = _quantity("k2-", ("1/rad", "1/m"), "rate, negative side", (0, 1e4))
    exponent_limit: float = _quantity(
        "z_max", "-", "k2 |q| past which the torque goes on straight", (1, 500), default=20.0
    )
    sources: Mapping[str, str] = _sources()

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            ValueError: A parameter is not a finite number inside its bounds.
        """
        _check_quantities(self)
        _freeze(self, "sources")


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
    inertia: float = _quantity("J", "kg·m²", "moment of inertia", (0, 1e4))
    damping: float = _quantity("B", "N·m·s/rad", "passive viscosity", (0, 1e4), low_allowed=True)
    stiffness: float = _quantity(
        "k_lin", "N·m/rad", "linear passive stiffness", (0, 1e6), low_allowed=True
    )
    rest_angle: float = _quantity(
        "θ_rest", "rad", "angle of no passive torque", (-10, 10), low_allowed=True
    )
    passive: Passive
    range: tuple[float, float]
    home_angle: float
    muscles: Mapping[str, Muscle]
    gears: Mapping[str, float]
    postures: Mapping[str, float] = field(default_factory=FrozenDict)
    sources: Mapping[str, str] = _sources()

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            ValueError: A parameter is not a finite number inside its bounds.
        """
        _check_quantities(self)
        _freeze(self, "muscles", "gears", "postures", "sources")
        object.__setattr__(self, "range", tuple(self.range))
        for what in ("gears", "postures"):
            names = set(getattr(self, what))
            if names != set(self.muscles) and (names or what == "gears"):
                raise ValueError(
                    f"{what} must name the muscles {sorted(self.muscles)}, got {sorted(names)}"
                )
