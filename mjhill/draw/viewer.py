"""Viewer: a window in which a model runs, its muscles drawn as in the films."""

from __future__ import annotations

import copy
import math
import os
import queue
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import add_muscle, drawn_muscles, hide_tendons, present_look
from mjhill.engine.checks import check_model
from mjhill.engine.equilibrium import at_home, check_finite
from mjhill.engine.install import installed, installed_backend
from mjhill.simulate.run import check_warnings

_FRAME = 1 / 60  # wall time of a frame [s]
_STEPPING = 0.7 * _FRAME  # at most this much of it goes to the physics, as in simulate
_HISTORY = 2000  # frames to step back to, as in simulate
_SLOWEST, _FASTEST = 1 / 64, 4.0
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION

_SPACE, _MINUS, _EQUAL, _BACKSPACE, _RIGHT, _LEFT = 32, 45, 61, 259, 262, 263  # GLFW's codes
_KEYS = "Space\nRight\nLeft\nBackspace\n-  =\nTab"
_USES = "run or pause\nstep\nback\nrestart\nspeed\nsettings"


def view(
    model: mujoco.MjModel,
    data: mujoco.MjData | None = None,
    *,
    paused: bool = False,
    speed: float = 1.0,
) -> None:
    """Run a model in a window until that is closed; muscles show activation and force.

    The window is MuJoCo's passive viewer: "Control" in its right panel has a slider for each
    muscle. Space runs or pauses, the right arrow steps while paused, the left arrow goes back a
    frame, Backspace goes back to the start, - and = halve and double the speed. A warning of
    MuJoCo pauses the run and is shown.

    Args:
        model: The model; it is copied, never changed.
        data: Its state, advanced in place; by default the key ``home``, or ``qpos0``, with
            steady muscles.
        paused: Whether to wait for Space at the start.
        speed: Simulated time by wall time [-], 1/64 to 4.

    Raises:
        ValueError: ``speed`` is out of range, a control or a position is not finite, or the
            model is not in order; see ``check_model``.
        RuntimeError: There is no display to open a window on.
    """
    if not _SLOWEST <= speed <= _FASTEST:
        raise ValueError(f"speed must be in [1/64, 4], got {speed}")
    check_model(model)
    data = at_home(model) if data is None else data
    check_finite(data)
    _check_display()
    muscles = drawn_muscles(model, None)
    private = copy.copy(model)
    hide_tendons(private, muscles)
    with installed() if installed_backend() is None else nullcontext():
        player = Player(private, data, running=not paused, speed=speed)
        with _window(player) as window:
            elapsed = 0.0
            while window.is_running():
                start = time.monotonic()
                player.play(elapsed)
                window.user_scn.ngeom = 0
                for muscle in muscles:
                    look = present_look(data, muscle)
                    add_muscle(window.user_scn, private, data, muscle, *look)
                window.set_texts(player.texts())
                window.sync()
                player.notice_reset()
                time.sleep(max(0.0, start + _FRAME - time.monotonic()))
                elapsed = time.monotonic() - start


