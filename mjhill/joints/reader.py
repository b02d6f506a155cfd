"""The joints of the paper, read from the parameter file that comes with mjhill."""

from __future__ import annotations

import math
import re
import reprlib
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from mjhill.joints.joint import Joint, Passive
from mjhill.muscles import Muscle, muscle_model
from mjhill.quantity import flags, quantities

SETS = ("joints", "constant_velocity")
"""Sets of parameters that come with mjhill; in the second, V_max does not rise with activation."""

_Made = TypeVar("_Made", Joint, Muscle, Passive)
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")  # becomes a file's name
_ENTRY = ("value", "source", "bounds")
FITTED = "fitted to "  # starts the source of a value that was fitted to measurements
_LONGEST = 1_000_000  # of a parameter file [byte]
_ANGLES = (-10.0, 10.0)  # that a joint can have [rad]
_GEARS = (1e-6, 1e6)  # size of a gear
_TEXT = 200  # characters of what is no source


def parameter_file(path: str | Path | None = None) -> Path:
    """A file of parameters.

    Args:
        path: The name of a set that comes with mjhill, one of ``SETS``, or a path, which is given
            back; by default that of the first set.
    """
    if path is None or str(path) in SETS:
        return Path(__file__).parent / f"{path or SETS[0]}.toml"
    return Path(path)


def read_joints(path: str | Path | None = None) -> dict[str, Joint]:
    """The joints of a parameter file in the form of ``joints.toml``, which is the default.

    ``constant_velocity`` is the other set that comes with mjhill: its V_max does not rise with
    activation, as in the paper.

    Every value stands as ``name = { value = ..., source = "..." }``, with ``bounds`` where
    ``mjhill identify`` may fit it. A joint with ``symmetric = true`` is fitted with both muscles
    and both sides alike.

    Raises:
        ValueError: The file is not TOML, or an entry is missing, unknown, of the wrong kind or out
            of bounds; the message names the file, the table and the entry.
        OSError: There is no such file, or it cannot be read.
    """
    file = parameter_file(path)
    try:
        tables = tomllib.loads(_text(file))
    except ValueError as error:
        raise ValueError(f"{file}: not a parameter file: {error}") from None
    except RecursionError:
        raise ValueError(
            f"{file}: not a parameter file: its tables or lists are nested too deeply; "
            "joints.toml, which comes with mjhill, shows the form"
        ) from None
    try:
        return {_name(name, "joint"): _joint(name, table) for name, table in tables.items()}
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def _text(file: Path) -> str:
    if file.exists() and not file.is_file():
        raise ValueError("it is no plain file")
    if file.stat().st_size > _LONGEST:
        raise ValueError(f"it has {file.stat().st_size:,} bytes, and at most {_LONGEST:,} are read")
    return file.read_text(encoding="utf-8")


class _Joints(Mapping[str, Joint]):
    """The joints of ``joints.toml``, read on first use."""

    def __getitem__(self, name: str) -> Joint:
        if name not in _shipped():
            raise KeyError(f"unknown joint {name!r}; there are: {', '.join(_shipped())}")
        return _shipped()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_shipped())

    def __len__(self) -> int:
        return len(_shipped())


JOINTS: Mapping[str, Joint] = _Joints()


@cache
def _shipped() -> dict[str, Joint]:
    return read_joints()


def _joint(name: str, table: Any) -> Joint:
    values = _split(table, name)
    symmetric = values.pop("symmetric", False)
    muscles, gears = {}, {}
    for muscle, muscle_table in _subtable(values, "muscles", name).items():
        where = f"{name}.muscles.{_name(muscle, f'{name}.muscles: muscle')}"
        parts = _split(muscle_table, where)
        gears[muscle] = _gear(_taken(parts, "gear", where), f"{where}: gear")
        muscles[muscle] = _made(_muscle_class(parts.pop("model", "hill"), where), parts, where)
    if not muscles:
        raise ValueError(f"{name}.muscles: there must be at least one muscle; add one")
    if not isinstance(symmetric, bool) or (symmetric and len(muscles) != 2):
        raise ValueError(
            f"{name}: symmetric must be true or false, and true only for a joint of two muscles, "
            f"got {_shown(symmetric)} and {len(muscles)}"
        )
    postures = _split(values.pop("postures", {}), f"{name}.postures")
    stated = {f"postures.{muscle}": source for muscle, source in postures.pop("sources").items()}
    values |= {
        "name": name,
        "sources": MappingProxyType({**values["sources"], **stated}),
        "passive": _made(
            Passive,
            _split(_subtable(values, "passive", name), f"{name}.passive"),
            f"{name}.passive",
        ),
        "muscles": MappingProxyType(muscles),
        "gears": MappingProxyType(gears),
        "postures": MappingProxyType(
            {key: _angle(value, f"{name}.postures: {key}") for key, value in postures.items()}
        ),
        "positive": _words(_taken(values, "positive", name), f"{name}: positive"),
        "range": _range(_taken(values, "range", name), f"{name}: range"),
        "home_angle": _angle(_taken(values, "home_angle", name), f"{name}: home_angle"),
    }
    return _made(Joint, values, name)


def _muscle_class(model: Any, where: str) -> type[Muscle]:
    try:
        return muscle_model(model).parameters
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}: model: {error}") from None


