"""Random models with muscles: hinges, slides, chains, tendons of both kinds, equalities."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from mjhill.benchmarks.fuzz.draws import (
    Random,
    chance,
    log_uniform,
    random_muscle,
    random_passive,
    sign,
)
from mjhill.engine.layout import ARRAYS, parameters_in
from mjhill.engine.spec import add_muscle, add_passive, set_muscle
from mjhill.muscles import convert, hill, hill_rigid
from mjhill.muscles.hill import Hill

INTEGRATORS = ("EULER", "IMPLICIT", "IMPLICITFAST", "DISCRETE", "RK4")
TIMESTEPS = (0.1e-3, 10e-3)  # [s], shortest and longest


@dataclass
class Draft:
    """A model under construction, and the typical sizes of its parts.

    Attributes:
        random: Source of the random numbers.
        spec: The model.
        timestep: [s].
        wildness: Probability that a parameter may be anywhere in its range.
        force: Typical force of a muscle [N·m or N].
        length: Typical length over which a muscle works [rad or m].
        joints: Names of the joints with one coordinate.
        reach: Typical movement of the joints [rad or m].
        inertia: Inertia of the previous body [kg·m² or kg].
        slopes: Stiffness [N·m/rad or N/m] of muscles drawn so far, in units of gear².
    """

    random: Random
    spec: mujoco.MjSpec
    timestep: float
    wildness: float
    force: float
    length: float
    reach: float
    inertia: float = 0.0
    joints: list[str] = field(default_factory=list)
    slopes: list[float] = field(default_factory=list)


def random_model(kind: str, random: Random) -> tuple[mujoco.MjModel, float]:
    """A model of a kind, one of ``KINDS``, and how far its joints move, roughly [rad or m]."""
    spec = mujoco.MjSpec()
    spec.modelname = kind
    spec.compiler.degree = False
    timestep = log_uniform(random, *TIMESTEPS)
    length = log_uniform(random, 0.01, 2)
    draft = Draft(
        random, spec, timestep,
        wildness=float(random.choice([0.0, 0.1, 0.3, 1.0], p=[0.3, 0.4, 0.2, 0.1])),
        force=log_uniform(random, 1e-2, 1e4),
        length=length,
        reach=length,
    )  # fmt: skip
    spec.option.timestep = timestep
    integrator = str(random.choice(INTEGRATORS))
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    spec.option.gravity = [0, 0, -9.81 if chance(random, 0.4) else 0.0]
    if chance(random, 0.05):
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    if chance(random, 0.02):
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    _KINDS[kind](draft)
    for actuator in spec.actuators:
        _settings(draft, actuator)
        spec.add_sensor(
            type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
            objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
            objname=actuator.name,
        )
    if chance(random, 0.2):
        # not those of bonds, whose rates would be out of bounds for many of these muscles
        _exchange(spec, str(random.choice([hill_rigid.MODEL.name])))
    with warnings.catch_warnings():  # of inertias that are hard to invert
        warnings.simplefilter("ignore", UserWarning)
        return spec.compile(), draft.reach


def _exchange(spec: mujoco.MjSpec, name: str) -> None:
    """Make the muscles of a model those of another muscle model."""
    for actuator in spec.actuators:
        rows = {array: getattr(actuator, array) for array in ARRAYS}
        set_muscle(actuator, convert(parameters_in(hill.MODEL, rows), name))


def _joint_muscles(draft: Draft) -> None:
    """One joint with one to four muscles on either side."""
    slide = draft.spec.modelname == "slide"
    parts = [(_gear(draft), _muscle(draft)) for _ in range(int(draft.random.integers(1, 5)))]
    for gear, part in parts:
        draft.slopes.append(gear * gear * stiffness(part))
    _body(draft, draft.spec.worldbody, slide)
    for index, (gear, part) in enumerate(parts):
        add_muscle(draft.spec, name=f"m{index}", muscle=part, joint=draft.joints[0], gear=gear)


def _chain(draft: Draft) -> None:
    """Two to four joints in a row, with muscles on joints and across several."""
    random, spec = draft.random, draft.spec
    count = int(random.integers(2, 5))
    plans = []
    for index in range(int(random.integers(1, 6))):
        part = _muscle(draft)
        across = sorted(random.choice(count, int(random.integers(1, count + 1)), replace=False))
        arms = [(int(joint), _gear(draft)) for joint in across]
        draft.slopes.append(stiffness(part) * max(gear * gear for _, gear in arms))
        plans.append((f"m{index}", part, arms))
    parent = spec.worldbody
    for _ in range(count):
        parent = _body(draft, parent, chance(random, 0.2))
    if chance(random, 0.1):
        root = spec.worldbody.first_body()
        root.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, name="ball")
    for name, part, arms in plans:
        if len(arms) == 1 and chance(random, 0.7):
            [(joint, gear)] = arms
            add_muscle(spec, name=name, muscle=part, joint=draft.joints[joint], gear=gear)
            continue
        tendon = spec.add_tendon(name=name)
        for joint, gear in arms:
            tendon.wrap_joint(draft.joints[joint], gear)
        if chance(random, 0.1):
            tendon.damping = [draft.force * log_uniform(random, 1e-4, 1e-2), 0, 0]
        gear = sign(random) * (1.0 if chance(random, 0.7) else log_uniform(random, 0.3, 3))
        add_muscle(spec, name=name, muscle=part, tendon=name, gear=gear)


def _equality(draft: Draft) -> None:
    """A chain with equality constraints between joints, tendons, points or bodies."""
    _chain(draft)
    random, spec = draft.random, draft.spec
    for index in range(int(random.integers(1, 3))):
        form = str(random.choice(["joint", "connect", "weld", "tendon"], p=[0.5, 0.2, 0.15, 0.15]))
        item = spec.add_equality(name=f"equality{index}")
        if chance(random, 0.2):
            item.solref = [log_uniform(random, 2e-3, 0.1), log_uniform(random, 0.3, 2)]
        if form == "tendon" and spec.tendons:
            item.type = mujoco.mjtEq.mjEQ_TENDON
            item.objtype = mujoco.mjtObj.mjOBJ_TENDON
            item.name1 = spec.tendons[0].name
            item.data = _data()
        elif form in ("connect", "weld"):
            bodies = [body.name for body in spec.bodies[1:]]
            kind = mujoco.mjtEq.mjEQ_CONNECT if form == "connect" else mujoco.mjtEq.mjEQ_WELD
            item.type, item.objtype = kind, mujoco.mjtObj.mjOBJ_BODY
            item.name1 = bodies[-1]
            item.name2 = "world" if chance(random, 0.5) else bodies[0]
            item.data = _data(0, 0, -0.1)
            if form == "weld":  # held where it is: anchor, relative pose 0, torque scale 1
                item.data = _data(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1)
        else:
            first, second = random.choice(draft.joints, 2, replace=False)
            item.type, item.objtype = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
            item.name1, item.name2 = str(first), str(second)
            slope = sign(random) * log_uniform(random, 0.1, 3)
            bends = random.uniform(-0.3, 0.3, 3) if chance(random, 0.3) else (0, 0, 0)
            item.data = _data(0, slope, *bends)


def _data(*values: float) -> Any:
    """The data of an equality constraint."""
    return np.array([*values, *[0.0] * (12 - len(values))], dtype=np.float64)


def _spatial(draft: Draft) -> None:
    """A limb in metres with muscles on tendons that bend over points, cylinders and spheres."""
    random, spec = draft.random, draft.spec
    draft.length = log_uniform(random, 0.02, 0.3)
    draft.reach = 1.0
    reach = 2.0 * draft.length
    radius = reach * float(random.uniform(0.03, 0.3))
    plans = []
    for index in range(int(random.integers(1, 5))):
        part = _muscle(draft)
        draft.slopes.append(radius * radius * stiffness(part))
        plans.append((f"m{index}", part))
    segments = [spec.worldbody]
    for _ in range(int(random.integers(1, 4))):
        body = _body(draft, segments[-1], chance(random, 0.1))
        body.pos = [0, 0, 0 if len(segments) == 1 else -reach]
        if chance(random, 0.6):  # as limbs have; a path may stay on its surfaces within it
            joint = body.first_joint()
            joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
            joint.range = [-float(random.uniform(0.1, 1)), float(random.uniform(0.1, 1))]
        segments.append(body)
    for index, (name, part) in enumerate(plans):
        last = int(random.integers(1, len(segments)))
        _path(draft, name, segments[: last + 1], radius, reach, (-1.0) ** index)
        gear = 1.0 if chance(random, 0.75) else log_uniform(random, 0.3, 3)
        gear *= -1.0 if chance(random, 0.05) else 1.0
        add_muscle(spec, name=name, muscle=part, tendon=name, gear=gear)


def _path(
    draft: Draft, name: str, segments: list[Any], radius: float, reach: float, side: float
) -> None:
    """A tendon from the first to the last of some segments, wrapped around geoms between."""
    random, spec = draft.random, draft.spec
    tendon = spec.add_tendon(name=name)
    for order, body in enumerate(segments):
        if order and chance(random, 0.6):
            kind = "CYLINDER" if chance(random, 0.7) else "SPHERE"
            wrap = f"{name}.wrap{order}"
            body.add_geom(
                name=wrap, type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"),
                size=[radius * float(random.uniform(0.5, 1.1)), 0.05, 0],
                euler=[np.pi / 2, 0, 0], mass=0, contype=0, conaffinity=0,
            )  # fmt: skip
            sidesite = ""
            if chance(random, 0.85):
                sidesite = f"{name}.side{order}"
                body.add_site(name=sidesite, pos=[side * 2 * radius, 0, 0])
            tendon.wrap_geom(wrap, sidesite)
        height = 0.9 * reach if order == 0 else -reach * float(random.uniform(0.1, 0.9))
        pos = [side * radius * float(random.uniform(0.3, 2)), 0, height]
        pos[1] = radius * float(random.uniform(-0.5, 0.5))
        body.add_site(name=f"{name}.site{order}", pos=pos)
        tendon.wrap_site(f"{name}.site{order}")


def stiffness(muscle: Hill) -> float:
    """Stiffness of a muscle's series element at its maximum isometric force."""
    shape = muscle.series_shape
    slope = shape / muscle.series_stretch / -math.expm1(-shape)
    return min(muscle.max_isometric_force * slope, 1e300)


