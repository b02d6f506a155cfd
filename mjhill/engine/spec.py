"""Muscles and passive elasticity added to an ``MjSpec``, and the smallest model of a joint."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco

from mjhill.engine.equilibrium import at_home, equilibrate
from mjhill.engine.layout import (
    NUSER_JNT,
    actuator_names,
    muscle_lengths,
    parameter_rows,
    passive_row,
    read_muscles,
)
from mjhill.joints.joint import Joint, Passive
from mjhill.joints.system import Coordinate, System
from mjhill.muscles import Muscle, OperatingPoint, convert, model_of


def joint_spec(joint: Joint) -> mujoco.MjSpec:
    """The smallest model of a joint: one hinge with its inertia, elasticity and muscles.

    No gravity and nothing to see; the same motion as the joint's own model.
    """
    return system_spec(System.of(joint))


def system_spec(system: System) -> mujoco.MjSpec:
    """The smallest model of a system: a body for each coordinate, no gravity, nothing to see.

    A muscle that acts on several coordinates does so through a fixed tendon of its name.
    """
    spec = mujoco.MjSpec()
    spec.modelname = system.name
    spec.option.timestep = 1e-3
    spec.option.gravity = [0, 0, 0]
    spec.compiler.degree = False
    for name, coordinate in system.coordinates.items():
        _add_coordinate(spec, name, coordinate)
    for name, muscle in system.muscles.items():
        arms = system.arms[name]
        if len(arms) == 1:
            [(joint, gear)] = arms.items()
            add_muscle(spec, name=name, muscle=muscle, joint=joint, gear=gear)
            continue
        tendon = spec.add_tendon(name=name)
        for joint, arm in arms.items():
            tendon.wrap_joint(joint, arm)
        add_muscle(spec, name=name, muscle=muscle, tendon=name)
    return spec


def _add_coordinate(spec: mujoco.MjSpec, name: str, coordinate: Coordinate) -> None:
    """A body of its own on a hinge or slide."""
    body = spec.worldbody.add_body(
        name=name,
        mass=coordinate.inertia if coordinate.slide else 1,
        ipos=[0, 0, 0],
        inertia=[1e-3 if coordinate.slide else coordinate.inertia] * 3,
        explicitinertial=True,
    )
    kind = mujoco.mjtJoint.mjJNT_SLIDE if coordinate.slide else mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(
        name=name,
        type=kind,
        axis=[0, 1, 0],
        damping=coordinate.damping,
        stiffness=coordinate.stiffness,
        springref=coordinate.rest,
    )
    if coordinate.passive is not None:
        add_passive(spec, joint=name, passive=coordinate.passive)


def add_muscle(
    spec: mujoco.MjSpec,
    *,
    name: str,
    muscle: Muscle,
    joint: str | None = None,
    tendon: str | None = None,
    gear: float = 1.0,
) -> mujoco.MjsActuator:
    """Add a muscle to a model under construction.

    Length is ``gear`` times the joint's position or the tendon's length, so a muscle that
    pulls towards positive angles of a hinge has a negative gear. The muscle pulls only.

    Args:
        spec: The model under construction.
        name: Name of the actuator.
        muscle: The parameters, of any muscle model, such as ``mjhill.Hill(...)``.
        joint: The joint to act on; this or ``tendon``.
        tendon: The tendon to act on; this or ``joint``.
        gear: Length of the muscle per unit of joint position or tendon length.

    Returns:
        The actuator, for further settings such as ``group``.

    Raises:
        ValueError: The name is taken, the joint or tendon is unknown or not exactly one is
            given, or the gear is 0.
        TypeError: ``muscle`` is no muscle.
    """
    if (joint is None) == (tendon is None):
        raise ValueError(f"muscle {name!r}: give joint=... or tendon=..., one of the two")
    if gear == 0:
        raise ValueError(f"muscle {name!r}: gear must not be 0")
    if name in [actuator.name for actuator in spec.actuators]:
        raise ValueError(f"muscle {name!r}: the model has an actuator of that name already")
    target = joint if joint is not None else tendon
    kind, known = ("joint", spec.joints) if joint is not None else ("tendon", spec.tendons)
    names = [item.name for item in known]
    if target not in names:
        listed = ", ".join(names) or "none"
        raise ValueError(f"muscle {name!r}: unknown {kind} {target!r}; there are: {listed}")
    transmission = mujoco.mjtTrn.mjTRN_JOINT if kind == "joint" else mujoco.mjtTrn.mjTRN_TENDON
    return spec.add_actuator(
        name=name,
        target=target,
        trntype=transmission,
        gear=[gear, 0, 0, 0, 0, 0],
        dyntype=mujoco.mjtDyn.mjDYN_USER,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_USER,
        actdim=model_of(muscle).state_count(muscle),
        ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        ctrlrange=[0, 1],
        # given, so that the compiler does not simulate to find it, which it does for user types
        lengthrange=[-1, 1],
        **parameter_rows(muscle),
    )


def set_muscle(actuator: mujoco.MjsActuator, muscle: Muscle) -> None:
    """Give an actuator that is a muscle new parameters, also of another muscle model."""
    actuator.actdim = model_of(muscle).state_count(muscle)
    for array, row in parameter_rows(muscle).items():
        setattr(actuator, array, row)


def add_passive(spec: mujoco.MjSpec, *, joint: str, passive: Passive) -> None:
    """Give a hinge or slide joint exponential passive elasticity about its ``springref``.

    The linear part of the elasticity is the joint's own ``stiffness``.

    Raises:
        ValueError: The joint is unknown or neither a hinge nor a slide.
    """
    by_name = {item.name: item for item in spec.joints}
    if joint not in by_name:
        raise ValueError(f"unknown joint {joint!r}; there are: {', '.join(by_name) or 'none'}")
    if by_name[joint].type not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        raise ValueError(f"joint {joint!r}: passive elasticity needs a hinge or slide joint")
    by_name[joint].userdata = passive_row(passive)
    if spec.nuser_jnt >= 0:  # -1: as long as the longest, found by the compiler
        spec.nuser_jnt = max(spec.nuser_jnt, NUSER_JNT)


def with_muscles(spec: mujoco.MjSpec, name: str, bins: int | None = None) -> mujoco.MjSpec:
    """A copy of a model with all its muscles as those of another muscle model.

    Poses of its keys stay; there the muscles are steady. A model with linear elements has them
    about the home pose; see ``OperatingPoint``. ``bins`` is the number of bins, for a model that
    has them.

    Raises:
        ValueError: There is no muscle model of this name, a muscle cannot be made one of it, or
            it cannot have so many bins.
    """
    before, changed = spec.copy().compile(), spec.copy()
    names, muscles = actuator_names(before), read_muscles(before)
    lengths = dict(muscle_lengths(before, at_home(before)))
    for actuator, of in zip(changed.actuators, names, strict=True):
        if of in muscles:
            muscle = convert(muscles[of], name, OperatingPoint(length=lengths[of]))
            if bins is not None:
                given: dict[str, Any] = {model_of(muscle).bins: bins}
                muscle = replace(muscle, **given)
            set_muscle(actuator, muscle)
    for key in changed.keys:
        key.act = []
    after = changed.copy().compile()
    data = mujoco.MjData(after)
    for k, key in enumerate(changed.keys):
        mujoco.mj_resetDataKeyframe(after, data, k)
        for i, of in enumerate(names):
            if of not in muscles:  # keeps the states that the key has
                old, new = int(before.actuator_actadr[i]), int(after.actuator_actadr[i])
                count = int(before.actuator_actnum[i])
                data.act[new : new + count] = before.key_act[k, old : old + count]
        equilibrate(after, data)
        key.act = data.act.tolist()
    return changed
