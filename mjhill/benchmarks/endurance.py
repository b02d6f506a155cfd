"""A long run in ``mujoco.batch``: constant memory, no warnings, no effect of the start in the end.

The two elbows of a pair get the same random excitations. One starts in steady state, the other at
another angle with slack muscles, as after ``mj_resetData``. For each excitation the elbow has one
stable equilibrium, so the two approach each other exponentially. Because of rounding they are
equal bit for bit after some step.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import mujoco.batch
import numpy as np
from numpy.typing import NDArray

from mjhill.benchmarks.result import Result
from mjhill.engine.equilibrium import equilibrate
from mjhill.engine.install import installed
from mjhill.engine.spec import joint_spec
from mjhill.joints.reader import JOINTS

COUNT = 100_000_000  # steps of all elbows together
PAIRS = 32
GROWTH = 8.0  # [MiB] by which memory may grow after the first tenth of a run
SHARES = {"implicitfast": 0.9, "RK4": 0.1}  # of the steps
HOLD = 100  # steps between two changes of the excitations
SAMPLES = 50  # measurements of memory in a run

Progress = Callable[[float], None]


def measure(count: int | None = None, progress: Progress | None = None) -> Result:
    """A row for each integrator: memory, warnings, and the difference between the two starts.

    Args:
        count: Steps of all elbows together.
        progress: Called with the share done, from 0 to 1.

    Raises:
        RuntimeError: MuJoCo warned in a run.
    """
    rows, done = [], 0.0
    for integrator, share in SHARES.items():

        def report(part: float, before: float = done, share: float = share) -> None:
            if progress is not None:
                progress(before + share * part)

        rows.append(endure(integrator, round(share * (count or COUNT)), PAIRS, report))
        done += share
    notes = (
        f"{2 * PAIRS} elbows of two muscles, excitations that change every {HOLD} steps; of each "
        "two one starts in steady state, the other elsewhere with slack muscles",
        f"growth: of resident memory after the first tenth; goal: at most {GROWTH:g} MiB",
        "same bits: the step after which both of every pair are equal bit for bit; apart: the "
        "largest difference of a position, velocity or muscle state at the end",
    )
    return Result(f"A long run, MuJoCo {mujoco.__version__}", rows, notes)


def endure(
    integrator: str, count: int, pairs: int = PAIRS, progress: Progress | None = None
) -> dict[str, Any]:
    """Run pairs of elbows.

    Args:
        integrator: Its name in MJCF.
        count: Steps of all elbows together.
        pairs: Pairs of elbows.
        progress: Called with the share done, from 0 to 1.

    Raises:
        RuntimeError: MuJoCo warned.
    """
    changes = max(count // (2 * pairs * HOLD), SAMPLES)
    started, memory = time.perf_counter(), []
    same: int | None = None
    with installed():
        batch = _batch(integrator, pairs)
        for change in range(changes):
            batch.ctrl = np.repeat(_excitations(change, pairs), 2, axis=0)
            batch.step(nstep=HOLD)
            if not np.array_equal(batch.state[::2], batch.state[1::2]):
                same = None
            elif same is None:
                same = (change + 1) * HOLD
            if (change + 1) % (changes // SAMPLES) == 0:
                _check(batch, change)
                memory.append(_resident())
                if progress is not None:
                    progress((change + 1) / changes)
    physics = np.hstack([batch.bind(name) for name in ("qpos", "qvel", "act")])
    return {
        "integrator": integrator,
        "million steps": 2 * pairs * changes * HOLD / 1e6,
        "minutes": (time.perf_counter() - started) / 60,
        "memory [MiB]": memory[-1],
        "growth [MiB]": max(memory[len(memory) // 10 :]) - memory[len(memory) // 10],
        "warnings": int(_counts(batch).sum()),
        "same bits from step": same,
        "apart": float(np.abs(physics[::2] - physics[1::2]).max()),
    }


def _batch(integrator: str, pairs: int) -> Any:
    """Elbows: one of each pair in steady state at home, the other slack at another angle."""
    joint = JOINTS["elbow"]
    model = joint_spec(joint).compile()
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    batch = mujoco.batch.Batch(model, nsim=2 * pairs)
    data = mujoco.MjData(model)
    data.qpos[:] = joint.home_angle
    data.ctrl[:] = _excitations(0, pairs)[0]
    equilibrate(model, data)
    batch.bind("qpos")[::2], batch.bind("act")[::2] = data.qpos, data.act
    batch.bind("qpos")[1::2] = np.linspace(*joint.range, pairs)[:, None]
    return batch


def _excitations(change: int, pairs: int) -> NDArray[np.float64]:
    """Excitations of the two muscles of each pair, a third of them 0, shape (pairs, 2)."""
    random = np.random.default_rng([19870, change])
    excitations: NDArray[np.float64] = random.uniform(-0.5, 1.0, (pairs, 2))
    return np.maximum(excitations, 0.0)


def _counts(batch: Any) -> NDArray[np.int_]:
    """Number of warnings of each kind, shape (kinds,)."""
    counts: NDArray[np.int_] = batch.warning[:, :, 1].sum(axis=0)  # beside the last one's index
    return counts


def _check(batch: Any, change: int) -> None:
    counts = _counts(batch)
    if counts.any():
        name = mujoco.mjtWarning(int(np.argmax(counts > 0))).name[2:]
        raise RuntimeError(f"MuJoCo warned {name} within {(change + 1) * HOLD} steps")


def _resident() -> float:
    """Resident memory of this process [MiB]; its peak on systems without /proc."""
    pages = Path("/proc/self/statm")
    if pages.exists():
        return int(pages.read_text(encoding="ascii").split()[1]) * resource.getpagesize() / 2**20
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10
