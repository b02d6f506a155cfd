"""What commands print: tables, JSON, progress bars, the paths of files written."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

Progress = Callable[[float], None]

json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


@contextmanager
def progress_bar(what: str) -> Iterator[Progress]:
    """A bar on standard error, where that is a terminal; yields what moves it, from 0 to 1."""
    from rich.console import Console
    from rich.progress import Progress as Bars

    console = Console(stderr=True)
    console.quiet = not console.is_terminal  # rich before 14.3 prints a line where bars are off
    with Bars(console=console, transient=True, disable=not console.is_terminal) as bars:
        bar = bars.add_task(what, total=1.0)
        yield lambda share: bars.update(bar, completed=share)


def print_table(rows: list[dict[str, Any]], as_json: bool, title: str, across: bool = True) -> None:
    """Print rows of equal keys as a table or as JSON; not across: a line for each key."""
    if as_json:
        click.echo(json.dumps(rows, ensure_ascii=False))
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    if not across:
        rows = [{"quantity": key, "value": value} for row in rows for key, value in row.items()]
    table = Table(title=title, title_justify="left")
    for column in rows[0] if rows else []:
        table.add_column(escape(column))  # a unit such as [s] is no markup
    for row in rows:
        table.add_row(*(escape(shown(value)) for value in row.values()))
    # a pipe has no width of its own; rich would cut the sources at 80 columns
    Console(width=None if sys.stdout.isatty() else 160).print(table)


def shown(value: Any) -> str:
    """A value as a cell of a table: numbers to four digits, nothing for None."""
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def print_paths(files: dict[str, Path]) -> None:
    """Print the files written, by what they hold."""
    width = max(map(len, files))
    for name, path in files.items():
        click.echo(f"{name:<{width}}  {path}")
