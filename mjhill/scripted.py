"""Runs from a model's home pose with scripted inputs, and what to say about them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import mujoco
import numpy as np

from mjhill.equilibrium import at_home
from mjhill.install import installed
from mjhill.layout import muscle_names
from mjhill.models import load
from mjhill.recording import Recording
from mjhill.run import record
from mjhill.signals import Signal, pulse


def movement(muscles: list[str]) -> dict[str, Signal]:
    """Neural inputs of the movement that ``mjhill demo`` shows, 4 s long.

    A step: the first muscle at 30 % for 0.8 s. A pulse pair: it and its antagonist fire one full
    pulse each, as in a fast voluntary movement. Co-contraction: both at 40 %.

    Raises:
        ValueError: There are not two muscles, an agonist and its antagonist.
    """
    if len(muscles) != 2:
        raise ValueError(
            "the scripted movement is for a pair of muscles, and the model has "
            f"{len(muscles)}: {', '.join(muscles) or 'none'}; give the inputs, such as "
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
    """Run a model from its ``home`` key, or its default pose, with muscles steady at no input.

    Args:
        model: A joint's name or a path.
        excitation: Neural inputs by muscle; without any, the scripted ``movement``.
        torque: External torques by joint.
        duration: Length of the run [s].
        progress: Called now and then with the share done, 0 to 1.

    Raises:
        ValueError: As ``load`` and ``record``.
        RuntimeError: As ``record``.
    """
    loaded = load(model)
    data = at_home(loaded)
    inputs = excitation or (movement(muscle_names(loaded)) if not torque else {})
    with installed():
        recording = record(
            loaded, data, duration=duration, excitation=inputs, torque=torque, progress=progress
        )
    return loaded, recording


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
