"""Offscreen video of recordings: muscles that show activation and force, curves beside them."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.draw.bellies import DrawnMuscle, drawn_muscles
from mjhill.draw.dashboard import Reading, make_dashboard
from mjhill.draw.panels import arrange
from mjhill.draw.stage import Poses, Stage, rest_pose, stage
from mjhill.draw.timeplot import Side, make_plots
from mjhill.draw.video import SUFFIXES, video_writer
from mjhill.files import check_writable, replacing
from mjhill.simulate.recording import Recording

Image = NDArray[np.uint8]
Progress = Callable[[int, int], None]

_SMALLEST, _LARGEST = 64, 8192  # sides of a frame [px]


@dataclass(frozen=True)
class View:
    """What one panel of a video shows.

    Attributes:
        model: The model; it is copied, never changed.
        recording: A run of this model.
        title: Shown above the picture.
    """

    model: mujoco.MjModel
    recording: Recording
    title: str = ""


@dataclass(frozen=True)
class _Reel:
    """A view with all that its frames need."""

    stage: Stage
    poses: Poses
    recording: Recording
    muscles: tuple[DrawnMuscle, ...]

    def frame(self, time: float) -> tuple[Image, list[Reading]]:
        readings = _readings(self.recording, self.muscles, time)
        return self.stage.picture(self.poses.at(time), _looks(self.muscles, readings)), readings


def render(
    views: View | Sequence[View],
    path: str | Path,
    *,
    fps: float = 30,
    size: tuple[int, int] = (1280, 720),
    speed: float = 1.0,
    camera: str | None = None,
    progress: Progress | None = None,
) -> Path:
    """Render recordings to a video, side by side, each with its curves and a time cursor.

    A muscle's belly turns from slate to red with activation and thickens with force; bars and
    numbers under the picture give both. Frames go to the encoder one by one, so memory does not
    grow with the length. The file appears whole or not at all.

    Args:
        views: One view, or several to compare.
        path: Where to write, ``.mp4`` or ``.gif``.
        fps: Frames per second of the film [1/s].
        size: Width and height of the film [px], even.
        speed: Recorded time by film time [-]; 0.25 is slow motion.
        camera: Name of a camera of each model; by default the first, or a free one.
        progress: Called after each frame with the number done and the number in all.

    Returns:
        The path written.

    Raises:
        ValueError: An argument is out of range, a camera is unknown, or a recording lacks a
            joint of its model.
        OSError: ``path`` cannot be written.
        RuntimeError: There is no OpenGL to render with, or no encoder.
    """
    path, views = Path(path), _listed(views)
    _check_film(views, fps, speed, size)
    if path.suffix not in SUFFIXES:
        raise ValueError(f"video {str(path)!r} must end in {' or '.join(SUFFIXES)}")
    check_writable(path)
    with replacing(path) as partial, ExitStack() as stack:
        film = stack.enter_context(closing(_frames(views, fps, size, speed, camera)))
        append = stack.enter_context(video_writer(partial, size, fps))
        count = len(_times(views, fps, speed))
        for done, frame in enumerate(film, 1):
            append(frame)
            if progress is not None:
                progress(done, count)
    return path


def frames(
    views: View | Sequence[View],
    *,
    fps: float = 30,
    size: tuple[int, int] = (1280, 720),
    speed: float = 1.0,
    camera: str | None = None,
) -> Iterator[Image]:
    """The frames of the film that ``render`` writes, one by one, as for a notebook.

    ``mediapy.show_video(list(mjhill.frames(view)), fps=30)`` shows them. The renderer is closed
    with the last frame, or when the iterator is.

    Args:
        views: As for ``render``, and so all others.
        fps: Frames per second of the film [1/s].
        size: Width and height [px].
        speed: Recorded time by film time [-].
        camera: Name of a camera of each model; by default the first, or a free one.

    Returns:
        RGB pictures, shape (height, width, 3) each.

    Raises:
        ValueError: As ``render``, at once.
        RuntimeError: There is no OpenGL to render with; with the first frame.
    """
    views = _listed(views)
    _check_film(views, fps, speed, size)
    return (frame.copy() for frame in _frames(views, fps, size, speed, camera))


def _frames(
    views: list[View], fps: float, size: tuple[int, int], speed: float, camera: str | None
) -> Generator[Image, None, None]:
    """The frames, all in the same array."""
    span = _span(views)
    note = "" if speed == 1 else f"{speed:g}\N{MULTIPLICATION SIGN} speed"
    sides = [_side(view, note, size, i, len(views)) for i, view in enumerate(views)]
    with ExitStack() as stack:
        reels = [
            stack.enter_context(_reel(view, side, camera))
            for view, side in zip(views, sides, strict=True)
        ]
        dashboard = make_dashboard(sides, size, span)
        frame = np.empty((size[1], size[0], 3), dtype=np.uint8)
        for time in _times(views, fps, speed).tolist():
            pictures, readings = zip(*(reel.frame(time) for reel in reels), strict=True)
            dashboard.compose(frame, time, pictures, readings)
            yield frame


def _listed(views: View | Sequence[View]) -> list[View]:
    return [views] if isinstance(views, View) else list(views)


def _times(views: Sequence[View], fps: float, speed: float) -> NDArray[np.float64]:
    """Recorded time of each frame [s]."""
    first, last = _span(views)
    count = max(1, round((last - first) / speed * fps))
    return np.asarray(first + np.arange(count) * speed / fps)


def snapshot(
    model: mujoco.MjModel,
    recording: Recording | None = None,
    time: float = 0.0,
    path: str | Path | None = None,
    *,
    size: tuple[int, int] = (1280, 720),
    camera: str | None = None,
) -> Image:
    """One picture of a model, without curves.

    Args:
        model: The model; it is copied, never changed.
        recording: A run of it; without one the key ``home`` is shown, or ``qpos0``, at rest.
        time: Time of the picture in the recording [s].
        path: Where to write it, ``.png``; by default it is not written.
        size: Width and height [px].
        camera: Name of a camera; by default the first, or a free one.

    Returns:
        RGB, shape (height, width, 3).

    Raises:
        ValueError: An argument is out of range, the camera is unknown, or the recording lacks
            a joint of the model.
        OSError: ``path`` cannot be written.
        RuntimeError: There is no OpenGL to render with.
    """
    if path is not None and Path(path).suffix != ".png":
        raise ValueError(f"picture {str(path)!r} must end in .png")
    if path is not None:
        check_writable(Path(path))
    _check_size(size, even=False)
    muscles = drawn_muscles(model, recording)
    if recording is None:
        qpos, readings = rest_pose(model), [Reading(0.0, 0.0) for _ in muscles]
    else:
        qpos = Poses.of(model, recording).at(time)
        readings = _readings(recording, muscles, time)
    with stage(model, muscles, size, camera) as scene:
        image = scene.picture(qpos, _looks(muscles, readings)).copy()
    if path is not None:
        import mediapy

        with replacing(path) as partial:
            mediapy.write_image(partial, image)
    return image


def _side(view: View, note: str, size: tuple[int, int], index: int, count: int) -> Side:
    muscles = drawn_muscles(view.model, view.recording)
    units = tuple(view.recording.units[f"{muscle.name}.force"] for muscle in muscles)
    panel = arrange(size, index, count, len(muscles))
    return Side(panel, view.title, muscles, units, make_plots(view.recording, muscles), note)


@contextmanager
def _reel(view: View, side: Side, camera: str | None) -> Iterator[_Reel]:
    poses = Poses.of(view.model, view.recording)
    size = (side.panel.picture.width, side.panel.picture.height)
    with stage(view.model, side.muscles, size, camera) as scene:
        yield _Reel(scene, poses, view.recording, side.muscles)


def _readings(recording: Recording, muscles: Sequence[DrawnMuscle], time: float) -> list[Reading]:
    def value(name: str) -> float:
        return float(np.interp(time, recording.time, recording[name]))

    return [Reading(value(f"{m.name}.a"), value(f"{m.name}.force")) for m in muscles]


def _looks(
    muscles: Sequence[DrawnMuscle], readings: Sequence[Reading]
) -> list[tuple[float, float]]:
    return [
        (reading.activation, reading.force / max(muscle.max_force, mujoco.mjMINVAL))
        for muscle, reading in zip(muscles, readings, strict=True)
    ]


def _span(views: Sequence[View]) -> tuple[float, float]:
    """First and last time of all the recordings [s]."""
    starts = [float(view.recording.time[0]) for view in views]
    ends = [float(view.recording.time[-1]) for view in views]
    return min(starts), max(ends)


def _check_film(views: Sequence[View], fps: float, speed: float, size: tuple[int, int]) -> None:
    if not views:
        raise ValueError("there must be at least one view to render, got none")
    if any(len(view.recording) == 0 for view in views):
        raise ValueError("a recording to render must have at least one sample, got none")
    _check_size(size, even=True)
    for name, value in (("fps", fps), ("speed", speed)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, got {value}")


def _check_size(size: tuple[int, int], *, even: bool) -> None:
    width, height = (operator.index(side) for side in size)
    if not (_SMALLEST <= width <= _LARGEST and _SMALLEST <= height <= _LARGEST):
        raise ValueError(
            f"size must be {_SMALLEST} to {_LARGEST} pixels each way, got {width} x {height}"
        )
    if even and (width % 2 or height % 2):
        raise ValueError(
            f"size must be even for the encoder, got {width} x {height}; "
            f"use {width + width % 2} x {height + height % 2}"
        )
