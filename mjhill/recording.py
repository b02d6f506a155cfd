"""Recordings: named time series of a run, saved and loaded without loss."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.files import replacing

_UNITLESS = "-"


@dataclass(frozen=True)
class Recording:
    """A run as named time series.

    Names are ``<object>.<quantity>``: ``elbow.angle``, ``elbow_flexor.force``.

    Attributes:
        time: Sample times [s], shape (T,), ascending.
        series: Name to values, each of shape (T,).
        units: Name to unit, for each name in ``series``.
        about: What was run: model, integrator, timestep, versions; strings and numbers.
    """

    time: NDArray[np.float64]
    series: Mapping[str, NDArray[np.float64]]
    units: Mapping[str, str]
    about: Mapping[str, str | float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ValueError: A series has no unit or not the shape of ``time``.
        """
        for name, values in self.series.items():
            if values.shape != self.time.shape:
                raise ValueError(
                    f"series {name!r} must have the shape of time, {self.time.shape}, "
                    f"got {values.shape}"
                )
            if name not in self.units:
                raise ValueError(f"series {name!r} has no unit; use {_UNITLESS!r} for none")

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The values of one series, shape (T,).

        Raises:
            KeyError: No such series; the message lists those there are.
        """
        if name not in self.series:
            raise KeyError(f"no series {name!r}; there are: {', '.join(self.series)}")
        return self.series[name]

    def __iter__(self) -> Iterator[str]:
        """The names of the series."""
        return iter(self.series)

    def __len__(self) -> int:
        """The number of samples."""
        return len(self.time)

    def save(self, path: str | Path) -> Path:
        """Write the recording to ``path``, as ``.csv`` or ``.npz`` by its suffix.

        CSV holds a comment line (``# `` and JSON), a header of ``name [unit]`` and rows of
        shortest exact decimals, so that loading gives back the same bits. The file appears
        whole or not at all.

        Returns:
            The path written.

        Raises:
            ValueError: The suffix is neither ``.csv`` nor ``.npz``.
            OSError: The folder is missing or cannot be written.
        """
        path = Path(path)
        writers = {".csv": _write_csv, ".npz": _write_npz}
        if path.suffix not in writers:
            raise ValueError(f"recording {str(path)!r} must end in .csv or .npz")
        with replacing(path) as partial:
            writers[path.suffix](self, partial)
        return path

    @staticmethod
    def load(path: str | Path) -> Recording:
        """Read a recording that ``save`` wrote.

        Raises:
            ValueError: The file is not a recording.
            FileNotFoundError: There is no such file.
        """
        path = Path(path)
        readers = {".csv": _read_csv, ".npz": _read_npz}
        if path.suffix not in readers:
            raise ValueError(f"recording {str(path)!r} must end in .csv or .npz")
        return readers[path.suffix](path)


def _write_csv(recording: Recording, path: Path) -> None:
    columns = [recording.time, *recording.series.values()]
    header = ["time [s]"] + [f"{name} [{recording.units[name]}]" for name in recording.series]
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {json.dumps(dict(recording.about))}\n")
        writer = csv.writer(file)
        writer.writerow(header)
        # repr of a float is its shortest decimal that reads back to the same bits
        writer.writerows(zip(*(map(repr, column.tolist()) for column in columns), strict=True))


def _read_csv(path: Path) -> Recording:
    with path.open(newline="", encoding="utf-8") as file:
        first = file.readline()
        rows = csv.reader(file)
        header = next(rows, [])
        if not first.startswith("# ") or header[:1] != ["time [s]"]:
            raise ValueError(
                f"{path}: not a mjhill recording: line 1 must start with '# ' and line 2 "
                "with 'time [s]'"
            )
        try:
            table = np.array([[float(cell) for cell in row] for row in rows], dtype=np.float64)
            about = json.loads(first[2:])
            columns = table.reshape(-1, len(header)).T.copy()
        except ValueError as error:
            raise ValueError(f"{path}: damaged recording: {error}") from error
    names, units = [], {}
    for title in header[1:]:
        name, _, unit = title.rpartition(" [")
        names.append(name)
        units[name] = unit.removesuffix("]")
    return Recording(columns[0], dict(zip(names, columns[1:], strict=True)), units, about)


def _write_npz(recording: Recording, path: Path) -> None:
    meta = {"units": dict(recording.units), "about": dict(recording.about)}
    arrays = {"time": recording.time, "meta": np.array(json.dumps(meta)), **recording.series}
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def _read_npz(path: Path) -> Recording:
    with np.load(path, allow_pickle=False) as archive:
        if "meta" not in archive or "time" not in archive:
            raise ValueError(f"{path}: not a mjhill recording: it has no 'time' and 'meta'")
        meta = json.loads(str(archive["meta"]))
        series = {name: archive[name] for name in archive.files if name not in ("time", "meta")}
        return Recording(archive["time"], series, meta["units"], meta["about"])
