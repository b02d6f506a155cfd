"""Bellies: a muscle as a shape along its path, so that activation and force can be seen."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.engine import layout
from mjhill.simulate.recording import Recording

Points = NDArray[np.float64]
Colour = tuple[float, float, float]

# one colour a muscle, on its tendon, in the legend and on its curves (Okabe & Ito 2008, without
# the reds, which show activation)
MUSCLE_COLOURS: tuple[Colour, ...] = (
    (0.00, 0.45, 0.70),
    (0.90, 0.62, 0.00),
    (0.00, 0.62, 0.45),
    (0.80, 0.47, 0.65),
    (0.34, 0.71, 0.91),
    (0.45, 0.45, 0.45),
)
_ACTIVATION_COLOURS = np.array([[0.33, 0.35, 0.48], [0.62, 0.24, 0.34], [0.86, 0.07, 0.06]])

# of the tendon's length in qpos0; chosen by eye
_STRAND_RADIUS = 0.013
_BELLY_RADIUS = 0.034  # without force
_BELLY_SWELLING = 0.050  # what the maximum isometric force adds; with its root, as cross-sections
_BELLY_START = 0.05  # from the path's first end, the origin
_TENDON_LENGTH = 0.27  # from the belly to the path's last end, the insertion
_ARC_STEP = 0.4  # of a drawn arc [rad]

_HIDDEN_GROUP = 5  # MuJoCo's default visualisation leaves groups 3 to 5 out


@dataclass(frozen=True)
class DrawnMuscle:
    """What is needed to draw a muscle.

    Attributes:
        name: The actuator's name.
        activation: Index of its activation in ``act``.
        out: Index into ``actuator_force``.
        max_force: Maximum isometric force [N or N·m].
        tendon: Id of the tendon that gives the path; -1 where there is none to draw.
        colour: The muscle's own colour, RGB in [0, 1].
    """

    name: str
    activation: int
    out: int
    max_force: float
    tendon: int
    colour: Colour


@dataclass(frozen=True)
class Shape:
    """A capsule or an ellipsoid between two points.

    Attributes:
        kind: ``mjGEOM_CAPSULE`` or ``mjGEOM_ELLIPSOID``.
        start: One end [m], shape (3,).
        end: The other end [m], shape (3,).
        radius: Radius at the middle [m].
        belly: Whether it is part of the belly, and not of the tendon.
    """

    kind: int
    start: Points
    end: Points
    radius: float
    belly: bool


def drawn_muscles(model: mujoco.MjModel, recording: Recording | None) -> tuple[DrawnMuscle, ...]:
    """The muscles of a model, mjhill's and MuJoCo's, whose activation and force are recorded.

    A muscle is drawn along the tendon of its name, or else along the tendon it acts on.
    """
    found: list[DrawnMuscle] = []
    for i, name in enumerate(layout.actuator_names(model)):
        force = _max_force(model, i)
        wanted = {f"{name}.a", f"{name}.force"}
        recorded = recording is None or wanted <= set(recording)
        if force is None or not recorded:
            continue
        colour = MUSCLE_COLOURS[len(found) % len(MUSCLE_COLOURS)]
        kind = layout.model_of_actuator(model, i)
        activation = int(model.actuator_actadr[i])  # of the native muscle's only state
        if kind is not None:
            activation += kind.state_names.index(kind.activation)
        out = int(model.actuator_outadr[i])
        tendon = _tendon(model, i, name)
        found.append(DrawnMuscle(name, activation, out, force, tendon, colour))
    return tuple(found)


def activation_colour(activation: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """Slate at 0 to bright red at 1, RGB in [0, 1]; shape of ``activation`` + (3,)."""
    stops = np.linspace(0, 1, len(_ACTIVATION_COLOURS))
    channels = [np.interp(activation, stops, column) for column in _ACTIVATION_COLOURS.T]
    return np.stack(channels, axis=-1)


def muscle_shapes(
    model: mujoco.MjModel, data: mujoco.MjData, muscle: DrawnMuscle, force: float
) -> list[Shape]:
    """The shapes of a muscle in the present pose.

    Args:
        model: The model.
        data: Data whose tendons are up to date (``mj_fwdKinematics``).
        muscle: Which muscle.
        force: Force as a fraction of the maximum isometric force [-].
    """
    shapes: list[Shape] = []
    rest = float(model.tendon_length0[muscle.tendon])
    radius = rest * (_BELLY_RADIUS + _BELLY_SWELLING * math.sqrt(min(max(force, 0.0), 1.5)))
    for branch in _branches(model, data, muscle.tendon):
        shapes += [
            Shape(mujoco.mjtGeom.mjGEOM_CAPSULE, a, b, _STRAND_RADIUS * rest, belly=False)
            for a, b in pairwise(branch)
        ]
        shapes += _belly(branch, rest, radius)
    return shapes


def draw_muscles(scene: Any, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Add every muscle's belly and tendon to a scene, as they are in ``data``.

    A belly turns from slate to red with activation and thickens with force. For the
    ``user_scn`` of a passive viewer, whose ``ngeom`` is to be set to 0 first, or the ``scene``
    of a ``mujoco.Renderer`` after ``update_scene``.

    Args:
        scene: A ``mujoco.MjvScene``; one that is full takes no more.
        model: The model.
        data: Its state after ``mj_forward`` or ``mj_step``.
    """
    for muscle in drawn_muscles(model, None):
        add_muscle(scene, model, data, muscle, *present_look(data, muscle))


