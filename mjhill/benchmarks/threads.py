"""``mujoco.batch`` with compiled muscles: how much faster two threads are."""

from __future__ import annotations

import statistics
import time

import mujoco
import mujoco.batch
import numpy as np

from mjhill.benchmarks.result import Result
from mjhill.engine.install import installed
from mjhill.simulate.load import load

SIMULATIONS, STEPS, ROUNDS = 256, 200, 21
GOAL = 1.7  # speed of two threads [one thread]


def measure() -> Result:
    """Muscle steps per second on one and two threads, medians of interleaved rounds."""
    model = load("elbow")
    threads = (1, 2)
    seconds: dict[int, list[float]] = {count: [] for count in threads}
    states = {}
    with installed():
        batches = {}
        for count in threads:
            batches[count] = mujoco.batch.Batch(model, nsim=SIMULATIONS, nthread=count)
            batches[count].ctrl = np.linspace(0, 1, 2 * SIMULATIONS).reshape(-1, 2)
        for _ in range(ROUNDS):
            for count, batch in batches.items():
                start = time.perf_counter()
                batch.step(nstep=STEPS)
                seconds[count].append(time.perf_counter() - start)
                states[count] = batch.state.copy()
    medians = {count: statistics.median(values) for count, values in seconds.items()}
    steps = SIMULATIONS * STEPS
    rows = []
    for count in threads:
        speed, same = medians[1] / medians[count], np.array_equal(states[1], states[count])
        rows.append(
            {
                "threads": count,
                "goal": f"≥ {GOAL:g} x one, same bits" if count > 1 else None,
                "million steps/s": steps / medians[count] / 1e6,
                "speed, 1 thread = 1": speed,
                "same bits as 1 thread": same,
                "met": speed >= GOAL and same if count > 1 else None,
            }
        )
    notes = (
        f"{SIMULATIONS} elbows x {STEPS} steps, {ROUNDS} rounds, interleaved, medians",
        "other work on this machine slows two threads more than one",
    )
    return Result("mujoco.batch on threads", rows, notes)
