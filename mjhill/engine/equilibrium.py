"""Steady muscle states for a pose and its controls."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from mjhill.elements import passive_torque
from mjhill.engine.layout import (
    NUSER_JNT,
    Group,
    actuator_names,
    has_passive,
    ids_of,
    in_order,
    joint_names,
    muscle_groups,
    read_passive,
)
from mjhill.engine.python import excitation, excitations
from mjhill.muscles.model import STRONGEST

ROUNDING = 1e-6  # by which n and a may be outside [0, 1]

_HOME = "home"


def at_home(model: mujoco.MjModel) -> mujoco.MjData:
    """Data at the model's key ``home``, or at ``qpos0`` without one, with steady muscles.

    A model put together from several has a key for each, such as ``left_home``; then each part
    is at its own. The controls are those of the keys, or 0.
    """
    data = mujoco.MjData(model)
    keys = {model.key(i).name: i for i in range(model.nkey)}
    if _HOME in keys:
        mujoco.mj_resetDataKeyframe(model, data, keys[_HOME])
    else:
        for name, key in keys.items():
            if name.endswith(_HOME):  # attached: prefix and name
                moved = model.key_qpos[key] != model.qpos0
                data.qpos[moved] = model.key_qpos[key][moved]
                data.ctrl[:] += model.key_ctrl[key]
    equilibrate(model, data)
    return data


def equilibrate(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Set every muscle's states to their steady values for the present pose and controls.

    For ``mjhill.Hill``, n and a become the excitation; s becomes the contractile length at which
    contractile and series element carry the same force at rest. The pose stays: the joint need
    not be in balance.

    Raises:
        ValueError: A control or a position is not finite.
    """
    check_finite(data)
    mujoco.mj_fwdPosition(model, data)
    for group in muscle_groups(model):
        steady = group.model.steady
        u = _excitations(model, data, group.actuators.tolist())
        rows = group.rows(steady, u=u, length=_lengths(model, data, group))
        for first, row in zip(model.actuator_actadr[group.actuators].tolist(), rows, strict=True):
            states = steady(*row)
            data.act[first : first + len(states)] = states


def _lengths(model: mujoco.MjModel, data: mujoco.MjData, group: Group) -> list[float]:
    outs = model.actuator_outadr[group.actuators]
    lengths: list[float] = (data.actuator_length[outs] - model.actuator_length0[outs]).tolist()
    return lengths


def _excitations(model: mujoco.MjModel, data: mujoco.MjData, actuators: list[int]) -> list[float]:
    """``excitation`` of each muscle, all at once where none has a delay."""
    if model.actuator_delay[actuators].any():
        return [excitation(model, data, actuator) for actuator in actuators]
    return [float(u) for u in excitations(model, data.ctrl, actuators)]


def check_finite(data: mujoco.MjData) -> None:
    """Refuse data whose controls or positions are not numbers.

    Raises:
        ValueError: One is not finite; the message has its index.
    """
    for what in ("ctrl", "qpos", "qvel"):
        for index, value in enumerate(getattr(data, what).tolist()):
            if not math.isfinite(value):
                raise ValueError(f"data.{what}[{index}] must be finite, got {value}")


