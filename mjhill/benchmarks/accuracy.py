"""Accuracy at MuJoCo's timesteps: largest angle error of the elbow in five movements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.benchmarks.result import Result
from mjhill.engine.equilibrium import equilibrate
from mjhill.engine.install import installed
from mjhill.engine.spec import joint_spec
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.simulate.reference import rest_state, simulate
from mjhill.simulate.signals import Signal, as_signal, pulse, step

TIMESTEPS = (0.5e-3, 1e-3, 2e-3, 5e-3, 10e-3)  # [s]
INTEGRATORS = ("EULER", "IMPLICIT", "IMPLICITFAST", "DISCRETE", "RK4")
DURATION = 0.8  # [s]
ONSET = 0.05  # [s], a multiple of every timestep
RK4_GOAL = 0.05  # error at 1 ms [°]
FINE = 10e-6  # [s], of the runs that the native muscle is compared with
_GRID = 0.5e-3  # [s], divides every timestep
_SETTLED = 4.0  # [s]

_Angles = NDArray[np.float64]


@dataclass(frozen=True)
class Movement:
    """The start and the inputs of one movement.

    Attributes:
        joint: The joint.
        tonic: Excitation of each muscle before the start, at which the joint has settled.
        excitation: Excitation of each muscle.
        torque: External torque [N·m].
    """

    joint: Joint
    tonic: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    excitation: Mapping[str, Signal] = field(default_factory=lambda: MappingProxyType({}))
    torque: Signal = field(default_factory=lambda: as_signal(0.0))


@cache
def movements() -> Mapping[str, Movement]:
    """The five movements of the elbow, by name."""
    joint = JOINTS["elbow"]
    flexor, extensor = joint.muscles
    most = joint.muscles[flexor].max_isometric_force
    stimulated = {
        name: replace(muscle, electrical_stimulation=True)
        for name, muscle in joint.hill_muscles.items()
    }
    both = {flexor: 0.3, extensor: 0.1}
    held = {name: as_signal(excitation) for name, excitation in both.items()}
    return {
        "rise": Movement(joint, excitation={flexor: step(0.5, ONSET)}),
        "release": Movement(joint, {flexor: 1.0}, {flexor: as_signal(1.0) + step(-1.0, ONSET)}),
        "stretch, release": Movement(
            joint, {flexor: 0.5}, {flexor: as_signal(0.5)}, pulse(-1.5 * most, ONSET, 0.04)
        ),
        "stimulation": Movement(
            replace(joint, muscles=stimulated),
            {flexor: 0.2},
            {flexor: as_signal(0.2) + step(0.6, ONSET)},
        ),
        "impact": Movement(joint, both, held, pulse(3 * most, ONSET, 0.01)),
    }


def measure() -> Result:
    """The table of errors: mjhill against SciPy, the native muscle against itself at 10 µs."""
    rows: list[dict[str, Any]] = []
    for name in movements():
        for muscle, integrators in _muscles(name).items():
            for integrator in integrators:
                row: dict[str, Any] = {"movement": name, "muscle": muscle}
                row["integrator"] = integrator.lower()
                goals = _goals(name, integrator) if muscle == "mjhill" else {}
                row["goal"] = _listed(goals)
                for timestep in TIMESTEPS:
                    percent = error(name, muscle, integrator, timestep)
                    row[f"{1e3 * timestep:g} ms"] = f"{percent:.2g}"
                row["met"] = _met(name, integrator, goals)
                rows.append(row)
    notes = (
        "elbow; rise: flexor from 0 to 0.5; release: flexor from 1 to 0; stretch, release: the "
        "flexor at 0.5 is stretched by 1.5 F_max for 40 ms; stimulation: electrical, flexor from "
        "0.2 to 0.8; impact: 3 F_max for 10 ms, flexor at 0.3, extensor at 0.1",
        "mjhill against SciPy's LSODA at 1e-9; native against itself at 10 µs",
        "goal: at most the error of the native muscle, in the movements that it can make; RK4 "
        f"at 1 ms {RK4_GOAL:g}°",
        "10 ms is above the limit of check_model for the elbow",
    )
    return Result("Largest angle error [% of the movement] by timestep", rows, notes)


def _goals(name: str, integrator: str) -> dict[float, float]:
    """The allowed error [%] of a movement, by timestep; empty without a goal."""
    if not (native := _muscles(name).get("native", ())):
        return {}
    if integrator == "RK4":
        return {1e-3: 100 * RK4_GOAL / float(np.degrees(np.ptp(_truth(name, "mjhill", ""))))}
    # under integrators that the native muscle is not measured with: its best one
    alike = integrator if integrator in native else "IMPLICITFAST"
    return {timestep: error(name, "native", alike, timestep) for timestep in (1e-3, 5e-3)}


def _listed(goals: Mapping[float, float]) -> str | None:
    parts = [f"≤ {goal:.2g} at {1e3 * timestep:g} ms" for timestep, goal in goals.items()]
    return ", ".join(parts) or None


def _met(name: str, integrator: str, goals: Mapping[float, float]) -> bool | None:
    if not goals:
        return None
    return all(error(name, "mjhill", integrator, step) <= goal for step, goal in goals.items())


def brief() -> list[tuple[str, list[tuple[float, float] | None]]]:
    """Errors [%] at 1 and 5 ms, by muscle and integrator: of each movement, and the largest."""
    rows: list[tuple[str, list[tuple[float, float] | None]]] = []
    kinds = [("mjhill", name) for name in ("EULER", "IMPLICITFAST", "DISCRETE", "RK4")]
    kinds += [("native", name) for name in ("EULER", "IMPLICITFAST")]
    for muscle, integrator in kinds:
        cells: list[tuple[float, float] | None] = []
        for name in movements():
            known = integrator in _muscles(name).get(muscle, ())
            cells.append(_at_1_and_5_ms(name, muscle, integrator) if known else None)
        found = [cell for cell in cells if cell is not None]
        cells.append((max(first for first, _ in found), max(second for _, second in found)))
        rows.append((f"{muscle}, {integrator.lower()}", cells))
    return rows


def _at_1_and_5_ms(name: str, muscle: str, integrator: str) -> tuple[float, float]:
    return error(name, muscle, integrator, 1e-3), error(name, muscle, integrator, 5e-3)


def _muscles(name: str) -> dict[str, tuple[str, ...]]:
    """The muscles that can make a movement, and their integrators."""
    native = {"native": ("EULER", "IMPLICITFAST")} if name in ("rise", "release") else {}
    return {"mjhill": INTEGRATORS, **native}


@cache
def error(name: str, muscle: str, integrator: str, timestep: float) -> float:
    """Largest angle error [% of the movement] of a movement by name."""
    # the native muscle is compared with itself, under each integrator
    truth = _truth(name, muscle, integrator if muscle == "native" else "")
    found = trajectory(_model(name, muscle), movements()[name], integrator, timestep)
    every = round(timestep / _GRID)
    return float(100 * np.abs(found - truth[::every]).max() / np.ptp(truth))


@cache
def _truth(name: str, muscle: str, integrator: str) -> _Angles:
    """Angles every 0.5 ms."""
    movement, model = movements()[name], _model(name, muscle)
    if muscle == "native":
        fine = trajectory(model, movement, integrator, FINE)
        return fine[:: round(_GRID / FINE)]
    exact = simulate(
        movement.joint,
        movement.excitation,
        torque=movement.torque,
        duration=DURATION,
        sample=_GRID,
        start=rest_state(movement.joint, _settled(model, movement), movement.tonic),
        solver="LSODA",
    )
    return exact[f"{movement.joint.name}.angle"]


@cache
def _model(name: str, muscle: str) -> mujoco.MjModel:
    from mjhill.comparison import native_model

    joint = movements()[name].joint
    return native_model(joint.name) if muscle == "native" else joint_spec(joint).compile()


def trajectory(
    model: mujoco.MjModel, movement: Movement, integrator: str, timestep: float
) -> _Angles:
    """Angle [rad] at every step of a movement."""
    angle = _settled(model, movement)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    model.opt.timestep = timestep
    data = _at(model, movement, angle)
    steps = round(DURATION / timestep)
    result = np.empty(steps + 1)
    result[0] = data.qpos[0]
    with installed():
        for index in range(steps):
            time = (index + 0.5) * timestep
            for name, signal in movement.excitation.items():
                data.actuator(name).ctrl = signal(time)
            data.qfrc_applied[0] = movement.torque(time)
            mujoco.mj_step(model, data)
            result[index + 1] = data.qpos[0]
    return result


def _settled(model: mujoco.MjModel, movement: Movement) -> float:
    """Angle [rad] at which the joint rests under the tonic excitation; home without any."""
    if not movement.tonic:
        return movement.joint.home_angle
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, 1e-3
    data = _at(model, movement, movement.joint.home_angle)
    with installed():
        mujoco.mj_step(model, data, nstep=round(_SETTLED / 1e-3))
    return float(data.qpos[0])


def _at(model: mujoco.MjModel, movement: Movement, angle: float) -> mujoco.MjData:
    """Data at rest at an angle [rad], with muscles in steady state at the tonic excitation."""
    data = mujoco.MjData(model)
    data.qpos[0] = angle
    for name, excitation in movement.tonic.items():
        data.actuator(name).ctrl = excitation
        if model.na == model.nu:  # a native muscle has one state, its activation
            data.act[model.actuator_actadr[model.actuator(name).id]] = excitation
    equilibrate(model, data)
    return data


def main() -> None:
    """Print the tables of README.md and docs/numerics.md as Markdown."""
    names = [*movements(), "worst"]
    print("| error at 1 / 5 ms [%] |" + "".join(f" {name} |" for name in names))
    print("|" + "---|" * (len(names) + 1))
    for label, cells in brief():
        shown = ["" if cell is None else f"{cell[0]:.2g} / {cell[1]:.2g}" for cell in cells]
        print(f"| {label} |" + "".join(f" {cell} |" for cell in shown))
    print("\n| error [%] | integrator |" + "".join(f" {1e3 * h:g} ms |" for h in TIMESTEPS))
    print("|" + "---|" * (len(TIMESTEPS) + 2))
    for name in movements():
        for integrator in ("IMPLICITFAST", "RK4"):
            cells_ = [f"{error(name, 'mjhill', integrator, h):.2g}" for h in TIMESTEPS]
            print(f"| {name} | {integrator.lower()} |" + "".join(f" {cell} |" for cell in cells_))


if __name__ == "__main__":
    main()
