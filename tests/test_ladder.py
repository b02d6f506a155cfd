"""The ladder: errors against ``hill``, and cells that say why there is none."""

from dataclasses import replace

import numpy as np
import pytest

from mjhill.ladder import RUNGS, ladder


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
