"""Intervals of confidence where residuals are straight, kinked and curved."""

import numpy as np
import pytest

from mjhill.identification.fit import intervals, solve


def test_a_straight_problem_keeps_the_intervals_of_its_covariance():
    random = np.random.default_rng(3)
    matrix, data = 3 * random.standard_normal((20, 3)), random.standard_normal(20)

    def straight(points):
        return matrix @ points - data[:, None]

    found = solve(straight, 3)
    np.testing.assert_array_equal(intervals(straight, found, 2), found.ends[:2])


def test_past_a_kink_the_interval_goes_on_as_far_as_the_data_agree():
    # told exactly above 0, not at all below; the solution is on the steep side
    def kinked(points):
        return np.stack([np.where(points[0] > 0, 10 * points[0], 0) - 0.1])

    found = solve(kinked, 1)
    assert 0 < found.deviations[0] < 0.02
    assert found.ends[0, 0] > -0.3
    low, high = intervals(kinked, found, 1)[0]
    assert high == pytest.approx(found.ends[0, 1])
    # below, only the prior and the missed datum rise: z**2 + 0.1**2 = 1.96**2
    assert low == pytest.approx(-1.96, abs=0.03)


def test_an_interval_follows_a_curved_valley():
    # the other parameter can make up for this one, but not along a straight line
    def valley(points):
        return np.stack([50 * (points[1] - points[0] ** 2), 2 * (points[0] - 0.5)])

    found = solve(valley, 2)
    low, high = intervals(valley, found, 1)[0]
    # the second follows the square of the first, so the cost is that of the first alone
    grid = np.linspace(-1, 2, 30001)
    cost = 0.5 * (grid**2 + grid**4 + 4 * (grid - 0.5) ** 2)
    agreeing = grid[cost < cost.min() + 0.5 * 1.96**2]
    assert low == pytest.approx(min(agreeing[0], found.ends[0, 0]), abs=0.05)
    assert high == pytest.approx(max(agreeing[-1], found.ends[0, 1]), abs=0.05)


def test_an_interval_at_a_bound_stays_inside():
    def pushing(points):
        return np.stack([points[0] - 50.0])

    found = solve(pushing, 1)
    low, high = intervals(pushing, found, 1)[0]
    assert low <= found.deviations[0] == 2.0 <= high
