"""The joints of the paper, read from the parameter file that comes with mjhill."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mjhill.parameters import Joint, Muscle, Passive

_DATA = Path(__file__).parent / "data" / "joints.toml"


def parameter_file() -> Path:
    """The file that holds the parameters of the joints that come with mjhill."""
    return _DATA


def read_joints(path: str | Path | None = None) -> dict[str, Joint]:
    """The joints of a parameter file in the form of ``data/joints.toml``, which is the default.

    Every value stands as ``name = { value = ..., source = "..." }``; further keys of an entry,
    such as the bounds of ``mjhill identify``, are not looked at.

    Raises:
        ValueError: The file is not TOML, or an entry is missing, unknown or out of bounds.
        FileNotFoundError: There is no such file.
    """
    try:
        tables = tomllib.loads(Path(path or _DATA).read_text(encoding="utf-8"))
        return {name: _joint(name, table) for name, table in tables.items()}
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path or _DATA}: not a parameter file: {error}") from None


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


def _joint(name: str, table: Mapping[str, Any]) -> Joint:
    values = _split(table)
    muscles, gears = {}, {}
    for muscle, muscle_table in values.pop("muscles").items():
        parts = _split(muscle_table)
        gears[muscle] = parts.pop("gear")
        muscles[muscle] = Muscle(**parts)
    postures = _split(values.pop("postures", {}))
    told = {f"postures.{muscle}": source for muscle, source in postures.pop("sources").items()}
    values["sources"] = MappingProxyType({**values["sources"], **told})
    return Joint(
        name=name,
        passive=Passive(**_split(values.pop("passive"))),
        muscles=MappingProxyType(muscles),
        gears=MappingProxyType(gears),
        postures=MappingProxyType(postures),
        range=tuple(values.pop("range")),
        **values,
    )


def _split(table: Mapping[str, Any]) -> dict[str, Any]:
    """Constructor arguments from entries ``name = {value = ..., source = ...}``."""
    values: dict[str, Any] = {}
    sources: dict[str, str] = {}
    for name, entry in table.items():
        stated = isinstance(entry, dict) and "value" in entry
        values[name] = entry["value"] if stated else entry
        if stated:
            sources[name] = _source(entry)
    return {**values, "sources": MappingProxyType(sources)}


def _source(entry: Mapping[str, Any]) -> str:
    if "bounds" not in entry:
        return str(entry["source"])
    low, high = entry["bounds"]
    return f"fitted by mjhill identify within {low:g} to {high:g}: {entry['source']}"
