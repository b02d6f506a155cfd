"""Ctrl-C, SIGTERM and SIGHUP as exceptions that end a command, and are never lost.

An exception that a signal raises is lost where Python cannot pass it on: in a callback from C, in
``__del__``, in the clean-up of an import. So what has arrived is kept here, and long work asks
for it with ``check``: where it reports progress, and before a file gets its final name.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_arrived: list[int] = []


@contextmanager
def handled() -> Iterator[None]:
    """Let the signals end this process through every ``finally``.

    Signals that this process ignores, as under ``nohup``, stay ignored. Does nothing outside of
    the main thread, where Python allows no handlers.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _arrived.clear()
    before = {
        number: signal.signal(number, _raise)
        for number in _ENDING
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _arrived.clear()


def check() -> None:
    """Raise what a signal has asked for, where its exception was lost.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
        SystemExit: Another signal arrived; its code is 128 and the signal's number.
    """
    if _arrived:
        _end(_arrived[0])


def acknowledge() -> None:
    """Go on after an interrupt that was dealt with."""
    _arrived.clear()


def _raise(number: int, frame: FrameType | None) -> None:
    del frame
    _arrived.append(number)
    _end(number)


def _end(number: int) -> NoReturn:
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    raise SystemExit(128 + number)