def _muscle(draft: Draft) -> Hill:
    return random_muscle(draft.random, draft.force, draft.length, draft.wildness)


def _gear(draft: Draft) -> float:
    size = log_uniform(draft.random, 0.01, 100) if chance(draft.random, 0.2) else 1.0
    return sign(draft.random) * size


def _body(draft: Draft, parent: Any, slide: bool) -> Any:
    """A body on a joint; its inertia usually suits the stiffness of the muscles."""
    random = draft.random
    index = len(draft.joints)
    name = f"joint{index}"
    if chance(random, 0.1):
        inertia = log_uniform(random, 1e-7, 1e4)
    else:  # natural frequency times timestep
        fast = log_uniform(random, 2e-3, 1.0)
        inertia = max(draft.slopes) * (draft.timestep / fast) ** 2
    inertia = min(max(inertia, 1e-9), 1e9)
    if draft.joints:  # MuJoCo itself cannot invert inertias that differ by much more
        inertia = min(max(inertia, 1e-3 * draft.inertia), draft.inertia)
    draft.inertia = inertia
    size, bend = draft.length, draft.reach
    body = parent.add_body(
        name=f"body{index}", mass=inertia if slide else min(inertia / size**2, 1e9),
        pos=[0, 0, 0 if index == 0 else -size], ipos=[0, 0, 0], inertia=[inertia] * 3,
        explicitinertial=True,
    )  # fmt: skip
    kind = mujoco.mjtJoint.mjJNT_SLIDE if slide else mujoco.mjtJoint.mjJNT_HINGE
    joint = body.add_joint(name=name, type=kind, axis=[1, 0, 0] if slide else [0, 1, 0])
    joint.damping = [draft.force * log_uniform(random, 1e-5, 0.3), 0, 0]
    if chance(random, 0.1):
        joint.damping = [0, 0, 0]
    if chance(random, 0.5):
        joint.stiffness = [draft.force / bend * log_uniform(random, 1e-2, 1), 0, 0]
    if chance(random, 0.2):
        joint.armature = inertia * log_uniform(random, 1e-3, 1)
    if chance(random, 0.15):
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.range = [-bend * float(random.uniform(0.2, 2)), bend * float(random.uniform(0.2, 2))]
    draft.joints.append(name)
    if chance(random, 0.5):
        passive = random_passive(random, draft.force, bend, draft.wildness)
        add_passive(draft.spec, joint=name, passive=passive)
    return body


def _settings(draft: Draft, actuator: Any) -> None:
    """Ranges and delay of a muscle's control and force."""
    random = draft.random
    if chance(random, 0.2):
        actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
    elif chance(random, 0.2):
        low = float(random.uniform(-2, 0.9))
        actuator.ctrlrange = [low, low + log_uniform(random, 0.01, 10)]
    if chance(random, 0.05):
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.forcerange = [-draft.force * log_uniform(random, 0.1, 1e3), 0]
    if chance(random, 0.1):
        actuator.nsample = int(random.integers(1, 20))
        actuator.delay = draft.timestep * float(random.uniform(0, actuator.nsample))
        actuator.interp = int(random.integers(0, 3))


_KINDS: dict[str, Callable[[Draft], None]] = {
    "hinge": _joint_muscles,
    "slide": _joint_muscles,
    "chain": _chain,
    "spatial": _spatial,
    "equality": _equality,
}
KINDS = tuple(_KINDS)
