"""The fit of a joint as one function."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mjhill.identification.failure import check_explained
from mjhill.identification.fit import Identified
from mjhill.identification.literature_fit import from_literature
from mjhill.identification.measurement import Measurement, read_measurement
from mjhill.identification.movement import from_measurements
from mjhill.joints.joint import Joint
from mjhill.joints.reader import read_joints


def identify(
    joint: str,
    measurements: Sequence[str | Path | Measurement] = (),
    *,
    predict: str | Sequence[str] | None = None,
    only: Sequence[str] = (),
    inputs: str | None = None,
    delay: bool = False,
    parameters: str | Path | None = None,
    torque: float | Sequence[float] | None = None,
    decimal: str | Sequence[str] | None = None,
    fixed: Mapping[str, float] = MappingProxyType({}),
    start: str = "relaxed",
    progress: Callable[[float], None] | None = None,
) -> Identified:
    """Fit the parameters of a joint within their bounds, and say how sure each is.

    Without measurements the fit is to Table 2 of Winters & Stark (1987), to published passive
    torques and ranges of motion, and to published facts that are not held out. With measurements
    it is to these alone.

    Args:
        joint: The joint's name.
        measurements: CSV files of one person, or measurements already read: time, angle, torque
            and the excitation of each muscle; see ``docs/parameters.md``.
        predict: ``angle`` or ``torque``, once for all measurements or once for each; by default
            torque where the joint is held still, angle elsewhere.
        only: Names of the parameters to fit; by default all that have bounds.
        inputs: ``hold``: each value of an excitation or of the torque lasts until the next
            sample; ``join``: straight lines go from sample to sample. By default as each looks.
        delay: Whether to fit a delay of the excitations too, 0 to 0.1 s.
        parameters: Parameter file with bounds; by default the one that comes with mjhill.
        torque: A constant external torque [N·m], for files that have no column of it; once for
            all or once for each.
        decimal: Sign between a number's digits in the files, ``.`` or ``,``, once for all or once
            for each; by default what the cells say.
        fixed: Without measurements, parameters that are not fitted, and their values. A name such
            as ``hill_shape`` is that of every muscle, ``elbow_flexor.hill_shape`` that of one.
        start: Without measurements, how the joint starts a step of Table 2: ``relaxed``, or
            ``held`` by the antagonist, which is then switched off.
        progress: Called with the share done, 0 to 1.

    Returns:
        The fitted joint, an estimate of each parameter, and the predictions of the measurements.
        Print it, or save it with ``mjhill.identification.write``.

    Raises:
        ValueError: The joint is unknown, a measurement cannot be read, an option does not go
            with the others, or nothing published on the joint comes with mjhill.
        FitError: The fit explains less than half of the variance of a measurement.
        RuntimeError: The fit did not settle.
    """
    known = read_joints(parameters)
    if joint not in known:
        raise ValueError(f"unknown joint {joint!r}; there are: {', '.join(known)}")
    if not measurements:
        if predict or only or inputs or delay or torque is not None or decimal:
            raise ValueError(
                "predict, only, inputs, delay, torque and decimal need measurements; give them"
            )
        return from_literature(joint, parameters, progress, fixed=fixed, start=start)
    if fixed or start != "relaxed":
        raise ValueError("fixed and start are about the literature; leave them out")
    read = _read(measurements, known[joint], torque, decimal)
    result, predictions = from_measurements(
        joint,
        read,
        predict=predict,
        only=only,
        inputs=inputs,
        delay=delay,
        parameters=parameters,
        progress=progress,
    )
    result = replace(result, predictions=tuple(predictions))
    check_explained(result, known[joint], _each("predict", predict, len(read)), inputs)
    return result


def _read(
    measurements: Sequence[str | Path | Measurement],
    joint: Joint,
    torque: float | Sequence[float] | None,
    decimal: str | Sequence[str] | None,
) -> list[Measurement]:
    count = len(measurements)
    options = zip(_each("torque", torque, count), _each("decimal", decimal, count), strict=True)
    read = []
    for one, (constant, sign) in zip(measurements, options, strict=True):
        if not isinstance(one, Measurement):
            read.append(read_measurement(Path(one), joint, torque=constant, decimal=sign))
            continue
        if constant is not None or sign is not None:
            raise ValueError(
                f"{one.source}: torque and decimal are about files, and this measurement has been "
                "read already; leave them out"
            )
        read.append(one)
    return read


def _each(name: str, given: Any, count: int) -> list[Any]:
    """An option for each measurement, given not at all, once for all or once for each."""
    if given is None:
        return [None] * count
    several = isinstance(given, Sequence) and not isinstance(given, str)
    options = list(given) if several else [given]
    if len(options) not in (1, count):
        raise ValueError(
            f"{name} must be given once, or once for each of the {count} measurements, got "
            f"{len(options)}: {', '.join(map(str, options))}"
        )
    return options * (count if len(options) == 1 else 1)
