"""The facts are measured on a joint made here, whose truths do not depend on the parameter file."""

from dataclasses import replace
from math import radians

import made_joint
import numpy as np
import pytest
from made_joint import MUSCLE

import mjhill
from mjhill.experiments.twitch import muscle_twitch
from mjhill.identification import facts as measured
from mjhill.identification.facts import Fact, facts
from mjhill.lab.ballistic import ballistic_movement, free_velocity
from mjhill.lab.postures import tonic_excitations
from mjhill.lab.rig import (
    UnmeasuredError,
    angle_series,
    at_rest,
    build_rig,
    record_run,
    strongest_angle,
)
from mjhill.literature import facts as published
from mjhill.literature.facts import read_entries

NO_ELASTICITY = mjhill.Passive(k1_pos=0.0, k2_pos=1.0, k1_neg=0.0, k2_neg=1.0)

ENTRY = """
[[fact]]
joint = "knee"
muscle = "knee_extensor"
measure = "free_velocity"
quantity = "speed"
unit = "rad/s"
low = 1.0
high = 2.0
source = "none"
"""


def make_joint(muscle: mjhill.Hill = MUSCLE, **changes) -> mjhill.Joint:
    return made_joint.make_joint(muscle, **{"passive": NO_ELASTICITY, **changes})


def movement_of(joint, degrees, braked):
    return ballistic_movement(
        joint, "puller", amplitude=radians(degrees), duration=0.5, braked=braked
    )


# --- the bench


def test_a_search_sees_the_angles_of_the_recorded_run_bit_for_bit():
    bench = build_rig(make_joint())
    inputs = {"puller": mjhill.pulse(1.0, 0.0, 0.05), "opponent": mjhill.pulse(1.0, 0.05, 0.03)}
    start = at_rest(bench, 0.2)
    searched = angle_series(bench, start, 0.2, inputs)
    assert np.array_equal(searched, record_run(bench, start, 0.2, excitation=inputs)["joint.angle"])


@pytest.mark.parametrize("angle", [-0.5, 0.0, 0.5])
def test_a_joint_stays_where_it_is_held(angle):
    joint = make_joint()
    bench, levels = build_rig(joint), tonic_excitations(joint, "puller", angle)
    end = record_run(bench, at_rest(bench, angle, levels), 0.5, excitation=levels)["joint.angle"][
        -1
    ]
    assert end == pytest.approx(angle, abs=1e-6)


def test_a_joint_too_stiff_for_its_muscle_is_not_held():
    with pytest.raises(UnmeasuredError, match="full excitation of puller does not hold joint"):
        tonic_excitations(make_joint(stiffness=100.0), "puller", 0.5)


# --- ballistic movements


@pytest.mark.parametrize("braked", [False, True])
def test_a_movement_goes_its_amplitude_and_no_farther(braked):
    joint = make_joint(damping=0.3)  # well damped, so that it needs no brake
    for degrees in (5, 40):
        found = movement_of(joint, degrees, braked)
        assert found.progress.max() == pytest.approx(1.0, abs=1e-3)
        assert found.progress[-1] == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("braked", [False, True])
def test_peak_velocity_and_duration_rise_with_the_amplitude_of_a_movement(braked):
    movements = [movement_of(make_joint(damping=0.3), degrees, braked) for degrees in (5, 20, 60)]
    assert (np.diff([one.peak_velocity for one in movements]) > 0).all()
    assert (np.diff([one.duration(radians(30.0)) for one in movements]) > 0).all()


def test_a_brake_makes_a_movement_faster_and_its_pulse_wider():
    joint = make_joint(damping=0.3)
    free, braked = movement_of(joint, 40, False), movement_of(joint, 40, True)
    assert free.brake == 0 < braked.brake
    assert braked.pulse > free.pulse
    assert braked.peak_velocity > free.peak_velocity


def test_movements_of_mirrored_muscles_are_mirrored():
    joint = make_joint(damping=0.3)
    there, back = (
        ballistic_movement(joint, name, amplitude=0.5, duration=0.5, braked=True)
        for name in joint.muscles
    )
    assert back.pulse == pytest.approx(there.pulse)
    # exact searches, but sums of torques in another order
    np.testing.assert_allclose(back.velocity, there.velocity, atol=1e-6)


def test_a_movement_that_swings_past_without_a_pulse_needs_a_brake():
    joint = make_joint(damping=0.01)
    with pytest.raises(UnmeasuredError, match="even without a pulse"):
        movement_of(joint, 30, False)
    assert movement_of(joint, 30, True).progress.max() == pytest.approx(1.0, abs=1e-3)


def test_a_turn_wider_than_the_range_or_too_far_for_its_time_is_not_measured():
    with pytest.raises(UnmeasuredError, match="wider than the range"):
        movement_of(make_joint(), 150, False)
    with pytest.raises(UnmeasuredError, match="does not move it by 60° in 0.02 s"):
        ballistic_movement(make_joint(), "puller", amplitude=radians(60), duration=0.02)


# --- twitches


def test_a_twitch_peaks_later_and_relaxes_more_slowly_with_larger_time_constants():
    fast = muscle_twitch(make_joint(), "puller")
    slow = muscle_twitch(
        make_joint(replace(MUSCLE, excitation_tau=0.06, deactivation_tau=0.08)), "puller"
    )
    assert slow.contraction > fast.contraction > 0
    assert slow.half_relaxation > fast.half_relaxation > 0
    assert 0 < fast.share < 1


