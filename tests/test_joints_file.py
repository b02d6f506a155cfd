"""Files of parameters, read and refused."""

import json
import os
import re

import pytest

import mjhill
from mjhill.joints.reader import parameter_file, read_joints


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
    "range reversed": (
        "range",
        "range = [1.0, -1.0]",
        r"hip: range must be two ascending angles in \[-10, 10\] rad, .* got \[1.0, -1.0\]",
    ),
    "range in degrees": ("range", "range = [0, 120]", r"hip: range must be .* got \[0, 120\]"),
    "range not a number": ("range", "range = [nan, 1.0]", "hip: range must be a finite number"),
    "bounds reversed": (
        "damping",
        'damping = { value = 1.0, bounds = [2.0, 0.5], source = "" }',
        r"hip: damping must have ascending bounds, got \[2.0, 0.5\]",
    ),
    "gear not a number": (
        "gear",
        "gear = nan",
        "hip_flexor: gear must be a finite number, got nan",
    ),
    "gear infinite": ("gear", "gear = inf", "hip_flexor: gear must be a finite number, got inf"),
    "gear true": ("gear", "gear = true", "hip_flexor: gear must be a number, got True"),
    "gear of nothing": (
        "gear",
        "gear = 0.0",
        "hip_flexor: gear must be 1e-06 to 1e.06 or .* got 0.0",
    ),
    "home not a number": ("home_angle", "home_angle = nan", "hip: home_angle must be a finite"),
    "home in degrees": ("home_angle", "home_angle = 40", r"home_angle must be in \[-10, 10\] rad"),
    "infinite": ("inertia", "inertia = inf", "hip: inertia must be a finite number, got inf"),
    "true": ("inertia", "inertia = true", "hip: inertia must be a number, got True"),
    "400 digits": (
        "inertia",
        f"inertia = {'9' * 400}",
        r"hip: inertia must be a finite number, got 99+\.\.\.9+; correct it",
    ),
    "5000 digits": ("inertia", f"inertia = {'9' * 5000}", "not a parameter file: "),
    "5000 hexadecimal digits": (
        "inertia",
        f"inertia = 0x{'f' * 5000}",
        "inertia must be a finite number, got a number of thousands of digits",
    ),
    "positive is a number": ("positive", "positive = 5", "hip: positive must be text .* got 5"),
    "positive in colour": (
        "positive",
        r'positive = "\u001B[31mred"',
        r"hip: positive must be text .*x1b\[31mred",
    ),
    "stimulation is a number": (
        "hill_shape",
        "hill_shape = 0.3\nelectrical_stimulation = 2",
        "hip_flexor: electrical_stimulation must be true or false, got 2",
    ),
    "source is a number": (
        "inertia",
        "inertia = { value = 1.0, source = 5 }",
        "hip: inertia: source must be text, got 5",
    ),
    "key misspelt": (
        "damping",
        'damping = { value = 1.0, bonds = [0.5, 2.0], source = "" }',
        "hip: damping: unknown key 'bonds'; there are: value, source, bounds",
    ),
    "what is made here": ("inertia", "inertia = 1.0\nsources = 1", "hip: unknown entry 'sources'"),
    "nested deeply": ("inertia", f"inertia = {'[' * 5000}", "nested too deeply"),
    "nested": ("inertia", f"inertia = {'[' * 50}{']' * 50}", r"inertia must be a number, got \[\["),
}


@pytest.mark.parametrize("case", REFUSED)
def test_an_entry_out_of_order_is_refused_with_its_table_and_name(tmp_path, hip_text, case):
    entry, line, message = REFUSED[case]
    text, count = re.subn(rf"\n{entry} = .*", lambda _: f"\n{line}", hip_text, count=1)
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


@pytest.mark.parametrize(
    "name", ["../trav", "/tmp/x", "a b", "", "-x", "a.b", "a/b", "\x1b[31mred", "é", "x" * 65]
)
def test_a_name_that_is_no_plain_word_is_refused(tmp_path, hip_text, name):
    quoted = json.dumps(name)  # which is a TOML key too
    for text, what in (
        (hip_text.replace("[hip", f"[{quoted}"), "joint "),
        (hip_text.replace("hip_flexor", quoted), "hip.muscles: muscle "),
    ):
        with pytest.raises(ValueError, match="a name must be 1 to 64 letters") as caught:
            read_joints(write(tmp_path, text))
        message = str(caught.value)
        assert message.startswith(f"{tmp_path / 'joints.toml'}: {what}")
        assert message.isprintable()


def test_files_that_are_no_text_are_refused(tmp_path, hip_text):
    path = tmp_path / "joints.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match="not a parameter file: .*utf-8"):
        read_joints(path)
    path.write_text(hip_text + "#" * 1_000_000, encoding="utf-8")
    with pytest.raises(ValueError, match=r"it has 1,0.* bytes, and at most 1,000,000 are read"):
        read_joints(path)
    path.unlink()
    os.mkfifo(path)  # which would wait for a writer
    with pytest.raises(ValueError, match="it is no plain file"):
        read_joints(path)


def test_a_file_that_is_not_there_says_so(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"joints\.toml"):
        read_joints(tmp_path / "joints.toml")
