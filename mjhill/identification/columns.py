"""Measured time series found in a table by their titles, in SI units."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.table import Table, read_table
from mjhill.identification.units import SI, factor_to_si
from mjhill.joints.joint import Joint

DECIMALS = (".", ",")  # signs that may stand between a number's digits
_TIMES = ("time", "t", "x value")  # the last is LabVIEW's
_TIME_UNITS = ("s", "sec", "seconds", "ms", "msec", "milliseconds")  # as a title, as Biodex does
_ANGLES = ("angle", "position")
_TORQUES = ("torque", "applied", "applied torque", "external torque")
_GAPS = ("", "nan", "-nan", "na", "n/a", "#n/a", "null")  # cells that say there is no number
_COMMA = re.compile(r"[+-]?\d*,\d+(?:e[+-]?\d+)?", re.IGNORECASE)  # a decimal comma ...
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")  # ... or one between thousands
_LEAST_KEPT = 0.5  # of the rows, after those without numbers at the ends are left out

_ALONE = "excitation"  # title of the only excitation of a file
_Role = tuple[str, str]  # quantity, and the muscle of an excitation


@dataclass(frozen=True)
class Column:
    """The numbers of one column, and where they stand in the file.

    Attributes:
        path: The file.
        title: Its header cell.
        name: The header cell less its unit.
        unit: Its unit; that of SI where the file has none.
        stated: Whether the file has one.
        factor: One unit in SI.
        lines: Line of each number, from 1.
        cells: The numbers as written.
        values: The numbers in SI, shape (T,).
    """

    path: Path
    title: str
    name: str
    unit: str
    stated: bool
    factor: float
    lines: tuple[int, ...]
    cells: tuple[str, ...]
    values: NDArray[np.float64]

    def written(self, index: int) -> str:
        """One number as it stands in the file, with its unit."""
        unit = "" if self.unit in ("-", "1", "none") else f" {self.unit}"
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
    """The columns of a measured joint.

    Attributes:
        time: Times.
        angle: Angles.
        torque: External torques; None where the file need not have them.
        excitation: By muscle, without those at rest.
        digest: SHA-256 of the file.
        notes: What was done to read the file, for people.
    """

    time: Column
    angle: Column
    torque: Column | None
    excitation: Mapping[str, Column]
    digest: str
    notes: tuple[str, ...]


def read_columns(
    path: str | Path, joint: Joint, *, with_torque: bool = True, decimal: str | None = None
) -> Columns:
    """Find the columns of a joint in a CSV file by their titles, and read them.

    Args:
        path: The file.
        joint: The joint.
        with_torque: Whether it has a column of torques; else there must be none.
        decimal: Sign between a number's digits, ``.`` or ``,``; by default what the cells say.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is no such table; a column is missing, there twice or has a unit of
            something else; or a cell in it is not a finite number.
    """
    names = _names(joint)
    table = read_table(path, lambda title: _meaning(title, names) is not None)
    found = _found(table, joint, names, with_torque=with_torque)
    units, first = _units_row(table, found)
    rows = _Rows(table, found, first)
    notes = list(table.notes)
    sign = decimal or rows.decimal()
    if sign == ",":
        notes.append("read with a decimal comma")
    numbers = rows.numbers(sign)
    kept, trimmed = rows.filled(numbers)
    notes += trimmed
    columns = {}
    for role, index in found.items():
        name, unit, factor = _unit(table, index, role, names, units)
        columns[role] = Column(
            table.path, table.titles[index], name, unit or SI[role[0]], bool(unit), factor,
            rows.lines[kept], tuple(row[index] for row in rows.rows[kept]),
            numbers[index][kept] * factor,
        )  # fmt: skip
    return Columns(
        columns["time", ""],
        columns["angle", ""],
        columns.get(("torque", "")),
        {muscle: column for (_, muscle), column in columns.items() if muscle},
        table.digest,
        tuple(notes),
    )


def _names(joint: Joint) -> dict[str, _Role]:
    """What each name of a column means, in the form of ``_plain``."""
    own = _plain(joint.name)
    names: dict[str, _Role] = {_ALONE: ("excitation", "")}
    for muscle in joint.muscles:
        whole = _plain(muscle)
        for name in (whole, whole.removeprefix(f"{own} ")):
            for form in ("{}", "{} u", "{} emg", "emg {}", "{} excitation", "excitation {}"):
                names[form.format(name)] = ("excitation", muscle)
    for quantity, plain in (("angle", _ANGLES), ("torque", _TORQUES)):
        for name in plain:
            names[name] = names[f"{own} {name}"] = names[f"joint {name}"] = (quantity, "")
    return names | dict.fromkeys((*_TIMES, *_TIME_UNITS), ("time", ""))


def _plain(name: str) -> str:
    return re.sub(r"[\s_.:-]+", " ", name).strip().casefold()


def _meaning(title: str, names: Mapping[str, _Role]) -> tuple[_Role, str, str] | None:
    """What a title means, its name and its unit; None where it is none of those looked for."""
    if _plain(title) in _TIME_UNITS:
        return ("time", ""), title, title
    for name, unit, sure in _splits(title):
        role = names.get(_plain(name))
        if role and (sure or _is_unit(unit, role[0])):
            return role, name, unit
    return None


def _splits(title: str) -> Iterator[tuple[str, str, bool]]:
    """Names and units that a title may have, and whether what is split off must be a unit."""
    yield title, "", True
    bracketed = re.fullmatch(r"([^\[(]*)[\[(]\s*([^\[(]*?)\s*[\])]", title)
    if bracketed:
        yield bracketed[1].strip(), bracketed[2], True
    for mark in reversed(list(re.finditer(r"\s*[/,]\s*|\s+in\s+|[\s_]+", title))):
        yield title[: mark.start()], title[mark.end() :], False


def _is_unit(text: str, quantity: str) -> bool:
    if not re.search(r"[^\W\d_]|[°%]", text):  # elbow_flexor_1 is a sensor
        return False
    try:
        factor_to_si(text, quantity)
    except ValueError:
        return False
    return True


def _found(
    table: Table, joint: Joint, names: Mapping[str, _Role], *, with_torque: bool
) -> dict[_Role, int]:
    """Index of the column of each role."""
    given: dict[_Role, list[int]] = {}
    for index, title in enumerate(table.titles):
        meaning = _meaning(title, names)
        if meaning:
            given.setdefault(meaning[0], []).append(index)
    time, angle, torque = ("time", ""), ("angle", ""), ("torque", "")
    found = {
        time: _only(table, given, time, "'time'", "add one"),
        angle: _only(table, given, angle, f"'angle' or '{joint.name}.angle'", "add one"),
    }
    if with_torque:
        remedy = "add one, or give the external torque if it was constant: torque=0, or --torque 0"
        found[torque] = _only(table, given, torque, f"'torque' or '{joint.name}.applied'", remedy)
    elif torque in given:
        raise ValueError(
            f"{table.path}: row {table.header}, column {table.titles[given[torque][0]]!r}: the "
            "file has torques, and a constant torque is given too; leave out one of them"
        )
    return found | _excitations(table, joint, given)


def _excitations(
    table: Table, joint: Joint, given: Mapping[_Role, Sequence[int]]
) -> dict[_Role, int]:
    """Index of the excitation column of each muscle, or of that of the first muscle alone."""
    roles = [("excitation", muscle) for muscle in joint.muscles]
    titles = [table.titles[i] for role in roles for i in given.get(role, ())]
    alone = given.get(("excitation", ""))
    if not alone:
        remedy = (
            "add one, with zeros if it was at rest; a file with one excitation alone may call it "
            f"'excitation': it drives {next(iter(joint.muscles))!r}"
        )
        return {
            role: _only(table, given, role, f"{role[1]!r} or '{role[1]}.u'", remedy)
            for role in roles
        }
    if titles:
        raise ValueError(
            f"{table.path}: row {table.header}, column {table.titles[alone[0]]!r}: 'excitation' "
            f"must be the only excitation, but there is {', '.join(map(repr, titles))} too; name "
            f"it after its muscle: {' or '.join(joint.muscles)}"
        )
    return {roles[0]: _only(table, given, ("excitation", ""), "'excitation'", "")}


def _only(
    table: Table, given: Mapping[_Role, Sequence[int]], role: _Role, wanted: str, remedy: str
) -> int:
    """Index of the one column of a role."""
    found = given.get(role, ())
    name = role[1] or role[0]
    where = f"{table.path}: row {table.header}"
    if not found:
        listed = ", ".join(map(repr, table.titles))
        if len(table.titles) == 1:
            remedy += "; separate the cells by commas, semicolons or tabs"
        raise ValueError(
            f"{where}, column {name!r}: a column {name} is missing; a header cell must be {wanted},"
            f" maybe with a unit in brackets; the columns found are: {listed}; {remedy}"
        )
    if len(found) > 1:
        titles = " and ".join(repr(table.titles[i]) for i in found)
        quantity = f"excitation of {role[1]}" if role[1] else role[0]
        raise ValueError(
            f"{where}, column {table.titles[found[1]]!r}: {titles} each hold the {quantity}; there "
            "must be one column for it: remove or rename the others"
        )
    return found[0]


def _units_row(table: Table, found: Mapping[_Role, int]) -> tuple[tuple[str, ...], int]:
    """The cells of a row of units under the header, less brackets, and the index of the next."""
    cells = table.rows[0]
    used = [cells[index] for index in found.values()]
    measured = [cells[index] for role, index in found.items() if role[0] != "excitation"]
    words = [cell for cell in used if cell.casefold() not in _GAPS and _parsed(cell, "") is None]
    if not words or any(_parsed(cell, "") is not None for cell in measured):
        return (), 0
    if len(table.rows) == 1:
        raise ValueError(
            f"{table.path}: row {table.lines[0]}: no rows follow the units; they must be followed "
            "by numbers"
        )
    return tuple(re.sub(r"^[\[(]\s*(.*?)\s*[\])]$", r"\1", cell) for cell in cells), 1


def _unit(
    table: Table, index: int, role: _Role, names: Mapping[str, _Role], units: Sequence[str]
) -> tuple[str, str, float]:
    """Name, unit and factor of a column, from its title and the row of units."""
    title = table.titles[index]
    meaning = _meaning(title, names)
    name, unit = meaning[1:] if meaning else (title, "")
    line, below = table.header, units[index] if units else ""
    try:
        factor = factor_to_si(unit, role[0])
        if below:
            line = table.lines[0]
            under = factor_to_si(below, role[0])
            if unit and under != factor:
                raise ValueError(f"{unit!r} in the title, {below!r} under it; remove one of them")
            unit, factor = below, under
    except ValueError as error:
        raise ValueError(
            f"{table.path}: row {line}, column {title!r}: {error}; convert the numbers to one, or "
            "correct the unit"
        ) from None
    return name, unit, factor


class _Rows:
    """The rows of numbers of the columns in use."""

    def __init__(self, table: Table, found: Mapping[_Role, int], first: int) -> None:
        while first < len(table.rows) and not any(table.rows[first]):
            first += 1  # a blank line under the units
        self.table = table
        self.used = tuple(found.values())
        self.lines = table.lines[first:]
        self.rows = table.rows[first:]

    def decimal(self) -> str:
        """The sign between a number's digits."""
        cells = [row[index] for row in self.rows for index in self.used]
        commas = [cell for cell in cells if _COMMA.fullmatch(cell)]
        if not commas:
            return "."
        if any("." in cell and _parsed(cell, ".") is not None for cell in cells):
            return "."  # and an error at the first comma
        if all(map(_THOUSANDS.fullmatch, commas)):
            raise ValueError(
                f"{self.table.path}: {commas[0]!r} may have a decimal comma or one between "
                "thousands; say which sign is the decimal one: decimal=',', or --decimal ,"
            )
        return ","

    def numbers(self, decimal: str) -> dict[int, NDArray[np.float64]]:
        """The numbers of each column, NaN where there is none."""
        return {
            index: np.array(
                [
                    self._number(line, index, row[index], decimal)
                    for line, row in zip(self.lines, self.rows, strict=True)
                ]
            )
            for index in self.used
        }

    def _where(self, line: int, index: int) -> str:
        return f"{self.table.path}: row {line}, column {self.table.titles[index]!r}"

    def _number(self, line: int, index: int, cell: str, decimal: str) -> float:
        if cell.casefold() in _GAPS:
            return float("nan")
        value = _parsed(cell, decimal)
        if value is None:
            other = DECIMALS[decimal == "."]
            if _parsed(cell, other) is not None:
                kinds = {".": "point", ",": "comma"}
                raise ValueError(
                    f"{self._where(line, index)}: {cell!r} has a decimal {kinds[other]}, but "
                    f"numbers here have a decimal {kinds[decimal]}: write "
                    f"{cell.replace(other, decimal)}, or set decimal (--decimal) if all have it"
                )
            raise ValueError(
                f"{self._where(line, index)}: {cell!r} is not a number; write one, such as 0.25"
            )
        if not np.isfinite(value):
            raise ValueError(
                f"{self._where(line, index)}: {cell} is not finite; every number must be: fill "
                "the gap or cut the file there"
            )
        return value

    def filled(self, numbers: Mapping[int, NDArray[np.float64]]) -> tuple[slice, list[str]]:
        """The rows from the first to the last full one, and notes on those left out.

        Raises:
            ValueError: There is a gap between, or too few rows are left.
        """
        gaps = {index: np.isnan(values) for index, values in numbers.items()}
        full = np.flatnonzero(~np.any(list(gaps.values()), axis=0))
        count = len(self.rows)
        first, end = (int(full[0]), int(full[-1]) + 1) if full.size else (0, 0)
        if end - first < _LEAST_KEPT * count:
            index = max(gaps, key=lambda one: int(gaps[one].sum()))
            raise ValueError(
                f"{self.table.path}: rows {self.lines[0]} to {self.lines[-1]}, column "
                f"{self.table.titles[index]!r}: {gaps[index].sum()} of {count} cells hold no "
                "number; fill them in, or cut the file where the measurement ends"
            )
        for index, gap in gaps.items():
            inside = np.flatnonzero(gap[first:end])
            if inside.size:
                raise self._gap(first + int(inside[0]), index)
        notes = []
        for place, left in (("start", range(first)), ("end", range(end, count))):
            if left:
                lines = f"{self.lines[left[0]]} to {self.lines[left[-1]]}"
                rows = f"rows {lines}" if len(left) > 1 else f"row {self.lines[left[0]]}"
                notes.append(f"{rows} at the {place} left out: not all cells hold numbers")
        return slice(first, end), notes

    def _gap(self, row: int, index: int) -> ValueError:
        where, cell = self._where(self.lines[row], index), self.rows[row][index]
        if not any(self.rows[row]):
            return ValueError(
                f"{where}: the row is blank; remove it, and give each trial a file of its own"
            )
        if cell:
            return ValueError(
                f"{where}: {cell!r} is not a number; every cell between the first and the last "
                "full row must be: fill the gap, or cut the file there"
            )
        return ValueError(f"{where}: the cell is empty; it must hold a number: fill it in")


def _parsed(cell: str, decimal: str) -> float | None:
    """A number; with a decimal point, with a decimal comma, or where there is no sign, either."""
    if "_" in cell or (decimal == "," and "." in cell):
        return None
    text = cell.replace("\N{MINUS SIGN}", "-")
    try:
        return float(text if decimal == "." else text.replace(",", "."))
    except ValueError:
        return None
