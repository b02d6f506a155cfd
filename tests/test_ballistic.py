"""Fast movements of a joint made here, whose truths do not depend on the parameter file."""

from dataclasses import replace
from math import radians

import made_joint
import numpy as np
import pytest
from made_joint import MUSCLE

import mjhill
from mjhill.lab.ballistic import (
    FALL_BACK,
    ballistic_movements,
    free_velocities,
    isokinetic_velocities,
)
from mjhill.lab.postures import tonic_excitations
from mjhill.lab.rig import UnmeasuredError, at_rest, build_rig, record_run

NO_ELASTICITY = mjhill.Passive(k1_pos=0.0, k2_pos=1.0, k1_neg=0.0, k2_neg=1.0)
NEAR = 1e-3  # of an amplitude, what a search must reach


def make_joint(muscle: mjhill.Hill = MUSCLE, **changes) -> mjhill.Joint:
    return made_joint.make_joint(muscle, **{"passive": NO_ELASTICITY, **changes})


def movement_of(joint, degrees, braked, muscle="puller"):
    return ballistic_movements(
        [joint], muscle, amplitude=radians(degrees), duration=0.5, braked=braked
    )


# --- where movements begin and end


@pytest.mark.parametrize("angle", [-0.5, 0.0, 0.5])
def test_a_joint_stays_where_it_is_held(angle):
    joint = make_joint()
    rig, held = build_rig(joint), tonic_excitations(joint, "puller", angle)
    found = record_run(rig, at_rest(rig, angle, held), 0.5, excitation=held)["joint.angle"]
    assert found[-1] == pytest.approx(angle, abs=1e-6)


def test_a_joint_too_stiff_for_its_muscle_is_not_held():
    with pytest.raises(UnmeasuredError, match="full excitation of puller does not hold joint"):
        tonic_excitations(make_joint(stiffness=100.0), "puller", 0.5)


# --- ballistic movements


@pytest.mark.parametrize("braked", [False, True])
def test_a_movement_goes_its_amplitude_and_no_farther(braked):
    joint = make_joint(damping=0.3)  # well damped, so that it needs no brake
    for degrees in (20, 40):
        (progress,) = movement_of(joint, degrees, braked).progress
        assert progress.max() == pytest.approx(1.0, abs=NEAR)
        assert progress[-1] == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("damping", [0.1, 0.3])
def test_a_braked_movement_comes_back_by_five_percent_at_most(damping):
    for degrees in (20, 60):
        found = movement_of(make_joint(damping=damping), degrees, True)
        (progress,) = found.progress
        after = progress[progress.argmax() :]
        assert found.pulses.kind == "braked"
        # the widest pulse with which it does so, so it comes back by just that
        assert after.min() == pytest.approx(1.0 - FALL_BACK, abs=2 * NEAR)


@pytest.mark.parametrize("braked", [False, True])
def test_peak_velocity_and_duration_rise_with_the_amplitude_of_a_movement(braked):
    found = [movement_of(make_joint(damping=0.3), degrees, braked) for degrees in (5, 20, 60)]
    assert (np.diff([one.peak_velocity[0] for one in found]) > 0).all()
    assert (np.diff([one.duration(radians(30.0))[0] for one in found]) > 0).all()


def test_a_brake_makes_a_movement_faster_and_its_pulse_wider():
    joint = make_joint(damping=0.3)
    free, braked = movement_of(joint, 40, False), movement_of(joint, 40, True)
    assert free.pulses.brake[0] == 0 < braked.pulses.brake[0]
    assert braked.pulses.agonist[0] > free.pulses.agonist[0]
    assert braked.peak_velocity[0] > free.peak_velocity[0]


def test_movements_of_mirrored_muscles_are_mirrored():
    joint = make_joint(damping=0.3)
    there, back = (movement_of(joint, 30, True, name) for name in joint.muscles)
    assert back.pulses.agonist == pytest.approx(there.pulses.agonist, rel=1e-4)
    # the search ends near the amplitude, and sums torques in another order
    np.testing.assert_allclose(back.progress, there.progress, atol=1e-4)


def test_joints_move_together_as_each_does_alone():
    joints = [make_joint(damping=damping) for damping in (0.2, 0.22)]
    both = ballistic_movements(joints, "puller", amplitude=0.5, duration=0.5, braked=True)
    for k, joint in enumerate(joints):
        alone = ballistic_movements([joint], "puller", amplitude=0.5, duration=0.5, braked=True)
        assert both.peak_velocity[k] == pytest.approx(alone.peak_velocity[0], rel=1e-4)
        np.testing.assert_allclose(both.progress[k], alone.progress[0], atol=1e-4)


