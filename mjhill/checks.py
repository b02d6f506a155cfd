"""Models checked before they run: nothing can be raised from inside a compiled callback."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.layout import (
    MUSCLE_TAG,
    NUSER_JNT,
    PASSIVE_TAG,
    SCALAR_JOINTS,
    STATES,
    actuator_names,
    has_passive,
    joint_names,
    moments,
    muscle_ids,
    parameter_columns,
    read_muscles,
    read_passive,
)
from mjhill.parameters import Muscle, quantities

COARSE = 0.2  # natural frequency x timestep (thirty steps a period) from which 5 % may be lost
PASSIVE_LOAD = 2.0  # passive torque that a movement may meet, in units of the strongest muscle's
GRAVITY = "mjhill_gravity"  # name of the custom numeric with the gravity that a model is made for

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """Something about a model that makes its results doubtful.

    Attributes:
        subject: What it is about: a joint or a muscle, and its name.
        problem: What is wrong with it, and what comes of that.
        remedy: What to do.
        severe: Whether results are meaningless, not only off by more than 5 %.
        timestep: The timestep [s] that would do, where it is too long.
    """

    subject: str
    problem: str
    remedy: str
    severe: bool
    timestep: float | None = None

    def __str__(self) -> str:
        """The finding as a sentence, with the remedy."""
        return f"{self.subject}: {self.problem}; {self.remedy}"


def check_model(model: mujoco.MjModel) -> tuple[Finding, ...]:
    """Check every muscle and passive elasticity of a model, and its timestep.

    Returns:
        What makes the results of a model in order doubtful. Over random systems
        (``mjhill bench sweep``), none without a finding was off by more than 5 % of its range,
        or 1.5 times what MuJoCo's own step of the joint is off.

    Raises:
        ValueError: An actuator is half a muscle or has no gear, a parameter is outside its
            bounds, a passive elasticity is incomplete or on a joint that cannot have one, or
            the timestep is not positive.

    Warns:
        RuntimeWarning: A finding is severe.
    """
    names = actuator_names(model)
    half = (model.actuator_dynprm[:, 0] == MUSCLE_TAG) & ~_whole(model)
    for actuator in np.flatnonzero(half).tolist():
        _check_marks(model, actuator, names[actuator])
    muscles = muscle_ids(model)
    _check_bounds(model, muscles)
    _check_gears(model, muscles, names)
    _check_elasticities(model)
    timestep = float(model.opt.timestep)
    if not (math.isfinite(timestep) and timestep > 0):
        raise ValueError(f"timestep must be positive, got {timestep} s; set model.opt.timestep")
    findings = (
        *_fast_joints(model),
        *_fast_activation(model, muscles, names),
        *_pushing(model, muscles, names),
        *_clipped(model, muscles, names),
        *_other_gravity(model),
    )
    for finding in findings:
        if finding.severe:
            warnings.warn(str(finding), RuntimeWarning, stacklevel=2)
    return findings


def _whole(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which actuators have all else that makes a tagged one a muscle."""
    return np.asarray(
        # as whole numbers: arrays compare with them a hundred times faster than with enums
        (model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_USER))
        & (model.actuator_gaintype == int(mujoco.mjtGain.mjGAIN_FIXED))
        & (model.actuator_biastype == int(mujoco.mjtBias.mjBIAS_USER))
        & (model.actuator_actnum == STATES)
        & (model.actuator_gainprm[:, 0] == 0)
        & (model.actuator_actlimited == 0)
        & (model.actuator_outnum == 1)
    )


def _check_marks(model: mujoco.MjModel, actuator: int, name: str) -> None:
    """Say what of ``_whole`` a tagged actuator lacks."""
    wanted = [
        ("dyntype", mujoco.mjtDyn(int(model.actuator_dyntype[actuator])), mujoco.mjtDyn.mjDYN_USER),
        (
            "gaintype",
            mujoco.mjtGain(int(model.actuator_gaintype[actuator])),
            mujoco.mjtGain.mjGAIN_FIXED,
        ),
        (
            "biastype",
            mujoco.mjtBias(int(model.actuator_biastype[actuator])),
            mujoco.mjtBias.mjBIAS_USER,
        ),
        ("actdim", int(model.actuator_actnum[actuator]), STATES),
        ("gainprm[0]", float(model.actuator_gainprm[actuator, 0]), 0.0),
        ("actlimited", bool(model.actuator_actlimited[actuator]), False),
        ("number of outputs", int(model.actuator_outnum[actuator]), 1),
    ]
    for what, found, needed in wanted:
        if found != needed:
            raise ValueError(
                f"actuator {name!r} is half a mjhill muscle: it has the tag "
                f"dynprm[0] = {MUSCLE_TAG:.0f} but {what} is {_word(found)}, not "
                f"{_word(needed)}; set it, or add the muscle with mjhill.add_muscle"
            )


