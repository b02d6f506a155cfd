import copy
import dataclasses
import json
import multiprocessing
import operator
import pickle
from types import MappingProxyType

import pytest

import mjhill
from mjhill.joints.system import System
from mjhill.quantity import quantities


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        ("max_isometric_force", 0.0),
        ("activation_tau", -0.01),
        ("excitation_tau", float("nan")),
        ("max_velocity", float("inf")),
        ("series_shape", 0.0),
        ("eccentric_plateau", 1.0),
        ("velocity_activation", 1.5),
        ("activation_floor", 0.0),
        ("width_short", "wide"),
    ],
)
def test_a_parameter_outside_its_bounds_is_named_with_its_value(muscle, parameter, value):
    with pytest.raises(ValueError, match=rf"{parameter} must be .*, got {value!r}"):
        dataclasses.replace(muscle, **{parameter: value})


def test_electrical_stimulation_must_be_a_switch(muscle):
    with pytest.raises(ValueError, match="electrical_stimulation must be False or True, got 0.5"):
        dataclasses.replace(muscle, electrical_stimulation=0.5)


def test_an_unknown_joint_lists_the_known_ones():
    with pytest.raises(KeyError, match="unknown joint 'wing'; there are: elbow"):
        mjhill.JOINTS["wing"]


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_every_number_of_a_joint_has_a_source(name):
    joint = mjhill.JOINTS[name]
    for muscle in joint.muscles.values():
        for parameter, _ in quantities(type(muscle)):
            changed = getattr(muscle, parameter) != _default(parameter)
            assert muscle.sources.get(parameter) or not changed, parameter
    for parameter, _ in quantities(type(joint)):
        assert joint.sources[parameter], parameter
    assert set(joint.passive.sources) >= {"k1_pos", "k2_pos", "k1_neg", "k2_neg"}


def _default(parameter):
    (field,) = (f for f in dataclasses.fields(mjhill.Hill) if f.name == parameter)
    return field.default


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_time_constants_lie_in_the_ranges_of_equation_12(name):
    for muscle in mjhill.JOINTS[name].muscles.values():
        assert 0.020 <= muscle.excitation_tau <= 0.050
        assert 0.005 <= muscle.activation_tau <= 0.015
        assert 0.020 <= muscle.deactivation_tau <= 0.060
        assert muscle.eccentric_plateau == 1.3


def parameter_objects():
    elbow = mjhill.JOINTS["elbow"]
    return {
        "joint": elbow,
        "muscle": elbow.muscles["elbow_flexor"],
        "passive": elbow.passive,
        "system": System.of(elbow),
    }


@pytest.mark.parametrize("kind", ["joint", "muscle", "passive", "system"])
@pytest.mark.parametrize("protocol", [*range(pickle.HIGHEST_PROTOCOL + 1), "copy", "deepcopy"])
def test_a_copy_of_parameters_is_equal_with_equal_hash_and_sources(kind, protocol):
    original = parameter_objects()[kind]
    if isinstance(protocol, int):
        copied = pickle.loads(pickle.dumps(original, protocol))
    else:
        copied = getattr(copy, protocol)(original)
    assert copied == original
    assert hash(copied) == hash(original)
    assert getattr(copied, "sources", None) == getattr(original, "sources", None)
    assert type(copied) is type(original)


@pytest.mark.parametrize("kind", ["joint", "muscle", "passive", "system"])
def test_parameters_as_a_dict_are_plain_and_go_through_json(kind):
    original = parameter_objects()[kind]
    values = dataclasses.asdict(original)
    assert json.loads(json.dumps(values)).keys() == values.keys()
    if kind in ("muscle", "passive"):
        assert type(original)(**values) == original
    if kind == "joint":
        assert values["muscles"]["elbow_flexor"] == dataclasses.asdict(
            original.muscles["elbow_flexor"]
        )


def test_joints_that_are_equal_hash_equal_however_they_were_made(elbow):
    backwards = dict(reversed(elbow.muscles.items()))
    other = dataclasses.replace(
        elbow, muscles=MappingProxyType(backwards), gears=dict(elbow.gears), range=[*elbow.range]
    )
    assert other == elbow
    assert len({other, elbow}) == 1
    assert dataclasses.replace(elbow, inertia=2 * elbow.inertia) not in {elbow}


def test_a_joint_in_another_process_is_the_same(elbow):
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        total = pool.apply(_total_force, (elbow, mjhill.step(0.5, 0.1)))
    assert total == 0.5 * sum(m.max_isometric_force for m in elbow.muscles.values())


def _total_force(joint, signal):
    return signal(0.2) * sum(muscle.max_isometric_force for muscle in joint.muscles.values())


CHANGES = {
    "set": lambda mapping: operator.setitem(mapping, "elbow_flexor", 1.0),
    "delete": lambda mapping: operator.delitem(mapping, "elbow_flexor"),
    "update": lambda mapping: mapping.update(elbow_flexor=1.0),
    "or": lambda mapping: operator.ior(mapping, {"elbow_flexor": 1.0}),
    "pop": lambda mapping: mapping.pop("elbow_flexor"),
    "popitem": lambda mapping: mapping.popitem(),
    "setdefault": lambda mapping: mapping.setdefault("x", 1.0),
    "clear": lambda mapping: mapping.clear(),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize("copied", [lambda joint: joint, copy.copy, copy.deepcopy])
def test_mappings_of_a_joint_cannot_be_changed(elbow, change, copied):
    joint = copied(elbow)
    before = dict(joint.gears)
    for mapping in (joint.gears, joint.muscles, joint.sources, joint.postures):
        with pytest.raises(TypeError, match="this mapping cannot be changed; make a new one"):
            change(mapping)
    assert joint.gears == before


def test_a_joint_keeps_its_own_copy_of_the_mappings_it_is_given(elbow):
    gears = dict(elbow.gears)
    joint = dataclasses.replace(elbow, gears=gears)
    gears["elbow_flexor"] = 7.0
    assert joint.gears == elbow.gears
