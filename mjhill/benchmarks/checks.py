"""``check_model`` on sound and unsound models: its false alarms and its misses.

The runs of a model decide, not the check. Sound: no run does what a muscle cannot do, and
positions are within ``RIGHT`` of those with a timestep eight times shorter. Unsound: a run does
what no muscle can do, or differs by more than ``WRONG`` from a converged one. Models that are
neither are left out.
"""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from typing import Any
from zlib import crc32

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.benchmarks.fuzz.draws import Random, log_uniform
from mjhill.benchmarks.fuzz.outcomes import impossible
from mjhill.benchmarks.result import Result
from mjhill.benchmarks.sweep import cases
from mjhill.benchmarks.sweep.cases import GRID, Case
from mjhill.benchmarks.sweep.solutions import at_start, inputs_of, run, use
from mjhill.engine.checks import check_model
from mjhill.engine.install import installed
from mjhill.engine.layout import muscle_names, read_muscle, write_muscle
from mjhill.lab.batch import quiet
from mjhill.muscles import hill_of
from mjhill.simulate.signals import as_signal, pulse

COUNT = 1000  # sound models, and unsound ones
RIGHT, WRONG = 0.05, 0.2  # of the range of movement
INTEGRATORS = ("euler", "implicitfast", "implicit", "discrete", "RK4")
KINDS = ("sound", "step", "stiff", "sign")  # the last three unsound
MEANINGS = {
    "sound": "limbs with muscles in the ranges of people, at 0.5 to 5 ms",
    "step": "the same with inertias to 1000 times smaller, at 1 to 10 ms",
    "stiff": "the same, the series elements of its muscles 10 to 10,000 times shorter",
    "sign": "muscles on spatial tendons with a negative gear",
}
_TIMESTEPS = (0.5e-3, 1e-3, 2e-3, 5e-3, 10e-3)  # [s], each divides the grid of the inputs
_BASES = ("physiological", "slide", "several", "spatial")
_BATCH = 8  # models that a process runs at a time

_Values = NDArray[np.float64]
Progress = Callable[[float], None]


@dataclass(frozen=True)
class Verdict:
    """One model: the verdict of its runs, and the findings of ``check_model``.

    Attributes:
        case: Kind and number, as ``step:17``.
        base: The case of the sweep that it was made from.
        integrator: Its name in MJCF.
        timestep: [s].
        sound: The verdict of the runs; None if there is none.
        reason: Why it is not sound.
        findings: Those of ``check_model``, the severe first.
        severe: Whether there is a severe one.
    """

    case: str
    base: str
    integrator: str
    timestep: float
    sound: bool | None
    reason: str
    findings: tuple[str, ...]
    severe: bool


def measure(
    count: int | None = None, case: str | None = None, progress: Progress | None = None
) -> Result:
    """Table of false alarms and misses.

    Args:
        count: Sound models, and unsound models.
        case: One model instead, such as ``step:17``.
        progress: Called with the share done, from 0 to 1.

    Raises:
        ValueError: A case is unknown.
    """
    if case is not None:
        kind, _, number = case.partition(":")
        if kind not in KINDS or not number.isdecimal():
            raise ValueError(
                f"a case is named KIND:NUMBER with a kind of {', '.join(KINDS)}, got {case!r}"
            )
        with installed(), quiet():
            verdict = judge(kind, int(number))
        row = asdict(verdict) | {"findings": "; ".join(verdict.findings)}
        return Result(f"{case}: {_word(verdict)}", [row])
    return table(sides(count or COUNT, progress=progress))


def sides(
    count: int = COUNT, processes: int | None = None, progress: Progress | None = None
) -> list[Verdict]:
    """``count`` sound models and as many unsound ones, a third of each kind.

    Args:
        count: Sound models, and unsound models.
        processes: How many processes; by default one for each core. 1 means this process.
        progress: Called with the share done, from 0 to 1.
    """
    wanted = {"sound": count} | {
        kind: (count + extra) // 3 for extra, kind in enumerate(("step", "stiff", "sign"))
    }
    with installed():  # compiles once, before the processes start
        if processes == 1:
            return list(_gathered(wanted, lambda jobs: map(_judged, jobs), progress))
    with (
        tempfile.TemporaryDirectory() as folder,  # MuJoCo writes a log to the working folder
        ProcessPoolExecutor(processes, initializer=os.chdir, initargs=(folder,)) as pool,
    ):
        return list(_gathered(wanted, lambda jobs: pool.map(_judged, jobs), progress))


