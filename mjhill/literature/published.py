"""Published passive torques and ranges of motion of joints."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from math import degrees, log, pi, radians
from pathlib import Path

from mjhill.joints.joint import Joint
from mjhill.muscles.readings import isometric_share
from mjhill.simulate.reference import plant_torque

_DATA = Path(__file__).parent / "published.csv"
_SPREAD = 4.0  # standard deviations from low to high
_SCAN = radians(10)


@dataclass(frozen=True)
class PassiveTorque:
    """A published restoring torque of a relaxed joint.

    Attributes:
        joint: The joint's name.
        angle: Joint angle [rad].
        low: Lower end of the published interval [N·m].
        high: Upper end [N·m].
        source: The publications.
    """

    joint: str
    angle: float
    low: float
    high: float
    source: str

    @property
    def label(self) -> str:
        """What it is, with its unit."""
        return f"passive torque at {degrees(self.angle):.0f}° [N·m]"

    def measured(self, joint: Joint) -> float:
        """The restoring torque of a joint's passive elasticity there [N·m]."""
        torque = plant_torque(joint, self.angle)
        return -torque if self.angle > joint.rest_angle else torque

    def deviation(self, joint: Joint) -> float:
        """Standard deviations between a joint and the literature, on a logarithmic scale.

        Raises:
            ValueError: The joint has no passive torque there.
        """
        measured = self.measured(joint)
        if measured <= 0:
            raise ValueError(
                f"{joint.name}: no passive torque at {degrees(self.angle):.0f}°, where one is "
                "published; give it stiffness, and rest elsewhere"
            )
        middle = 0.5 * (log(self.low) + log(self.high))
        return (log(measured) - middle) * _SPREAD / log(self.high / self.low)


@dataclass(frozen=True)
class EndAngle:
    """A published end of the active range of motion, where the full effort of a muscle stops.

    Attributes:
        joint: The joint's name.
        muscle: The muscle.
        low: Lower end of the published interval [rad].
        high: Upper end [rad].
        source: The publications.
    """

    joint: str
    muscle: str
    low: float
    high: float
    source: str

    @property
    def label(self) -> str:
        """What it is, with the unit of tables."""
        return f"full effort of {self.muscle} ends at [°]"

    def measured(self, joint: Joint) -> float:
        """Angle [rad] at which a joint is in balance under the full effort of the muscle.

        Raises:
            ValueError: The passive elasticity does not stop it within half a turn.
        """
        return _balance(joint, self.muscle)

    def deviation(self, joint: Joint) -> float:
        """Standard deviations between a joint and the literature.

        Of half a turn from rest where nothing stops the joint.
        """
        middle = 0.5 * (self.low + self.high)
        try:
            angle = self.measured(joint)
        except ValueError:
            sign = 1.0 if joint.gears[self.muscle] < 0 else -1.0
            angle = joint.rest_angle + sign * pi
        return (angle - middle) * _SPREAD / (self.high - self.low)


def passive_torques(joint: str) -> list[PassiveTorque]:
    """Published passive torques of a joint."""
    return [
        PassiveTorque(
            joint, radians(float(row["at"])), float(row["low"]), float(row["high"]), row["source"]
        )
        for row in _rows(joint, "passive_torque")
    ]


def end_angles(joint: str) -> list[EndAngle]:
    """Published ends of the active range of motion of a joint."""
    return [
        EndAngle(
            joint, row["at"], radians(float(row["low"])), radians(float(row["high"])), row["source"]
        )
        for row in _rows(joint, "end_angle")
    ]


def _rows(joint: str, quantity: str) -> list[dict[str, str]]:
    with _DATA.open(newline="", encoding="utf-8") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [row for row in rows if row["joint"] == joint and row["quantity"] == quantity]


def _balance(joint: Joint, agonist: str) -> float:
    from scipy.optimize import brentq

    def net(travel: float) -> float:
        """Torque [N·m] towards the agonist's side, at ``travel`` [rad] from rest."""
        angle = joint.rest_angle + sign * travel
        total = plant_torque(joint, angle)
        for name, muscle in joint.hill_muscles.items():
            share = isometric_share(muscle, float(name == agonist), joint.gears[name] * angle)
            total -= joint.gears[name] * muscle.max_isometric_force * share
        return sign * total

    sign = -1.0 if joint.gears[agonist] > 0 else 1.0
    before, beyond = 0.0, _SCAN
    while net(beyond) > 0:
        if beyond >= pi:
            raise ValueError(f"{joint.name}: nothing stops {agonist} within half a turn from rest")
        before, beyond = beyond, beyond + _SCAN
    return joint.rest_angle + sign * float(brentq(net, before, beyond, xtol=1e-12))
