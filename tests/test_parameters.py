import dataclasses

import pytest

import mjhill
from mjhill.parameters import quantities


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
    (field,) = (f for f in dataclasses.fields(mjhill.Muscle) if f.name == parameter)
    return field.default


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_time_constants_lie_in_the_ranges_of_equation_12(name):
    for muscle in mjhill.JOINTS[name].muscles.values():
        assert 0.020 <= muscle.excitation_tau <= 0.050
        assert 0.005 <= muscle.activation_tau <= 0.015
        assert 0.020 <= muscle.deactivation_tau <= 0.060
        assert muscle.eccentric_plateau == 1.3
