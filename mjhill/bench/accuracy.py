"""Accuracy at MuJoCo's timesteps: largest angle error of a step of input against the reference."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.bench.result import Result
from mjhill.equilibrium import at_home
from mjhill.install import installed
from mjhill.joints import JOINTS
from mjhill.models import load
from mjhill.reference import simulate

LEVELS = (0.1, 0.5, 1.0)
TIMESTEPS = (0.5e-3, 1e-3, 2e-3, 5e-3, 10e-3)  # [s]
DURATION = 1.0  # [s]
FINE = 10e-6  # [s], for what the native muscle is compared with
_GRID = 0.5e-3  # [s], divides every timestep

_Angles = NDArray[np.float64]


def measure() -> Result:
    """The table of errors: mjhill against SciPy, the native muscle against itself at 10 µs."""
    from mjhill.comparison import native_model

    joint = JOINTS["elbow"]
    ours, native = load(joint.name), native_model(joint.name)
    rows: list[dict[str, Any]] = []
    for level in LEVELS:
        agonist = next(iter(joint.muscles))
        exact = simulate(joint, {agonist: level}, duration=DURATION, sample=_GRID)
        truth = exact[f"{joint.name}.angle"]
        for integrator in mujoco.mjtIntegrator.__members__:
            rows.append(_row("mjhill", ours, integrator, level, truth))
        for integrator in ("mjINT_EULER", "mjINT_IMPLICITFAST"):
            fine = angles(native, integrator, FINE, level)[:: round(_GRID / FINE)]
            rows.append(_row("native", native, integrator, level, fine))
    notes = (
        f"elbow from its home pose, input of the flexor stepped at 0, {DURATION:g} s",
        "mjhill against SciPy's Radau at 1e-9; native against itself at 10 µs",
        "goal: mjhill under Euler and implicitfast at most 0.15 % at 1 ms and 2 % at 5 ms",
        "goal: mjhill under RK4 at most 0.05° at 1 ms",
    )
    return Result("Largest angle error [°] (share of the movement) by timestep", rows, notes)


def _row(
    muscle: str, model: mujoco.MjModel, integrator: str, level: float, truth: _Angles
) -> dict[str, Any]:
    movement = float(np.ptp(truth))
    row: dict[str, Any] = {
        "u": level,
        "movement": f"{np.degrees(movement):.0f}°",
        "muscle": muscle,
        "integrator": _short(integrator),
    }
    for timestep in TIMESTEPS:
        worst = error(model, integrator, timestep, level, truth)
        cell = f"{np.degrees(worst):.2g}° ({100 * worst / movement:.2g} %)"
        row[f"{1e3 * timestep:g} ms"] = cell
    return row


def angles(model: mujoco.MjModel, integrator: str, timestep: float, level: float) -> _Angles:
    """Angle [rad] at every step of a run in which the first actuator's input steps to a level."""
    model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
    model.opt.timestep = timestep
    data = at_home(model)
    data.ctrl[0] = level
    steps = round(DURATION / timestep)
    result = np.empty(steps + 1)
    result[0] = data.qpos[0]
    with installed():
        for step in range(steps):
            mujoco.mj_step(model, data)
            result[step + 1] = data.qpos[0]
    return result


def brief(level: float = 0.5) -> list[tuple[str, float, float]]:
    """Errors at 1 and 5 ms in percent of the movement, by muscle and integrator, at one level."""
    from mjhill.comparison import native_model

    joint = JOINTS["elbow"]
    ours, native = load(joint.name), native_model(joint.name)
    agonist = next(iter(joint.muscles))
    exact = simulate(joint, {agonist: level}, duration=DURATION, sample=_GRID)
    truth = exact[f"{joint.name}.angle"]
    rows = []
    for integrator in ("mjINT_EULER", "mjINT_IMPLICITFAST", "mjINT_DISCRETE", "mjINT_RK4"):
        rows.append(("mjhill, " + _short(integrator), *_percent(ours, integrator, level, truth)))
    for integrator in ("mjINT_EULER", "mjINT_IMPLICITFAST"):
        fine = angles(native, integrator, FINE, level)[:: round(_GRID / FINE)]
        rows.append(("native, " + _short(integrator), *_percent(native, integrator, level, fine)))
    return rows


def _percent(
    model: mujoco.MjModel, integrator: str, level: float, truth: _Angles
) -> tuple[float, float]:
    movement = float(np.ptp(truth))
    at_1_ms, at_5_ms = (
        100 * error(model, integrator, timestep, level, truth) / movement
        for timestep in (1e-3, 5e-3)
    )
    return at_1_ms, at_5_ms


def error(
    model: mujoco.MjModel, integrator: str, timestep: float, level: float, truth: _Angles
) -> float:
    """Largest angle error [rad] against a truth sampled every 0.5 ms."""
    found = angles(model, integrator, timestep, level)
    return float(np.abs(found - truth[:: round(timestep / _GRID)]).max())


def _short(integrator: str) -> str:
    return integrator.removeprefix("mjINT_").lower()
