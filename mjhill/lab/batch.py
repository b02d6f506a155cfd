"""A batch of rigs: many joints with different parameters, simulated together on all cores."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import mujoco
import mujoco.batch
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjhill.engine.install import installed, without_python_callbacks
from mjhill.engine.layout import NUSER_JNT, parameter_rows, passive_row
from mjhill.engine.spec import joint_spec
from mjhill.joints.joint import Joint
from mjhill.lab.rig import UnmeasuredError
from mjhill.muscles import steady_states

CONTROL_AND_TORQUE = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED)
"""What a rollout reads for each step: the excitation of every muscle, then the joint's torque."""

_CLAMP = 1e15  # [kg·m²]; torques of a joint are lost in the rounding of what drives it

_Values = NDArray[np.float64]


class Rigs:
    """One simulation for each of several joints: made once, run often.

    Attributes:
        joints: N joints with the same muscles and gears; other numbers may differ.
        timestep: Length of a step [s].
    """

    def __init__(
        self, joints: Sequence[Joint], *, timestep: float = 1e-3, locked: bool = False
    ) -> None:
        """Make the simulations.

        Args:
            joints: The joints.
            timestep: Length of a step [s].
            locked: Whether muscles cannot move the joints: each stays where it starts, unless
                a torque moves its armature.
        """
        self.joints, self.timestep = tuple(joints), timestep
        self._muscles = len(joints[0].muscles)
        with installed():  # also while the batch is made: none can run with Python callbacks
            self._batch = _simulations(joints, timestep, _CLAMP if locked else 0.0)

    def run(
        self,
        *,
        start: ArrayLike,
        velocity: ArrayLike = 0.0,
        before: ArrayLike = 0.0,
        excitation: ArrayLike,
        torque: ArrayLike = 0.0,
        steps: int,
        record: Sequence[str] = ("qpos",),
    ) -> dict[str, _Values]:
        """Fields of MuJoCo's data over time, each of shape (N, steps, entries).

        Positions and velocities are those at the end of each step, forces those at its start.

        Args:
            start: Angle at time 0 [rad], broadcast to (N,).
            velocity: Velocity at time 0 [rad/s], broadcast to (N,).
            before: Excitation of each muscle before time 0, at which it starts steady [-],
                broadcast to (N, muscles).
            excitation: Excitation of each muscle over each step [-], broadcast to
                (N, steps, muscles).
            torque: External torque over each step [N·m], broadcast to (N, steps).
            steps: Number of steps.
            record: Names of the fields.

        Raises:
            UnmeasuredError: MuJoCo warned that a simulation went bad.
        """
        inputs = np.empty((len(self.joints), steps, self._muscles + 1))
        inputs[:, :, : self._muscles], inputs[:, :, self._muscles] = excitation, torque
        with installed(), quiet():
            self._batch.reset(stage=int(mujoco.mjtStage.mjSTAGE_NONE))
            _start(self._batch, self.joints, start, velocity, before)
            found = self._batch.rollout(steps, inputs, CONTROL_AND_TORQUE, record=record)
        check_batch(self._batch, self.joints[0])
        return {str(name): np.asarray(values) for name, values in found.items()}


