"""Cost of a step: without muscles, with native muscles, with mjhill's, interleaved."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from mjhill.benchmarks.result import Result
from mjhill.comparison import step_cost
from mjhill.engine.spec import joint_spec
from mjhill.joints.reader import JOINTS

ROUNDS, STEPS = 1500, 150
PER_MUSCLE, WHOLE = 0.12, 1.2  # goals: [µs], [native muscles = 1]


def measure() -> Result:
    """Microseconds per step and per muscle, medians of interleaved blocks."""
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        hinge = Path(folder) / "hinge.xml"
        spec = joint_spec(JOINTS["elbow"])
        spec.compile()
        hinge.write_text(spec.to_xml(), encoding="utf-8")
        for name, model in (("bare hinge", hinge), ("elbow scene", "elbow")):
            for integrator in ("Euler", "implicitfast", "RK4"):
                cost = step_cost(model, rounds=ROUNDS, steps=STEPS, integrator=integrator)
                wanted = integrator != "RK4"  # which computes the muscle four times a step
                met = cost.mjhill_per_muscle <= PER_MUSCLE and cost.ratio <= WHOLE
                rows.append(
                    {
                        "model": name,
                        "integrator": integrator,
                        "goal": f"≤ {PER_MUSCLE:g} µs/muscle, ≤ {WHOLE:g}" if wanted else None,
                        "no muscle [µs/step]": cost.bare,
                        "native": cost.native,
                        "mjhill": cost.mjhill,
                        "native/muscle [µs]": cost.native_per_muscle,
                        "mjhill/muscle": cost.mjhill_per_muscle,
                        "mjhill : native, whole step": cost.ratio,
                        "met": met if wanted else None,
                    }
                )
    notes = (
        f"{ROUNDS} rounds of {STEPS} steps each, A B C A B C ..., joint in motion",
        "no muscle: a motor for each muscle; differences and ratios are those within a round",
        f"goal: at most {PER_MUSCLE:g} µs per muscle under Euler and implicitfast, and at most "
        f"{WHOLE:g} times the whole step with native muscles",
        "RK4 computes the muscle four times a step",
    )
    return Result("Cost of a step with the elbow's two muscles", rows, notes)
