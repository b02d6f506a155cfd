"""Tables read from text: titles and rows of cells, with the line that each row stands on."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

_DELIMITERS = (",", ";", "\t")


@dataclass(frozen=True)
class Table:
    """A CSV file, its cells still text.

    Attributes:
        path: The file.
        header: Line of the header, from 1.
        titles: The cells of the header.
        lines: Line of each row, from 1.
        rows: The rows, each with as many cells as there are titles.
    """

    path: Path
    header: int
    titles: tuple[str, ...]
    lines: tuple[int, ...]
    rows: tuple[tuple[str, ...], ...]


def read_table(path: str | Path) -> Table:
    """Read a CSV file: maybe a line that starts with ``#``, then a header, then rows.

    Cells are separated by commas, semicolons or tabs, whichever splits the header most. Blank
    lines before the header and after the last row are skipped.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not text, is empty, has no rows, or a row has not a cell per title.
    """
    path = Path(path)
    lines = _text(path).split("\n")
    commented = int(lines[0].startswith("#"))
    filled = (i for i, line in enumerate(lines) if i >= commented and line.strip())
    start = next(filled, None)
    if start is None:
        raise ValueError(
            f"{path}: row 1: the file is empty; it must have a header and rows of numbers"
        )
    delimiter = max(_DELIMITERS, key=lambda mark: len(_cells(lines[start], mark)))
    rows = _rows(path, lines, start, delimiter)
    header, titles = rows.pop(0)
    while rows and not any(rows[-1][1]):
        rows.pop()
    if not rows:
        raise ValueError(
            f"{path}: row {header}: no rows follow the header; it must be followed by numbers"
        )
    for line, cells in rows:
        if len(cells) != len(titles):
            raise _ragged(path, line, cells, titles, delimiter)
    return Table(path, header, titles, tuple(r[0] for r in rows), tuple(r[1] for r in rows))


def _text(path: Path) -> str:
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file; give the path of a CSV file")
    if path.is_dir():
        raise ValueError(f"{path}: is a folder, not a text CSV; give the path of a file in it")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise ValueError(f"{path}: is not a text CSV; save it as CSV in UTF-8")
    return text


def _cells(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line], delimiter=delimiter))


def _rows(
    path: Path, lines: list[str], start: int, delimiter: str
) -> list[tuple[int, tuple[str, ...]]]:
    """Line and cells of each row from index ``start`` of the lines."""
    reader = csv.reader(lines[start:], delimiter=delimiter, skipinitialspace=True, strict=True)
    rows, line = [], start + 1
    try:
        for cells in reader:
            rows.append((line, tuple(cell.strip() for cell in cells)))
            line = start + 1 + reader.line_num
    except csv.Error as error:
        raise ValueError(
            f"{path}: row {line}: is not CSV: {error}; remove the quotes around its cells"
        ) from error
    return rows


def _ragged(
    path: Path, line: int, cells: tuple[str, ...], titles: tuple[str, ...], delimiter: str
) -> ValueError:
    many = len(cells) > len(titles)
    column = titles[-1] if many else titles[len(cells)]
    if not any(cells):
        column = titles[0]
        fault, remedy = "the row is blank", "remove it, and give each trial a file of its own"
    elif not many:
        fault, remedy = f"the row has {len(cells)} cells, so none here", "fill it in"
    else:
        fault, remedy = f"the row has {len(cells)} cells, so some past this one", "remove them"
        if delimiter == ",":
            remedy += "; if commas are decimal signs, write decimal points"
    return ValueError(
        f"{path}: row {line}, column {column!r}: {fault}; each row must have {len(titles)} cells, "
        f"as the header has: {remedy}"
    )
