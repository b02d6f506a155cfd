"""The ladder: models of muscle on the same joint in the same tasks, compared with ``hill``."""

from mjhill.ladder.table import Cell, ladder
from mjhill.ladder.tasks import RUNGS, TASKS, Task, rung

__all__ = ["RUNGS", "TASKS", "Cell", "Task", "ladder", "rung"]
