"""The study of intervals, in small: draws, coverage of a few fits, the command."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from mjhill.benchmarks import intervals
from mjhill.cli import main
from mjhill.identification.fit import DEVIATIONS


@pytest.fixture(scope="module")
def fits():
    """Every joint, kind of inputs and rate at least once."""
    jobs = (
        ("elbow", "pulses", 200, 1),
        ("wrist", "steps", 100, 2),
        ("knee", "chirps", 100, 1),
        ("head", "pulses", 100, 3),
        ("eye", "steps", 200, 3),
        ("elbow", "chirps", 200, 3),
    )
    return [intervals.fit(*job) for job in jobs]


def test_most_intervals_hold_the_truth(fits):
    (*_, row) = intervals.table(fits).rows
    assert row["joint"] == row["inputs"] == "all"
    assert row["fits"] == 6
    assert row["intervals"] == sum(len(one.truth) for one in fits)
    # of about 24; the whole study has the narrow goal
    assert row["hold the truth [%]"] >= 80
    assert row["from the data [%]"] > 30


def test_the_table_has_every_joint_kind_and_rate(fits):
    rows = {(row["joint"], row["inputs"]): row for row in intervals.table(fits).rows}
    assert rows["elbow", "all"]["fits"] == rows["all", "pulses"]["fits"] == 2
    assert rows["elbow", "chirps"]["fits"] == 1
    assert rows["elbow", "chirps"]["at 200 Hz [%]"] == rows["elbow", "chirps"]["hold the truth [%]"]
    assert rows["elbow", "chirps"]["at 100 Hz [%]"] is None
    assert ("elbow", "steps") not in rows
    assert [row["goal"] for row in rows.values()].count(None) == len(rows) - 1
    assert rows["all", "all"]["goal"] == 92


def test_inputs_are_taken_as_they_were_made(fits):
    for one in fits:
        kind, number = one.case.split(":")[1], int(one.case.split(":")[3])
        assert one.taken == ("joined" if kind == "chirps" else "held")
        assert one.quantity == ("torque" if number == 3 else "angle")


def test_truths_are_drawn_inside_the_bounds_and_fill_them():
    drawn = intervals._normal(np.random.default_rng(0), 2000)
    assert np.abs(drawn).max() <= DEVIATIONS
    assert np.std(drawn) == pytest.approx(0.88, abs=0.04)  # of a normal cut at 2


def test_the_same_case_is_the_same_fit(fits):
    assert intervals.fit("eye", "steps", 200, 3) == fits[4]


def test_the_command_runs_one_again_and_refuses_what_it_does_not_know(fits):
    run = CliRunner().invoke(main, ["bench", "intervals", "--case", "eye:steps:200:3", "--json"])
    assert run.exit_code == 0, run.output
    rows = json.loads(run.stdout)["intervals"]
    assert [row["truth"] for row in rows] == list(fits[4].truth)
    for case in ("eye:steps:200", "eye:steps:300:1", "wing:steps:100:1", "eye"):
        run = CliRunner().invoke(main, ["bench", "intervals", "--case", case])
        assert run.exit_code == 2
        assert "a case is named JOINT:KIND:RATE:NUMBER, such as elbow:pulses:100:7" in run.output
    run = CliRunner().invoke(main, ["bench", "intervals", "--kind", "ramps", "--count", "1"])
    assert run.exit_code == 2
    assert "unknown kind of inputs 'ramps'; there are: pulses, steps, chirps" in run.output
