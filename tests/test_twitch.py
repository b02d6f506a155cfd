from dataclasses import replace
from math import radians

import numpy as np
import pytest
from made_joint import MUSCLE, make_joint
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.twitch import muscle_twitch, twitch
from mjhill.lab.batch import Rigs
from mjhill.lab.dynamometer import (
    active_torque,
    compliant_machine,
    electrically_stimulated,
    run_paths,
    stiff_machine,
)
from mjhill.lab.rig import UnmeasuredError, muscle_torque, strongest_angle
from mjhill.lab.twitch import ACTION_POTENTIAL, twitches

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


# --- one action potential, on many joints at once


def train(rate, duration=1.0, timestep=1e-3):
    """Excitation over each step by action potentials at a rate [Hz], shape (1, steps, 2)."""
    edges = timestep * np.arange(round(duration / timestep) + 1)
    count = np.floor(edges * rate)
    on = count + np.minimum((edges * rate - count) / rate / ACTION_POTENTIAL, 1.0) * 1.0
    # time excited until each edge, in action potentials
    return np.stack([np.diff(on) * ACTION_POTENTIAL / timestep, np.zeros(len(edges) - 1)], 1)[None]


def test_a_train_of_action_potentials_fuses_to_tetanus_at_the_largest_rate():
    rigs = Rigs([make_joint()], locked=True)

    def torque(excitation):
        found = rigs.run(start=0.0, excitation=excitation, steps=1000, record=["qfrc_actuator"])
        return found["qfrc_actuator"][0, 500:, 0]

    tetanus = torque([[[1.0, 0.0]]])
    trains = [torque(train(rate)) for rate in (10.0, 30.0, 1 / ACTION_POTENTIAL)]
    means = [float(one.mean() / tetanus.mean()) for one in trains]
    ripples = [float(np.ptp(one) / one.mean()) for one in trains]
    assert 0 < means[0] < means[1] < means[2] == pytest.approx(1.0, abs=1e-6)
    assert ripples[0] > ripples[1] > ripples[2]
    assert ripples[2] < 1e-3


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_a_locked_joint_and_one_on_a_dynamometer_twitch_alike(name):
    joint = mjhill.JOINTS[name]
    for muscle in joint.muscles:
        locked, held = twitches([joint], muscle), muscle_twitch(joint, muscle)
        # the dynamometer gives way by 0.2°, and its times are whole steps
        assert locked.contraction[0] == pytest.approx(held.contraction, rel=0.02)
        assert locked.half_relaxation[0] == pytest.approx(held.half_relaxation, rel=0.02)
        assert locked.share[0] == pytest.approx(held.share, rel=0.02)
        assert locked.torque.max() == pytest.approx(held.peak, rel=0.02)


def test_joints_twitch_together_as_each_does_alone():
    joints = [make_joint(replace(MUSCLE, excitation_tau=tau)) for tau in (0.02, 0.04)]
    together = twitches(joints, "puller")
    for k, joint in enumerate(joints):
        alone = twitches([joint], "puller")
        for name in ("contraction", "half_relaxation", "share"):
            assert getattr(together, name)[k] == pytest.approx(getattr(alone, name)[0], rel=1e-9)
    assert together.contraction[1] > together.contraction[0]


def test_a_twitch_peaks_later_and_relaxes_more_slowly_with_larger_time_constants():
    slow = replace(MUSCLE, excitation_tau=0.06, deactivation_tau=0.08)
    found = twitches([make_joint(), make_joint(slow)], "puller")
    assert found.contraction[1] > found.contraction[0] > 0
    assert found.half_relaxation[1] > found.half_relaxation[0] > 0
    assert ((found.share > 0) & (found.share < 1)).all()


def test_a_twitch_is_isometric_at_the_angle_of_the_largest_force():
    joint = make_joint(replace(MUSCLE, optimal_length=0.3))
    angle = muscle_twitch(joint, "puller").recording["joint.angle"]
    assert angle[0] == pytest.approx(-0.3)
    assert np.ptp(angle) < radians(0.2)  # what the dynamometer gives way
    assert strongest_angle(make_joint(range=(-0.1, 1.0)), "puller") == 0.0
    assert strongest_angle(replace(joint, range=(-0.1, 1.0)), "puller") == -0.1


def test_a_muscle_that_makes_no_torque_or_does_not_relax_is_not_measured():
    with pytest.raises(UnmeasuredError, match="torque of puller does not rise after the impulse"):
        twitches([make_joint()], "puller", width=0.0)
    slow = make_joint(replace(MUSCLE, deactivation_tau=1.0))
    with pytest.raises(UnmeasuredError, match="puller has not half relaxed 1 s after the impulse"):
        twitches([slow], "puller", width=0.4)


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
