"""Measured time series read from a table with named columns and units."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint

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


_NO_UNIT = ("-", "1", "none")
_UNITS: Mapping[str, Mapping[str, float]] = {  # quantity: unit to SI, that of SI first
    "time": {"s": 1.0, "ms": 1e-3},
    "angle": {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180},
    "torque": {"N·m": 1.0, "Nm": 1.0, "N m": 1.0, "N.m": 1.0, "mN·m": 1e-3, "N·mm": 1e-3},
    "excitation": {**dict.fromkeys(_NO_UNIT, 1.0), "%": 1e-2},
}
_LOOKALIKES = str.maketrans({"⋅": "·", "∙": "·", "º": "°"})
_TITLE = re.compile(r"(?P<name>[^\[]*?)\s*(?:\[\s*(?P<unit>[^\]]*?)\s*\])?")


@dataclass(frozen=True)
class Column:
    """The numbers of one column, and where they stand in the file.

    Attributes:
        path: The file.
        title: Its header cell.
        name: The header cell less its unit.
        unit: Its unit; that of SI where the header has none.
        factor: One unit in SI.
        lines: Line of each number, from 1.
        cells: The numbers as written.
        values: The numbers in SI, shape (T,).
    """

    path: Path
    title: str
    name: str
    unit: str
    factor: float
    lines: tuple[int, ...]
    cells: tuple[str, ...]
    values: NDArray[np.float64]

    def written(self, index: int) -> str:
        """One number as it stands in the file, with its unit."""
        unit = "" if self.unit in _NO_UNIT else f" {self.unit}"
        return self.cells[index] + unit

    def error(self, index: int, problem: str) -> ValueError:
        """An error about one number, that says where it stands and what it is."""
        return ValueError(
            f"{self.path}: row {self.lines[index]}, column {self.title!r}: "
            f"{self.written(index)} {problem}"
        )

    def error_of_all(self, problem: str) -> ValueError:
        """An error about all the numbers, that says where they stand."""
        return ValueError(
            f"{self.path}: rows {self.lines[0]} to {self.lines[-1]}, column {self.title!r}: "
            f"{problem}"
        )


@dataclass(frozen=True)
class Columns:
    """The columns of a measured joint; ``excitation`` by muscle, without those at rest."""

    time: Column
    angle: Column
    torque: Column
    excitation: Mapping[str, Column]


def read_columns(table: Table, joint: Joint) -> Columns:
    """Find the columns of a joint by their titles, ``name`` or ``name [unit]``, and read them.

    Raises:
        ValueError: A column is missing, there twice or has an unknown unit, or a cell in it is
            not a finite number.
    """
    time = _only(table, "time", ("time",), "add one")
    angle = _only(table, "angle", ("angle", f"{joint.name}.angle"), "add one")
    remedy = "add one, with zeros if none was applied"
    torque = _only(table, "torque", ("torque", f"{joint.name}.applied"), remedy)
    return Columns(
        time=_read(table, time, "time"),
        angle=_read(table, angle, "angle"),
        torque=_read(table, torque, "torque"),
        excitation={
            muscle: _read(table, index, "excitation")
            for muscle, index in _excitations(table, joint).items()
        },
    )


def _excitations(table: Table, joint: Joint) -> dict[str, int]:
    """Index of the excitation column of each muscle, or of that of the first muscle alone."""
    names = {muscle: (muscle, f"{muscle}.u") for muscle in joint.muscles}
    titles = [table.titles[i] for options in names.values() for i in _all(table, options)]
    alone = _all(table, ("excitation",))
    if not alone:
        remedy = (
            "add one, with zeros if it was at rest; a file with one excitation alone may call it "
            f"'excitation': it drives {next(iter(joint.muscles))!r}"
        )
        return {m: _only(table, f"excitation of {m}", names[m], remedy) for m in names}
    if titles:
        raise ValueError(
            f"{table.path}: row {table.header}, column {table.titles[alone[0]]!r}: 'excitation' "
            f"must be the only excitation, but there is {', '.join(map(repr, titles))} too; name "
            f"it after its muscle: {' or '.join(names)}"
        )
    return {next(iter(names)): _only(table, "excitation", ("excitation",), "")}


def _only(table: Table, quantity: str, names: tuple[str, ...], remedy: str) -> int:
    """Index of the one column with one of the names."""
    found = _all(table, names)
    where = f"{table.path}: row {table.header}"
    wanted = " or ".join(map(repr, names))
    if not found:
        listed = ", ".join(map(repr, table.titles))
        if len(table.titles) == 1:
            remedy += "; separate the cells by commas, semicolons or tabs"
        raise ValueError(
            f"{where}, column {names[0]!r}: a column {names[0]} is missing; a header cell must be "
            f"{wanted}, maybe with a unit in brackets; the columns found are: {listed}; {remedy}"
        )
    if len(found) > 1:
        titles = " and ".join(repr(table.titles[i]) for i in found)
        raise ValueError(
            f"{where}, column {table.titles[found[1]]!r}: {titles} each hold the {quantity}; there "
            "must be one column for it: remove or rename the others"
        )
    return found[0]


def _all(table: Table, names: tuple[str, ...]) -> list[int]:
    return [i for i, title in enumerate(table.titles) if _split(title)[0] in names]


def _split(title: str) -> tuple[str, str]:
    """Name and unit of a title; one of another form is all name."""
    match = _TITLE.fullmatch(title)
    return (match["name"], match["unit"] or "") if match else (title, "")


def _read(table: Table, index: int, quantity: str) -> Column:
    title, units = table.titles[index], _UNITS[quantity]
    name, unit = _split(title)
    unit = unit.translate(_LOOKALIKES) or next(iter(units))
    if unit not in units:
        raise ValueError(
            f"{table.path}: row {table.header}, column {title!r}: unknown unit {unit!r} of "
            f"{quantity}; it must be one of: {', '.join(units)}; convert the numbers to one"
        )
    cells = tuple(row[index] for row in table.rows)
    numbers = [
        _number(f"{table.path}: row {line}, column {title!r}", cell)
        for line, cell in zip(table.lines, cells, strict=True)
    ]
    values = np.array(numbers, dtype=np.float64) * units[unit]
    return Column(table.path, title, name, unit, units[unit], table.lines, cells, values)


def _number(where: str, cell: str) -> float:
    if not cell:
        raise ValueError(f"{where}: the cell is empty; it must hold a number: fill it in")
    value = _parsed(cell)
    if value is None and _parsed(cell.replace(",", ".")) is not None:
        raise ValueError(
            f"{where}: {cell!r} has a decimal comma; numbers must have decimal points: write "
            f"{cell.replace(',', '.')}"
        )
    if value is None:
        raise ValueError(f"{where}: {cell!r} is not a number; write one, such as 0.25")
    if not math.isfinite(value):
        raise ValueError(
            f"{where}: {cell} is not finite; every number must be: fill the gap or cut the file "
            "there"
        )
    return value


def _parsed(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None
