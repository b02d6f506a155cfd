"""Recordings: named time series of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.muscles import Muscle

LONGEST_NAME = 10_000
_UNITLESS = "-"


@dataclass(frozen=True, eq=False)
class Recording:
    """A run as named time series.

    Names are ``<object>.<quantity>``: ``elbow.angle``, ``elbow_flexor.force``. Two recordings are
    equal if all they hold is, to the last bit.

    Attributes:
        time: Sample times [s], shape (T,), ascending.
        series: Name to values, each of shape (T,).
        units: Name to unit, for each name in ``series``.
        about: What was run: model, integrator, timestep, versions; strings and numbers.
        muscles: Parameters of the mjhill muscles, by name.
    """

    time: NDArray[np.float64]
    series: Mapping[str, NDArray[np.float64]]
    units: Mapping[str, str]
    about: Mapping[str, str | float] = field(default_factory=dict)
    muscles: Mapping[str, Muscle] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check names and shapes.

        Raises:
            ValueError: A series has no unit or not the shape of ``time``, its values are not
                real numbers, or a name or unit could not be saved.
        """
        object.__setattr__(self, "time", _real("time", self.time))
        if self.time.ndim != 1:
            raise ValueError(f"time must have one dimension, got shape {self.time.shape}")
        series = {name: _real(f"series {name!r}", values) for name, values in self.series.items()}
        object.__setattr__(self, "series", series)
        for name, values in series.items():
            _check_name(name)
            if values.shape != self.time.shape:
                raise ValueError(
                    f"series {name!r} must have the shape of time, {self.time.shape}, "
                    f"got {values.shape}"
                )
            if name not in self.units:
                raise ValueError(f"series {name!r} has no unit; use {_UNITLESS!r} for none")
            _check_unit(name, self.units[name])

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The values of one series, shape (T,).

        Raises:
            KeyError: No such series; the message lists those there are.
        """
        if name not in self.series:
            raise KeyError(f"no series {name!r}; there are: {', '.join(map(shown, self.series))}")
        return self.series[name]

    def __iter__(self) -> Iterator[str]:
        """The names of the series."""
        return iter(self.series)

    def __len__(self) -> int:
        """The number of samples."""
        return len(self.time)

    def __eq__(self, other: object) -> bool:
        """Whether another recording holds the same, to the last bit and in the same order."""
        if not isinstance(other, Recording):
            return NotImplemented
        return (
            list(self.series) == list(other.series)
            and all(self.units[name] == other.units[name] for name in self.series)
            and dict(self.about) == dict(other.about)
            and dict(self.muscles) == dict(other.muscles)
            and self.time.tobytes() == other.time.tobytes()
            and all(self[name].tobytes() == other[name].tobytes() for name in self.series)
        )

    __hash__ = None  # type: ignore[assignment]  # arrays can be changed

    def save(self, path: str | Path) -> Path:
        """Write the recording to ``path``, as ``.csv`` or ``.npz`` by its suffix.

        CSV holds a comment line (``# `` and JSON), a header of ``name [unit]`` and rows of
        shortest exact decimals, so that loading gives back the same bits. NPZ holds the arrays
        ``time`` and ``series``, shape (number of series, T), and names and units as
        ``meta.json``. The file appears whole or not at all.

        Returns:
            The path written.

        Raises:
            ValueError: The suffix is neither ``.csv`` nor ``.npz``.
            OSError: The folder is missing or cannot be written.
        """
        from mjhill.simulate.recording_files import save

        return save(self, Path(path))

    @staticmethod
    def load(path: str | Path) -> Recording:
        """Read a recording that ``save`` wrote.

        Raises:
            ValueError: The file is not a recording, or a damaged one; the message names the
                file and the place in it. Nothing in a file is executed, and no more memory is
                taken than its size allows for.
            FileNotFoundError: There is no such file.
        """
        from mjhill.simulate.recording_files import load

        return load(Path(path), Recording)


def shown(name: str) -> str:
    """A name as it can be printed: as it is, or escaped where it would control a terminal."""
    return name if name.isprintable() else ascii(name)[1:-1]


def _real(what: str, values: Any) -> NDArray[np.float64]:
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{what} must hold real numbers, got {array.dtype}")
    return array.astype(np.float64, copy=False)


def _check_name(name: Any) -> None:
    if not isinstance(name, str) or not 0 < len(name) <= LONGEST_NAME:
        found = f"{len(name)} characters" if isinstance(name, str) else repr(name)
        raise ValueError(f"the name of a series must be text of 1 to {LONGEST_NAME}, got {found}")
    if not _can_be_written(name):
        raise ValueError(f"the name of series {name!a} cannot be written as UTF-8; rename it")


def _check_unit(name: str, unit: Any) -> None:
    good = isinstance(unit, str) and unit.isprintable() and len(unit) <= 100
    if not good or "[" in unit or "]" in unit:
        raise ValueError(
            f"the unit of series {name!r} must be short printable text without brackets, "
            f"got {unit!r:.120}"
        )


def _can_be_written(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
