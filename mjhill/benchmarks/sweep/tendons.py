"""Random limbs with muscles on spatial tendons."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from mjhill.engine.spec import add_muscle
from mjhill.muscles.hill import Hill


def tendon_model(
    random: np.random.Generator, muscle: Callable[[np.random.Generator, float, float], Hill]
) -> tuple[mujoco.MjModel, float]:
    """A limb of one or two hinges with a flexor and an extensor, perhaps one across both.

    Args:
        random: Where the numbers come from.
        muscle: Draws a muscle of an optimal fibre length [m] and about a force [N].

    Returns:
        The model, and the torque [N·m] that a muscle makes at most, roughly.
    """
    scale = float(random.uniform(0.7, 1.3))
    force = float(np.exp(random.uniform(np.log(150), np.log(900)))) * scale
    radius = 0.025 * scale * float(random.uniform(0.7, 1.3))
    torque = force * radius
    spec = mujoco.MjSpec()
    spec.modelname = "limb"
    spec.option.timestep = 1e-3
    spec.option.gravity = [0, 0, -9.81 if random.random() < 0.5 else 0.0]
    spec.compiler.degree = False
    upper = 0.3 * scale
    spec.worldbody.add_site(name="origin0", pos=[radius, 0, upper])
    spec.worldbody.add_site(name="origin1", pos=[-radius, 0, upper])
    segment, count = spec.worldbody, 1 if random.random() < 0.5 else 2
    for index in range(count):
        place = [0, 0, 0 if index == 0 else -upper]
        segment = segment.add_body(name=f"segment{index}", pos=place)
        _add_segment(random, segment, index, scale, radius, torque)
    for side, label in enumerate(("flexor", "extensor")):
        _add_path(spec, label, side, int(random.integers(count)))
        part = muscle(random, float(random.uniform(0.05, 0.15)) * scale, force)
        add_muscle(spec, name=label, muscle=part, tendon=label)
        spec.add_sensor(
            type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
            objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
            objname=label,
        )
    return spec.compile(), torque


def _add_segment(
    random: np.random.Generator,
    body: mujoco.MjsBody,
    index: int,
    scale: float,
    radius: float,
    torque: float,
) -> None:
    """A hinge, the limb below it, a surface to wrap around, and the ends of two muscles."""
    upper = 0.3 * scale
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[0.03 * scale, 0, 0],
        fromto=[0, 0, 0, 0, 0, -upper],
        mass=2.0 * scale**3 * float(random.uniform(0.5, 1.5)) / (1 + index),
        contype=0,
        conaffinity=0,
    )
    body.add_joint(
        name=f"hinge{index}",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[0, 1, 0],
        damping=0.01 * torque * float(random.uniform(0.5, 3)),
        stiffness=torque * float(random.uniform(0.1, 0.5)),
    )
    body.add_geom(
        name=f"wrap{index}",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius, 0.05, 0],
        euler=[np.pi / 2, 0, 0],
        mass=0,
        contype=0,
        conaffinity=0,
    )
    for side, sign in enumerate((1.0, -1.0)):
        body.add_site(name=f"side{index}{side}", pos=[sign * 2 * radius, 0, 0])
        end = [sign * radius, 0, -upper * float(random.uniform(0.2, 0.5))]
        body.add_site(name=f"insertion{index}{side}", pos=end)


def _add_path(spec: mujoco.MjSpec, label: str, side: int, last: int) -> None:
    """A tendon from the origin of a side over the hinges up to ``last``."""
    tendon = spec.add_tendon(name=label)
    tendon.wrap_site(f"origin{side}")
    for index in range(last + 1):
        tendon.wrap_geom(f"wrap{index}", f"side{index}{side}")
        if index < last:  # a path needs a point between two surfaces
            tendon.wrap_site(f"insertion{index}{side}")
    tendon.wrap_site(f"insertion{last}{side}")
