"""Published facts: the file that holds them, and what is measured of them."""

from collections import Counter
from dataclasses import replace
from math import radians

import numpy as np
import pytest

import mjhill
from mjhill.identification import measures
from mjhill.identification.evidence import evidence_on
from mjhill.identification.facts import Fact, facts
from mjhill.identification.measures import measure, remark
from mjhill.lab.ballistic import ballistic_movements, free_velocities
from mjhill.lab.rig import UnmeasuredError
from mjhill.literature import facts as published
from mjhill.literature.facts import read_entries
from mjhill.literature.table2 import rows_of

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
OF_BOUNDS = ("series_stretch", "series_stiffness", "passive_stiffness")
"""Measures of facts from which bounds of parameters are derived: the tendon, the relaxed elbow."""


def test_every_fact_is_about_a_muscle_of_a_joint_and_has_an_interval_and_a_source():
    entries = read_entries()
    assert len({(entry.joint, entry.quantity) for entry in entries}) == len(entries) > 0
    for entry in entries:
        assert entry.muscle in mjhill.JOINTS[entry.joint].muscles
        assert 0 < entry.low < entry.high
        assert entry.source
        assert entry.quantity


def test_every_third_fact_of_a_joint_is_held_out_and_all_of_the_knee():
    """The rule at the head of the file."""
    entries = read_entries()
    (knee,) = sorted(
        {one.joint for one in entries if rows_of(mjhill.JOINTS[one.joint])}, reverse=True
    )[:1]
    assert knee == "knee"  # the last in the alphabet that Table 2 has too
    count: Counter[str] = Counter()
    for entry in entries:
        count[entry.joint] += entry.measure not in OF_BOUNDS
        third = entry.measure not in OF_BOUNDS and count[entry.joint] % 3 == 0
        assert entry.held_out == (third or entry.joint == knee), entry.quantity


def test_every_fact_is_measured_or_says_why_it_is_not(shipped_facts):
    assert [fact.joint for fact in shipped_facts] == [entry.joint for entry in read_entries()]
    for fact in shipped_facts:
        assert fact.measured is not None or fact.note
        assert fact.measured is None or np.isfinite(fact.measured)


def test_progress_ends_at_one():
    shares: list[float] = []
    facts({name: mjhill.JOINTS[name] for name in ("knee", "hip")}, progress=shares.append)
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
    assert facts({"head": mjhill.JOINTS["head"]}) == []


def test_velocities_are_given_in_the_unit_of_the_publication(shipped_facts):
    fact = next(fact for fact in shipped_facts if fact.joint == "eye")
    saccade = ballistic_movements(
        [mjhill.JOINTS["eye"]],
        "lateral_rectus",
        amplitude=radians(5),
        duration=0.2,
        braked=True,
        height=0.5,
        tonic=0.1,
    )
    assert fact.unit == "°/s"
    assert fact.measured == pytest.approx(np.degrees(saccade.peak_velocity[0]))


def test_a_measure_of_several_joints_is_that_of_each():
    ankle = mjhill.JOINTS["ankle"]
    joints = [ankle, replace(ankle, damping=1.3 * ankle.damping)]
    for entry in read_entries():
        if entry.joint == "ankle":
            alone = [measure(entry, [joint])[0] for joint in joints]
            np.testing.assert_allclose(measure(entry, joints), alone, rtol=1e-9)


def test_a_deviation_counts_half_the_interval_as_one():
    def deviation(measured):
        return Fact("eye", "speed", "°/s", 1.0, 3.0, "none", measured).deviation

    assert [deviation(value) for value in (0.0, 1.0, 2.0, 3.5, None)] == [-2, -1, 0, 1.5, None]


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


def free_velocity_entries():
    found = [entry for entry in read_entries() if entry.measure == "free_velocity"]
    assert found
    return found


def test_a_free_velocity_is_that_of_a_muscle_and_not_of_a_spring():
    for entry in free_velocity_entries():
        joint = mjhill.JOINTS[entry.joint]
        angle = radians(entry.arguments["degrees"])
        recoil, full = (
            free_velocities([joint], entry.muscle, angle=angle, excitation=u)[0] for u in (0.0, 1.0)
        )
        assert recoil < 0.3 * full
        assert f"passive elasticity alone moves it at {recoil:.3g} rad/s" in remark(entry, joint)


