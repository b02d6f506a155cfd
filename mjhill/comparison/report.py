"""A comparison as files: table, recordings, overlaid plots, video."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from mjhill.comparison.native import compiled, native_spec, read_spec
from mjhill.comparison.table import Comparison
from mjhill.files import replacing

if TYPE_CHECKING:
    from mjhill.draw import View

_VIDEO_SPEED = 0.25  # of real time


def write(
    comparison: Comparison,
    folder: str | Path,
    *,
    video: bool = True,
    progress: Callable[[float], None] | None = None,
) -> list[Path]:
    """Write a comparison: table (JSON), recordings (CSV), overlaid plots (PNG) and video (MP4).

    Each file appears whole or not at all.

    Args:
        comparison: The result of ``compare``.
        folder: The folder; created if it does not exist.
        video: Whether to render both models side by side, at a quarter of the speed.
        progress: Called while the video is made with the share done, 0 to 1.

    Returns:
        The paths written.

    Raises:
        OSError: A file cannot be written.
        RuntimeError: No renderer or no video encoder was found.
    """
    from mjhill.draw.plot import plot_overlay

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "comparison.json"
    with replacing(table) as partial_file:
        text = json.dumps(comparison.as_dict(), indent=2, ensure_ascii=False, allow_nan=False)
        partial_file.write_text(text + "\n", encoding="utf-8")
    paths = [table]
    for task, sides in comparison.recordings.items():
        stem = task.replace(" ", "_")
        for side, recording in sides.items():
            paths.append(recording.save(folder / f"{stem}_{side}.csv"))
        title = comparison.tasks[task]
        paths.append(plot_overlay(sides, folder / f"{stem}.png", title=title))
    if video:
        paths.append(_write_video(comparison, folder / "comparison.mp4", progress))
    return paths


def views_of(comparison: Comparison) -> list[View]:
    """The views of the video: the pulses with mjhill's muscles, then with MuJoCo's."""
    from mjhill.draw import View

    spec = read_spec(comparison.model, comparison.muscle)
    models = {"mjhill": compiled(spec), "native": compiled(native_spec(spec))}
    titles = {"mjhill": "mjhill", "native": "MuJoCo <muscle>"}
    return [
        View(models[side], recording, titles[side])
        for side, recording in comparison.recordings["pulses"].items()
    ]


def _write_video(
    comparison: Comparison, path: Path, progress: Callable[[float], None] | None
) -> Path:
    from mjhill.draw import render

    count = None if progress is None else lambda done, total: progress(done / total)
    render(views_of(comparison), path, speed=_VIDEO_SPEED, progress=count)
    return path
