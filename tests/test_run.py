import mujoco
import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.engine.python import excitation
from mjhill.engine.spec import joint_spec
from mjhill.muscles.readings import shortening_velocity, tension

STRONG = mjhill.Hill(
    max_isometric_force=100.0,
    optimal_length=0.0,
    width_short=0.2,
    width_long=0.2,
    max_velocity=2.0,
    hill_shape=0.3,
    series_stretch=0.02,
    excitation_tau=0.03,
    activation_tau=0.01,
    deactivation_tau=0.04,
)


def test_a_recording_has_every_series_with_its_unit(pair):
    with mjhill.installed():
        result = mjhill.record(
            pair, rest(pair), duration=0.05, excitation={"elbow_flexor": 0.5}, torque={"elbow": 1.0}
        )
    muscle = {
        "u": "-", "n": "-", "a": "-", "velocity": "rad/s", "stretch": "rad", "force": "N·m",
        "length": "rad", "length_rate": "rad/s", "contractile_length": "rad",
        "series_stiffness": "N·m/rad", "series_energy": "J", "contractile_power": "W",
        "series_power": "W", "power": "W", "contractile_work": "J", "work": "J", "arm_elbow": "-",
    }  # fmt: skip
    expected = {"elbow.angle": "rad", "elbow.velocity": "rad/s", "elbow.applied": "N·m"}
    expected["elbow.passive_energy"] = "J"
    for name in ("elbow_flexor", "elbow_extensor"):
        expected |= {f"{name}.{quantity}": unit for quantity, unit in muscle.items()}
    for quantity in ("kinetic_energy", "damping_loss", "external_work"):
        expected[f"model.{quantity}"] = "J"
    assert dict(result.units) == expected
    assert len(result) == 51
    np.testing.assert_allclose(np.diff(result.time), 1e-3)
    assert result.about["integrator"] == "mjINT_EULER"


def test_recorded_force_is_the_force_that_mujoco_applies(pair):
    data = rest(pair)
    with mjhill.installed():
        result = mjhill.record(pair, data, duration=0.2, excitation={"elbow_flexor": 0.8})
        mujoco.mj_forward(pair, data)
    assert result["elbow_flexor.force"][-1] == -data.actuator_force[0] > 1.0
    assert "elbow_flexor.tension" not in result


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


@pytest.mark.parametrize("integrator", ["EULER", "IMPLICITFAST", "RK4"])
def test_force_is_the_tension_of_the_series_element(pair, muscle, integrator):
    pair.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.2, excitation={"elbow_flexor": 0.8})
    tensions = [tension(muscle, x) for x in run["elbow_flexor.stretch"].tolist()]
    np.testing.assert_allclose(run["elbow_flexor.force"], tensions, rtol=1e-13)


def limited(elbow, **changes):
    """The pair of the elbow, its flexor's actuator changed."""
    spec = joint_spec(elbow)
    for what, value in changes.items():
        setattr(spec.actuator("elbow_flexor"), what, value)
    return spec.compile()


def test_a_forcerange_shows_in_force_and_tension_says_what_the_muscle_would_give(elbow):
    model = limited(elbow, forcerange=[-1, 0], forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE)
    data = rest(model, elbow_flexor=1.0)
    with mjhill.installed(), pytest.warns(RuntimeWarning, match="its forcerange, -1 to 0"):
        run = mjhill.record(model, data, duration=0.2)
    assert data.actuator_force[0] == -1.0
    np.testing.assert_array_equal(run["elbow_flexor.force"], 1.0)
    assert run["elbow_flexor.tension"].min() > 10.0
    assert run.units["elbow_flexor.tension"] == "N·m"
    assert "elbow_extensor.tension" not in run


