"""A process that makes one part, so that not even a crash takes the others with it."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import FrameType
from typing import Any

from mjhill.report.catalogue import Part
from mjhill.report.part import make

_PATIENCE = 3.0  # with a process that is to end [s]
_NEWS = 0.1  # least time between two messages [s]


@dataclass(frozen=True)
class Failure:
    """Why a part is not there.

    Attributes:
        reason: In one line.
        details: Where it happened, for who mends it.
    """

    reason: str
    details: str = ""


@dataclass(frozen=True)
class Success:
    """A part is there; ``problem`` says what it lacks."""

    problem: str | None


@dataclass
class Worker:
    """A process at work.

    Attributes:
        process: The process.
        connection: What it speaks through: shares of the work, then how it ended.
        workplace: Folder that it writes to.
        share: What it has done of the work [-].
        ended: Whether it has said how it ended.
    """

    process: Any
    connection: Connection
    workplace: Path
    share: float = 0.0
    ended: bool = False

    def listen(self) -> Success | Failure | None:
        """Take one message: the end of the work, or None while it goes on."""
        try:
            message = self.connection.recv()
        except EOFError:
            self.process.join(_PATIENCE)
            return Failure(f"its process ended with {_ending(self.process.exitcode)}")
        if isinstance(message, float):
            self.share = message
            return None
        self.ended = True
        end: Success | Failure = message
        return end

    def stop(self) -> None:
        """End the process, by force where it is still at work."""
        self.connection.close()
        if not self.ended:
            self.process.terminate()
        self.process.join(_PATIENCE)
        self.process.kill()
        self.process.join()
        self.process.close()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Keep Ctrl-C and SIGTERM waiting, and Ctrl-C from the processes that are started meanwhile.

    Ctrl-C reaches every process of a terminal, and what is to end is for one of them to say.
    """
    waiting: list[int] = []
    resource_tracker.ensure_running()  # its start, by the first process, would lift the mask again
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # those started inherit it
    # a blocked signal goes to another thread, such as one of a numerical library, and would be
    # raised here all the same
    handled = threading.current_thread() is threading.main_thread()
    before = {
        number: signal.signal(number, lambda arrived, _: waiting.append(arrived))
        for number in (signal.SIGINT, signal.SIGTERM)
        if handled
    }
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in before.items():
            signal.signal(number, handler)
        for arrived in waiting[:1]:
            signal.raise_signal(arrived)


def start(part: Part, workplace: Path, *, fingerprint: str, video: bool) -> Worker:
    """A new process that makes a part; to be called ``uninterrupted``."""
    # a fork would take over the callbacks, threads and OpenGL of this process
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(
        target=_work, args=(part, workplace, fingerprint, video, theirs), name=part.name
    )
    try:
        process.start()
    finally:
        theirs.close()
    return Worker(process, ours, workplace)


def _work(
    part: Part, workplace: Path, fingerprint: str, video: bool, connection: Connection
) -> None:
    signal.signal(signal.SIGTERM, _leave)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent to answer
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=(parent, workplace), daemon=True).start()
    last = 0.0

    def progress(share: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _NEWS or share >= 1.0:
            connection.send(float(share))  # fails where the other side is gone, and so ends this
            last = now

    end: Success | Failure
    try:
        try:
            end = Success(
                make(part, workplace, fingerprint=fingerprint, video=video, progress=progress)
            )
        except BrokenPipeError:
            raise
        except Exception as error:
            end = Failure(f"{type(error).__name__}: {error}", traceback.format_exc())
        connection.send(end)
    except BrokenPipeError:
        sys.exit(1)  # nobody listens any more
    finally:
        if not parent.is_alive():
            shutil.rmtree(workplace, ignore_errors=True)


def _end_with(parent: Any, workplace: Path) -> None:
    """End this process, and remove what it has written, when its parent has been killed."""
    wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_PATIENCE)
    shutil.rmtree(workplace, ignore_errors=True)  # it did not listen
    os._exit(1)


def _leave(number: int, frame: FrameType | None) -> None:
    """Leave through every ``finally``, so that encoders are ended too."""
    raise SystemExit(128 + number)


def _ending(code: int | None) -> str:
    if code is not None and code < 0:
        return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"
