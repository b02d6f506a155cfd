import dataclasses
import math
import time
import warnings

import mujoco
import pytest
from scipy.optimize import brentq

import mjhill
from mjhill.engine.equilibrium import check_states
from mjhill.engine.spec import joint_spec
from mjhill.engine.stability import Plant


def flexor(spec):
    return next(a for a in spec.actuators if a.name == "elbow_flexor")


def test_a_model_in_order_passes(pair):
    mjhill.check_model(pair)


@pytest.mark.parametrize(
    ("attribute", "value", "message"),
    [
        ("biastype", mujoco.mjtBias.mjBIAS_NONE, "biastype is none, not user"),
        ("gaintype", mujoco.mjtGain.mjGAIN_USER, "gaintype is user, not fixed"),
        ("actdim", 4, "actdim is 4, not 3"),
        ("actlimited", mujoco.mjtLimited.mjLIMITED_TRUE, "actlimited is true, not false"),
    ],
)
def test_half_a_muscle_is_refused_with_what_is_missing(elbow, attribute, value, message):
    spec = joint_spec(elbow)
    setattr(flexor(spec), attribute, value)
    flexor(spec).actrange = [0, 1]
    model = spec.compile()
    with pytest.raises(ValueError, match=f"'elbow_flexor' is half a mjhill muscle.*{message}"):
        mjhill.check_model(model)


def test_a_tag_on_a_native_actuator_is_refused(elbow):
    spec = joint_spec(elbow)
    flexor(spec).dyntype = mujoco.mjtDyn.mjDYN_FILTER
    flexor(spec).actdim = 1
    with pytest.raises(ValueError, match="dyntype is filter, not user"):
        mjhill.check_model(spec.compile())


def test_a_gain_that_would_leak_activation_into_force_is_refused(pair):
    pair.actuator_gainprm[0, 0] = 1.0
    with pytest.raises(ValueError, match=r"gainprm\[0\] is 1.0, not 0.0"):
        mjhill.check_model(pair)


def test_a_parameter_out_of_bounds_in_the_model_is_named_with_its_muscle(pair):
    pair.actuator_dynprm[1, 2] = -0.01
    with pytest.raises(
        ValueError,
        match=r"muscle 'elbow_extensor': activation_tau must be in \[1e-06, 1\] s, got -0.01",
    ):
        mjhill.check_model(pair)


def test_passive_elasticity_out_of_bounds_is_named_with_its_joint(pair):
    pair.jnt_user[0, 2] = float("nan")
    with pytest.raises(ValueError, match="joint 'elbow': k2_pos must be in .*, got nan"):
        mjhill.check_model(pair)


@pytest.mark.parametrize("timestep", [0.0, -1e-3, float("nan")])
def test_a_timestep_that_is_not_positive_is_refused(pair, timestep):
    pair.opt.timestep = timestep
    with pytest.raises(ValueError, match="timestep must be positive"):
        mjhill.check_model(pair)


def test_a_timestep_past_the_stability_of_the_series_element_warns(pair):
    pair.opt.timestep = 0.05
    with pytest.warns(RuntimeWarning, match="joint 'elbow': with its muscles .* forces ring"):
        mjhill.check_model(pair)


def test_user_actuators_of_others_are_not_looked_at(pair):
    pair.actuator_dynprm[:, 0] = 7.0
    pair.actuator_dynprm[:, 1] = -1.0
    mjhill.check_model(pair)


def test_a_coarse_timestep_is_a_finding_with_the_timestep_that_would_do(pair):
    assert mjhill.check_model(pair) == ()
    pair.opt.timestep = 1e-2
    [finding] = mjhill.check_model(pair)
    assert not finding.severe
    assert "joint 'elbow': with its muscles at full force ('elbow_flexor'" in str(finding)
    assert "may be off by 5 %" in str(finding)
    pair.opt.timestep = finding.timestep
    assert mjhill.check_model(pair) == ()


def test_rk4_warns_of_a_time_constant_that_it_cannot_follow(elbow, muscle):
    quick = dataclasses.replace(muscle, excitation_tau=1.5e-3)
    model = joint_spec(
        dataclasses.replace(elbow, muscles={**elbow.muscles, "elbow_flexor": quick})
    ).compile()
    model.opt.timestep = 5e-3
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    [finding] = [f for f in mjhill.check_model(model) if "tau" in f.problem]
    assert str(finding).startswith("muscle 'elbow_flexor': timestep over excitation_tau is 3.33")
    assert finding.timestep == pytest.approx(1.5e-3)


def light(elbow, share):
    """The elbow with a share of its inertia and no elasticity: its series elements are springs."""
    made = dataclasses.replace(elbow, inertia=share * elbow.inertia, stiffness=0.0)
    model = joint_spec(made).compile()
    model.jnt_user[:] = 0.0
    return model


