"""Cost of a step: bare plant, native muscles and ours, interleaved."""

from __future__ import annotations

from typing import Any

import mujoco

from mjhill.bench.result import Result
from mjhill.comparison import step_cost

ROUNDS, STEPS = 300, 300


def measure() -> Result:
    """Microseconds per step and per muscle, medians of interleaved blocks."""
    rows: list[dict[str, Any]] = []
    for integrator in ("Euler", "implicitfast", "RK4"):
        cost = step_cost("elbow", rounds=ROUNDS, steps=STEPS, integrator=integrator)
        rows.append(
            {
                "integrator": integrator,
                "bare [µs/step]": cost.bare,
                "native": cost.native,
                "mjhill": cost.mjhill,
                "native/muscle [µs]": cost.native_per_muscle,
                "mjhill/muscle": cost.mjhill_per_muscle,
                "whole step, mjhill : native": cost.ratio,
            }
        )
    notes = (
        f"{ROUNDS} rounds of {STEPS} steps each, A B C A B C ..., joint in motion",
        "bare: the same plant with a motor for each muscle",
        "goal: at most 0.12 µs per muscle under Euler and implicitfast; whole step at most 1.2",
        f"MuJoCo {mujoco.__version__}",
    )
    return Result("Cost of a step", rows, notes)
