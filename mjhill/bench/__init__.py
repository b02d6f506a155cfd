"""Benchmarks: what mjhill claims about accuracy and speed, measured on this machine."""

from __future__ import annotations

import inspect
import os
import platform
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from typing import cast

from mjhill.bench.result import Result

NAMES = ("accuracy", "cost", "threads", "start", "video")
LONG = ("sweep", "fuzz", "checks", "endurance")  # minutes each: run by name, one at a time


def run(
    names: tuple[str, ...], progress: Callable[[float], None] | None = None
) -> dict[str, Result]:
    """Run benchmarks by name, all without any.

    Raises:
        ValueError: There is no such benchmark; the message lists those there are.
    """
    for name in names:
        if name not in NAMES:
            raise ValueError(
                f"unknown benchmark {name!r}; there are: {', '.join(NAMES)}"
                f"; by themselves: {', '.join(LONG)}"
            )
    chosen = names or NAMES
    results = {}
    for index, name in enumerate(chosen):
        results[name] = import_module(f"mjhill.bench.{name}").measure()
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
    """Run a benchmark that takes minutes, one of ``LONG``; see its ``measure``.

    Raises:
        ValueError: It has no such kind, case or option.
    """
    measure = import_module(f"mjhill.bench.{name}").measure
    options = {"kinds": kinds, "count": count, "case": case}
    known = inspect.signature(measure).parameters
    for option, value in options.items():
        if value and option not in known:
            word = {"kinds": "--kind"}.get(option, f"--{option}")
            raise ValueError(f"{word} does not go with mjhill bench {name}")
    given = {option: value for option, value in options.items() if option in known}
    return cast(Result, measure(**given, progress=progress))


def versions() -> str:
    """What the numbers were measured with."""
    packages = ("mjhill", "mujoco", "numba", "numpy", "scipy")
    listed = ", ".join(f"{name} {version(name)}" for name in packages)
    return f"{listed}; Python {platform.python_version()}, {os.cpu_count()} cores"
