"""Right on every path, not on the rise alone: the elbow's flexor held, stretched and stimulated."""

import dataclasses
import math

import mujoco
import numpy as np
import pytest

import mjhill
from mjhill.engine.spec import joint_spec, system_spec
from mjhill.joints.system import Coordinate, Movement, System
from mjhill.simulate.reference import rest_state, simulate

TIMESTEPS = (1e-3, 2e-3, 5e-3)
HELD = Movement(lambda t: 1.3, lambda t: 0.0)


def alone(muscle):
    """The muscle on a hinge without an antagonist."""
    return System(
        name="flexor",
        coordinates={"hinge": Coordinate(inertia=0.06)},
        muscles={"flexor": muscle},
        arms={"flexor": {"hinge": -1.0}},
    )


def force_error(muscle, movement, signal, tonic, timestep, duration=0.3):
    """Largest error of force [F_max] while the joint is moved, and the forces themselves."""
    system = alone(muscle)
    start = rest_state(system, movement.position(0.0), {"flexor": tonic})
    exact = simulate(
        system, {"flexor": signal}, movement={"hinge": movement}, duration=duration,
        start=start, sample=timestep, solver="LSODA",
    )["flexor.force"]  # fmt: skip
    model = system_spec(system).compile()
    model.opt.timestep = timestep
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = mujoco.MjData(model)
    data.qpos[0], data.ctrl[0] = movement.position(0.0), tonic
    mjhill.equilibrate(model, data)
    forces = []
    with mjhill.installed():
        for step in range(len(exact)):
            now, before = (movement.position(k * timestep) for k in (step, step - 1))
            # as MuJoCo's own movements have it: the mean velocity of the step before
            data.qpos[0], data.qvel[0] = now, (now - before) / timestep if step else 0.0
            data.ctrl[0] = signal((step + 0.5) * timestep)
            mujoco.mj_step(model, data)
            forces.append(-data.actuator_force[0])
    error = np.abs(np.array(forces) - exact).max()
    return error / muscle.max_isometric_force, np.array(forces)


@pytest.mark.parametrize(
    ("timestep", "most"), [*zip(TIMESTEPS, (0.0005, 0.002, 0.01), strict=True)]
)
def test_an_isometric_muscle_is_released_as_it_should_be(muscle, timestep, most):
    released = mjhill.constant(1.0) + mjhill.step(-1.0, 0.05)
    error, _ = force_error(muscle, HELD, released, 1.0, timestep)
    assert error <= most


@pytest.mark.parametrize("timestep", TIMESTEPS)
def test_electrical_stimulation_does_not_dip_at_its_onset(muscle, timestep):
    stimulated = dataclasses.replace(muscle, electrical_stimulation=True)
    rising = mjhill.constant(0.2) + mjhill.step(0.6, 0.05)
    error, forces = force_error(stimulated, HELD, rising, 0.2, timestep)
    assert np.all(np.diff(forces) >= -1e-9 * forces[0])
    assert error < 0.01


@pytest.mark.parametrize(("timestep", "most"), [*zip(TIMESTEPS, (0.015, 0.03, 0.1), strict=True)])
def test_a_stretch_at_v_max_and_back_gives_the_force_of_the_reference(muscle, timestep, most):
    rate = 2 * math.pi * 10
    size = muscle.max_velocity / rate
    movement = Movement(
        lambda t: 1.3 - size * (1 - math.cos(rate * t)),
        lambda t: -muscle.max_velocity * math.sin(rate * t),
    )
    error, _ = force_error(muscle, movement, mjhill.constant(1.0), 1.0, timestep)
    assert error <= most


@pytest.mark.parametrize("integrator", ["EULER", "IMPLICITFAST", "DISCRETE", "RK4"])
def test_an_ankle_hit_with_three_times_its_force_swings_as_it_should(integrator):
    joint = mjhill.JOINTS["ankle"]
    most = max(muscle.max_isometric_force for muscle in joint.muscles.values())
    push = mjhill.pulse(3 * most, 0.05, 0.01)
    exact = simulate(joint, {}, torque=push, duration=0.5, solver="LSODA")["ankle.angle"]
    model = joint_spec(joint).compile()
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    data = mujoco.MjData(model)
    data.qpos[0] = joint.home_angle
    mjhill.equilibrate(model, data)
    with mjhill.installed():
        run = mjhill.record(model, data, duration=0.5, torque={"ankle": push})
    error = np.abs(run["ankle.angle"] - exact).max() / np.ptp(exact)
    # MuJoCo's own first-order step of the joint
    assert error < (0.005 if integrator == "RK4" else 0.03)


def test_a_timestep_too_long_for_the_ankle_under_an_impact_warns():
    model = joint_spec(mjhill.JOINTS["ankle"]).compile()
    model.opt.timestep = 5e-3
    with pytest.warns(RuntimeWarning, match="joint 'ankle'.*set model.opt.timestep to"):
        mjhill.check_model(model)
