"""The joints of the paper, read from the parameter file that comes with mjhill."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from mjhill.parameters import Joint, Muscle, Passive

_DATA = Path(__file__).parent / "data" / "joints.toml"
_Made = TypeVar("_Made", Joint, Muscle, Passive)


def parameter_file() -> Path:
    """The file that holds the parameters of the joints that come with mjhill."""
    return _DATA


def read_joints(path: str | Path | None = None) -> dict[str, Joint]:
    """The joints of a parameter file in the form of ``data/joints.toml``, which is the default.

    Every value stands as ``name = { value = ..., source = "..." }``; further keys of an entry,
    such as the bounds of ``mjhill identify``, are not looked at.

    Raises:
        ValueError: The file is not TOML, or an entry is missing, unknown or out of bounds; the
            message names the file, the table and the entry.
        FileNotFoundError: There is no such file.
    """
    file = Path(path or _DATA)
    try:
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file}: not a parameter file: {error}") from None
    try:
        return {name: _joint(name, table) for name, table in tables.items()}
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


class _Joints(Mapping[str, Joint]):
    """The joints of ``data/joints.toml``, read on first use."""

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
    muscles, gears = {}, {}
    for muscle, muscle_table in _subtable(values, "muscles", name).items():
        where = f"{name}.muscles.{muscle}"
        parts = _split(muscle_table, where)
        gears[muscle] = _number(_taken(parts, "gear", where), f"{where}: gear")
        muscles[muscle] = _made(Muscle, parts, where)
    postures = _split(values.pop("postures", {}), f"{name}.postures")
    told = {f"postures.{muscle}": source for muscle, source in postures.pop("sources").items()}
    values |= {
        "name": name,
        "sources": MappingProxyType({**values["sources"], **told}),
        "passive": _made(
            Passive,
            _split(_subtable(values, "passive", name), f"{name}.passive"),
            f"{name}.passive",
        ),
        "muscles": MappingProxyType(muscles),
        "gears": MappingProxyType(gears),
        "postures": MappingProxyType(
            {key: _number(value, f"{name}.postures: {key}") for key, value in postures.items()}
        ),
        "range": _pair(_taken(values, "range", name), f"{name}: range"),
    }
    return _made(Joint, values, name)


def _split(table: Any, where: str) -> dict[str, Any]:
    """Constructor arguments from entries ``name = {value = ..., source = ...}``."""
    if not isinstance(table, dict):
        raise ValueError(f"{where}: must be a table, got {table!r}")
    values: dict[str, Any] = {}
    sources: dict[str, str] = {}
    for name, entry in table.items():
        stated = isinstance(entry, dict) and "value" in entry
        values[name] = entry["value"] if stated else entry
        if stated:
            sources[name] = _source(entry, f"{where}: {name}")
    return {**values, "sources": MappingProxyType(sources)}


def _source(entry: Mapping[str, Any], what: str) -> str:
    source = entry.get("source")
    if source is None:
        raise ValueError(f'{what} has no source; say where it comes from: source = "..."')
    if "bounds" not in entry:
        return str(source)
    low, high = _pair(entry["bounds"], f"{what}: bounds")
    return f"fitted by mjhill identify within {low:g} to {high:g}: {source}"


def _subtable(values: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    table = _taken(values, key, where)
    if not isinstance(table, dict):
        raise ValueError(f"{where}.{key}: must be a table, got {table!r}")
    return table


def _taken(values: dict[str, Any], key: str, where: str) -> Any:
    if key not in values:
        raise ValueError(f"{where}: {key} is missing; add it")
    return values.pop(key)


def _number(value: Any, what: str) -> float:
    if not isinstance(value, (int, float)):
        raise ValueError(f"{what} must be a number, got {value!r}")
    return float(value)


def _pair(value: Any, what: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{what} must be two numbers, [low, high], got {value!r}")
    return _number(value[0], what), _number(value[1], what)


def _made(kind: type[_Made], values: dict[str, Any], where: str) -> _Made:
    """An object of a parameter class; what is wrong with its values is said with the table."""
    _check_names(kind, values, where)
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def _check_names(kind: type, values: Mapping[str, Any], where: str) -> None:
    known = [item.name for item in fields(kind)]
    for name in values:
        if name not in known:
            listed = ", ".join(item for item in known if item not in ("name", "sources"))
            raise ValueError(f"{where}: unknown entry {name!r}; there are: {listed}")
    for item in fields(kind):
        optional = item.default is not MISSING or item.default_factory is not MISSING
        if not (optional or item.name in values):
            raise ValueError(f"{where}: {item.name} is missing; add it")
