"""Where fitted values come from, as a parameter file says it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from mjhill.identification.fit import Estimate, Identified
from mjhill.identification.measurement import Measurement
from mjhill.joints.reader import FITTED, parameter_file

INFORMED = 0.1  # share from the data below which a value is said to be that of its bounds
_BOUNDS = "; bounds: "  # before what the file said of a parameter: where its bounds come from
_UNINFORMED = "not informed by "
_NAMED = 3  # files that are named with each value; all are in the header
_SHORT = 12  # digits of a hash beside a value


def source_text(result: Identified, estimate: Estimate, before: str) -> str:
    """The source of a value that was fitted to measurements.

    Args:
        result: The fit.
        estimate: The parameter.
        before: The source that it had in the file that the fit started from.
    """
    measurements = [prediction.measurement for prediction in result.predictions]
    files = ", ".join(map(_short, measurements[:_NAMED]))
    if len(measurements) > _NAMED:
        files += f" and {len(measurements) - _NAMED} more, see the top of the file"
    low, high = estimate.bounds
    share = f"{100 * estimate.informed:.0f} % from the data"
    if estimate.informed < INFORMED:
        text = (
            f"{_UNINFORMED}{files}: {share}, so the value is that of the bounds {low:g} to {high:g}"
        )
    else:
        text = (
            f"{FITTED}{files} within {low:g} to {high:g}: {share}, "
            f"95 % interval {estimate.low:.4g} to {estimate.high:.4g}"
        )
    if before.startswith((FITTED, _UNINFORMED)) and _BOUNDS in before:
        before = before.partition(_BOUNDS)[2]  # of an earlier fit to measurements
    return text + _BOUNDS + before


def pinned_text(before: str, bounds: Sequence[float]) -> str:
    """The source of a value that was fixed.

    Args:
        before: The source that it had while it was free.
        bounds: The bounds that it had.
    """
    low, high = bounds
    return f"fixed by mjhill identify, not fitted within {low:g} to {high:g}: {before}"


def header(results: Sequence[Identified], parameters: str | Path | None) -> str:
    """Comment lines about what was fixed and about fits to measurements; often none.

    Args:
        results: The fits.
        parameters: The file that they started from; None for the one that comes with mjhill.
    """
    measured = [result for result in results if result.predictions]
    pinned = {item.path[-1]: value for result in results for item, value in result.pinned}
    if not measured:
        if not pinned:
            return ""
        listed = ", ".join(f"{name} = {value:g}" for name, value in pinned.items())
        return f"# Made by mjhill identify with --fix: {listed}.\n\n"
    lines = []
    for result in measured:
        lines.append(
            f"{result.joint.name}: fitted by mjhill {version('mjhill')}, mjhill.identify (the "
            "command `mjhill identify`), to"
        )
        for item in result.predictions:
            one = item.measurement
            digest = f"SHA-256 {one.digest}" if one.digest else "not read from a file"
            lines.append(f"  {_name(one)}: {digest},")
            lines.append(
                f"    {len(one)} rows, {item.quantity} predicted, "
                f"{100 * item.explained:.2f} % of its variance explained"
            )
            lines.append(f"    inputs between rows: {item.inputs}")
            lines += [f"    {note}" for note in item.notes]
        lines.append(f"  fitted: {', '.join(one.name for one in result.estimates)}")
        if late := result.delay:
            lines.append(
                f"  delay of the excitations, not part of the joint: {late.value:.4g} s, "
                f"95 % interval {late.low:.4g} to {late.high:.4g}"
            )
        unknown = [one.name for one in result.estimates if one.informed < INFORMED]
        if unknown:
            lines.append(
                f"  of these, less than {100 * INFORMED:.0f} % from the data and so the value of "
                f"the bounds: {', '.join(unknown)}"
            )
    start = "joints.toml, which comes with mjhill"
    if parameters:
        file = parameter_file(parameters)
        start = f"{file.name}, SHA-256 {hashlib.sha256(file.read_bytes()).hexdigest()}"
    lines.append(f"All else, with the comments that follow, is that of {start}.")
    return "".join(f"# {_printable(line)}\n" for line in lines) + "\n"


def _short(measurement: Measurement) -> str:
    digest = f" (SHA-256 {measurement.digest[:_SHORT]})" if measurement.digest else ""
    return _printable(_name(measurement)) + digest


def _name(measurement: Measurement) -> str:
    return Path(measurement.source).name or measurement.source


def _printable(text: str) -> str:
    """Text on one line: names of files may hold anything."""
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode("ascii")
        for letter in text
    )
