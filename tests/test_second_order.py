import numpy as np
import pytest

from mjhill.analysis.second_order import fit_step, step_response

TIME = np.arange(2001) * 1e-3


@pytest.mark.parametrize(
    ("slow", "fast"), [(0.2, 0.04), (0.3, 0.1), (0.15, 0.15), (0.15, 0.149), (0.1, 0.005)]
)
@pytest.mark.parametrize("magnitude", [1.6, -0.02])
def test_the_response_of_a_second_order_system_is_recognised(slow, fast, magnitude):
    fit = fit_step(TIME, magnitude * step_response(TIME, slow, fast))
    assert fit.magnitude == pytest.approx(magnitude, rel=1e-4)
    assert fit.duration == pytest.approx(slow + fast, rel=1e-3)
    assert fit.misfit < 1e-4
    # near equal poles the difference of the two is a square root of what the fit resolves
    close = slow - fast < 0.1 * slow
    assert fit.time_constants == pytest.approx((slow, fast), rel=0.05 if close else 5e-3)


@pytest.mark.parametrize(("slow", "fast"), [(0.15, 0.15), (0.16, 0.14)])
def test_noise_moves_the_sum_of_near_equal_poles_far_less_than_the_poles(slow, fast):
    random = np.random.default_rng(5)
    clean = step_response(TIME, slow, fast)
    fits = [fit_step(TIME, clean + 0.02 * random.standard_normal(len(TIME))) for _ in range(10)]
    assert [fit.duration for fit in fits] == pytest.approx([slow + fast] * 10, rel=0.02)
    assert np.std([fit.duration for fit in fits]) < 0.2 * np.std(
        [fit.time_constants[0] for fit in fits]
    )
    # the noise of 2 % is what is left
    assert [fit.misfit for fit in fits] == pytest.approx([0.02] * 10, rel=0.1)


def test_the_slow_time_constant_comes_first():
    fit = fit_step(TIME, step_response(TIME, 0.2, 0.05))
    assert fit.time_constants[0] > fit.time_constants[1] > 0


def test_a_response_goes_from_still_at_0_to_1_with_its_mean_delay_the_sum():
    for slow, fast in ((0.2, 0.05), (0.1, 0.1)):
        response = step_response(TIME, slow, fast)
        assert response[0] == 0.0
        assert response[1] < 1e-3  # a second-order system starts without velocity
        assert (np.diff(response) >= 0).all()
        late = 1.0 - response
        assert np.trapezoid(late, TIME) == pytest.approx(slow + fast, rel=1e-3)


def test_a_response_solves_its_equation():
    slow, fast, step = 0.12, 0.05, TIME[1]
    response = step_response(TIME, slow, fast)
    first = np.gradient(response, step)
    second = np.gradient(first, step)
    left = slow * fast * second + (slow + fast) * first + response
    np.testing.assert_allclose(left[2:-2], 1.0, atol=1e-3)  # differences of second order


def test_a_response_is_continuous_where_its_poles_meet():
    together = step_response(TIME, 0.1, 0.1)
    for apart in (1e-3, 1.01e-4, 0.99e-4, 1e-6):
        near = step_response(TIME, 0.1 * (1 + apart / 2), 0.1 * (1 - apart / 2))
        # symmetric about the double pole, so of second order in the distance but for rounding
        np.testing.assert_allclose(near, together, atol=apart**2 + 1e-10)


@pytest.mark.parametrize("response", [np.zeros(2001), np.sin(np.pi * TIME / TIME[-1]) * (TIME < 2)])
def test_a_response_that_ends_where_it_starts_is_refused(response):
    with pytest.raises(ValueError, match="ends where it starts, so there is no step to fit"):
        fit_step(TIME, response)
