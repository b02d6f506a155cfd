"""Many joints stepped together do what each does alone."""

from dataclasses import replace
from types import MappingProxyType

import mujoco
import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.engine.spec import joint_spec
from mjhill.lab.batch import driving_torques, joint_angles
from mjhill.simulate.reference import plant_torque

STEPS = 300
TIME = np.arange(STEPS + 1) * 1e-3


def with_flexor(joint, **changes):
    muscles = dict(joint.muscles)
    muscles["elbow_flexor"] = replace(muscles["elbow_flexor"], **changes)
    return replace(joint, muscles=MappingProxyType(muscles))


def varied(joint):
    """Joints that differ in every kind of parameter."""
    return [
        joint,
        with_flexor(joint, max_isometric_force=40.0, activation_tau=0.014),
        replace(joint, damping=0.1, stiffness=1.5, rest_angle=1.0),
        replace(joint, passive=replace(joint.passive, k1_pos=0.5, k2_neg=6.0)),
        replace(joint, inertia=0.1),
    ]


def without_muscle(joint):
    """A joint whose muscles have no torque to speak of."""
    weak = {name: replace(m, max_isometric_force=1e-9) for name, m in joint.muscles.items()}
    return replace(joint, muscles=MappingProxyType(weak))


def recorded(joint, start, excitation, torque):
    model = joint_spec(joint).compile()
    data = rest(model, start)
    with mjhill.installed():
        recording = mjhill.record(
            model, data, duration=STEPS * 1e-3, excitation=excitation, torque={"elbow": torque}
        )
    return recording["elbow.angle"]


def mid_step(signal):
    """Values of a signal over each step, as a recorded run holds them."""
    return np.array([signal(t + 0.5e-3) for t in TIME[:-1]])


# --- free joints


def test_each_joint_moves_as_it_does_alone(elbow):
    joints = varied(elbow)
    flex, extend = mjhill.pulse(0.7, 0.02, 0.1), mjhill.step(0.4, 0.15)
    push = mjhill.sinusoid(3.0, 5.0)
    found = joint_angles(
        joints,
        start=1.0,
        excitation=np.stack([mid_step(flex), mid_step(extend)], axis=1),
        torque=mid_step(push),
        steps=STEPS,
    )
    inputs = {"elbow_flexor": flex, "elbow_extensor": extend}
    alone = [recorded(joint, 1.0, inputs, push) for joint in joints]
    # the same engine and machine code; forward calls between the steps change no state
    np.testing.assert_allclose(found, alone, rtol=0, atol=1e-12)
    assert (np.abs(np.diff(found[:, -1])) > 1e-3).all()


def test_inputs_and_starts_may_differ_from_joint_to_joint(elbow):
    start, level = np.array([0.6, 1.4]), np.array([[0.2, 0.0], [0.0, 0.5]])
    found = joint_angles(
        [elbow, elbow],
        start=start,
        excitation=level[:, None, :],
        torque=[[1.0], [0.0]],
        steps=STEPS,
    )
    for k, push in enumerate((1.0, 0.0)):
        inputs = dict(zip(elbow.muscles, level[k].tolist(), strict=True))
        alone = recorded(elbow, start[k], inputs, push)
        np.testing.assert_allclose(found[k], alone, rtol=0, atol=1e-12)


def test_a_joint_starts_at_its_angle_and_velocity(elbow):
    found = joint_angles([elbow], start=0.9, velocity=2.0, excitation=0.0, steps=5, timestep=1e-4)
    assert found[0, 0] == 0.9
    # half a per mille of the velocity is lost to damping and elasticity in a step
    assert np.diff(found[0])[0] / 1e-4 == pytest.approx(2.0, rel=2e-3)


def test_a_joint_in_balance_under_steady_inputs_stays(elbow):
    level = np.array([0.3, 0.2])
    settled = joint_angles([elbow], start=1.2, before=level, excitation=level, steps=10_000)[0, -1]
    stays = joint_angles([elbow], start=settled, before=level, excitation=level, steps=STEPS)
    assert np.ptp(stays) < 1e-6  # what ten seconds left unsettled


def test_a_simulation_that_goes_bad_is_an_error_that_names_the_joint(elbow, capfd):
    with pytest.raises(RuntimeError, match="elbow: MuJoCo warned 'badqacc' in 2 of 2 simulations"):
        joint_angles([elbow] * 2, start=1.0, excitation=0.0, torque=1e12, steps=5)
    capfd.readouterr()  # MuJoCo says so too


# --- driven joints


def test_the_torque_that_holds_a_joint_balances_muscles_and_elasticity(elbow):
    level = np.array([0.5, 0.2])
    for joint in varied(elbow):
        model = joint_spec(joint).compile()
        data = rest(model, 0.8, elbow_flexor=0.5, elbow_extensor=0.2)
        with mjhill.installed():
            mujoco.mj_forward(model, data)
        path, excitation = np.full(50, 0.8), np.tile(level, (50, 1))
        held = driving_torques([joint], path=path, before=level, excitation=excitation)
        expected = -(data.qfrc_actuator[0] + plant_torque(joint, 0.8))
        np.testing.assert_allclose(held[0], expected, rtol=1e-9)


