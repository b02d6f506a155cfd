import itertools
import math

import pytest

from mjhill import elements

HILL = dict(hill=0.25, plateau=1.3, slope_ratio=1.0, viscosity=1e-6)


def velocity(force, hypothetical=1.0, **changes):
    return elements.contractile_velocity(force, hypothetical, **{**HILL, **changes})[0]


def test_isometric_force_needs_no_velocity():
    for hypothetical in (0.01, 0.4, 1.0):
        assert velocity(hypothetical, hypothetical) == 0.0


def test_unloaded_muscle_shortens_at_its_maximum_velocity():
    assert velocity(0.0) == pytest.approx(1.0, abs=1e-5)


def test_shortening_follows_hill_equation_3():
    for force in (0.1, 0.35, 0.8):
        v = velocity(force)
        assert (force + 0.25) * (v + 0.25) == pytest.approx(0.25 * 1.25, rel=1e-5)


def test_shortening_velocity_depends_on_relative_load_alone():
    assert velocity(0.2, 0.4) == pytest.approx(velocity(0.5, 1.0), rel=1e-4)


def test_fast_lengthening_reaches_the_plateau():
    assert velocity(1.29) > -2.1
    assert velocity(1.31, viscosity=1e-3) < -5.0


def test_the_plateau_goes_on_with_the_slope_of_the_viscosity():
    viscosity = 1e-3
    first, second = (velocity(f, viscosity=viscosity) for f in (1.5, 1.6))
    assert 0.1 / (first - second) == pytest.approx(viscosity, rel=1e-2)


@pytest.mark.parametrize("ratio", [1.0, 6.0])
def test_slope_ratio_is_lengthening_over_shortening_at_zero_velocity(ratio):
    step = 1e-6
    shortening = -step / velocity(1 - step, slope_ratio=ratio)
    lengthening = step / velocity(1 + step, slope_ratio=ratio)
    assert lengthening / shortening == pytest.approx(ratio, rel=1e-3)


@pytest.mark.parametrize("force", [0.0, 0.3, 0.999, 1.001, 1.2, 1.5, 20.0])
@pytest.mark.parametrize("hypothetical", [1e-3, 0.5, 1.0])
def test_slope_of_the_velocity_is_its_derivative(force, hypothetical):
    parameters = (hypothetical, 0.3, 1.3, 1.0, 1e-3)
    if force - 1e-7 < hypothetical < force + 1e-7:
        pytest.skip("the slope is that of one side at the corner")
    low, high = (elements.contractile_velocity(force + d, *parameters)[0] for d in (-1e-7, 1e-7))
    _, p, q, r = elements.contractile_velocity(force, *parameters)
    assert p > 0
    assert q > 0
    assert -p / q == pytest.approx((high - low) / 2e-7, rel=1e-4)
    step = 1e-7 * hypothetical
    low, high = (
        elements.contractile_velocity(force, hypothetical + d, *parameters[1:])[0]
        for d in (-step, step)
    )
    assert r / q == pytest.approx((high - low) / (2 * step), rel=1e-4)


def test_velocity_falls_with_force_without_a_jump():
    forces = [0.002 * k for k in range(2000)]
    velocities = [velocity(f, 0.5, viscosity=1e-3) for f in forces]
    assert all(a > b for a, b in itertools.pairwise(velocities))


def test_series_element_carries_maximum_force_at_its_maximum_stretch():
    assert elements.series_force(0.3, 0.3, 3.0, 2.0)[0] == pytest.approx(1.0)


def test_series_element_is_slack_when_it_is_not_stretched():
    assert elements.series_force(-0.1, 0.3, 3.0, 2.0) == (0.0, 0.0)
    assert elements.series_force(0.0, 0.3, 3.0, 2.0)[0] == 0.0


def test_a_series_element_about_to_stretch_has_its_stiffness_already():
    assert elements.series_force(0.0, 0.3, 3.0, 2.0)[1] > 0


def test_series_stiffness_is_linear_in_force_as_equation_6_says():
    points = [elements.series_force(x, 0.3, 3.0, 2.0) for x in (0.05, 0.2, 0.5)]
    slopes = [(k2 - k1) / (f2 - f1) for (f1, k1), (f2, k2) in itertools.pairwise(points)]
    assert slopes == pytest.approx([3.0 / 0.3] * 2)


@pytest.mark.parametrize("stretch", [0.01, 0.3, 0.59, 0.7, 3.0])
def test_series_stiffness_is_the_derivative_of_the_force(stretch):
    low, high = (elements.series_force(stretch + d, 0.3, 3.0, 2.0)[0] for d in (-1e-7, 1e-7))
    stiffness = elements.series_force(stretch, 0.3, 3.0, 2.0)[1]
    assert stiffness == pytest.approx((high - low) / 2e-7, rel=1e-5)


@pytest.mark.parametrize("force", [0.0, 1e-3, 1.0, 15.0, 80.0])
def test_series_stretch_inverts_series_force(force):
    stretch = elements.series_stretch_at(force, 0.3, 3.0, 2.0)
    assert elements.series_force(stretch, 0.3, 3.0, 2.0)[0] == pytest.approx(force, abs=1e-12)


def test_series_force_stays_finite_far_outside_its_range():
    assert math.isfinite(elements.series_force(1e6, 0.3, 3.0, 2.0)[0])


def test_active_force_is_largest_at_the_optimum_and_has_a_width_on_each_side():
    def factor(length):
        return elements.active_length_factor(length, 1.0, 0.5, 2.0)

    assert factor(1.0) == 1.0
    assert factor(0.5) == pytest.approx(math.exp(-1))
    assert factor(3.0) == pytest.approx(math.exp(-1))


def test_activation_rises_with_one_time_constant_and_falls_with_the_other():
    assert elements.activation_rate(0.6, 0.5, 0.01, 0.04) == pytest.approx(10.0)
    assert elements.activation_rate(0.4, 0.5, 0.01, 0.04) == pytest.approx(-2.5)
    assert elements.activation_rate(0.5, 0.5, 0.01, 0.04) == 0.0


def test_hypothetical_force_never_falls_below_its_floor():
    assert elements.hypothetical_force(0.0, 0.7, 1e-3) == 1e-3
    assert elements.hypothetical_force(0.5, 0.7, 1e-3) == 0.35


def test_velocity_scales_with_the_active_state_only_when_asked_to():
    assert elements.velocity_scale(0.2, 0.0) == 1.0
    assert elements.velocity_scale(0.2, 0.5) == pytest.approx(0.6)
    assert elements.velocity_scale(1.0, 0.5) == 1.0


def test_passive_torque_restores_on_both_sides_each_with_its_constants():
    def torque(q):
        return elements.passive_torque(q, 2.0, 0.1, 3.0, 0.5, 4.0, 20.0)

    assert torque(0.0) == 0.0
    assert torque(0.5) == pytest.approx(-(1.0 + 0.1 * (math.exp(1.5) - 1)))
    assert torque(-0.5) == pytest.approx(1.0 + 0.5 * (math.exp(2.0) - 1))


def test_passive_torque_goes_on_straight_past_its_limit():
    a, b, c = (elements.passive_torque(q, 0.0, 0.1, 2.0, 0.1, 2.0, 5.0) for q in (3.0, 4.0, 5.0))
    assert c - b == pytest.approx(b - a)
    assert b - a == pytest.approx(-0.2 * math.exp(5.0))
