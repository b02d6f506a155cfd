"""Why a free joint does not go in proportion to its input: elasticity, or torque and angle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.lab.batch import joint_angles
from mjhill.lab.rig import direction
from mjhill.lab.variants import (
    AS_IT_IS,
    FLAT,
    LINEAR,
    with_flat_torque,
    with_linear_elasticity,
)

LONG = 10.0  # by when the slowest joint has settled [s]

_Values = NDArray[np.float64]


def step_responses(
    joints: Sequence[Joint],
    tasks: Sequence[tuple[str, float]],
    starts: Sequence[float],
    timestep: float,
) -> _Values:
    """How far each muscle and level takes its joint its way [rad], shape (N, steps + 1)."""
    names = list(joints[0].muscles)
    inputs = np.zeros((len(tasks), 1, len(names)))
    for i, (muscle, level) in enumerate(tasks):
        inputs[i, 0, names.index(muscle)] = level
    steps = round(LONG / timestep)
    runs = joint_angles(joints, start=starts, excitation=inputs, steps=steps, timestep=timestep)
    signs = np.array([direction(joints[0], muscle) for muscle, _ in tasks])
    return np.asarray(signs[:, None] * (runs - runs[:, :1]))


def proportions(
    joint: Joint, low: float, high: float, timestep: float
) -> dict[str, dict[str, float]]:
    """Ratio of the magnitudes of two levels from the angle of rest, by muscle and condition.

    A linear elasticity and a flat torque-angle relation are those with which the low level would
    end where it does.
    """
    names, rest = list(joint.muscles), joint.rest_angle
    count = len(names)
    lows = step_responses([joint] * count, [(m, low) for m in names], [rest] * count, timestep)[
        :, -1
    ]
    conditions: dict[str, list[Joint]] = {
        AS_IT_IS: [joint] * count,
        LINEAR: [with_linear_elasticity(joint, *pair) for pair in zip(names, lows, strict=True)],
        FLAT: [with_flat_torque(joint, *pair) for pair in zip(names, lows, strict=True)],
    }
    joints = [one for several in conditions.values() for one in several]
    tasks = [(muscle, high) for _ in conditions for muscle in names]
    highs = step_responses(joints, tasks, [rest] * len(tasks), timestep)[:, -1]
    ratios = highs.reshape(len(conditions), count) / lows
    return {
        muscle: dict(zip(conditions, ratios[:, k].tolist(), strict=True))
        for k, muscle in enumerate(names)
    }
