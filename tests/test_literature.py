"""The parameter file is what the fit to the literature gives, and how well that agrees."""

import itertools
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import mjhill
from mjhill.identification.evidence import evidence_on
from mjhill.identification.fit import Estimate, Identified
from mjhill.identification.free import free_parameters, pin, value_of
from mjhill.identification.literature_fit import from_literature
from mjhill.identification.report import parameter_text, rounded, write_parameters
from mjhill.identification.rows import published_rows, step_rows
from mjhill.joints.reader import parameter_file, read_joints
from mjhill.literature.facts import read_entries

CHEAP = ("hip", "head")  # the fits of the others take up to minutes; that of the elbow: test_readme


def shipped(name):
    """The shipped joint, as if it had just been fitted."""
    joint, free = mjhill.JOINTS[name], free_parameters(name)
    values = [value_of(joint, item) for item in free]
    estimates = [
        Estimate(item.name, value, value, value, (item.low, item.high), 1.0, False)
        for item, value in zip(free, values, strict=True)
    ]
    return Identified(joint, tuple(free), tuple(estimates))


def moved(result, share=0.4):
    """A result whose values are that share of the way between their bounds."""
    estimates = [
        replace(one, value=(1 - share) * one.bounds[0] + share * one.bounds[1])
        for one in result.estimates
    ]
    return replace(result, estimates=tuple(estimates))


# --- the fit


@pytest.fixture(scope="module")
def hip():
    return from_literature("hip")


@pytest.mark.parametrize("name", CHEAP)
def test_the_fit_gives_the_shipped_values_again(name):
    shares = []
    result = from_literature(name, progress=shares.append)
    for free, estimate in zip(result.free, result.estimates, strict=True):
        # the file keeps four digits, and processors differ in the last bits of a run
        assert estimate.value == pytest.approx(value_of(mjhill.JOINTS[name], free), rel=2e-3)
        assert value_of(result.joint, free) == estimate.value
        assert free.low <= estimate.low <= estimate.value <= estimate.high <= free.high
    assert all(0 < a < b < 1 for a, b in itertools.pairwise(shares))


def test_the_fit_does_not_look_at_the_values_in_the_file(tmp_path, hip):
    text = parameter_file().read_text(encoding="utf-8")
    low, high = tomllib.loads(text)["hip"]["stiffness"]["bounds"]
    start = text.index("[hip]")
    changed = text[:start] + re.sub(
        r"stiffness = \{ value = \S+,",
        f"stiffness = {{ value = {0.9 * low + 0.1 * high:g},",
        text[start:],
        count=1,
    )
    path = tmp_path / "joints.toml"
    path.write_text(changed, encoding="utf-8")
    assert read_joints(path)["hip"].stiffness != mjhill.JOINTS["hip"].stiffness
    assert from_literature("hip", path).estimates == hip.estimates


def test_a_joint_on_which_nothing_is_published_is_refused(tmp_path):
    text = parameter_file().read_text(encoding="utf-8").replace("[hip", "[wing")
    path = tmp_path / "joints.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="nothing published on 'wing' comes with mjhill"):
        from_literature("wing", path)


# --- what can be chosen


def test_what_is_fixed_keeps_its_value_and_is_not_fitted(hip):
    fixed = {"hill_shape": 0.3, "hip_flexor.width_long": 2.0}
    result = from_literature("hip", fixed=fixed)
    names = ["hip_flexor.hill_shape", "hip_flexor.width_long", "hip_extensor.hill_shape"]
    assert {item.name: value for item, value in result.pinned} == dict(
        zip(names, (0.3, 2.0, 0.3), strict=True)
    )
    for item, value in result.pinned:
        assert value_of(result.joint, item) == value
    fitted = [estimate.name for estimate in result.estimates]
    assert sorted([*fitted, *names]) == sorted(estimate.name for estimate in hip.estimates)


