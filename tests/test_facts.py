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
