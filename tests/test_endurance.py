import numpy as np
import pytest

from mjhill.benchmarks import endurance

SMALL = 4  # pairs


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_a_steady_and_a_slack_start_end_with_the_same_bits_and_memory_stays_flat(integrator):
    row = endurance.endure(integrator, 200_000, SMALL)
    assert row["million steps"] == pytest.approx(0.2, rel=0.01)
    assert row["same bits from step"] is not None
    assert row["same bits from step"] < 20_000
    assert row["apart"] == 0.0
    assert row["growth [MiB]"] < endurance.GROWTH
    assert row["warnings"] == 0


def test_the_two_starts_are_far_apart_at_first():
    row = endurance.endure("implicitfast", 1, SMALL)  # as few steps as there are samples
    assert row["same bits from step"] is None
    assert row["apart"] > 1e-9


def test_a_run_that_warns_is_refused(monkeypatch):
    excitations = endurance._excitations
    late = {7: np.full((SMALL, 2), np.nan)}
    monkeypatch.setattr(
        endurance, "_excitations", lambda k, pairs: late.get(k, excitations(k, pairs))
    )
    with pytest.raises(RuntimeError, match=r"MuJoCo warned WARN_BADCTRL within 800 steps"):
        endurance.endure("implicitfast", 1, SMALL)