def test_a_fit_without_facts_misses_what_a_fit_with_them_meets(hip):
    without = from_literature("hip", facts=[])
    facts = evidence_on(hip.joint).facts

    def misses(result):
        found = evidence_on(result.joint).residuals([], np.zeros((0, 1)))
        return np.abs(found[-len(facts) :]).max()

    assert misses(hip) < misses(without)


def test_how_a_step_starts_is_kept_with_the_result_and_changes_the_steps(hip):
    held = from_literature("hip", start="held")
    assert (hip.start, held.start) == ("relaxed", "held")
    assert held.estimates == hip.estimates  # Table 2 has no step of the hip
    for muscle, relaxed, other in zip(
        mjhill.JOINTS["elbow"].muscles,
        step_rows(mjhill.JOINTS["elbow"], "relaxed"),
        step_rows(mjhill.JOINTS["elbow"], "held"),
        strict=False,
    ):
        assert relaxed["our T1 [ms]"] != other["our T1 [ms]"], muscle
    with pytest.raises(ValueError, match="start must be one of relaxed, held, got 'slack'"):
        from_literature("hip", start="slack")


def test_a_joint_held_before_a_step_does_not_move_until_its_muscles_change():
    elbow = mjhill.JOINTS["elbow"]
    relaxed, held = (evidence_on(elbow, start=start) for start in ("relaxed", "held"))
    first = relaxed.responses([elbow])[0, :, 5], held.responses([elbow])[0, :, 5]
    # 5 ms later a muscle that is switched off still holds
    assert (np.abs(first[1]) < 0.1 * np.abs(first[0])).all()


def test_a_held_out_fact_is_no_choice():
    held_out = [fact for fact in read_entries() if fact.joint == "hip" and fact.held_out]
    with pytest.raises(ValueError, match="hip, .*: this fact is held out, so no fit may use it"):
        from_literature("hip", facts=held_out)


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        ({"strength": 1.0}, "no free parameter is called 'strength'; there are: .*hip_flexor"),
        ({"hill_shape": 5.0}, "hip_flexor.hill_shape must be fixed within its bounds, .* got 5"),
        ({"stiffness": float("nan")}, "stiffness must be fixed within its bounds, .* got nan"),
        ({"inertia": 1.0}, "no free parameter is called 'inertia'"),
    ],
)
def test_what_cannot_be_fixed_is_refused(fixed, message):
    with pytest.raises(ValueError, match=message):
        from_literature("hip", fixed=fixed)


def test_a_fit_with_everything_fixed_is_refused():
    free = free_parameters("hip")
    fixed = {item.name: value_of(mjhill.JOINTS["hip"], item) for item in free}
    with pytest.raises(ValueError, match="all parameters are fixed, so there is none to fit"):
        pin(free, fixed)
    rest, pinned = pin(free, dict(list(fixed.items())[1:]))
    assert rest == free[:1]
    assert [value for _, value in pinned] == list(fixed.values())[1:]


# --- how the shipped joints agree


def test_steps_agree_with_table_2():
    for joint in mjhill.JOINTS.values():
        rows = step_rows(joint)
        assert bool(rows) == (joint.name != "hip")
        for row in rows:
            assert abs(row["off [%]"]) <= 5, row
            assert abs(row["T1 + T2 off [%]"]) <= 15, row
            ours, published = (
                row[f"{whose}T1 [ms]"] + row[f"{whose}T2 [ms]"] for whose in ("our ", "")
            )
            assert 100 * (ours / published - 1) == pytest.approx(row["T1 + T2 off [%]"])


def test_passive_torques_and_ranges_agree_with_what_is_published():
    rows = [row for joint in mjhill.JOINTS.values() for row in published_rows(joint)]
    assert len(rows) == 39
    for row in rows:
        nearest = np.clip(row["ours"], row["low"], row["high"])
        assert (row["outside by"] or 0.0) == pytest.approx(abs(row["ours"] - nearest), abs=1e-12)
    assert sum(row["outside by"] is None for row in rows) >= 36


