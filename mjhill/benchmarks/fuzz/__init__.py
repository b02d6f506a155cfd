"""Random models with any accepted parameters: does a model fail without a warning of a check?"""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from typing import Any

import mujoco

from mjhill.benchmarks.fuzz.models import KINDS
from mjhill.benchmarks.fuzz.outcomes import STEPS, STRONGEST, Outcome, run
from mjhill.benchmarks.result import Result
from mjhill.engine.install import installed
from mjhill.lab.batch import quiet

COUNT = 100_000  # models in all
SHOWN = 20  # silent failures to list
_CHUNK = 25

Progress = Callable[[float], None]


def measure(
    kinds: Sequence[str] = (),
    count: int | None = None,
    case: str | None = None,
    progress: Progress | None = None,
) -> Result:
    """How many random models fail, and how many of these without a finding.

    Args:
        kinds: Kinds of model; by default all.
        count: Models in all.
        case: One model instead, such as ``hinge:17``: its findings and its run.
        progress: Called with the share done, from 0 to 1.

    Raises:
        ValueError: A kind or case is unknown.
    """
    if case is None:
        return table(fuzz(kinds or KINDS, count or COUNT, progress=progress))
    outcome = replay(case)
    row = {name: _listed(value) for name, value in asdict(outcome).items()}
    return Result(f"{case}: {outcome.verdict}", [row])


def fuzz(
    kinds: Sequence[str] = KINDS,
    count: int = COUNT,
    processes: int | None = None,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Run random models, ``count`` in all, in parallel.

    Args:
        kinds: Kinds of model.
        count: Models in all, divided evenly between the kinds.
        processes: How many processes; by default one for each core. 1 means this process.
        progress: Called with the share done, from 0 to 1.

    Raises:
        ValueError: A kind is unknown.
    """
    for kind in kinds:
        if kind not in KINDS:
            raise ValueError(f"unknown kind of model {kind!r}; there are: {', '.join(KINDS)}")
    jobs = [(kinds[k % len(kinds)], k // len(kinds)) for k in range(count)]
    outcomes: list[Outcome] = []
    with installed():  # compiles once, before the processes start
        if processes == 1:
            with quiet():
                return [run(*job) for job in jobs]
    chunks = [jobs[first : first + _CHUNK] for first in range(0, count, _CHUNK)]
    with (
        tempfile.TemporaryDirectory() as folder,  # MuJoCo writes a log to the working folder
        ProcessPoolExecutor(processes, initializer=os.chdir, initargs=(folder,)) as pool,
    ):
        for found in pool.map(_outcomes, chunks):
            outcomes += found
            if progress is not None:
                progress(len(outcomes) / count)
    return outcomes


def replay(case: str) -> Outcome:
    """Run one model again, by its name, such as ``hinge:17``.

    Raises:
        ValueError: The name is not a kind and a number.
    """
    kind, _, number = case.partition(":")
    if not number.isdecimal():
        raise ValueError(f"a case is named KIND:NUMBER, such as {KINDS[0]}:17, got {case!r}")
    with installed(), quiet():
        return run(kind, int(number))


def _outcomes(jobs: list[tuple[str, int]]) -> list[Outcome]:
    with installed(), quiet():
        return [run(*job) for job in jobs]


def table(outcomes: Sequence[Outcome]) -> Result:
    """A row for each kind of model, and the silent failures with the command for each."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.kind, []).append(outcome)
    rows: list[dict[str, Any]] = [_row(kind, group) for kind, group in groups.items()]
    if len(rows) > 1:
        rows.append(_row("all", outcomes))
    silent = [o for o in outcomes if o.verdict == "silent"]
    warned = [
        o
        for o in outcomes
        if o.verdict == "reported" and any(failure.startswith("WARN") for failure in o.failures)
    ]
    kinds = Counter(failure for o in outcomes for failure in o.failures)
    notes = (
        f"{STEPS} steps each; a failure: a warning of MuJoCo, a state that is not finite, n or a "
        f"outside [0, 1], tension below 0 or above {STRONGEST:g} F_max; predicted: with a severe "
        "finding of check_model or check_tendons, or an error of a check",
        f"reported: mjhill.record warns or raises; because MuJoCo warned: {len(warned)} of them",
        "plant: MuJoCo also warns of the same run without mjhill's muscles and elasticities",
        "failures: " + ", ".join(f"{name} {n}" for name, n in kinds.most_common()),
        f"goal: none silent; there are {len(silent)}",
        *(f"{', '.join(o.failures)}: mjhill bench fuzz --case {o.case}" for o in silent[:SHOWN]),
    )
    return Result(f"Random models, MuJoCo {mujoco.__version__}", rows, notes)


def _row(kind: str, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    verdicts = Counter(outcome.verdict for outcome in outcomes)
    row: dict[str, Any] = {"models": kind, "n": len(outcomes)}
    for verdict in ("sound", "finding only", "predicted", "reported", "plant", "silent"):
        row[verdict] = verdicts[verdict]
    return row


def _listed(value: Any) -> Any:
    return "; ".join(value) if isinstance(value, tuple) else value