def test_a_movement_starts_where_another_needed_almost_the_same_pulses():
    first = movement_of(make_joint(damping=0.2), 30, True)
    joint = make_joint(damping=0.21)
    told = ballistic_movements(
        [joint], "puller", amplitude=radians(30), duration=0.5, guess=first.pulses
    )
    assert told.pulses.kind == "braked"
    searched = movement_of(joint, 30, True)
    assert told.peak_velocity[0] == pytest.approx(searched.peak_velocity[0], rel=1e-4)


def test_a_movement_that_swings_past_without_a_pulse_needs_a_brake():
    joint = make_joint(damping=0.01)
    with pytest.raises(UnmeasuredError, match="even without a pulse"):
        movement_of(joint, 60, False)
    braked = movement_of(joint, 60, True)
    assert braked.progress.max() == pytest.approx(1.0, abs=NEAR)


def test_a_turn_wider_than_the_range_or_too_far_for_its_time_is_not_measured():
    with pytest.raises(UnmeasuredError, match="150° is wider than the range of joint, 137.5"):
        movement_of(make_joint(), 150, False)
    with pytest.raises(UnmeasuredError, match="does not move it by 60° in 0.02 s"):
        ballistic_movements([make_joint()], "puller", amplitude=radians(60), duration=0.02)


def test_a_muscle_too_weak_for_a_movement_is_told_apart_from_one_that_is_not():
    knee = mjhill.JOINTS["knee"]
    weak = replace(knee.muscles["knee_extensor"], max_isometric_force=2.0)
    weakened = replace(knee, muscles={**knee.muscles, "knee_extensor": weak})

    def extend(joint):
        return ballistic_movements(
            [joint], "knee_extensor", amplitude=radians(60), duration=0.8, braked=True
        )

    assert extend(knee).peak_velocity[0] > 1.0
    with pytest.raises(UnmeasuredError, match="full excitation of knee_extensor does not hold kn"):
        extend(weakened)


def test_a_velocity_that_is_never_passed_has_no_duration():
    found = movement_of(make_joint(damping=0.3), 5, True)
    with pytest.raises(UnmeasuredError, match="does not pass 100 rad/s and fall again"):
        found.duration(100.0)


# --- free and isokinetic velocities


def test_no_muscle_turns_a_free_joint_faster_than_it_can_shorten():
    # nothing else pushes them
    joints = [make_joint(inertia=inertia, stiffness=0.0) for inertia in (0.0005, 0.01, 0.1)]
    found = free_velocities(joints, "puller")
    assert (found > 0).all()
    assert (found < MUSCLE.max_velocity).all()


def test_a_light_joint_comes_near_the_largest_velocity_of_its_muscle():
    even = replace(MUSCLE, width_short=20.0, width_long=20.0)  # as strong at any length
    joint = make_joint(even, inertia=1e-3, damping=0.0, stiffness=0.0, range=(-3.0, 1.0))
    assert free_velocities([joint], "puller")[0] > 0.9 * MUSCLE.max_velocity


def test_past_the_end_of_the_range_velocity_does_not_count():
    wide, narrow = (
        free_velocities([make_joint(stiffness=0.0, range=(-1.2, end))], "puller")[0]
        for end in (1.2, 0.1)
    )
    assert 0 < narrow < 0.9 * wide


def test_a_relaxed_joint_at_rest_does_not_move_and_a_bent_one_springs_back():
    joint = make_joint(stiffness=5.0)
    still = free_velocities([joint], "puller", excitation=0.0)[0]
    recoil = free_velocities([joint], "puller", angle=-1.0, excitation=0.0)[0]
    assert still == pytest.approx(0.0, abs=1e-6)
    assert recoil > 1.0


def test_a_velocity_at_a_share_of_the_torque_is_that_of_hills_relation():
    shape = MUSCLE.hill_shape
    for share in (0.25, 0.5, 0.75):
        (found,) = isokinetic_velocities([make_joint()], "puller", share=share)
        hill = MUSCLE.max_velocity * (1 - share) / (1 + share / shape)
        assert found == pytest.approx(hill, rel=0.01)  # mjhill adds a little viscosity
    geared = make_joint(gears={"puller": -2.0, "opponent": 2.0})
    assert isokinetic_velocities([geared], "puller", share=0.25)[0] == pytest.approx(
        0.5 * isokinetic_velocities([make_joint()], "puller", share=0.25)[0]
    )
