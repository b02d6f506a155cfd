import mujoco
import numpy as np
import pytest
from made_joint import MUSCLE, make_joint

import mjhill
from mjhill.engine.spec import joint_spec, system_spec
from mjhill.joints.system import Coordinate, Movement, System
from mjhill.simulate.reference import rest_state, simulate

SLIDE = System(
    name="slide",
    coordinates={"cart": Coordinate(inertia=0.8, damping=6.0, stiffness=40.0, slide=True)},
    muscles={"puller": MUSCLE, "opponent": MUSCLE},
    arms={"puller": {"cart": -2.0}, "opponent": {"cart": 1.5}},
)
TWO_JOINTS = System(
    name="arm",
    coordinates={
        "shoulder": Coordinate(inertia=0.05, damping=0.2, stiffness=3.0),
        "elbow": Coordinate(inertia=0.02, damping=0.1, stiffness=2.0, rest=0.3),
    },
    muscles={"biceps": MUSCLE, "triceps": MUSCLE, "deltoid": MUSCLE},
    arms={
        "biceps": {"shoulder": -0.5, "elbow": -1.0},
        "triceps": {"shoulder": 0.6, "elbow": 0.8},
        "deltoid": {"shoulder": -1.0},
    },
)
INPUTS = {
    "slide": {"puller": mjhill.pulse(1.0, 0.02, 0.1), "opponent": mjhill.pulse(0.8, 0.1, 0.1)},
    "arm": {
        "biceps": mjhill.pulse(1.0, 0.02, 0.1),
        "triceps": mjhill.pulse(0.8, 0.1, 0.1),
        "deltoid": 0.1,
    },
}


def positions(recording, system):
    return np.array(
        [
            recording[f"{name}.{'position' if coordinate.slide else 'angle'}"]
            for name, coordinate in system.coordinates.items()
        ]
    )


@pytest.mark.parametrize("system", [SLIDE, TWO_JOINTS], ids=lambda system: system.name)
def test_two_stiff_solvers_agree_to_a_millionth(system):
    found = [
        positions(
            simulate(
                system, INPUTS[system.name], duration=0.3, solver=solver, rtol=1e-9, atol=1e-11
            ),
            system,
        )
        for solver in ("Radau", "LSODA")
    ]
    movement = np.ptp(found[0], axis=1)
    assert np.all(np.abs(found[0] - found[1]).max(axis=1) < 1e-6 * movement)


@pytest.mark.parametrize("system", [SLIDE, TWO_JOINTS], ids=lambda system: system.name)
def test_mujoco_agrees_with_the_reference(system):
    model = system_spec(system).compile()
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = 1e-3
    data = mujoco.MjData(model)
    start = rest_state(system)
    count = 2 * len(system.coordinates)
    data.qpos[:], data.qvel[:], data.act[:] = start[0:count:2], start[1:count:2], start[count:]
    with mjhill.installed():
        found = mjhill.record(model, data, duration=0.3, excitation=INPUTS[system.name])
    truth = simulate(system, INPUTS[system.name], duration=0.3)
    for name, coordinate in system.coordinates.items():
        key = f"{name}.{'position' if coordinate.slide else 'angle'}"
        assert np.ptp(truth[key]) > 0.01
        assert np.abs(found[key] - truth[key]).max() < 2e-3 * np.ptp(truth[key])


def test_a_joint_as_a_system_is_the_same_model(elbow):
    joint, system = joint_spec(elbow).compile(), system_spec(System.of(elbow)).compile()
    for name in ("actuator_gear", "actuator_dynprm", "actuator_gainprm", "actuator_biasprm",
                 "dof_damping", "jnt_stiffness", "qpos_spring"):  # fmt: skip
        np.testing.assert_array_equal(getattr(joint, name), getattr(system, name), err_msg=name)


def test_a_joint_as_a_system_moves_the_same(elbow):
    inputs = {"elbow_flexor": mjhill.pulse(1.0, 0.02, 0.1)}
    first = simulate(elbow, inputs, duration=0.2)
    second = simulate(System.of(elbow), inputs, duration=0.2, start=rest_state(elbow))
    np.testing.assert_array_equal(first["elbow.angle"], second["elbow.angle"])


def test_a_prescribed_movement_is_followed_and_lengthens_the_muscle():
    system = System.of(make_joint())
    movement = Movement(lambda t: 0.2 * np.sin(20 * t), lambda t: 4.0 * np.cos(20 * t))
    found = simulate(
        system, {"puller": 0.5}, movement={"joint": movement}, duration=0.2,
        start=rest_state(system, 0.0, {"puller": 0.5}),
    )  # fmt: skip
    np.testing.assert_allclose(found["joint.angle"], 0.2 * np.sin(20 * found.time), atol=1e-12)
    held = simulate(
        system, {"puller": 0.5}, duration=0.2, start=rest_state(system, 0.0, {"puller": 0.5}),
        movement={"joint": Movement(lambda _: 0.0, lambda _: 0.0)},
    )  # fmt: skip
    assert np.ptp(held["puller.force"]) < 1e-6
    assert np.ptp(found["puller.force"]) > 2.0


def test_length_is_the_sum_over_coordinates():
    at = {"shoulder": 0.2, "elbow": 0.5}
    assert TWO_JOINTS.length("biceps", at) == pytest.approx(-0.6)
    assert not TWO_JOINTS.slides("biceps")
    assert SLIDE.slides("puller")


def test_bad_input_is_named():
    with pytest.raises(ValueError, match=r"unknown coordinate 'wrist'; there are: shoulder, elbow"):
        simulate(
            TWO_JOINTS, {}, duration=0.1, movement={"wrist": Movement(lambda _: 0, lambda _: 0)}
        )
    with pytest.raises(ValueError, match="unknown coordinate 'wrist'"):
        simulate(TWO_JOINTS, {}, duration=0.1, torque={"wrist": 1.0})
    with pytest.raises(ValueError, match="torque must be given by coordinate"):
        simulate(TWO_JOINTS, {}, duration=0.1, torque=1.0)
    with pytest.raises(ValueError, match=r"arms must name the muscles \['biceps'\], got \[\]"):
        System(name="x", coordinates=TWO_JOINTS.coordinates, muscles={"biceps": MUSCLE})
    with pytest.raises(ValueError, match="'biceps' needs an arm about one of"):
        System(
            name="x",
            coordinates=TWO_JOINTS.coordinates,
            muscles={"biceps": MUSCLE},
            arms={"biceps": {"wrist": 1.0}},
        )
