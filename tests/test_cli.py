import json
import re
import subprocess
import sys
from pathlib import Path

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
        (("run", "elbow", "-e", "elbow_flexor"), "must be NAME=VALUE"),
        (("run", "elbow", "-e", "elbow_flexor=0.5@0.3:0.1"), "must be NAME=VALUE"),
        (("run", "elbow", "-e", "biceps=0.5"), "unknown actuator 'biceps'"),
        (("run", "elbow", "-d", "-1"), "duration must be positive, got -1.0 s"),
        (("run", "elbow", "-d", "nan"), "duration must be positive, got nan s"),
        (("run", "elbow", "-d", "inf"), "duration must be positive, got inf s"),
        (("run", "elbow", "-d", "1e12"), "is 1e+15 steps of 0.001 s, and its recording takes"),
        (("run", "elbow", "-d", "1e12"), "at most 10,000,000 steps and 4 GB are allowed"),
        (("video", "elbow", "-d", "1e12"), "at most 1,000,000 are allowed: lower --duration"),
        (("video", "elbow", "--fps", "1e9"), "has 4e+09 frames"),
        (("run", "elbow", "-e", "elbow_flexor=2"), "'elbow_flexor' must be 0 to 1, got 2 at 0 s"),
        (("run", "elbow", "-e", "elbow_flexor=-0.1@0.5:1"), "must be 0 to 1, got -0.1 at 0.5 s"),
        (
            ("run", "elbow", "-e", "elbow_flexor=0.7", "-e", "elbow_flexor=0.7@1"),
            "must be 0 to 1, got 1.4 at 1 s; lower it, or the sum",
        ),
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


def every_command(group=main, path=()):
    """The arguments that lead to each command, also to those of groups within groups."""
    yield path
    for name, command in getattr(group, "commands", {}).items():
        yield from every_command(command, (*path, name))


@pytest.mark.parametrize("option", ["--help", "-h"])
@pytest.mark.parametrize("command", list(every_command()), ids="-".join)
def test_every_command_explains_itself(command, option):
    run = CliRunner().invoke(main, [*command, option])
    assert run.exit_code == 0, run.output
    assert run.stdout.startswith("Usage:")
    assert "--help" in run.stdout
    assert run.stderr == ""


def test_help_says_how_long_the_long_commands_take():
    for command in ("bench", "reproduce"):
        assert re.search(r"\d minutes\s+on\s+two\s+cores", invoke(command, "--help").stdout)


def test_outputs_are_named_after_the_command_and_what_is_replaced_is_said():
    small = ("--size", "320", "180")
    for command, name, more in (
        ("run", "run-elbow.csv", ()),
        ("video", "video-elbow.mp4", small),
    ):
        arguments = (command, "elbow", "-d", "0.05", *more)
        assert f"out/{name}\n" in invoke(*arguments).stdout
        assert f"out/{name} (replaced)\n" in invoke(*arguments).stdout
        assert json.loads(invoke(*arguments, "--json").stdout)["replaced"] == [f"out/{name}"]
    assert {path.name for path in Path("out").iterdir()} == {"run-elbow.csv", "video-elbow.mp4"}


def test_a_wrong_model_makes_no_folder():
    assert invoke("run", "wing").exit_code == 2
    assert not Path("out").exists()


def test_a_film_shows_a_torque():
    result = invoke("video", "elbow", "-d", "0.3", "-t", "elbow=-5", "--fps", "5", "--json")
    assert result.exit_code == 0, result.stderr
    numbers = json.loads(result.stdout)
    assert numbers["elbow lowest angle [°]"] < 70  # home is at 73
    assert Path(numbers["files"]["video"]).stat().st_size > 1000


def test_several_models_are_compared_into_a_folder_each():
    result = invoke("compare", "eye", "elbow", "--no-video", "--no-cost", "-o", "both", "--json")
    assert result.exit_code == 0, result.stderr
    both = json.loads(result.stdout)
    assert [item["model"] for item in both] == ["eye", "elbow"]
    for item in both:
        assert f"both/{item['model']}/comparison.json" in item["files"]
        assert all(Path(file).exists() for file in item["files"])


def test_models_that_cannot_be_compared_are_refused_before_the_first_is():
    for models, message in (
        (("elbow", "wing"), "unknown model 'wing'"),
        (("elbow", "elsewhere/elbow.xml"), "would both be written to both/elbow"),
    ):
        result = invoke("compare", *models, "-o", "both")
        assert result.exit_code == 2
        assert message in result.stderr
        assert not Path("both").exists()


def test_that_there_is_no_gravity_is_said():
    assert "no gravity" in invoke("list").stdout
    assert "Gravity: none" in invoke("info", "elbow").stdout
    Path("falling.xml").write_text(
        '<mujoco><include file="{}"/><option gravity="0 0 -9.81"/></mujoco>'.format(
            mjhill.model_path("elbow").with_name("elbow.xml")
        )
    )
    assert "Gravity: 0 0 -9.81 m/s²" in invoke("info", "falling.xml").stdout
    for joint in mjhill.JOINTS:
        readme = mjhill.model_path(joint).with_name("README.md")
        assert "no gravity" in readme.read_text(encoding="utf-8")
    assert "no gravity" in mjhill.load.__doc__


def test_inputs_that_add_up_to_one_are_taken():
    levels = ("-e", "elbow_flexor=0.7", "-e", "elbow_flexor=0.3@0.01", "-e", "elbow_flexor=-1@0.02")
    assert invoke("run", "elbow", "-d", "0.03", *levels).exit_code == 0


def test_a_benchmark_says_how_long_it_takes_and_which_goals_are_met(monkeypatch):
    monkeypatch.setattr("mjhill.benchmarks.threads.SIMULATIONS", 8)
    monkeypatch.setattr("mjhill.benchmarks.threads.ROUNDS", 3)
    result = invoke("bench", "threads")
    assert result.stderr == "threads: about 10 s on two cores\n"
    head = next(line for line in result.stdout.splitlines() if "goal" in line)
    assert head.index("goal") < head.index("speed") < head.index("met")
    one, two = json.loads(invoke("bench", "threads", "--json").stdout)["threads"]
    assert (one["goal"], one["met"]) == (None, None)
    assert two["met"] is (two["speed, 1 thread = 1"] >= 1.7)
