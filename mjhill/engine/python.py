"""The callbacks in plain Python: readable, debuggable, the reference for the compiled ones."""

from __future__ import annotations

import mujoco
import numpy as np

from mjhill.elements import passive_torque, series_force
from mjhill.engine.layout import (
    NUSER_JNT,
    RATE_PARAMETERS,
    SCALAR_JOINTS,
    SLOTS,
    STRETCH_PARAMETERS,
    has_passive,
    is_muscle,
)
from mjhill.muscles.scheme import muscle_rates, present_stretch


def act_dyn(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float | None:
    """Write ``act_dot`` of a muscle; None if the actuator is not one."""
    if not is_muscle(model, actuator):
        return None
    out = model.actuator_outadr[actuator]
    act = model.actuator_actadr[actuator]
    n, a, s = data.act[act : act + 3].tolist()
    data.act_dot[act : act + 3] = muscle_rates(
        _is_staged(model),
        control(model, data, actuator),
        n,
        a,
        s,
        muscle_length(model, data, actuator),
        float(data.actuator_velocity[out]),
        float(model.opt.timestep),
        *(_parameter(model, actuator, name) for name in RATE_PARAMETERS),
    )
    return float(data.act_dot[act + 2])


def act_bias(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float | None:
    """Force of a muscle on its joint or tendon; None if the actuator is not one."""
    if not is_muscle(model, actuator):
        return None
    force, _ = series_force(
        series_stretch(model, data, actuator),
        _parameter(model, actuator, "series_stretch"),
        _parameter(model, actuator, "series_shape"),
        _parameter(model, actuator, "series_limit"),
    )
    # tension is positive in elements; MuJoCo's force is positive when it lengthens the actuator
    return -force * _parameter(model, actuator, "max_isometric_force")


def series_stretch(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    """Stretch of the series element now [rad or m]; needs the rates of ``mj_forward``."""
    s = model.actuator_actadr[actuator] + 2
    return present_stretch(
        _is_staged(model),
        float(data.act[s - 1]),
        float(data.act[s]),
        float(data.act_dot[s]),
        muscle_length(model, data, actuator),
        float(data.actuator_velocity[model.actuator_outadr[actuator]]),
        float(model.opt.timestep),
        *(_parameter(model, actuator, name) for name in STRETCH_PARAMETERS),
    )


def muscle_length(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    """Length of a muscle, less that at ``qpos0`` [rad or m]."""
    out = model.actuator_outadr[actuator]
    return float(data.actuator_length[out] - model.actuator_length0[out])


def _is_staged(model: mujoco.MjModel) -> bool:
    return bool(model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4)


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


def control(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    """The input the engine would use: delayed, clamped to ``ctrlrange``, 0 if it is bad.

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


def _parameter(model: mujoco.MjModel, actuator: int, name: str) -> float:
    array, slot = SLOTS[name]
    return float(getattr(model, f"actuator_{array}")[actuator, slot])
