import itertools

import numpy as np
import pytest

from mjhill.identification import fit as solver
from mjhill.identification.fit import solve
from mjhill.identification.free import Free

FREE = [Free((name,), 1.0, 9.0) for name in ("first", "second", "third")]


def linear(matrix, data):
    """Residuals that are linear in the parameters."""
    return lambda points: np.asarray(matrix) @ points - np.asarray(data)[:, None]


def test_a_linear_problem_gives_the_closed_form():
    random = np.random.default_rng(3)
    matrix, data = random.standard_normal((20, 3)), random.standard_normal(20)
    found = solve(linear(matrix, data), 3)
    covariance = np.linalg.inv(matrix.T @ matrix + np.eye(3))  # the priors are standard normal
    best = covariance @ matrix.T @ data
    # derivatives are differences of 1e-5, exact for a linear problem but for rounding
    np.testing.assert_allclose(found.deviations, best, atol=1e-8)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-8, atol=1e-10)
    left = np.concatenate([matrix @ best - data, best])
    assert found.cost == pytest.approx(0.5 * left @ left, rel=1e-9)


def test_intervals_are_those_of_the_posterior():
    # one datum of standard deviation 0.5 at 1: posterior 0.8 with variance 0.2
    found = solve(linear([[2.0, 0.0, 0.0]], [2.0]), 3).estimates(FREE)
    first = found[0]
    assert first.value == pytest.approx(FREE[0].value(0.8))
    spread = 1.96 * np.sqrt(0.2)
    assert first.low == pytest.approx(FREE[0].value(0.8 - spread))
    assert first.high == pytest.approx(FREE[0].value(0.8 + spread))
    assert first.informed == pytest.approx(0.8)
    assert (first.name, first.bounds) == ("first", (1.0, 9.0))


def test_informed_tells_precise_data_from_none():
    precise, vague, none = solve(linear([[100.0, 0, 0], [0, 0.1, 0]], [50.0, 0.0]), 3).estimates(
        FREE
    )
    assert precise.informed == pytest.approx(1.0, abs=1e-3)
    assert vague.informed == pytest.approx(0.01, abs=1e-3)
    assert none.informed == pytest.approx(0.0, abs=1e-9)
    assert none.value == pytest.approx(3.0)  # the middle of 1 and 9 on a logarithmic scale


def test_bounds_hold_and_what_ends_on_one_is_flagged():
    found = solve(linear(10 * np.eye(3), [500.0, -500.0, 5.0]), 3)
    np.testing.assert_allclose(found.deviations[:2], [2.0, -2.0], atol=1e-9)
    at_top, at_bottom, inside = found.estimates(FREE)
    assert (at_top.at_bound, at_bottom.at_bound, inside.at_bound) == (True, True, False)
    assert at_top.value == at_top.high == pytest.approx(9.0)
    assert at_bottom.value == at_bottom.low == pytest.approx(1.0)


def test_a_start_elsewhere_leads_to_the_same_end():
    residuals = linear([[1.0, 2.0, 0.5], [0.0, 1.0, -1.0]], [1.0, 0.5])
    ends = [solve(residuals, 3, start=start).deviations for start in (None, np.array([2, -2, 1.0]))]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-7)


def test_what_was_fitted_besides_the_parameters_is_not_among_the_estimates():
    assert [e.name for e in solve(linear(np.eye(3), np.ones(3)), 3).estimates(FREE[:2])] == [
        "first",
        "second",
    ]


def bend(points):
    """A curved valley, which takes Gauss and Newton several steps."""
    return np.stack([30 * (points[1] - points[0] ** 2), 5 * (1 - points[0])])


def test_progress_only_rises_and_stays_below_one():
    shares = []
    solve(bend, 2, shares.append)
    assert len(shares) > 2
    assert all(0 < a < b < 1 for a, b in itertools.pairwise(shares))


def test_a_fit_that_does_not_settle_is_an_error(monkeypatch):
    monkeypatch.setattr(solver, "_ITERATIONS", 2)
    with pytest.raises(RuntimeError, match="the fit did not settle in 2 iterations"):
        solve(bend, 2)
