"""The ladder: errors against ``hill``, and cells that say why there is none."""

from dataclasses import replace

import numpy as np
import pytest

import mjhill
from mjhill.ladder import RUNGS, ladder, rung
from mjhill.muscles import steady_tension
from mjhill.simulate.reference import plant_torque


def test_hill_has_no_error_and_a_rigid_muscle_has_one():
    cells = {
        c.model: c for c in ladder("elbow", models=("hill", "hill-rigid"), tasks=("step 0.5",))
    }
    assert cells["hill"].error == 0
    assert cells["hill-rigid"].error > 0


def test_lengthening_stretches_the_muscle():
    from mjhill.joints.reader import JOINTS
    from mjhill.ladder import TASKS

    elbow = JOINTS["elbow"]
    longer, shorter = (
        abs(TASKS[t].run(elbow, elbow)).max() for t in ("lengthening", "isovelocity")
    )
    assert longer > shorter


def test_a_run_that_is_not_finite_has_no_error_but_a_reason(monkeypatch):
    from mjhill.ladder import table

    broken = lambda joint, base: np.full(3, np.nan if joint is not base else 1.0)  # noqa: E731
    task = replace(table.TASKS["tetanus"], run=broken)
    monkeypatch.setattr(table, "TASKS", {**table.TASKS, "tetanus": task})
    (cell,) = ladder("elbow", models=("dm",), tasks=("tetanus",))
    assert cell.error is None
    assert "finite" in cell.cannot


@pytest.mark.parametrize("model", RUNGS)
def test_every_model_does_every_task(model):
    for cell in ladder("ankle", models=(model,)):
        assert cell.error is not None, cell


@pytest.mark.parametrize("wrong", [{"models": ("hil",)}, {"tasks": ("jump",)}])
def test_unknown_names_are_refused(wrong):
    with pytest.raises(ValueError, match="unknown"):
        list(ladder("elbow", **wrong))


@pytest.mark.parametrize("name", ["elbow", "ankle", "eye"])
def test_flat_active_force_is_that_of_hill_at_home_and_only_there(name):
    joint = mjhill.JOINTS[name]
    flat = rung("hill-flat-ata", joint)
    for muscle, own in joint.muscles.items():
        home = joint.gears[muscle] * joint.home_angle
        for u in (0.05, 0.5, 1.0):
            there = steady_tension(own, u, home)
            assert steady_tension(flat.muscles[muscle], u, home) == pytest.approx(there, rel=1e-9)
        elsewhere = home + 0.5 * own.width_short
        constant = steady_tension(flat.muscles[muscle], 1.0, elsewhere)
        assert constant == pytest.approx(there, rel=1e-5)
        assert abs(steady_tension(own, 1.0, elsewhere) / there - 1) > 0.02
    cells = {c.task: c.error for c in ladder(joint, models=("hill-flat-ata",))}
    assert cells["tetanus"] < 1e-2
    assert cells["twitch"] < 1e-2
    assert cells["isovelocity"] > 0.3


@pytest.mark.parametrize("name", ["elbow", "ankle", "eye"])
def test_linear_passive_torque_touches_that_of_hill_at_home(name):
    joint = mjhill.JOINTS[name]
    linear = rung("hill-linear-pe", joint)
    home = joint.home_angle
    assert plant_torque(linear, home) == pytest.approx(plant_torque(joint, home), abs=1e-9)
    steps = [plant_torque(linear, home + d) - plant_torque(linear, home) for d in (-0.4, 0.4)]
    assert steps[0] == pytest.approx(-steps[1])
    ends = [plant_torque(joint, end) for end in joint.range]
    assert max(
        abs(plant_torque(linear, e) - t) for e, t in zip(joint.range, ends, strict=True)
    ) > 0.1 * max(map(abs, ends))
