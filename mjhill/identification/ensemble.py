"""Many joints that differ in their parameters, stepped together on every core."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import mujoco.batch
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.install import installed, without_python_callbacks
from mjhill.layout import NUSER_JNT, parameter_rows, passive_row
from mjhill.parameters import Joint
from mjhill.readings import steady_stretch
from mjhill.spec import joint_spec

_INPUTS = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED)


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
) -> NDArray[np.float64]:
    """Angle [rad] of each joint at every step, the start included, shape (N, steps + 1).

    Through MuJoCo and the compiled callbacks, one simulation a joint.

    Args:
        joints: N joints that differ in numbers only: the same muscles and gears.
        start: Angle at time 0 [rad], shape (N,).
        velocity: Velocity at time 0 [rad/s], shape (N,).
        before: Input at which the muscles are steady at time 0, broadcast to (N, muscles).
        excitation: Input of each muscle over each step, broadcast to (N, steps, muscles).
        torque: External torque over each step [N·m], broadcast to (N, steps).
        steps: Number of steps.
        timestep: Length of a step [s].
    """
    spec = joint_spec(joints[0])
    spec.option.timestep = timestep
    with without_python_callbacks():
        model = spec.compile()
    count, muscles = len(joints), len(joints[0].muscles)
    batch = mujoco.batch.Batch(model, nsim=count)
    _expand(batch, joints)
    batch.qpos[:, 0], batch.qvel[:, 0] = start, velocity
    batch.act[:] = _steady(joints, batch.qpos[:, 0], np.broadcast_to(before, (count, muscles)))
    inputs = np.empty((count, steps, muscles + 1))
    inputs[:, :, :muscles], inputs[:, :, muscles] = excitation, torque
    result = np.empty((count, steps + 1))
    result[:, 0] = start
    with installed():
        result[:, 1:] = batch.rollout(steps, inputs, _INPUTS)["qpos"][:, :, 0]
    return result


def _expand(batch: mujoco.batch.Batch, joints: Sequence[Joint]) -> None:
    """Give each simulation the parameters of its joint; the inertia is the model's."""
    rows = {name: batch.expand(f"actuator_{name}") for name in ("dynprm", "gainprm", "biasprm")}
    user, stiffness = batch.expand("jnt_user"), batch.expand("jnt_stiffness")
    rest, damping = batch.expand("qpos_spring"), batch.expand("dof_damping")
    for i, joint in enumerate(joints):
        for k, muscle in enumerate(joint.muscles.values()):
            for name, row in parameter_rows(muscle).items():
                rows[name][i, k] = row
        user[i, 0, :NUSER_JNT] = passive_row(joint.passive)
        stiffness[i, 0], rest[i, 0] = joint.stiffness, joint.rest_angle
        damping[i, 0] = joint.damping


def _steady(
    joints: Sequence[Joint], start: NDArray[np.float64], inputs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """States n, a, s of every muscle, steady at a start angle and its inputs."""
    act = []
    for joint, angle, levels in zip(joints, start.tolist(), inputs.tolist(), strict=True):
        row: list[float] = []
        for (name, muscle), u in zip(joint.muscles.items(), levels, strict=True):
            length = joint.gears[name] * angle
            row += [u, u, length - steady_stretch(muscle, u, length)]
        act.append(row)
    return np.array(act)