def present_look(data: mujoco.MjData, muscle: DrawnMuscle) -> tuple[float, float]:
    """Activation, and force as a fraction of the maximum isometric force, in ``data`` [-]."""
    # MuJoCo's force is negative where it pulls
    force = -float(data.actuator_force[muscle.out]) / max(muscle.max_force, mujoco.mjMINVAL)
    return float(data.act[muscle.activation]), force


def add_muscle(
    scene: Any,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    muscle: DrawnMuscle,
    activation: float,
    force: float,
) -> None:
    """Put a muscle's belly and tendon into a scene; nothing if it has no path.

    Args:
        scene: A ``mujoco.MjvScene``.
        model: The model.
        data: Data whose tendons are up to date (``mj_fwdKinematics``).
        muscle: Which muscle.
        activation: From 0 to 1 [-].
        force: Force as a fraction of the maximum isometric force [-].
    """
    if muscle.tendon < 0:
        return
    red = activation_colour(activation)
    for shape in muscle_shapes(model, data, muscle, force):
        if shape.belly:
            _add_shape(scene, shape, red, 0.05 + 0.1 * min(max(activation, 0.0), 1.0))
        else:
            _add_shape(scene, shape, muscle.colour, 0.05)


def hide_tendons(model: mujoco.MjModel, muscles: Iterable[DrawnMuscle]) -> None:
    """Move the plain tendons of muscles that are drawn to a group that is not shown."""
    for muscle in muscles:
        if muscle.tendon >= 0:
            model.tendon_group[muscle.tendon] = _HIDDEN_GROUP


def _max_force(model: mujoco.MjModel, actuator: int) -> float | None:
    kind = layout.model_of_actuator(model, actuator)
    if kind is not None:
        array, slot = kind.slots["max_isometric_force"]
        return float(getattr(model, f"actuator_{array}")[actuator, slot])
    if model.actuator_gaintype[actuator] != mujoco.mjtGain.mjGAIN_MUSCLE:
        return None
    force, scale = model.actuator_gainprm[actuator, 2:4]
    # the native muscle's rule: a negative force asks for scale / acc0
    acceleration = model.actuator_acc0[model.actuator_outadr[actuator]]
    return float(force if force >= 0 else scale / max(mujoco.mjMINVAL, acceleration))


def _tendon(model: mujoco.MjModel, actuator: int, name: str) -> int:
    tendon = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, name))
    if tendon < 0 and model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON:
        tendon = int(model.actuator_trnid[actuator, 0])
    if tendon < 0 or model.tendon_type[tendon] != mujoco.mjtTendon.mjTENDON_SPATIAL:
        return -1
    return tendon


