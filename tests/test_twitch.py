from dataclasses import replace
from math import radians

import numpy as np
import pytest
from made_joint import MUSCLE, make_joint
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.twitch import twitch
from mjhill.lab.dynamometer import (
    active_torque,
    compliant_machine,
    electrically_stimulated,
    run_paths,
    stiff_machine,
)
from mjhill.lab.rig import UnmeasuredError, muscle_torque

# --- the dynamometer


@pytest.mark.parametrize("level", [0.0, 0.4, 1.0])
def test_a_joint_steady_on_a_dynamometer_stays_and_its_torque_is_that_of_muscle_and_elasticity(
    level,
):
    joint = make_joint()
    path = np.full(300, 0.4)
    found = run_paths(
        joint, stiff_machine(joint), path, before={"puller": level}, excitation={"puller": level}
    )
    assert np.ptp(found.angle) < 1e-9
    np.testing.assert_allclose(found.torque, found.torque[0, 0], atol=1e-6)
    both = muscle_torque(joint, "puller", level, 0.4) + muscle_torque(joint, "opponent", 0, 0.4)
    passive = mjhill.reference.plant_torque(joint, 0.4)
    assert found.torque[0, 0] == pytest.approx(both + passive)


@pytest.mark.parametrize("muscle", ["puller", "opponent"])
def test_active_torque_is_the_muscles_own_once_elasticity_is_taken_off(muscle):
    joint = make_joint()
    angles = np.array([-0.8, 0.0, 0.8])
    path = np.repeat(angles[:, np.newaxis], 1500, axis=1)
    _, torque = active_torque(joint, stiff_machine(joint), path, muscle)
    for angle, end in zip(angles, torque[:, -1], strict=True):
        rise = muscle_torque(joint, muscle, 1.0, angle) - muscle_torque(joint, muscle, 0.0, angle)
        # the coupling gives way by 0.2°
        assert end == pytest.approx(abs(rise), rel=5e-3)


def test_a_machine_gives_way_by_no_more_than_it_says():
    joint = make_joint()
    for deflection in (radians(0.2), radians(5.0)):
        machine = compliant_machine(joint, deflection)
        found = run_paths(joint, machine, np.zeros(1500), excitation={"puller": 1.0})
        assert 0.9 * deflection < np.ptp(found.angle) <= deflection


def test_a_light_joint_gets_a_machine_that_the_steps_can_follow():
    joint = make_joint(inertia=5e-5)
    found = run_paths(joint, stiff_machine(joint), np.zeros(1000), excitation={"puller": 1.0})
    assert np.isfinite(found.torque).all()
    assert (np.diff(found.torque[0]) > -1e-3).all()  # rises without ringing


def test_the_reading_of_a_relaxed_turn_has_the_inertia_of_the_limb():
    limp = replace(MUSCLE, max_isometric_force=1e-9)
    nothing = mjhill.Passive(k1_pos=0, k2_pos=1, k1_neg=0, k2_neg=1)
    joint = make_joint(limp, stiffness=0.0, damping=0.0, passive=nothing)
    machine = stiff_machine(make_joint())
    time = 1e-3 * np.arange(500)
    found = run_paths(joint, machine, 0.5 * 8.0 * time**2 - 0.5)
    assert found.torque[0, 400] == pytest.approx(-joint.inertia * 8.0, rel=1e-3)


# --- the twitch


def test_a_shorter_impulse_gives_a_smaller_twitch_in_proportion():
    joint = make_joint()
    small, large = (twitch(joint, width=width).twitches["puller"] for width in (1e-3, 2e-3))
    # short of a twitch's own time the impulse's area counts; the muscle is not linear
    assert 1.5 < large.peak / small.peak < 2.5


def test_twitches_of_mirrored_muscles_are_alike_and_grow_with_the_muscle():
    found = twitch(make_joint())
    one, other = found.twitches.values()
    assert one.contraction == other.contraction  # elasticity differs, a little
    assert one.peak == pytest.approx(other.peak, rel=1e-3)
    strong = replace(MUSCLE, max_isometric_force=20.0)
    double = twitch(make_joint(strong, inertia=0.02)).twitches["puller"]
    assert double.peak == pytest.approx(2 * one.peak, rel=1e-2)
    assert double.share == pytest.approx(one.share, rel=1e-2)


def test_bypassing_neural_excitation_makes_a_twitch_earlier_and_larger():
    found = twitch(make_joint())
    for muscle, one in found.twitches.items():
        assert found.electrical[muscle].contraction < one.contraction
        assert found.electrical[muscle].peak > one.peak
    *_, faster = found.claims()
    assert faster.holds


def test_without_neural_excitation_to_bypass_nothing_is_gained():
    joint = make_joint(replace(MUSCLE, excitation_tau=1e-6))
    *_, faster = twitch(joint).claims()
    assert not faster.holds
    assert all(
        muscle.electrical_stimulation for muscle in electrically_stimulated(joint).muscles.values()
    )


def test_published_twitches_stand_beside_those_of_the_ankle_only():
    ankle = {measure.name: measure for measure in twitch().measures()}
    assert ankle["ankle plantarflexor twitch, time to peak"].published == (91.0, 131.0)
    wrist = twitch("wrist")
    assert all(measure.published is None for measure in wrist.measures())
    assert [claim.holds for claim in wrist.claims()].count(None) == 2


def test_a_twitch_is_drawn_and_ready_for_json():
    found = twitch("eye")
    figure = Figure(figsize=found.size, layout="constrained")
    found.draw(figure)
    assert len(figure.axes) == 2
    assert "mN·m" in figure.axes[0].get_ylabel()
    assert found.as_dict()["joint"] == "eye"
    assert set(found.recordings) == set(mjhill.JOINTS["eye"].muscles)


def test_progress_ends_at_one():
    shares: list[float] = []
    twitch("wrist", progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_what_cannot_be_measured_is_refused():
    with pytest.raises(ValueError, match="unknown joint 'toe'; there are: elbow, "):
        twitch("toe")
    for width in (0.0, -1.0, 0.5, float("nan")):
        with pytest.raises(ValueError, match=r"width must be in \(0, 0.5\) s, got"):
            twitch("ankle", width=width)
    slow = make_joint(replace(MUSCLE, deactivation_tau=1.0))
    with pytest.raises(UnmeasuredError, match="has not half relaxed"):
        twitch(slow, width=0.4)