def _name(name: str, what: str) -> str:
    """A name that is safe as a file's name and in every output."""
    if not _NAME.fullmatch(name):
        raise ValueError(
            f"{what} {_shown(name)}: a name must be 1 to 64 letters a to z, digits, _ and -, "
            "and not begin with -; rename it"
        )
    return name


def _split(table: Any, where: str) -> dict[str, Any]:
    """Constructor arguments from entries ``name = {value = ..., source = ...}``."""
    if not isinstance(table, dict):
        raise ValueError(f"{where}: must be a table, got {_shown(table)}")
    values: dict[str, Any] = {}
    sources: dict[str, str] = {}
    for name, entry in table.items():
        if name in ("name", "sources"):  # these are made here
            raise ValueError(f"{where}: unknown entry {name!r}; remove it")
        stated = isinstance(entry, dict) and "value" in entry
        values[name] = entry["value"] if stated else entry
        if stated:
            sources[name] = _source(entry, f"{where}: {name}")
    return {**values, "sources": MappingProxyType(sources)}


def _source(entry: Mapping[str, Any], what: str) -> str:
    for key in entry:
        if key not in _ENTRY:
            raise ValueError(f"{what}: unknown key {_shown(key)}; there are: {', '.join(_ENTRY)}")
    source = entry.get("source")
    if source is None:
        raise ValueError(f'{what} has no source; say where it comes from: source = "..."')
    if not isinstance(source, str):
        raise ValueError(f'{what}: source must be text, got {_shown(source)}; put it in "..."')
    if "bounds" not in entry:
        return source
    low, high = _pair(entry["bounds"], f"{what}: bounds")
    if not low < high:
        raise ValueError(f"{what} must have ascending bounds, got {_shown([low, high])}")
    if source.startswith(FITTED):
        return source
    return f"fitted by mjhill identify within {low:g} to {high:g}: {source}"


def _subtable(values: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    table = _taken(values, key, where)
    if not isinstance(table, dict):
        raise ValueError(f"{where}.{key}: must be a table, got {_shown(table)}")
    return table


def _taken(values: dict[str, Any], key: str, where: str) -> Any:
    if key not in values:
        raise ValueError(f"{where}: {key} is missing; add it")
    return values.pop(key)


def _number(value: Any, what: str) -> float:
    """A finite number; a TOML file can also hold ``true``, ``nan`` and hundreds of digits."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{what} must be a number, got {_shown(value)}")
    if abs(value) > 1e300 or math.isnan(value):
        raise ValueError(f"{what} must be a finite number, got {_shown(value)}; correct it")
    return float(value)


def _angle(value: Any, what: str) -> float:
    number = _number(value, what)
    if not _ANGLES[0] <= number <= _ANGLES[1]:
        raise ValueError(
            f"{what} must be in [{_ANGLES[0]:g}, {_ANGLES[1]:g}] rad, got {_shown(value)}; "
            "angles are in radians"
        )
    return number


def _gear(value: Any, what: str) -> float:
    number = _number(value, what)
    if not _GEARS[0] <= abs(number) <= _GEARS[1]:
        raise ValueError(
            f"{what} must be {_GEARS[0]:g} to {_GEARS[1]:g} or the negative of that, got "
            f"{_shown(value)}; -1 is a muscle that pulls towards positive angles, 1 one that pulls "
            "towards negative ones"
        )
    return number


def _pair(value: Any, what: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{what} must be two numbers, [low, high], got {_shown(value)}")
    return _number(value[0], what), _number(value[1], what)


def _range(value: Any, what: str) -> tuple[float, float]:
    low, high = _pair(value, what)
    if not _ANGLES[0] <= low < high <= _ANGLES[1]:
        raise ValueError(
            f"{what} must be two ascending angles in [{_ANGLES[0]:g}, {_ANGLES[1]:g}] rad, "
            f"[low, high], got {_shown(value)}"
        )
    return low, high


def _words(value: Any, what: str) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= _TEXT or not value.isprintable():
        raise ValueError(
            f"{what} must be text of 1 to {_TEXT} characters on one line, got {_shown(value)}; "
            'write it as "flexion"'
        )
    return value


def _shown(value: Any) -> str:
    """A value in a message: in full where it is short."""
    try:
        whole = repr(value)
    except ValueError:  # more digits than Python writes
        return "a number of thousands of digits"
    return whole if len(whole) <= _TEXT else reprlib.repr(value)


def _made(kind: type[_Made], values: dict[str, Any], where: str) -> _Made:
    """An object of a parameter class; what is wrong with its values is said with the table."""
    _check_names(kind, values, where)
    for name, _ in quantities(kind):
        if name in values:
            values[name] = _number(values[name], f"{where}: {name}")
    for name in flags(kind):
        if not isinstance(values.get(name, False), bool):
            raise ValueError(f"{where}: {name} must be true or false, got {_shown(values[name])}")
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def _check_names(kind: type, values: Mapping[str, Any], where: str) -> None:
    known = [item.name for item in fields(kind)]
    for name in values:
        if name not in known:
            listed = ", ".join(item for item in known if item not in ("name", "sources"))
            raise ValueError(f"{where}: unknown entry {_shown(name)}; there are: {listed}")
    for item in fields(kind):
        optional = item.default is not MISSING or item.default_factory is not MISSING
        if not (optional or item.name in values):
            raise ValueError(f"{where}: {item.name} is missing; add it")
