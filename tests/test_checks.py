import dataclasses
import math

import mujoco
import pytest

import mjhill
from mjhill.checks import natural_frequencies
from mjhill.spec import joint_spec


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
    with pytest.warns(
        RuntimeWarning, match="joint 'elbow' with its muscles at full .* meaningless"
    ):
        mjhill.check_model(pair)


def test_user_actuators_of_others_are_not_looked_at(pair):
    pair.actuator_dynprm[:, 0] = 7.0
    pair.actuator_dynprm[:, 1] = -1.0
    mjhill.check_model(pair)


def test_a_coarse_timestep_is_a_finding_with_the_timestep_that_would_do(pair):
    assert mjhill.check_model(pair) == ()
    pair.opt.timestep = 5e-3
    [finding] = mjhill.check_model(pair)
    assert not finding.severe
    assert "joint 'elbow' with its muscles at full force" in str(finding)
    assert "may be off by 5 %" in str(finding)
    pair.opt.timestep = 0.999 * finding.timestep
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
    assert finding.timestep == pytest.approx(3e-3)


def test_the_natural_frequency_is_that_of_the_series_elements_on_the_inertia(pair):
    muscles = mjhill.layout.read_muscles(pair)
    for joint in range(pair.njnt):
        pair.jnt_user[joint] = 0.0  # no exponential elasticity
    [(joint, frequency)] = natural_frequencies(pair)
    stiffness = sum(
        m.max_isometric_force * m.series_shape / m.series_stretch / (1 - math.exp(-m.series_shape))
        for m in muscles.values()
    )
    assert joint == "elbow"
    assert frequency == pytest.approx(math.sqrt(stiffness / pair.body_inertia[1, 1]))
