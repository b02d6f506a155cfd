"""The ladder: errors against ``hill``, and cells that say why there is none."""

import pytest

from mjhill.ladder import ladder


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


def test_second_order_says_why_it_cannot():
    (cell,) = ladder("elbow", models=("second-order",), tasks=("tetanus",))
    assert cell.error is None
    assert "prescribed movement" in cell.cannot


@pytest.mark.parametrize("wrong", [{"models": ("hil",)}, {"tasks": ("jump",)}])
def test_unknown_names_are_refused(wrong):
    with pytest.raises(ValueError, match="unknown"):
        list(ladder("elbow", **wrong))
