import math

import pytest
from scipy.integrate import solve_ivp

from mjhill import elements, scheme

CE = dict(max_velocity=20.0, hill=0.3, plateau=1.3, slope_ratio=1.0, viscosity=1e-3)
SE = dict(stretch_max=0.3, shape=3.0, limit=2.0)


def exact_stretch(stretch, length_rate, hypothetical, dt):
    def rate(_, x):
        force, _slope = elements.series_force(x[0], *SE.values())
        shape = (CE["hill"], CE["plateau"], CE["slope_ratio"], CE["viscosity"])
        v = elements.contractile_velocity(force, hypothetical, *shape)[0]
        return [length_rate + CE["max_velocity"] * v]

    return solve_ivp(rate, (0, dt), [stretch], method="Radau", rtol=1e-11, atol=1e-13).y[0, -1]


def test_relaxed_is_exact_to_second_order_and_decays_like_one_over_z():
    for z in (-1e-3, -1e-2, -0.1):
        exact = math.expm1(z) / z
        assert scheme.relaxed(-z * 7.0, 7.0) == pytest.approx(exact, abs=abs(z) ** 3)
    assert scheme.relaxed(1e9, 1.0) == pytest.approx(1e-9, rel=1e-6)
    assert scheme.relaxed(0.0, 3.0) == 1.0


def test_excitation_is_advanced_exactly_at_any_step():
    n, _ = scheme.advance_excitation(0.8, 0.1, 0.0, 0.04, 0.01, 0.025)
    assert n == pytest.approx(0.8 + (0.1 - 0.8) * math.exp(-0.025 / 0.04))


def test_activation_of_one_step_has_third_order_error():
    errors = []
    for dt in (0.002, 0.001):
        exact = solve_ivp(
            lambda t, y: [(0.8 - y[0]) / 0.04, (y[0] - y[1]) / 0.01],
            (0, dt), [0.3, 0.1], rtol=1e-12, atol=1e-14,
        ).y[1, -1]  # fmt: skip
        errors.append(scheme.advance_excitation(0.8, 0.3, 0.1, 0.04, 0.01, dt)[1] - exact)
    assert errors[0] / errors[1] == pytest.approx(8, rel=0.1)


@pytest.mark.parametrize("hypothetical", [1e-3, 0.05, 0.7])
@pytest.mark.parametrize("length_rate", [-6.0, 0.0, 6.0])
def test_stretch_is_advanced_with_second_order(hypothetical, length_rate):
    start = 0.12
    errors = []
    for parts in (64, 128):
        stretch = start
        for _ in range(parts):
            stretch = scheme.advance_stretch(
                stretch, length_rate, hypothetical, *CE.values(), *SE.values(), 0.01 / parts, 1
            )
        errors.append(abs(stretch - exact_stretch(start, length_rate, hypothetical, 0.01)))
    assert errors[1] < 1e-9 or 3.0 < errors[0] / errors[1] < 5.5


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_slack_is_taken_up_without_overshoot(dt):
    hypothetical, stretch = 0.2, -0.05
    balance = elements.series_stretch_at(hypothetical, *SE.values())
    history = []
    for _ in range(200):
        stretch = scheme.advance_stretch(
            stretch, 0.0, hypothetical, *CE.values(), *SE.values(), dt, 1
        )
        history.append(stretch)
    assert max(history) <= balance * 1.001
    assert history[-1] == pytest.approx(balance, rel=1e-3)
    # one exponential step across a curved force-velocity relation
    assert exact_stretch(-0.05, 0.0, hypothetical, dt) == pytest.approx(history[0], abs=dt)


@pytest.mark.parametrize("dt", [1e-3, 1e-2, 1.0])
def test_a_stiff_stretch_lands_near_its_equilibrium_at_any_step(dt):
    force = 1e-3
    stretch = 0.05
    for _ in range(40):
        stretch = scheme.advance_stretch(stretch, 0.0, force, *CE.values(), *SE.values(), dt, 2)
    assert stretch == pytest.approx(elements.series_stretch_at(force, *SE.values()), rel=1e-3)


def test_capped_rate_keeps_the_equilibrium_of_a_moving_muscle():
    shape = (CE["hill"], CE["plateau"], CE["slope_ratio"], CE["viscosity"])
    hypothetical, length_rate = 1e-3, 3.0
    h = 1e-3

    def rate(x):
        return scheme.capped_stretch_rate(
            x, length_rate, hypothetical, CE["max_velocity"], *shape, *SE.values(), h
        )

    stretch = 0.01
    for _ in range(100):
        k1 = rate(stretch)
        k2 = rate(stretch + h / 2 * k1)
        k3 = rate(stretch + h / 2 * k2)
        stretch += h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(stretch + h * k3))
    force = elements.series_force(stretch, *SE.values())[0]
    v = elements.contractile_velocity(force, hypothetical, *shape)[0]
    assert CE["max_velocity"] * v == pytest.approx(-length_rate, rel=1e-6)


def test_electrical_stimulation_skips_the_lag_of_excitation():
    parameters = (0.038, 0.011, 0.044)
    rest = (1e-3, 0.0, 1.0, 1.0, 0.3, 3.0, 2.0, 20.0, 0.3, 1.3, 1.0, 1e-3, 0.0)
    for staged in (False, True):
        states = {}
        for stimulated in (0.0, 1.0):
            n, a, s = 0.0, 0.0, 0.0
            for _ in range(5):
                rates = scheme.muscle_rates(
                    staged, 1.0, n, a, s, 0.0, 0.0, 1e-3, *parameters, stimulated, *rest
                )
                n, a, s = (x + 1e-3 * r for x, r in zip((n, a, s), rates, strict=True))
            states[stimulated] = (n, a)
        assert states[1.0][0] == pytest.approx(1.0)
        assert states[1.0][1] == pytest.approx(1 - math.exp(-5e-3 / 0.011), rel=0.1)
        assert states[1.0][1] > 5 * states[0.0][1]
