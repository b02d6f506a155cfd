import numpy as np
import pytest
from click.testing import CliRunner

import mjhill
from mjhill.benchmarks import sweep
from mjhill.benchmarks.sweep import solutions
from mjhill.benchmarks.sweep.cases import DURATION, KINDS, draw
from mjhill.cli import main

COUNT = 100
TIMESTEPS = (1e-3, 2e-3, 5e-3)


def steady(outcomes, integrator, timestep):
    """Outcomes of systems that are neither sensitive nor have a severe finding."""
    found = [
        o
        for o in outcomes
        if (o.integrator, o.timestep) == (integrator, timestep)
        and o.amplification <= sweep.SENSITIVE
        and not o.severe
    ]
    assert len(found) > 0.4 * COUNT
    return found


def stretches_a_step(outcome):
    """How far a step moves the muscle at most, in units of its series element's stretch."""
    case = draw(outcome.kind, int(outcome.case.partition(":")[2]))
    (muscle,), (movement,) = case.system.muscles.values(), case.movement.values()
    speed = max(abs(movement.velocity(time)) for time in np.linspace(0, DURATION, 1001))
    return speed * outcome.timestep / muscle.series_stretch


def spread(outcomes):
    errors = [o.error for o in outcomes]
    return tuple(np.quantile(errors, share, method="higher") for share in (0.5, 0.99, 1.0))


def check(outcomes, integrator, timestep, most):
    for o in steady(outcomes, integrator, timestep):
        assert o.error <= max(most, sweep.FLOOR * (o.floor or 0.0)), o


@pytest.mark.parametrize("kind", KINDS)
def test_a_hundred_random_systems_are_right_or_have_a_finding(kind):
    outcomes = sweep.sweep((kind,), COUNT, ("implicitfast", "RK4"), TIMESTEPS, processes=1)
    assert not [o for o in outcomes if sweep.is_missed(o)]
    if kind in ("physiological", "slide", "several"):
        check(outcomes, "implicitfast", 1e-3, 2.0)
        check(outcomes, "implicitfast", 5e-3, 8.0)
    if kind == "physiological":
        # the median of these systems before the scheme was mended
        assert spread(steady(outcomes, "implicitfast", 1e-3))[0] <= 0.37
        _, most, all_ = spread(steady(outcomes, "RK4", 1e-3))
        assert most <= 0.5
        assert all_ <= 1.0
    if kind == "spatial":
        check(outcomes, "implicitfast", 2e-3, 2.0)
    if kind == "stretch":  # % of F_max
        for timestep, most in zip(TIMESTEPS, (1.5, 3.0, 10.0), strict=True):
            for o in steady(outcomes, "implicitfast", timestep):
                assert o.error <= most * max(1.0, stretches_a_step(o)), o


def test_the_yardstick_of_spatial_tendons_does_not_depend_on_its_timestep():
    case = draw("spatial", 3)
    with mjhill.installed():
        coarse, fine = (
            solutions.run(case, "RK4", timestep) for timestep in (solutions.FINE, 10e-6)
        )
    assert np.abs(coarse - fine).max() < 1e-5 * np.ptp(fine)


def test_a_finding_names_the_joint_the_quantity_and_a_timestep_that_does():
    [outcome] = sweep.replay("physiological:48", ("implicitfast",), (5e-3,))
    assert outcome.severe
    assert "joint 'eye': with its muscles at full force" in outcome.finding
    assert "set model.opt.timestep to" in outcome.finding


def test_a_case_is_always_the_same():
    first, second = (draw("wide", 7) for _ in range(2))
    assert first.system.muscles == second.system.muscles
    assert first.start == second.start
    assert draw("wide", 8).system.muscles != first.system.muscles


def test_a_case_is_replayed_to_the_same_bits():
    first, second = (sweep.replay("physiological:3", ("RK4",), (1e-3,)) for _ in range(2))
    assert first == second


def test_the_command_replays_a_case_and_refuses_what_it_does_not_know():
    run = CliRunner().invoke(main, ["bench", "sweep", "--case", "stretch:1", "--json"])
    assert run.exit_code == 0, run.output
    assert '"case": "stretch:1"' in run.output
    run = CliRunner().invoke(main, ["bench", "sweep", "--case", "stretch:x"])
    assert run.exit_code == 2
    assert "a case is named KIND:NUMBER" in run.output
    run = CliRunner().invoke(main, ["bench", "sweep", "--kind", "elastic", "--count", "1"])
    assert run.exit_code == 2
    assert f"unknown kind of system 'elastic'; there are: {', '.join(KINDS)}" in run.output
    run = CliRunner().invoke(main, ["bench", "accuracy", "--count", "3"])
    assert run.exit_code == 2


@pytest.mark.parametrize(("case", "timestep"), [("wide:79", 2e-3), ("slide:24", 1e-3)])
def test_a_swing_that_the_discrete_integrator_gets_wrong_has_a_finding(case, timestep):
    [outcome] = sweep.replay(case, ("discrete",), (timestep,))
    assert outcome.error > 5
    assert "it swings with little damping" in outcome.finding
    [outcome] = sweep.replay(case, ("implicitfast",), (timestep,))
    assert outcome.error < 5
    assert not outcome.finding
