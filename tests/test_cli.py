import json
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

import mjhill
from mjhill.cli import main
from mjhill.cli.printing import print_table


def invoke(*arguments):
    return CliRunner().invoke(main, list(arguments))


def test_list_names_every_joint():
    rows = json.loads(invoke("list", "--json").stdout)
    assert [row["joint"] for row in rows] == list(mjhill.JOINTS)


def test_the_head_of_a_table_shows_its_units(capsys):
    print_table([{"time [s]": 0.25, "of": "[b]"}], False, title="Times")
    printed = capsys.readouterr().out
    assert "time [s]" in printed
    assert "[b]" in printed


def test_info_gives_value_unit_and_source_of_every_parameter():
    rows = json.loads(invoke("info", "elbow", "--json").stdout)
    by_name = {(row["of"], row["parameter"]): row for row in rows}
    row = by_name["elbow_flexor", "max_isometric_force"]
    assert (row["value"], row["unit"]) == (
        mjhill.JOINTS["elbow"].muscles["elbow_flexor"].max_isometric_force,
        "N·m",
    )
    assert all(row["source"] for row in rows)
    assert "max_isometric_force" in invoke("info", "elbow").stdout


def test_info_reads_a_file_too():
    rows = json.loads(invoke("info", str(mjhill.model_path("elbow")), "--json").stdout)
    assert {row["of"] for row in rows} == {"elbow", "elbow_flexor", "elbow_extensor"}


def test_info_prints_mjcf_that_makes_the_same_muscles(tmp_path):
    import mujoco

    lines = invoke("info", "elbow", "--mjcf").stdout
    joint, actuators = lines.split("\n", 1)
    joint = joint.replace("/>", ' axis="0 1 0"/>')
    actuators = actuators.replace("<general ", '<general joint="elbow" ')
    xml = (
        f'<mujoco><compiler angle="radian"/><worldbody><body>{joint}<geom size="0.1"/></body>'
        f"</worldbody><actuator>{actuators}</actuator></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(xml)
    mjhill.check_model(model)
    joint = mjhill.JOINTS["elbow"]
    for name, muscle in joint.muscles.items():
        assert mjhill.read_muscle(model, name) == muscle
    assert mjhill.read_passive(model, "elbow") == joint.passive


def test_run_writes_a_recording_and_says_where(tmp_path):
    path = tmp_path / "run.csv"
    result = invoke(
        "run", "elbow", "-e", "elbow_flexor=0.3", "-e", "elbow_flexor=0.5@0.1:0.2",
        "-t", "elbow=1@0.05", "-d", "0.3", "-o", str(path), "--json",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["files"]["recording"] == str(path)
    recording = mjhill.Recording.load(path)
    u = recording["elbow_flexor.u"]
    assert u[50] == 0.3
    assert u[150] == pytest.approx(0.8)
    np.testing.assert_array_equal(recording["elbow.applied"][100:], 1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "wing"), "unknown model 'wing': no file of that name, and the joints are: elbow"),
        (("run", "elbow", "-e", "elbow_flexor"), "must read NAME=LEVEL"),
        (("run", "elbow", "-e", "elbow_flexor=0.5@0.3:0.1"), "must read NAME=LEVEL"),
        (("run", "elbow", "-e", "biceps=0.5"), "unknown actuator 'biceps'"),
        (("run", "elbow", "-d", "-1"), "duration must be positive, got -1.0 s"),
        (("run", "elbow", "-o", "run.txt"), "recording 'run.txt' must end in .csv or .npz"),
        (("video", "elbow", "-o", "film.avi"), "video 'film.avi' must end in .mp4 or .gif"),
        (("bench", "everything"), "unknown benchmark 'everything'; there are: accuracy"),
    ],
)
def test_a_wrong_input_ends_in_one_line_and_exit_code_2(arguments, message):
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert result.stderr.count("error:") == 1


def test_a_place_that_cannot_be_written_ends_in_exit_code_1_before_the_run(tmp_path):
    result = invoke("run", "elbow", "-o", str(tmp_path / "no" / "run.csv"))
    assert result.exit_code == 1
    assert "the folder" in result.stderr
    assert "does not exist" in result.stderr


def test_the_module_runs_as_a_program():
    run = subprocess.run(
        [sys.executable, "-m", "mjhill", "--version"], capture_output=True, text=True, check=True
    )
    assert mjhill.__version__ in run.stdout


@pytest.mark.parametrize("command", [None, *main.commands])
def test_every_command_explains_itself(command):
    run = CliRunner().invoke(main, [command, "--help"] if command else ["--help"])
    assert run.exit_code == 0, run.output
    assert run.output.startswith("Usage:")
