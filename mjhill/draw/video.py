"""Video files, written frame by frame through ffmpeg."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SUFFIXES = (".mp4", ".gif")
_H264 = "-preset veryfast -movflags +faststart"
# a palette for each frame: one for the whole film would keep all its frames in memory
_GIF = "-vf split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1"


@contextmanager
def video_writer(
    path: Path, size: tuple[int, int], fps: float
) -> Iterator[Callable[[NDArray[np.uint8]], None]]:
    """A function that appends one frame, shape (height, width, 3), to the video at ``path``.

    The encoder is a process of its own, so it works while the next frame is rendered. It is
    gone when this returns; after a failure or an interrupt it is killed.

    Args:
        path: ``.mp4`` or ``.gif``.
        size: Width and height [px], even.
        fps: Frames per second [1/s].

    Raises:
        RuntimeError: There is no encoder, or it failed; the message has its own words.
    """
    import mediapy

    _find_ffmpeg(mediapy)
    gif = path.suffix == ".gif"
    writer = mediapy.VideoWriter(
        path,
        (size[1], size[0]),
        fps=fps,
        codec="gif" if gif else "h264",
        crf=None if gif else 20,
        ffmpeg_args=_GIF if gif else _H264,
        encoded_format=None if gif else "yuv420p",
    )
    with writer:
        # mediapy keeps the process to itself, and on failure waits for it with its pipe open
        process: Any = writer._proc
        try:
            yield partial(_checked, process, writer.add_image)
            _checked(process, writer.close)
        except BaseException:
            _end(process)
            writer._popen = writer._proc = None
            raise


def _checked(process: Any, action: Callable[..., None], *frame: Any) -> None:
    """Use the encoder; if it has ended, say why.

    Raises:
        RuntimeError: It is.
    """
    try:
        action(*frame)
    except (OSError, RuntimeError) as error:
        process.kill()
        status = process.wait()
        words = process.stderr.read().decode(errors="replace").strip()
        # mediapy may have read the encoder's words into its own error
        reason = words or (str(error) if isinstance(error, RuntimeError) else f"status {status}")
        raise RuntimeError(f"the video encoder stopped: {reason}; is the disk full?") from error


def _end(process: Any) -> None:
    """Kill the encoder and close its pipes."""
    process.kill()
    for pipe in (process.stdin, process.stderr):
        with suppress(OSError):
            pipe.close()
    process.wait()


def _find_ffmpeg(mediapy: Any) -> None:
    """Let mediapy use the ffmpeg on the path, or else the one that imageio-ffmpeg brings.

    Raises:
        RuntimeError: There is neither.
    """
    if mediapy.video_is_available():
        return
    try:
        import imageio_ffmpeg

        mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError) as error:
        raise RuntimeError(
            "no video encoder: 'pip install imageio-ffmpeg', or install ffmpeg so that it is on "
            "the path"
        ) from error
