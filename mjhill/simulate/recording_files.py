"""Recordings as files: CSV and NPZ, written whole and read with suspicion."""

from __future__ import annotations

import csv
import errno
import json
import math
import re
import zipfile
import zlib
from array import array
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mjhill.files import replacing
from mjhill.muscles import Muscle, model_of, muscle_model

FORMAT = 2  # of both kinds of file; 1 was without the parameters of muscles
META, TIME, SERIES = "meta.json", "time.npy", "series.npy"  # the members of an NPZ
MOST_META = 16 * 2**20  # bytes of names, units and parameters
SMALL = 256 * 2**20  # bytes that any file may unpack to
MOST_EXPANSION = 100  # times the size of a file that it may unpack to

_HEADER_SIZE = 128  # of an array that NumPy writes, padded
_HEADER = re.compile(
    rb"\x93NUMPY\x01\x00\x76\x00"
    rb"\{'descr': '<f8', 'fortran_order': False, 'shape': \((\d{1,15},(?: \d{1,15})?)\), \} *\n"
)

_Values = NDArray[np.float64]
_Made = TypeVar("_Made")
# time, series, units, what was run, parameters of muscles
_Parts = tuple[
    _Values, dict[str, _Values], dict[str, str], dict[str, str | float], dict[str, Muscle]
]


class _DamageError(ValueError):
    """What is wrong with a file, without its name."""


def save(recording: Any, path: Path) -> Path:
    """Write a recording; see ``Recording.save``."""
    writers = {".csv": _write_csv, ".npz": _write_npz}
    if path.suffix not in writers:
        raise ValueError(f"recording {str(path)!r} must end in .csv or .npz")
    with replacing(path) as partial:
        writers[path.suffix](recording, partial)
    return path


