"""Many joints that differ in their parameters, stepped together on every core."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import mujoco.batch
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.engine.install import installed, without_python_callbacks
from mjhill.engine.layout import NUSER_JNT, parameter_rows, passive_row
from mjhill.engine.spec import joint_spec
from mjhill.joints.joint import Joint
from mjhill.muscles.readings import steady_stretch

_INPUTS = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED)

_Values = NDArray[np.float64]


def angles(
    joints: Sequence[Joint],
    *,
    start: ArrayLike,
    velocity: ArrayLike = 0.0,
    before: ArrayLike = 0.0,
    excitation: ArrayLike,
    torque: ArrayLike = 0.0,
    steps: int,
    timestep: float = 1e-3,
) -> _Values:
    """Angle [rad] of each joint at every step, the start included, shape (N, steps + 1).

    Through MuJoCo and the compiled callbacks, one simulation a joint.

    Args:
        joints: N joints that differ in numbers only: the same muscles and gears.
        start: Angle at time 0 [rad], broadcast to (N,).
        velocity: Velocity at time 0 [rad/s], broadcast to (N,).
        before: Input at which the muscles are steady at time 0, broadcast to (N, muscles).
        excitation: Input of each muscle over each step, broadcast to (N, steps, muscles).
        torque: External torque over each step [N·m], broadcast to (N, steps).
        steps: Number of steps.
        timestep: Length of a step [s].

    Raises:
        RuntimeError: MuJoCo warned, and so did not simulate to the end.
    """
    muscles = len(joints[0].muscles)
    inputs = np.empty((len(joints), steps, muscles + 1))
    inputs[:, :, :muscles], inputs[:, :, muscles] = excitation, torque
    result = np.empty((len(joints), steps + 1))
    result[:, 0] = start
    with installed():  # from the start: no batch runs under Python callbacks
        batch = _batch(joints, start, velocity, before, timestep)
        result[:, 1:] = batch.rollout(steps, inputs, _INPUTS)["qpos"][:, :, 0]
    check_warnings(batch, joints[0].name)
    return result


def driving_torques(
    joints: Sequence[Joint],
    *,
    path: _Values,
    before: ArrayLike = 0.0,
    excitation: ArrayLike,
    timestep: float = 1e-3,
) -> _Values:
    """External torque [N·m] that takes each joint along a path, shape (N, T).

    The path is prescribed, as by a clamp without compliance; the torque is what balances the
    joint's inertia, passive torque and muscles.

    Args:
        joints: N joints, as in ``angles``.
        path: Angle at every step [rad], shape (T,).
        before: As in ``angles``.
        excitation: Input of each muscle over each step, shape (T, muscles).
        timestep: Length of a step [s].

    Raises:
        RuntimeError: MuJoCo warned, and so did not simulate to the end.
    """
    speed = np.diff(path, prepend=path[0]) / timestep  # the way the muscles have really come
    acceleration = np.gradient(np.gradient(path, timestep), timestep)
    inertial = np.outer([joint.inertia for joint in joints], acceleration)
    result = np.empty((len(joints), len(path)))
    inputs = np.asarray(excitation)
    with installed():
        # one thread: a step alone is shorter than it takes to wake the others
        batch = _batch(joints, path[0], 0.0, before, timestep, threads=1)
        qpos, qvel, ctrl = batch.qpos, batch.qvel, batch.ctrl
        passive, muscles = batch.bind("qfrc_passive"), batch.bind("qfrc_actuator")
        for step in range(len(path)):
            qpos[:, 0], qvel[:, 0], ctrl[:] = path[step], speed[step], inputs[step]
            batch.step()
            result[:, step] = inertial[:, step] - passive[:, 0] - muscles[:, 0]
    check_warnings(batch, joints[0].name)
    return result


def _batch(
    joints: Sequence[Joint],
    start: ArrayLike,
    velocity: ArrayLike,
    before: ArrayLike,
    timestep: float,
    threads: int = 0,
) -> mujoco.batch.Batch:
    """A simulation for each joint, its muscles steady at the start, on all threads by default."""
    spec = joint_spec(joints[0])
    spec.option.timestep = timestep
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # there are none to look for
    with without_python_callbacks():
        model = spec.compile()
    batch = mujoco.batch.Batch(model, nsim=len(joints), nthread=threads)
    _expand(batch, joints)
    batch.qpos[:, 0], batch.qvel[:, 0] = start, velocity
    levels = np.broadcast_to(before, (len(joints), len(joints[0].muscles)))
    batch.act[:] = _steady(joints, batch.qpos[:, 0], levels)
    return batch


def _expand(batch: mujoco.batch.Batch, joints: Sequence[Joint]) -> None:
    """Give each simulation the parameters of its joint."""
    rows = {name: batch.expand(f"actuator_{name}") for name in ("dynprm", "gainprm", "biasprm")}
    user, stiffness = batch.expand("jnt_user"), batch.expand("jnt_stiffness")
    rest, damping = batch.expand("qpos_spring"), batch.expand("dof_damping")
    inertia = batch.expand("body_inertia")
    for i, joint in enumerate(joints):
        for k, muscle in enumerate(joint.muscles.values()):
            for name, row in parameter_rows(muscle).items():
                rows[name][i, k] = row
        user[i, 0, :NUSER_JNT] = passive_row(joint.passive)
        stiffness[i, 0], rest[i, 0] = joint.stiffness, joint.rest_angle
        damping[i, 0], inertia[i, 1] = joint.damping, joint.inertia
    batch.set_const()  # the mass matrix, which follows from the inertia


def check_warnings(batch: mujoco.batch.Batch, joint: str) -> None:
    """Refuse simulations in which MuJoCo warned: they stop, or go on from a state put back.

    Raises:
        RuntimeError: One did; the message has the warning's name and the joint.
    """
    warned = batch.warning[:, :, 1] > 0  # counts by simulation and kind
    if warned.any():
        kind = mujoco.mjtWarning(int(np.argmax(warned.any(axis=0)))).name
        raise RuntimeError(
            f"{joint}: MuJoCo warned '{kind.removeprefix('mjWARN_').lower()}' in "
            f"{warned.any(axis=1).sum()} of {len(warned)} simulations; look for a bad input"
        )


def _steady(joints: Sequence[Joint], start: _Values, inputs: _Values) -> _Values:
    """States n, a, s of every muscle, steady at a start angle and its inputs."""
    act = []
    for joint, angle, levels in zip(joints, start.tolist(), inputs.tolist(), strict=True):
        row: list[float] = []
        for (name, muscle), u in zip(joint.muscles.items(), levels, strict=True):
            length = joint.gears[name] * angle
            row += [u, u, length - steady_stretch(muscle, u, length)]
        act.append(row)
    return np.array(act)
