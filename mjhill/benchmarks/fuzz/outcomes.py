"""One random model: the findings of the checks, and the failures of a run."""

from __future__ import annotations

import math
import warnings
from copy import copy
from dataclasses import dataclass
from zlib import crc32

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from mjhill.benchmarks.fuzz.draws import Random, chance, log_uniform
from mjhill.benchmarks.fuzz.models import KINDS, random_model
from mjhill.engine.checks import Finding, check_model
from mjhill.engine.equilibrium import check_states, equilibrate
from mjhill.engine.layout import addresses, in_order, muscle_groups
from mjhill.engine.tendons import check_tendons
from mjhill.simulate.run import record
from mjhill.simulate.signals import Signal

STEPS = 400
HOLD = 20  # steps between two changes of the controls
STRONGEST = 3.0  # more tension than any muscle has [F_max]
ROUNDING = 1e-9  # n and a may be outside [0, 1] by so much

_FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """A model, its data at the start, and the controls of each step.

    Attributes:
        kind: Kind of model, one of ``KINDS``.
        number: Number within the kind; both together determine the case.
        model: The model.
        data: Its state at the start.
        controls: Shape (STEPS, nu); some values are not valid controls.
        start: How the start was made.
    """

    kind: str
    number: int
    model: mujoco.MjModel
    data: mujoco.MjData
    controls: _Values
    start: str

    @property
    def name(self) -> str:
        """Kind and number."""
        return f"{self.kind}:{self.number}"


@dataclass(frozen=True)
class Outcome:
    """What the checks say of one model, and what its run does.

    Attributes:
        case: Kind and number, as ``hinge:17``.
        integrator: Its name in MuJoCo.
        timestep: [s].
        start: How the start was made.
        failures: What the run did although no muscle can; empty if all was well.
        findings: Severe findings, and errors of the checks.
        hints: Findings that are not severe.
        plant: Whether MuJoCo warns of the same run without mjhill's muscles and elasticities.
        reported: What ``mjhill.record`` says of the same run, if the checks found nothing.
    """

    case: str
    integrator: str
    timestep: float
    start: str
    failures: tuple[str, ...]
    findings: tuple[str, ...]
    hints: tuple[str, ...]
    plant: bool
    reported: str

    @property
    def kind(self) -> str:
        """Kind of model."""
        return self.case.partition(":")[0]

    @property
    def verdict(self) -> str:
        """One of: sound, predicted, finding only (no failure), plant, reported, silent."""
        if not self.failures:
            return "finding only" if self.findings else "sound"
        if self.findings:
            return "predicted"
        if self.plant:
            return "plant"
        return "reported" if self.reported else "silent"


def draw(kind: str, number: int) -> Case:
    """The case of a kind and number; always the same.

    Raises:
        ValueError: There is no such kind, or the number is negative.
    """
    if kind not in KINDS:
        raise ValueError(f"unknown kind of model {kind!r}; there are: {', '.join(KINDS)}")
    if number < 0:
        raise ValueError(f"a case has a number of 0 or more, got {number}")
    random = np.random.default_rng([crc32(f"fuzz {kind}".encode()), number])
    model, reach = random_model(kind, random)
    data = mujoco.MjData(model)
    start = str(random.choice(["reset", "near", "far", "act"], p=[0.25, 0.45, 0.15, 0.15]))
    if start != "reset":
        _pose(random, model, data, reach * log_uniform(random, 0.1, 1), start == "far")
        if start != "far" and chance(random, 0.8):
            _hold_equalities(model, data)
    controls = _controls(random, model)
    data.ctrl[:] = controls[0]
    if start in ("near", "act") or (start == "far" and chance(random, 0.7)):
        _equilibrate(model, data)
    else:
        start += " unsteady"
    if start == "act":
        _impossible_states(random, model, data)
    return Case(kind, number, model, data, controls, start)


def run(kind: str, number: int) -> Outcome:
    """Check a case, then run it. Callbacks must be installed."""
    case = draw(kind, number)
    findings, hints = _findings(case)
    failures = _failures(case)
    if failures and not findings:  # last, because it takes longer than the run
        findings = tuple(str(finding) for finding in check_tendons(case.model))
    warned = any(failure.startswith("WARN") for failure in failures)
    reported = "" if not failures or findings else _reported(case)
    return Outcome(
        case.name, mujoco.mjtIntegrator(case.model.opt.integrator).name[6:].lower(),
        float(case.model.opt.timestep), case.start, failures, findings, hints,
        warned and _plant_warns(case), reported,
    )  # fmt: skip


def _pose(
    random: Random, model: mujoco.MjModel, data: mujoco.MjData, reach: float, far: bool
) -> None:
    """Move hinges and slides within a reach [rad or m], or far outside of it; some also move."""
    for joint in range(model.njnt):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_BALL:
            continue
        position = float(random.uniform(-1, 1)) * reach
        if far:
            position = math.copysign(log_uniform(random, 1.0, 100.0), position)
        data.qpos[model.jnt_qposadr[joint]] += position
        if chance(random, 0.3):
            data.qvel[model.jnt_dofadr[joint]] = float(random.normal()) * 3.0 * reach


