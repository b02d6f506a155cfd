"""A long run through ``mujoco.batch``: memory stays flat, nothing warns, the start is forgotten.

Elbows in pairs get the same random inputs. One of a pair starts steady, the other at another
angle as ``mj_resetData`` leaves it, its muscles slack. The elbow has one place of rest for each
input and its states follow stable equations, so the two come together exponentially; rounding
ends it: from some step on they are the same bits.
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
HOLD = 100  # steps between changes of the inputs
SAMPLES = 50  # times that memory is looked at

Progress = Callable[[float], None]


def measure(count: int | None = None, progress: Progress | None = None) -> Result:
    """A row for each integrator: memory, warnings, and what became of the two starts.

    Args:
        count: Steps of all elbows together.
        progress: Called now and then with the share done, 0 to 1.

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
        f"{2 * PAIRS} elbows of two muscles, inputs that change every {HOLD} steps; of each two "
        "one starts steady, the other elsewhere with slack muscles",
        f"growth: of resident memory after the first tenth; goal: at most {GROWTH:g} MiB",
        "same bits: the step from which both of every pair have the same bits; apart: the largest "
        "difference of a position, velocity or muscle state at the end",
    )
    return Result(f"A long run, MuJoCo {mujoco.__version__}", rows, notes)


def endure(
    integrator: str, count: int, pairs: int = PAIRS, progress: Progress | None = None
) -> dict[str, Any]:
    """Run pairs of elbows for a number of steps in all.

    Args:
        integrator: Its name in MJCF.
        count: Steps of all elbows together.
        pairs: Pairs of elbows.
        progress: Called now and then with the share done, 0 to 1.

    Raises:
        RuntimeError: MuJoCo warned.
    """
    changes = max(count // (2 * pairs * HOLD), SAMPLES)
    started, memory = time.perf_counter(), []
    same: int | None = None
    with installed():
        batch = _batch(integrator, pairs)
        for change in range(changes):
            batch.ctrl = np.repeat(_inputs(change, pairs), 2, axis=0)
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
    """Elbows, every second one steady at its home angle, the others slack at other angles."""
    joint = JOINTS["elbow"]
    model = joint_spec(joint).compile()
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    batch = mujoco.batch.Batch(model, nsim=2 * pairs)
    data = mujoco.MjData(model)
    data.qpos[:] = joint.home_angle
    data.ctrl[:] = _inputs(0, pairs)[0]
    equilibrate(model, data)
    batch.bind("qpos")[::2], batch.bind("act")[::2] = data.qpos, data.act
    batch.bind("qpos")[1::2] = np.linspace(*joint.range, pairs)[:, None]
    return batch


def _inputs(change: int, pairs: int) -> NDArray[np.float64]:
    """Inputs of the two muscles of each pair, a third of them 0, shape (pairs, 2)."""
    random = np.random.default_rng([19870, change])
    levels: NDArray[np.float64] = random.uniform(-0.5, 1.0, (pairs, 2))
    return np.maximum(levels, 0.0)


def _counts(batch: Any) -> NDArray[np.int_]:
    """How often each warning was given, shape (warnings,)."""
    counts: NDArray[np.int_] = batch.warning[:, :, 1].sum(axis=0)  # beside the last one's index
    return counts


def _check(batch: Any, change: int) -> None:
    counts = _counts(batch)
    if counts.any():
        name = mujoco.mjtWarning(int(np.argmax(counts > 0))).name[2:]
        raise RuntimeError(f"MuJoCo warned {name} within {(change + 1) * HOLD} steps")


def _resident() -> float:
    """Resident memory of this process [MiB]; its peak where the system does not tell it."""
    pages = Path("/proc/self/statm")
    if pages.exists():
        return int(pages.read_text(encoding="ascii").split()[1]) * resource.getpagesize() / 2**20
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10
