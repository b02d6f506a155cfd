"""Parts run, several at once, each in a process of its own; what is finished is kept."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from mjhill import interrupts
from mjhill.report.catalogue import CATALOGUE, Entry, Part, every_part, select
from mjhill.report.fingerprint import fingerprint
from mjhill.report.process import Failure, Worker, start, uninterrupted
from mjhill.report.store import Store, is_finished

_INTERRUPTED = Failure("interrupted before it was done")


@dataclass
class Outcome:
    """What a run of the catalogue has come to.

    Attributes:
        folder: Where the files are.
        parts: Numbers of each part that is there, new or kept, in the order of the catalogue.
        missing: Parts that were asked for and are not there, with the reason.
        problems: What parts that are there lack, such as a film that could not be made.
        ran: Names of the parts that were run, the others having been there before.
        interrupted: Whether it was ended before all was done.
    """

    folder: Path
    parts: list[tuple[Part, dict[str, Any]]] = field(default_factory=list)
    missing: dict[Part, Failure] = field(default_factory=dict)
    problems: dict[Part, str] = field(default_factory=dict)
    ran: list[str] = field(default_factory=list)
    interrupted: bool = False

    @property
    def exit_code(self) -> int:
        """0 where all is there, 1 where something failed, 130 after an interruption."""
        if self.interrupted:
            return 130
        return 1 if self.missing or self.problems else 0


def reproduce(
    folder: str | Path,
    *,
    catalogue: Sequence[Entry] = CATALOGUE,
    only: Sequence[str] = (),
    joints: Sequence[str] = (),
    video: bool = True,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Outcome:
    """Run the paper's experiments, but for those whose numbers are in the folder already.

    A part that fails or an interruption leaves the others as they are; the outcome tells of it.

    Args:
        folder: Where to keep what each part gives; made where it is not there.
        catalogue: The experiments.
        only: Ids of those wanted; all without any.
        joints: Joints to make each on; each experiment's own without any.
        video: Whether to film what moves.
        fresh: Whether to run all again.
        jobs: How many to run at once; as many as there are cores, but no more than 4, without it.
        progress: Called with the share done, from 0 to 1.

    Raises:
        ValueError: There is no such experiment or joint, or ``jobs`` is not positive.
        OSError: The folder cannot be written.
    """
    wanted = select(catalogue, only, joints)
    jobs = min(4, os.cpu_count() or 1) if jobs is None else jobs
    if jobs < 1:
        raise ValueError(f"jobs must be at least 1, got {jobs}")
    store, outcome = Store(Path(folder).absolute()), Outcome(Path(folder))
    store.open()
    prints = _fingerprints(catalogue)
    waiting = []
    for part in wanted:
        word = prints[part.entry.id]
        if isinstance(word, Failure):
            outcome.missing[part] = word
        elif fresh or not is_finished(part, store.read(part, word), video=video):
            waiting.append(part)
    run = _Run(store, outcome, prints, video, jobs, progress or (lambda share: None))
    run.all(waiting, done=len(wanted) - len(waiting))
    # side by side they end in any order
    outcome.ran = [part.name for part in wanted if part.name in outcome.ran]
    outcome.missing = {p: outcome.missing[p] for p in wanted if p in outcome.missing}
    for part in every_part(catalogue):
        word = prints[part.entry.id]
        numbers = store.read(part, word) if isinstance(word, str) else None
        if numbers is None:
            continue
        if outcome.missing.get(part) is _INTERRUPTED:  # what was there before is as good
            outcome.problems[part] = outcome.missing.pop(part).reason
        if part not in outcome.missing:
            outcome.parts.append((part, numbers))
    return outcome


def _fingerprints(catalogue: Sequence[Entry]) -> dict[str, str | Failure]:
    """The fingerprint of each experiment, or why it has none."""
    prints: dict[str, str | Failure] = {}
    for entry in catalogue:
        try:
            prints[entry.id] = fingerprint(entry.module)
        except (ImportError, SyntaxError, OSError) as error:
            prints[entry.id] = Failure(f"{type(error).__name__}: {error}")
    return prints


@dataclass
class _Run:
    """The parts that wait, and the processes of those that do not."""

    store: Store
    outcome: Outcome
    prints: dict[str, Any]
    video: bool
    jobs: int
    progress: Callable[[float], None]
    running: dict[Part, tuple[Worker, ExitStack]] = field(default_factory=dict)

    def all(self, waiting: list[Part], done: int) -> None:
        """Run parts until none is left, or until an interruption."""
        queue, total = list(waiting), done + len(waiting)
        try:
            while queue or self.running:
                while queue and len(self.running) < self.jobs:
                    self._start(queue[0])
                    del queue[0]
                shares = [worker.share for worker, _ in self.running.values()]
                self.progress((total - len(queue) - len(shares) + sum(shares)) / total)
                self._listen()
            self.progress(1.0)
        except KeyboardInterrupt:
            interrupts.acknowledge()  # the report comes next
            self.outcome.interrupted = True
            self.outcome.missing |= dict.fromkeys([*self.running, *queue], _INTERRUPTED)
        finally:
            for worker, stack in self.running.values():
                worker.stop()
                stack.close()

    def _start(self, part: Part) -> None:
        with uninterrupted(), ExitStack() as stack:
            workplace = stack.enter_context(self.store.workplace(part))
            word = self.prints[part.entry.id]
            worker = start(part, workplace, fingerprint=word, video=self.video)
            self.running[part] = worker, stack.pop_all()

    def _listen(self) -> None:
        """Wait for news of any part, and take in those that have come to an end."""
        ready = wait([worker.connection for worker, _ in self.running.values()])
        for part, (worker, stack) in list(self.running.items()):
            if worker.connection not in ready:
                continue
            end = worker.listen()
            if end is None:
                continue
            with uninterrupted(), stack:
                if isinstance(end, Failure):
                    self.outcome.missing[part] = end
                else:
                    self.store.keep(part, worker.workplace)
                    self.outcome.ran.append(part.name)
                    if end.problem:
                        self.outcome.problems[part] = end.problem
                worker.stop()
                del self.running[part]
