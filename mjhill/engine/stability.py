"""How long a timestep may be: a model as small movements see it, its muscles at full force."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.engine.layout import (
    NUSER_JNT,
    SCALAR_JOINTS,
    has_passive,
    ids_of,
    in_order,
    moments,
    muscle_groups,
)

PASSIVE_LOAD = 2.0  # passive torque that a movement may meet, in units of the strongest muscle's
# largest (frequency x timestep)² and rate x timestep of RK4, for any damping
_STAGED_SPRING, _STAGED_RATE = 7.3, 2.7

LITTLE = 0.3  # twice the damping ratio below which a movement swings on
_LARGE = 64  # degrees of freedom from which a model is taken in parts

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Mode:
    """A movement that a timestep may be too long for.

    Attributes:
        load: Its stiffness, in units of the largest that the timestep can hold.
        joint: Id of the joint that moves most.
        muscles: Ids of up to three muscles that give most of its stiffness, the stiffest first.
    """

    load: float
    joint: int
    muscles: tuple[int, ...]


@dataclass(frozen=True)
class Swing:
    """A movement with little damping: muscles and joints take little of its energy.

    Attributes:
        period: [s].
        joint: Id of the joint that moves most.
    """

    period: float
    joint: int


@dataclass(frozen=True)
class Plant:
    """A model as small movements about ``qpos0`` see it, all muscles at full force.

    Coordinates y are those that equality constraints leave free, n of them.

    Attributes:
        staged: Whether the integrator is RK4.
        joints: Joint id of each degree of freedom, shape (nv,).
        muscles: Actuator id of each muscle.
        free: A movement of the model [dof] for each of y, shape (nv, n).
        mass: Inertia, shape (n, n).
        viscosity: Shape (n, n).
        elasticity: Stiffness of the joints, shape (n, n).
        arms: Change of each muscle's length with y, shape (nmuscle, n).
        slopes: Stiffness of each series element, shape (nmuscle,).
        relaxation: Rate [1/s] at which each contractile element takes up a stretch.
        drags: Force over velocity of each muscle that has it without a series element,
            shape (nmuscle,).
        braking: Under RK4, the fastest rate [1/s] at which damping stops a movement, those that
            constraints hold back included, and its joint: RK4 sees the damping there too.
    """

    staged: bool
    joints: NDArray[np.int32]
    muscles: tuple[int, ...]
    free: _Values
    mass: _Values
    viscosity: _Values
    elasticity: _Values
    arms: _Values
    slopes: _Values
    relaxation: _Values
    drags: _Values
    braking: tuple[float, int] = (0.0, 0)

    @staticmethod
    def parts(model: mujoco.MjModel) -> list[Plant]:
        """The plant of a model: in a large one, a part for all that moves together.

        There is none where no muscle can move anything.
        """
        plant = Plant._of(model)
        if plant is None or len(plant.mass) <= _LARGE or plant.free.shape[0] != len(plant.mass):
            return [plant] if plant else []
        groups = _connected(model.dof_treeid, plant.arms)
        return [plant._part(np.flatnonzero(groups == group)) for group in np.unique(groups)]

    def _part(self, dofs: NDArray[np.int_]) -> Plant:
        """The part that some degrees of freedom are, none of them constrained."""
        acting = np.flatnonzero(self.arms[:, dofs].any(axis=1))
        square = np.ix_(dofs, dofs)
        return Plant(
            self.staged, self.joints[dofs], tuple(self.muscles[k] for k in acting),
            np.eye(len(dofs)), self.mass[square], self.viscosity[square],
            self.elasticity[square], self.arms[np.ix_(acting, dofs)], self.slopes[acting],
            self.relaxation[acting], self.drags[acting],
        )  # fmt: skip

    @staticmethod
    def _of(model: mujoco.MjModel) -> Plant | None:
        groups = muscle_groups(model)
        if not groups or not model.nv:
            return None
        muscles = ids_of(groups)
        data = mujoco.MjData(model)
        mujoco.mj_fwdPosition(model, data)
        free = _free(model, data)
        if not free.shape[1]:
            return None
        (force,) = in_order(groups, "max_isometric_force")
        slopes, relaxation, drags = in_order(groups, "at_full_force")
        arms = moments(model, data)[model.actuator_outadr[muscles]]
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        elasticity = _elasticity(model, np.abs(arms * force[:, None]).max(axis=0))
        damping = np.asarray(model.dof_damping, dtype=np.float64).reshape(model.nv, -1)[:, 0]
        viscosity, elastic = np.diag(damping), np.diag(elasticity)
        staged, braking = model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_RK4), (0.0, 0)
        if data.ne:
            braking = _braking(mass, damping, model.dof_jntid) if staged else braking
            mass, viscosity, elastic = (free.T @ m @ free for m in (mass, viscosity, elastic))
            arms = arms @ free
        return Plant(
            staged, model.dof_jntid.copy(), tuple(muscles), free, mass, viscosity, elastic, arms,
            slopes, relaxation, drags, braking,
        )  # fmt: skip

    def overloads(self, timestep: float, limit: float) -> list[Mode]:
        """Movements whose load is ``limit`` or more at a timestep [s], the heaviest first."""
        stiffness, held = self._pencil(timestep)
        brake = Mode(timestep * self.braking[0] / _STAGED_RATE, self.braking[1], ())
        braked = [brake] if brake.load >= limit else []
        if _is_positive(limit * held - stiffness):
            return braked
        loads, modes = self._modes(timestep)
        return braked + [
            Mode(float(loads[k]), self._joint(modes[:, k]), self._stiffest(modes[:, k], timestep))
            for k in np.argsort(-loads)
            if loads[k] >= limit
        ]

    def load(self, timestep: float) -> float:
        """The load of the heaviest movement."""
        loads, _ = self._modes(timestep)
        return max(float(loads.max()), timestep * self.braking[0] / _STAGED_RATE)

    def swings(self, fastest: float) -> list[Swing]:
        """Movements with little damping, of a natural frequency [rad/s] of ``fastest`` or more."""
        springs = (self.arms.T * self.slopes) @ self.arms + self.elasticity
        if _is_positive(fastest**2 * self.mass - springs):
            return []
        inverse = np.linalg.inv(np.linalg.cholesky(self.mass))
        squares, modes = np.linalg.eigh(inverse @ springs @ inverse.T)
        modes = inverse.T @ modes
        found = []
        for k in np.flatnonzero(squares >= fastest**2)[::-1]:
            mode, frequency = modes[:, k], float(np.sqrt(squares[k]))
            # shares of a muscle's stiffness that act as a spring's, and the share lost to yielding
            shares = self.slopes * (self.arms @ mode) ** 2 / squares[k]
            lost = shares @ (frequency * self.relaxation / (squares[k] + self.relaxation**2))
            lost += (self.viscosity + self._drag) @ mode @ mode / frequency
            if lost < LITTLE:
                found.append(Swing(2 * np.pi / frequency, self._joint(mode)))
        return found

    def longest(self, timestep: float, limit: float) -> float:
        """A timestep [s], shorter than the given one, at which no load reaches ``limit``."""
        load = self.load(timestep)
        while load >= limit:
            # load rises with the timestep, or with its square where muscles do not yield
            timestep *= max(0.99 * limit / load, 0.5)
            load = self.load(timestep)
        return timestep

    def _pencil(self, h: float) -> tuple[_Values, _Values]:
        """Stiffness that a step of h [s] sees, and the largest that it can hold, shapes (n, n).

        In single-step integrators an oscillation that grows first is one that turns at every
        step. The stretch of a muscle that turns with it is (1 - exp(-z))/z/(1 + exp(-z)) of the
        way the joint moves in a step, z = h relaxation; MuJoCo takes viscosity implicitly, but not
        that of muscles. Where muscles do not yield, the limit is (frequency x timestep)² = 4.
        """
        if self.staged:
            springs = (self.arms.T * self.slopes) @ self.arms + self.elasticity
            damping = self.viscosity + self._drag
            return h * h / _STAGED_SPRING * springs + h / _STAGED_RATE * damping, self.mass
        springs = (self.arms.T * (self.slopes * self._turning(h))) @ self.arms
        stiffness = h * h * (springs + self.elasticity / 2) + h * self._drag
        return stiffness, 2 * self.mass + h * self.viscosity

    def _turning(self, h: float) -> _Values:
        z = np.maximum(self.relaxation * h, 1e-12)
        return np.asarray(-np.expm1(-z) / z / (1 + np.exp(-z)))

    def _modes(self, h: float) -> tuple[_Values, _Values]:
        """Loads, ascending, and their movements y as columns."""
        stiffness, held = self._pencil(h)
        inverse = np.linalg.inv(np.linalg.cholesky(held))
        loads, modes = np.linalg.eigh(inverse @ stiffness @ inverse.T)
        return loads, inverse.T @ modes

    def _joint(self, mode: _Values) -> int:
        """The joint that has most of a movement's kinetic energy."""
        return int(self.joints[np.argmax(self._energies @ mode * (self.free @ mode))])

    @cached_property
    def _drag(self) -> _Values:
        """Viscosity that comes from muscles, shape (n, n)."""
        return (self.arms.T * self.drags) @ self.arms

    @cached_property
    def _energies(self) -> _Values:
        return self.free @ self.mass

    def _stiffest(self, mode: _Values, h: float) -> tuple[int, ...]:
        """Up to three muscles that give most of a movement's stiffness, the stiffest first."""
        weights = np.ones(len(self.slopes)) if self.staged else self._turning(h)
        shares = (self.slopes * weights + self.drags / h) * (self.arms @ mode) ** 2
        order = np.argsort(-shares)[:3]
        return tuple(self.muscles[k] for k in order if shares[k] >= 0.3 * shares.max())