def _word(value: object) -> str:
    return str(getattr(value, "name", value)).rpartition("_")[2].lower()


def _check_bounds(model: mujoco.MjModel, muscles: list[int]) -> None:
    columns = parameter_columns(model, muscles)
    good = np.isin(columns["electrical_stimulation"], (0.0, 1.0))
    for name, quantity in quantities(Muscle):
        values = columns[name]
        above = values >= quantity.low if quantity.low_allowed else values > quantity.low
        good &= above & (values <= quantity.high)  # not so for NaN
    if not good.all():
        read_muscles(model)  # says which


def _check_gears(model: mujoco.MjModel, muscles: list[int], names: list[str]) -> None:
    gears = model.actuator_gear[model.actuator_outadr[muscles]]
    bad = ~np.isfinite(gears).all(axis=1) | ~gears.any(axis=1)
    for row in np.flatnonzero(bad).tolist():
        shown = " ".join(f"{value:g}" for value in gears[row])
        raise ValueError(
            f"muscle {names[muscles[row]]!r}: gear must be finite and not 0, got {shown}; "
            "with gear 0 it has no length and moves nothing"
        )


def _check_elasticities(model: mujoco.MjModel) -> None:
    if not model.nuser_jnt:
        return
    tagged = np.flatnonzero(model.jnt_user[:, 0] == PASSIVE_TAG).tolist()
    names = joint_names(model) if tagged else []
    for joint in tagged:
        if model.nuser_jnt < NUSER_JNT:
            raise ValueError(
                f"joint {names[joint]!r}: the user data of mjhill's passive elasticity has "
                f"{NUSER_JNT} numbers, and the model keeps {model.nuser_jnt} for each joint; "
                f"give all {NUSER_JNT}, or use mjhill.add_passive"
            )
        if model.jnt_type[joint] not in SCALAR_JOINTS:
            raise ValueError(
                f"joint {names[joint]!r}: passive elasticity needs a hinge or slide joint"
            )
        read_passive(model, names[joint])


def _fast_joints(model: mujoco.MjModel) -> Iterator[Finding]:
    """Findings on joints that swing too fast for the timestep."""
    timestep = float(model.opt.timestep)
    plant = _Plant.of(model)
    if plant is None:
        return
    modes = [(joint, w) for joint, w in plant.modes() if timestep * w >= COARSE]
    if not modes:
        return
    names = joint_names(model)
    growing = plant.growing(timestep, model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4)
    seen = set()
    for joint, frequency in modes:
        if joint in seen:
            continue
        seen.add(joint)
        severe = joint in growing
        effect = (
            "and at this timestep it swings ever wider, so the result will be meaningless"
            if severe
            else "so the result may be off by 5 %"
        )
        enough = COARSE / frequency
        yield Finding(
            f"joint {names[joint]!r} with its muscles at full force",
            f"natural frequency [rad/s] times timestep is {timestep * frequency:.3g}, past "
            f"{COARSE:g}, {effect}",
            f"set model.opt.timestep to {enough:.2g} s or less",
            severe,
            enough,
        )


def _fast_activation(
    model: mujoco.MjModel, muscles: list[int], names: list[str]
) -> Iterator[Finding]:
    """Findings on time constants that RK4 cannot follow; other integrators are exact there."""
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return
    timestep = float(model.opt.timestep)
    columns = parameter_columns(model, muscles)
    for what in ("excitation_tau", "activation_tau", "deactivation_tau"):
        for row in np.flatnonzero(timestep > 2 * columns[what]).tolist():
            if what == "excitation_tau" and columns["electrical_stimulation"][row]:
                continue
            tau = float(columns[what][row])
            yield Finding(
                f"muscle {names[muscles[row]]!r}",
                f"timestep over {what} is {timestep / tau:.3g}, past 2, so RK4 slows it down and "
                "the result may be off by 5 %",
                f"set model.opt.timestep to {2 * tau:.2g} s or less, or another integrator",
                False,
                2 * tau,
            )


