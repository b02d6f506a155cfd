import json

import pytest
from click.testing import CliRunner

import mjhill
from mjhill.benchmarks import fuzz
from mjhill.benchmarks.fuzz import outcomes as drawn_outcomes
from mjhill.benchmarks.fuzz.models import INTEGRATORS, KINDS, TIMESTEPS
from mjhill.cli import main
from mjhill.muscles.hill import Hill
from mjhill.quantity import quantities

COUNT = 1000


@pytest.fixture(scope="module")
def outcomes():
    return fuzz.fuzz(count=COUNT, processes=1)


def test_no_model_of_a_thousand_fails_in_silence(outcomes):
    assert [o for o in outcomes if o.verdict == "silent"] == []


def test_the_models_that_need_no_finding_are_many(outcomes):
    verdicts = [o.verdict for o in outcomes]
    assert verdicts.count("sound") > 0.4 * COUNT
    assert verdicts.count("predicted") > 0.1 * COUNT
    assert verdicts.count("plant") < 0.02 * COUNT


def test_activation_stays_inside_0_and_1_unless_it_starts_outside(outcomes):
    for outcome in outcomes:
        if not outcome.start.startswith("act"):
            assert "n or a outside" not in outcome.failures, outcome


def test_all_integrators_and_timesteps_are_drawn(outcomes):
    assert {o.integrator for o in outcomes} == {name.lower() for name in INTEGRATORS}
    timesteps = [o.timestep for o in outcomes]
    assert min(timesteps) < 1.1 * TIMESTEPS[0]
    assert max(timesteps) > 0.9 * TIMESTEPS[1]


def test_muscles_are_drawn_from_the_whole_of_their_ranges():
    drawn = [
        muscle
        for number in range(200)
        for kind in KINDS
        for muscle in mjhill.engine.layout.read_muscles(
            drawn_outcomes.draw(kind, number).model
        ).values()
    ]
    # no muscles of bonds: most would have rates out of bounds
    assert {type(muscle) for muscle in drawn} == {Hill, mjhill.HillRigid}
    for name, quantity in quantities(Hill):
        values = [getattr(muscle, name) for muscle in drawn if isinstance(muscle, Hill)]
        assert max(values) == quantity.high, name
        assert min(values) == quantity.low if quantity.low_allowed else min(values) < 1.01, name
    assert {muscle.electrical_stimulation for muscle in drawn} == {False, True}


def test_a_case_is_replayed_to_the_same_outcome(outcomes):
    failed = next(o for o in outcomes if o.failures)
    assert fuzz.replay(failed.case) == failed


def test_the_command_replays_a_case_and_refuses_what_it_does_not_know():
    run = CliRunner().invoke(main, ["bench", "fuzz", "--case", "hinge:3", "--json"])
    assert run.exit_code == 0, run.output
    assert json.loads(run.stdout)["fuzz"][0]["case"] == "hinge:3"
    run = CliRunner().invoke(main, ["bench", "fuzz", "--case", "hinge"])
    assert run.exit_code == 2
    assert "a case is named KIND:NUMBER, such as hinge:17" in run.output
    run = CliRunner().invoke(main, ["bench", "fuzz", "--kind", "ball", "--count", "1"])
    assert run.exit_code == 2
    assert f"unknown kind of model 'ball'; there are: {', '.join(KINDS)}" in run.output
    run = CliRunner().invoke(main, ["bench", "endurance", "--case", "hinge:3"])
    assert run.exit_code == 2
    assert "--case does not go with mjhill bench endurance" in run.output