def _gathered(
    wanted: dict[str, int], judged: Callable[..., Any], progress: Progress | None
) -> Iterator[Verdict]:
    """Models of each kind in the order of their numbers, until enough have a verdict."""
    total, done = sum(wanted.values()), 0
    for kind, number in wanted.items():
        first, left = 0, number
        while left:
            size = min(max(2 * left // _BATCH, 2), 16)
            jobs = [(kind, first + k * _BATCH, _BATCH) for k in range(size)]
            first += size * _BATCH
            for verdict in (v for found in judged(jobs) for v in found):
                if left and verdict.sound is (kind == "sound"):
                    yield verdict
                    left, done = left - 1, done + 1
                    if progress is not None:
                        progress(done / total)


def _judged(job: tuple[str, int, int]) -> list[Verdict]:
    kind, first, count = job
    with installed(), quiet():
        return [judge(kind, first + k) for k in range(count)]


def judge(kind: str, number: int) -> Verdict:
    """Draw a model, run it and check it. Callbacks must be installed."""
    random = np.random.default_rng([crc32(f"checks {kind}".encode()), number])
    base = "spatial" if kind == "sign" else str(random.choice(_BASES))
    case = cases.draw(base, int(random.integers(1_000_000)))
    steps = _TIMESTEPS[1:] if kind == "step" else _TIMESTEPS[:4]
    timestep, integrator = float(random.choice(steps)), str(random.choice(INTEGRATORS))
    _spoil(kind, random, case)
    use(case.model, integrator, timestep)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        found = sorted(check_model(case.model), key=lambda finding: not finding.severe)
    sound, reason = (
        (False, "pushes") if kind == "sign" else _verdict_of_runs(case, integrator, timestep)
    )
    return Verdict(
        f"{kind}:{number}", case.name, integrator, timestep, sound, reason,
        tuple(map(str, found)), any(finding.severe for finding in found),
    )  # fmt: skip


def _spoil(kind: str, random: Random, case: Case) -> None:
    """Change a model so that it is unsound, or may be."""
    model = case.model
    if kind == "step":
        share = log_uniform(random, 1e-3, 1)
        model.body_mass *= share
        model.body_inertia *= share
        mujoco.mj_setConst(model, mujoco.MjData(model))
    elif kind == "stiff":
        for name in muscle_names(model):
            muscle = hill_of(read_muscle(model, name))
            stretch = muscle.series_stretch * log_uniform(random, 1e-4, 0.1)
            write_muscle(model, name, replace(muscle, series_stretch=stretch))
    elif kind == "sign":
        outs = model.actuator_outadr
        backwards = outs[random.random(model.nu) < 0.5]
        if not len(backwards):
            backwards = outs[:1]
        model.actuator_gear[backwards, 0] *= -1.0


def _verdict_of_runs(case: Case, integrator: str, timestep: float) -> tuple[bool | None, str]:
    """The verdict of a model's runs, None if there is none, and the reason."""
    clear = True
    for driven in _inputs(case):
        coarse, strange = _watched(driven, integrator, timestep)
        if strange:
            return False, ", ".join(strange)
        fine = _finer(driven, integrator, timestep, 8)
        span = float(np.ptp(fine, axis=0).max())
        off = _distance(coarse, fine) / span
        if off <= RIGHT:
            continue
        clear = False
        if off > WRONG:
            converged = (_finer(driven, integrator, timestep, finer) for finer in (16, 32))
            if _distance(*converged) < 0.25 * RIGHT * span:
                return False, f"off by {100 * off:.0f} %"
    return (True, "") if clear else (None, "unclear")


def _inputs(case: Case) -> Iterator[Case]:
    """The case itself, and the case with all muscles at full excitation, also while pushed."""
    yield case
    full = pulse(1.0, 0.05, 10.0)
    yield replace(case, excitation={name: full for name in case.excitation}, tonic=_none(case))
    if case.torque:
        [(joint, torque), *_] = case.torque.items()
        size = max(abs(torque(GRID * k + 1e-6)) for k in range(60))
        push = as_signal(0.0) + pulse(size, 0.3, 0.02)
        full_all = {name: as_signal(1.0) for name in case.excitation}
        tonic = {name: 1.0 for name in case.tonic}
        yield replace(case, excitation=full_all, tonic=tonic, torque={joint: push})


def _none(case: Case) -> dict[str, float]:
    return {name: 0.0 for name in case.tonic}


def _watched(case: Case, integrator: str, timestep: float) -> tuple[_Values, tuple[str, ...]]:
    """Positions at each step, and what the run does although no muscle can."""
    model = case.model
    use(model, integrator, timestep)
    data, inputs = at_start(case), inputs_of(case, timestep)
    positions, tension = [data.qpos.copy()], []
    states = np.empty((len(inputs), model.nv + model.na))
    for step, (ctrl, torque) in enumerate(zip(*np.split(inputs, [model.nu], 1), strict=True)):
        data.ctrl[:], data.qfrc_applied[:] = ctrl, torque
        mujoco.mj_step(model, data)
        states[step, : model.nv], states[step, model.nv :] = data.qvel, data.act
        positions.append(data.qpos.copy())
        tension.append(-data.actuator_force)
    return np.array(positions), impossible(model, states, np.array(tension), data.warning.number)


def _finer(case: Case, integrator: str, timestep: float, finer: int) -> _Values:
    """Positions at multiples of the timestep, of a run with steps ``finer`` times shorter."""
    return run(case, integrator, timestep / finer, every=finer)


def _distance(first: _Values, second: _Values) -> float:
    worst = float(np.abs(first - second).max())
    return worst if np.isfinite(worst) else float("inf")


def _word(verdict: Verdict) -> str:
    if verdict.sound is None:
        return "neither sound nor unsound"
    if verdict.sound:
        return "sound" + (", a false alarm" if verdict.severe else "")
    return "unsound" + ("" if verdict.severe else ", missed")


def table(verdicts: list[Verdict]) -> Result:
    """A row for each kind, and the command for each false alarm and each miss."""
    rows: list[dict[str, Any]] = []
    for kind in KINDS:
        group = [v for v in verdicts if v.case.startswith(f"{kind}:")]
        found = sum(bool(v.findings) for v in group)
        severe = sum(v.severe for v in group)
        rows.append(
            {"models": kind, "n": len(group), "severe finding": severe, "any finding": found,
             "any [%]": 100 * found / max(len(group), 1), "what": MEANINGS[kind]}
        )  # fmt: skip
    sound = [v for v in verdicts if v.sound]
    unsound = [v for v in verdicts if v.sound is False]
    alarms = [v for v in sound if v.severe]
    missed = [v for v in unsound if not v.severe]
    notes = (
        f"sound: right to {100 * RIGHT:g} % of the movement under three inputs, one of them full "
        f"force; unsound: error above {100 * WRONG:g} %, or a run that does what no muscle can",
        f"severe findings, of which check_model warns: {len(alarms)} of {len(sound)} sound models "
        f"have one (goal: 1 %), {len(missed)} of {len(unsound)} unsound ones have none (goal: 1 %)",
        f"with milder ones, 'may be off by 5 %': {sum(bool(v.findings) for v in sound)} of "
        f"{len(sound)} sound models, all but {sum(not v.findings for v in unsound)} of "
        f"{len(unsound)} unsound ones",
        *(f"false alarm, {v.findings[0]}: mjhill bench checks --case {v.case}" for v in alarms),
        *(f"missed, {v.reason}: mjhill bench checks --case {v.case}" for v in missed),
    )
    return Result(f"Sound and unsound models, MuJoCo {mujoco.__version__}", rows, notes)