def _branches(model: mujoco.MjModel, data: mujoco.MjData, tendon: int) -> list[Points]:
    """The tendon's path, arcs included, shape (K, 3) [m] for each branch between pulleys."""
    start, number = int(data.ten_wrapadr[tendon]), int(data.ten_wrapnum[tendon])
    points = data.wrap_xpos.reshape(-1, 3)[start : start + number]
    objects = data.wrap_obj.ravel()[start : start + number].tolist()
    branches: list[list[Points]] = [[]]
    for i, geom in enumerate(objects):
        if geom == -2:  # a pulley
            branches.append([])
            continue
        if geom >= 0 and i > 0 and objects[i - 1] == geom:
            branches[-1] += _arc(model, data, geom, points[i - 1], points[i])
        branches[-1].append(points[i].copy())
    return [np.array(branch) for branch in branches if len(branch) > 1]


def _arc(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, start: Points, end: Points
) -> list[Points]:
    """Points between two on a wrapping sphere or cylinder, the shorter way round."""
    axis = np.zeros(3)
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
        axis = data.geom_xmat[geom].reshape(3, 3)[:, 2]
    centre = data.geom_xpos[geom]
    heights = [float((p - centre) @ axis) for p in (start, end)]
    spokes = [p - centre - h * axis for p, h in zip((start, end), heights, strict=True)]
    norms = [float(np.linalg.norm(spoke)) for spoke in spokes]
    cosine = float(spokes[0] @ spokes[1]) / max(norms[0] * norms[1], mujoco.mjMINVAL)
    angle = math.acos(min(max(cosine, -1.0), 1.0))
    sine = math.sin(angle)
    if sine < 1e-6:
        return []
    inner = np.arange(1, math.ceil(angle / _ARC_STEP)) / math.ceil(angle / _ARC_STEP)
    return [
        centre
        + (heights[0] + t * (heights[1] - heights[0])) * axis
        + (math.sin((1 - t) * angle) * spokes[0] + math.sin(t * angle) * spokes[1]) / sine
        for t in inner
    ]


def _belly(branch: Points, rest: float, radius: float) -> list[Shape]:
    """One ellipsoid where the path is straight, a tapered chain of capsules where it bends."""
    lengths = np.linalg.norm(np.diff(branch, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    start = _BELLY_START * rest
    end = max(along[-1] - _TENDON_LENGTH * rest, start + 0.3 * rest)
    places = np.linspace(start, end, 10)
    spine = np.stack([np.interp(places, along, column) for column in branch.T], axis=1)
    chord = spine[-1] - spine[0]
    straight = spine[0] + np.linspace(0, 1, len(spine))[:, None] * chord
    if np.abs(spine - straight).max() < 0.03 * rest:
        return [Shape(mujoco.mjtGeom.mjGEOM_ELLIPSOID, spine[0], spine[-1], radius, belly=True)]
    middles = (np.arange(len(spine) - 1) + 0.5) / (len(spine) - 1)
    return [
        Shape(
            mujoco.mjtGeom.mjGEOM_CAPSULE, a, b, radius * math.sin(math.pi * t) ** 0.7, belly=True
        )
        for a, b, t in zip(spine[:-1], spine[1:], middles, strict=True)
    ]


def _add_shape(scene: Any, shape: Shape, rgb: Any, emission: float) -> None:
    """Put a shape into a scene, unless that is full."""
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    rgba = np.array([*rgb, 1.0], dtype=np.float32)
    chord = shape.end - shape.start
    half = float(np.linalg.norm(chord)) / 2
    # a capsule's size is radius and half length, an ellipsoid's its three half axes
    capsule = shape.kind == mujoco.mjtGeom.mjGEOM_CAPSULE
    size = np.array([shape.radius, half if capsule else shape.radius, half])
    middle = (shape.start + shape.end) / 2
    mujoco.mjv_initGeom(geom, shape.kind, size, middle, _frame(chord).ravel(), rgba)
    geom.emission, geom.specular, geom.shininess = emission, 0.3, 0.4
    geom.category = mujoco.mjtCatBit.mjCAT_DYNAMIC
    scene.ngeom += 1


def _frame(direction: Points) -> NDArray[np.float64]:
    """A rotation whose z axis points along ``direction``, shape (3, 3)."""
    quaternion, matrix = np.zeros(4), np.zeros(9)
    mujoco.mju_quatZ2Vec(quaternion, direction)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
