from dataclasses import replace
from math import radians

import numpy as np
import pytest
from made_joint import MUSCLE, make_joint
from matplotlib.figure import Figure

from mjhill.experiments.tetanus import tetanus
from mjhill.lab.rig import muscle_torque


def contraction(muscle=MUSCLE, **changes):
    return tetanus(make_joint(muscle, **changes)).voluntary["puller"]


def test_a_muscle_without_series_element_rises_as_its_two_first_order_processes():
    # time constants of neural excitation and activation, in series
    quick = replace(MUSCLE, series_stretch=0.005, max_velocity=100.0, width_short=9, width_long=9)
    fit = contraction(quick).fit
    assert fit.time_constants == pytest.approx((0.03, 0.01), abs=2e-3)
    assert fit.misfit < 0.01


def test_a_longer_series_element_slows_the_rise():
    rises = [contraction(replace(MUSCLE, series_stretch=x)).rise for x in (0.1, 0.2, 0.4)]
    assert rises == sorted(rises)
    assert rises[0] < rises[-1]


def test_the_steady_level_is_the_torque_at_mid_range_of_the_largest_over_the_range():
    off = replace(MUSCLE, optimal_length=0.6)
    joint = make_joint(off)
    found = tetanus(joint)
    assert found.angle == pytest.approx(0.0)
    # the muscle that pulls towards positive angles is longest at negative ones
    assert found.best["puller"] == pytest.approx(-0.6, abs=0.1)
    assert found.best["opponent"] == pytest.approx(0.6, abs=0.1)
    level = muscle_torque(joint, "puller", 1.0, 0.0) / muscle_torque(joint, "puller", 1.0, -0.6)
    assert found.voluntary["puller"].steady == pytest.approx(level, rel=0.01)
    *_, below = found.claims()
    assert below.holds


def test_at_its_best_angle_mid_range_gives_the_largest_torque_and_decides_nothing():
    found = tetanus(make_joint())
    assert found.voluntary["puller"].steady == pytest.approx(1.0)
    assert found.largest["puller"] == pytest.approx(10.0, rel=0.01)
    *_, below = found.claims()
    assert below.holds is None


def test_a_torque_that_hardly_depends_on_angle_is_not_said_to_stay_below_the_largest():
    flat = replace(MUSCLE, optimal_length=0.6, width_short=20.0, width_long=20.0)
    *_, below = tetanus(make_joint(flat)).claims()
    assert below.holds is False


def test_electrical_stimulation_saves_about_the_time_constant_of_neural_excitation():
    found = tetanus(make_joint())
    saved = found.voluntary["puller"].rise - found.electrical["puller"].rise
    assert saved == pytest.approx(MUSCLE.excitation_tau, rel=0.3)


def test_nothing_that_can_be_bypassed_makes_stimulation_no_faster():
    claims = list(tetanus(make_joint(replace(MUSCLE, excitation_tau=1e-6))).claims())
    assert claims[0].holds
    assert not claims[1].holds


@pytest.mark.parametrize("joint", ["elbow", "eye", "hip"])
def test_any_joint_is_measured_drawn_and_ready_for_json(joint):
    shares: list[float] = []
    found = tetanus(joint, progress=shares.append)
    figure = Figure(figsize=found.size, layout="constrained")
    found.draw(figure)
    numbers = found.as_dict()
    assert shares[-1] == 1.0
    assert all(np.isfinite(measure["value"]) for measure in numbers["measures"])
    assert all(claim["evidence"] for claim in numbers["claims"])
    low, high = (radians(angle) for angle in (-60, 150))
    assert low < found.angle < high


def test_an_unknown_joint_is_refused():
    with pytest.raises(ValueError, match="unknown joint 'toe'; there are: elbow, "):
        tetanus("toe")
