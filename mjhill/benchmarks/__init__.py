"""Benchmarks: the accuracy and the speed of mjhill, measured on this machine."""

from __future__ import annotations

import inspect
import os
import platform
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from typing import cast

from mjhill.benchmarks.result import Result

NAMES = ("accuracy", "balance", "cost", "threads", "start", "video")
# on two cores without a graphics card
SECONDS = {"accuracy": 10, "balance": 10, "cost": 20, "threads": 10, "start": 30, "video": 230}
# run only by name, one at a time
LONG = {
    "sweep": 120, "fuzz": 300, "checks": 150, "endurance": 90, "literature": 500, "intervals": 900,
}  # fmt: skip


def run(
    names: tuple[str, ...], progress: Callable[[float], None] | None = None
) -> dict[str, Result]:
    """Run benchmarks by name; by default all.

    Raises:
        ValueError: There is no such benchmark; the message lists those there are.
    """
    chosen = check_names(names)
    results = {}
    for index, name in enumerate(chosen):
        results[name] = import_module(f"mjhill.benchmarks.{name}").measure()
        if progress is not None:
            progress((index + 1) / len(chosen))
    return results


def run_long(
    name: str,
    kinds: tuple[str, ...] = (),
    count: int | None = None,
    case: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Run one benchmark of ``LONG``, which take minutes; see its ``measure``.

    Raises:
        ValueError: It has no such kind, case or option.
    """
    measure = import_module(f"mjhill.benchmarks.{name}").measure
    options = {"kinds": kinds, "count": count, "case": case}
    known = inspect.signature(measure).parameters
    for option, value in options.items():
        if value and option not in known:
            word = {"kinds": "--kind"}.get(option, f"--{option}")
            raise ValueError(f"{word} does not go with mjhill bench {name}")
    given = {option: value for option, value in options.items() if option in known}
    return cast(Result, measure(**given, progress=progress))


def check_names(names: tuple[str, ...]) -> tuple[str, ...]:
    """The requested benchmarks; by default all but the long ones.

    Raises:
        ValueError: There is no such benchmark; the message lists those there are.
    """
    for name in names:
        if name not in NAMES:
            raise ValueError(
                f"unknown benchmark {name!r}; there are: {', '.join(NAMES)}"
                f"; one at a time: {', '.join(LONG)}"
            )
    return names or NAMES


def length(names: tuple[str, ...]) -> str:
    """How long benchmarks take on two cores, in words."""
    seconds = sum((SECONDS | LONG)[name] for name in names)
    return f"about {seconds} s" if seconds < 90 else f"about {round(seconds / 60)} minutes"


def versions() -> str:
    """Versions of the packages, and the number of cores."""
    packages = ("mjhill", "mujoco", "numba", "numpy", "scipy")
    listed = ", ".join(f"{name} {version(name)}" for name in packages)
    return f"{listed}; Python {platform.python_version()}, {os.cpu_count()} cores"
