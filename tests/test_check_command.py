import json
import subprocess
import sys

import mujoco
import pytest
from click.testing import CliRunner
from test_tendons import arm
from test_transients import slipping

import mjhill
from mjhill.cli import main


def check(*arguments):
    return CliRunner().invoke(main, ["check", *map(str, arguments)])


def saved(model, folder):
    path = folder / "model.mjb"
    mujoco.mj_saveModel(model, str(path))
    return path


@pytest.mark.parametrize("joint", mjhill.JOINTS)
def test_every_shipped_joint_is_in_order(joint):
    result = check(joint)
    assert result.exit_code == 0
    assert "no findings" in result.stdout
    assert "muscles: 2" in result.stdout


def test_severe_findings_end_in_exit_code_3_and_a_table_with_remedies(tmp_path):
    result = check(saved(arm("-2 2"), tmp_path))
    assert result.exit_code == 3
    assert "of these on tendons, paths swept: 1" in result.stdout
    assert "biceps" in result.stdout
    assert "stays on the geom" in " ".join(result.stdout.replace("│", " ").split())


def test_notes_alone_end_in_exit_code_0(pair, tmp_path):
    pair.opt.timestep = 1e-2
    result = check(saved(pair, tmp_path), "--json")
    assert result.exit_code == 0
    answer = json.loads(result.stdout)
    assert answer["looked_at"]["timestep [s]"] == "0.01"
    [finding] = answer["findings"]
    assert finding["severe"] is False
    assert finding["timestep"] < 1e-2


def test_a_model_that_is_refused_ends_in_exit_code_2(pair, tmp_path):
    pair.actuator_dynprm[1, 2] = -0.01
    result = check(saved(pair, tmp_path))
    assert result.exit_code == 2
    assert "muscle 'elbow_extensor': activation_tau must be in" in result.stderr


def test_run_says_in_one_line_what_no_muscle_can_do(tmp_path):
    model, _ = slipping()
    path = saved(model, tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "mjhill", "run", str(path), "-d", "0.3", "-e", "puller=0.1",
         "-t", "joint=30", "-o", "run.csv"],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    lines = done.stderr.splitlines()
    assert [line.partition(" at ")[0] for line in lines] == [
        "warning: muscle 'puller' did what no muscle can" for line in lines
    ]
    assert lines
    assert check(path).exit_code == 3  # predicted
