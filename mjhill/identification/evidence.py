"""What is published about a joint, and how far a joint is from it, in standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.second_order import SecondOrderStep, fit_step, step_response
from mjhill.identification.free import Free, joint_at
from mjhill.identification.measures import Memory, measure
from mjhill.joints.joint import Joint
from mjhill.lab.batch import joint_angles
from mjhill.lab.postures import tonic_excitations
from mjhill.lab.rig import UnmeasuredError
from mjhill.literature.facts import Entry, name_of, read_entries
from mjhill.literature.published import EndAngle, PassiveTorque, end_angles, passive_torques
from mjhill.literature.table2 import SHAPE_SPREAD, Row, rows_of

STARTS = ("relaxed", "held")
"""How a joint starts a step of Table 2: both muscles relaxed, or held there by the antagonist."""

# standard deviations of what the fit compares; those of facts are published
MAGNITUDE_SPREAD = 0.025  # of MAG
DELAY_SPREAD = 0.08  # of T1 + T2
FACT = 2.0  # weight of a fact, whose standard deviation is published
_UNMEASURED = 5.0  # deviation of what cannot be measured
_SHAPE_SAMPLES = 60
_SETTLED = 5.0  # duration of a run, in units of the largest T1 + T2 ...
_SHORTEST = 0.8  # ... and at least this [s]
_TIMESTEP = 1e-3  # [s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """What is published about one joint.

    Attributes:
        joint: The joint; the values of its free parameters are ignored.
        steps: Muscle and row of Table 2, for each run.
        torques: Published passive torques.
        ends: Published ends of the active range of motion.
        facts: Published facts that the fit uses.
        start: How the joint starts a step, one of ``STARTS``.
    """

    joint: Joint
    steps: tuple[tuple[str, Row], ...]
    torques: tuple[PassiveTorque, ...]
    ends: tuple[EndAngle, ...]
    facts: tuple[Entry, ...] = ()
    start: str = "relaxed"

    @property
    def time(self) -> _Values:
        """Times of a run [s], shape (T,)."""
        slowest = max((sum(row.time_constants) for _, row in self.steps), default=0.0)
        duration = max(_SHORTEST, _SETTLED * slowest)
        return np.asarray(np.arange(round(duration / _TIMESTEP) + 1) * _TIMESTEP)

    @property
    def labels(self) -> list[str]:
        """What each residual is about, in the order of ``residuals``."""
        steps = [f"{name} at {row.level:g}" for name, row in self.steps]
        samples = len(self._shape_samples)
        return [
            *(torque.label for torque in self.torques),
            *(end.label for end in self.ends),
            *(f"MAG of {step}" for step in steps),
            *(f"T1 + T2 of {step}" for step in steps),
            *(f"shape of {step}" for step in steps for _ in range(samples)),
            *(fact.quantity for fact in self.facts),
        ]

    @property
    def _shape_samples(self) -> NDArray[np.intp]:
        last = len(self.time) - 1
        return np.unique(np.linspace(0, last, _SHAPE_SAMPLES).astype(np.intp))

    def responses(self, joints: list[Joint]) -> _Values:
        """Movement from the start in each step, for joints that differ in their parameters [rad].

        Shape (joints, steps, T).
        """
        muscles, time = list(self.joint.muscles), self.time
        excitations = np.zeros((len(joints), len(self.steps), len(muscles)))
        before = np.zeros_like(excitations)
        start = np.empty((len(joints), len(self.steps)))
        for k, (name, row) in enumerate(self.steps):
            excitations[:, k, muscles.index(name)] = row.level
            start[:, k] = [joint.postures[name] for joint in joints]
            if self.start == "held":
                before[:, k] = [
                    list(tonic_excitations(joint, name, joint.postures[name]).values())
                    for joint in joints
                ]
        simulated = joint_angles(
            [joint for joint in joints for _ in self.steps],
            start=start.ravel(),
            before=before.reshape(-1, len(muscles)),
            excitation=excitations.reshape(-1, 1, len(muscles)),
            steps=len(time) - 1,
            timestep=_TIMESTEP,
        ).reshape(len(joints), len(self.steps), len(time))
        signs = np.array([-np.sign(self.joint.gears[name]) for name, _ in self.steps])
        return np.asarray(signs[:, None] * (simulated - start[:, :, None]))

    def residuals(
        self, free: Sequence[Free], points: _Values, memory: Memory | None = None
    ) -> _Values:
        """Residuals at K points of P deviations, (P, K) -> (R, K)."""
        joints = [joint_at(self.joint, free, point) for point in points.T]
        parts = [np.array([[t.deviation(joint) for t in self.torques] for joint in joints])]
        parts.append(np.array([[end.deviation(joint) for end in self.ends] for joint in joints]))
        if self.steps:
            parts.append(self._step_residuals(self._known_responses(joints)))
        parts.extend(_fact_residuals(fact, joints, memory) for fact in self.facts)
        return np.ascontiguousarray(np.concatenate(parts, axis=1).T)

    def _known_responses(self, joints: list[Joint]) -> _Values:
        """``responses``, NaN for a joint whose simulation goes bad."""
        try:
            return self.responses(joints)
        except UnmeasuredError:
            if len(joints) == 1:
                return np.full((1, len(self.steps), len(self.time)), np.nan)
            return np.concatenate([self._known_responses([joint]) for joint in joints])

    def _step_residuals(self, responses: _Values) -> _Values:
        """Residuals of the steps' ends, delays and shapes, (K, steps, T) -> (K, R)."""
        time = self.time
        pick = self._shape_samples
        magnitude = np.array([row.magnitude for _, row in self.steps])
        delay = np.array([sum(row.time_constants) for _, row in self.steps])
        wanted = np.array([step_response(time, *row.time_constants) for _, row in self.steps])
        share = responses / magnitude[:, None]
        end = share[:, :, -1]
        # the area above a step response is its mean delay, which is T1 + T2 of a second-order one
        delay_error = np.trapezoid(wanted - share / end[:, :, None], time, axis=2)
        shape = (share - wanted)[:, :, pick] / (SHAPE_SPREAD * np.sqrt(len(pick)))
        parts = [
            (end - 1) / MAGNITUDE_SPREAD,
            delay_error / (DELAY_SPREAD * delay),
            shape.reshape(len(responses), -1),
        ]
        return np.asarray(np.nan_to_num(np.concatenate(parts, axis=1), nan=_UNMEASURED))

    def fits(self, joint: Joint) -> list[SecondOrderStep]:
        """Second-order fits of a joint's steps, in the order of ``steps``."""
        if not self.steps:
            return []
        return [fit_step(self.time, response) for response in self.responses([joint])[0]]


