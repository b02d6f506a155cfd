"""Poses: the joint positions of a recording, put back where the model has them."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.engine.layout import joint_names
from mjhill.simulate.recording import Recording

# what a recording calls the coordinates of a joint, by its type
_COORDINATES: dict[int, tuple[str, ...]] = {
    int(mujoco.mjtJoint.mjJNT_HINGE): ("angle",),
    int(mujoco.mjtJoint.mjJNT_SLIDE): ("position",),
    int(mujoco.mjtJoint.mjJNT_BALL): tuple(f"qpos{i}" for i in range(4)),
    int(mujoco.mjtJoint.mjJNT_FREE): tuple(f"qpos{i}" for i in range(7)),
}


@dataclass(frozen=True)
class Poses:
    """``qpos`` of a recording as a function of time.

    Attributes:
        time: Sample times [s], shape (T,).
        nq: Length of ``qpos``.
        scalars: Address in ``qpos`` and values, shape (T,), of hinges and slides.
        others: The same of ball and free joints.
    """

    time: NDArray[np.float64]
    nq: int
    scalars: tuple[tuple[int, NDArray[np.float64]], ...]
    others: tuple[tuple[int, NDArray[np.float64]], ...]

    @staticmethod
    def of(model: mujoco.MjModel, recording: Recording) -> Poses:
        """The poses of a recording.

        Raises:
            ValueError: A joint of the model is not in the recording.
        """
        scalars: list[tuple[int, NDArray[np.float64]]] = []
        others: list[tuple[int, NDArray[np.float64]]] = []
        for i, name in enumerate(joint_names(model)):
            coordinates = _COORDINATES[int(model.jnt_type[i])]
            kept = scalars if len(coordinates) == 1 else others
            for k, coordinate in enumerate(coordinates):
                values = _series(recording, name, coordinate)
                kept.append((int(model.jnt_qposadr[i]) + k, values))
        return Poses(recording.time, int(model.nq), tuple(scalars), tuple(others))

    def at(self, time: float) -> NDArray[np.float64]:
        """``qpos`` at ``time`` [s], shape (nq,); before and after the recording its ends.

        Hinges and slides are interpolated; a quaternion is that of the nearest sample.
        """
        qpos = np.zeros(self.nq)
        for address, values in self.scalars:
            qpos[address] = np.interp(time, self.time, values)
        if self.others:
            nearest = int(np.abs(self.time - time).argmin())
            for address, values in self.others:
                qpos[address] = values[nearest]
        return qpos


def rest_pose(model: mujoco.MjModel) -> NDArray[np.float64]:
    """``qpos`` of the key ``home`` where there is one, or else ``qpos0``; shape (nq,)."""
    key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, "home")
    qpos: NDArray[np.float64] = model.qpos0 if key < 0 else model.key_qpos[key]
    return qpos.copy()


def _series(recording: Recording, joint: str, coordinate: str) -> NDArray[np.float64]:
    name = f"{joint}.{coordinate}"
    if name not in recording.series:
        known = ", ".join(recording) or "none"
        raise ValueError(
            f"the recording has no series {name!r}, which joint {joint!r} of the model needs; "
            f"render it with the model it was recorded from. Its series are: {known}"
        )
    return recording.series[name]