def test_the_torque_that_moves_a_joint_without_muscle_is_that_of_its_plant(elbow):
    joint = without_muscle(elbow)
    path = 1.0 + 0.3 * np.sin(8.0 * TIME)
    found = driving_torques([joint], path=path, excitation=np.zeros((len(path), 2)))[0]
    velocity, acceleration = 2.4 * np.cos(8.0 * TIME), -19.2 * np.sin(8.0 * TIME)
    plant = np.array([plant_torque(joint, q) for q in path.tolist()])
    expected = joint.inertia * acceleration + joint.damping * velocity - plant
    # differences of first order, at the ends of the path one-sided and worse
    np.testing.assert_allclose(found[3:-3], expected[3:-3], atol=0.01 * np.ptp(expected))


def test_the_torque_that_moves_a_joint_is_recovered_from_its_path(elbow):
    joints = varied(elbow)
    torque = 4.0 * np.sin(12.0 * TIME[:-1]) ** 2
    excitation = np.stack([0.4 * (TIME[:-1] > 0.05), 0.2 * (TIME[:-1] > 0.12)], axis=1)
    paths = joint_angles(joints, start=1.0, excitation=excitation, torque=torque, steps=STEPS)
    for joint, path in zip(joints, paths, strict=True):
        found = driving_torques([joint], path=path[:-1], excitation=excitation)[0]
        # derivatives of the path are differences, a step apart from each other
        np.testing.assert_allclose(found[5:-5], torque[5:-5], atol=0.03 * np.ptp(torque))


def stepped_torques(joint, path, excitation, timestep=1e-3):
    """The torque on a path, from a simulation that is put on it anew before every step."""
    model = joint_spec(joint).compile()
    data = rest(model, path[0])
    speed = np.diff(path, prepend=path[0]) / timestep
    inertial = joint.inertia * np.gradient(np.gradient(path, timestep), timestep)
    torque = np.empty(len(path))
    with mjhill.installed():
        for k in range(len(path)):
            data.qpos[0], data.qvel[0], data.ctrl[:] = path[k], speed[k], excitation[k]
            mujoco.mj_step(model, data)
            torque[k] = inertial[k] - data.qfrc_passive[0] - data.qfrc_actuator[0]
    return torque


@pytest.mark.parametrize("name", mjhill.JOINTS)
def test_a_driven_joint_is_on_its_path_at_every_step(name):
    joint = mjhill.JOINTS[name]
    low, high = joint.range
    random = np.random.default_rng(4)
    path = 0.5 * (low + high) + 0.4 * (high - low) * np.sin(8 * TIME)
    path += 1e-3 * (high - low) * random.standard_normal(len(path))  # jerky, too
    excitation = random.uniform(0, 1, (len(path), 2))
    found = driving_torques([joint], path=path, excitation=excitation)[0]
    expected = stepped_torques(joint, path, excitation)
    # the path is summed up from its velocities, with their rounding
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.ptp(expected))


def test_driven_joints_do_not_disturb_each_other(elbow):
    joints, path = varied(elbow), 1.0 + 0.2 * np.sin(10.0 * TIME)
    inputs = {"path": path, "excitation": np.full((len(path), 2), 0.3)}
    together = driving_torques(joints, **inputs)
    for joint, row in zip(joints, together, strict=True):
        np.testing.assert_array_equal(row, driving_torques([joint], **inputs)[0])


def test_each_joint_may_have_a_path_and_excitations_of_its_own(elbow):
    joints = varied(elbow)[:2]
    paths = np.stack([1.0 + 0.2 * np.sin(10 * TIME), 0.9 + 0.1 * np.cos(6 * TIME)])
    excitation = np.random.default_rng(6).uniform(0, 1, (2, len(TIME), 2))
    together = driving_torques(joints, path=paths, excitation=excitation)
    for joint, path, inputs, row in zip(joints, paths, excitation, together, strict=True):
        alone = driving_torques([joint], path=path, excitation=inputs)[0]
        np.testing.assert_array_equal(row, alone)


# --- callbacks


@pytest.mark.parametrize("backend", ["compiled", "python"])
def test_callbacks_in_place_change_nothing_and_stay(elbow, backend):
    inputs = {"excitation": np.full((20, 2), 0.4)}
    moved = joint_angles([elbow] * 3, start=1.0, steps=20, **inputs)
    driven = driving_torques([elbow] * 3, path=moved[0, :20], **inputs)
    with mjhill.installed(backend):
        np.testing.assert_array_equal(
            moved, joint_angles([elbow] * 3, start=1.0, steps=20, **inputs)
        )
        np.testing.assert_array_equal(
            driven, driving_torques([elbow] * 3, path=moved[0, :20], **inputs)
        )
        assert mjhill.installed_backend() == backend
