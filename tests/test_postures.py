"""Postures that muscles hold together."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import mjhill
from mjhill.lab.batch import joint_angles
from mjhill.lab.postures import (
    balancing_excitations,
    check_ascending,
    held_cocontractions,
    stable_excitations,
    stablest_angle,
    static_stiffness,
    tonic_excitations,
)
from mjhill.lab.rig import UnmeasuredError, net_torque


def symmetric(optimum):
    """The eye with two equal muscles."""
    eye = mjhill.JOINTS["eye"]
    one = replace(
        eye.muscles["lateral_rectus"], optimal_length=optimum, width_short=0.6, width_long=0.6
    )
    return replace(eye, muscles=dict.fromkeys(eye.muscles, one))


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
@pytest.mark.parametrize("level", [0.02, 0.5, 1.0])
def test_balanced_inputs_leave_no_torque_and_one_muscle_at_the_level(name, level):
    joint = mjhill.JOINTS[name]
    inputs = balancing_excitations(joint, level, joint.home_angle)
    weakest = min(muscle.max_isometric_force for muscle in joint.muscles.values())
    assert abs(net_torque(joint, inputs, joint.home_angle)) < 1e-9 * weakest
    assert max(inputs.values()) == level
    assert min(inputs.values()) > 0


def test_equal_muscles_get_equal_inputs_in_the_middle():
    assert set(balancing_excitations(symmetric(0.2), 0.3, 0.0).values()) == {0.3}


def test_a_level_too_low_for_the_passive_torque_is_not_held():
    elbow = mjhill.JOINTS["elbow"]
    with pytest.raises(
        UnmeasuredError, match="an excitation of 0.02 is too low to hold elbow at 28"
    ):
        balancing_excitations(elbow, 0.02, 0.5)


def test_a_balanced_joint_stays_and_an_unstable_one_drifts():
    """The verdict of the static stiffness against a run of a joint let go 0.1° off."""
    elbow, nudge = mjhill.JOINTS["elbow"], np.radians(0.1)
    for angle in (elbow.home_angle, 1.9):
        inputs = balancing_excitations(elbow, 0.5, angle)
        found = joint_angles(
            [elbow], start=angle + nudge, before=[*inputs.values()],
            excitation=[*inputs.values()], steps=4000,
        )  # fmt: skip
        way = found[0] - angle
        returns = static_stiffness(elbow, inputs, angle) > 0
        assert returns == (angle == 1.9)
        assert (way[-1] < nudge) == returns


def test_muscles_past_their_optimum_make_cocontraction_unstable_and_a_spring_steadies_it():
    joint = symmetric(-0.3)
    condition = partial(balancing_excitations, joint, 0.5)
    drift = static_stiffness(joint, condition(0.0), 0.0)
    assert drift < 0
    with pytest.raises(
        UnmeasuredError,
        match="eye drifts away from 0°: .* static stiffness with these excitations is -",
    ):
        stable_excitations(joint, condition, 0.0)
    assert stable_excitations(joint, condition, 0.0, support=-1.01 * drift) == condition(0.0)


def test_the_home_angle_is_the_posture_where_the_joint_stays_there():
    eye, elbow = mjhill.JOINTS["eye"], mjhill.JOINTS["elbow"]
    assert stablest_angle(eye, [partial(balancing_excitations, eye, 0.5)]) == eye.home_angle
    levels = [partial(balancing_excitations, elbow, level) for level in (0.02, 0.2, 0.5)]
    angle = stablest_angle(elbow, levels)
    assert angle != elbow.home_angle
    assert all(static_stiffness(elbow, level(angle), angle) > 0 for level in levels)


def test_levels_that_are_not_held_come_with_their_reason():
    wrist = mjhill.JOINTS["wrist"]
    held, unheld = held_cocontractions(wrist, (0.02, 0.5), wrist.home_angle)
    assert list(held) == [0.02]
    assert [one.label for one in unheld] == ["co-contraction 0.5"]
    assert "drifts away" in unheld[0].reason
    with pytest.raises(UnmeasuredError, match="drifts away"):
        held_cocontractions(wrist, (0.5,), wrist.home_angle)


@pytest.mark.parametrize("angle", [0.1, 2.2])
def test_one_muscle_holds_a_joint_and_too_far_none_does(angle):
    elbow = mjhill.JOINTS["elbow"]
    inputs = tonic_excitations(elbow, "elbow_flexor", angle)
    assert abs(net_torque(elbow, inputs, angle)) < 1e-9
    assert sum(level > 0 for level in inputs.values()) == 1
    weak = {
        name: replace(muscle, max_isometric_force=1e-6) for name, muscle in elbow.muscles.items()
    }
    with pytest.raises(UnmeasuredError, match=r"full excitation of .* does not hold elbow at .*°"):
        tonic_excitations(replace(elbow, muscles=weak), "elbow_flexor", angle)


@pytest.mark.parametrize("values", [(), (0.1,), (0.2, 0.1), (0.1, 0.1), (0.0, 0.1), (0.5, 1.1)])
def test_levels_that_do_not_ascend_within_their_bounds_are_refused(values):
    with pytest.raises(ValueError, match=r"levels must be 2 or more ascending numbers in \(0, 1\]"):
        check_ascending("levels", values, 0.0, 1.0)
