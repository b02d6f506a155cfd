"""Steady muscle states for a pose and its controls."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from mjhill.elements import (
    active_length_factor,
    hypothetical_force,
    passive_torque,
    series_force,
    series_stretch_at,
)
from mjhill.engine.layout import (
    NUSER_JNT,
    STATES,
    actuator_names,
    has_passive,
    joint_names,
    muscle_ids,
    parameter_columns,
    read_passive,
)
from mjhill.engine.python import control

STRONGEST = 3.0  # tension that no muscle has [F_max]
ROUNDING = 1e-6  # by which n and a may be outside [0, 1]

_HOME = "home"
# the parameters on which the steady state depends, in the order in which it is computed
_FACTOR = ("optimal_length", "width_short", "width_long")
_SERIES = ("series_stretch", "series_shape", "series_limit")


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

    n and a become the control; s becomes the contractile length at which contractile and series
    element carry the same force at rest. The pose stays: the joint need not be in balance.

    Raises:
        ValueError: A control or a position is not finite.
    """
    check_finite(data)
    mujoco.mj_fwdPosition(model, data)
    muscles = muscle_ids(model)
    if not muscles:
        return
    outs = model.actuator_outadr[muscles]
    lengths = (data.actuator_length[outs] - model.actuator_length0[outs]).tolist()
    columns = parameter_columns(model, muscles)
    factors = zip(*(columns[name].tolist() for name in _FACTOR), strict=True)
    floors = columns["activation_floor"].tolist()
    series = zip(*(columns[name].tolist() for name in _SERIES), strict=True)
    states = np.empty((len(muscles), STATES))
    inputs = _controls(model, data, muscles)
    for row, (u, length, factor, floor, element) in enumerate(
        zip(inputs, lengths, factors, floors, series, strict=True)
    ):
        force = hypothetical_force(u, active_length_factor(length, *factor), floor)
        states[row] = u, u, length - series_stretch_at(force, *element)
    data.act[model.actuator_actadr[muscles][:, None] + np.arange(STATES)] = states


def _controls(model: mujoco.MjModel, data: mujoco.MjData, muscles: list[int]) -> list[float]:
    """``control`` of each muscle, all at once where none has a delay."""
    if model.actuator_delay[muscles].any():
        return [control(model, data, actuator) for actuator in muscles]
    addresses = model.actuator_ctrladr[muscles]
    u = data.ctrl[addresses]
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL:
        low, high = model.actuator_ctrlrange[addresses].T
        u = np.where(model.actuator_ctrllimited[addresses], np.clip(u, low, high), u)
    u[np.abs(u) > mujoco.mjMAXVAL] = 0.0
    return [float(value) for value in np.clip(u, 0.0, 1.0)]


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
    """Refuse data that no muscle and no elasticity could be in, or that no step could leave well.

    Raises:
        ValueError: n or a is outside [0, 1]; s is not a number, or would stretch or slacken the
            series element beyond what it can be; a muscle is torn apart so fast that it would
            carry more than ``STRONGEST``; or a joint is so deep in its passive elasticity that
            the timestep cannot follow. The message names the muscle or joint.
    """
    mujoco.mj_fwdPosition(model, data)
    muscles = muscle_ids(model)
    if muscles:
        _check_muscles(model, data, muscles)
    elastic = [joint for joint in range(model.njnt) if has_passive(model, joint)]
    if elastic:
        _check_elasticities(model, data, elastic)


def _check_muscles(model: mujoco.MjModel, data: mujoco.MjData, muscles: list[int]) -> None:
    mujoco.mj_fwdVelocity(model, data)
    outs, first = model.actuator_outadr[muscles], model.actuator_actadr[muscles]
    states = data.act[first[:, None] + np.arange(STATES)]
    columns = parameter_columns(model, muscles)
    stretch = data.actuator_length[outs] - model.actuator_length0[outs] - states[:, 2]
    slackest = 10 * (columns["series_stretch"] + columns["width_short"] + columns["width_long"])
    # tension in fast lengthening [F_max], see contractile_velocity
    slowest = columns["max_velocity"] * (1 - columns["velocity_activation"])
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        torn = columns["eccentric_plateau"] + columns["viscosity"] * (
            np.maximum(data.actuator_velocity[outs], 0.0) / slowest
        )
    inside = ((states[:, :2] >= -ROUNDING) & (states[:, :2] <= 1 + ROUNDING)).all(axis=1)
    good = inside & (stretch >= -slackest) & (torn <= STRONGEST)
    elements = zip(*(columns[name].tolist() for name in _SERIES), strict=True)
    tensions = [
        series_force(x, *element)[0] for x, element in zip(stretch.tolist(), elements, strict=True)
    ]
    for row in np.flatnonzero(~(good & (np.array(tensions) <= STRONGEST))).tolist():
        subject = f"muscle {actuator_names(model)[muscles[row]]!r}"
        n, a, s = states[row].tolist()
        remedy = "call mjhill.equilibrate(model, data)"
        if not inside[row]:
            what, value = ("n", n) if not -ROUNDING <= n <= 1 + ROUNDING else ("a", a)
            raise ValueError(
                f"{subject}: its state {what} must be in [0, 1], got {value:g}; {remedy}"
            )
        if torn[row] > STRONGEST:
            raise ValueError(
                f"{subject}: it is lengthened at {data.actuator_velocity[outs[row]]:.3g} per "
                f"second and would carry {torn[row]:.3g} F_max, above {STRONGEST:g}; start slower"
            )
        raise ValueError(
            f"{subject}: its contractile length s = {s:g} would stretch the series element by "
            f"{stretch[row]:g}, to {tensions[row]:.3g} F_max; allowed are {STRONGEST:g} F_max at "
            f"most, and a stretch of {-slackest[row]:.3g} at least; {remedy}"
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
                f"pushes with {torque:.3g}, and a timestep of {timestep:g} s cannot follow what "
                "comes of that; start nearer to rest, or set a shorter model.opt.timestep"
            )