def test_a_twitch_is_isometric_at_the_angle_of_the_largest_force():
    joint = make_joint(replace(MUSCLE, optimal_length=0.3))
    angle = muscle_twitch(joint, "puller").recording["joint.angle"]
    assert angle[0] == pytest.approx(-0.3)
    assert np.ptp(angle) < radians(0.2)  # what the dynamometer gives way
    assert strongest_angle(make_joint(range=(-0.1, 1.0)), "puller") == 0.0
    assert strongest_angle(replace(joint, range=(-0.1, 1.0)), "puller") == -0.1


# --- velocity


def test_no_muscle_turns_a_free_joint_faster_than_it_can_shorten():
    for inertia in (0.0005, 0.01, 0.1):
        joint = make_joint(inertia=inertia, stiffness=0.0)  # nothing else pushes it
        assert 0 < free_velocity(joint, "puller") < MUSCLE.max_velocity


def test_a_light_joint_comes_near_the_largest_velocity_of_its_muscle():
    even = replace(MUSCLE, width_short=20.0, width_long=20.0)  # as strong at any length
    joint = make_joint(even, inertia=1e-3, damping=0.0, stiffness=0.0, range=(-3.0, 1.0))
    assert free_velocity(joint, "puller") > 0.9 * MUSCLE.max_velocity


# --- the facts


def test_every_fact_is_about_a_muscle_of_a_joint_and_has_an_interval_and_a_source():
    entries = read_entries()
    assert len({(entry.joint, entry.quantity) for entry in entries}) == len(entries) > 0
    for entry in entries:
        assert entry.muscle in mjhill.JOINTS[entry.joint].muscles
        assert 0 < entry.low < entry.high
        assert entry.source
        assert entry.quantity


def test_every_fact_is_measured_or_says_why_it_is_not():
    shares: list[float] = []
    found = facts(progress=shares.append)
    assert [fact.joint for fact in found] == [entry.joint for entry in read_entries()]
    for fact in found:
        assert fact.measured is not None or fact.note
        assert fact.measured is None or np.isfinite(fact.measured)
    assert shares[-1] == 1.0
    assert shares == sorted(shares)


def test_only_the_joints_given_are_measured_with_the_parameters_given():
    ankle = mjhill.JOINTS["ankle"]
    flexor = ankle.muscles["ankle_plantarflexor"]
    muscles = {"ankle_plantarflexor": replace(flexor, max_velocity=0.5 * flexor.max_velocity)}
    slow = replace(ankle, muscles={**ankle.muscles, **muscles})
    usual, slower = facts({"ankle": ankle})[0], facts({"ankle": slow})[0]
    assert usual.quantity == "plantarflexor twitch, time to peak"
    assert (slower.quantity, slower.low, slower.high) == (usual.quantity, usual.low, usual.high)
    assert slower.measured > usual.measured
    assert facts({"hip": mjhill.JOINTS["hip"]}) == []


def test_velocities_are_given_in_the_unit_of_the_publication():
    eye = mjhill.JOINTS["eye"]
    fact = facts({"eye": eye})[0]
    saccade = ballistic_movement(
        eye,
        "lateral_rectus",
        amplitude=radians(5),
        duration=0.2,
        braked=True,
        height=0.5,
        tonic=0.1,
    )
    assert fact.unit == "°/s"
    assert fact.measured == pytest.approx(np.degrees(saccade.peak_velocity))


def test_a_fact_is_within_its_interval_ends_included():
    def within(measured):
        return Fact("eye", "speed", "°/s", 1.0, 2.0, "none", measured).within

    assert [within(value) for value in (0.9, 1.0, 1.5, 2.0, 2.1, None)] == [
        False, True, True, True, False, None,
    ]  # fmt: skip


def test_what_cannot_be_measured_is_reported_with_its_reason():
    stuck = replace(mjhill.JOINTS["eye"], stiffness=10.0)
    for fact in facts({"eye": stuck}):
        assert fact.measured is None
        assert fact.within is None
        assert "full excitation of medial_rectus does not hold eye" in fact.note


def test_names_that_do_not_exist_are_refused_with_those_that_do(tmp_path):
    eye = mjhill.JOINTS["eye"]
    with pytest.raises(ValueError, match="unknown joint 'toe'; there are: elbow, "):
        facts({"toe": eye})
    with pytest.raises(
        ValueError, match="unknown muscle 'ankle_plantarflexor'; there are: lateral"
    ):
        facts({"ankle": eye})
    for old, new, message in (
        ("free_velocity", "magic", "unknown measure 'magic'; there are: .*twitch_share"),
        ("rad/s", "knots", "unknown unit 'knots'; there are: .*ms"),
        ("high = 2.0", "high = 1.0", "low must be below high, got 1 and 1"),
        ('source = "none"', "", "not a file of facts"),
        ("[[fact]]", "[[fact", "not a file of facts"),
    ):
        path = tmp_path / "facts.toml"
        path.write_text(ENTRY.replace(old, new), encoding="utf-8")
        with pytest.raises(ValueError, match=message):
            read_entries(path)
    path.write_text(ENTRY, encoding="utf-8")
    assert read_entries(path)[0].quantity == "speed"


def test_every_measure_that_the_file_can_name_is_there():
    assert set(published.MEASURES) == set(measured.MEASURES)