def _pushing(model: mujoco.MjModel, muscles: list[int], names: list[str]) -> Iterator[Finding]:
    """Findings on muscles that push: their tendon's length counts backwards."""
    gears = model.actuator_gear[model.actuator_outadr[muscles], 0]
    on_tendon = model.actuator_trntype[muscles] == int(mujoco.mjtTrn.mjTRN_TENDON)
    for row in np.flatnonzero(on_tendon & (gears < 0)).tolist():
        actuator, gear = muscles[row], float(gears[row])
        first = int(model.tendon_adr[model.actuator_trnid[actuator, 0]])
        # a fixed tendon is a sum of joint angles, whose sign is free
        if model.wrap_type[first] != mujoco.mjtWrap.mjWRAP_JOINT:
            yield Finding(
                f"muscle {names[actuator]!r}",
                f"its gear on the tendon is {gear:g}, so it pushes where a muscle pulls",
                "make the gear positive",
                True,
            )


def _clipped(model: mujoco.MjModel, muscles: list[int], names: list[str]) -> Iterator[Finding]:
    """Findings on forces that MuJoCo cuts off, of which the muscle's states know nothing."""
    outs = model.actuator_outadr[muscles]
    limited = model.actuator_forcelimited[outs].astype(bool)
    forces = parameter_columns(model, muscles)
    largest = forces["max_isometric_force"] * forces["eccentric_plateau"]
    low, high = model.actuator_forcerange[outs].T
    for row in np.flatnonzero(limited & ((low > -largest) | (high < 0))).tolist():
        yield Finding(
            f"muscle {names[muscles[row]]!r}",
            f"its forcerange, {low[row]:g} to {high[row]:g}, cuts off forces that its tendon "
            f"carries (tension is negative, to {-largest[row]:.3g})",
            "take the forcerange away",
            True,
        )


def _other_gravity(model: mujoco.MjModel) -> Iterator[Finding]:
    """Findings on parts made for another gravity, which the model has taken over from elsewhere."""
    for index in range(model.nnumeric):
        numeric = model.numeric(index)
        if numeric.name.endswith(GRAVITY) and (numeric.data != model.opt.gravity).any():
            made, now = (" ".join(f"{v:g}" for v in g) for g in (numeric.data, model.opt.gravity))
            part = numeric.name.removesuffix(GRAVITY) or "the model"
            yield Finding(
                f"{part!r}" if part != "the model" else part,
                f"it was made for gravity {made} m/s² and now has {now}, so its limb falls",
                "set model.opt.gravity, or hold the limb with tonic input",
                False,
            )


def natural_frequencies(model: mujoco.MjModel) -> list[tuple[str, float]]:
    """Natural frequencies [rad/s] of a model at ``qpos0``, fastest first, and the joint of each.

    All muscles pull at full force, and passive elasticities carry ``PASSIVE_LOAD`` times the
    torque of the strongest muscle. What equality constraints hold together moves together.
    """
    plant, names = _Plant.of(model), joint_names(model)
    return [(names[joint], w) for joint, w in plant.modes()] if plant else []


