import mujoco
import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.readings import shortening_velocity
from mjhill.spec import joint_spec


def test_a_recording_has_every_series_with_its_unit(pair):
    with mjhill.installed():
        result = mjhill.record(
            pair, rest(pair), duration=0.05, excitation={"elbow_flexor": 0.5}, torque={"elbow": 1.0}
        )
    muscle = {"u": "-", "n": "-", "a": "-", "velocity": "rad/s", "stretch": "rad", "force": "N·m"}
    expected = {"elbow.angle": "rad", "elbow.velocity": "rad/s", "elbow.applied": "N·m"}
    for name in ("elbow_flexor", "elbow_extensor"):
        expected |= {f"{name}.{quantity}": unit for quantity, unit in muscle.items()}
    assert dict(result.units) == expected
    assert len(result) == 51
    np.testing.assert_allclose(np.diff(result.time), 1e-3)
    assert result.about["integrator"] == "mjINT_EULER"


def test_recorded_force_is_the_force_that_mujoco_applies(pair):
    data = rest(pair)
    with mjhill.installed():
        result = mjhill.record(pair, data, duration=0.2, excitation={"elbow_flexor": 0.8})
        mujoco.mj_forward(pair, data)
    assert result["elbow_flexor.force"][-1] == pytest.approx(-data.actuator_force[0], rel=1e-12)
    assert result["elbow_flexor.force"][-1] > 1.0


@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize("integrator", ["EULER", "IMPLICITFAST", "IMPLICIT", "RK4"])
def test_recorded_velocity_is_how_far_the_contractile_element_shortened(pair, integrator, every):
    pair.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    with mjhill.installed():
        result = mjhill.record(
            pair,
            rest(pair),
            duration=0.3,
            every=every,
            excitation={"elbow_flexor": mjhill.step(0.7, 0.02)},
        )
    for name, gear in (("elbow_flexor", -1), ("elbow_extensor", 1)):
        contractile = gear * result["elbow.angle"] - result[f"{name}.stretch"]
        mean = -np.diff(contractile) / np.diff(result.time)
        np.testing.assert_allclose(result[f"{name}.velocity"][1:], mean, rtol=0, atol=1e-11)
    assert result["elbow_flexor.velocity"].max() > 3


@pytest.mark.parametrize("integrator", ["EULER", "IMPLICITFAST", "IMPLICIT"])
def test_a_run_that_goes_on_begins_with_the_velocity_of_the_step_before(pair, integrator):
    pair.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    with mjhill.installed():
        data = rest(pair)
        first = mjhill.record(pair, data, duration=0.1, excitation={"elbow_flexor": 0.7})
        second = mjhill.record(pair, data, duration=0.1)
    for name in ("elbow_flexor.velocity", "elbow_extensor.velocity"):
        assert second[name][0] == pytest.approx(first[name][-1], rel=1e-9)
    assert second["elbow_flexor.velocity"][0] > 1


def test_under_rk4_a_run_begins_with_the_velocity_of_that_moment(pair, muscle):
    pair.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with mjhill.installed():
        data = rest(pair)
        mjhill.record(pair, data, duration=0.1, excitation={"elbow_flexor": 0.7})
        second = mjhill.record(pair, data, duration=0.1)
    stretch, angle = second["elbow_flexor.stretch"][0], second["elbow.angle"][0]
    expected = shortening_velocity(muscle, second["elbow_flexor.a"][0], -angle, stretch)
    assert second["elbow_flexor.velocity"][0] == pytest.approx(expected, rel=1e-9)
    assert expected > 1


def test_recording_every_few_steps_keeps_those_steps(pair):
    runs = []
    for every in (1, 5):
        with mjhill.installed():
            runs.append(
                mjhill.record(
                    pair, rest(pair), duration=0.1, every=every, excitation={"elbow_flexor": 0.5}
                )
            )
    np.testing.assert_array_equal(runs[1]["elbow.angle"], runs[0]["elbow.angle"][::5])


def test_recording_does_not_change_the_run(pair):
    with mjhill.installed():
        data, plain = rest(pair), rest(pair)
        mjhill.record(pair, data, duration=0.1, excitation={"elbow_flexor": 0.5})
        plain.ctrl[0] = 0.5
        mujoco.mj_step(pair, plain, nstep=100)
    np.testing.assert_array_equal(data.qpos, plain.qpos)
    np.testing.assert_array_equal(data.act, plain.act)