def _fact_residuals(fact: Entry, joints: Sequence[Joint], memory: Memory | None) -> _Values:
    """Standard deviations of each joint from a fact, (K, 1)."""
    try:
        values = measure(fact, joints, memory)
    except UnmeasuredError:
        return np.full((len(joints), 1), _UNMEASURED)
    return np.asarray(FACT * fact.deviation(values)[:, None])


def evidence_on(
    joint: Joint, *, start: str = "relaxed", facts: Sequence[Entry] | None = None
) -> Evidence:
    """What is published about a joint.

    Args:
        joint: The joint.
        start: How it starts a step of Table 2, one of ``STARTS``.
        facts: Facts to fit to; those about other joints are ignored. By default those that come
            with mjhill and are not held out.

    Raises:
        ValueError: The start is unknown, or a fact is held out.
    """
    if start not in STARTS:
        raise ValueError(f"start must be one of {', '.join(STARTS)}, got {start!r}")
    if facts is None:
        facts = [fact for fact in read_entries() if not fact.held_out]
    own = tuple(fact for fact in facts if fact.joint == joint.name)
    for fact in own:
        if fact.held_out:
            raise ValueError(
                f"{name_of(fact)}: this fact is held out, so no fit may use it; leave it out"
            )
    return Evidence(
        joint,
        tuple((muscle, row) for row in rows_of(joint) for muscle in row.muscles),
        tuple(passive_torques(joint.name)),
        tuple(end_angles(joint.name)),
        own,
        start,
    )
