import dataclasses

import mujoco
import pytest
from conftest import PLAIN_XML

import mjhill
from mjhill.comparison.native import native_spec
from mjhill.engine.spec import joint_spec
from mjhill.quantity import quantities


def test_a_muscle_is_read_back_as_it_was_added(pair, elbow):
    for name, muscle in elbow.muscles.items():
        assert mjhill.read_muscle(pair, name) == muscle


def test_a_written_muscle_is_read_back_whole(pair, muscle):
    values = {name: 0.0123 * k for k, name in enumerate(mjhill.muscle_model("hill").slots, 2)}
    values |= {"electrical_stimulation": True, "eccentric_plateau": 1.4, "series_limit": 3.0}
    changed = dataclasses.replace(muscle, **values)
    mjhill.write_muscle(pair, "elbow_extensor", changed)
    assert mjhill.read_muscle(pair, "elbow_extensor") == changed
    assert mjhill.read_muscle(pair, "elbow_flexor") == muscle


def test_passive_elasticity_is_read_back_as_it_was_written(pair, elbow):
    assert mjhill.read_passive(pair, "elbow") == elbow.passive
    changed = dataclasses.replace(elbow.passive, k2_neg=9.0)
    mjhill.write_passive(pair, "elbow", changed)
    assert mjhill.read_passive(pair, "elbow") == changed


@pytest.mark.parametrize("model", mjhill.MODELS, ids=lambda model: model.name)
def test_no_two_parameters_share_a_slot_and_the_gain_stays_silent(model):
    slots = list(model.slots.values())
    assert len(set(slots)) == len(slots)
    assert ("gainprm", 0) not in slots
    assert ("dynprm", 0) not in slots
    assert {name for name, _ in quantities(model.parameters)} <= set(model.slots)


def test_files_made_before_are_read_as_they_were():
    slots = mjhill.muscle_model("hill").slots
    assert [name for name, (array, _) in slots.items() if array == "dynprm"] == [
        "excitation_tau", "activation_tau", "deactivation_tau", "electrical_stimulation",
        "activation_floor",
    ]  # fmt: skip
    assert slots["max_isometric_force"] == ("gainprm", 1)
    assert slots["series_limit"] == ("gainprm", 7)
    assert slots["max_velocity"] == ("biasprm", 0)
    assert slots["velocity_activation"] == ("biasprm", 5)


def test_an_unknown_muscle_lists_those_there_are(pair):
    with pytest.raises(ValueError, match="unknown muscle 'biceps'.*: elbow_flexor, elbow_extensor"):
        mjhill.read_muscle(pair, "biceps")


def test_a_joint_without_passive_elasticity_says_how_to_give_it_one():
    model = mujoco.MjModel.from_xml_string(PLAIN_XML)
    with pytest.raises(ValueError, match="joint 'elbow' has no mjhill passive elasticity"):
        mjhill.read_passive(model, "elbow")
    with pytest.raises(ValueError, match="unknown joint 'knee'; the model's joints are: elbow"):
        mjhill.read_passive(model, "knee")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "give joint=... or tendon=..., one of the two"),
        ({"joint": "elbow", "tendon": "t"}, "one of the two"),
        ({"joint": "knee"}, "unknown joint 'knee'; there are: elbow"),
        ({"tendon": "t"}, "unknown tendon 't'; there are: none"),
        ({"joint": "elbow", "gear": 0.0}, "gear must not be 0"),
    ],
)
def test_a_muscle_that_cannot_be_added_says_why(muscle, arguments, message):
    spec = mujoco.MjSpec.from_string(PLAIN_XML)
    with pytest.raises(ValueError, match=message):
        mjhill.add_muscle(spec, name="m", muscle=muscle, **arguments)


def test_a_second_muscle_of_the_same_name_is_refused(muscle):
    spec = mujoco.MjSpec.from_string(PLAIN_XML)
    mjhill.add_muscle(spec, name="m", muscle=muscle, joint="elbow")
    with pytest.raises(ValueError, match="muscle 'm': the model has an actuator of that name"):
        mjhill.add_muscle(spec, name="m", muscle=muscle, joint="elbow")


def test_passive_elasticity_needs_a_scalar_joint(elbow):
    spec = mujoco.MjSpec.from_string(PLAIN_XML.replace('name="elbow"', 'name="elbow" type="ball"'))
    with pytest.raises(ValueError, match="needs a hinge or slide joint"):
        mjhill.add_passive(spec, joint="elbow", passive=elbow.passive)


def test_muscles_without_names_are_numbered(elbow):
    spec = joint_spec(elbow)
    for actuator in spec.actuators:
        actuator.name = ""
    model = spec.compile()
    mjhill.check_model(model)
    assert mjhill.muscle_names(model) == ["actuator0", "actuator1"]
    assert mjhill.read_muscle(model, "actuator0") == elbow.muscles["elbow_flexor"]
    with mjhill.installed():
        run = mjhill.record(
            model, mjhill.at_home(model), duration=0.2, excitation={"actuator0": 0.5}
        )
    assert run["actuator0.force"][-1] > 1.0
    assert native_spec(spec).compile().na == 2


def test_a_passive_joint_without_a_name_is_numbered(elbow):
    spec = mujoco.MjSpec.from_string(PLAIN_XML)
    mjhill.add_passive(spec, joint="elbow", passive=elbow.passive)
    spec.joints[0].name = ""
    model = spec.compile()
    mjhill.check_model(model)
    assert mjhill.read_passive(model, "joint0") == elbow.passive
    with mjhill.installed():
        run = mjhill.record(model, mujoco.MjData(model), duration=0.05)
    assert "joint0.angle" in run.series
