"""Tasks that every rung of the ladder does, and the rungs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Joint
from mjhill.joints.reader import read_joints
from mjhill.lab.batch import driving_torques, joint_angles
from mjhill.lab.rig import as_joint, timestep_of
from mjhill.ladder.exchanged import with_flat_force, with_linear_elements, with_linear_passive

CONSTANT_VELOCITY = "hill, V_max constant"

_EXCHANGED: Mapping[str, Callable[[Joint], Joint]] = MappingProxyType(
    {
        "hill-flat-ata": with_flat_force,
        "hill-linear-pe": with_linear_passive,
        "hill-linear": with_linear_elements,
    }
)

RUNGS = ("hill", CONSTANT_VELOCITY, *_EXCHANGED, "hill-rigid", "dm", "huxley")
"""The models of the ladder; of ``hill, V_max constant`` the parameters were fitted anew."""

_BURST, _LONG, _MOVE = 0.05, 1.0, 0.2  # [s]; estimates, ten times shorter in the eye
_SPAN = 0.2  # of the range of motion that a prescribed movement covers; an estimate

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """One task: what is read, its unit, and the run that any joint can do.

    Attributes:
        quantity: ``torque`` or ``angle``.
        unit: Its unit.
        prescribed: Whether it prescribes the joint's movement.
        run: From the joint under test and the joint that inputs are computed from to values
            at every step.
    """

    quantity: str
    unit: str
    prescribed: bool
    run: Callable[[Joint, Joint], _Values]


def rung(name: str, joint: str | Joint) -> Joint:
    """The joint with the muscles of a rung.

    Raises:
        ValueError: The joint or the model is unknown, or a muscle cannot be made one of it.
    """
    base = as_joint(joint)
    if name == CONSTANT_VELOCITY:
        return read_joints("constant_velocity")[base.name]
    if name in _EXCHANGED:
        return _EXCHANGED[name](base)
    return base if name == "hill" else base.with_muscles(name)


def _steps(joint: Joint, seconds: float) -> int:
    scale = 0.1 if joint.name == "eye" else 1.0
    return round(seconds * scale / timestep_of(joint))


def _drive(joint: Joint, seconds: float, level: float, width: float | None = None) -> _Values:
    excitation = np.zeros((1, _steps(joint, seconds), len(joint.muscles)))
    until = None if width is None else _steps(joint, width)
    excitation[0, :until, 0] = level
    return excitation


def _weightless(joint: Joint) -> Joint:
    """Without inertia: its torque at the corners of a ramp would be most of the range."""
    return replace(joint, inertia=1e-12)


def _isometric(level: float, width: float | None) -> Callable[[Joint, Joint], _Values]:
    def run(joint: Joint, base: Joint) -> _Values:
        excitation = _drive(base, _LONG, level, width)
        path = np.full(excitation.shape[1], base.home_angle)
        torque = driving_torques(
            [_weightless(joint)], path=path, excitation=excitation, timestep=timestep_of(base)
        )
        return np.asarray(torque[0])

    return run


def _ramp(sign: float) -> Callable[[Joint, Joint], _Values]:
    def run(joint: Joint, base: Joint) -> _Values:
        first = next(iter(base.muscles))
        before = [[0.5] + [0.0] * (len(base.muscles) - 1)]
        steps, low, high = _steps(base, _MOVE), *base.range
        shortening = sign * -np.sign(base.gears[first])  # the muscle's length is gear * angle
        course = np.clip((np.arange(2 * steps) - steps / 4) / steps, 0, 1)
        path = base.home_angle + shortening * _SPAN * (high - low) * course
        torque = driving_torques(
            [_weightless(joint)],
            path=path,
            before=before,
            excitation=before,
            timestep=timestep_of(base),
        )
        return np.asarray(torque[0])

    return run


def _free(level: float, width: float | None) -> Callable[[Joint, Joint], _Values]:
    def run(joint: Joint, base: Joint) -> _Values:
        first = next(iter(base.muscles))
        start = base.postures.get(first, base.rest_angle)
        excitation = _drive(base, _LONG, level, width)
        angle = joint_angles(
            [joint], start=start, excitation=excitation, steps=excitation.shape[1],
            timestep=timestep_of(base),
        )  # fmt: skip
        return np.asarray(angle[0])

    return run


TASKS: Mapping[str, Task] = MappingProxyType(
    {
        "twitch": Task("torque", "N·m", True, _isometric(1.0, _BURST / 5)),
        "tetanus": Task("torque", "N·m", True, _isometric(1.0, None)),
        "isovelocity": Task("torque", "N·m", True, _ramp(1.0)),
        "lengthening": Task("torque", "N·m", True, _ramp(-1.0)),
        "free_pulse": Task("angle", "rad", False, _free(1.0, _BURST)),
        "step 0.1": Task("angle", "rad", False, _free(0.1, None)),
        "step 0.5": Task("angle", "rad", False, _free(0.5, None)),
    }
)
"""Tasks by name; an error is in % of the range of the task's quantity under ``hill``."""
