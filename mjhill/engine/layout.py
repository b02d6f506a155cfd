"""Where a muscle lives in MuJoCo: parameter slots, states, addresses. The one slot table.

A muscle is ``<general dyntype="user" gaintype="fixed" biastype="user" actdim="3">``. Its states
are ``act = [n, a, s]``; its parameters fill ``actuator_dynprm`` (excitation and activation),
``actuator_gainprm`` (length) and ``actuator_biasprm`` (velocity). The exponential passive
elasticity of a joint is in ``jnt_user``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from mjhill.joints.joint import Passive
from mjhill.muscles.hill import Hill

MUSCLE_TAG = 198701.0  # dynprm[0] of a muscle with three states, slots as below
PASSIVE_TAG = 198702.0  # jnt_user[0] of a joint with exponential passive elasticity
STATES = 3  # n, a, s
# joints with one coordinate, which can have passive elasticity
SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))

# parameter -> array and index; gainprm[0] is the gain of the fixed gain type and must be 0
SLOTS: dict[str, tuple[str, int]] = {
    "excitation_tau": ("dynprm", 1),
    "activation_tau": ("dynprm", 2),
    "deactivation_tau": ("dynprm", 3),
    "electrical_stimulation": ("dynprm", 4),
    "activation_floor": ("dynprm", 5),
    "max_isometric_force": ("gainprm", 1),
    "optimal_length": ("gainprm", 2),
    "width_short": ("gainprm", 3),
    "width_long": ("gainprm", 4),
    "series_stretch": ("gainprm", 5),
    "series_shape": ("gainprm", 6),
    "series_limit": ("gainprm", 7),
    "max_velocity": ("biasprm", 0),
    "hill_shape": ("biasprm", 1),
    "eccentric_plateau": ("biasprm", 2),
    "eccentric_slope_ratio": ("biasprm", 3),
    "viscosity": ("biasprm", 4),
    "velocity_activation": ("biasprm", 5),
}
PASSIVE_SLOTS = ("k1_pos", "k2_pos", "k1_neg", "k2_neg", "exponent_limit")  # jnt_user[1:6]
NUSER_JNT = 1 + len(PASSIVE_SLOTS)

# the parameters of ``scheme.muscle_rates``, in its order
RATE_PARAMETERS = (
    "excitation_tau",
    "activation_tau",
    "deactivation_tau",
    "electrical_stimulation",
    "activation_floor",
    "optimal_length",
    "width_short",
    "width_long",
    "series_stretch",
    "series_shape",
    "series_limit",
    "max_velocity",
    "hill_shape",
    "eccentric_plateau",
    "eccentric_slope_ratio",
    "viscosity",
    "velocity_activation",
)
STRETCH_PARAMETERS = RATE_PARAMETERS[4:]  # those of ``scheme.present_stretch``


@dataclass(frozen=True)
class Address:
    """Where one muscle is in the model's and data's arrays.

    Attributes:
        actuator: Actuator id.
        ctrl: Index into ``ctrl``.
        act: Index of n in ``act``; a and s follow.
        out: Index into ``actuator_length``, ``actuator_velocity`` and ``actuator_force``.
    """

    actuator: int
    ctrl: int
    act: int
    out: int


def is_muscle(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether the callbacks serve this actuator: a user actuator, tagged, of three states."""
    return bool(
        model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_USER
        and model.actuator_dynprm[actuator, 0] == MUSCLE_TAG
        and model.actuator_actnum[actuator] == STATES
    )


