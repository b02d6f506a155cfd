"""Residual of the energy balance of each joint in the movement of ``mjhill demo``.

``mjhill bench balance`` prints the table of docs/energy.md.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco

from mjhill.benchmarks.result import Result
from mjhill.engine.equilibrium import at_home
from mjhill.engine.install import installed
from mjhill.engine.layout import muscle_names
from mjhill.joints.reader import JOINTS
from mjhill.simulate.energy import energy
from mjhill.simulate.load import load
from mjhill.simulate.run import record
from mjhill.simulate.scripted import movement

DURATION = 2.4  # [s], step and pulse pair
CASES = (  # integrator and timestep [s]
    ("implicitfast", 1e-3),
    ("implicitfast", 0.5e-3),
    ("rk4", 1e-3),
)


@cache
def gaps(joint: str, integrator: str, timestep: float) -> tuple[float, float]:
    """Largest residual of the whole and of the muscles alone, as shares of the largest term [-]."""
    model = load(joint)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.timestep = timestep
    with installed():
        run = record(
            model,
            at_home(model),
            duration=DURATION,
            excitation=movement(muscle_names(model)),
        )
    balance = energy(run)
    return balance.gap, balance.muscle_gap


def measure() -> Result:
    """A row for each joint: the largest residual of the whole and of the muscles alone."""
    table: list[dict[str, Any]] = []
    for joint, pairs in rows():
        row: dict[str, Any] = {"joint": joint}
        for (integrator, timestep), (whole, muscles) in zip(CASES, pairs, strict=True):
            row[f"{integrator}, {1e3 * timestep:g} ms"] = f"{whole:.2g} / {muscles:.2g}"
        table.append(row)
    notes = (
        "the movement of mjhill demo; the whole / the muscles alone, in percent of the largest "
        "term of the balance; docs/energy.md explains the terms",
    )
    return Result("Residual of the energy balance [%]", table, notes)


def rows() -> list[tuple[str, list[tuple[float, float]]]]:
    """Joints, each with the two residuals [%] (the whole, the muscles alone) of every case."""
    found = []
    for joint in JOINTS:
        pairs = [gaps(joint, *case) for case in CASES]
        found.append((joint, [(100 * whole, 100 * muscles) for whole, muscles in pairs]))
    return found
