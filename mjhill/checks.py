"""Models checked before they run: nothing can be raised from inside a compiled callback."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

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

COARSE = 0.2  # natural frequency x timestep (thirty steps a period) from which 5 % may be lost
UNSTABLE = 2.0  # from which a single-step integrator does not hold a spring
PASSIVE_LOAD = 2.0  # passive torque that a movement may meet, in units of the strongest muscle's


@dataclass(frozen=True)
class Finding:
    """Something about a model that makes its results doubtful.

    Attributes:
        subject: What it is about: a joint or a muscle, and its name.
        quantity: The quantity that makes it so.
        value: Its value.
        limit: The value from which it does.
        timestep: The timestep [s] that would do.
        severe: Whether results are meaningless, not only off by more than 5 %.
    """

    subject: str
    quantity: str
    value: float
    limit: float
    timestep: float
    severe: bool

    def __str__(self) -> str:
        """The finding as a sentence, with the remedy."""
        effect = "the result will be meaningless" if self.severe else "it may be off by 5 %"
        return (
            f"{self.subject}: {self.quantity} is {self.value:.3g}, past {self.limit:g}, so "
            f"{effect}; set model.opt.timestep to {self.timestep:.2g} s or less"
        )


def check_model(model: mujoco.MjModel) -> tuple[Finding, ...]:
    """Check every muscle and passive elasticity of a model, and its timestep.

    Returns:
        What makes the results of a model in order doubtful at its timestep. Over random systems
        (``mjhill bench sweep``), none without a finding was off by more than 5 % of its range,
        or 1.5 times what MuJoCo's own step of the joint is off.

    Raises:
        ValueError: An actuator is half a muscle, a parameter is outside its bounds, a passive
            elasticity is on a joint that cannot have one, or the timestep is not positive.

    Warns:
        RuntimeWarning: A finding is severe.
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
    timestep = float(model.opt.timestep)
    if not (math.isfinite(timestep) and timestep > 0):
        raise ValueError(f"timestep must be positive, got {timestep} s; set model.opt.timestep")
    findings = (*_fast_joints(model, muscles), *_fast_activation(model, muscles))
    for finding in findings:
        if finding.severe:
            warnings.warn(str(finding), RuntimeWarning, stacklevel=2)
    return findings


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


def _fast_joints(model: mujoco.MjModel, muscles: dict[str, Muscle]) -> Iterator[Finding]:
    """Findings on joints that swing too fast for the timestep."""
    timestep = float(model.opt.timestep)
    seen = set()
    for joint, frequency in natural_frequencies(model, muscles):
        if timestep * frequency < COARSE or joint in seen:
            continue
        seen.add(joint)
        severe = timestep * frequency >= UNSTABLE
        yield Finding(
            f"joint {joint!r} with its muscles at full force",
            "natural frequency [rad/s] times timestep",
            timestep * frequency,
            UNSTABLE if severe else COARSE,
            COARSE / frequency,
            severe,
        )


def _fast_activation(model: mujoco.MjModel, muscles: dict[str, Muscle]) -> Iterator[Finding]:
    """Findings on time constants that RK4 cannot follow; other integrators are exact there."""
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return
    timestep = float(model.opt.timestep)
    for name, muscle in muscles.items():
        for what in ("excitation_tau", "activation_tau", "deactivation_tau"):
            tau = getattr(muscle, what)
            bypassed = what == "excitation_tau" and muscle.electrical_stimulation
            if timestep > 2 * tau and not bypassed:
                quantity = f"timestep over {what}"
                yield Finding(f"muscle {name!r}", quantity, timestep / tau, 2.0, 2 * tau, False)


def natural_frequencies(
    model: mujoco.MjModel, muscles: dict[str, Muscle]
) -> list[tuple[str, float]]:
    """Natural frequencies [rad/s] of a model at ``qpos0``, fastest first, and the joint of each.

    All muscles pull at full force, and passive elasticities carry ``PASSIVE_LOAD`` times the
    torque of the strongest muscle.
    """
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    arms = moments(model, data)
    stiffness = np.zeros((model.nv, model.nv))
    torque = np.zeros(model.nv)
    for name, address in addresses(model):
        muscle, arm = muscles[name], arms[address.out]
        growth = math.exp(muscle.series_shape)
        slope = muscle.max_isometric_force * muscle.series_shape / muscle.series_stretch
        stiffness += slope * growth / (growth - 1) * np.outer(arm, arm)
        torque = np.maximum(torque, muscle.max_isometric_force * np.abs(arm))
    if not torque.any():
        return []
    for joint, name in enumerate(joint_names(model)):
        dof = model.jnt_dofadr[joint]
        if has_passive(model, joint):
            passive, load = read_passive(model, name), PASSIVE_LOAD * torque[dof]
            stiffness[dof, dof] += model.jnt_stiffness[joint] + max(
                passive.k2_pos * (load + passive.k1_pos) if passive.k1_pos else 0.0,
                passive.k2_neg * (load + passive.k1_neg) if passive.k1_neg else 0.0,
            )
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    squares, modes = np.linalg.eigh(inverse @ stiffness @ inverse.T)
    found = []
    for square, mode in zip(squares[::-1], modes.T[::-1], strict=True):
        movement = inverse.T @ mode
        dof = int(np.argmax(movement * (stiffness @ movement)))
        joint = joint_names(model)[model.dof_jntid[dof]]
        found.append((joint, math.sqrt(max(float(square), 0.0))))
    return found