def _braking(mass: _Values, damping: _Values, joints: NDArray[np.int32]) -> tuple[float, int]:
    """The fastest rate [1/s] at which damping stops a movement, and the joint that moves most."""
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    rates, modes = np.linalg.eigh(inverse @ (damping[:, None] * inverse.T))
    moved = (inverse.T @ modes[:, -1]) ** 2 * damping
    return float(rates[-1]), int(joints[np.argmax(moved)])


def _connected(trees: NDArray[np.int32], arms: _Values) -> NDArray[np.int32]:
    """A number for each degree of freedom, equal where muscles connect their trees."""
    group = np.arange(trees.max() + 1, dtype=np.int32)
    touched = arms != 0
    first = np.where(touched, trees, trees.max()).min(axis=1)
    last = np.where(touched, trees, 0).max(axis=1)
    for row in np.flatnonzero(first < last):
        joined = np.unique(group[trees[touched[row]]])
        group[np.isin(group, joined)] = joined[0]
    return group[trees]


def _is_positive(matrix: _Values) -> bool:
    """Whether a symmetric matrix is positive definite."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


def _elasticity(model: mujoco.MjModel, torque: _Values) -> _Values:
    """Stiffness of each degree of freedom under a load, from the muscles' torques, shape (nv,)."""
    stiffness = np.zeros(model.nv)
    scalar = np.flatnonzero(np.logical_or(*(model.jnt_type == kind for kind in SCALAR_JOINTS)))
    dofs = model.jnt_dofadr[scalar]
    stiffness[dofs] = np.asarray(model.jnt_stiffness).reshape(model.njnt, -1)[scalar, 0]
    if model.nuser_jnt < NUSER_JNT:
        return stiffness
    for joint, dof in zip(scalar.tolist(), dofs.tolist(), strict=True):
        if has_passive(model, joint):
            load = PASSIVE_LOAD * torque[dof]
            k1_pos, k2_pos, k1_neg, k2_neg = model.jnt_user[joint, 1:5].tolist()
            stiffness[dof] += max(
                k2_pos * (load + k1_pos) if k1_pos else 0.0,
                k2_neg * (load + k1_neg) if k1_neg else 0.0,
            )
    return stiffness


def _free(model: mujoco.MjModel, data: mujoco.MjData) -> _Values:
    """Directions in which equality constraints let a model move, as columns, shape (nv, n)."""
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
