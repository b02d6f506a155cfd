"""Printing of tables, JSON, progress bars and paths.

Names in models and files may contain anything. The terminal gets no control characters and no
markup, and only characters of its encoding.
"""

from __future__ import annotations

import codecs
import io
import json
import re
import sys
import unicodedata
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from mjhill import interrupts

Progress = Callable[[float], None]

json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")

_ERRORS = "mjhill.plain"
# control and format characters, which move the cursor, colour or reverse text; lone surrogates
_HIDDEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
_IN_JSON = re.compile("[\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]")
_ASCII = {
    "·": ".", "²": "^2", "³": "^3", "°": "deg", "µ": "u", "…": "...", "“": '"', "”": '"',
    "≤": "<=", "≥": ">=",
    "\N{MULTIPLICATION SIGN}": "x",
    "\N{MINUS SIGN}": "-",
    "\N{EN DASH}": "-",
    "\N{EM DASH}": "-",
    "\N{RIGHT SINGLE QUOTATION MARK}": "'",
}  # fmt: skip


@contextmanager
def progress_bar(what: str) -> Iterator[Progress]:
    """A bar on standard error, if that is a terminal; yields a function of the share, 0 to 1."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as Bars

    console = Console(stderr=True, emoji=False)
    console.quiet = not console.is_terminal  # rich before 14.3 prints a line even without bars
    with Bars(console=console, transient=True, disable=not console.is_terminal) as bars:
        bar = bars.add_task(escape(plain(what)), total=1.0)

        def move(share: float) -> None:
            interrupts.check()
            bars.update(bar, completed=share)

        yield move


def print_table(rows: list[dict[str, Any]], as_json: bool, title: str, across: bool = True) -> None:
    """Print rows with equal keys as a table or as JSON; not ``across``: a line for each key."""
    if as_json:
        print_json(rows)
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    if not across:
        rows = [{"quantity": key, "value": value} for row in rows for key, value in row.items()]
    # Text: neither [s] nor :x: is markup
    table = Table(title=Text(_encodable(title), style="table.title"), title_justify="left")
    for column in rows[0] if rows else []:
        table.add_column(Text(_encodable(column)))
    for row in rows:
        table.add_row(*(Text(_encodable(shown(value))) for value in row.values()))
    # a pipe has no width; rich would cut at 80 columns
    console = Console(width=None if sys.stdout.isatty() else 160)
    with console.capture() as printed:  # rich would end the process if the pipe is closed
        console.print(table)
    sys.stdout.write(printed.get())
    sys.stdout.flush()


def print_json(value: Any) -> None:
    """Print a value as JSON in one line, without characters that terminals interpret."""
    ascii_only = not (sys.stdout.encoding or "").lower().startswith("utf")
    text = json.dumps(value, ensure_ascii=ascii_only)
    click.echo(_IN_JSON.sub(lambda found: f"\\u{ord(found[0]):04x}", text))


def print_line(text: str, *, err: bool = False) -> None:
    """Print one line of text."""
    click.echo(plain(text), err=err)


def print_paths(files: dict[str, Path], replaced: Collection[Path] = ()) -> None:
    """Print the paths of written files by their content, and which of them replaced others."""
    width = max(map(len, files))
    for name, path in files.items():
        print_line(f"{name:<{width}}  {path}{' (replaced)' if path in replaced else ''}")


def shown(value: Any) -> str:
    """A value as text for a table: four digits, yes or no, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def plain(text: str) -> str:
    """Text on one line, with control characters as escapes: ``\\x1b``."""
    return "".join(_escaped(letter) for letter in " ".join(text.splitlines()))


def make_printable(*streams: Any) -> None:
    """Let streams replace letters that their encoding lacks: ``kg.m^2`` for kg·m²."""
    codecs.register_error(_ERRORS, _replace)
    for stream in streams:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_ERRORS)


def _escaped(letter: str) -> str:
    if unicodedata.category(letter) not in _HIDDEN:
        return letter
    return letter.encode("unicode_escape").decode("ascii")


def _encodable(text: str) -> str:
    """Plain text in the encoding of standard output, for the layout of a table."""
    codecs.register_error(_ERRORS, _replace)
    encoding = sys.stdout.encoding or "utf-8"
    return plain(text).encode(encoding, _ERRORS).decode(encoding)


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letters = error.object[error.start : error.end]
    return "".join(map(_in_ascii, letters)), error.end


def _in_ascii(letter: str) -> str:
    if letter in _ASCII:
        return _ASCII[letter]
    name = unicodedata.name(letter, "")
    if name.startswith("GREEK SMALL LETTER "):
        return name.removeprefix("GREEK SMALL LETTER ").lower()
    bare = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode("ascii")
    return bare or "?"