@dataclass(frozen=True)
class _Plant:
    """A model as small movements about ``qpos0`` see it, all muscles at full force.

    Coordinates y are those that equality constraints leave free.

    Attributes:
        joints: Joint id of each degree of freedom.
        free: A movement of the model [dof] for each of y, shape (nv, n).
        mass: Inertia, shape (n, n).
        viscosity: Shape (n, n).
        elasticity: Stiffness of the joints, shape (n, n).
        arms: Change of each muscle's length with y, shape (nmuscle, n).
        slopes: Stiffness of each series element, shape (nmuscle,).
        relaxation: Rate [1/s] at which each contractile element takes up a stretch.
    """

    joints: NDArray[np.int32]
    free: _Values
    mass: _Values
    viscosity: _Values
    elasticity: _Values
    arms: _Values
    slopes: _Values
    relaxation: _Values

    @staticmethod
    def of(model: mujoco.MjModel) -> _Plant | None:
        """The plant of a model; None without muscles."""
        muscles = muscle_ids(model)
        if not muscles:
            return None
        data = mujoco.MjData(model)
        mujoco.mj_fwdPosition(model, data)
        columns = parameter_columns(model, muscles)
        force, hill = columns["max_isometric_force"], columns["hill_shape"]
        growth = np.exp(columns["series_shape"])
        per_force = columns["series_shape"] / columns["series_stretch"] * growth / (growth - 1)
        arms = moments(model, data)[model.actuator_outadr[muscles]]
        mass, free = np.zeros((model.nv, model.nv)), _free(model, data)
        mujoco.mj_fullM(model, data, mass)
        # slope of force-velocity at rest, isometric, see contractile_velocity
        yielding = columns["max_velocity"] * hill / (1 + hill * (1 + columns["viscosity"]))
        elasticity = _elasticity(model, np.abs(arms * force[:, None]).max(axis=0))
        damping = np.asarray(model.dof_damping, dtype=np.float64).reshape(model.nv, -1)[:, 0]
        return _Plant(
            model.dof_jntid.copy(), free, free.T @ mass @ free,
            free.T @ (damping[:, None] * free), free.T @ (elasticity[:, None] * free),
            arms @ free, force * per_force, yielding * per_force,
        )  # fmt: skip

    def modes(self) -> list[tuple[int, float]]:
        """Joint and natural frequency [rad/s] of each mode, fastest first."""
        stiffness = self.elasticity + (self.arms.T * self.slopes) @ self.arms
        inverse = np.linalg.inv(np.linalg.cholesky(self.mass))
        squares, modes = np.linalg.eigh(inverse @ stiffness @ inverse.T)
        frequencies = np.sqrt(np.maximum(squares, 0.0))
        found = zip(self._joints(inverse.T @ modes), frequencies.tolist(), strict=True)
        return sorted(found, key=lambda pair: -pair[1])

    def growing(self, timestep: float, staged: bool) -> set[int]:
        """Joints that a timestep [s] makes swing ever wider about rest."""
        step = self._stages(timestep) if staged else self._step(timestep)
        sizes, modes = np.linalg.eig(step)
        movements = modes[: len(self.mass), np.abs(sizes) > 1 + 1e-9]
        return set(self._joints(np.abs(movements)))

    def _step(self, h: float) -> _Values:
        """What a single step makes of y, its velocity, and the stretches one step old.

        The scheme advances stretches to the present length; MuJoCo takes viscosity implicitly.
        """
        n, m = len(self.mass), len(self.slopes)
        z = np.maximum(self.relaxation * h, 1e-12)
        stretch = np.hstack(
            [np.zeros((m, n)), (-np.expm1(-z) / z * h)[:, None] * self.arms, np.diag(np.exp(-z))]
        )
        force = -(self.arms.T * self.slopes) @ stretch
        force[:, :n] -= self.elasticity
        momentum = np.hstack([np.zeros((n, n)), self.mass, np.zeros((n, m))])
        velocity = np.linalg.solve(self.mass + h * self.viscosity, momentum + h * force)
        position = np.hstack([np.eye(n), np.zeros((n, n + m))]) + h * velocity
        return np.vstack([position, velocity, stretch])

    def _stages(self, h: float) -> _Values:
        """The same under RK4, where the scheme relaxes no faster than 2/h."""
        n, m = len(self.mass), len(self.slopes)
        inverse = np.linalg.inv(self.mass)
        rates = h * np.block(
            [
                [np.zeros((n, n)), np.eye(n), np.zeros((n, m))],
                [
                    -inverse @ self.elasticity,
                    -inverse @ self.viscosity,
                    -inverse @ (self.arms.T * self.slopes),
                ],
                [np.zeros((m, n)), self.arms, -np.diag(np.minimum(self.relaxation, 2.0 / h))],
            ]
        )
        one = np.eye(len(rates))
        return one + rates @ (one + rates @ (one / 2 + rates @ (one / 6 + rates / 24)))

    def _joints(self, modes: _Values) -> list[int]:
        """The joint that moves most in each mode, by kinetic energy."""
        dofs = np.argmax(np.abs((self.free @ modes) * (self.free @ self.mass @ modes)), axis=0)
        return [int(joint) for joint in self.joints[dofs]]


def _elasticity(model: mujoco.MjModel, torque: _Values) -> _Values:
    """Stiffness of each degree of freedom's joint under a load, from the muscles' torques."""
    stiffness = np.zeros(model.nv)
    for joint in _elastic_joints(model):
        dof = model.jnt_dofadr[joint]
        load = PASSIVE_LOAD * torque[dof]
        k1_pos, k2_pos, k1_neg, k2_neg = model.jnt_user[joint, 1:5].tolist()
        stiffness[dof] = float(model.jnt_stiffness[joint].flat[0]) + max(
            k2_pos * (load + k1_pos) if k1_pos else 0.0,
            k2_neg * (load + k1_neg) if k1_neg else 0.0,
        )
    return stiffness


def _elastic_joints(model: mujoco.MjModel) -> list[int]:
    return [joint for joint in range(model.njnt) if has_passive(model, joint)]


def _free(model: mujoco.MjModel, data: mujoco.MjData) -> _Values:
    """Directions in which equality constraints let a model move, as columns."""
    if not data.ne:
        return np.eye(model.nv)
    rows: Any = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(
            rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        )
    else:
        rows = data.efc_J.reshape(data.nefc, model.nv)
    held = rows[data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)]
    _, sizes, directions = np.linalg.svd(held)
    rank = int((sizes > 1e-9 * max(sizes.max(), 1e-300)).sum())
    return np.ascontiguousarray(directions[rank:].T)
