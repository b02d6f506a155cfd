"""What the literature says of a joint, as residuals of a least-squares fit.

Three kinds, each in units of its own standard deviation: the steps of Table 2, published
passive torques, and the angles at which full effort stops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.second_order import SecondOrderStep, fit_step, step_response
from mjhill.identification.free import Free, joint_at
from mjhill.joints.joint import Joint
from mjhill.lab.batch import joint_angles
from mjhill.literature.published import EndAngle, PassiveTorque, end_angles, passive_torques
from mjhill.literature.table2 import SHAPE_SPREAD, Row, rows_of

MAGNITUDE_SPREAD = 0.01  # of MAG: Table 2 has two digits
DELAY_SPREAD = 0.03  # of T1 + T2
_SHAPE_SAMPLES = 60
_SETTLED = 5.0  # duration of a run, in units of the largest T1 + T2 ...
_SHORTEST = 0.8  # ... and at least this [s]
_TIMESTEP = 1e-3  # [s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """The evidence on one joint.

    Attributes:
        joint: The joint, of which the free parameters are not looked at.
        steps: Hill and row of Table 2, for each run.
        torques: Published passive torques.
        ends: Published ends of the active range of motion.
    """

    joint: Joint
    steps: tuple[tuple[str, Row], ...]
    torques: tuple[PassiveTorque, ...]
    ends: tuple[EndAngle, ...]

    @property
    def time(self) -> _Values:
        """Times of a run [s], shape (T,)."""
        slowest = max((sum(row.time_constants) for _, row in self.steps), default=0.0)
        duration = max(_SHORTEST, _SETTLED * slowest)
        return np.asarray(np.arange(round(duration / _TIMESTEP) + 1) * _TIMESTEP)

    def responses(self, joints: list[Joint]) -> _Values:
        """How far each step goes in joints that differ in their parameters [rad].

        Shape (joints, steps, T).
        """
        muscles, time = list(self.joint.muscles), self.time
        inputs = np.zeros((len(joints), len(self.steps), len(muscles)))
        start = np.empty((len(joints), len(self.steps)))
        for k, (name, row) in enumerate(self.steps):
            inputs[:, k, muscles.index(name)] = row.level
            start[:, k] = [joint.postures[name] for joint in joints]
        runs = joint_angles(
            [joint for joint in joints for _ in self.steps],
            start=start.ravel(),
            excitation=inputs.reshape(-1, 1, len(muscles)),
            steps=len(time) - 1,
            timestep=_TIMESTEP,
        ).reshape(len(joints), len(self.steps), len(time))
        signs = np.array([-np.sign(self.joint.gears[name]) for name, _ in self.steps])
        return np.asarray(signs[:, None] * (runs - start[:, :, None]))

    def residuals(self, free: list[Free], points: _Values) -> _Values:
        """Residuals at K points of P deviations, (P, K) -> (R, K)."""
        joints = [joint_at(self.joint, free, point) for point in points.T]
        parts = [np.array([[t.deviation(joint) for t in self.torques] for joint in joints])]
        parts.append(np.array([[end.deviation(joint) for end in self.ends] for joint in joints]))
        if self.steps:
            parts.append(self._step_residuals(self.responses(joints)))
        return np.ascontiguousarray(np.concatenate(parts, axis=1).T)

    def _step_residuals(self, gone: _Values) -> _Values:
        time = self.time
        pick = np.unique(np.linspace(0, len(time) - 1, _SHAPE_SAMPLES).astype(int))
        magnitude = np.array([row.magnitude for _, row in self.steps])
        delay = np.array([sum(row.time_constants) for _, row in self.steps])
        wanted = np.array([step_response(time, *row.time_constants) for _, row in self.steps])
        share = gone / magnitude[:, None]
        end = share[:, :, -1]
        # the area above a step response is its mean delay, which is T1 + T2 of a second-order one
        late = np.trapezoid(wanted - share / end[:, :, None], time, axis=2)
        shape = (share - wanted)[:, :, pick] / (SHAPE_SPREAD * np.sqrt(len(pick)))
        parts = [
            (end - 1) / MAGNITUDE_SPREAD,
            late / (DELAY_SPREAD * delay),
            shape.reshape(len(gone), -1),
        ]
        return np.concatenate(parts, axis=1)

    def fits(self, joint: Joint) -> list[SecondOrderStep]:
        """Second-order fits of a joint's steps, in the order of ``steps``."""
        if not self.steps:
            return []
        return [fit_step(self.time, response) for response in self.responses([joint])[0]]


def evidence_on(joint: Joint) -> Evidence:
    """The evidence that comes with mjhill on one of its joints."""
    steps = tuple((muscle, row) for row in rows_of(joint) for muscle in row.muscles)
    return Evidence(joint, steps, tuple(passive_torques(joint.name)), tuple(end_angles(joint.name)))