@contextmanager
def quiet() -> Iterator[None]:
    """Do not print the warnings of MuJoCo; the data count them."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def joint_angles(
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
    """Angle [rad] of each joint at every step, with the start, shape (N, steps + 1).

    Args:
        joints: N joints with the same muscles and gears; other numbers may differ.
        start: As in ``Rigs.run``, and so are the others.
        velocity: See there.
        before: See there.
        excitation: See there.
        torque: See there.
        steps: Number of steps.
        timestep: Length of a step [s].

    Raises:
        UnmeasuredError: MuJoCo warned that a simulation went bad.
    """
    found = Rigs(joints, timestep=timestep).run(
        start=start,
        velocity=velocity,
        before=before,
        excitation=excitation,
        torque=torque,
        steps=steps,
    )
    result = np.empty((len(joints), steps + 1))
    result[:, 0], result[:, 1:] = start, found["qpos"][:, :, 0]
    return result


def driving_torques(
    joints: Sequence[Joint],
    *,
    path: ArrayLike,
    before: ArrayLike = 0.0,
    excitation: ArrayLike,
    timestep: float = 1e-3,
) -> _Values:
    """External torque [N·m] that moves each joint along a path, shape (N, T).

    The path is prescribed, as by a rigid clamp: an armature so heavy that only the torque on it
    moves the joint, at the path's velocities. What is returned is the torque that balances the
    joint's own inertia, passive torque and muscles.

    Args:
        joints: N joints, as in ``joint_angles``.
        path: Angle at every step [rad], shape (T,), or (N, T) for a path each.
        before: As in ``joint_angles``.
        excitation: Excitation of each muscle over each step [-], broadcast to (N, T, muscles).
        timestep: Length of a step [s].

    Raises:
        UnmeasuredError: MuJoCo warned that a simulation went bad.
    """
    # the mean velocity over the last step, which is what the muscles have experienced
    paths = np.atleast_2d(np.asarray(path, dtype=np.float64))
    speed = np.diff(paths, prepend=paths[:, :1]) / timestep
    acceleration = np.gradient(np.gradient(paths, timestep, axis=1), timestep, axis=1)
    inertial = np.array([[joint.inertia] for joint in joints]) * acceleration
    found = Rigs(joints, timestep=timestep, locked=True).run(
        start=paths[:, 0],
        before=before,
        excitation=excitation,
        torque=_CLAMP * np.diff(speed, append=speed[:, -1:]) / timestep,
        steps=paths.shape[1],
        record=("qfrc_passive", "qfrc_actuator"),
    )
    passive, active = (found[name][:, :, 0] for name in ("qfrc_passive", "qfrc_actuator"))
    return np.asarray(inertial - passive - active)


def _simulations(
    joints: Sequence[Joint], timestep: float, armature: float = 0.0
) -> mujoco.batch.Batch:
    spec = joint_spec(joints[0])
    spec.option.timestep = timestep
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # the model has none
    spec.joints[0].armature = armature
    with without_python_callbacks():
        model = spec.compile()
    batch = mujoco.batch.Batch(model, nsim=len(joints))
    _expand(batch, joints)
    return batch


def _start(
    batch: mujoco.batch.Batch,
    joints: Sequence[Joint],
    start: ArrayLike,
    velocity: ArrayLike,
    before: ArrayLike,
) -> None:
    """Put each joint at its start, muscles steady there."""
    batch.qpos[:, 0], batch.qvel[:, 0] = start, velocity
    excitations = np.broadcast_to(before, (len(joints), len(joints[0].muscles)))
    batch.act[:] = _steady_states(joints, batch.qpos[:, 0], excitations)


def _expand(batch: mujoco.batch.Batch, joints: Sequence[Joint]) -> None:
    """Set the parameters of each joint in its simulation."""
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
    batch.set_const()  # computes the mass matrix from the inertia


def check_batch(batch: mujoco.batch.Batch, joint: Joint) -> None:
    """Refuse a batch in which MuJoCo warned: it stops there, or continues from a reset state.

    Raises:
        UnmeasuredError: A simulation warned; the message has the warning's name and the joint.
    """
    warned = batch.warning[:, :, 1] > 0  # counts by simulation and kind
    if warned.any():
        kind = mujoco.mjtWarning(int(np.argmax(warned.any(axis=0)))).name
        raise UnmeasuredError(
            f"{joint.name}: MuJoCo warned '{kind.removeprefix('mjWARN_').lower()}' in "
            f"{warned.any(axis=1).sum()} of {len(warned)} simulations; check parameters, torques "
            "and timestep"
        )


def _steady_states(joints: Sequence[Joint], start: _Values, excitations: _Values) -> _Values:
    """States of every muscle, steady at its excitation and the joint's start angle."""
    act = []
    for joint, angle, row in zip(joints, start.tolist(), excitations.tolist(), strict=True):
        states: list[float] = []
        for (name, muscle), u in zip(joint.muscles.items(), row, strict=True):
            states += steady_states(muscle, u, joint.gears[name] * angle)
        act.append(states)
    return np.array(act)
