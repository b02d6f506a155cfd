from dataclasses import replace
from functools import cache
from math import radians

import numpy as np
import pytest
from matplotlib.figure import Figure

import mjhill
from mjhill.analysis.second_order import step_response
from mjhill.experiments.step import Step, fitted_step, step
from mjhill.lab.variants import AS_IT_IS, FLAT, LINEAR
from mjhill.simulate.reference import rest_state, simulate


@cache
def elbow_step() -> Step:
    return step()


def verdicts(result: Step) -> list[bool | None]:
    return [claim.holds for claim in result.claims()]


def test_the_elbow_steps_as_table_2_says():
    for one in elbow_step().steps:
        assert one.row is not None
        # what the fits of joints aim at, see docs/joints.md
        assert one.fit.magnitude == pytest.approx(one.row.magnitude, rel=0.05)
        assert one.fit.duration == pytest.approx(sum(one.row.time_constants), rel=0.15)


def test_the_elbow_bears_out_what_the_paper_says_of_steps():
    assert verdicts(elbow_step()) == [True] * 6


def test_a_step_goes_where_the_stiff_solver_takes_it(elbow):
    one = elbow_step().steps[1]
    reference = simulate(
        elbow, {one.muscle: one.excitation}, duration=0.5, start=rest_state(elbow, one.start)
    )
    travel = reference["elbow.angle"] - one.start
    times = elbow_step().time
    ours = np.interp(reference.time, times, one.response)
    assert np.abs(ours - travel).max() < radians(0.5)


def test_stiffness_and_damping_are_those_of_the_system_that_made_the_response(elbow):
    joint = replace(elbow, inertia=0.05)
    stiffness, damping = 4.0, 1.2
    slow, fast = sorted(-1 / np.roots([0.05, damping, stiffness]).real, reverse=True)
    time = np.arange(2000) * 1e-3
    response = 1.5 * step_response(time, slow, fast)
    one = fitted_step(joint, "elbow_flexor", 0.1, time=time, response=response, start=0.0)
    assert one.stiffness == pytest.approx(stiffness, rel=1e-3)
    assert one.damping == pytest.approx(damping, rel=1e-3)
    force = joint.muscles["elbow_flexor"].max_isometric_force
    assert one.gain == pytest.approx(stiffness * 1.5 / (0.1 * force), rel=1e-3)
    assert not one.doubt


def test_a_ringing_response_leaves_stiffness_undetermined(elbow):
    time = np.arange(3000) * 1e-3
    response = 1.0 - np.exp(-time) * np.cos(12 * time)
    one = fitted_step(elbow, "elbow_flexor", 0.1, time=time, response=response, start=0.0)
    assert "not determined" in one.doubt
    seen = {measure.name: measure.value for measure in one.measures()}
    assert seen["elbow flexor at 0.1: K"] is None


def test_a_stiff_linear_joint_goes_in_proportion_and_the_claim_falls(elbow):
    # its muscles keep their torque at every angle
    muscles = {
        name: replace(muscle, width_short=1e3, width_long=1e3, activation_floor=1e-6)
        for name, muscle in elbow.muscles.items()
    }
    joint = replace(
        elbow,
        stiffness=200.0,
        damping=8.0,
        passive=replace(elbow.passive, k1_pos=0.0, k1_neg=0.0),
        muscles=muscles,
        postures=dict.fromkeys(muscles, elbow.rest_angle),
    )
    result = step(joint)
    for ratios in result.proportion.values():
        assert ratios[AS_IT_IS] == pytest.approx(5.0, rel=0.01)
        assert ratios[LINEAR] == pytest.approx(5.0, rel=0.01)
        assert ratios[FLAT] == pytest.approx(5.0, rel=0.01)
    assert verdicts(result)[1] is False


def test_a_joint_without_postures_starts_from_rest():
    hip = step("hip")
    assert {one.start for one in hip.steps} == {mjhill.JOINTS["hip"].rest_angle}
    assert all(one.row is None for one in hip.steps)


def test_mirrored_joints_step_alike():
    low, high, *others = step("head").steps
    for one, other in zip((low, high), others, strict=True):
        np.testing.assert_allclose(one.response, other.response, atol=1e-9)


def test_the_film_is_the_highest_step_of_the_first_muscle(elbow):
    film = elbow_step().film()
    assert film is not None
    assert film["elbow_flexor.u"][-1] == 0.5
    travel = film["elbow.angle"] - film["elbow.angle"][0]
    np.testing.assert_allclose(travel, elbow_step().steps[1].response, atol=1e-9)


def test_measures_have_table_2_beside_them():
    measures = {measure.name: measure for measure in elbow_step().measures()}
    assert measures["elbow flexor at 0.1: MAG"].published == (92.0, 92.0)
    assert measures["elbow flexor at 0.5: T2"].published == (100.0, 100.0)
    assert elbow_step().as_dict()["joint"] == "elbow"


def test_the_figure_has_an_axis_for_each_muscle():
    figure = Figure(figsize=Step.size, layout="constrained")
    elbow_step().draw(figure)
    assert [axis.get_title() for axis in figure.axes] == ["elbow flexor", "elbow extensor"]


def test_an_unknown_joint_is_refused_with_those_there_are():
    with pytest.raises(ValueError, match="unknown joint 'shoulder'; there are: elbow"):
        step("shoulder")


@pytest.mark.parametrize("excitations", [(0.5,), (0.5, 0.1), (0.0, 0.5), (0.1, 1.5), (0.2, 0.2)])
def test_excitations_that_do_not_rise_are_refused(excitations):
    with pytest.raises(ValueError, match="excitations must be at least two, ascending, in"):
        step(excitations=excitations)
