"""Random systems in MuJoCo and in the reference solver: errors, and warnings of the check."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

import mujoco
import numpy as np

from mjhill.benchmarks.result import Result
from mjhill.benchmarks.sweep.cases import DURATION, KINDS, Case, draw
from mjhill.benchmarks.sweep.solutions import PUSH, Truth, error, floor, run, solve, stretched, use
from mjhill.engine.checks import check_model
from mjhill.engine.install import installed

TIMESTEPS = (0.5e-3, 1e-3, 2e-3, 5e-3)  # [s]
INTEGRATORS = ("implicitfast", "euler", "discrete", "RK4")
COUNT = 100  # systems of each kind
SENSITIVE = 10.0  # times that a push may grow
MISSED = 5.0  # error [%] from which a finding is required
FLOOR = 1.5  # times the error of MuJoCo's own plant, if that is larger


@dataclass(frozen=True)
class Outcome:
    """The error of one system under one integrator and timestep.

    Attributes:
        case: Kind and number, as ``physiological:17``.
        kind: Kind of system.
        integrator: Its name in MJCF.
        timestep: [s].
        error: Largest error [% of the range of angle; of F_max where the movement is prescribed].
        floor: The error of the plant alone, driven by the true torques; None if not measured.
        amplification: How much a small push grows.
        finding: The first finding of ``check_model``; empty if there is none.
        severe: Whether that finding is severe.
    """

    case: str
    kind: str
    integrator: str
    timestep: float
    error: float
    floor: float | None
    amplification: float
    finding: str
    severe: bool


def measure(
    kinds: Sequence[str] = (),
    count: int | None = None,
    case: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """The table of errors of random systems by kind, integrator and timestep.

    Args:
        kinds: Kinds of system; by default all.
        count: Systems of each kind.
        case: One system instead, such as ``physiological:17``: a row for each run.
        progress: Called with the share done, from 0 to 1.

    Raises:
        ValueError: A kind or case is unknown.
    """
    if case is None:
        return table(sweep(kinds or KINDS, count or COUNT, progress=progress))
    rows = [asdict(outcome) for outcome in replay(case)]
    return Result(f"Errors [%] of {case}", rows)


def sweep(
    kinds: Sequence[str] = KINDS,
    count: int = COUNT,
    integrators: Sequence[str] = INTEGRATORS,
    timesteps: Sequence[float] = TIMESTEPS,
    processes: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Outcome]:
    """Run random systems, ``count`` of each kind, in parallel.

    Args:
        kinds: Kinds of system.
        count: Systems of each kind, numbered from 0.
        integrators: Integrators by their names in MJCF.
        timesteps: Timesteps [s].
        processes: How many processes; by default one for each core. 1 means this process.
        progress: Called with the share done, from 0 to 1.

    Raises:
        ValueError: A kind is unknown.
    """
    jobs = [
        (kind, number, tuple(integrators), tuple(timesteps))
        for kind in kinds
        for number in range(count)
    ]
    outcomes: list[Outcome] = []
    with installed():  # compiles once, before the processes start
        if processes == 1:
            for done, job in enumerate(jobs):
                outcomes += _outcomes(job)
                _report(progress, done + 1, len(jobs))
            return outcomes
    with ProcessPoolExecutor(processes) as pool:
        for done, found in enumerate(pool.map(_outcomes, jobs, chunksize=4)):
            outcomes += found
            _report(progress, done + 1, len(jobs))
    return outcomes


def replay(
    case: str, integrators: Sequence[str] = INTEGRATORS, timesteps: Sequence[float] = TIMESTEPS
) -> list[Outcome]:
    """Run one system again, by its name, such as ``physiological:17``.

    Raises:
        ValueError: The name is not a kind and a number.
    """
    kind, _, number = case.partition(":")
    if not number.isdecimal():
        raise ValueError(f"a case is named KIND:NUMBER, such as {KINDS[0]}:17, got {case!r}")
    with installed():
        return _outcomes((kind, int(number), tuple(integrators), tuple(timesteps)))


def _report(progress: Callable[[float], None] | None, done: int, total: int) -> None:
    if progress is not None:
        progress(done / total)


def _outcomes(job: tuple[str, int, tuple[str, ...], tuple[float, ...]]) -> list[Outcome]:
    kind, number, integrators, timesteps = job
    with installed():
        truth = solve(draw(kind, number))
        return [
            _outcome(truth, integrator, timestep)
            for integrator in integrators
            for timestep in timesteps
            # the positions within a step of RK4 cannot be prescribed
            if not (truth.case.movement and integrator == "RK4")
        ]


def _outcome(truth: Truth, integrator: str, timestep: float) -> Outcome:
    case = truth.case
    # a joint whose movement is prescribed is never too fast for a timestep
    finding, severe = ("", False) if case.movement else _gravest_finding(case, integrator, timestep)
    advance = stretched if case.movement else run
    return Outcome(
        case.name,
        case.kind,
        integrator,
        timestep,
        error(truth, advance(case, integrator, timestep)),
        None if case.movement else error(truth, floor(truth, integrator, timestep)),
        truth.amplification,
        finding,
        severe,
    )


def _gravest_finding(case: Case, integrator: str, timestep: float) -> tuple[str, bool]:
    """The most severe finding of ``check_model``, and whether it is severe."""
    use(case.model, integrator, timestep)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        findings = sorted(check_model(case.model), key=lambda finding: not finding.severe)
    return (str(findings[0]), findings[0].severe) if findings else ("", False)


def table(outcomes: Sequence[Outcome]) -> Result:
    """A row for each kind and integrator, and the worst cases with the command for each."""
    rows: list[dict[str, Any]] = []
    groups = dict.fromkeys((o.kind, o.integrator) for o in outcomes)
    worst: list[str] = []
    for kind, integrator in groups:
        group = [o for o in outcomes if (o.kind, o.integrator) == (kind, integrator)]
        cases = {o.case for o in group}
        row: dict[str, Any] = {"systems": kind, "integrator": integrator}
        row["n"] = len(cases)
        row["sensitive"] = len({o.case for o in group if o.amplification > SENSITIVE})
        steady = [o for o in group if o.amplification <= SENSITIVE]
        for timestep in sorted({o.timestep for o in group}):
            row |= _cells([o for o in steady if o.timestep == timestep], timestep)
        rows.append(row)
        top = max((o for o in steady if not o.severe), key=lambda o: o.error, default=None)
        if top is not None:
            worst.append(
                f"worst of {kind}, {integrator}: {top.error:.3g} % at {1e3 * top.timestep:g} ms: "
                f"mjhill bench sweep --case {top.case}"
            )
    missed = [o for o in outcomes if is_missed(o)]
    notes = (
        f"largest error in {DURATION:g} s, median / 99 % / most: of the angle in % of its range, "
        "of tension in % of F_max where the movement is prescribed (stretch)",
        f"sensitive: a push of {100 * PUSH:g} % grows more than {SENSITIVE:g}-fold; left out",
        "floor: the same of the plant driven by the true torques, which is MuJoCo's own error; "
        "found: systems with a severe finding of check_model, left out of the errors",
        f"off by more than {MISSED:g} % and {FLOOR:g} times the floor, without a finding: "
        f"{len(missed)}"
        + "".join(f", {o.case} {o.integrator} {1e3 * o.timestep:g} ms" for o in missed[:10]),
        *worst,
    )
    return Result(f"Errors of random systems, MuJoCo {mujoco.__version__}", rows, notes)


def is_missed(outcome: Outcome) -> bool:
    """Whether the error of a free movement is above 5 % although there is no finding."""
    if outcome.floor is None or outcome.amplification > SENSITIVE or outcome.finding:
        return False
    return outcome.error > max(MISSED, FLOOR * outcome.floor)


def _cells(outcomes: list[Outcome], timestep: float) -> dict[str, str | int]:
    name = f"{1e3 * timestep:g} ms"
    sound = [o for o in outcomes if not o.severe]
    cells: dict[str, str | int] = {name: "", f"floor {name}": "", f"found {name}": ""}
    if sound:
        cells[name] = _spread([o.error for o in sound])
        floors = [o.floor for o in sound if o.floor is not None]
        cells[f"floor {name}"] = _spread(floors) if floors else ""
    cells[f"found {name}"] = len(outcomes) - len(sound)
    return cells


def _spread(errors: list[float]) -> str:
    """Median, 99 % quantile and largest."""
    shares = (0.5, 0.99, 1.0)
    return " / ".join(f"{np.quantile(errors, share, method='higher'):.2g}" for share in shares)
