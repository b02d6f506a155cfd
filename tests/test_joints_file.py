"""Files of parameters, read and refused."""

import re

import pytest

import mjhill
from mjhill.joints import parameter_file, read_joints


@pytest.fixture
def hip_text():
    """The hip's part of the shipped file."""
    text = parameter_file().read_text(encoding="utf-8")
    return text[text.index("[hip]") : text.index("[head]")]


def write(tmp_path, text):
    path = tmp_path / "joints.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_shipped_file_holds_the_shipped_joints():
    assert read_joints() == read_joints(parameter_file()) == dict(mjhill.JOINTS)


def test_a_file_may_hold_one_joint(tmp_path, hip_text):
    assert read_joints(write(tmp_path, hip_text)) == {"hip": mjhill.JOINTS["hip"]}


def test_a_bare_number_needs_no_source(tmp_path, hip_text):
    path = write(tmp_path, re.sub(r"\ninertia = .*", "\ninertia = 2.5", hip_text))
    assert read_joints(path)["hip"].inertia == 2.5


ENTRY = '= { value = 1.0, source = "" }'
REFUSED = {  # entry: what its line becomes, and what is said of it
    "not TOML": ("inertia", "inertia = {", "not a parameter file: .*line "),
    "no entry": ("inertia", "", "hip: inertia is missing"),
    "no entry of a muscle": ("hill_shape", "", r"hip.muscles.hip_flexor: hill_shape is missing"),
    "no gear": ("gear", "", r"hip.muscles.hip_flexor: gear is missing"),
    "gear in words": ("gear", 'gear = "up"', r"hip_flexor: gear must be a number, got 'up'"),
    "unknown": (
        "damping",
        f"dampening {ENTRY}",
        "hip: unknown entry 'dampening'; there are: .*dam",
    ),
    "unknown, of a muscle": (
        "hill_shape",
        f"hil_shape {ENTRY}",
        "hip.muscles.hip_flexor: unknown entry 'hil_shape'; there are: max_isometric_force",
    ),
    "negative": (
        "inertia",
        'inertia = { value = -1.0, source = "" }',
        r"hip: inertia must be in \(0, 10000\] kg·m², got -1.0",
    ),
    "negative, of a muscle": (
        "max_velocity",
        "max_velocity = -1.0",
        r"hip.muscles.hip_flexor: max_velocity must be in .* rad/s or m/s, got -1.0",
    ),
    "negative, passive": ("k2_pos", "k2_pos = -1.0", r"hip.passive: k2_pos must be in"),
    "in words": ("inertia", 'inertia = "much"', "hip: inertia must be a number, got 'much'"),
    "no value": (
        "damping",
        'damping = { bounds = [0.1, 1.0], source = "" }',
        "hip: damping must be a number, got {'bounds'",
    ),
    "no source": ("inertia", "inertia = { value = 1.0 }", "hip: inertia has no source"),
    "one bound": (
        "damping",
        'damping = { value = 1.0, bounds = [1.0], source = "" }',
        r"hip: damping: bounds must be two numbers, \[low, high\], got \[1.0\]",
    ),
    "range of one": ("range", "range = [1.0]", r"hip: range must be two numbers"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_an_entry_out_of_order_is_refused_with_its_table_and_name(tmp_path, hip_text, case):
    entry, line, message = REFUSED[case]
    text, count = re.subn(rf"\n{entry} = .*", f"\n{line}", hip_text, count=1)
    assert count == 1
    path = write(tmp_path, text)
    with pytest.raises(ValueError, match=message) as caught:
        read_joints(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_joint_without_muscles_and_what_is_no_table_are_refused(tmp_path, hip_text):
    for text, message in (
        (hip_text[: hip_text.index("[hip.muscles.")], "hip: muscles is missing"),
        ("hip = 1", "hip: must be a table, got 1"),
        (hip_text.replace("[hip.passive]", "[hip.elastic]"), "hip: passive is missing"),
        (hip_text + "\n[hip.postures]\nwing = 1.0", "hip: postures must name the muscles"),
    ):
        with pytest.raises(ValueError, match=message):
            read_joints(write(tmp_path, text))


def test_a_file_that_is_not_there_says_so(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"joints\.toml"):
        read_joints(tmp_path / "joints.toml")
