"""Every joint that comes with mjhill, at its default timestep and past it."""

import mujoco
import numpy as np
import pytest

import mjhill
from mjhill.simulate.reference import simulate

FINE = 1e-4  # [s]


def angles(model, joint, excitation, timestep, duration):
    model.opt.timestep = timestep
    data = mjhill.at_home(model)
    for name, level in excitation.items():
        data.actuator(name).ctrl = level
    result = [joint.home_angle]
    with mjhill.installed():
        for _ in range(round(duration / timestep)):
            mujoco.mj_step(model, data)
            result.append(data.joint(joint.name).qpos[0])
    return np.array(result)


def tasks(joint):
    first, second = joint.muscles
    return [{first: 0.5}, {first: 1.0}, {second: 1.0}]


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_a_joint_is_accurate_at_its_default_timestep_and_holds_at_five_times_it(name):
    joint, model = mjhill.JOINTS[name], mjhill.load(name)
    default = model.opt.timestep
    for excitation in tasks(joint):
        truth = simulate(joint, excitation, duration=0.4, sample=FINE)[f"{name}.angle"]
        for timestep, allowed in ((default, 0.005), (5 * default, 0.05)):
            found = angles(model, joint, excitation, timestep, 0.4)
            error = np.abs(found - truth[:: round(timestep / FINE)]).max()
            assert error <= allowed * np.ptp(truth)


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_full_cocontraction_does_not_ring_at_five_times_the_default_timestep(name):
    joint, model = mjhill.JOINTS[name], mjhill.load(name)
    excitation = dict.fromkeys(joint.muscles, 1.0)
    found = angles(model, joint, excitation, 5 * model.opt.timestep, 1.0)
    steps = np.diff(found[-40:])
    # it may still be on its way, but not to and fro
    assert np.abs(np.diff(steps)).max() < 1e-3


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_tetanus_at_the_optimum_gives_the_maximum_isometric_torque(name):
    joint, model = mjhill.JOINTS[name], mjhill.load(name)
    for muscle, parameters in joint.muscles.items():
        data = mujoco.MjData(model)
        data.joint(name).qpos = parameters.optimal_length / joint.gears[muscle]
        mjhill.equilibrate(model, data)
        data.actuator(muscle).ctrl = 1.0
        held = data.qpos.copy()
        with mjhill.installed():
            for _ in range(1500):
                mujoco.mj_step(model, data)
                data.qpos[:], data.qvel[:] = held, 0.0
            mujoco.mj_forward(model, data)
        torque = -data.actuator(muscle).force[0]
        assert torque == pytest.approx(parameters.max_isometric_force, rel=1e-3)
