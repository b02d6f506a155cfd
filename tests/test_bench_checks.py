import pytest
from click.testing import CliRunner

from mjhill.benchmarks import checks
from mjhill.cli import main

COUNT = 15


@pytest.fixture(scope="module")
def verdicts():
    return checks.sides(COUNT, processes=1)


def test_sound_models_have_no_severe_finding(verdicts):
    sound = [v for v in verdicts if v.sound]
    assert len(sound) == COUNT
    assert [v for v in sound if v.severe] == []


def test_unsound_models_of_every_kind_have_a_severe_finding(verdicts):
    unsound = [v for v in verdicts if v.sound is False]
    assert len(unsound) == COUNT
    assert {v.case.partition(":")[0] for v in unsound} == {"step", "stiff", "sign"}
    assert [v for v in unsound if not v.severe] == []


def test_what_a_model_is_does_not_depend_on_the_check(verdicts, monkeypatch):
    unsound = next(v for v in verdicts if v.case.startswith("stiff"))
    monkeypatch.setattr(checks, "check_model", lambda model: ())
    with checks.installed(), checks.quiet():
        again = checks.judge(*split(unsound.case))
    assert (again.sound, again.reason) == (False, unsound.reason)
    assert again.findings == ()
    result = checks.table([again])
    assert any(f"mjhill bench checks --case {unsound.case}" in note for note in result.notes)


def test_the_command_replays_a_case(verdicts):
    case = verdicts[0].case
    run = CliRunner().invoke(main, ["bench", "checks", "--case", case])
    assert run.exit_code == 0, run.output
    assert f"{case}: sound" in run.output
    run = CliRunner().invoke(main, ["bench", "checks", "--case", "mass:1"])
    assert run.exit_code == 2
    assert "a case is named KIND:NUMBER with a kind of sound, step, stiff, sign" in run.output


def split(case: str) -> tuple[str, int]:
    kind, _, number = case.partition(":")
    return kind, int(number)
