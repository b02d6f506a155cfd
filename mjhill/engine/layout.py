"""Where a muscle lives in MuJoCo: states, parameter slots, addresses.

A muscle is ``<general dyntype="user" gaintype="fixed" biastype="user">``. ``actuator_dynprm[0]``
is the tag of its model, which says how many states it has and in which slots of ``dynprm``,
``gainprm`` and ``biasprm`` its parameters are. The exponential passive elasticity of a joint is
in ``jnt_user``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.joints.joint import Passive
from mjhill.muscles import BY_TAG, MODELS, TAGS, Muscle, MuscleModel, model_of
from mjhill.muscles.model import arguments

PASSIVE_TAG = 198702.0  # jnt_user[0] of a joint with exponential passive elasticity
# joints with one coordinate, which can have passive elasticity
SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
PASSIVE_SLOTS = ("k1_pos", "k2_pos", "k1_neg", "k2_neg", "exponent_limit")  # jnt_user[1:6]
NUSER_JNT = 1 + len(PASSIVE_SLOTS)
ARRAYS = ("dynprm", "gainprm", "biasprm")

_USER = int(mujoco.mjtDyn.mjDYN_USER)


@dataclass(frozen=True)
class Address:
    """Where one muscle is in the model's and data's arrays.

    Attributes:
        actuator: Actuator id.
        ctrl: Index into ``ctrl``.
        act: Index of its first state in ``act``.
        out: Index into ``actuator_length``, ``actuator_velocity`` and ``actuator_force``.
        model: Its muscle model.
    """

    actuator: int
    ctrl: int
    act: int
    out: int
    model: MuscleModel

    def state(self, name: str) -> int:
        """Index of a named state in ``act``."""
        return self.act + self.model.state_names.index(name)


@dataclass(frozen=True)
class Group:
    """All muscles of one muscle model.

    Attributes:
        model: The muscle model.
        actuators: Their ids, ascending, shape (n,).
        columns: Each parameter, shape (n,).
    """

    model: MuscleModel
    actuators: NDArray[np.int_]
    columns: Mapping[str, NDArray[np.float64]]

    def rows(self, equation: Any, **context: Any) -> Iterator[tuple[Any, ...]]:
        """What an equation asks for, muscle by muscle, in the order of its arguments.

        Args:
            equation: The equation.
            context: What is no parameter, by name: a value for each muscle.
        """
        wanted = (
            context[name] if name in context else self.columns[name].tolist()
            for name in arguments(equation)
        )
        return zip(*wanted, strict=True)

    def ask(self, equation: Any) -> Any:
        """The value of an equation of parameters alone, for all muscles at once."""
        return self.model.ask_columns(equation, self.columns)


def has_tag(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which actuators have a tag of mjhill, known or unknown."""
    tags = model.actuator_dynprm[:, 0]
    return np.asarray((tags >= TAGS[0]) & (tags < TAGS[1]))


