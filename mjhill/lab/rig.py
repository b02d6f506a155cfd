"""A rig: one joint in its smallest model, and runs of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import mujoco
import numpy as np

from mjhill.engine.equilibrium import equilibrate
from mjhill.engine.install import installed, without_python_callbacks
from mjhill.engine.spec import joint_spec
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.muscles import steady_tension
from mjhill.simulate.recording import Recording
from mjhill.simulate.reference import plant_torque
from mjhill.simulate.run import record
from mjhill.simulate.signals import Signal

_TIMESTEP = 1e-3  # of most joints [s]
_TIMESTEPS = {"eye": 0.5e-3}  # [s]; the eye is ten times as fast


class UnmeasuredError(RuntimeError):
    """The quantity cannot be measured on this joint; the message says why."""


def as_joint(joint: str | Joint) -> Joint:
    """The joint itself, or mjhill's joint of that name.

    Raises:
        ValueError: The name is unknown.
    """
    if isinstance(joint, Joint):
        return joint
    if joint not in JOINTS:
        raise ValueError(f"unknown joint {joint!r}; there are: {', '.join(JOINTS)}")
    return JOINTS[joint]


def as_muscle(joint: Joint, muscle: str | None) -> str:
    """The muscle's name, checked; None gives the first, which pulls towards positive angles.

    Raises:
        ValueError: The joint has no muscle of that name.
    """
    if muscle is None:
        return next(iter(joint.muscles))
    if muscle not in joint.muscles:
        known = ", ".join(joint.muscles)
        raise ValueError(f"{joint.name}: unknown muscle {muscle!r}; there are: {known}")
    return muscle


@dataclass(frozen=True)
class Rig:
    """A joint and its model.

    Attributes:
        joint: The joint.
        model: MuJoCo model of one hinge and the muscles.
    """

    joint: Joint
    model: mujoco.MjModel

    @property
    def timestep(self) -> float:
        """Timestep of the simulation [s]."""
        return float(self.model.opt.timestep)


@dataclass(frozen=True)
class Dynamometer:
    """A machine that moves the joint along a path: a motor behind a coupling of finite stiffness.

    It is the actuator ``dynamometer`` of the model. Its control is ``drive`` [N·m]. Its force is
    the torque in the coupling, which a gauge would read; that includes the inertial torque.

    Attributes:
        stiffness: Stiffness of the coupling [N·m/rad].
        damping: Damping of the coupling [N·m·s/rad].
    """

    stiffness: float
    damping: float

    def drive(self, angle: float, velocity: float = 0.0) -> float:
        """Control [N·m] for a motor at an angle [rad] that moves at a velocity [rad/s]."""
        return self.stiffness * angle + self.damping * velocity


@dataclass(frozen=True)
class Spring:
    """A linear spring between the joint and the ground.

    Attributes:
        stiffness: Stiffness [N·m/rad].
        rest: Angle at which the spring has no torque [rad].
    """

    stiffness: float
    rest: float


def timestep_of(joint: Joint) -> float:
    """Timestep [s] of a joint on a rig."""
    return _TIMESTEPS.get(joint.name, _TIMESTEP)


def dynamometer(joint: Joint, frequency: float) -> Dynamometer:
    """A dynamometer; joint and coupling have a natural frequency [Hz] and critical damping."""
    omega = 2 * pi * frequency
    return Dynamometer(joint.inertia * omega**2, 2 * joint.inertia * omega)


def build_rig(
    joint: Joint,
    *,
    exact: bool = False,
    machine: Dynamometer | None = None,
    spring: Spring | None = None,
    added_inertia: float = 0.0,
) -> Rig:
    """A rig for a joint.

    Args:
        joint: The joint.
        exact: Whether to integrate with RK4. Euler's method is half a step early, and a fit then
            finds too little damping, by half a step times the stiffness.
        machine: A dynamometer on the joint. The integrator is then implicitfast, which is stable
            with a stiff coupling.
        spring: A spring on the joint.
        added_inertia: Inertia of a body fixed to the limb [kg·m²].
    """
    spec = joint_spec(joint)
    spec.option.timestep = timestep_of(joint)
    if machine:
        _mount(spec, joint.name, machine)
    if spring:
        tendon = spec.add_tendon(name="spring", stiffness=[spring.stiffness, 0, 0])
        tendon.springlength = [spring.rest, spring.rest]
        tendon.wrap_joint(joint.name, 1.0)
    if added_inertia > 0:
        spec.bodies[1].add_body(
            name="added", mass=1, ipos=[0, 0, 0], inertia=[added_inertia] * 3, explicitinertial=True
        )
    if exact:
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with without_python_callbacks():
        return Rig(joint, spec.compile())


def _mount(spec: mujoco.MjSpec, joint: str, machine: Dynamometer) -> None:
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.add_actuator(
        name="dynamometer",
        target=joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=[1, *[0] * 9],
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        biasprm=[0, -machine.stiffness, -machine.damping, *[0] * 7],
    )


def at_rest(
    rig: Rig, angle: float, excitations: Mapping[str, float] | None = None
) -> mujoco.MjData:
    """State without velocity at an angle [rad]; muscles are steady at their excitations, or 0."""
    data = mujoco.MjData(rig.model)
    data.qpos[0] = angle
    for name, u in (excitations or {}).items():
        data.actuator(name).ctrl = u
    equilibrate(rig.model, data)
    return data


def record_run(
    rig: Rig,
    data: mujoco.MjData,
    duration: float,
    *,
    excitation: Mapping[str, Signal | float] | None = None,
    torque: Signal | float = 0.0,
) -> Recording:
    """Recording of a run of ``duration`` [s] from a state.

    Args:
        rig: The rig.
        data: The state at the start; it is advanced.
        duration: Length of the run [s].
        excitation: Excitation over time by muscle [-]; others keep their control.
        torque: External torque on the joint [N·m].

    Raises:
        UnmeasuredError: MuJoCo warned that the simulation went bad.
    """
    with installed():
        try:
            return record(
                rig.model,
                data,
                duration=duration,
                excitation=excitation,
                torque={rig.joint.name: torque},
            )
        except RuntimeError as error:
            raise UnmeasuredError(str(error)) from error


def direction(joint: Joint, muscle: str) -> float:
    """1 for a muscle that pulls towards positive angles, else -1."""
    return -float(np.sign(joint.gears[muscle]))


def antagonist(joint: Joint, muscle: str) -> str:
    """The first muscle that pulls in the other direction.

    Raises:
        ValueError: There is none.
    """
    for name in joint.muscles:
        if direction(joint, name) != direction(joint, muscle):
            return name
    raise ValueError(f"{joint.name}: no muscle pulls against {muscle!r}")


def muscle_torque(joint: Joint, muscle: str, excitation: float, angle: float) -> float:
    """Steady torque [N·m] of a muscle at an excitation [-] and a constant angle [rad]."""
    force = steady_tension(joint.muscles[muscle], excitation, joint.gears[muscle] * angle)
    return -joint.gears[muscle] * force


def net_torque(joint: Joint, excitations: Mapping[str, float], angle: float) -> float:
    """Steady torque [N·m] of muscles and passive elasticity at an angle [rad].

    The excitation of a muscle without an entry is 0.
    """
    pulls = (muscle_torque(joint, m, excitations.get(m, 0.0), angle) for m in joint.muscles)
    return plant_torque(joint, angle) + sum(pulls)


def strongest_angle(joint: Joint, muscle: str) -> float:
    """Angle [rad] in the range of motion at which the muscle's isometric force is largest."""
    low, high = joint.range
    return min(max(joint.hill_muscles[muscle].optimal_length / joint.gears[muscle], low), high)
