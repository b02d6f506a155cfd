"""The parameter file is what the fit to the literature gives, and how well that agrees."""

import itertools
import re
import tomllib

import numpy as np
import pytest

import mjhill
from mjhill.identification.fit import Estimate, Identified
from mjhill.identification.free import free_parameters, value_of
from mjhill.identification.literature_fit import from_literature, published_rows, step_rows
from mjhill.identification.report import parameter_text, rounded, write_parameters
from mjhill.joints.reader import parameter_file, read_joints

# what the joints as a whole do not reach
OUTSIDE = {
    ("elbow", "passive torque at 30° [N·m]"),
    ("wrist", "passive torque at 45° [N·m]"),
    ("wrist", "full effort of wrist_flexor ends at [°]"),
    ("wrist", "full effort of wrist_extensor ends at [°]"),
    ("wrist_rotation", "full effort of pronator ends at [°]"),
    ("wrist_rotation", "full effort of supinator ends at [°]"),
    ("knee", "passive torque at 10° [N·m]"),
    ("knee", "full effort of knee_flexor ends at [°]"),
    ("knee", "full effort of knee_extensor ends at [°]"),
    ("ankle", "full effort of ankle_dorsiflexor ends at [°]"),
    ("ankle", "full effort of ankle_plantarflexor ends at [°]"),
    ("hip", "passive torque at -20° [N·m]"),
    ("hip", "full effort of hip_extensor ends at [°]"),
}
BY_COST = ("knee", "ankle", "head", "wrist", "wrist_rotation", "eye", "hip")


def shipped(name):
    """The shipped joint, as if it had just been fitted."""
    joint, free = mjhill.JOINTS[name], free_parameters(name)
    values = [value_of(joint, item) for item in free]
    estimates = [
        Estimate(item.name, value, value, value, (item.low, item.high), 1.0, False)
        for item, value in zip(free, values, strict=True)
    ]
    return Identified(joint, tuple(free), tuple(estimates))


# --- the fit


def test_every_joint_but_the_elbow_is_fitted_here():
    # the elbow is in test_readme, which has its fit at hand
    assert {*BY_COST, "elbow"} == set(mjhill.JOINTS)


@pytest.mark.parametrize("name", BY_COST)
def test_the_fit_gives_the_shipped_values_again(name):
    shares = []
    result = from_literature(name, progress=shares.append)
    for free, estimate in zip(result.free, result.estimates, strict=True):
        # the file keeps four digits, and processors differ in the last bits of a run
        assert estimate.value == pytest.approx(value_of(mjhill.JOINTS[name], free), rel=2e-3)
        assert value_of(result.joint, free) == estimate.value
        assert free.low <= estimate.low <= estimate.value <= estimate.high <= free.high
    assert all(0 < a < b < 1 for a, b in itertools.pairwise(shares))


def test_the_fit_does_not_look_at_the_values_in_the_file(tmp_path):
    text = parameter_file().read_text(encoding="utf-8")
    hip = tomllib.loads(text)["hip"]
    low, high = hip["stiffness"]["bounds"]
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
    assert from_literature("hip", path).estimates == from_literature("hip").estimates


def test_a_joint_on_which_nothing_is_published_is_refused(tmp_path):
    text = parameter_file().read_text(encoding="utf-8").replace("[hip", "[wing")
    path = tmp_path / "joints.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="nothing published on 'wing' comes with mjhill"):
        from_literature("wing", path)


# --- how the shipped joints agree


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_steps_agree_with_table_2(name):
    rows = step_rows(mjhill.JOINTS[name])
    assert bool(rows) == (name != "hip")
    for row in rows:
        assert abs(row["off [%]"]) < 5, row["movement"]
        assert abs(row["T1 + T2 off [%]"]) < 20, row["movement"]
        sums = row["our T1 [ms]"] + row["our T2 [ms]"], row["T1 [ms]"] + row["T2 [ms]"]
        assert 100 * (sums[0] / sums[1] - 1) == pytest.approx(row["T1 + T2 off [%]"])


def test_nothing_but_what_is_listed_lies_outside_published_torques_and_ranges():
    rows = [row for joint in mjhill.JOINTS.values() for row in published_rows(joint)]
    assert {(row["joint"], row["quantity"]) for row in rows if row["outside by"]} == OUTSIDE


def test_outside_by_is_the_distance_to_the_nearer_end():
    for row in (row for joint in mjhill.JOINTS.values() for row in published_rows(joint)):
        nearest = np.clip(row["ours"], row["low"], row["high"])
        assert (row["outside by"] or 0.0) == pytest.approx(abs(row["ours"] - nearest), abs=1e-12)


# --- the file


def test_shipped_values_leave_the_file_as_it_is_to_the_byte():
    text = parameter_file().read_text(encoding="utf-8")
    assert parameter_text([shipped(name) for name in mjhill.JOINTS]) == text


def test_only_the_numbers_that_were_fitted_change(tmp_path):
    result = shipped("hip")
    moved = [
        Estimate(e.name, sum(e.bounds) / 2, 0.0, 0.0, e.bounds, 1.0, False)
        for e in result.estimates
    ]
    path = tmp_path / "fitted.toml"
    write_parameters(path, [Identified(result.joint, result.free, tuple(moved))])
    before = parameter_file().read_text(encoding="utf-8").splitlines()
    after = path.read_text(encoding="utf-8").splitlines()
    changed = [(old, new) for old, new in zip(before, after, strict=True) if old != new]
    number = re.compile(r"value = [-+.e\d]+")
    assert len(changed) == len(moved)
    assert all(number.sub("", old) == number.sub("", new) for old, new in changed)
    joint = read_joints(path)["hip"]
    for free, estimate in zip(result.free, moved, strict=True):
        assert value_of(joint, free) == pytest.approx(estimate.value, rel=5e-4)  # four digits
    assert not list(tmp_path.glob(".*"))


def test_a_rounded_value_keeps_four_digits_and_its_bounds():
    assert rounded(0.123456, 0.0, 1.0) == 0.1235
    assert rounded(1.99996, 0.0, 1.99997) == 1.99997
    assert rounded(1.00004, 1.00003, 2.0) == 1.00003
