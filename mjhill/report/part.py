"""Makes one part: runs the experiment, draws its figure, films its run."""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from mjhill.experiments.result import Result
from mjhill.report.catalogue import Part
from mjhill.report.store import FIGURE, FILM, NUMBERS, write_json
from mjhill.simulate.recording import Recording

Progress = Callable[[float], None]

_DPI = 200  # of a figure [1/inch]: two pixels for each of a page that is 900 wide
_FILM = {"size": (640, 360), "fps": 24}
_LONGEST = 4.0  # of a film [s]
_SPEEDS = (10, 5, 2, 1, 0.5, 0.25, 0.2, 0.1, 0.05, 0.02, 0.01)
_BEFORE_FILM = 0.7  # share of the work [-]


def make(
    part: Part, folder: Path, *, fingerprint: str, video: bool, progress: Progress
) -> str | None:
    """Run an experiment on a joint and write its files into a folder.

    Returns:
        Why the film is missing; None if it is there or none was asked for.

    Raises:
        Exception: Whatever the experiment raises.
    """
    function = part.entry.function()
    started = time.perf_counter()
    result: Result = function(part.joint, progress=lambda share: progress(_BEFORE_FILM * share))
    seconds = time.perf_counter() - started
    progress(_BEFORE_FILM)
    numbers = {
        "id": part.entry.id,
        **plain(result.as_dict()),
        "options": _options(function),
        "seconds": seconds,
        "fingerprint": fingerprint,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    numbers["figure"] = _draw(result, folder / f"{part.name}{FIGURE}")
    film = None
    if video and part.entry.filmed:
        path = folder / f"{part.name}{FILM}"
        film = _film(
            part.joint, result.film(), path, lambda share: progress(_BEFORE_FILM + 0.3 * share)
        )
    write_json(folder / f"{part.name}{NUMBERS}", {**numbers, "film": film})
    progress(1.0)
    return film.get("problem") if film else None


def plain(value: Any, name: str = "result") -> Any:
    """A value with Python's numbers in place of numpy's.

    Raises:
        ValueError: A number is not finite; JSON has no such numbers.
    """
    if isinstance(value, dict):
        return {key: plain(item, f"{name}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, f"{name}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{name} is {value}; a measure that was not seen is None")
    return value


def film_speed(duration: float) -> float:
    """Recorded time per film time [-] at which the eye can follow a run of ``duration`` [s]."""
    slow_enough = [speed for speed in _SPEEDS if duration <= speed * _LONGEST]
    return float(min(slow_enough, default=duration / _LONGEST))


def _options(function: Callable[..., Any]) -> dict[str, Any]:
    """Parameters of an experiment other than the joint, with the values of this run."""
    parameters = list(inspect.signature(function).parameters.values())[1:]
    return {
        item.name: _shown(item.default)
        for item in parameters
        if item.name != "progress" and item.default is not inspect.Parameter.empty
    }


def _shown(value: Any) -> Any:
    """A value as JSON writes it, or else as Python does."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list | tuple):
        return [_shown(item) for item in value]
    return repr(value)


def _draw(result: Result, path: Path) -> dict[str, int]:
    """Draw the figure; gives its width and height [px]."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=result.size, layout="constrained")
    result.draw(figure)
    figure.savefig(path, dpi=_DPI, facecolor="white", pil_kwargs={"optimize": True})
    width, height = (round(_DPI * side) for side in figure.get_size_inches())
    return {"width": width, "height": height}


def _film(
    joint: str, recording: Recording | None, path: Path, progress: Progress
) -> dict[str, Any]:
    """Film a run; gives the speed, or the problem: numbers are kept even without OpenGL."""
    if recording is None:
        return {"nothing": "the experiment has no run to film on this joint"}
    from mjhill.draw import View, render
    from mjhill.simulate.load import load

    duration = float(recording.time[-1] - recording.time[0])
    speed = film_speed(duration)
    try:
        render(
            View(load(joint), recording),
            path,
            speed=speed,
            progress=lambda done, total: progress(done / total),
            **_FILM,  # type: ignore[arg-type]
        )
    except (RuntimeError, ValueError, OSError) as error:
        path.unlink(missing_ok=True)
        return {"problem": f"{type(error).__name__}: {error}"}
    return {"speed": speed, "recorded": duration}