def test_a_muscle_of_a_disabled_group_is_recorded_with_no_force(elbow):
    model = limited(elbow, group=3)
    model.opt.disableactuator = 1 << 3
    with mjhill.installed(), pytest.warns(RuntimeWarning, match="its group 3 is disabled"):
        run = mjhill.record(model, rest(model, elbow_flexor=1.0), duration=0.05)
    np.testing.assert_array_equal(run["elbow_flexor.force"], 0.0)
    assert not np.signbit(run["elbow_flexor.force"]).any()
    assert run["elbow_flexor.tension"][0] > 0.01


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


def test_a_recorded_input_is_the_one_that_the_muscle_gets(pair):
    pair.actuator_ctrlrange[1] = 0.2, 0.6
    pair.actuator_ctrllimited[0] = False
    signals = [-0.5, 0.1, 0.4, 0.9, 7.0]
    for clamp in (True, False):
        flag = mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
        pair.opt.disableflags = 0 if clamp else flag
        for value in signals:
            data = rest(pair)
            inputs = {"elbow_flexor": value, "elbow_extensor": value}
            with mjhill.installed():
                run = mjhill.record(pair, data, duration=0.001, excitation=inputs)
            for index, name in enumerate(inputs):
                assert run[f"{name}.u"][-1] == excitation(pair, data, index)


def test_a_delayed_input_is_recorded_when_it_arrives(elbow):
    spec = joint_spec(elbow)
    spec.actuator("elbow_flexor").nsample, spec.actuator("elbow_flexor").delay = 40, 0.02
    model = spec.compile()
    with mjhill.installed():
        run = mjhill.record(
            model, rest(model), duration=0.1, excitation={"elbow_flexor": mjhill.step(0.5, 0.03)}
        )
    onset = run.time[np.argmax(run["elbow_flexor.u"] > 0)]
    assert onset == pytest.approx(0.05, abs=1.5e-3)


@pytest.mark.parametrize("arm", [-1.0, 0.04])
def test_force_times_moment_arm_is_the_torque_on_the_joint(elbow, arm):
    spec = joint_spec(elbow)
    tendon = spec.add_tendon(name="t")
    tendon.wrap_joint("elbow", arm)
    mjhill.add_muscle(spec, name="m", muscle=elbow.muscles["elbow_flexor"], tendon="t")
    model = spec.compile()
    data = rest(model)
    with mjhill.installed():
        run = mjhill.record(model, data, duration=0.1, excitation={"m": 0.5})
    assert run.units["m.arm_elbow"] == "m"
    muscles = ("m", "elbow_flexor", "elbow_extensor")
    torque = sum(run[f"{name}.force"][-1] * run[f"{name}.arm_elbow"][-1] for name in muscles)
    assert torque == pytest.approx(data.qfrc_actuator[0], rel=1e-12)
    np.testing.assert_array_equal(run["m.arm_elbow"], -arm)


def test_moment_arms_follow_a_tendon_over_joints_of_every_kind():
    model = mujoco.MjSpec.from_string("""
    <mujoco><option gravity="0 0 -3"/><worldbody><site name="o" pos="0.05 0 0.1"/>
      <body><joint name="slide" type="slide" axis="0 0 1"/><joint name="hinge" axis="0 1 0"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" contype="0"/>
        <body pos="0 0 -0.3"><joint name="ball" type="ball"/><site name="i" pos="0.04 0.01 -0.1"/>
          <geom type="box" size="0.02 0.03 0.1" pos="0 0 -0.1" contype="0"/></body></body>
      <body pos="1 0 0"><freejoint name="free"/><geom size="0.1" contype="0"/></body></worldbody>
      <tendon><spatial name="t"><site site="o"/><site site="i"/></spatial></tendon></mujoco>""")
    mjhill.add_muscle(model, name="m", muscle=STRONG, tendon="t")
    model = model.compile()
    data = mujoco.MjData(model)
    with mjhill.installed():
        run = mjhill.record(model, data, duration=0.05, excitation={"m": 1.0}, every=5)
    names = ["slide", "hinge", "ball0", "ball1", "ball2"]
    arms = {name: unit for name, unit in run.units.items() if ".arm_" in name}
    assert arms == {f"m.arm_{name}": "-" if name == "slide" else "m" for name in names}
    torque = np.array([run[f"m.arm_{name}"][-1] * run["m.force"][-1] for name in names])
    np.testing.assert_allclose(torque, data.qfrc_actuator[:5], rtol=1e-10)
    assert run["m.length_rate"][-1] == data.actuator_velocity[0]
    np.testing.assert_allclose(
        run["m.contractile_length"], run["m.length"] - run["m.stretch"], rtol=0, atol=1e-15
    )