def turns(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator turns a hinge: its force is a torque [N·m], its length an angle [rad]."""
    on_joint = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
    joint = model.actuator_trnid[actuator, 0]
    return bool(on_joint and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE)


def muscle_ids(model: mujoco.MjModel) -> list[int]:
    """Actuator ids of the muscles of a model."""
    found = (
        (model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_USER))
        & (model.actuator_dynprm[:, 0] == MUSCLE_TAG)
        & (model.actuator_actnum == STATES)
    )
    return [int(i) for i in np.flatnonzero(found)]


def actuator_names(model: mujoco.MjModel) -> list[str]:
    """Name of each actuator; one without a name is called ``actuator<id>``."""
    return _names(model, model.name_actuatoradr, "actuator")


def joint_names(model: mujoco.MjModel) -> list[str]:
    """Name of each joint; one without a name is called ``joint<id>``."""
    return _names(model, model.name_jntadr, "joint")


def _names(model: mujoco.MjModel, starts: np.ndarray, kind: str) -> list[str]:
    text = model.names
    return [
        text[start : text.index(b"\0", start)].decode() or f"{kind}{i}"
        for i, start in enumerate(starts.tolist())
    ]


def muscle_names(model: mujoco.MjModel) -> list[str]:
    """Names of the muscles of a model, in the order of its actuators."""
    names = actuator_names(model)
    return [names[i] for i in muscle_ids(model)]


def address(model: mujoco.MjModel, name: str) -> Address:
    """The addresses of a muscle.

    Raises:
        ValueError: No muscle has this name; the message lists those there are.
    """
    names = muscle_names(model)
    if name not in names:
        known = ", ".join(names) or "none"
        raise ValueError(f"unknown muscle {name!r}; the model's muscles are: {known}")
    return _address(model, muscle_ids(model)[names.index(name)])


def addresses(model: mujoco.MjModel) -> Iterator[tuple[str, Address]]:
    """Name and addresses of each muscle of a model."""
    names = actuator_names(model)
    for actuator in muscle_ids(model):
        yield names[actuator], _address(model, actuator)


def _address(model: mujoco.MjModel, actuator: int) -> Address:
    return Address(
        actuator,
        int(model.actuator_ctrladr[actuator]),
        int(model.actuator_actadr[actuator]),
        int(model.actuator_outadr[actuator]),
    )


def moments(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Moment arms of all outputs, shape (nout, nv); needs ``mj_fwdPosition``."""
    dense = np.zeros((model.nout, model.nv))
    mujoco.mju_sparse2dense(
        dense, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    return dense


def read_muscle(model: mujoco.MjModel, name: str) -> Hill:
    """The parameters of a muscle, from the model's arrays.

    Raises:
        ValueError: No muscle has this name, or a value is outside its bounds.
    """
    return _muscle(model, name, address(model, name).actuator)


def read_muscles(model: mujoco.MjModel) -> dict[str, Hill]:
    """The parameters of all muscles by name.

    Raises:
        ValueError: A value is outside its bounds.
    """
    return {name: _muscle(model, name, at.actuator) for name, at in addresses(model)}


def _muscle(model: mujoco.MjModel, name: str, actuator: int) -> Hill:
    rows = {array: getattr(model, f"actuator_{array}")[actuator] for array in _ARRAYS}
    values: dict[str, Any] = {
        parameter: float(rows[array][slot]) for parameter, (array, slot) in SLOTS.items()
    }
    try:
        return Hill(**values)
    except ValueError as error:
        raise ValueError(f"muscle {name!r}: {error}") from None


def parameter_columns(model: mujoco.MjModel, actuators: list[int]) -> dict[str, np.ndarray]:
    """Each parameter of the given muscles, shape (len(actuators),)."""
    rows = {array: getattr(model, f"actuator_{array}")[actuators] for array in _ARRAYS}
    return {name: rows[array][:, slot] for name, (array, slot) in SLOTS.items()}


def write_muscle(model: mujoco.MjModel, name: str, muscle: Hill) -> None:
    """Write the parameters of a muscle into the model's arrays.

    Raises:
        ValueError: No muscle has this name.
    """
    i = address(model, name).actuator
    for array, row in parameter_rows(muscle).items():
        getattr(model, f"actuator_{array}")[i] = row


def parameter_rows(muscle: Hill) -> dict[str, np.ndarray]:
    """The rows ``dynprm``, ``gainprm`` and ``biasprm`` of a muscle, shape (10,) each."""
    rows = {array: np.zeros(10) for array in _ARRAYS}
    rows["dynprm"][0] = MUSCLE_TAG
    for parameter, (array, slot) in SLOTS.items():
        rows[array][slot] = float(getattr(muscle, parameter))
    return rows


def has_passive(model: mujoco.MjModel, joint: int) -> bool:
    """Whether a joint has exponential passive elasticity."""
    return bool(model.nuser_jnt >= NUSER_JNT and model.jnt_user[joint, 0] == PASSIVE_TAG)


def read_passive(model: mujoco.MjModel, name: str) -> Passive:
    """The exponential passive elasticity of a joint, from the model's arrays.

    Raises:
        ValueError: No joint has this name, it has no passive elasticity of ours, or a value is
            outside its bounds.
    """
    joint = joint_id(model, name)
    if not has_passive(model, joint):
        raise ValueError(
            f"joint {name!r} has no mjhill passive elasticity; give it one with "
            "mjhill.add_passive(spec, joint=..., passive=...)"
        )
    values = dict(zip(PASSIVE_SLOTS, model.jnt_user[joint, 1:].tolist(), strict=False))
    try:
        return Passive(**values)
    except ValueError as error:
        raise ValueError(f"joint {name!r}: {error}") from None


def write_passive(model: mujoco.MjModel, name: str, passive: Passive) -> None:
    """Write the exponential passive elasticity of a joint into the model's arrays.

    Raises:
        ValueError: No joint has this name, or it has no passive elasticity of ours.
    """
    read_passive(model, name)
    model.jnt_user[joint_id(model, name), :NUSER_JNT] = passive_row(passive)


def passive_row(passive: Passive) -> np.ndarray:
    """The start of ``jnt_user`` that holds a passive elasticity, shape (6,)."""
    return np.array([PASSIVE_TAG, *(getattr(passive, slot) for slot in PASSIVE_SLOTS)])


def joint_id(model: mujoco.MjModel, name: str) -> int:
    """The id of a joint.

    Raises:
        ValueError: No joint has this name; the message lists those there are.
    """
    names = joint_names(model)
    if name not in names:
        raise ValueError(
            f"unknown joint {name!r}; the model's joints are: {', '.join(names) or 'none'}"
        )
    return names.index(name)


_ARRAYS = ("dynprm", "gainprm", "biasprm")
