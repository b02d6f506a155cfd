"""Start: import of mjhill, first use of compiled muscles without and with a cache."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
from typing import Any

from mjhill.benchmarks.result import Result

ROUNDS = 7
_TIMED = "import time; t = time.perf_counter(); {}; print(time.perf_counter() - t)"
_IMPORT = "import mjhill"
_USE = "import mjhill; t = time.perf_counter(); mjhill.install(); mjhill.uninstall()"


def measure() -> Result:
    """Seconds, each in a fresh process, medians."""
    rows = []
    with tempfile.TemporaryDirectory() as cache:
        importing = [_seconds(_IMPORT, cache) for _ in range(ROUNDS)]
        rows.append(_row("import mjhill", importing, 0.5))
        cold = []
        for _ in range(3):
            with tempfile.TemporaryDirectory() as empty:
                cold.append(_seconds(_USE, empty))
        rows.append(_row("first compiled use, empty cache", cold, 5.0))
        _seconds(_USE, cache)
        warm = [_seconds(_USE, cache) for _ in range(ROUNDS)]
        rows.append(_row("first compiled use, cached", warm, 0.5))
    return Result("Start [s]", rows, ("an empty cache includes loading the compiler",))


def _row(what: str, seconds: list[float], goal: float) -> dict[str, Any]:
    median = statistics.median(seconds)
    return {"what": what, "goal": f"≤ {goal:g} s", "median [s]": median, "met": median <= goal}


def _seconds(statement: str, cache: str) -> float:
    environment = {**os.environ, "MJHILL_CACHE_DIR": cache}
    run = subprocess.run(
        [sys.executable, "-c", _TIMED.format(statement)],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    return float(run.stdout)