def test_a_run_goes_on_from_where_the_data_is(pair):
    with mjhill.installed():
        data = rest(pair)
        first = mjhill.record(pair, data, duration=0.1, excitation={"elbow_flexor": 0.5})
        second = mjhill.record(pair, data, duration=0.1)
    assert second.time[0] == pytest.approx(first.time[-1])
    assert second["elbow.angle"][0] == first["elbow.angle"][-1]
    assert second["elbow_flexor.u"][0] == 0.5


def test_an_external_torque_moves_the_joint_the_way_it_points(pair):
    with mjhill.installed():
        result = mjhill.record(
            pair, rest(pair, angle=1.3), duration=0.1, torque={"elbow": mjhill.pulse(5, 0, 0.05)}
        )
    assert result["elbow.angle"][-1] > 1.35


def test_a_model_with_muscles_does_not_run_without_callbacks(pair):
    with pytest.raises(RuntimeError, match="no callbacks are installed.*mjhill.installed"):
        mjhill.record(pair, rest(pair), duration=0.1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"excitation": {"biceps": 0.5}}, "unknown actuator 'biceps'; there are: elbow_flexor"),
        ({"torque": {"knee": 1.0}}, "unknown hinge or slide joint 'knee'; there are: elbow"),
        ({"excitation": {"elbow_flexor": float("nan")}}, "level must be finite, got nan"),
        ({"duration": 0.0}, "duration must be positive, got 0.0 s"),
        ({"duration": 1e-9}, "duration must be at least a timestep, 0.001 s, got 1e-09 s"),
        ({"every": 0}, "every must be at least 1 step, got 0"),
    ],
)
def test_a_run_with_bad_input_says_what_is_wrong(pair, arguments, message):
    with mjhill.installed(), pytest.raises(ValueError, match=message):
        mjhill.record(pair, rest(pair), **{"duration": 0.1, **arguments})


def test_a_control_that_is_not_finite_is_named_before_the_run(pair):
    data = rest(pair)
    data.ctrl[1] = np.nan
    with mjhill.installed(), pytest.raises(ValueError, match=r"data.ctrl\[1\] must be finite"):
        mjhill.record(pair, data, duration=0.1)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_an_input_that_turns_bad_names_itself_and_its_time(pair, bad):
    signal = mjhill.Signal(lambda t: bad if t > 0.02 else 0.1)
    message = f"input of 'elbow_flexor' at 0.02.* s must be finite, got {bad}"
    with mjhill.installed(), pytest.raises(ValueError, match=message):
        mjhill.record(pair, rest(pair), duration=0.1, excitation={"elbow_flexor": signal})


def test_an_input_of_the_wrong_type_says_what_to_pass(pair):
    with mjhill.installed(), pytest.raises(TypeError, match=r"wrap a function .* mjhill.Signal"):
        mjhill.record(pair, rest(pair), duration=0.1, excitation={"elbow_flexor": "strong"})


def test_a_run_in_which_mujoco_warned_is_a_failed_run(pair):
    data = rest(pair)
    data.qvel[0] = 1e12
    with mjhill.installed(), pytest.raises(RuntimeError, match="MuJoCo warned 'badqvel'"):
        mjhill.record(pair, data, duration=0.1)


def test_a_ball_joint_and_a_slide_are_recorded_by_coordinate(muscle):
    model = mujoco.MjModel.from_xml_string("""
    <mujoco><worldbody><body><joint name="s" type="slide"/><geom size="0.1"/>
      <body><joint name="b" type="ball"/><geom size="0.1" pos="0.2 0 0"/></body>
    </body></worldbody></mujoco>""")
    result = mjhill.record(model, mujoco.MjData(model), duration=0.01)
    assert result.units["s.position"] == "m"
    assert [name for name in result if name.startswith("b.")] == [
        *(f"b.qpos{k}" for k in range(4)), *(f"b.qvel{k}" for k in range(3)),
    ]  # fmt: skip


def test_progress_reaches_the_end(pair):
    shares = []
    with mjhill.installed():
        mjhill.record(pair, rest(pair), duration=0.512, progress=shares.append)
    assert shares == [0.0, 0.5, 1.0]


def test_a_bare_pair_is_a_model_of_the_joint(elbow):
    model = joint_spec(elbow).compile()
    assert model.nv == 1
    assert model.na == 6
