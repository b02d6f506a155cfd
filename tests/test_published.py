from dataclasses import replace
from types import MappingProxyType

import pytest

import mjhill
from mjhill.lab.rig import at_rest, build_rig, muscle_torque, record_run
from mjhill.literature.published import (
    EndAngle,
    PassiveTorque,
    end_angles,
    passive_torques,
)
from mjhill.simulate.reference import plant_torque

TORQUES = [item for name in mjhill.JOINTS for item in passive_torques(name)]
ENDS = [item for name in mjhill.JOINTS for item in end_angles(name)]


def at(angle, low=1.0, high=2.0):
    return PassiveTorque("elbow", angle, low, high, "")


def test_every_joint_has_torques_on_both_sides_and_an_end_for_each_muscle():
    for name, joint in mjhill.JOINTS.items():
        angles = [item.angle for item in passive_torques(name)]
        assert min(angles) < joint.rest_angle < max(angles), name
        assert {item.muscle for item in end_angles(name)} == set(joint.muscles)


@pytest.mark.parametrize("item", [*TORQUES, *ENDS], ids=lambda item: item.joint)
def test_every_interval_ascends_and_has_a_source(item):
    assert item.low < item.high
    assert item.source


@pytest.mark.parametrize("item", TORQUES, ids=lambda item: item.joint)
def test_published_torques_restore_a_joint_inside_its_reach(item):
    low, high = mjhill.JOINTS[item.joint].range
    assert item.low > 0
    assert low - 0.5 < item.angle < high + 0.2  # the hip is measured past its range


@pytest.mark.parametrize("item", ENDS, ids=lambda item: item.muscle)
def test_a_muscle_ends_on_its_own_side_near_the_range(item):
    joint = mjhill.JOINTS[item.joint]
    towards_positive = joint.gears[item.muscle] < 0
    middle = 0.5 * (item.low + item.high)
    assert (middle > joint.rest_angle) == towards_positive
    assert middle == pytest.approx(joint.range[towards_positive], abs=0.2)


# --- passive torques of a joint


@pytest.mark.parametrize("side", [-0.8, 0.8])
def test_a_torque_that_restores_is_positive_on_both_sides(elbow, side):
    angle = elbow.rest_angle + side
    measured = at(angle).measured(elbow)
    assert measured > 0
    assert measured == abs(plant_torque(elbow, angle))


def test_deviations_count_from_the_geometric_middle_to_two_at_the_ends(elbow):
    torque = at(elbow.rest_angle + 0.5).measured(elbow)
    angle = elbow.rest_angle + 0.5
    assert at(angle, torque / 2, torque * 2).deviation(elbow) == pytest.approx(0, abs=1e-12)
    assert at(angle, torque, 3 * torque).deviation(elbow) == pytest.approx(-2)
    assert at(angle, torque / 3, torque).deviation(elbow) == pytest.approx(2)


def test_a_joint_without_torque_there_is_refused_by_name(elbow):
    with pytest.raises(ValueError, match="elbow: no passive torque at 73°, where one is published"):
        at(elbow.rest_angle).deviation(elbow)


# --- ends of the active range


def full_effort(joint, muscle):
    """Net torque on a joint held still under the full effort of a muscle, by angle."""
    return lambda angle: (
        plant_torque(joint, angle)
        + sum(muscle_torque(joint, name, float(name == muscle), angle) for name in joint.muscles)
    )


@pytest.mark.parametrize("item", ENDS, ids=lambda item: item.muscle)
def test_the_net_torque_is_zero_at_the_end_and_pushes_back_to_it(item):
    joint = mjhill.JOINTS[item.joint]
    net, end = full_effort(joint, item.muscle), item.measured(joint)
    strength = joint.muscles[item.muscle].max_isometric_force
    assert net(end) == pytest.approx(0, abs=1e-8 * strength)
    assert net(end - 0.02) > 0 > net(end + 0.02)


@pytest.mark.parametrize("muscle", ["elbow_flexor", "elbow_extensor"])
def test_a_run_at_full_effort_ends_there(elbow, muscle):
    joint = replace(elbow, damping=2.0)  # damped well, so that it settles
    bench = build_rig(joint)
    recording = record_run(bench, at_rest(bench, joint.rest_angle), 4.0, excitation={muscle: 1.0})
    end = EndAngle("elbow", muscle, 0.0, 1.0, "").measured(joint)
    assert recording["elbow.angle"][-1] == pytest.approx(end, abs=1e-3)  # of 1.2 rad


def test_deviations_of_an_end_reach_two_at_the_ends_of_its_interval(elbow):
    end = EndAngle("elbow", "elbow_flexor", 0.0, 1.0, "").measured(elbow)
    for low, high, expected in ((end, end + 1, -2), (end - 1, end, 2), (end - 1, end + 1, 0)):
        found = EndAngle("elbow", "elbow_flexor", low, high, "").deviation(elbow)
        assert found == pytest.approx(expected, abs=1e-9)


def test_a_muscle_that_nothing_stops_is_an_error_that_names_it(elbow):
    # no elasticity, and no opponent that would be stretched
    limp = replace(elbow.passive, k1_pos=0.0)
    wide = {
        name: replace(muscle, width_short=100.0, width_long=100.0)
        for name, muscle in elbow.muscles.items()
    }
    joint = replace(elbow, stiffness=0.0, passive=limp, muscles=MappingProxyType(wide))
    with pytest.raises(ValueError, match="elbow: nothing stops elbow_flexor within half a turn"):
        EndAngle("elbow", "elbow_flexor", 0.0, 1.0, "").measured(joint)
