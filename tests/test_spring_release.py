"""Release of a joint from springs."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.spring_release import release, spring_release
from mjhill.lab.postures import balancing_excitations
from mjhill.lab.rig import UnmeasuredError


@pytest.fixture(scope="module")
def elbow():
    return spring_release("elbow", duration=0.6)


def passive_joint():
    """An elbow that is a spring and a damper, its muscles too weak to matter."""
    joint = mjhill.JOINTS["elbow"]
    weak = {
        name: replace(muscle, max_isometric_force=1e-6) for name, muscle in joint.muscles.items()
    }
    none = mjhill.Passive(k1_pos=0.0, k2_pos=1.0, k1_neg=0.0, k2_neg=1.0)
    return replace(joint, muscles=weak, passive=none, stiffness=5.0, damping=0.3)


def test_a_joint_that_is_a_spring_and_a_damper_is_found_again_without_the_external_spring():
    joint = passive_joint()
    for spring in (20.0, 80.0):
        one = release(joint, spring, 0.0, {}, joint.rest_angle, -0.1, 0.5)
        assert one.stiffness == pytest.approx(joint.stiffness, rel=0.01)
        assert one.swing.damping == pytest.approx(joint.damping, rel=0.01)
        assert one.swing.misfit < 1e-3
        assert one.hold == pytest.approx((spring + joint.stiffness) * 0.1)


def test_the_joint_is_still_until_it_is_released_and_goes_back(elbow):
    for one in elbow.releases:
        angle, held = one.run["elbow.angle"], one.run.time <= 0.1
        start = elbow.angle + elbow.deflection
        np.testing.assert_allclose(angle[held], start, atol=1e-6)
        assert abs(angle[-1] - elbow.angle) < abs(elbow.deflection)
        assert (one.run["elbow.applied"][~held] == 0).all()


def test_muscle_torques_change_though_inputs_do_not(elbow):
    run = elbow.film()
    for name in ("elbow_flexor", "elbow_extensor"):
        assert np.ptp(run[f"{name}.u"]) == 0
        assert np.ptp(run[f"{name}.force"]) > 0.5


def test_without_cocontraction_a_stiffer_spring_rings_faster():
    joint = mjhill.JOINTS["elbow"]
    inputs = balancing_excitations(joint, 0.02, joint.home_angle)
    frequencies = [
        release(joint, k, 0.02, inputs, joint.home_angle, 0.1, 0.5).swing.natural_frequency
        for k in (20.0, 80.0)
    ]
    assert frequencies[1] / frequencies[0] == pytest.approx(2.0, rel=0.1)


def test_claims_follow_from_the_releases(elbow):
    damped, rising = elbow.claims()
    over = [one for one in elbow.releases if one.swing.damping_ratio >= 1]
    assert damped.holds is (not over)
    assert f"not underdamped in {len(over)} of 9" in damped.evidence
    assert rising.holds
    calm = tuple(one for one in elbow.releases if one.cocontraction == 0.02)
    assert next(replace(elbow, releases=calm).claims()).holds
    weak = tuple(
        replace(one, swing=replace(one.swing, stiffness=one.spring + 3.0 + 0.1 * one.cocontraction))
        for one in elbow.releases
    )
    assert list(replace(elbow, releases=weak).claims())[1].holds is False
    lost = tuple(replace(o, swing=replace(o.swing, stiffness=-1.0)) for o in elbow.releases)
    assert "damping ratios not found" in next(replace(elbow, releases=lost).claims()).evidence
    swapped = replace(elbow, releases=elbow.releases[::-1])
    assert not list(swapped.claims())[1].holds


def test_a_level_that_is_not_held_is_reported():
    soft = (0.5,)  # less than the wrist's muscles take away
    result = spring_release(
        "wrist", angle=0.0, cocontraction=(0.02, 0.5), springs=soft, duration=0.3
    )
    assert [one.cocontraction for one in result.releases] == [0.02]
    assert any("drifts away" in measure.note for measure in result.measures())
    assert list(result.claims())[1].holds is None
    with pytest.raises(UnmeasuredError, match="drifts away"):
        spring_release("wrist", angle=0.0, cocontraction=(0.5, 0.6), springs=soft)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"joint": "tail"}, "unknown joint 'tail'; there are: elbow"),
        ({"cocontraction": (0.2,)}, "cocontraction must be 2 or more ascending"),
        ({"springs": (-1.0,)}, "springs must be 1 or more ascending"),
        ({"springs": (30.0, 20.0)}, "springs must be 1 or more ascending"),
        ({"angle": -1.0}, "angle must be in the range of elbow"),
        ({"deflection": 0.0}, "deflection must be in"),
        ({"duration": -1.0}, "duration must be in"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        spring_release(**options)


def test_the_figure_the_film_and_the_numbers_are_there(elbow):
    shares = []
    result = spring_release("eye", cocontraction=(0.02, 0.5), duration=0.2, progress=shares.append)
    assert shares[-1] == 1.0
    figure = Figure(figsize=result.size)
    result.draw(figure)
    assert len(figure.axes) == 4
    assert elbow.film().about["model"] == "elbow"
    assert elbow.as_dict()["section"] == "4.3.1, Fig. 10"