def _hold_equalities(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Back to ``qpos0``, at rest, if the pose violates an equality constraint."""
    mujoco.mj_fwdPosition(model, data)
    if data.ne and np.abs(data.efc_pos[: data.ne]).max() > 1e-6:
        data.qpos[:] = model.qpos0
        data.qvel[:] = 0.0


def _equilibrate(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Muscles in steady state at the controls; 0 replaces a control that is not finite."""
    held = data.ctrl.copy()
    data.ctrl[:] = np.where(np.isfinite(held), held, 0.0)
    equilibrate(model, data)
    data.ctrl[:] = held


def _impossible_states(random: Random, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Set one to three states to values that a muscle never has."""
    values = [-0.5, -1e-3, 1.01, 2.0, 1e3, -1e10, 1e10, 1e300, -1e300, math.inf, math.nan, 0.5]
    for _ in range(int(random.integers(1, 4))):
        data.act[int(random.integers(model.na))] = float(random.choice(values))


def _controls(random: Random, model: mujoco.MjModel) -> _Values:
    """Excitations that jump every ``HOLD`` steps; in one case of four, some are not valid."""
    spans = STEPS // HOLD
    excitations = random.choice([0.0, 1.0, np.nan], size=(spans, model.nu), p=[0.3, 0.3, 0.4])
    drawn = random.uniform(0, 1, excitations.shape)
    excitations = np.where(np.isnan(excitations), drawn, excitations)
    if chance(random, 0.25):
        wrong = [math.nan, math.inf, -math.inf, -1.0, 1.5, 1e6, -1e6, 1e12]
        where = random.random(excitations.shape) < 0.15
        chosen = random.choice(wrong, size=excitations.shape)
        excitations = np.where(where, chosen, excitations)
    return np.repeat(excitations, HOLD, axis=0)


def _findings(case: Case) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Errors and severe findings of the checks; then the findings that are not severe."""
    found: list[Finding] = []
    errors: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        try:
            found += check_model(case.model)
        except ValueError as error:
            errors.append(f"check_model: {error}")
    try:
        check_states(case.model, _copy(case))
    except ValueError as error:
        errors.append(f"check_states: {error}")
    severe = [str(finding) for finding in found if finding.severe]
    return (*errors, *severe), tuple(str(finding) for finding in found if not finding.severe)


def _copy(case: Case) -> mujoco.MjData:
    data = mujoco.MjData(case.model)
    mujoco.mj_copyData(data, case.model, case.data)
    return data


def _failures(case: Case) -> tuple[str, ...]:
    """What a run of a case does although no muscle can."""
    model, data = case.model, _copy(case)
    start = np.empty(mujoco.mj_stateSize(model, _FULL))
    mujoco.mj_getState(model, data, start, _FULL)
    states, sensed = mujoco.rollout.rollout(model, data, start[None], case.controls[None])
    counts = data.warning.number.copy()
    if not (np.abs(case.controls) <= mujoco.mjMAXVAL).all():
        counts[int(mujoco.mjtWarning.mjWARN_BADCTRL)] = 0  # MuJoCo warns rightly
    # after act comes the history of delays, which holds unclamped controls
    physics = states[0][:, : 1 + model.nq + model.nv + model.na]
    return impossible(model, physics, -np.asarray(sensed[0]), counts)


def impossible(
    model: mujoco.MjModel, states: _Values, tension: _Values, warned: NDArray[np.int32]
) -> tuple[str, ...]:
    """What a run does although no muscle can.

    Args:
        model: A model whose actuators are all muscles.
        states: State after each step, ``act`` last, shape (steps, size).
        tension: Of each muscle in each step, shape (steps, nmuscle).
        warned: How often MuJoCo gave each of its warnings.
    """
    failures = [mujoco.mjtWarning(int(i)).name[2:] for i in np.flatnonzero(warned)]
    if not (np.isfinite(states).all() and np.isfinite(tension).all()):
        failures.append("not finite")
    shares = [
        states.shape[1] - model.na + at.state(state.name)
        for _, at in addresses(model)
        for state in at.model.states
        if state.share
    ]
    act = states[:, shares]
    if (act < -ROUNDING).any() or (act > 1 + ROUNDING).any():
        failures.append("n or a outside")
    if (tension < 0).any():
        failures.append("pushes")
    (force,) = in_order(muscle_groups(model), "max_isometric_force")
    if (tension > STRONGEST * force).any():
        failures.append("too strong")
    return tuple(failures)


def _plant_warns(case: Case) -> bool:
    """Whether MuJoCo warns of the same run without mjhill's muscles and elasticities."""
    model, data = copy(case.model), _copy(case)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    if model.nuser_jnt:
        model.jnt_user[:] = 0.0
    mujoco.mj_step(model, data, STEPS)
    return bool(data.warning.number.any())


def _reported(case: Case) -> str:
    """What ``record`` warns of or raises in a run; empty if nothing."""
    model, timestep = case.model, float(case.model.opt.timestep)
    inputs = _clamped(model, case.controls)
    excitation = {name: _held(inputs[:, at.ctrl], timestep) for name, at in addresses(model)}
    data = _copy(case)
    data.ctrl[:] = inputs[0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", "muscle .* did what no muscle can", RuntimeWarning)
        try:
            record(model, data, excitation=excitation, duration=STEPS * timestep)
        except (RuntimeError, RuntimeWarning) as said:
            return str(said)
        except ValueError:  # refused because of its inputs, not of the failure
            return ""
    return ""


def _clamped(model: mujoco.MjModel, controls: _Values) -> _Values:
    """Controls as MuJoCo uses them: clamped, then 0 for all if one is still not valid."""
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL:
        limited = model.actuator_ctrllimited.astype(bool)
        clamped = np.clip(controls, *model.actuator_ctrlrange.T)  # NaN stays NaN
        controls = np.where(limited, clamped, controls)
    good = (np.abs(controls) <= mujoco.mjMAXVAL).all(axis=1)
    return np.where(good[:, None], controls, 0.0)


def _held(values: _Values, timestep: float) -> Signal:
    """A signal that holds each value for a timestep [s]."""
    return Signal(lambda time: float(values[min(int(time / timestep), len(values) - 1)]))
