"""A joint on the bench: its smallest model, started still and driven."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import mujoco
import mujoco.batch
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from mjhill.engine.equilibrium import equilibrate
from mjhill.engine.install import installed, without_python_callbacks
from mjhill.engine.spec import joint_spec
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.lab.ensemble import check_warnings
from mjhill.muscles.readings import steady_stretch, tension
from mjhill.simulate.recording import Recording
from mjhill.simulate.reference import plant_torque
from mjhill.simulate.run import record
from mjhill.simulate.signals import Signal

_TIMESTEPS = {"eye": 0.5e-3}  # [s]; its inertia and damping make it ten times as fast
_TIMESTEP = 1e-3  # of every other joint [s]
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS  # time, angle, velocity, then the muscles' states


class UnmeasuredError(RuntimeError):
    """What was to be measured is not seen in this joint; the message says why."""


def as_joint(joint: str | Joint) -> Joint:
    """A joint that comes with mjhill, by name; any other as it is.

    Raises:
        ValueError: There is none of that name.
    """
    if isinstance(joint, Joint):
        return joint
    if joint not in JOINTS:
        raise ValueError(f"unknown joint {joint!r}; there are: {', '.join(JOINTS)}")
    return JOINTS[joint]


def as_muscle(joint: Joint, muscle: str | None) -> str:
    """A muscle of a joint by name; the first, which pulls towards positive angles, for None.

    Raises:
        ValueError: There is none of that name.
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
        model: Its model, one hinge and the muscles.
    """

    joint: Joint
    model: mujoco.MjModel

    @property
    def timestep(self) -> float:
        """Step of the simulation [s]."""
        return float(self.model.opt.timestep)


@dataclass(frozen=True)
class Dynamometer:
    """A machine that holds the joint to a path: a motor behind a coupling of finite stiffness.

    It is an actuator ``dynamometer`` of the model. Its input is the path's ``drive`` [N·m], its
    force the torque in the coupling, which is what its gauge reads, the joint's inertial torque
    included.

    Attributes:
        stiffness: Of the coupling [N·m/rad].
        damping: Of the coupling [N·m·s/rad].
    """

    stiffness: float
    damping: float

    def drive(self, angle: float, velocity: float = 0.0) -> float:
        """Input [N·m] that holds the joint to an angle [rad] that moves at a velocity [rad/s]."""
        return self.stiffness * angle + self.damping * velocity


@dataclass(frozen=True)
class Spring:
    """A linear spring between the joint and the ground.

    Attributes:
        stiffness: [N·m/rad].
        rest: Angle at which it is slack [rad].
    """

    stiffness: float
    rest: float


def dynamometer(joint: Joint, frequency: float) -> Dynamometer:
    """A dynamometer on whose coupling the joint rings at a frequency [Hz], critically damped."""
    pulsation = 2 * pi * frequency
    return Dynamometer(joint.inertia * pulsation**2, 2 * joint.inertia * pulsation)


def rig(
    joint: Joint,
    *,
    exact: bool = False,
    machine: Dynamometer | None = None,
    spring: Spring | None = None,
    added_inertia: float = 0.0,
) -> Rig:
    """A joint on the bench.

    Args:
        joint: The joint.
        exact: Whether to integrate by RK4; the half step by which Euler's method is early takes
            half a step's worth of stiffness off the damping that a fit finds.
        machine: A dynamometer on the joint; the joint is then integrated by implicitfast, which
            is stable with a stiff coupling.
        spring: A spring on the joint.
        added_inertia: Of a body fixed to the limb [kg·m²].
    """
    spec = joint_spec(joint)
    spec.option.timestep = _TIMESTEPS.get(joint.name, _TIMESTEP)
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


def still(bench: Rig, angle: float, levels: Mapping[str, float] | None = None) -> mujoco.MjData:
    """The joint without velocity at an angle [rad], its muscles steady at some inputs or 0."""
    data = mujoco.MjData(bench.model)
    data.qpos[0] = angle
    for name, level in (levels or {}).items():
        data.actuator(name).ctrl = level
    equilibrate(bench.model, data)
    return data


def run(
    bench: Rig,
    data: mujoco.MjData,
    duration: float,
    *,
    excitation: Mapping[str, Signal | float] | None = None,
    torque: Signal | float = 0.0,
) -> Recording:
    """A recorded run of ``duration`` [s] under inputs and an external torque [N·m].

    Raises:
        UnmeasuredError: MuJoCo warned that the run went bad.
    """
    with installed():
        try:
            return record(
                bench.model,
                data,
                duration=duration,
                excitation=excitation,
                torque={bench.joint.name: torque},
            )
        except RuntimeError as error:
            raise UnmeasuredError(str(error)) from error


def check_batch(batch: mujoco.batch.Batch, joint: Joint) -> None:
    """Refuse simulations in which MuJoCo warned: they stop, or go on from a state put back.

    Raises:
        UnmeasuredError: One did; the message has the warning's name.
    """
    try:
        check_warnings(batch, joint.name)
    except RuntimeError as error:
        raise UnmeasuredError(str(error)) from error


def angles(
    bench: Rig, start: mujoco.MjData, duration: float, excitation: Mapping[str, Signal]
) -> NDArray[np.float64]:
    """Angle [rad] at every step of the run that ``run`` would record, shape (T + 1,).

    Bit for bit the same and thirty times as fast, for searches; ``start`` stays as it is.
    """
    steps = round(duration / bench.timestep)
    control = np.tile(start.ctrl, (1, steps, 1))
    for name, signal in excitation.items():
        index = bench.model.actuator_ctrladr[bench.model.actuator(name).id]
        # held over each step at the value of mid-step, as in a recorded run
        control[0, :, index] = [signal((k + 0.5) * bench.timestep) for k in range(steps)]
    state = np.empty(mujoco.mj_stateSize(bench.model, _STATE))
    mujoco.mj_getState(bench.model, start, state, _STATE)
    with installed():
        states, _ = mujoco.rollout.rollout(
            bench.model, mujoco.MjData(bench.model), state[np.newaxis], control
        )
    return np.concatenate([state[1:2], states[0, :, 1]])


def direction(joint: Joint, muscle: str) -> float:
    """1 where a muscle pulls towards positive angles, -1 where towards negative ones."""
    return -float(np.sign(joint.gears[muscle]))


def antagonist(joint: Joint, muscle: str) -> str:
    """The first muscle that pulls the other way.

    Raises:
        ValueError: There is none.
    """
    for name in joint.muscles:
        if direction(joint, name) != direction(joint, muscle):
            return name
    raise ValueError(f"{joint.name}: no muscle pulls against {muscle!r}")


def muscle_torque(joint: Joint, muscle: str, level: float, angle: float) -> float:
    """Steady torque [N·m] of a muscle at an input, the joint held at an angle [rad]."""
    parameters, length = joint.muscles[muscle], joint.gears[muscle] * angle
    force = tension(parameters, steady_stretch(parameters, level, length))
    return -joint.gears[muscle] * force


def net_torque(joint: Joint, inputs: Mapping[str, float], angle: float) -> float:
    """Steady torque [N·m] of muscles and passive elasticity at an angle [rad]; inputs 0 unnamed."""
    pulls = (muscle_torque(joint, name, inputs.get(name, 0.0), angle) for name in joint.muscles)
    return plant_torque(joint, angle) + sum(pulls)


def strongest_angle(joint: Joint, muscle: str) -> float:
    """Angle [rad] in the range of motion at which a muscle's isometric force is largest."""
    low, high = joint.range
    return min(max(joint.muscles[muscle].optimal_length / joint.gears[muscle], low), high)
