"""What reaches the terminal: no control characters, no markup, in any encoding."""

import json
import os
import subprocess
import sys

import mujoco
import pytest
from click.testing import CliRunner

import mjhill
from mjhill.cli import main
from mjhill.cli.printing import plain, print_table

HOSTILE = "\x1b[31mred\x07 [bold]x[/bold] :smile: a&\"<b>'\u202eabc\x9b2J"
VISIBLE = r"""\x1b[31mred\x07 [bold]x[/bold] :smile: a&"<b>'\u202eabc\x9b2J"""


@pytest.fixture
def hostile_model(pair, elbow, tmp_path):
    """A file of an elbow with a hostile name for the joint and for one muscle."""
    spec = mujoco.MjSpec()
    spec.modelname = HOSTILE
    body = spec.worldbody.add_body()
    body.add_geom(size=[0.1, 0, 0])
    body.add_joint(name=HOSTILE, axis=[0, 1, 0])
    muscle = elbow.muscles["elbow_flexor"]
    mjhill.add_passive(spec, joint=HOSTILE, passive=elbow.passive)
    mjhill.add_muscle(spec, name=HOSTILE, muscle=muscle, joint=HOSTILE, gear=-1)
    path = tmp_path / "hostile.mjb"  # a binary model may hold any name
    mujoco.mj_saveModel(spec.compile(), str(path), None)
    return path


def invoke(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def is_harmless(text):
    return all(letter.isprintable() or letter == "\n" for letter in text)


def test_plain_text_is_one_line_without_control_characters():
    assert plain(HOSTILE) == VISIBLE
    assert plain("one\r\ntwo\u2028three") == "one two three"
    assert plain("N·m ² θ, 日本, é") == "N·m ² θ, 日本, é"


def test_a_table_takes_markup_as_text(capsys):
    print_table([{HOSTILE: HOSTILE}], False, title=HOSTILE)
    printed = capsys.readouterr().out
    assert is_harmless(printed)
    assert printed.count(VISIBLE) == 3


@pytest.mark.parametrize(
    "command",
    [
        ("info",),
        ("info", "--json"),
        ("info", "--mjcf"),
        ("run", "-d", "0.01", "-e", f"{HOSTILE}=0.5", "-o", "run.csv"),
        ("run", "-d", "0.01", "-e", f"{HOSTILE}=0.5", "-o", "run.csv", "--json"),
        ("run", "-d", "0.01", "-e", "other=0.5", "-o", "run.csv"),
    ],
)
def test_a_hostile_name_reaches_no_terminal(hostile_model, command):
    result = invoke(command[0], hostile_model, *command[1:])
    assert is_harmless(result.stdout)
    assert is_harmless(result.stderr)
    assert "x1b" in result.output or "&#27;" in result.output or "u001b" in result.output


def test_json_holds_a_hostile_name_without_loss(hostile_model):
    rows = json.loads(invoke("info", hostile_model, "--json").stdout)
    assert {row["of"] for row in rows} == {HOSTILE}


def test_mjcf_of_a_hostile_name_loads_again_under_that_name(hostile_model):
    joint, actuators = invoke("info", hostile_model, "--mjcf").stdout.split("\n", 1)
    target = joint[joint.index('"') : joint.index('" ') + 1]
    actuators = actuators.replace("<general ", f"<general joint={target} ")
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body>{joint}<geom size="0.1"/></body></worldbody>'
        f"<actuator>{actuators}</actuator></mujoco>"
    )
    assert (model.joint(0).name, model.actuator(0).name) == (HOSTILE, HOSTILE)
    mjhill.check_model(model)


@pytest.mark.parametrize("command", ["list", "info eye"])
def test_a_terminal_of_ascii_or_latin_letters_shows_everything(command):
    for encoding, unit in (("ascii", "kg.m^2"), ("latin-1", "kg·m²")):
        run = subprocess.run(
            [sys.executable, "-m", "mjhill", *command.split()],
            env={**os.environ, "PYTHONIOENCODING": encoding},
            capture_output=True,
            check=True,
        )
        assert unit in run.stdout.decode(encoding)
        assert run.stderr == b""


def test_json_is_the_same_on_a_terminal_of_ascii_letters():
    rows = []
    for encoding in ("ascii", "utf-8"):
        run = subprocess.run(
            [sys.executable, "-m", "mjhill", "list", "--json"],
            env={**os.environ, "PYTHONIOENCODING": encoding},
            capture_output=True,
            check=True,
        )
        rows.append(json.loads(run.stdout.decode(encoding)))
    assert rows[0] == rows[1]
