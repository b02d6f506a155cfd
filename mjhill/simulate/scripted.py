"""Runs from a model's home pose with scripted excitations, and summaries of them."""

from __future__ import annotations

import copy
import math
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import mujoco
import numpy as np

from mjhill.engine.equilibrium import at_home
from mjhill.engine.install import installed
from mjhill.engine.layout import actuator_names, muscle_names
from mjhill.simulate.load import load
from mjhill.simulate.recording import Recording
from mjhill.simulate.run import record
from mjhill.simulate.signals import Signal, as_signal, pulse

LONGEST = 10_000_000  # steps
LARGEST = 4e9  # memory that a recording may take [byte]
_BYTES = 56  # of memory for each number, the most being taken while it is written as text
_SHORT = 10_000  # steps that need no look at the memory
_ROUNDING = 1e-9  # in a sum of excitations


def movement(muscles: list[str]) -> dict[str, Signal]:
    """Excitations of the movement that ``mjhill demo`` shows, 4 s long.

    A step: the first muscle at 30 % for 0.8 s. A pulse pair: it and its antagonist fire one full
    pulse each, as in a fast voluntary movement. Co-contraction: both at 40 %.

    Raises:
        ValueError: There are not two muscles, an agonist and its antagonist.
    """
    if len(muscles) != 2:
        raise ValueError(
            "the scripted movement is for a pair of muscles, and the model has "
            f"{len(muscles)}: {', '.join(muscles) or 'none'}; give the excitations, such as "
            "--excite NAME=0.5"
        )
    agonist, antagonist = muscles
    return {
        agonist: pulse(0.3, 0.2, 0.8) + pulse(1.0, 1.7, 0.12) + pulse(0.4, 2.8, 0.9),
        antagonist: pulse(1.0, 1.85, 0.1) + pulse(0.4, 2.8, 0.9),
    }


def run(
    model: str | Path,
    excitation: Mapping[str, Signal | float],
    torque: Mapping[str, Signal | float],
    duration: float,
    progress: Callable[[float], None] | None = None,
) -> tuple[mujoco.MjModel, Recording]:
    """Run a model from its ``home`` key, or its default pose, with muscles steady and relaxed.

    Args:
        model: A joint's name or a path.
        excitation: Excitations by muscle; without any, the scripted ``movement``.
        torque: External torques by joint.
        duration: Length of the run [s].
        progress: Called now and then with the share done, 0 to 1.

    Raises:
        ValueError: As ``run_loaded`` and ``load``.
        RuntimeError: As ``record``.
    """
    loaded = load(model)
    return loaded, run_loaded(loaded, excitation, torque, duration, progress)


def run_loaded(
    model: mujoco.MjModel,
    excitation: Mapping[str, Signal | float],
    torque: Mapping[str, Signal | float],
    duration: float,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """``run`` with a model that is loaded already.

    Raises:
        ValueError: As ``record``, or an excitation leaves 0 to 1, or the run is too long.
        RuntimeError: As ``record``.
    """
    data = at_home(model)
    excitations = excitation or (movement(muscle_names(model)) if not torque else {})
    _check_excitations(model, excitations)
    with installed():
        _check_length(model, data, duration)
        return record(
            model, data, duration=duration, excitation=excitations, torque=torque, progress=progress
        )


def _check_excitations(model: mujoco.MjModel, excitations: Mapping[str, Signal | float]) -> None:
    """Refuse excitations outside 0 to 1; they are constant between their breaks."""
    native = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_MUSCLE
    names = actuator_names(model)
    muscles = {*muscle_names(model), *(names[index] for index in np.flatnonzero(native))}
    for name in muscles & excitations.keys():
        signal = as_signal(excitations[name])
        for time in (0.0, *signal.breaks):
            if not -_ROUNDING <= signal(time) <= 1 + _ROUNDING:
                raise ValueError(
                    f"excitation of muscle {name!r} must be 0 to 1, got {signal(time):g} at "
                    f"{time:g} s; lower it, or the sum of its parts where there are several"
                )


def _check_length(model: mujoco.MjModel, data: mujoco.MjData, duration: float) -> None:
    """Refuse a run that would take hours or more memory than there may be."""
    timestep = float(model.opt.timestep)
    steps = duration / timestep
    if not math.isfinite(duration) or steps <= _SHORT:
        return  # what is no length, record refuses
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the run itself warns
        series = record(model, copy.copy(data), duration=timestep).series
    memory = _BYTES * (1 + len(series)) * steps
    if steps > LONGEST or memory > LARGEST:
        raise ValueError(
            f"a run of {duration:g} s is {steps:.4g} steps of {timestep:g} s, and its recording "
            f"takes {memory / 1e9:.3g} GB of memory; at most {LONGEST:,} steps and "
            f"{LARGEST / 1e9:g} GB are allowed, here {_longest(timestep, len(series)):.4g} s; "
            "make it shorter, or call mjhill.record with every=..."
        )


def _longest(timestep: float, series: int) -> float:
    return timestep * min(LONGEST, LARGEST / (_BYTES * (1 + series)))


def summary(recording: Recording) -> dict[str, float]:
    """Extremes of a recording, by what they are and their unit."""
    numbers: dict[str, float] = {}
    for name in recording:
        subject, _, quantity = name.rpartition(".")
        values, unit = recording[name], recording.units[name]
        if quantity == "angle":
            numbers[f"{subject} lowest angle [°]"] = float(np.degrees(values.min()))
            numbers[f"{subject} highest angle [°]"] = float(np.degrees(values.max()))
        elif quantity == "velocity" and f"{subject}.angle" in recording.series:
            numbers[f"{subject} peak velocity [°/s]"] = float(np.degrees(np.abs(values).max()))
        elif quantity == "force":
            numbers[f"{subject} peak force [{unit}]"] = float(values.max())
    return numbers
