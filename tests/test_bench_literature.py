"""The benchmark of other fits to the literature, on its quickest joint."""

import pytest

from mjhill.benchmarks import literature


@pytest.fixture
def hip_only(monkeypatch):
    monkeypatch.setattr(literature, "JOINTS", {"hip": literature.JOINTS["hip"]})
    entries = [fact for fact in literature.read_entries() if fact.joint == "hip"]
    monkeypatch.setattr(literature, "read_entries", lambda: entries)


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="--kind must be one of variants, facts, got others"):
        literature.measure(["others"])


def test_facts_left_out_are_farther_than_facts_fitted(hip_only):
    shares = []
    result = literature.measure(["facts"], shares.append)
    assert shares[-1] == 1.0
    assert [row["use"] for row in result.rows] == ["fitted", "fitted", "held out", "fitted"]
    for row in result.rows:
        assert (row["left out"] is None) == (row["use"] == "held out")
    fitted = [row for row in result.rows if row["use"] == "fitted"]
    left_out, shipped = (sum(abs(row[key]) for row in fitted) for key in ("left out", "as shipped"))
    assert left_out > shipped
    assert "of 3, " in result.notes[0]
