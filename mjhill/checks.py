"""Models checked before they run: nothing can be raised from inside a compiled callback."""

from __future__ import annotations

import math
import warnings

import mujoco
import numpy as np

from mjhill.layout import (
    MUSCLE_TAG,
    SCALAR_JOINTS,
    STATES,
    actuator_names,
    addresses,
    has_passive,
    joint_names,
    moments,
    muscle_names,
    read_muscle,
    read_passive,
)
from mjhill.parameters import Muscle


def check_model(model: mujoco.MjModel) -> None:
    """Check every muscle and passive elasticity of a model, and its timestep.

    Raises:
        ValueError: An actuator is half a muscle, a parameter is outside its bounds, a passive
            elasticity is on a joint that cannot have one, or the timestep is not positive.

    Warns:
        RuntimeWarning: The timestep is past the stability limit of a series element.
    """
    for actuator in range(model.nactuator):
        if model.actuator_dynprm[actuator, 0] == MUSCLE_TAG:
            _check_marks(model, actuator)
    muscles = {name: read_muscle(model, name) for name in muscle_names(model)}
    for joint, name in enumerate(joint_names(model)):
        if has_passive(model, joint):
            if model.jnt_type[joint] not in SCALAR_JOINTS:
                raise ValueError(f"joint {name!r}: passive elasticity needs a hinge or slide joint")
            read_passive(model, name)
    _check_timestep(model, muscles)


def _check_marks(model: mujoco.MjModel, actuator: int) -> None:
    """Everything else that makes a tagged actuator a muscle."""
    wanted = [
        ("dyntype", mujoco.mjtDyn(int(model.actuator_dyntype[actuator])), mujoco.mjtDyn.mjDYN_USER),
        (
            "gaintype",
            mujoco.mjtGain(int(model.actuator_gaintype[actuator])),
            mujoco.mjtGain.mjGAIN_FIXED,
        ),
        (
            "biastype",
            mujoco.mjtBias(int(model.actuator_biastype[actuator])),
            mujoco.mjtBias.mjBIAS_USER,
        ),
        ("actdim", int(model.actuator_actnum[actuator]), STATES),
        ("gainprm[0]", float(model.actuator_gainprm[actuator, 0]), 0.0),
        ("actlimited", bool(model.actuator_actlimited[actuator]), False),
        ("number of outputs", int(model.actuator_outnum[actuator]), 1),
    ]
    for what, found, needed in wanted:
        if found != needed:
            name = actuator_names(model)[actuator]
            raise ValueError(
                f"actuator {name!r} is half a mjhill muscle: it has the tag "
                f"dynprm[0] = {MUSCLE_TAG:.0f} but {what} is {_word(found)}, not "
                f"{_word(needed)}; set it, or add the muscle with mjhill.add_muscle"
            )


def _word(value: object) -> str:
    return str(getattr(value, "name", value)).rpartition("_")[2].lower()


def _check_timestep(model: mujoco.MjModel, muscles: dict[str, Muscle]) -> None:
    timestep = float(model.opt.timestep)
    if not (math.isfinite(timestep) and timestep > 0):
        raise ValueError(f"timestep must be positive, got {timestep} s; set model.opt.timestep")
    limits = stable_timesteps(model, muscles)
    name = min(limits, key=limits.__getitem__, default=None)
    if name is not None and timestep > limits[name]:
        warnings.warn(
            f"timestep {timestep:g} s is past {limits[name]:.2g} s, where the series element of "
            f"muscle {name!r} becomes unstable at full force; the result will be meaningless: "
            "lower model.opt.timestep",
            RuntimeWarning,
            stacklevel=3,
        )


def stable_timesteps(model: mujoco.MjModel, muscles: dict[str, Muscle]) -> dict[str, float]:
    """Longest stable timestep [s] of each muscle, beside an equal antagonist, at full force.

    A single-step integrator holds a spring of stiffness k on an inertia m up to 2 sqrt(m/k);
    k is that of two series elements at F_max, m the inertia that the muscle moves at ``qpos0``.
    """
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    arms = moments(model, data)
    limits = {}
    for name, address in addresses(model):
        muscle = muscles[name]
        moment = arms[address.out : address.out + 1]
        acceleration = np.zeros_like(moment)
        mujoco.mj_solveM(model, data, acceleration, moment)
        inverse_inertia = float((moment @ acceleration.T)[0, 0])
        growth = math.exp(muscle.series_shape)
        stiffness = muscle.max_isometric_force * muscle.series_shape / muscle.series_stretch
        stiffness *= growth / (growth - 1)
        limits[name] = (
            2 / math.sqrt(2 * stiffness * inverse_inertia) if inverse_inertia else math.inf
        )
    return limits
