"""What a run leaves of MuJoCo's arrays at each sample, before any of it has a name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.engine.layout import SCALAR_JOINTS, muscle_ids
from mjhill.engine.python import excitation

_Values = NDArray[np.float64]
_COPIED = (  # arrays of data that are kept as they are
    "qpos",
    "qvel",
    "ctrl",
    "act",
    "act_dot",
    "actuator_length",
    "actuator_velocity",
    "actuator_force",
    "qfrc_applied",
    "qfrc_damper",
    "qfrc_constraint",
    "qfrc_actuator",
    "qfrc_gravcomp",
    "qfrc_fluid",
    "qfrc_adhesion",
)


@dataclass(frozen=True)
class Samples:
    """Copies of MuJoCo's arrays at T samples.

    Attributes:
        time: Times [s], shape (T,).
        arrays: Arrays of ``MjData`` by name, shape (T, size).
        pushed: Generalised force of ``xfrc_applied``, shape (T, nv).
        kinetic: Kinetic energy [J], shape (T,).
        gravity: Energy in the field of gravity, less what ``gravcomp`` holds [J], shape (T,).
        springs: Energy in all springs that are MuJoCo's own [J], shape (T,); 0 where there are
            none but those of hinges and slides.
        arms: Slope of an output's length over a degree of freedom, by the two, shape (T,).
        delayed: Input of each muscle that has a delay, by actuator id, shape (T,).
    """

    time: _Values
    arrays: Mapping[str, _Values]
    pushed: _Values
    kinetic: _Values
    gravity: _Values
    springs: _Values
    arms: Mapping[tuple[int, int], _Values]
    delayed: Mapping[int, _Values]

    def column(self, array: str, index: int) -> _Values:
        """One element of an array over time, shape (T,)."""
        return np.ascontiguousarray(self.arrays[array][:, index])


class Sampler:
    """Fills ``Samples`` row by row during a run.

    MuJoCo's single-step integrators make the new velocity before they move the joint with it,
    q[k+1] = q[k] + h v[k+1]. So ``qvel`` is the mean velocity of the step before, and the velocity
    at sample k is (v[k] + v[k+1])/2. Kinetic energy is that of this velocity, under RK4 that of
    ``qvel`` itself.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, count: int) -> None:
        """Make room for ``count`` samples of a model's data."""
        self._model, self._data = model, data
        self._staged = model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
        self._views = {name: getattr(data, name) for name in _COPIED}
        self._arrays = {name: np.empty((count, view.size)) for name, view in self._views.items()}
        self._time, self._kinetic, self._gravity = (np.empty(count) for _ in range(3))
        self._stored, self._pushed = np.zeros(count), np.zeros((count, model.nv))
        self._moments = np.empty((count, data.actuator_moment.size))
        self._layouts: list[tuple[int, list[NDArray[np.int32]]]] = []
        off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        gravity = np.zeros(3) if off else model.opt.gravity
        self._weights = -np.outer(model.body_mass * (1 - model.body_gravcomp), gravity).ravel()
        self._all_weights = -np.outer(model.body_mass, gravity).ravel()
        self._springs = has_other_springs(model)
        late = [i for i in muscle_ids(model) if model.actuator_delay[i] != 0]
        self._delayed = {actuator: np.empty(count) for actuator in late}

    def take(self, row: int) -> None:
        """Keep the present state; needs ``mj_forward``."""
        data = self._data
        self._time[row] = data.time
        for name, view in self._views.items():
            self._arrays[name][row] = view
        self._moments[row] = data.actuator_moment
        layout = [data.moment_rownnz, data.moment_rowadr, data.moment_colind]
        known = self._layouts[-1][1] if self._layouts else None
        if known is None or any(map(_differ, known, layout)):
            self._layouts.append((row, [part.copy() for part in layout]))
        self._gravity[row] = self._weights @ data.xipos.ravel()
        if self._springs:
            mujoco.mj_energyPos(self._model, data)
            self._stored[row] = data.energy[0] - self._all_weights @ data.xipos.ravel()
        if data.xfrc_applied.any():
            self._pushed[row] = _generalised(self._model, data)
        for actuator, values in self._delayed.items():
            values[row] = excitation(self._model, data, actuator)
        if self._staged:
            self._moved(row, data.qvel)

    def went_on(self, row: int) -> None:
        """Keep what the step after a sample shows of it."""
        if not self._staged:
            self._moved(row, 0.5 * (self._arrays["qvel"][row] + self._data.qvel))

    def ended(self, row: int) -> None:
        """Keep what the last sample shows without a step after it."""
        if not self._staged:
            data = self._data
            self._moved(row, data.qvel + 0.5 * self._model.opt.timestep * data.qacc)

    def _moved(self, row: int, velocity: _Values) -> None:
        momentum = np.zeros(self._model.nv)
        mujoco.mj_mulM(self._model, self._data, momentum, velocity)
        self._kinetic[row] = 0.5 * momentum @ velocity

    def samples(self) -> Samples:
        """What was kept."""
        return Samples(
            self._time, self._arrays, self._pushed, self._kinetic, self._gravity, self._stored,
            self._arms(), self._delayed,
        )  # fmt: skip

    def _arms(self) -> dict[tuple[int, int], _Values]:
        """Columns of the sparse moments, where they are not 0 throughout."""
        arms: dict[tuple[int, int], _Values] = {}
        ends = [first for first, _ in self._layouts[1:]] + [len(self._time)]
        for (first, (counts, starts, dofs)), end in zip(self._layouts, ends, strict=True):
            for out, (count, start) in enumerate(zip(counts, starts, strict=True)):
                for at in range(int(start), int(start) + int(count)):
                    column = self._moments[first:end, at]
                    if column.any():
                        key = out, int(dofs[at])
                        arms.setdefault(key, np.zeros(len(self._time)))[first:end] = column
        return arms


def has_other_springs(model: mujoco.MjModel) -> bool:
    """Whether a model has springs other than those of hinges and slides."""
    stiff = (model.jnt_stiffness != 0) | model.jnt_stiffnesspoly.any(axis=1)
    joints = stiff & ~np.isin(model.jnt_type, SCALAR_JOINTS)
    tendons = model.tendon_stiffness.any() or model.tendon_stiffnesspoly.any()
    return bool(joints.any() or tendons or model.nflex)


def _differ(one: NDArray[np.int32], other: NDArray[np.int32]) -> bool:
    return one.tobytes() != other.tobytes()


def _generalised(model: mujoco.MjModel, data: mujoco.MjData) -> _Values:
    """The forces on bodies as forces on the degrees of freedom, shape (nv,)."""
    total = np.zeros(model.nv)
    for body in np.flatnonzero(data.xfrc_applied.any(axis=1)).tolist():
        push = data.xfrc_applied[body]
        mujoco.mj_applyFT(model, data, push[:3], push[3:], data.xipos[body], body, total)
    return total