def test_what_a_timestep_can_hold_is_where_a_muscle_at_full_force_turns_unstable(elbow):
    # at L_opt and u = 1 the muscles stay where they are: the joint does not move but by itself
    model = light(elbow, 1e-3)
    muscles = mjhill.engine.layout.read_muscles(model)
    force = min(muscle.max_isometric_force for muscle in muscles.values())
    for name, muscle in muscles.items():
        equal = dataclasses.replace(muscle, max_isometric_force=force, optimal_length=0.0)
        mjhill.write_muscle(model, name, equal)
    [plant] = Plant.parts(model)
    stable = brentq(lambda h: plant.load(h) - 1.0, 1e-6, 0.1)
    spans = []
    with mjhill.installed():
        for timestep in (0.97 * stable, 1.03 * stable):
            model.opt.timestep = timestep
            data = mujoco.MjData(model)
            data.ctrl[:] = 1.0
            mjhill.equilibrate(model, data)
            data.qvel[0] = 1e-6
            mujoco.mj_step(model, data, nstep=1000)
            spans.append(abs(data.qvel[0]))
    assert spans[0] < 1e-8
    assert spans[1] > 1e-4


def test_without_yielding_the_limit_is_that_of_an_oscillator(elbow):
    model = light(elbow, 1.0)
    model.dof_damping[:] = 0.0
    muscles = mjhill.engine.layout.read_muscles(model)
    model.actuator_biasprm[:, 0] = 1e-9  # V_max, slower than any muscle that is allowed
    [plant] = Plant.parts(model)
    stiffness = sum(
        m.max_isometric_force * m.series_shape / m.series_stretch / (1 - math.exp(-m.series_shape))
        for m in muscles.values()
    )
    frequency = math.sqrt(stiffness / elbow.inertia)
    assert plant.load(1e-3) == pytest.approx((frequency * 1e-3) ** 2 / 4, rel=1e-6)


def arms(count, gear=1.0):
    """Many elbows side by side in one model."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = 1e-3
    muscle = mjhill.JOINTS["elbow"].muscles["elbow_flexor"]
    for k in range(count):
        body = spec.worldbody.add_body(mass=1, inertia=[0.06] * 3, explicitinertial=True)
        body.add_joint(name=f"joint{k}", type=mujoco.mjtJoint.mjJNT_HINGE, damping=[0.5])
        for name, sign in ((f"flexor{k}", -gear), (f"extensor{k}", gear)):
            mjhill.add_muscle(spec, name=name, muscle=muscle, joint=f"joint{k}", gear=sign)
    return spec


def test_a_large_model_taken_in_parts_gives_the_loads_of_a_small_one(monkeypatch):
    model = arms(4).compile()
    model.body_inertia[:, 1] = model.body_inertia[:, 2] = model.body_inertia[:, 0] = 1.0
    [whole] = Plant.parts(model)
    monkeypatch.setattr("mjhill.engine.stability._LARGE", 2)
    parts = Plant.parts(model)
    assert len(parts) == 4
    assert [part.muscles for part in parts] == [(0, 1), (2, 3), (4, 5), (6, 7)]
    assert max(part.load(1e-3) for part in parts) == pytest.approx(whole.load(1e-3), rel=1e-9)


def test_joints_that_a_constraint_holds_together_have_their_inertia_together():
    spec = arms(2)
    spec.bodies[2].inertia = [6e-5] * 3
    alone = Plant.parts(spec.compile())[0].load(1e-3)
    constraint = spec.add_equality(name1="joint0", name2="joint1")
    constraint.type = mujoco.mjtEq.mjEQ_JOINT
    constraint.data[:5] = [0, 1, 0, 0, 0]
    [together] = Plant.parts(spec.compile())
    assert len(together.mass) == 1
    # twice the stiffness on a thousand times the inertia, and viscosity holds some of it
    assert together.load(1e-3) < alone / 50


def test_rk4_sees_damping_where_a_constraint_allows_no_movement():
    spec = arms(1)
    constraint = spec.add_equality(name1="joint0")
    constraint.type = mujoco.mjtEq.mjEQ_JOINT
    other = spec.worldbody.add_body(mass=1, inertia=[0.06] * 3, explicitinertial=True)
    other.add_joint(name="other", type=mujoco.mjtJoint.mjJNT_HINGE)
    spec.bodies[1].joints[0].damping = [200, 0, 0]
    model = spec.compile()
    assert mjhill.check_model(model) == ()
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    found(model, "joint 'joint0': damping is 1.2 of what a timestep of 0.001 s can hold")


def test_the_cost_of_the_checks_grows_with_the_muscles_not_with_their_square():
    def time_of(function, model, data):
        spent = []
        for _ in range(5):
            start = time.process_time()
            function(model, data)
            spent.append(time.process_time() - start)
        return min(spent)

    few, many = (spec.compile() for spec in (arms(100), arms(800)))
    for check in (
        lambda model, data: mjhill.check_model(model),
        mjhill.equilibrate,
        check_states,
    ):
        ratio = time_of(check, many, mujoco.MjData(many)) / time_of(check, few, mujoco.MjData(few))
        assert ratio < 8**1.5  # eight times the muscles; a square would give 64


def test_a_muscle_that_pushes_its_tendon_is_found():
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><site name="a"/><body pos="0 0 1"><joint type="slide" axis="0 0 1"/>
        <geom size="0.1"/><site name="b"/></body></worldbody>
        <tendon><spatial name="t"><site site="a"/><site site="b"/></spatial></tendon></mujoco>"""
    )
    mjhill.add_muscle(
        spec, name="m", muscle=mjhill.JOINTS["elbow"].muscles["elbow_flexor"], tendon="t", gear=-1
    )
    with pytest.warns(RuntimeWarning, match="'m': its gear on the tendon is -1, so it pushes"):
        mjhill.check_model(spec.compile())


