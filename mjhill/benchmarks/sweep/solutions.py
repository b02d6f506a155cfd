"""One case solved by the reference solver and by MuJoCo, and the difference between the two."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from mjhill.benchmarks.sweep.cases import DURATION, Case
from mjhill.engine.equilibrium import equilibrate
from mjhill.engine.layout import address, addresses, joint_id, read_muscle
from mjhill.simulate.recording import Recording
from mjhill.simulate.reference import rest_state, simulate
from mjhill.simulate.signals import Signal, as_signal

SAMPLE = 0.5e-3  # [s], divides every timestep of the sweep
FINE = 50e-6  # [s], RK4's timestep where the reference solver cannot follow
PUSH = 1e-3  # share of the range of angle and of F_max; its growth shows a sensitive system
_PUSHED_FINE = 200e-6  # [s], coarser: two pushed runs are compared with one another
_RTOL, _ATOL = 1e-7, 1e-9  # of the reference, a thousandth of the errors to find
_PUSHED_LOOSER = (
    100  # times: an error of a hundredth of the push still shows how much the push grows
)

_Values = NDArray[np.float64]
_FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
_INPUTS = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED


@dataclass(frozen=True)
class Truth:
    """The solution of a case that MuJoCo is measured against.

    Attributes:
        case: The case.
        positions: Positions at multiples of ``SAMPLE``, shape (T, nq).
        forces: Tension of each muscle there, shape (T, nmuscle).
        amplification: Largest change of position, in units of ``PUSH``, that a push makes.
    """

    case: Case
    positions: _Values
    forces: _Values
    amplification: float

    @property
    def range(self) -> float:
        """Range of the joint that moves most [rad or m]."""
        return float(np.ptp(self.positions, axis=0).max())


def solve(case: Case) -> Truth:
    """Solve a case as exactly as possible, and find how much it amplifies a push."""
    if case.movement:
        recording = _reference(case)
        return Truth(case, _positions(case, recording), _forces(case, recording), 0.0)
    if case.system is None:
        positions, forces = _fine(case, FINE)
        base, _ = _fine(case, _PUSHED_FINE)
        runs = [_fine(other, _PUSHED_FINE)[0] for other in _pushed(case, positions)]
    else:
        recording = _reference(case)
        positions, forces = _positions(case, recording), _forces(case, recording)
        base = positions
        runs = [
            _positions(case, _reference(other, _PUSHED_LOOSER))
            for other in _pushed(case, positions)
        ]
    most = max(float(np.abs(pushed - base).max()) for pushed in runs)
    return Truth(case, positions, forces, most / (PUSH * float(np.ptp(positions, axis=0).max())))


def _pushed(case: Case, positions: _Values) -> list[Case]:
    """Two cases: one starts a share of the range away, the other gets a push."""
    [first, *_] = case.start
    moved = {**case.start, first: case.start[first] + PUSH * float(np.ptp(positions, axis=0).max())}
    largest = _largest_force(case)
    if case.system is None:  # from the force of a tendon to the torque of a hinge
        data = mujoco.MjData(case.model)
        mujoco.mj_fwdPosition(case.model, data)
        largest *= float(np.abs(data.actuator_moment).max())
    torque = case.torque.get(first, as_signal(0.0)) + PUSH * largest
    return [replace(case, start=moved), replace(case, torque={**case.torque, first: torque})]


def _reference(case: Case, looser: float = 1.0) -> Recording:
    assert case.system is not None
    start = rest_state(case.system, case.start, case.tonic)
    return simulate(
        case.system, case.excitation, torque=case.torque, movement=case.movement,
        duration=DURATION, start=start, sample=SAMPLE, solver="LSODA", rtol=looser * _RTOL,
        atol=looser * _ATOL,
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


def _fine(case: Case, timestep: float) -> tuple[_Values, _Values]:
    """Positions and tensions of a case under RK4 at multiples of ``SAMPLE``.

    Its sensors are the forces of its muscles. The last tension is that of the step before.
    """
    use(case.model, "RK4", timestep)
    every = round(SAMPLE / timestep)
    positions, sensed = _rollout(case.model, at_start(case), inputs_of(case, timestep))
    return positions[::every], -np.vstack([sensed, sensed[-1]])[::every]


def use(model: mujoco.MjModel, integrator: str, timestep: float) -> None:
    """Set integrator, by its name in MJCF, and timestep [s]."""
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.timestep = timestep


def run(case: Case, integrator: str, timestep: float, every: int | None = None) -> _Values:
    """Positions at multiples of ``SAMPLE`` or of the timestep, whichever is longer.

    Or at each ``every``-th step. Shape (T, nq). Callbacks must be installed. After a warning of
    MuJoCo positions are NaN.
    """
    use(case.model, integrator, timestep)
    positions, _ = _rollout(case.model, at_start(case), inputs_of(case, timestep))
    return positions[:: every or round(SAMPLE / timestep) or 1]


def error(truth: Truth, found: _Values) -> float:
    """Largest error of positions [% of the range], or of tension [% of F_max] where prescribed."""
    if truth.case.movement:
        exact, unit = truth.forces, _largest_force(truth.case)
    else:
        exact, unit = truth.positions, truth.range
    exact = exact[:: (len(exact) - 1) // (len(found) - 1)]
    worst = float(np.abs(found - exact)[1:].max())
    return 100 * worst / unit if np.isfinite(worst) else float("inf")


def _largest_force(case: Case) -> float:
    return max(read_muscle(case.model, name).max_isometric_force for name in case.tonic)


def floor(truth: Truth, integrator: str, timestep: float) -> _Values:
    """As ``run``, but motors with the true tensions replace the muscles."""
    case = truth.case
    model = copy(case.model)
    use(model, integrator, timestep)
    data = at_start(case)
    inputs = inputs_of(case, timestep)
    every = round(timestep / SAMPLE)
    for column, name in enumerate(case.tonic):
        at = address(model, name)
        model.actuator_dyntype[at.actuator] = mujoco.mjtDyn.mjDYN_NONE
        model.actuator_actadr[at.actuator], model.actuator_actnum[at.actuator] = -1, 0
        model.actuator_biastype[at.actuator] = mujoco.mjtBias.mjBIAS_NONE
        model.actuator_gainprm[at.actuator, 0] = -1.0
        model.actuator_ctrllimited[at.ctrl] = 0
        inputs[:, at.ctrl] = truth.forces[::every, column][: len(inputs)]
    positions, _ = _rollout(model, data, inputs)
    return positions


def stretched(case: Case, integrator: str, timestep: float) -> _Values:
    """Tension of the muscles of a case whose joint is moved, at every step, shape (T, nmuscle).

    Velocity is, as in MuJoCo's own movements, the mean of the step before.
    """
    use(case.model, integrator, timestep)
    data = at_start(case)
    inputs = inputs_of(case, timestep)
    outs = [address(case.model, name).out for name in case.tonic]
    steps = round(DURATION / timestep)
    forces = np.empty((steps + 1, len(outs)))
    for step in range(steps + 1):
        for name, movement in case.movement.items():
            joint = joint_id(case.model, name)
            now, before = (movement.position(k * timestep) for k in (step, step - 1))
            data.qpos[case.model.jnt_qposadr[joint]] = now
            data.qvel[case.model.jnt_dofadr[joint]] = (now - before) / timestep if step else 0.0
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


def inputs_of(case: Case, timestep: float) -> _Values:
    """Controls and applied forces of each step: the values in the middle of the step."""
    model = case.model
    times = (np.arange(round(DURATION / timestep)) + 0.5) * timestep
    inputs = np.zeros((len(times), model.nu + model.nv))
    for name, signal in case.excitation.items():
        inputs[:, address(model, name).ctrl] = _sampled(signal, times)
    for name, signal in case.torque.items():
        inputs[:, model.nu + model.jnt_dofadr[joint_id(model, name)]] = _sampled(signal, times)
    return inputs


def _sampled(signal: Signal, times: NDArray[Any]) -> list[float]:
    return [signal(time) for time in times.tolist()]


def _rollout(
    model: mujoco.MjModel, data: mujoco.MjData, inputs: _Values
) -> tuple[_Values, _Values]:
    """Positions at the start and after each step, and the readings of the sensors."""
    start = np.empty(mujoco.mj_stateSize(model, _FULL))
    mujoco.mj_getState(model, data, start, _FULL)
    states, sensed = mujoco.rollout.rollout(
        model, data, start[None], inputs[None], control_spec=int(_INPUTS)
    )
    positions = np.vstack([start, states[0]])[:, 1 : 1 + model.nq]
    if data.warning.number.any():  # the rest repeats the last good state, or a reset one
        after = max(round(data.time / model.opt.timestep), 1)
        positions[after:] = np.nan
    return positions, np.asarray(sensed[0])
