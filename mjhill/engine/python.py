"""The callbacks in plain Python: readable, debuggable, the reference for the compiled ones."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mjhill.elements import passive_torque
from mjhill.engine.layout import (
    NUSER_JNT,
    SCALAR_JOINTS,
    has_passive,
    model_of_actuator,
)
from mjhill.muscles.model import Equation, MuscleModel, arguments


def act_dyn(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float | None:
    """Write ``act_dot`` of a muscle; None if the actuator is not one."""
    muscle = model_of_actuator(model, actuator)
    if muscle is None:
        return None
    rates = _value(muscle, muscle.rates, model, data, actuator)
    first, count = model.actuator_actadr[actuator], model.actuator_actnum[actuator]
    if rates is not None:  # else it has written into state_rates
        data.act_dot[first : first + count] = rates
    return float(data.act_dot[first + count - 1])


def act_bias(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float | None:
    """Force of a muscle on its joint or tendon; None if the actuator is not one."""
    muscle = model_of_actuator(model, actuator)
    if muscle is None:
        return None
    # tension is positive in equations; MuJoCo's force is positive when it lengthens the actuator
    return -float(_value(muscle, muscle.force, model, data, actuator))


def _value(
    muscle: MuscleModel,
    equation: Equation,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    actuator: int,
) -> Any:
    """An equation of a muscle, given what it asks for by name."""
    out = model.actuator_outadr[actuator]
    first, count = model.actuator_actadr[actuator], model.actuator_actnum[actuator]
    states, rates = data.act[first : first + count], data.act_dot[first : first + count]
    values = []
    for name in arguments(equation):
        if name in muscle.slots:
            array, slot = muscle.slots[name]
            values.append(float(getattr(model, f"actuator_{array}")[actuator, slot]))
        elif name in muscle.state_names:
            values.append(float(states[muscle.state_names.index(name)]))
        elif name.removesuffix("_rate") in muscle.state_names:
            values.append(float(rates[muscle.state_names.index(name.removesuffix("_rate"))]))
        elif name == "states":
            values.append(states)
        elif name == "state_rates":
            values.append(rates)
        elif name == "staged":
            values.append(bool(model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4))
        elif name == "u":
            values.append(excitation(model, data, actuator))
        elif name == "length":
            values.append(float(data.actuator_length[out] - model.actuator_length0[out]))
        elif name == "length_rate":
            values.append(float(data.actuator_velocity[out]))
        else:
            values.append(float(model.opt.timestep))
    return equation(*values)


def passive(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Add the exponential passive elasticity of the joints to ``qfrc_passive``."""
    if model.nuser_jnt < NUSER_JNT:
        return
    for joint in range(model.njnt):
        if not has_passive(model, joint) or model.jnt_type[joint] not in SCALAR_JOINTS:
            continue
        dof = model.jnt_dofadr[joint]
        if not data.tree_awake[model.dof_treeid[dof]]:
            continue  # MuJoCo does not clear qfrc_passive of a sleeping tree
        position = model.jnt_qposadr[joint]
        deviation = float(data.qpos[position] - model.qpos_spring[position])
        parameters = model.jnt_user[joint, 1:NUSER_JNT].tolist()
        data.qfrc_passive[dof] += passive_torque(deviation, 0.0, *parameters)


def excitation(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    """The control that the engine would use: delayed, clamped to ``ctrlrange``, 0 if it is bad.

    Clamped to [0, 1] last, as the native muscle does.
    """
    ctrl = model.actuator_ctrladr[actuator]
    u = float(data.ctrl[ctrl])
    if model.actuator_delay[actuator] != 0:
        result = np.zeros(1)
        interpolation = int(model.actuator_history[actuator, 1])
        read = mujoco.mj_readCtrl(model, data, actuator, data.time, result, interpolation)
        u = float(result[0] if read is None else read[0])
    clamped = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
    if clamped and model.actuator_ctrllimited[ctrl]:
        low, high = model.actuator_ctrlrange[ctrl].tolist()
        u = min(max(u, low), high)
    if not abs(u) <= mujoco.mjMAXVAL:
        return 0.0
    return min(max(u, 0.0), 1.0)


def excitations(model: mujoco.MjModel, ctrl: np.ndarray, actuators: list[int]) -> np.ndarray:
    """``excitation`` of actuators without a delay, all at once.

    Args:
        model: The model.
        ctrl: Controls, shape (..., nu).
        actuators: n actuator ids.

    Returns:
        Excitations [-], shape (..., n).
    """
    addresses = model.actuator_ctrladr[actuators]
    u = ctrl[..., addresses]
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL:
        low, high = model.actuator_ctrlrange[addresses].T
        u = np.where(model.actuator_ctrllimited[addresses], np.clip(u, low, high), u)
    return np.clip(np.where(np.abs(u) <= mujoco.mjMAXVAL, u, 0.0), 0.0, 1.0)