def test_a_joint_that_a_spring_moves_is_not_measured():
    for entry in free_velocity_entries():
        joint = mjhill.JOINTS[entry.joint]
        muscles = {
            name: replace(muscle, max_isometric_force=1e-3 * muscle.max_isometric_force)
            for name, muscle in joint.muscles.items()
        }
        sprung = replace(joint, muscles=muscles)
        (fact,) = [f for f in facts({joint.name: sprung}) if f.quantity == entry.quantity]
        assert fact.measured is None
        assert fact.deviation is None
        assert fact.note.startswith("passive elasticity alone moves it at ")
        assert fact.note.endswith(f"which is more than 50% of what {entry.muscle} does")


def test_a_fact_that_is_held_out_is_refused_by_a_fit():
    entries = read_entries()
    for joint in mjhill.JOINTS.values():
        assert not any(fact.held_out for fact in evidence_on(joint).facts)
    knee = mjhill.JOINTS["knee"]
    held_out = next(entry for entry in entries if entry.joint == "knee")
    with pytest.raises(ValueError, match="knee, velocity of .*: this fact is held out, so no fit"):
        evidence_on(knee, facts=[held_out])
    assert evidence_on(mjhill.JOINTS["eye"], facts=[held_out]).facts == ()
    given = replace(held_out, held_out=False)
    assert evidence_on(knee, facts=[given]).facts == (given,)


def test_names_that_do_not_exist_are_refused_with_those_that_do(tmp_path):
    eye = mjhill.JOINTS["eye"]
    with pytest.raises(ValueError, match="unknown joint 'toe'; there are: elbow, "):
        facts({"toe": eye})
    with pytest.raises(
        ValueError, match="unknown muscle 'ankle_plantarflexor'; there are: lateral"
    ):
        facts({"ankle": eye})


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "free_velocity",
            "magic",
            r"\(knee, speed\): unknown measure 'magic'; there are: ballistic",
        ),
        ("rad/s", "knots", "unknown unit 'knots'; there are: °, °/s, ms"),
        (
            "high = 2.0",
            "high = 1.0",
            "low must be below high, got 1 and 1; an interval needs a wid",
        ),
        ("high = 2.0", "high = 0.5", "low must be below high, got 1 and 0.5"),
        ("high = 2.0", "high = nan", "high must be a finite number, got nan"),
        ("high = 2.0", 'high = "2"', "high must be a finite number, got '2'"),
        ('source = "none"', "", "source missing; say which study it is from"),
        ('source = "none"', 'source = " "', "source must say which study .* got ' '"),
        ("low = 1.0\nhigh = 2.0", "", "low, high missing"),
        ("low =", "lowest = 0.5\nlow =", "unknown key 'lowest'; there are: joint, muscle, measure"),
        ("[[fact]]", "[[fact", "not a file of facts"),
        ("[[fact]]", "[[point]]", "not a file of facts: it must .* nothing else, got fact, point"),
    ],
)
def test_a_fact_out_of_order_is_refused_by_its_file_and_name(tmp_path, old, new, message):
    path = tmp_path / "facts.toml"
    path.write_text(ENTRY + ENTRY.replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=message) as caught:
        read_entries(path)
    assert str(caught.value).startswith(str(path))
    assert ", fact 2" in str(caught.value) or "not a file" in str(caught.value)
    path.write_text(ENTRY, encoding="utf-8")
    assert read_entries(path)[0].quantity == "speed"


def test_a_measure_that_fails_says_what_joint_and_why():
    entry = next(entry for entry in read_entries() if entry.measure == "ballistic_peak_velocity")
    eye = mjhill.JOINTS["eye"]
    muscles = {
        name: replace(muscle, max_isometric_force=1e-6) for name, muscle in eye.muscles.items()
    }
    with pytest.raises(UnmeasuredError, match="full excitation of .* does not hold eye at"):
        measure(entry, [replace(eye, muscles=muscles)])


def test_every_measure_that_the_file_can_name_is_there():
    assert set(published.MEASURES) == set(measures.MEASURES)
