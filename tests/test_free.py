import re
from dataclasses import fields

import numpy as np
import pytest

import mjhill
from mjhill.identification.free import DEVIATIONS, Free, free_parameters, joint_at, value_of
from mjhill.joints.reader import parameter_file

POSITIVE = Free(("muscles", "puller", "max_velocity"), 2.0, 8.0)
SIGNED = Free(("postures", "puller"), -1.0, 3.0)
VALUE, BOUNDS = r"value = [-+.e\d]+", r"bounds = \[.*?\]"  # in the parameter file


@pytest.mark.parametrize("free", [POSITIVE, SIGNED])
def test_a_value_and_its_deviation_invert_each_other(free):
    for deviation in np.linspace(-DEVIATIONS, DEVIATIONS, 9):
        assert free.deviation(free.value(deviation)) == pytest.approx(deviation, abs=1e-12)
    for value in np.linspace(free.low, free.high, 9):
        assert free.value(free.deviation(value)) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("free", [POSITIVE, SIGNED, Free(("damping",), 0.0, 1.0)])
def test_two_deviations_reach_the_bounds_and_no_more_pass_them(free):
    for far in (DEVIATIONS, DEVIATIONS + 1e-9, 50.0):
        assert free.value(far) == pytest.approx(free.high, rel=1e-12)
        assert free.value(-far) == pytest.approx(free.low, rel=1e-12)
        assert free.low <= free.value(-far) < free.value(far) <= free.high


def test_the_middle_is_geometric_where_both_bounds_are_positive():
    assert POSITIVE.value(0.0) == pytest.approx(4.0)
    assert POSITIVE.value(1.0) / POSITIVE.value(0.0) == pytest.approx(
        POSITIVE.value(0.0) / POSITIVE.value(-1.0)
    )


def test_the_middle_is_arithmetic_where_a_bound_is_not_positive():
    assert SIGNED.value(0.0) == 1.0
    assert Free(("damping",), 0.0, 1.0).value(0.0) == 0.5


def test_names_leave_out_that_a_muscle_is_one():
    names = [free.name for free in free_parameters("elbow")]
    assert {"damping", "passive.k1_pos", "postures.elbow_flexor"} <= set(names)
    assert "elbow_flexor.max_velocity" in names
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_every_shipped_value_lies_inside_its_bounds(name):
    for free in free_parameters(name):
        assert free.low <= value_of(mjhill.JOINTS[name], free) <= free.high, free.name


def leaves(joint):
    """Every number of a joint by its path in the parameter file."""
    found = {}
    parts = {(): joint, ("passive",): joint.passive}
    parts |= {("muscles", name): muscle for name, muscle in joint.muscles.items()}
    for path, part in parts.items():
        for field in fields(part):
            value = getattr(part, field.name)
            if isinstance(value, float):
                found[*path, field.name] = value
    return found | {("postures", name): value for name, value in joint.postures.items()}


@pytest.mark.parametrize(
    "path",
    [
        ("damping",),
        ("passive", "k2_neg"),
        ("postures", "elbow_extensor"),
        ("muscles", "elbow_flexor", "max_velocity"),
    ],
)
def test_exactly_the_free_parameter_is_set(elbow, path):
    (free,) = (free for free in free_parameters("elbow") if free.path == path)
    before, after = leaves(elbow), leaves(joint_at(elbow, [free], np.array([0.7])))
    assert after.pop(path) == free.value(0.7) != before.pop(path)
    assert after == before


def test_all_free_parameters_are_set_at_once(elbow):
    free = free_parameters("elbow")
    deviations = np.linspace(-1.9, 1.9, len(free))
    changed = joint_at(elbow, free, deviations)
    for item, deviation in zip(free, deviations, strict=True):
        assert value_of(changed, item) == item.value(deviation)
    assert changed.gears == elbow.gears
    assert changed.inertia == elbow.inertia


def test_an_unknown_joint_lists_the_known_ones():
    with pytest.raises(ValueError, match="unknown joint 'wing'; there are: elbow, wrist"):
        free_parameters("wing")


def changed_file(tmp_path, entry, old, new):
    """A copy of the shipped file with one entry of the elbow changed."""
    lines = parameter_file().read_text(encoding="utf-8").splitlines()
    index = next(i for i, line in enumerate(lines) if line.startswith(f"{entry} = "))
    lines[index], count = re.subn(old, new, lines[index])
    assert count == 1
    path = tmp_path / "joints.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("entry", "old", "new", "message"),
    [
        ("damping", BOUNDS, "bounds = [0.9, 0.1]", "elbow: damping must have ascending bounds"),
        ("damping", VALUE, "value = 70", r"elbow: damping must .* about its value 70, got \["),
        ("damping", BOUNDS, "bounds = [0.5, 0.5]", "elbow: damping must have ascending bounds"),
        ("damping", BOUNDS, "bounds = [0.05]", "elbow: damping: bounds must be two numbers"),
        ("damping", BOUNDS, 'bounds = [0.05, "x"]', "elbow: damping: bounds must be a number"),
        (
            "gear",
            r"-1\.0",
            "{value = -1.0, bounds = [-2.0, -0.5], source = ''}",
            "cannot be fitted",
        ),
    ],
)
def test_bounds_out_of_order_are_refused_by_name(tmp_path, entry, old, new, message):
    with pytest.raises(ValueError, match=message):
        free_parameters("elbow", changed_file(tmp_path, entry, old, new))


def test_a_joint_without_bounds_has_nothing_to_fit(tmp_path):
    text = parameter_file().read_text(encoding="utf-8")
    path = tmp_path / "joints.toml"
    path.write_text(re.sub(r"bounds = \[.*?\], ", "", text), encoding="utf-8")
    with pytest.raises(ValueError, match="hip: no parameter has bounds, so there is none to fit"):
        free_parameters("hip", path)