def test_facts_agree_with_what_is_published(shipped_facts):
    assert len(shipped_facts) == 28
    assert all(abs(fact.deviation) <= 2 for fact in shipped_facts)
    assert sum(abs(fact.deviation) <= 1 for fact in shipped_facts) >= 20


def test_facts_that_no_fit_has_seen_agree_too(shipped_facts):
    held_out = [fact for fact in shipped_facts if fact.held_out]
    assert len(held_out) >= 9
    assert sum(abs(fact.deviation) <= 2 for fact in held_out) >= 0.8 * len(held_out)


# --- the file


def test_shipped_values_leave_the_file_as_it_is_to_the_byte():
    text = parameter_file().read_text(encoding="utf-8")
    assert parameter_text([shipped(name) for name in mjhill.JOINTS]) == text


def test_only_the_numbers_that_were_fitted_change(tmp_path):
    result = moved(shipped("hip"))
    path = tmp_path / "fitted.toml"
    write_parameters(path, [result])
    before = parameter_file().read_text(encoding="utf-8").splitlines()
    after = path.read_text(encoding="utf-8").splitlines()
    changed = [(old, new) for old, new in zip(before, after, strict=True) if old != new]
    number = re.compile(r"value = [-+.e\d]+")
    assert len(changed) == len(result.free)
    assert all(number.sub("", old) == number.sub("", new) for old, new in changed)
    joint = read_joints(path)["hip"]
    for free, estimate in zip(result.free, result.estimates, strict=True):
        assert value_of(joint, free) == pytest.approx(estimate.value, rel=5e-4)  # four digits
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("name", ["head", "eye"])
def test_both_muscles_of_a_symmetric_joint_get_the_fitted_values(tmp_path, name):
    result = moved(shipped(name))
    path = tmp_path / "fitted.toml"
    write_parameters(path, [result])
    joint = read_joints(path)[name]
    one, other = joint.muscles
    postures = [joint.postures[muscle] for muscle in (one, other)]
    assert postures[0] == -postures[1] != 0
    assert joint.passive.k1_pos == joint.passive.k1_neg
    assert joint.passive.k2_pos == joint.passive.k2_neg
    assert replace(joint.muscles[one], sources=joint.muscles[other].sources) == joint.muscles[other]
    fitted = {estimate.name: estimate.value for estimate in result.estimates}
    for free in result.free:
        assert free.path[:2] != ("muscles", other)
        assert value_of(joint, free) == pytest.approx(fitted[free.name], rel=5e-4)


def test_a_fixed_value_is_written_without_bounds_and_with_its_source(tmp_path):
    result = shipped("head")
    (speed,) = (item for item in result.free if item.path[-1] == "max_velocity")
    kept = [(f, e) for f, e in zip(result.free, result.estimates, strict=True) if f != speed]
    pinned = replace(
        result,
        free=tuple(free for free, _ in kept),
        estimates=tuple(estimate for _, estimate in kept),
        pinned=((speed, 12.0),),
    )
    path = tmp_path / "fitted.toml"
    write_parameters(path, [pinned])
    tables = tomllib.loads(path.read_text(encoding="utf-8"))["head"]["muscles"]
    before = tomllib.loads(parameter_file().read_text(encoding="utf-8"))["head"]["muscles"]
    for muscle, table in tables.items():
        entry, old = table["max_velocity"], before[muscle]["max_velocity"]
        assert entry["value"] == 12.0
        assert "bounds" not in entry
        assert entry["source"] == (
            f"fixed by mjhill identify, not fitted within {speed.low:g} to {speed.high:g}: "
            f"{old['source']}"
        )
        assert {**table, "max_velocity": 0} == {**before[muscle], "max_velocity": 0}
    assert speed.name not in [item.name for item in free_parameters("head", path)]


def test_a_rounded_value_keeps_four_digits_and_its_bounds():
    assert rounded(0.123456, 0.0, 1.0) == 0.1235
    assert rounded(1.99996, 0.0, 1.99997) == 1.99997
    assert rounded(1.00004, 1.00003, 2.0) == 1.00003
