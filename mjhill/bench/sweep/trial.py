"""One case solved by the reference and by MuJoCo at several timesteps, and how far they differ."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from mjhill.bench.sweep.cases import DURATION, Case
from mjhill.equilibrium import equilibrate
from mjhill.layout import address, addresses, joint_id, read_muscle
from mjhill.recording import Recording
from mjhill.reference import rest_state, simulate
from mjhill.signals import Signal, as_signal

SAMPLE = 0.5e-3  # [s], divides every timestep of the sweep
FINE = 10e-6  # [s], RK4's timestep where the reference solver cannot follow
PUSH = 1e-3  # share of the range of angle and of F_max by which a sensitive system is found
_PUSHED_FINE = 50e-6  # [s], coarser: two pushed runs are compared with one another

_Values = NDArray[np.float64]
_FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
_INPUTS = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED


@dataclass(frozen=True)
class Truth:
    """The solution of a case that MuJoCo is measured against.

    Attributes:
        case: The case.
        positions: Positions at multiples of ``SAMPLE``, shape (T, nq).
        forces: Tension of each muscle there, shape (T, nmuscle); None for spatial tendons.
        amplification: Largest change of position, in units of ``PUSH``, that a push makes.
    """

    case: Case
    positions: _Values
    forces: _Values | None
    amplification: float

    @property
    def range(self) -> float:
        """Range of the joint that moves most [rad or m]."""
        return float(np.ptp(self.positions, axis=0).max())


def solve(case: Case) -> Truth:
    """Solve a case as exactly as is possible, and find how much it amplifies a push."""
    if case.movement:
        recording = _reference(case)
        return Truth(case, _positions(case, recording), _forces(case, recording), 0.0)
    if case.system is None:
        positions, forces = run(case, "RK4", FINE), None
        base = run(case, "RK4", _PUSHED_FINE)
        runs = [run(other, "RK4", _PUSHED_FINE) for other in _pushed(case, positions)]
    else:
        recording = _reference(case)
        positions, forces = _positions(case, recording), _forces(case, recording)
        base = positions
        runs = [_positions(case, _reference(other)) for other in _pushed(case, positions)]
    most = max(float(np.abs(pushed - base).max()) for pushed in runs)
    return Truth(case, positions, forces, most / (PUSH * float(np.ptp(positions, axis=0).max())))


def _pushed(case: Case, positions: _Values) -> list[Case]:
    """The case from a start moved by a share of the range, and under a torque of a share of F_max."""
    [first, *_] = case.start
    moved = {**case.start, first: case.start[first] + PUSH * float(np.ptp(positions, axis=0).max())}
    largest = max(read_muscle(case.model, name).max_isometric_force for name in case.tonic)
    if case.system is None:  # force of a tendon to torque of a hinge
        data = mujoco.MjData(case.model)
        mujoco.mj_fwdPosition(case.model, data)
        largest *= float(np.abs(data.actuator_moment).max())
    torque = case.torque.get(first, as_signal(0.0)) + PUSH * largest
    return [replace(case, start=moved), replace(case, torque={**case.torque, first: torque})]


def _reference(case: Case, **options: float) -> Recording:
    assert case.system is not None
    start = rest_state(case.system, case.start, case.tonic)
    return simulate(
        case.system, case.excitation, torque=case.torque, movement=case.movement,
        duration=DURATION, start=start, sample=SAMPLE, solver="LSODA", **options,
    )  # fmt: skip


def _positions(case: Case, recording: Recording) -> _Values:
    assert case.system is not None
    names = [
        f"{name}.{'position' if coordinate.slide else 'angle'}"
        for name, coordinate in case.system.coordinates.items()
    ]
    return np.array([recording[name] for name in names]).T


def _forces(case: Case, recording: Recording) -> _Values:
    return np.array([recording[f"{name}.force"] for name in case.tonic]).T


def use(model: mujoco.MjModel, integrator: str, timestep: float) -> None:
    """Set integrator, by its name in MJCF, and timestep [s]."""
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.timestep = timestep


def run(case: Case, integrator: str, timestep: float) -> _Values:
    """Positions at multiples of ``SAMPLE`` or of the timestep, whichever is longer.

    Shape (T, nq). Callbacks must be installed. From where MuJoCo warns, positions are NaN.
    """
    use(case.model, integrator, timestep)
    data = at_start(case)
    return _rollout(case.model, data, _inputs(case, timestep), round(SAMPLE / timestep) or 1)


def floor(truth: Truth, integrator: str, timestep: float) -> _Values:
    """As ``run``, of the same plant driven by the true muscle torques."""
    case = truth.case
    assert truth.forces is not None
    use(case.model, integrator, timestep)
    data = at_start(case)
    arms = np.zeros((len(case.tonic), case.model.nv))
    for row, name in enumerate(case.tonic):
        at = address(case.model, name)
        mujoco.mju_sparse2dense(
            arms[row : row + 1], data.actuator_moment,
            data.moment_rownnz[at.out : at.out + 1], data.moment_rowadr[at.out : at.out + 1],
            data.moment_colind,
        )  # fmt: skip
    inputs = _inputs(case, timestep)
    every = round(timestep / SAMPLE)
    inputs[:, case.model.nu :] -= truth.forces[::every][: len(inputs)] @ arms
    before = case.model.opt.disableflags
    case.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    try:
        return _rollout(case.model, data, inputs, 1)
    finally:
        case.model.opt.disableflags = before


def stretched(case: Case, timestep: float, integrator: str = "implicitfast") -> _Values:
    """Tension of the muscles of a case whose joint is moved, at every step, shape (T, nmuscle)."""
    use(case.model, integrator, timestep)
    data = at_start(case)
    inputs = _inputs(case, timestep)
    outs = [address(case.model, name).out for name in case.tonic]
    steps = round(DURATION / timestep)
    forces = np.empty((steps + 1, len(outs)))
    for step in range(steps + 1):
        for name, movement in case.movement.items():
            joint = case.model.joint(name)
            data.qpos[joint.qposadr[0]] = movement.position(step * timestep)
            data.qvel[joint.dofadr[0]] = (movement.position(step*timestep)-movement.position((step-1)*timestep))/timestep
        data.ctrl[:] = inputs[min(step, steps - 1), : case.model.nu]
        mujoco.mj_step(case.model, data)
        forces[step] = -data.actuator_force[outs]
    return forces


def at_start(case: Case) -> mujoco.MjData:
    """Data of a case at its start."""
    data = mujoco.MjData(case.model)
    for name, position in case.start.items():
        data.qpos[case.model.jnt_qposadr[joint_id(case.model, name)]] = position
    for name, at in addresses(case.model):
        data.ctrl[at.ctrl] = case.tonic[name]
    equilibrate(case.model, data)
    return data


def _inputs(case: Case, timestep: float) -> _Values:
    """Controls and applied forces of each step, their values of mid-step."""
    model = case.model
    times = (np.arange(round(DURATION / timestep)) + 0.5) * timestep
    inputs = np.zeros((len(times), model.nu + model.nv))
    for name, signal in case.excitation.items():
        inputs[:, address(model, name).ctrl] = _sampled(signal, times)
    for name, signal in case.torque.items():
        inputs[:, model.nu + model.jnt_dofadr[joint_id(model, name)]] = _sampled(signal, times)
    return inputs


def _sampled(signal: Signal, times: _Values) -> list[float]:
    return [signal(time) for time in times.tolist()]


def _rollout(model: mujoco.MjModel, data: mujoco.MjData, inputs: _Values, every: int) -> _Values:
    start = np.empty(mujoco.mj_stateSize(model, _FULL))
    mujoco.mj_getState(model, data, start, _FULL)
    states, _ = mujoco.rollout.rollout(
        model, data, start[None], inputs[None], control_spec=int(_INPUTS)
    )
    positions = np.vstack([start, states[0]])[:, 1 : 1 + model.nq]
    if data.warning.number.any():  # the rest repeats the last good state, or a reset one
        after = max(round(data.time / model.opt.timestep), 1)
        positions[after:] = np.nan
    return np.ascontiguousarray(positions[::every])
