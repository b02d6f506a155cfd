"""Measurements: what went into a joint and what it did, read from a file and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.columns import DECIMALS, Column, Columns, read_columns
from mjhill.identification.inputs import simulated_step
from mjhill.joints.joint import Joint

_LEAST_SAMPLES = 50
_LEAST_DURATION = 0.1  # [s], two of the slowest time constants of a muscle
_COARSE_INTERVAL = 0.2  # [s], from here on samples step over the rise of a muscle
_FINE_INTERVAL = 1e-5  # [s], below it a movement has no measurable change
_LEAST_MOVEMENT = 1e-6  # [rad]
RANGE_MARGIN = 1.0  # [rad] past the range of motion
_TORQUE_MARGIN = 10.0  # external torque over the strongest muscle
_SLIGHTLY = 0.05  # of the span of an excitation, by which it may be below 0 or above 1


@dataclass(frozen=True)
class Measurement:
    """A joint measured: what went in and what it did.

    Attributes:
        source: The file.
        time: Sample times [s], shape (T,), ascending, evenly spaced or not.
        excitation: Excitation [-], 0 to 1, by muscle of the joint, each of shape (T,).
        angle: Angle of the joint [rad], shape (T,).
        torque: External torque on the joint, gravity included [N·m], shape (T,), positive towards
            positive angles.
        digest: SHA-256 of the file in hexadecimal digits; empty where there is none.
        notes: What was done to the numbers of the file, for people.
        simulated: Timestep [s] of the simulation that this is a recording of, None of anything
            else: its inputs were held over each step, and a fit takes the same steps.
    """

    source: str
    time: NDArray[np.float64]
    excitation: Mapping[str, NDArray[np.float64]]
    angle: NDArray[np.float64]
    torque: NDArray[np.float64]
    digest: str = ""
    notes: tuple[str, ...] = ()
    simulated: float | None = None

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ValueError: A series has not the shape of ``time``.
        """
        series = {"angle": self.angle, "torque": self.torque, **self.excitation}
        for name, values in series.items():
            if values.shape != self.time.shape:
                raise ValueError(
                    f"{self.source}: {name} must have the shape of time, {self.time.shape}, "
                    f"got {values.shape}"
                )

    def __len__(self) -> int:
        """The number of samples."""
        return len(self.time)


def read_measurement(
    path: str | Path, joint: Joint, *, torque: float | None = None, decimal: str | None = None
) -> Measurement:
    """Read a measurement of a joint from a CSV file.

    Lines about the device may come first; then a header, maybe a row of units, and rows of
    numbers, separated by commas, semicolons or tabs. A title is a name, maybe with a unit:
    ``Angle [deg]``, ``angle (deg)``, ``angle/deg``, ``angle_deg``. Letters may be large or small.
    The columns, in any order:

    - ``time`` or ``t`` [s];
    - ``angle``, ``position`` or ``<joint>.angle`` [rad];
    - ``torque`` or ``<joint>.applied`` [N·m], unless ``torque`` is given;
    - ``<muscle>`` or ``<muscle>.u`` for each muscle of the joint [-]; or one ``excitation`` that
      drives the first muscle of the joint, while the others are at rest. The joint's name may be
      left out, and ``EMG`` added.

    A column may have any unit of its quantity; without one it has the unit in brackets. Other
    columns are ignored, so a ``Recording`` with an applied torque, saved as ``.csv``, is a
    measurement. Rows at the ends that lack numbers are left out, and an excitation that is off
    its limits by at most 5 % of its span is clipped; ``Measurement.notes`` says so.

    Args:
        path: The file.
        joint: The joint.
        torque: A constant external torque [N·m], for a file that has no column of it.
        decimal: Sign between a number's digits, ``.`` or ``,``; by default what the cells say.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: The file is not such a table, or its numbers cannot be those of the joint;
            the message names the file, the row (line of the file, from 1) and the column.
    """
    _check_options(path, joint, torque, decimal)
    columns = read_columns(path, joint, with_torque=torque is None, decimal=decimal)
    _check_ascending(columns.time)
    _check_sampling(columns.time)
    notes = [*columns.notes, *_assumed(columns)]
    excitation = {}
    for muscle, column in columns.excitation.items():
        excitation[muscle], clipped = _clipped(column)
        notes += clipped
    _check_angle(columns.angle, joint)
    if columns.torque:
        _check_torque(columns.torque, joint)
    _check_change(columns)
    rest = np.zeros_like(columns.time.values)
    return Measurement(
        source=str(path),
        time=columns.time.values,
        excitation={muscle: excitation.get(muscle, rest) for muscle in joint.muscles},
        angle=columns.angle.values,
        torque=columns.torque.values if columns.torque else rest + (torque or 0.0),
        digest=columns.digest,
        notes=tuple(notes if torque is None else [*notes, f"torque: {torque:g} N·m, as given"]),
        simulated=simulated_step(path),
    )


def _check_options(
    path: str | Path, joint: Joint, torque: float | None, decimal: str | None
) -> None:
    if decimal not in (None, *DECIMALS):
        raise ValueError(f"{path}: decimal must be {' or '.join(DECIMALS)}, got {decimal!r}")
    if torque is not None and not abs(torque) <= largest_torque(joint):
        raise ValueError(
            f"{path}: torque must be within ±{largest_torque(joint):g} N·m, got {torque:g}"
        )


def _assumed(columns: Columns) -> list[str]:
    """What the units were taken for, where a wrong guess could pass."""
    guessed = [column for column in (columns.angle, columns.torque) if column]
    return [
        f"{column.title!r} has no unit: taken as {column.unit}"
        for column in guessed
        if not column.stated
    ]


