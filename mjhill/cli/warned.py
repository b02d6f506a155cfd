"""Warnings of commands: one line each on standard error, without the place in the code."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click


@contextmanager
def one_line_warnings() -> Iterator[None]:
    """Print warnings as ``warning: MESSAGE``; filters stay as they are."""
    with warnings.catch_warnings():
        warnings.showwarning = _show
        yield


def _show(message: Warning | str, *_place: Any, **_options: Any) -> None:
    line = " ".join(str(message).split())
    text = line if line.isprintable() else ascii(line)[1:-1]
    click.echo(f"warning: {text}", err=True)
