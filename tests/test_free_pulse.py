from dataclasses import replace
from functools import cache
from math import radians

import numpy as np
import pytest
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.free_pulse import FreePulse, free_pulse, ratio_at, ratio_over_time
from mjhill.lab.postures import resting_angle
from mjhill.lab.rig import UnmeasuredError
from mjhill.lab.variants import AS_IT_IS, FAST, FLAT, LINEAR
from mjhill.simulate.reference import rest_state, simulate
from mjhill.simulate.signals import pulse


@cache
def elbow_pulse() -> FreePulse:
    return free_pulse()


def test_the_elbow_bears_out_what_the_paper_says_of_pulses_but_one_thing():
    claims = list(elbow_pulse().claims())
    assert [claim.holds for claim in claims] == [True] * 4 + [False]
    assert "parallel elasticity and the active torque-angle relation" in claims[-1].sentence
    # both count, but the elasticity less
    late = elbow_pulse().late_ratios()
    assert late[FLAT] > late[LINEAR] > late[AS_IT_IS]


def test_the_strongest_pulse_moves_the_joint_as_the_stiff_solver_says(elbow):
    strongest = elbow_pulse().strengths[-1]
    start = resting_angle(elbow)
    reference = simulate(
        elbow,
        {"elbow_flexor": pulse(1.0, 0.0, 0.1)},
        duration=0.4,
        start=rest_state(elbow, start),
    )
    ours = np.interp(reference.time, strongest.time, strongest.travel)
    assert np.abs(ours - (reference["elbow.angle"] - start)).max() < radians(0.5)


def test_peaks_grow_with_strength_and_with_width():
    result = elbow_pulse()
    for several in (result.strengths, result.widths):
        assert np.all(np.diff([one.peak_velocity for one in several]) > 0)
        assert np.all(np.diff([one.amplitude for one in several]) > 0)


def test_velocity_peaks_before_the_angle_does():
    for one in elbow_pulse().widths:
        assert one.time_to_peak_velocity < one.time_to_amplitude


def test_the_same_pulse_is_the_same_movement_in_either_series():
    strongest = elbow_pulse().strengths[-1]
    same = next(one for one in elbow_pulse().widths if one.width == strongest.width)
    np.testing.assert_array_equal(same.travel, strongest.travel)


def test_without_torque_velocity_relation_an_early_pulse_superposes():
    ratios = elbow_pulse().early_ratios()
    assert abs(ratios[FAST] - 2.0) < 0.3 * abs(ratios[AS_IT_IS] - 2.0)
    assert ratios[AS_IT_IS] < 1.8


def test_ratio_over_time_passes_through_the_ratio_at_a_time():
    pair = elbow_pulse().pairs[AS_IT_IS]
    time, ratio = ratio_over_time(*pair)
    assert np.interp(0.08, time, ratio) == pytest.approx(ratio_at(*pair, 0.08), rel=1e-3)


def test_torque_at_peak_velocity_is_what_hill_gives_less_than_isometric():
    assert 0.0 < elbow_pulse().torque_share < 0.5


def test_a_joint_without_muscles_tension_stays_at_its_angle_of_rest(elbow):
    tense = {
        name: replace(muscle, max_isometric_force=1e-9) for name, muscle in elbow.muscles.items()
    }
    assert resting_angle(replace(elbow, muscles=tense)) == pytest.approx(elbow.rest_angle)


def test_a_relaxed_joint_stays_where_it_is():
    ankle = mjhill.JOINTS["ankle"]
    angle = resting_angle(ankle)
    assert abs(angle - ankle.rest_angle) > radians(0.1)
    run = simulate(ankle, {}, duration=0.5, start=rest_state(ankle, angle))
    assert np.ptp(run["ankle.angle"]) < 1e-6


def test_the_film_has_three_bursts_and_the_joint_stays():
    film = elbow_pulse().film()
    assert film is not None
    agonist, opposing = film["elbow_flexor.u"], film["elbow_extensor.u"]
    assert np.sum(np.diff(agonist) > 0) >= 1
    assert opposing.max() == 1.0
    assert opposing[0] == 0.0
    assert np.all(agonist[opposing == 1.0] == 0.0)
    late = film["elbow.angle"][film.time > 0.6 * film.time[-1]]
    assert np.ptp(late) < radians(3.0)
    assert late[-1] > film["elbow.angle"][0] + radians(20.0)


def test_mirrored_muscles_move_alike():
    left = free_pulse("head", widths=(0.1,))
    right = free_pulse("head", muscle="right_rotator", widths=(0.1,))
    np.testing.assert_allclose(left.widths[0].travel, right.widths[0].travel, atol=1e-9)


def test_the_figure_has_strengths_widths_and_their_ratio():
    figure = Figure(figsize=FreePulse.size, layout="constrained")
    elbow_pulse().draw(figure)
    titles = [axis.get_title() for axis in figure.axes if axis.get_title()]
    assert titles == ["for 100 ms", "at 100%", "100% over 50%"]


def test_measures_name_excitation_and_width():
    names = [measure.name for measure in elbow_pulse().measures()]
    assert "25% for 100 ms: peak velocity" in names
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"muscle": "biceps"}, "unknown muscle 'biceps'; there are: elbow_flexor"),
        ({"widths": (-0.1,)}, "widths must ascend"),
        ({"widths": (0.2, 0.1)}, "widths must ascend"),
        ({"width": 0.0}, "widths must ascend"),
        ({"excitations": (0.3, 0.5)}, "each twice the one before"),
        ({"excitations": (1.0, 2.0)}, "in .0, 1."),
        ({"duration": -1.0}, "duration must be positive"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        free_pulse(**options)


def test_a_run_too_short_to_see_the_end_is_refused():
    with pytest.raises(UnmeasuredError, match="give a longer duration"):
        free_pulse(duration=0.21)
