"""The CSV file of a laboratory as a table of text: encoding, preamble, header, rows."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

_DELIMITERS = (",", ";", "\t")
_PREAMBLE = 200  # lines in which a header is looked for
_COMMENT = "#"  # starts a comment, or a header as numpy.savetxt writes it


@dataclass(frozen=True)
class Table:
    """A CSV file, its cells still text.

    Attributes:
        path: The file.
        digest: SHA-256 of its bytes, in hexadecimal digits.
        header: Line of the header, from 1.
        titles: The cells of the header.
        lines: Line of each row, from 1.
        rows: The rows, each with as many cells as there are titles.
        notes: What was done to read it, for people.
    """

    path: Path
    digest: str
    header: int
    titles: tuple[str, ...]
    lines: tuple[int, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]


def read_table(path: str | Path, known: Callable[[str], bool]) -> Table:
    """Read a CSV file: maybe lines about the device, then a header, then rows.

    Cells are separated by commas, semicolons or tabs. The header is the line among the first 200
    that has the most known titles. Blank lines after it and at the end are skipped.

    Args:
        path: The file, in UTF-8, UTF-16 with a byte order mark, or Windows-1252.
        known: Whether a cell may be a title.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not text, is empty, has no rows, or a row has more cells than titles.
    """
    path = Path(path)
    content = _content(path)
    text, notes = _decoded(path, content)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    start, delimiter = _header(path, lines, known)
    rows = _rows(path, [lines[start].lstrip(_COMMENT), *lines[start + 1 :]], start, delimiter)
    header, titles = rows.pop(0)
    width = max((i + 1 for i, title in enumerate(titles) if title), default=0)
    while rows and not any(rows[-1][1]):
        rows.pop()
    while rows and not any(rows[0][1]):
        rows.pop(0)
    if not rows:
        raise ValueError(
            f"{path}: row {header}: no rows follow the header; it must be followed by numbers"
        )
    for line, cells in rows:
        if any(cells[len(titles) :]):
            raise _too_many(path, line, cells, titles, delimiter)
    filled = (cells + ("",) * (width - len(cells)) for _, cells in rows)
    return Table(
        path,
        hashlib.sha256(content).hexdigest(),
        header,
        titles[:width],
        tuple(line for line, _ in rows),
        tuple(cells[:width] for cells in filled),
        notes,
    )


def _content(path: Path) -> bytes:
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file; give the path of a CSV file")
    if path.is_dir():
        raise ValueError(f"{path}: is a folder, not a text CSV; give the path of a file in it")
    return path.read_bytes()


def _decoded(path: Path, content: bytes) -> tuple[str, tuple[str, ...]]:
    """The text of a file, and a note where its encoding is not UTF-8."""
    encodings = {"utf-8-sig": "", "cp1252": "read as Windows-1252, as it is not UTF-8"}
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        encodings = {"utf-16": "read as UTF-16"}
    for encoding, note in encodings.items():
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text, (note,) if note else ()
    raise ValueError(f"{path}: is not a text CSV; save it as CSV in UTF-8")


def _header(path: Path, lines: list[str], known: Callable[[str], bool]) -> tuple[int, str]:
    """Index of the line of the header, and the delimiter."""
    found = []  # number of known titles, number of cells, index less than 0, delimiter
    for index, line in enumerate(lines[:_PREAMBLE]):
        for delimiter in _DELIMITERS:
            cells = _cells(line.lstrip(_COMMENT), delimiter)
            titles = sum(map(known, cells))
            # a comment may mention one title, as a sentence does
            if any(cells) and (titles > 1 or not line.startswith(_COMMENT)):
                found.append((titles, len(cells), -index, delimiter))
    if not found:
        raise ValueError(
            f"{path}: row 1: the file is empty; it must have a header and rows of numbers"
        )
    best = max(found)
    if not best[0]:  # the columns of the first line are those that are not the wanted ones
        best = max(one for one in found if one[2] == found[0][2])
    return -best[2], best[3]


def _cells(line: str, delimiter: str) -> tuple[str, ...]:
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a comment longer than any cell may be
        return ()
    return tuple(cell.strip() for cell in cells)


def _rows(
    path: Path, lines: list[str], start: int, delimiter: str
) -> list[tuple[int, tuple[str, ...]]]:
    """Line and cells of each row; the first of the lines has index ``start`` in the file."""
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=True)
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


def _too_many(
    path: Path, line: int, cells: tuple[str, ...], titles: tuple[str, ...], delimiter: str
) -> ValueError:
    remedy = "remove them"
    if delimiter == ",":
        remedy += (
            "; if commas are decimal signs, write decimal points, or separate the cells by "
            "semicolons"
        )
    return ValueError(
        f"{path}: row {line}, column {titles[-1]!r}: the row has {len(cells)} cells, so some past "
        f"this one; each row must have at most {len(titles)} cells, as the header has: {remedy}"
    )