@pytest.mark.parametrize("every", [1, 7])
def test_powers_add_up_and_are_the_rates_of_works_and_energies(pair, every):
    with mjhill.installed():
        run = mjhill.record(
            pair, rest(pair), duration=0.3, every=every, excitation={"elbow_flexor": 0.6}
        )
    steps = np.diff(run.time)
    for name in ("elbow_flexor", "elbow_extensor"):
        for power, work, sign in (
            ("contractile_power", "contractile_work", 1),
            ("series_power", "series_energy", -1),
            ("power", "work", 1),
        ):
            rate = sign * np.diff(run[f"{name}.{work}"]) / steps
            np.testing.assert_allclose(run[f"{name}.{power}"][1:], rate, rtol=1e-9, atol=1e-12)
        parts = run[f"{name}.contractile_power"] + run[f"{name}.series_power"]
        largest = np.abs(parts).max()
        np.testing.assert_allclose(
            run[f"{name}.power"], parts, rtol=0, atol=2e-3 * every**2 * largest
        )


def test_series_stiffness_is_the_slope_of_force_over_stretch(pair):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.2, excitation={"elbow_flexor": 0.6})
    force, stretch = run["elbow_flexor.force"], run["elbow_flexor.stretch"]
    slope = np.diff(force[:80]) / np.diff(stretch[:80])
    stiffness = run["elbow_flexor.series_stiffness"]
    np.testing.assert_allclose(slope, 0.5 * (stiffness[1:80] + stiffness[:79]), rtol=2e-3)


def test_a_muscle_with_the_name_of_its_joint_is_refused(elbow):
    spec = joint_spec(elbow)
    spec.actuator("elbow_flexor").name = "elbow"
    model = spec.compile()
    with mjhill.installed(), pytest.raises(ValueError, match="both would have the series"):
        mjhill.record(model, mujoco.MjData(model), duration=0.01)


def test_an_actuator_without_a_name_and_one_called_like_it_are_refused(elbow):
    spec = joint_spec(elbow)
    spec.actuator("elbow_flexor").name, spec.actuator("elbow_extensor").name = "", "actuator0"
    model = spec.compile()
    with mjhill.installed(), pytest.raises(ValueError, match="'actuator0': another one"):
        mjhill.record(model, mujoco.MjData(model), duration=0.01)


def test_a_recording_has_the_parameters_of_its_muscles(pair, elbow):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.01)
    assert run.muscles == elbow.muscles


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
    message = f"excitation of 'elbow_flexor' at 0.02.* s must be finite, got {bad}"
    with mjhill.installed(), pytest.raises(ValueError, match=message):
        mjhill.record(pair, rest(pair), duration=0.1, excitation={"elbow_flexor": signal})


def test_an_input_of_the_wrong_type_says_what_to_pass(pair):
    with mjhill.installed(), pytest.raises(TypeError, match=r"wrap a function .* mjhill.Signal"):
        mjhill.record(pair, rest(pair), duration=0.1, excitation={"elbow_flexor": "strong"})


def test_a_run_in_which_mujoco_warned_is_a_failed_run(pair):
    with mjhill.installed(), pytest.raises(RuntimeError, match="MuJoCo warned 'badqacc'"):
        mjhill.record(pair, rest(pair), duration=0.1, torque={"elbow": 1e12})


def test_a_start_that_no_muscle_can_be_in_is_refused(pair):
    data = rest(pair)
    data.qvel[0] = 1e12
    with mjhill.installed(), pytest.raises(ValueError, match="'elbow_extensor': it is lengthened"):
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
