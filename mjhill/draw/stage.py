"""A model on stage: its poses over a recording, and pictures of them."""

from __future__ import annotations

import copy
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import DrawnMuscle, add_muscle, hide_tendons
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


Image = NDArray[np.uint8]

_SPARE_GEOMS = 2000


@dataclass(frozen=True)
class Stage:
    """A posed model, a scene and an OpenGL context of its own.

    Attributes:
        model: Private copy of the model, with buffers of the picture's size.
        data: Private data.
        muscles: The muscles to draw.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    muscles: tuple[DrawnMuscle, ...]
    _camera: Any
    _scene: Any
    _option: Any
    _gl: Any
    _context: Any
    _pixels: Image

    def picture(self, qpos: NDArray[np.float64], looks: Sequence[tuple[float, float]]) -> Image:
        """The scene as an image; valid until the next call.

        Args:
            qpos: Pose, shape (nq,).
            looks: Activation and force as a fraction of the maximum isometric force [-], for
                each muscle.

        Returns:
            RGB, shape (height, width, 3).
        """
        self.data.qpos[:] = qpos
        mujoco.mj_fwdKinematics(self.model, self.data)
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self.model, self.data, self._option, None, self._camera, everything, self._scene
        )
        for muscle, (activation, force) in zip(self.muscles, looks, strict=True):
            add_muscle(self._scene, self.model, self.data, muscle, activation, force)
        height, width, _ = self._pixels.shape
        view = mujoco.MjrRect(0, 0, width, height)
        self._gl.make_current()
        mujoco.mjr_render(view, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, view, self._context)
        return self._pixels[::-1]  # OpenGL's first row is the lowest


@contextmanager
def stage(
    model: mujoco.MjModel,
    muscles: tuple[DrawnMuscle, ...],
    size: tuple[int, int],
    camera: str | None,
) -> Iterator[Stage]:
    """A stage for pictures of ``size`` (width, height) [px]; its context is freed at the end.

    Raises:
        ValueError: The model has no camera of this name.
        RuntimeError: There is no OpenGL to render with.
    """
    seen_from = find_camera(model, camera)
    private = _private_copy(model, muscles, size)
    gl, context = _open_context(private, size)
    try:
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        yield Stage(
            private,
            mujoco.MjData(private),
            muscles,
            seen_from,
            mujoco.MjvScene(private, maxgeom=private.ngeom + _SPARE_GEOMS),
            mujoco.MjvOption(),
            gl,
            context,
            np.empty((size[1], size[0], 3), dtype=np.uint8),
        )
    finally:
        gl.make_current()
        context.free()
        gl.free()


def find_camera(model: mujoco.MjModel, name: str | None) -> Any:
    """The camera of this name; without one the model's first, or else a free one.

    Raises:
        ValueError: The model has no camera of this name; the message lists those there are.
    """
    camera = mujoco.MjvCamera()
    known = [model.camera(i).name for i in range(model.ncam)]
    if name is not None and name not in known:
        raise ValueError(f"unknown camera {name!r}; the model's cameras are: {_listed(known)}")
    if not known:
        mujoco.mjv_defaultFreeCamera(model, camera)
        return camera
    camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
    camera.fixedcamid = 0 if name is None else known.index(name)
    return camera


def _private_copy(
    model: mujoco.MjModel, muscles: tuple[DrawnMuscle, ...], size: tuple[int, int]
) -> mujoco.MjModel:
    """A copy with buffers of the picture's size, whose muscles' plain tendons are not shown."""
    private = copy.copy(model)
    private.vis.global_.offwidth, private.vis.global_.offheight = size
    # a shadow needs no more detail than the picture it falls into
    detail = 1 << max(size).bit_length()
    private.vis.quality.shadowsize = min(private.vis.quality.shadowsize, detail)
    hide_tendons(private, muscles)
    return private


def _open_context(model: mujoco.MjModel, size: tuple[int, int]) -> tuple[Any, Any]:
    """An OpenGL context and MuJoCo's rendering context in it.

    Raises:
        RuntimeError: Neither could be made; the message says what to install.
    """
    gl = None
    try:
        gl = _context_class()(*size)
        gl.make_current()
        return gl, mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    except (ImportError, AttributeError, OSError, RuntimeError, mujoco.FatalError) as error:
        if gl is not None:
            gl.free()
        reason = str(error).rstrip(". ")
        choice = os.environ.get("MUJOCO_GL") or "unset"
        raise RuntimeError(
            f"cannot render: no OpenGL context (MUJOCO_GL is {choice}): {reason}. On a machine "
            "without a screen set MUJOCO_GL=egl and install EGL, on Debian or Ubuntu with "
            "'apt-get install libegl1 libgles2 libgl1-mesa-dri'"
        ) from error


def _context_class() -> Any:
    """The class of OpenGL contexts that MUJOCO_GL names; EGL where it is unset and no screen.

    MuJoCo chooses when it is imported, which may have been before anyone thought of rendering;
    its C library reads MUJOCO_GL later, when the first context is made.
    """
    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not screen and not os.environ.get("MUJOCO_GL"):
        os.environ["MUJOCO_GL"] = "egl"
    choice = os.environ.get("MUJOCO_GL", "").lower().strip()
    if choice == "egl":
        from mujoco.egl import GLContext

        return GLContext
    if choice == "osmesa":
        from mujoco.osmesa import GLContext as SoftwareContext

        return SoftwareContext
    from mujoco.gl_context import GLContext as DefaultContext

    return DefaultContext


def _listed(names: list[str]) -> str:
    return ", ".join(names) or "none"
