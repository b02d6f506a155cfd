"""A model's parameters as rows of a table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco

from mjhill.engine.layout import (
    addresses,
    elastic_joints,
    read_muscle,
    read_passive,
    turns,
)
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.quantity import quantities
from mjhill.simulate.load import load


def rows(model: str | Path, muscle: str | None = None) -> list[dict[str, Any]]:
    """Every parameter of a joint or of the muscles in a file.

    Each row has ``of``, ``parameter``, ``symbol``, ``value``, ``unit``, ``meaning`` and
    ``source``; a model from a file states no sources.

    Raises:
        ValueError: As ``load``.
    """
    if str(model) in JOINTS:
        joint = JOINTS[str(model)] if muscle is None else JOINTS[str(model)].with_muscles(muscle)
        parts: list[tuple[str, Any, bool]] = [(joint.name, joint, True)]
        parts.append((joint.name, joint.passive, True))
        parts += [(name, muscle, True) for name, muscle in joint.muscles.items()]
        return [row for part in parts for row in _part_rows(*part)] + list(_angle_rows(joint))
    else:
        loaded = load(model, muscle)
        parts = [
            (name, read_passive(loaded, name), hinge) for name, hinge in elastic_joints(loaded)
        ]
        for name, at in addresses(loaded):
            hinge = turns(loaded, at.actuator)
            parts.append((name, read_muscle(loaded, name), hinge))
    return [row for part in parts for row in _part_rows(*part)]


def gravity(model: str | Path) -> str:
    """The gravity of a model in words.

    Raises:
        ValueError: As ``load``.
    """
    loaded = load(model)
    off = loaded.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    if off or not loaded.opt.gravity.any():
        return "none" + (", as in the movements of the paper" if str(model) in JOINTS else "")
    return f"{' '.join(f'{value:g}' for value in loaded.opt.gravity)} m/s²"


def _angle_rows(joint: Joint) -> Iterator[dict[str, Any]]:
    """The angles of a joint that are no parameters of its model."""
    low, high = joint.range
    angles = [
        ("range", low, "least angle of the range of motion, which is no stop"),
        ("range", high, "largest angle of the range of motion"),
        ("home_angle", joint.home_angle, "angle of the home pose"),
    ]
    for muscle, angle in joint.postures.items():
        angles.append((f"postures.{muscle}", angle, "where a step of the muscle starts, at rest"))
    for name, value, meaning in angles:
        yield {
            "of": joint.name,
            "parameter": name,
            "symbol": "",
            "value": value,
            "unit": "rad",
            "meaning": meaning,
            "source": joint.sources.get(name, ""),
        }


def _part_rows(name: str, part: Any, hinge: bool) -> Iterator[dict[str, Any]]:
    for parameter, quantity in quantities(type(part)):
        # a part read from a file states no sources; a shipped joint states all but defaults
        source = part.sources.get(parameter, "default" if part.sources else "")
        yield {
            "of": name,
            "parameter": parameter,
            "symbol": quantity.symbol,
            "value": getattr(part, parameter),
            "unit": quantity.units[0 if hinge else 1],
            "meaning": quantity.meaning,
            "source": source,
        }
