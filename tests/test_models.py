import mujoco
import numpy as np
import pytest

import mjhill
from mjhill.engine.mjcf import parameters_xml
from mjhill.simulate.reference import rest_state


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_a_model_carries_the_parameters_of_its_joint(name):
    model, joint = mjhill.load(name), mjhill.JOINTS[name]
    assert mjhill.muscle_names(model) == list(joint.muscles)
    for muscle, parameters in joint.muscles.items():
        assert mjhill.read_muscle(model, muscle) == parameters
        assert model.actuator(muscle).gear[0] == joint.gears[muscle]
    assert mjhill.read_passive(model, name) == joint.passive
    hinge = model.joint(name)
    assert model.dof_damping[hinge.dofadr[0]] == joint.damping
    assert model.jnt_stiffness[hinge.id] == joint.stiffness
    assert model.qpos_spring[hinge.qposadr[0]] == pytest.approx(joint.rest_angle)
    assert not model.jnt_limited[hinge.id]


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_the_parameters_of_a_model_are_made_from_the_parameter_file(name):
    committed = mjhill.model_path(name).with_name("parameters.xml").read_text(encoding="utf-8")
    assert committed == parameters_xml(mjhill.JOINTS[name]), "run `make models`"


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_a_model_has_the_inertia_of_its_joint_in_every_pose(name):
    model, joint = mjhill.load(name), mjhill.JOINTS[name]
    data = mujoco.MjData(model)
    for angle in np.linspace(*joint.range, 5):
        data.joint(name).qpos = angle
        mujoco.mj_fwdPosition(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        assert full[0, 0] == pytest.approx(joint.inertia, rel=1e-6)


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_the_home_key_is_the_rest_state_at_the_home_angle(name):
    model, joint = mjhill.load(name), mjhill.JOINTS[name]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    state = rest_state(joint)
    np.testing.assert_allclose([*data.qpos, *data.qvel, *data.act], state, atol=1e-6)


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_a_model_loads_in_stock_mujoco(name):
    model = mujoco.MjModel.from_xml_path(str(mjhill.model_path(name)))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=10)
    assert np.all(np.isfinite(data.qpos))
    assert not data.actuator_force.any()


def test_a_binary_model_loads_too(tmp_path):
    path = tmp_path / "elbow.mjb"
    mujoco.mj_saveModel(mjhill.load("elbow"), str(path), None)
    assert mjhill.muscle_names(mjhill.load(path)) == ["elbow_flexor", "elbow_extensor"]


def test_an_unknown_model_lists_the_joints():
    with pytest.raises(ValueError, match="unknown model 'wing': no file .* joints are: elbow"):
        mjhill.load("wing")
    with pytest.raises(ValueError, match="unknown joint 'wing'; there are: elbow"):
        mjhill.model_path("wing")


def test_a_loaded_model_is_checked(tmp_path):
    path = tmp_path / "bad.xml"
    path.write_text("""<mujoco><worldbody><body><joint name="j"/><geom size="1"/></body></worldbody>
    <actuator><general name="m" joint="j" dyntype="user" actdim="3" biastype="user"
      dynprm="198701 0.03 -1" lengthrange="-1 1"/></actuator></mujoco>""")
    with pytest.raises(ValueError, match="'m' is half a mjhill muscle"):
        mjhill.load(path)
