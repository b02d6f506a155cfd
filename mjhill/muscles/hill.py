"""The Hill muscle of Winters & Stark (1987): its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mjhill.quantity import FORCE, LENGTH, VELOCITY, check_quantities, freeze, quantity, sources


@dataclass(frozen=True, kw_only=True)
class Hill:
    """One muscle: neural excitation, activation, contractile and series element.

    On a joint, force is a torque [N·m] and length an angle [rad]; on a tendon, force [N] and
    length [m]. Lengths are MuJoCo's actuator length less its value at ``qpos0``: they grow as
    the muscle is stretched. Equation numbers are those of Winters & Stark (1987).

    Attributes:
        sources: Where each value comes from, by parameter name.
    """

    max_isometric_force: float = quantity(
        "F_max", FORCE, "isometric force at full activation and optimal length", (0, 1e6)
    )
    optimal_length: float = quantity(
        "L_opt", LENGTH, "length at which active force is largest", (-100, 100), low_allowed=True
    )
    width_short: float = quantity(
        "w_short", LENGTH, "Gaussian width of active force below the optimum", (0, 1000)
    )
    width_long: float = quantity(
        "w_long", LENGTH, "Gaussian width of active force above the optimum", (0, 1000)
    )
    max_velocity: float = quantity(
        # the slowest muscles shorten by a tenth of their length in a second; a muscle that
        # is far slower than its joint holds it like a rope, at any force
        "V_max", VELOCITY, "shortening velocity without load (eq. 3)",
        (1e-4, 1e4), low_allowed=True,
    )  # fmt: skip
    hill_shape: float = quantity(
        # below 0.05 a muscle holds or slips like a clutch, which no timestep resolves
        "A",
        "-",
        "Hill's a/F0, curvature of force-velocity (eq. 3)",
        (0.05, 10),
        low_allowed=True,
    )
    series_stretch: float = quantity(
        # a nanometre; where it is shorter, products of its stiffness overflow
        "x_max", LENGTH, "stretch of the series element at F_max (eq. 7)",
        (1e-9, 100), low_allowed=True,
    )  # fmt: skip
    series_shape: float = quantity(
        # above 10 stiffness rises by four powers of ten within the working range
        "S", "-", "shape of the exponential series element (eq. 7)",
        (0.01, 10), default=3.0, low_allowed=True,
    )  # fmt: skip
    # below a microsecond nothing is left to resolve, and n - a over it is rounding
    excitation_tau: float = quantity(
        "τ_nex", "s", "neural excitation, time constant (12)", (1e-6, 1), low_allowed=True
    )
    activation_tau: float = quantity(
        "τ_act", "s", "activation, time constant (12)", (1e-6, 1), low_allowed=True
    )
    deactivation_tau: float = quantity(
        "τ_deact", "s", "deactivation, time constant (12)", (1e-6, 1), low_allowed=True
    )
    eccentric_plateau: float = quantity(
        "P", "-", "force in fast lengthening, in units of isometric force", (1, 3), default=1.3
    )
    eccentric_slope_ratio: float = quantity(
        "R", "-", "slope of force-velocity just in lengthening over just in shortening",
        (1e-3, 20), default=1.0, low_allowed=True,
    )  # fmt: skip
    velocity_activation: float = quantity(
        "κ", "-", "share of V_max that scales with active state: V_max (1 - κ + κ a g)",
        (0, 1), default=0.0, low_allowed=True,
    )  # fmt: skip
    viscosity: float = quantity(
        "β", "-", "viscosity beside the contractile element, in units of F_max/V_max",
        (1e-6, 1), default=1e-3, low_allowed=True,
    )  # fmt: skip
    activation_floor: float = quantity(
        "a_min", "-", "least active state a g; keeps a relaxed muscle taut",
        (1e-6, 0.1), default=1e-3, low_allowed=True,
    )  # fmt: skip
    series_limit: float = quantity(
        "r", "-", "stretch, in units of x_max, past which the series element goes on straight",
        (1, 10), default=2.0, low_allowed=True,
    )  # fmt: skip
    electrical_stimulation: bool = False
    sources: Mapping[str, str] = sources()

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            ValueError: A parameter is not a finite number inside its bounds.
        """
        check_quantities(self)
        if self.electrical_stimulation not in (False, True):
            raise ValueError(
                f"electrical_stimulation must be False or True, got {self.electrical_stimulation!r}"
            )
        object.__setattr__(self, "electrical_stimulation", bool(self.electrical_stimulation))
        freeze(self, "sources")