def _check_ascending(time: Column) -> None:
    steps = np.diff(time.values)
    index = _first(steps <= 0) + 1
    if not index:
        return
    if steps[index - 1] == 0:
        raise time.error(
            index,
            f"is the time of row {time.lines[index - 1]} again; each row must have its own: "
            "remove one of them, or write the time with more decimals",
        )
    raise time.error(
        index,
        f"comes after {time.written(index - 1)} in row {time.lines[index - 1]}; time "
        "must ascend: sort the rows by time, and give each trial a file of its own",
    )


def _check_sampling(time: Column) -> None:
    count = len(time.values)
    if count < _LEAST_SAMPLES:
        raise time.error_of_all(
            f"{count} samples are too few to fit; there must be {_LEAST_SAMPLES} or more: "
            "measure for longer or more often"
        )
    interval = round(float(np.median(np.diff(time.values))), 9)  # free of rounding of the times
    duration = round(float(np.ptp(time.values)), 6)
    allowed = f"it must be {_FINE_INTERVAL:g} s or more, and below {_COARSE_INTERVAL:g} s"
    if interval >= _COARSE_INTERVAL:
        hint = "" if time.unit == "ms" else f", or the time is in ms: write `{time.name} [ms]`"
        raise time.error_of_all(
            f"the median interval is {interval:g} s; {allowed}: this is too coarse to see a "
            f"muscle{hint or '; measure more often'}"
        )
    if interval < _FINE_INTERVAL:
        hint = f"the time is in s: write `{time.name} [s]`" if time.unit == "ms" else "keep fewer"
        raise time.error_of_all(
            f"the median interval is {interval:g} s; {allowed}: this is finer than any muscle "
            f"moves; check the unit, or {hint}"
        )
    if duration < _LEAST_DURATION:
        raise time.error_of_all(
            f"{duration:g} s are too few to fit; the time must span {_LEAST_DURATION:g} s or more: "
            "measure for longer"
        )


def _clipped(excitation: Column) -> tuple[NDArray[np.float64], list[str]]:
    """An excitation within 0 to 1, and notes on what was slightly off.

    Raises:
        ValueError: It is further off.
    """
    values = excitation.values
    slightly = _SLIGHTLY * float(np.ptp(values))
    index = _first((values < -slightly) | (values > 1 + slightly))
    if index >= 0:
        raise _no_excitation(excitation, index)
    notes = []
    for off, limit in ((values < 0, "below 0"), (values > 1, "above 1")):
        if off.any():
            worst = int(np.argmax(np.abs(values - 0.5) * off))
            samples = f"{off.sum()} sample{'s' if off.sum() > 1 else ''}"
            notes.append(
                f"{excitation.title!r}: {samples} {limit} clipped, at most "
                f"{excitation.written(worst)}"
            )
    return np.clip(values, 0.0, 1.0), notes


def _no_excitation(excitation: Column, index: int) -> ValueError:
    if excitation.values[index] < 0:
        hint = "remove the offset of the signal, and rectify it"
    elif excitation.factor == 1:
        hint = f"percent? write `{excitation.name} [%]`; or divide by that of a maximal effort"
    else:
        hint = "divide by the excitation of a maximal effort"
    top = "1" if excitation.factor == 1 else "100 %"
    return excitation.error(
        index,
        f"is no excitation; it must be in [0, {top}], or outside by at most "
        f"{100 * _SLIGHTLY:.0f} % of its span: {hint}",
    )


def _check_angle(angle: Column, joint: Joint) -> None:
    low, high = joint.range
    hint = f"degrees? write `{angle.name} [deg]`" if angle.factor == 1 else "check the unit"
    index = _first(np.abs(angle.values) > 2 * math.pi)
    if index >= 0:
        raise angle.error(index, f"is more than a full turn; it must be within 2 pi rad: {hint}")
    index = _first((angle.values < low - RANGE_MARGIN) | (angle.values > high + RANGE_MARGIN))
    if index >= 0:
        raise angle.error(
            index,
            f"is impossible for the {joint.name}; it must be within {RANGE_MARGIN:g} rad of its "
            f"range, {low:g} to {high:g} rad ({math.degrees(low):.0f} to {math.degrees(high):.0f} "
            f"deg): {hint}, or check its sign and zero",
        )


def _check_torque(torque: Column, joint: Joint) -> None:
    limit = largest_torque(joint)
    index = _first(np.abs(torque.values) > limit)
    if index >= 0:
        smaller = f"write `{torque.name} [mN·m]` if it is that"
        hint = smaller if torque.factor == 1 else "check it in the header"
        raise torque.error(
            index,
            f"is too much for the {joint.name}; it must be within ±{limit:g} N·m, "
            f"{_TORQUE_MARGIN:g} times the strongest muscle: wrong unit? {hint}",
        )


def largest_torque(joint: Joint) -> float:
    """The largest external torque [N·m] that is taken as one of the joint."""
    strongest = max(muscle.max_isometric_force for muscle in joint.muscles.values())
    return _TORQUE_MARGIN * strongest


def _check_change(columns: Columns) -> None:
    inputs = [column for column in (columns.torque, *columns.excitation.values()) if column]
    still = np.ptp(columns.angle.values) < _LEAST_MOVEMENT
    if still and all(np.ptp(column.values) == 0 for column in inputs):
        titles = ", ".join(repr(column.title) for column in inputs)
        raise columns.angle.error_of_all(
            f"nothing to learn from: the angle stays within {_LEAST_MOVEMENT:g} rad, and {titles} "
            "never change; an input or the angle must change: measure a movement"
        )


def _first(where: NDArray[np.bool_]) -> int:
    """Index of the first true value, -1 if there is none."""
    return int(np.argmax(where)) if where.any() else -1
