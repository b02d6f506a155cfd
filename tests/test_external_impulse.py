"""A torque impulse at several co-contraction levels."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.external_impulse import external_impulse, impulse_with_burst
from mjhill.lab.impulse import Impulse
from mjhill.lab.postures import balancing_excitations
from mjhill.lab.rig import UnmeasuredError
from mjhill.lab.variants import contractile_viscosity, series_stiffness, with_linear_elements


@pytest.fixture(scope="module")
def elbow():
    return external_impulse("elbow", duration=0.8)


def test_the_joint_is_still_before_and_after_without_a_hit(elbow):
    joint = mjhill.JOINTS["elbow"]
    impulse = Impulse(elbow.angle, elbow.sign, 0.06, 0.02, 0.5)
    run = impulse.response(joint, 0.5, elbow.excitations[0.5], 1e-9).run
    assert np.abs(run["elbow.angle"] - elbow.angle).max() < 1e-6


def test_the_small_impulse_deflects_by_what_was_asked_at_the_lowest_level(elbow):
    assert np.degrees(elbow.small[0].swing.peak) == pytest.approx(5.0, rel=0.01)
    assert {hit.impulse / elbow.small[0].impulse for hit in elbow.large} == {3.0}


def test_the_applied_torque_has_the_impulse(elbow):
    run = elbow.small[0].run
    applied = elbow.sign * run["elbow.applied"]
    assert applied.sum() * run.about["timestep"] == pytest.approx(elbow.small[0].impulse)


def test_right_after_the_hit_momentum_is_the_impulse_less_what_the_joint_took():
    """A hit far shorter than the response gives all bodies together J v."""
    joint = mjhill.JOINTS["elbow"]
    inputs = balancing_excitations(joint, 0.02, joint.home_angle)
    hit = Impulse(joint.home_angle, 1.0, 1.0, 0.002, 0.1).response(joint, 0.02, inputs, 0.01)
    velocity = hit.run["elbow.velocity"][2]
    assert velocity * (joint.inertia + 1.0) == pytest.approx(0.01, rel=0.005)


def test_more_inertia_swings_slower(elbow):
    heavy = external_impulse("elbow", cocontraction=(0.2, 0.5), added_inertia=0.5, duration=0.5)
    for light, slow in zip(elbow.small[1:], heavy.small, strict=True):
        assert slow.swing.natural_frequency < light.swing.natural_frequency


def test_claims_follow_from_the_hits(elbow):
    claims = list(elbow.claims())
    assert [claim.holds for claim in claims] == [True] * 5
    reversed_levels = replace(elbow, small=elbow.small[::-1], large=elbow.large[::-1])
    assert [claim.holds for claim in reversed_levels.claims()][:3] == [False] * 3
    alike = tuple(
        replace(hit, swing=replace(hit.swing, peak=0.05 - 0.001 * k))
        for k, hit in enumerate(elbow.small)
    )
    assert next(replace(elbow, small=alike).claims()).holds is False
    assert list(replace(elbow, linear=elbow.small).claims())[4].holds is False


def test_torque_that_does_follow_input_is_said_to(elbow):
    """What the claim denies, made: correlation 1 and no change without input."""
    assert elbow.burst.claim().holds
    assert not replace(elbow.burst, correlation=1.0, before=0.0, other=0.0).claim().holds


def test_the_burst_acts_on_the_stretched_muscle_and_only_after_it_starts(elbow):
    burst = elbow.burst
    assert elbow.sign == -1.0
    assert burst.muscle == "elbow_flexor"
    early = burst.run.time < burst.start
    for muscle in ("elbow_flexor", "elbow_extensor"):
        same = burst.run[f"{muscle}.force"] == burst.without[f"{muscle}.force"]
        assert same[early].all()
    assert burst.run["elbow_flexor.u"].max() == pytest.approx(
        burst.run["elbow_flexor.u"][0] + burst.height
    )
    assert burst.delay > 0


def test_a_muscle_at_full_input_takes_no_burst(elbow):
    joint, full = mjhill.JOINTS["elbow"], dict.fromkeys(elbow.excitations[0.5], 1.0)
    impulse = Impulse(elbow.angle, elbow.sign, 0.06, 0.02, 0.5)
    with pytest.raises(UnmeasuredError, match="excitation of elbow_flexor is 1"):
        impulse_with_burst(impulse, joint, full, size=0.1, height=0.3)


def test_linear_elements_agree_at_the_inputs_that_they_are_made_for(elbow):
    joint = mjhill.JOINTS["elbow"]
    flat = with_linear_elements(joint, elbow.excitations[0.2], elbow.angle)
    for name, level in elbow.excitations[0.2].items():
        length = joint.gears[name] * elbow.angle
        one, other = joint.muscles[name], flat.muscles[name]
        for slope in (series_stiffness, contractile_viscosity):
            assert slope(other, level, length) == pytest.approx(slope(one, level, length), rel=0.01)
        relaxed, active = (series_stiffness(other, u, length) for u in (0.01, 1.0))
        assert active / relaxed < 1.02
    assert elbow.linear[1].swing.peak == pytest.approx(elbow.small[1].swing.peak, rel=0.1)


def test_a_level_that_is_not_held_is_reported_and_the_rest_measured():
    result = external_impulse("wrist", angle=0.0, cocontraction=(0.02, 0.1, 0.5), duration=0.4)
    assert [hit.cocontraction for hit in result.small] == [0.02, 0.1]
    notes = [measure.note for measure in result.measures() if "co-contraction 0.5" in measure.name]
    assert "drifts away" in notes[0]
    with pytest.raises(UnmeasuredError, match="drifts away"):
        external_impulse("wrist", angle=0.0, cocontraction=(0.5, 0.6))


def test_one_level_decides_nothing_about_several():
    result = external_impulse("wrist", angle=0.0, cocontraction=(0.02, 0.5), duration=0.4)
    decided = [claim.holds is not None for claim in result.claims()]
    assert decided == [False, False, False, True, False]  # the fourth needs one level only


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"joint": "tail"}, "unknown joint 'tail'; there are: elbow"),
        ({"cocontraction": (0.5, 0.2)}, "cocontraction must be 2 or more ascending"),
        ({"angle": 4.0}, "angle must be in the range of elbow, 0 to 2.496 rad, got 4"),
        ({"width": -0.01}, r"width must be in \(0, 0.375\] s, got -0.01"),
        ({"deflection": 0.0}, "deflection must be in"),
        ({"larger": 1.0}, "larger must be in"),
        ({"burst": 2.0}, "burst must be in"),
        ({"added_inertia": -1.0}, "added_inertia must be"),
        ({"duration": float("nan")}, "duration must be in"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        external_impulse(**options)


def test_the_figure_the_film_and_the_numbers_are_there(elbow):
    shares = []
    result = external_impulse(
        "eye", cocontraction=(0.02, 0.5), duration=0.35, progress=shares.append
    )
    assert shares[-1] == 1.0
    assert shares == sorted(shares)
    figure = Figure(figsize=result.size)
    result.draw(figure)
    assert len(figure.axes) == 6
    assert elbow.film() is elbow.large[1].run
    assert elbow.as_dict()["joint"] == "elbow"
