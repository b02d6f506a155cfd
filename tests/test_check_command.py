import json

import mujoco
import pytest
from click.testing import CliRunner
from test_tendons import arm

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
