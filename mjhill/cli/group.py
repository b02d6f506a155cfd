"""The group of commands: error messages and exit codes.

Exit codes: 0 done, 1 the machine or the run failed, 2 the input was wrong, 130 Ctrl-C,
141 the reader of the output has ended, 143 SIGTERM.
"""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

import click

from mjhill import interrupts
from mjhill.cli.printing import make_printable, plain


class Group(click.Group):
    """Turns errors into one line and an exit code."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Run the command of the arguments; ends in SystemExit."""
        _open_standard_streams()
        make_printable(sys.stdout, sys.stderr)
        with interrupts.handled(), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            return super().main(*args, **options)

    def make_context(self, *args: Any, **options: Any) -> click.Context:
        """Read the arguments; prints --help."""
        with _reported():
            return super().make_context(*args, **options)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command of a context."""
        with _reported():
            return super().invoke(ctx)


@contextmanager
def _reported() -> Iterator[None]:
    """Print an error in one line, and end with its exit code."""
    try:
        try:
            yield
            sys.stdout.flush()  # raises if the disk is full or the pipe is closed
        finally:
            interrupts.check()  # an interrupt is the cause of any other error
    except (click.ClickException, click.exceptions.Exit, click.exceptions.Abort):
        raise  # click's own endings; the last two are RuntimeErrors
    except KeyboardInterrupt:
        # After an interrupt in code made from text, such as a dataclass, Python would kill
        # itself at exit; running other such code prevents it
        exec("")
        _end("interrupted", code=128 + signal.SIGINT)
    except BrokenPipeError:
        _leave_stdout()
        sys.exit(128 + signal.SIGPIPE)
    except MemoryError as error:
        _end(f"error: out of memory; try a shorter run ({error})", code=1)
    except (ValueError, TypeError, KeyError) as error:
        _end(f"error: {error.args[0] if isinstance(error, KeyError) else error}", code=2)
    except (RuntimeError, OSError) as error:
        if isinstance(error, OSError):
            _leave_stdout()  # standard output may be what could not be written
        _end(f"error: {error}", code=1)


def _end(message: str, code: int) -> NoReturn:
    with suppress(OSError):
        click.echo(plain(message), err=True)
    sys.exit(code)


def _leave_stdout() -> None:
    """Discard the rest of standard output; Python would complain at exit."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _open_standard_streams() -> None:
    """Open closed standard streams; otherwise the first file written would become the output."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: Any = None,
    line: str | None = None,
) -> None:
    del category, filename, lineno, file, line
    click.echo(f"warning: {plain(str(message))}", err=True)