def is_muscle(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether the callbacks serve an actuator: of user type, tagged, with its model's states."""
    return model_of_actuator(model, actuator) is not None


def model_of_actuator(model: mujoco.MjModel, actuator: int) -> MuscleModel | None:
    """The muscle model of an actuator; None if the callbacks do not serve it."""
    kind = BY_TAG.get(float(model.actuator_dynprm[actuator, 0]))
    if kind is None or model.actuator_dyntype[actuator] != _USER:
        return None
    wanted = int(_state_counts(model, kind, np.array([actuator]))[0])
    return kind if model.actuator_actnum[actuator] == wanted else None


def muscle_groups(model: mujoco.MjModel) -> list[Group]:
    """The muscles of a model by muscle model, those that it has."""
    tags = np.where(model.actuator_dyntype == _USER, model.actuator_dynprm[:, 0], 0.0)
    groups = []
    for kind in MODELS:
        found = np.flatnonzero(tags == kind.tag)
        if found.size:
            found = found[model.actuator_actnum[found] == _state_counts(model, kind, found)]
        if found.size:
            groups.append(Group(kind, found, _columns(model, kind, found)))
    return groups


def state_count(model: mujoco.MjModel, kind: MuscleModel, actuator: int) -> int:
    """The number of states that an actuator with the tag of a muscle model must have."""
    return int(_state_counts(model, kind, np.array([actuator]))[0])


def _state_counts(
    model: mujoco.MjModel, kind: MuscleModel, actuators: NDArray[np.int_]
) -> NDArray[np.float64]:
    if not kind.bins:
        return np.full(len(actuators), float(len(kind.states)))
    array, slot = kind.slots[kind.bins]
    return np.asarray(len(kind.states) + getattr(model, f"actuator_{array}")[actuators, slot])


def _columns(
    model: mujoco.MjModel, kind: MuscleModel, actuators: NDArray[np.int_]
) -> dict[str, NDArray[np.float64]]:
    rows = {array: getattr(model, f"actuator_{array}")[actuators] for array in ARRAYS}
    return {name: rows[array][:, slot] for name, (array, slot) in kind.slots.items()}


def muscle_ids(model: mujoco.MjModel) -> list[int]:
    """Actuator ids of the muscles of a model."""
    return ids_of(muscle_groups(model))


def ids_of(groups: list[Group]) -> list[int]:
    """Actuator ids of the muscles of some groups, ascending."""
    return sorted(actuator for group in groups for actuator in group.actuators.tolist())


def in_order(groups: list[Group], equation: str) -> tuple[NDArray[np.float64], ...]:
    """What an equation of parameters gives for all muscles of a model, in the order of their ids.

    Args:
        groups: Those of ``muscle_groups``, at least one.
        equation: A field of ``MuscleModel``, or the name of a parameter that all have.

    Returns:
        Each result, shape (number of muscles,).
    """
    order = np.argsort(np.concatenate([group.actuators for group in groups]))
    found = []
    for group in groups:
        stated = getattr(group.model, equation, None)
        value = group.columns[equation] if stated is None else group.ask(stated)
        found.append(value if isinstance(value, tuple) else (value,))
    return tuple(np.concatenate(part)[order] for part in zip(*found, strict=True))


def turns(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator turns a hinge: its force is a torque [N·m], its length an angle [rad]."""
    on_joint = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
    joint = model.actuator_trnid[actuator, 0]
    return bool(on_joint and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE)


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
    for actuator, known in enumerate(actuator_names(model)):
        if known == name and is_muscle(model, actuator):
            return _address(model, actuator)
    listed = ", ".join(muscle_names(model)) or "none"
    raise ValueError(f"unknown muscle {name!r}; the model's muscles are: {listed}")


def addresses(model: mujoco.MjModel) -> Iterator[tuple[str, Address]]:
    """Name and addresses of each muscle of a model, in the order of its actuators."""
    names = actuator_names(model)
    for actuator in muscle_ids(model):
        yield names[actuator], _address(model, actuator)


def muscle_lengths(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[tuple[str, float]]:
    """Name of each muscle and its length less that at ``qpos0``; needs ``mj_fwdPosition``."""
    for name, at in addresses(model):
        yield name, float(data.actuator_length[at.out] - model.actuator_length0[at.out])


def _address(model: mujoco.MjModel, actuator: int) -> Address:
    return Address(
        actuator,
        int(model.actuator_ctrladr[actuator]),
        int(model.actuator_actadr[actuator]),
        int(model.actuator_outadr[actuator]),
        BY_TAG[float(model.actuator_dynprm[actuator, 0])],
    )


def moments(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Moment arms of all outputs, shape (nout, nv); needs ``mj_fwdPosition``."""
    dense = np.zeros((model.nout, model.nv))
    mujoco.mju_sparse2dense(
        dense, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    return dense


def read_muscle(model: mujoco.MjModel, name: str) -> Muscle:
    """The parameters of a muscle, from the model's arrays.

    Raises:
        ValueError: No muscle has this name, or a value is outside its bounds.
    """
    return _muscle(model, name, address(model, name))


def read_muscles(model: mujoco.MjModel) -> dict[str, Muscle]:
    """The parameters of all muscles by name.

    Raises:
        ValueError: A value is outside its bounds.
    """
    return {name: _muscle(model, name, at) for name, at in addresses(model)}


def _muscle(model: mujoco.MjModel, name: str, at: Address) -> Muscle:
    rows = {array: getattr(model, f"actuator_{array}")[at.actuator] for array in ARRAYS}
    try:
        return parameters_in(at.model, rows)
    except ValueError as error:
        raise ValueError(f"muscle {name!r}: {error}") from None


def parameters_in(kind: MuscleModel, rows: Mapping[str, Any]) -> Muscle:
    """The parameters that the rows ``dynprm``, ``gainprm`` and ``biasprm`` hold.

    Raises:
        ValueError: A value is outside its bounds.
    """
    values: dict[str, Any] = {
        parameter: float(rows[array][slot]) for parameter, (array, slot) in kind.slots.items()
    }
    return kind.parameters(**values)


def write_muscle(model: mujoco.MjModel, name: str, muscle: Muscle) -> None:
    """Write the parameters of a muscle into the model's arrays.

    Raises:
        ValueError: No muscle has this name, or it is one of another muscle model or of another
            number of states.
    """
    at, kind = address(model, name), model_of(muscle)
    if kind is not at.model:
        raise ValueError(
            f"muscle {name!r} is of the model {at.model.name!r} and was given parameters of "
            f"{kind.name!r}; load the model again with muscle={kind.name!r}, or give it a "
            f"mjhill.{at.model.parameters.__name__}"
        )
    states = int(model.actuator_actnum[at.actuator])
    if kind.state_count(muscle) != states:
        raise ValueError(
            f"muscle {name!r} has {states} states and was given parameters for "
            f"{kind.state_count(muscle)}; their number cannot change in a compiled model"
        )
    for array, row in parameter_rows(muscle).items():
        getattr(model, f"actuator_{array}")[at.actuator] = row


def parameter_rows(muscle: Muscle) -> dict[str, np.ndarray]:
    """The rows ``dynprm``, ``gainprm`` and ``biasprm`` of a muscle, shape (10,) each."""
    kind, rows = model_of(muscle), {array: np.zeros(10) for array in ARRAYS}
    rows["dynprm"][0] = kind.tag
    for parameter, (array, slot) in kind.slots.items():
        rows[array][slot] = float(getattr(muscle, parameter))
    return rows


def has_passive(model: mujoco.MjModel, joint: int) -> bool:
    """Whether a joint has exponential passive elasticity."""
    return bool(model.nuser_jnt >= NUSER_JNT and model.jnt_user[joint, 0] == PASSIVE_TAG)


def elastic_joints(model: mujoco.MjModel) -> Iterator[tuple[str, bool]]:
    """Joints with passive elasticity, and whether each is a hinge."""
    for joint, name in enumerate(joint_names(model)):
        if has_passive(model, joint):
            yield name, bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE)


def read_passive(model: mujoco.MjModel, name: str) -> Passive:
    """The exponential passive elasticity of a joint, from the model's arrays.

    Raises:
        ValueError: No joint has this name, it has no passive elasticity of mjhill, or a value is
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
        ValueError: No joint has this name, or it has no passive elasticity of mjhill.
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