class Player:
    """A model that is run, paused, stepped and restarted by keys.

    Attributes:
        model: The model.
        data: Its state.
        running: Whether the simulation runs.
        speed: Simulated time by wall time [-].
        problem: The warning of MuJoCo that has ended the run, or nothing.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, *, running: bool, speed: float
    ) -> None:
        """Start at the present state of ``data``; ``speed`` is simulated by wall time [-]."""
        self.model, self.data = model, data
        self.running, self.speed, self.problem = running, speed, ""
        self._keys: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._due = 0.0  # simulated time still to be stepped [s]
        self._history: deque[NDArray[np.float64]] = deque(maxlen=_HISTORY)
        self._start = self._state()
        self._start_is_reset = self._is_reset()
        mujoco.mj_forward(model, data)

    def press(self, key: int) -> None:
        """Note a key, by its GLFW code; may be called by any thread."""
        self._keys.put(key)

    def play(self, elapsed: float) -> None:
        """Do what the keys say and, while running, step for a wall time [s]."""
        while not self._keys.empty():
            self._obey(self._keys.get())
        if not self.running:
            mujoco.mj_forward(self.model, self.data)  # a slider or the mouse may have moved
            return
        self._history.append(self._state())
        timestep = self.model.opt.timestep
        self._due += min(elapsed, 0.1) * self.speed
        until = time.monotonic() + _STEPPING
        while self.running and self._due >= timestep and time.monotonic() < until:
            self._step()
            self._due -= timestep
        self._due = math.fmod(self._due, timestep)  # a slow machine shows slow motion

    def notice_reset(self) -> None:
        """Restart where the window has reset the state, which it does to ``qpos0``."""
        if self._is_reset() and not self._start_is_reset:
            self._restart()

    def texts(self) -> list[tuple[Any, Any, str, str]]:
        """What is written over the picture, in the form of the window's ``set_texts``."""
        font, grid = mujoco.mjtFontScale.mjFONTSCALE_100, mujoco.mjtGridPos
        state = self.problem or ("running" if self.running else "paused")
        return [
            (font, grid.mjGRID_TOPLEFT, _KEYS, _USES),
            (font, grid.mjGRID_BOTTOMLEFT, f"{self.data.time:.3f} s at {self.speed:g}", state),
        ]

    def _obey(self, key: int) -> None:
        if key == _SPACE:
            self.running = not self.running and not self.problem
        elif key == _RIGHT and not self.running and not self.problem:
            self._history.append(self._state())
            self._step()
        elif key == _LEFT:
            self.running = False
            if self._history:
                self._restore(self._history.pop())
        elif key == _BACKSPACE:
            self._restart()
        elif key in (_MINUS, _EQUAL):
            faster = 0.5 if key == _MINUS else 2.0
            self.speed = min(max(self.speed * faster, _SLOWEST), _FASTEST)

    def _step(self) -> None:
        mujoco.mj_step(self.model, self.data)
        try:
            check_warnings(self.data)
        except RuntimeError as error:
            self.running, self.problem = False, str(error)

    def _restart(self) -> None:
        self._restore(self._start)
        self._history.clear()

    def _restore(self, state: NDArray[np.float64]) -> None:
        mujoco.mj_resetData(self.model, self.data)  # its warnings too
        mujoco.mj_setState(self.model, self.data, state, _STATE)
        mujoco.mj_forward(self.model, self.data)
        self.problem = ""

    def _state(self) -> NDArray[np.float64]:
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def _is_reset(self) -> bool:
        data = self.data
        moved = data.time != 0 or data.qvel.any() or data.act.any()
        return not moved and np.array_equal(data.qpos, self.model.qpos0)


@contextmanager
def _window(player: Player) -> Iterator[Any]:
    """A passive viewer of the player's model; at the end its thread is gone.

    Raises:
        RuntimeError: On macOS, where the process was not started by ``mjpython``.
    """
    import mujoco.viewer

    before = threading.enumerate()
    try:
        window = mujoco.viewer.launch_passive(
            player.model, player.data, key_callback=player.press, show_left_ui=False
        )
    except RuntimeError as error:
        if sys.platform != "darwin":
            raise
        raise RuntimeError(
            "macOS opens windows only for mjpython: run `mjpython -m mjhill view MODEL`, or use "
            "`mjhill video MODEL` for a film"
        ) from error
    threads = [thread for thread in threading.enumerate() if thread not in before]
    try:
        with window.lock():
            _aim(window.cam, player.model, player.data)
        yield window
    finally:
        window.close()
        for thread in threads:
            thread.join(5.0)  # MuJoCo crashes where the process ends before


def _aim(camera: Any, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Let a free camera, which the mouse can move, see what the model's first camera sees."""
    mujoco.mjv_defaultFreeCamera(model, camera)
    if not model.ncam:
        return
    x, y, z = -data.cam_xmat[0].reshape(3, 3)[:, 2]  # its line of sight
    camera.azimuth, camera.elevation = np.degrees((math.atan2(y, x), math.asin(z)))
    angles = np.radians((model.cam_fovy[0], model.vis.global_.fovy)) / 2
    zoom = math.tan(angles[0]) / math.tan(angles[1])
    camera.distance = zoom * float(np.linalg.norm(data.cam_xpos[0] - camera.lookat))


def _check_display() -> None:
    """Open a window that is not shown: MuJoCo's viewer waits forever where it gets none.

    Raises:
        RuntimeError: It could not be opened; the message says why.
    """
    if sys.platform != "linux":
        return
    reason = "neither DISPLAY nor WAYLAND_DISPLAY is set"
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        import glfw

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # said below
            if glfw.init():
                glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
                window = glfw.create_window(64, 64, "", None, None)
                glfw.default_window_hints()
                if window:
                    glfw.destroy_window(window)
                    return
            words: Any = glfw.get_error()[1]
        reason = words.decode(errors="replace") if words else "GLFW does not say why"
    raise RuntimeError(
        f"no display to open a window on ({reason}); use `mjhill video MODEL` for a film, or log "
        "in with `ssh -X`"
    )