@pytest.mark.parametrize("gear", [0.0, math.nan, math.inf])
def test_a_muscle_without_a_gear_is_refused(pair, gear):
    pair.actuator_gear[0] = [gear, 0, 0, 0, 0, 0]
    with pytest.raises(ValueError, match="'elbow_flexor': gear must be finite and not 0"):
        mjhill.check_model(pair)


def found(model, match):
    with pytest.warns(RuntimeWarning, match=match):
        mjhill.check_model(model)


def test_limits_of_force_that_cut_a_muscle_off_are_found(elbow):
    spec = joint_spec(elbow)
    flexor(spec).forcerange = [-1, 0]
    flexor(spec).forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    found(spec.compile(), "'elbow_flexor': its forcerange, -1 to 0, cuts off forces")
    spec = joint_spec(elbow)
    spec.joint("elbow").actfrcrange = [-1, 1]
    spec.joint("elbow").actfrclimited = mujoco.mjtLimited.mjLIMITED_TRUE
    found(spec.compile(), "joint 'elbow': its actuatorfrcrange, -1 to 1, cuts off")


def test_a_muscle_that_is_switched_off_is_found(pair):
    pair.actuator_group[1] = 3
    pair.opt.disableactuator = 1 << 3
    found(pair, "'elbow_extensor': its group 3 is disabled")
    pair.opt.disableactuator = 0
    pair.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    found(pair, "actuation is disabled")


def test_elasticity_with_a_number_missing_is_refused():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="j" user="198702 0.04 4.2 0.4 3.2"/>
        <geom size="0.1"/></body></worldbody></mujoco>"""
    )
    with pytest.raises(ValueError, match="'j': the user data .* has 6 numbers, .* keeps 5"):
        mjhill.check_model(model)


def attached(*prefixes):
    whole = mujoco.MjSpec()
    whole.copy_during_attach = True
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # MuJoCo's own, on the options that it drops
        for prefix in prefixes:
            part = mujoco.MjSpec.from_file(str(mjhill.model_path("elbow")))
            whole.attach(part, prefix=prefix, frame=whole.worldbody.add_frame())
        return whole.compile()


def test_attached_models_that_lose_their_options_are_noted():
    model = attached("left_", "right_")
    notes = mjhill.check_model(model)
    assert [note.subject for note in notes] == ["attached model 'left_'", "attached model 'right_'"]
    assert "gravity 0 0 0 m/s², a timestep of 0.001 s, integrator implicitfast" in notes[0].problem
    assert "gravity 0 0 -9.81 m/s², a timestep of 0.002 s, integrator euler" in notes[0].problem
    assert not notes[0].severe
    model.opt.gravity[:] = 0
    model.opt.timestep = 1e-3
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert mjhill.check_model(model) == ()


def test_attached_models_start_each_at_its_own_home():
    home = mjhill.JOINTS["elbow"].home_angle
    data = mjhill.at_home(attached("left_", "right_"))
    assert data.qpos.tolist() == [home, home]


@pytest.mark.parametrize("joint", mjhill.JOINTS)
def test_a_shipped_model_says_what_options_it_is_made_for(joint):
    model = mjhill.load(joint)
    made = model.numeric("mjhill_made_for").data.tolist()
    opt = model.opt
    assert made == [*opt.gravity.tolist(), opt.timestep, opt.integrator]


@pytest.mark.parametrize(
    ("index", "value"),
    [(0, 1e10), (0, -1e300), (1, -0.5), (0, math.nan), (2, -1e10), (2, math.inf)],
)
def test_states_that_no_muscle_has_are_refused_with_its_name(pair, index, value):
    data = mujoco.MjData(pair)
    mjhill.equilibrate(pair, data)
    check_states(pair, data)
    data.act[3 + index] = value
    with pytest.raises(ValueError, match=r"muscle 'elbow_extensor': its .*; call mjhill.equil"):
        check_states(pair, data)
