import functools

import numpy as np
import pytest
from click.testing import CliRunner

from mjhill.bench import sweep
from mjhill.bench.sweep.cases import KINDS, draw
from mjhill.cli import main

COUNT = 100
# MuJoCo's own step of the plant sets a floor, which counts where it is more than the limit
FLOOR = 1.5


@functools.cache
def outcomes(kind, integrators=("implicitfast", "RK4")):
    timesteps = (1e-3, 2e-3, 5e-3)
    return sweep.sweep((kind,), COUNT, integrators, timesteps, processes=1)


def errors(kind, integrator, timestep):
    """Errors [%] of steady systems without a severe finding, each less what the floor allows."""
    found = [
        o
        for o in outcomes(kind)
        if (o.integrator, o.timestep) == (integrator, timestep)
        and o.amplification <= sweep.SENSITIVE
        and not o.severe
    ]
    assert len(found) > 0.4 * COUNT
    return np.array([o.error for o in found]), np.array([o.floor or 0.0 for o in found])


def spread(error):
    return tuple(np.quantile(error, share, method="higher") for share in (0.5, 0.99, 1.0))


def check(kind, integrator, timestep, most):
    error, floor = errors(kind, integrator, timestep)
    allowed = np.maximum(most, FLOOR * floor)
    assert np.all(error <= allowed), (error[error > allowed], floor[error > allowed])


# kinds of a file are run by one worker of pytest-xdist only if they share a group; each has its own
@pytest.mark.parametrize("kind", ["physiological", "slide", "several"])
def test_random_systems_are_right_at_1_and_5_ms(kind):
    check(kind, "implicitfast", 1e-3, 2.0)
    check(kind, "implicitfast", 5e-3, 8.0)
    if kind == "physiological":
        error, floor = errors(kind, "implicitfast", 1e-3)
        assert spread(error)[0] <= 0.4  # the median of this sweep before the scheme was mended
        _, most, all_ = spread(errors(kind, "RK4", 1e-3)[0])
        assert most <= 0.5
        assert all_ <= 1.0


def test_muscles_on_spatial_tendons_are_right_at_2_ms():
    check("spatial", "implicitfast", 2e-3, 2.0)


def test_prescribed_stretch_gives_the_force_of_the_reference():
    for timestep, most in ((1e-3, 1.5), (2e-3, 3.0), (5e-3, 10.0)):
        error, _ = errors("stretch", "implicitfast", timestep)
        assert error.max() <= most


@pytest.mark.parametrize("kind", ["physiological", "wide", "slide", "several", "spatial"])
def test_no_system_is_off_by_5_percent_without_a_finding(kind):
    missed = [o for o in outcomes(kind) if sweep.is_missed(o)]
    assert not missed


def test_a_finding_names_the_joint_the_quantity_and_a_timestep_that_does():
    severe = [o for o in outcomes("physiological") if o.severe]
    assert severe
    for outcome in severe:
        assert "natural frequency [rad/s] times timestep is" in outcome.finding
        assert "set model.opt.timestep to" in outcome.finding


def test_a_case_is_always_the_same():
    first, second = (draw("wide", 7) for _ in range(2))
    assert first.system.muscles == second.system.muscles
    assert first.start == second.start
    assert draw("wide", 8).system.muscles != first.system.muscles


def test_a_case_is_replayed_to_the_same_bits():
    [before] = [
        o
        for o in outcomes("physiological")
        if (o.case, o.integrator, o.timestep) == ("physiological:3", "RK4", 1e-3)
    ]
    [again] = sweep.replay("physiological:3", ("RK4",), (1e-3,))
    assert again == before


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
