"""Parts run, several at once, each in its own process; what is finished is kept.

A thread waits for each process. Not one pool of processes: a crash would break the pool and lose
the other parts, and Python before 3.14 cannot stop a pool's processes. Signals raise exceptions
only in the main thread, so none interrupts the start of a process or the move of its files.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from multiprocessing import connection, resource_tracker
from pathlib import Path
from types import FrameType
from typing import Any

from mjhill import interrupts
from mjhill.report.catalogue import CATALOGUE, Entry, Part, every_part, select
from mjhill.report.fingerprint import fingerprint
from mjhill.report.part import make
from mjhill.report.store import Store, is_finished

_PATIENCE = 3.0  # time that a process gets to end before it is killed [s]
_INTERVAL = 0.1  # between two looks at a process, and two reports of progress [s]


@dataclass(frozen=True)
class Failure:
    """Why a part could not be made.

    Attributes:
        reason: In one line.
        details: The traceback, where there is one.
    """

    reason: str
    details: str = ""


@dataclass(frozen=True)
class Success:
    """A part was made; ``problem`` says what it lacks, such as a film."""

    problem: str | None


_INTERRUPTED = Failure("interrupted before it was done")


@dataclass
class Outcome:
    """What a run of the catalogue gave.

    Attributes:
        folder: Where the files are.
        parts: Numbers of each part that is there, new or kept, in the order of the catalogue.
        missing: The requested parts that are not there, with the reason.
        problems: What parts that are there lack, such as a film that could not be made.
        ran: Names of the parts that were run; the others were there before.
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
        """0 if all is there, 1 if something failed, 130 after an interruption."""
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
    """Run the paper's experiments, except those whose numbers are in the folder already.

    If a part fails, or the run is interrupted, the other parts are kept, and the outcome says so.

    Args:
        folder: Where to keep the files of each part; it is made if it does not exist.
        catalogue: The experiments.
        only: Ids of the experiments to run; by default all.
        joints: Joints to run each experiment on; by default each experiment's own.
        video: Whether to film what moves.
        fresh: Whether to run again what is there already.
        jobs: How many to run at once; by default one for each core, but at most 4.
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
    hashes = _fingerprints(catalogue)

    def kept(part: Part) -> dict[str, Any] | None:
        word = hashes[part.entry.id]
        return None if isinstance(word, Failure) else store.read(part, word)

    ends: dict[Part, Success | Failure] = {}
    for part in wanted:
        word = hashes[part.entry.id]
        if isinstance(word, Failure):
            ends[part] = word
        elif fresh or not is_finished(part, kept(part), video=video):
            ends[part] = _INTERRUPTED  # until it ends otherwise
    waiting = [part for part, end in ends.items() if end is _INTERRUPTED]
    run = _Run(store, hashes, video, progress or (lambda share: None))
    outcome.interrupted = run.all(waiting, jobs, len(wanted), ends)
    for part, end in ends.items():
        if isinstance(end, Failure):
            outcome.missing[part] = end
        else:
            outcome.ran.append(part.name)
            if end.problem:
                outcome.problems[part] = end.problem
    for part in every_part(catalogue):
        numbers = kept(part)
        if numbers is None:
            continue
        if outcome.missing.get(part) is _INTERRUPTED:  # the older numbers are still valid
            outcome.problems[part] = outcome.missing.pop(part).reason
        if part not in outcome.missing:
            outcome.parts.append((part, numbers))
    return outcome


def _fingerprints(catalogue: Sequence[Entry]) -> dict[str, str | Failure]:
    """The fingerprint of each experiment, or why it has none."""
    hashes: dict[str, str | Failure] = {}
    for entry in catalogue:
        try:
            hashes[entry.id] = fingerprint(entry.module)
        except (ImportError, SyntaxError, OSError) as error:
            hashes[entry.id] = Failure(f"{type(error).__name__}: {error}")
    return hashes


@dataclass(frozen=True)
class _Run:
    """What the threads of one run share."""

    store: Store
    hashes: dict[str, Any]
    video: bool
    progress: Callable[[float], None]
    shares: dict[Part, float] = field(default_factory=dict)
    stopping: threading.Event = field(default_factory=threading.Event)

    def all(
        self, waiting: list[Part], jobs: int, total: int, ends: dict[Part, Success | Failure]
    ) -> bool:
        """Run parts, write how each one ended into ``ends``; gives whether it was interrupted."""
        interrupted = False
        futures: dict[Future[Success | Failure], Part] = {}
        resource_tracker.ensure_running()  # its start unblocks SIGINT; so not in a thread below
        # Ctrl-C reaches all processes of a terminal, but only this one answers it: a process
        # inherits the blocked signal from the thread that starts it
        threads = ThreadPoolExecutor(
            jobs, initializer=signal.pthread_sigmask, initargs=(signal.SIG_BLOCK, {signal.SIGINT})
        )
        try:
            for part in waiting:
                futures[threads.submit(self._make, part)] = part
            running = set(futures)
            while running:
                done = total - len(waiting) + sum(self.shares.values())
                self.progress(done / total)
                ended, running = wait(running, _INTERVAL, FIRST_COMPLETED)
                for future in ended:
                    future.result()  # raises what a full disk has raised there
            self.progress(1.0)
        except KeyboardInterrupt:
            interrupts.acknowledge()  # the report comes next
            interrupted = True
        finally:
            self.stopping.set()
            threads.shutdown(cancel_futures=True)
        for future, part in futures.items():
            if not future.cancelled():
                ends[part] = future.result()
        return interrupted

    def _make(self, part: Part) -> Success | Failure:
        """Make a part in a new process and keep its files."""
        if self.stopping.is_set():
            return _INTERRUPTED
        # a fork would take over the callbacks, threads and OpenGL of this process
        context = multiprocessing.get_context("spawn")
        with self.store.workplace(part) as workplace:
            reader, writer = context.Pipe(duplex=False)
            arguments = (writer, part, workplace, self.hashes[part.entry.id], self.video)
            process = context.Process(target=_work, args=arguments, name=part.name)
            with reader:
                try:
                    with writer:
                        process.start()
                    end = self._listen(part, process, reader)
                finally:
                    _end(process)
            if isinstance(end, Success):
                self.store.keep(part, workplace)
            self.shares[part] = 1.0
            return end

    def _listen(self, part: Part, process: Any, reader: connection.Connection) -> Success | Failure:
        """Take shares of the work from a process until it says how it ended."""
        try:
            while not self.stopping.is_set():
                if not reader.poll(_INTERVAL):
                    continue
                message: Success | Failure | float = reader.recv()
                if not isinstance(message, float):
                    process.join(_PATIENCE)
                    return message
                self.shares[part] = message
        except EOFError:
            process.join(_PATIENCE)
            return Failure(f"its process ended with {_named(process.exitcode)}")
        return _INTERRUPTED


def _end(process: Any) -> None:
    """End a process, by force if it does not end by itself."""
    if process.pid is None:  # it could not be started
        return
    process.terminate()
    process.join(_PATIENCE)
    process.kill()
    process.join()
    process.close()


def _named(code: int | None) -> str:
    if code is not None and code < 0:
        return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


def _work(
    writer: connection.Connection, part: Part, workplace: Path, word: str, video: bool
) -> None:
    """Make a part in this process; send shares of the work, then how it ended."""
    signal.signal(signal.SIGTERM, _leave)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent to answer
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=(parent, workplace), daemon=True).start()
    last = 0.0

    def progress(share: float) -> None:
        nonlocal last
        if time.monotonic() - last >= _INTERVAL:
            writer.send(float(share))
            last = time.monotonic()

    end: Success | Failure
    try:
        try:
            end = Success(make(part, workplace, fingerprint=word, video=video, progress=progress))
        except BrokenPipeError:
            raise
        except Exception as error:
            end = Failure(f"{type(error).__name__}: {error}", traceback.format_exc())
        writer.send(end)
    except BrokenPipeError:
        sys.exit(1)  # the parent was killed
    finally:
        if not parent.is_alive():
            shutil.rmtree(workplace, ignore_errors=True)


def _end_with(parent: Any, workplace: Path) -> None:
    """End this process, and remove what it has written, when its parent was killed."""
    connection.wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_PATIENCE)
    shutil.rmtree(workplace, ignore_errors=True)  # SIGTERM had no effect
    os._exit(1)


def _leave(number: int, frame: FrameType | None) -> None:
    """Leave through every ``finally``, so that encoders are ended too."""
    raise SystemExit(128 + number)
