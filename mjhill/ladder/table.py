"""The table of the ladder: the error of each rung in each task."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mjhill.joints.joint import Joint
from mjhill.lab.rig import UnmeasuredError, as_joint
from mjhill.ladder.tasks import RUNGS, TASKS, rung


@dataclass(frozen=True)
class Cell:
    """One rung in one task.

    Attributes:
        joint: Name of the joint.
        model: The rung.
        task: The task.
        error: R.m.s. difference to ``hill`` [% of the task's range under ``hill``], or None.
        cannot: Why there is no error; empty where there is one.
    """

    joint: str
    model: str
    task: str
    error: float | None
    cannot: str = ""

    def as_dict(self) -> dict[str, Any]:
        """All values, ready for JSON."""
        return asdict(self)


def ladder(
    joint: str | Joint, *, models: Sequence[str] = RUNGS, tasks: Sequence[str] = tuple(TASKS)
) -> Iterator[Cell]:
    """Every rung in every task on one joint; the inputs are the same for all.

    Raises:
        ValueError: A joint, a model or a task is unknown.
    """
    base = as_joint(joint)
    for what, names, known in (("model", models, RUNGS), ("task", tasks, tuple(TASKS))):
        for name in names:
            if name not in known:
                raise ValueError(f"unknown {what} {name!r}; there are: {', '.join(known)}")
    for task in tasks:
        truth = TASKS[task].run(base, base)
        for model in models:
            try:
                found = TASKS[task].run(rung(model, base), base)
            except UnmeasuredError as error:
                yield Cell(base.name, model, task, None, str(error))
                continue
            if not np.isfinite(found).all():
                yield Cell(base.name, model, task, None, "the run did not stay finite")
                continue
            off = np.sqrt(np.mean((found - truth) ** 2)) / np.ptp(truth)
            yield Cell(base.name, model, task, 100 * float(off))
