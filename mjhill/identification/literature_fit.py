"""A joint fitted to the literature: Table 2, published passive torques, ranges of motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.second_order import SecondOrderStep, fit_step, step_response
from mjhill.identification.fit import Free, Identified, free_parameters, intervals, joint_at, solve
from mjhill.identification.measures import Memory, measure
from mjhill.joints.joint import Joint
from mjhill.joints.reader import read_joints
from mjhill.lab.batch import joint_angles
from mjhill.lab.rig import UnmeasuredError
from mjhill.literature.facts import Entry, read_entries
from mjhill.literature.published import EndAngle, PassiveTorque, end_angles, passive_torques
from mjhill.literature.table2 import SHAPE_SPREAD, Row, rows_of

# standard deviations of what the fit compares; those of facts are published
MAGNITUDE_SPREAD = 0.025  # of MAG
DELAY_SPREAD = 0.1  # of T1 + T2
PRIOR = 0.5  # weight of the priors
_UNMEASURED = 5.0  # deviation of what cannot be measured
_DIFFERENCE, _TOLERANCE = 1e-2, 1e-4  # for derivatives, and of the fit [standard deviations]
_SHAPE_SAMPLES = 60
_SETTLED = 5.0  # duration of a run, in units of the largest T1 + T2 ...
_SHORTEST = 0.8  # ... and at least this [s]
_TIMESTEP = 1e-3  # [s]
_NEAR = 1.3  # ratio of T1 to T2 below which only their sum is well determined

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
    """

    joint: Joint
    steps: tuple[tuple[str, Row], ...]
    torques: tuple[PassiveTorque, ...]
    ends: tuple[EndAngle, ...]
    facts: tuple[Entry, ...] = ()

    @property
    def time(self) -> _Values:
        """Times of a run [s], shape (T,)."""
        slowest = max((sum(row.time_constants) for _, row in self.steps), default=0.0)
        duration = max(_SHORTEST, _SETTLED * slowest)
        return np.asarray(np.arange(round(duration / _TIMESTEP) + 1) * _TIMESTEP)

    def responses(self, joints: list[Joint]) -> _Values:
        """Movement from the start in each step, for joints that differ in their parameters [rad].

        Shape (joints, steps, T).
        """
        muscles, time = list(self.joint.muscles), self.time
        excitations = np.zeros((len(joints), len(self.steps), len(muscles)))
        start = np.empty((len(joints), len(self.steps)))
        for k, (name, row) in enumerate(self.steps):
            excitations[:, k, muscles.index(name)] = row.level
            start[:, k] = [joint.postures[name] for joint in joints]
        simulated = joint_angles(
            [joint for joint in joints for _ in self.steps],
            start=start.ravel(),
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
        pick = np.unique(np.linspace(0, len(time) - 1, _SHAPE_SAMPLES).astype(int))
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
        return np.nan_to_num(np.concatenate(parts, axis=1), nan=_UNMEASURED)

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
    return np.asarray(fact.deviation(values)[:, None])


def evidence_on(joint: Joint) -> Evidence:
    """The published data about a joint that come with mjhill."""
    steps = tuple((muscle, row) for row in rows_of(joint) for muscle in row.muscles)
    facts = tuple(
        fact for fact in read_entries() if fact.joint == joint.name and not fact.held_out
    )
    torques, ends = passive_torques(joint.name), end_angles(joint.name)
    return Evidence(joint, steps, tuple(torques), tuple(ends), facts)


def step_rows(joint: Joint) -> list[dict[str, Any]]:
    """Table 2 beside the joint's own steps, one row for each step; degrees and ms."""
    evidence = evidence_on(joint)
    rows = []
    for (muscle, row), fit in zip(evidence.steps, evidence.fits(joint), strict=True):
        wanted = [1e3 * constant for constant in row.time_constants]
        found = [1e3 * constant for constant in fit.time_constants]
        rows.append(
            {
                "movement": row.movement,
                "muscle": muscle,
                "input": row.level,
                "MAG [°]": degrees(row.magnitude),
                "ours [°]": degrees(fit.magnitude),
                "off [%]": 100 * (fit.magnitude / row.magnitude - 1),
                "T1 [ms]": wanted[0],
                "T2 [ms]": wanted[1],
                "our T1 [ms]": found[0],
                "our T2 [ms]": found[1],
                "T1 + T2 off [%]": 100 * (sum(found) / sum(wanted) - 1),
                "fit leaves [%]": 100 * fit.misfit,
                "split": "ill-conditioned" if min(map(_ratio, (wanted, found))) < _NEAR else "",
                "note": row.note,
            }
        )
    return rows


def _ratio(constants: list[float]) -> float:
    return constants[0] / max(constants[1], 1e-9)


def published_rows(joint: Joint) -> list[dict[str, Any]]:
    """Published passive torques and ranges of motion beside a joint's own, one row each."""
    return list(_published_rows(evidence_on(joint)))


def _published_rows(evidence: Evidence) -> Iterator[dict[str, Any]]:
    joint = evidence.joint
    for torque in evidence.torques:
        yield _published_row(
            joint,
            f"passive torque at {degrees(torque.angle):.0f}° [N·m]",
            (torque.low, torque.high),
            torque.measured(joint),
            torque.source,
        )
    for end in evidence.ends:
        yield _published_row(
            joint,
            f"full effort of {end.muscle} ends at [°]",
            (degrees(end.low), degrees(end.high)),
            degrees(end.measured(joint)),
            end.source,
        )


def _published_row(
    joint: Joint, quantity: str, span: tuple[float, float], ours: float, source: str
) -> dict[str, Any]:
    low, high = span
    outside = max(low - ours, ours - high, 0.0)
    return {
        "joint": joint.name,
        "quantity": quantity,
        "low": low,
        "high": high,
        "ours": ours,
        "outside by": outside or None,
        "source": source,
    }


def from_literature(
    joint: str,
    parameters: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> Identified:
    """Fit the free parameters of a joint to Table 2 and to published torques and ranges.

    Deterministic; it starts from the middle of the bounds, not from the values in the file.

    Args:
        joint: The joint's name.
        parameters: The parameter file; by default the one that comes with mjhill.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The file has no such joint, or nothing is published about it.
        RuntimeError: The fit did not settle.
    """
    free = free_parameters(joint, parameters)
    start = read_joints(parameters)[joint]
    evidence = _evidence(start)

    memory: Memory = {}

    def residuals(points: _Values) -> _Values:
        return evidence.residuals(free, points, memory)

    def without_facts(points: _Values) -> _Values:
        return replace(evidence, facts=()).residuals(free, points)

    options = {"prior": PRIOR, "difference": _DIFFERENCE, "tolerance": _TOLERANCE}
    # facts say little where nothing moves as it should
    first = solve(without_facts, len(free), **options)
    solution = solve(residuals, len(free), progress, start=first.deviations, **options)
    ends = intervals(residuals, solution, len(free), PRIOR)
    fitted = joint_at(start, free, solution.deviations)
    return Identified(fitted, tuple(free), tuple(solution.estimates(free, ends)))


def check_evidence(joints: Iterable[str], parameters: str | Path | None = None) -> None:
    """Refuse joints without published data, before long work on others.

    Raises:
        ValueError: There is such a joint; the message names it.
    """
    known = read_joints(parameters)
    for name in joints:
        _evidence(known[name])


def _evidence(joint: Joint) -> Evidence:
    evidence = evidence_on(joint)
    if not (evidence.steps or evidence.torques or evidence.ends):
        raise ValueError(
            f"nothing published on {joint.name!r} comes with mjhill; give a measurement"
        )
    return evidence
