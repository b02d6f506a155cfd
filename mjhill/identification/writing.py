"""Fitted values put into a parameter file, with its bounds, sources and comments kept."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from mjhill.files import replacing
from mjhill.identification.identified import Identified
from mjhill.joints.reader import parameter_file

_DIGITS = 4  # significant


def parameter_text(results: Iterable[Identified], parameters: str | Path | None = None) -> str:
    """The text of a parameter file with the values of some joints replaced by fitted ones.

    Args:
        results: The fitted joints.
        parameters: The file to start from; by default the one that comes with mjhill.
    """
    import tomlkit

    document = tomlkit.parse(Path(parameters or parameter_file()).read_text(encoding="utf-8"))
    for result in results:
        for free, estimate in zip(result.free, result.estimates, strict=True):
            entry = document[result.joint.name]
            for key in free.path:
                entry = entry[key]  # type: ignore[index]
            entry["value"] = rounded(estimate.value, free.low, free.high)  # type: ignore[index]
    return tomlkit.dumps(document)


def write_parameters(
    path: str | Path, results: Iterable[Identified], parameters: str | Path | None = None
) -> None:
    """Write ``parameter_text`` to a file, whole or not at all.

    Raises:
        OSError: The folder is missing or cannot be written.
    """
    with replacing(path) as partial:
        partial.write_text(parameter_text(results, parameters), encoding="utf-8")


def rounded(value: float, low: float, high: float) -> float:
    """A value to four significant digits, still inside its bounds."""
    return min(max(float(f"{value:.{_DIGITS}g}"), low), high)