def check_states(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Refuse data with an impossible state, or one that the timestep cannot follow.

    Raises:
        ValueError: A state is outside its bounds, as n and a outside [0, 1]; a state is not a
            number, or one that its muscle model calls impossible, such as an s that would stretch
            or slacken the series element beyond what it can be; a muscle is torn apart so fast
            that it would carry more than ``STRONGEST``; or a joint is so deep in its passive
            elasticity that the timestep cannot follow. The message names the muscle or joint.
    """
    mujoco.mj_fwdPosition(model, data)
    if muscle_groups(model):
        mujoco.mj_fwdVelocity(model, data)
        _check_torn(model, data)
        _check_muscles(model, data)
    elastic = [joint for joint in range(model.njnt) if has_passive(model, joint)]
    if elastic:
        _check_elasticities(model, data, elastic)


def _check_muscles(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    for group in muscle_groups(model):
        kind, first = group.model, model.actuator_actadr[group.actuators]
        named = {name: data.act[first + k] for k, name in enumerate(kind.state_names)}
        for state in kind.states:
            if state.share:
                _check_share(model, group, state.name, named[state.name])
        counts = model.actuator_actnum[group.actuators]
        states = [data.act[at : at + n] for at, n in zip(first, counts, strict=True)]
        rows = group.rows(
            kind.fault,
            **{name: values.tolist() for name, values in named.items()},
            states=states,
            length=_lengths(model, data, group),
        )
        for k, row in enumerate(rows):
            _refuse(model, group, k, kind.fault(*row))
        finite = [bool(np.isfinite(values).all()) for values in states]
        if not all(finite):
            _refuse(model, group, finite.index(False), "a state of it is not finite")


def _check_share(model: mujoco.MjModel, group: Group, name: str, values: np.ndarray) -> None:
    inside = (values >= -ROUNDING) & (values <= 1 + ROUNDING)  # not so for NaN
    for k in np.flatnonzero(~inside).tolist():
        _refuse(model, group, k, f"its state {name} must be in [0, 1], got {values[k]:g}")


def _refuse(model: mujoco.MjModel, group: Group, k: int, wrong: str | None) -> None:
    if wrong is not None:
        name = actuator_names(model)[int(group.actuators[k])]
        raise ValueError(f"muscle {name!r}: {wrong}; call mjhill.equilibrate(model, data)")


def _check_torn(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Refuse muscles that are lengthened so fast that they would tear."""
    groups = muscle_groups(model)
    ids = ids_of(groups)
    held, more = in_order(groups, "lengthening")
    (force,) = in_order(groups, "max_isometric_force")
    rate = data.actuator_velocity[model.actuator_outadr[ids]]
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        torn = (held + more * np.maximum(rate, 0.0)) / force
    for row in np.flatnonzero(~(torn <= STRONGEST * (1 + ROUNDING))).tolist():
        raise ValueError(
            f"muscle {actuator_names(model)[ids[row]]!r}: it is lengthened at {rate[row]:.3g} per "
            f"second and would carry {torn[row]:.3g} F_max, above {STRONGEST:g}; start slower"
        )


def _check_elasticities(model: mujoco.MjModel, data: mujoco.MjData, elastic: list[int]) -> None:
    """Refuse a start so deep in an exponential that a step moves it by half an e-fold."""
    timestep, names = float(model.opt.timestep), joint_names(model)
    for joint in elastic:
        dof = model.jnt_dofadr[joint]
        passive = read_passive(model, names[joint])
        deviation = float(
            data.qpos[model.jnt_qposadr[joint]] - model.qpos_spring[model.jnt_qposadr[joint]]
        )
        k1, k2 = (
            (passive.k1_pos, passive.k2_pos) if deviation >= 0 else (passive.k1_neg, passive.k2_neg)
        )
        torque = abs(passive_torque(deviation, 0.0, *model.jnt_user[joint, 1:NUSER_JNT].tolist()))
        unit = np.zeros((1, model.nv))
        unit[0, dof] = 1.0
        mobility = np.zeros((1, model.nv))
        mujoco.mj_solveM(model, data, mobility, unit)
        # the slope of an exponential is its value times its rate, and its energy value over rate
        slope, energy = k2 * (torque + k1), torque / k2
        speed = math.hypot(data.qvel[dof], math.sqrt(2 * energy * mobility[0, dof]))
        stiffness = timestep * math.sqrt(slope * mobility[0, dof])
        rates = [
            rate
            for scale, rate in (
                (passive.k1_pos, passive.k2_pos),
                (passive.k1_neg, passive.k2_neg),
            )
            if scale > 0
        ]
        reach = timestep * speed * max(rates, default=0.0)
        if max(stiffness, reach) > 0.5:
            raise ValueError(
                f"joint {names[joint]!r}: at {deviation:.3g} from rest its passive elasticity "
                f"pushes with {torque:.3g}, and a timestep of {timestep:g} s is too long "
                "for that; start nearer to rest, or set a shorter model.opt.timestep"
            )