def load(path: Path, make: Callable[..., _Made]) -> _Made:
    """Read a recording, made by ``make`` from its parts; see ``Recording.load``."""
    readers = {".csv": _read_csv, ".npz": _read_npz}
    if path.suffix not in readers:
        raise ValueError(f"recording {str(path)!r} must end in .csv or .npz")
    if path.exists() and not path.is_file():
        raise ValueError(f"{path}: not a mjhill recording: it is not a regular file")
    with _naming(path):
        return make(*readers[path.suffix](path))


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Turn all that a bad file can lead to into one error that names it."""
    try:
        yield
    except _DamageError as error:
        raise ValueError(f"{path}: {error}") from None
    except (
        ArithmeticError, EOFError, LookupError, NotImplementedError, RecursionError, RuntimeError,
        TypeError, ValueError, csv.Error, zipfile.BadZipFile, zlib.error,
    ) as error:  # fmt: skip
        message = str(error) or type(error).__name__
        raise ValueError(f"{path}: damaged recording: {message}") from error
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        raise ValueError(f"{path}: damaged recording: it points outside itself") from error


def _write_csv(recording: Any, path: Path) -> None:
    columns = [recording.time, *recording.series.values()]
    header = ["time [s]"] + [f"{name} [{recording.units[name]}]" for name in recording.series]
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {json.dumps({'format': FORMAT, **_described(recording)})}\n")
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(zip(*map(_decimals, columns), strict=True))


def _decimals(column: _Values) -> Iterable[str]:
    # repr of a float is its shortest decimal that reads back to the same bits; but for the sign
    # of what is not a number
    numbers = map(repr, column.tolist())
    odd = np.isnan(column) & np.signbit(column)
    if not odd.any():
        return numbers
    return ["-nan" if bad else text for text, bad in zip(numbers, odd.tolist(), strict=True)]


def _read_csv(path: Path) -> _Parts:
    with path.open(newline="", encoding="utf-8") as file:
        first = file.readline(MOST_META)
        rows = csv.reader(file, strict=True)
        header = next(rows, []) if first.startswith("# ") and first.endswith("\n") else []
        if header[:1] != ["time [s]"]:
            raise _DamageError(
                "not a mjhill recording: line 1 must start with '# ' and line 2 with 'time [s]'"
            )
        names, units = _titles(header[1:])
        about, muscles = _understood(_parsed(first[2:]))
        cells = array("d")
        for row in rows:
            line = rows.line_num + 1
            if len(row) != len(header):
                raise _DamageError(
                    f"damaged recording: line {line} must have {len(header)} cells as the header, "
                    f"got {len(row)}"
                )
            cells.extend(_numbers(row, header, line))
    table = np.frombuffer(cells, dtype=np.float64) if cells else np.empty(0)
    columns = table.reshape(-1, len(header)).T.copy()
    return (columns[0], dict(zip(names, columns[1:], strict=True)), units, about, muscles)


def _titles(titles: list[str]) -> tuple[list[str], dict[str, str]]:
    """Names and units of the columns after time."""
    names: list[str] = []
    units: dict[str, str] = {}
    for column, title in enumerate(titles, start=2):
        name, bracket, unit = title.rpartition(" [")
        if not bracket or not unit.endswith("]"):
            raise _DamageError(
                f"damaged recording: the title of column {column} must read 'name [unit]', "
                f"got {title!r:.200}"
            )
        if name in units:
            raise _DamageError(
                f"damaged recording: column {column} has the name of another, {name!r:.200}"
            )
        names.append(name)
        units[name] = unit.removesuffix("]")
    return names, units


def _numbers(row: list[str], header: list[str], line: int) -> list[float]:
    try:
        return [float(cell) for cell in row]
    except ValueError:
        for cell, title in zip(row, header, strict=True):
            try:
                float(cell)
            except ValueError:
                raise _DamageError(
                    f"damaged recording: line {line}, column {title!r:.200}: {cell!r:.50} is not "
                    "a number"
                ) from None
        raise


def _write_npz(recording: Any, path: Path) -> None:
    meta = {
        "format": FORMAT,
        "names": list(recording.series),
        "units": [recording.units[name] for name in recording.series],
        **_described(recording),
    }
    shape = len(recording.series), len(recording)
    table = np.array([*recording.series.values()], dtype="<f8").reshape(shape)
    for compression in (zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED):
        with zipfile.ZipFile(path, "w", compression) as archive:
            archive.writestr(META, json.dumps(meta))
            for name, values in ((TIME, recording.time), (SERIES, table)):
                with archive.open(name, "w", force_zip64=True) as file:
                    np.lib.format.write_array(file, values.astype("<f8", copy=False))
        if _unpacked(archive.infolist()) <= _allowed(path):
            return  # else so many zeros that it looks like a bomb when read


def _unpacked(members: list[zipfile.ZipInfo]) -> int:
    return sum(member.file_size for member in members)


def _allowed(path: Path) -> int:
    return max(SMALL, MOST_EXPANSION * path.stat().st_size)


def _read_npz(path: Path) -> _Parts:
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        if sorted(member.filename for member in members) != sorted((META, TIME, SERIES)):
            raise _DamageError(
                f"not a mjhill recording: its members must be {META}, {TIME} and {SERIES}"
            )
        for member in members:
            plain = member.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
            if not plain or member.flag_bits & 1:
                raise _DamageError(
                    f"damaged recording: {member.filename} is encrypted or packed in an unknown way"
                )
        if _unpacked(members) > _allowed(path):
            raise _DamageError(
                f"damaged recording: it says that it unpacks to {_unpacked(members)} bytes, "
                f"more than {MOST_EXPANSION} times its size"
            )
        if archive.getinfo(META).file_size > MOST_META:
            raise _DamageError(f"damaged recording: {META} is longer than {MOST_META} bytes")
        meta = _parsed(archive.read(META).decode())
        time, table = _array(archive, TIME, 1), _array(archive, SERIES, 2)
    names, units = _texts(meta.get("names")), _texts(meta.get("units"))
    if not (names is not None and units is not None and len(names) == len(units) == len(table)):
        raise _DamageError(
            f"damaged recording: {META} must have a name and a unit for each of the "
            f"{len(table)} series"
        )
    if len(set(names)) != len(names):
        raise _DamageError(f"damaged recording: two series have the same name in {META}")
    about, muscles = _understood(meta)
    series = dict(zip(names, table, strict=True))
    return (time, series, dict(zip(names, units, strict=True)), about, muscles)


def _array(archive: zipfile.ZipFile, name: str, dimensions: int) -> _Values:
    """An array of floats whose size is what its header and the archive's say.

    The header is matched and not evaluated, as NumPy would: ``save`` writes no other.
    """
    member = archive.getinfo(name)
    with archive.open(member) as file:
        header = _HEADER.fullmatch(file.read(_HEADER_SIZE))
        shape = [int(size) for size in header[1].split(b",") if size.strip()] if header else []
        if len(shape) != dimensions:
            raise _DamageError(
                f"damaged recording: {name} must be an array of floats in {dimensions} dimensions"
            )
        held = member.file_size - _HEADER_SIZE
        if 8 * math.prod(shape) != held:
            raise _DamageError(
                f"damaged recording: {name} says it has shape {tuple(shape)} and holds {held} bytes"
            )
        values = np.frombuffer(file.read(), dtype="<f8")
    return values.reshape(shape).astype(np.float64)


def _described(recording: Any) -> dict[str, Any]:
    """What a file says beside the series."""
    muscles = {
        name: {"model": model_of(muscle).name, **asdict(muscle)}
        for name, muscle in recording.muscles.items()
    }
    return {"about": dict(recording.about), "muscles": muscles}


def _parsed(text: str) -> dict[str, Any]:
    """JSON that must be an object."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _DamageError(f"damaged recording: what it is about is no JSON: {error}") from None
    if not isinstance(found, dict):
        raise _DamageError("damaged recording: what it is about must be a JSON object")
    return found


def _understood(meta: dict[str, Any]) -> tuple[dict[str, str | float], dict[str, Muscle]]:
    """What a recording is about, and the parameters of its muscles."""
    version = meta.get("format", 1)
    if version not in (1, FORMAT):
        raise _DamageError(
            f"a recording of format {version!r:.20}, and this version of mjhill reads formats up "
            f"to {FORMAT}; upgrade mjhill"
        )
    about, known = (meta, {}) if version == 1 else (meta.get("about"), meta.get("muscles"))
    if not isinstance(about, dict) or not isinstance(known, dict):
        raise _DamageError("damaged recording: 'about' and 'muscles' must be JSON objects")
    for key, value in about.items():
        if not isinstance(value, (str, int, float)):
            raise _DamageError(
                f"damaged recording: 'about' must hold texts and numbers, got {value!r:.50} "
                f"for {key!r:.50}"
            )
    muscles = {}
    for name, values in known.items():
        try:
            kind = muscle_model(values.pop("model", "hill"))
            muscles[name] = kind.parameters(**values)
        except (AttributeError, TypeError, ValueError) as error:
            raise _DamageError(f"damaged recording: muscle {name!r:.50}: {error}") from None
    return about, muscles


def _texts(values: Any) -> list[str] | None:
    good = isinstance(values, list) and all(isinstance(value, str) for value in values)
    return values if good else None
