import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mjhill import elements
from mjhill.muscles import hill, scheme

CE = dict(max_velocity=20.0, hill=0.3, plateau=1.3, slope_ratio=1.0, viscosity=1e-3)
SE = dict(stretch_max=0.3, shape=3.0, limit=2.0)


SHARE = 0.0  # of V_max that scales with activation


def exact_stretch(stretch, length_rate, before, after, dt):
    shape = (CE["hill"], CE["plateau"], CE["slope_ratio"], CE["viscosity"])

    def rate(t, x):
        force, _slope = elements.series_force(x[0], *SE.values())
        hypothetical = before + (after - before) * t / dt
        return [
            length_rate
            + CE["max_velocity"] * elements.contractile_velocity(force, hypothetical, *shape)[0]
        ]

    return solve_ivp(rate, (0, dt), [stretch], method="Radau", rtol=1e-10, atol=1e-12).y[0, -1]


def test_averages_of_a_decay_are_exact_to_second_order_and_fall_like_one_over_z():
    for z in (-1e-3, -1e-2, -0.1):
        constant, growing = scheme.averages(-z * 7.0, 7.0)
        assert constant == pytest.approx(math.expm1(z) / z, abs=abs(z) ** 3)
        assert growing * 7.0 == pytest.approx((math.expm1(z) - z) / z**2, abs=abs(z) ** 2)
    constant, growing = scheme.averages(1e9, 1.0)
    assert constant == pytest.approx(1e-9, rel=1e-6)
    assert growing == pytest.approx(1e-9, rel=1e-6)
    assert scheme.averages(0.0, 4.0) == (1.0, 0.125)


def test_excitation_is_advanced_exactly_at_any_step():
    n = scheme.advance_excitation(0.8, 0.1, 0.04, 0.025)
    assert n == pytest.approx(0.8 + (0.1 - 0.8) * math.exp(-0.025 / 0.04))


def test_activation_of_one_step_has_third_order_error():
    errors = []
    for dt in (0.002, 0.001):
        exact = solve_ivp(
            lambda t, y: [(0.8 - y[0]) / 0.04, (y[0] - y[1]) / 0.01],
            (0, dt), [0.3, 0.1], rtol=1e-12, atol=1e-14,
        ).y[1, -1]  # fmt: skip
        n_next = scheme.advance_excitation(0.8, 0.3, 0.04, dt)
        errors.append(scheme.advance_activation(0.3, n_next, 0.1, 0.01, dt) - exact)
    assert errors[0] / errors[1] == pytest.approx(8, rel=0.1)


def advance(stretch, length_rate, before, after, dt):
    return scheme.advance_stretch(
        stretch, length_rate, before, after, CE["max_velocity"], SHARE, *list(CE.values())[1:],
        *SE.values(), dt,
    )  # fmt: skip


def rates(stretch, length_rate, hypothetical):
    return scheme.stretch_rate(
        stretch, length_rate, hypothetical, CE["max_velocity"], SHARE, *list(CE.values())[1:],
        *SE.values(),
    )  # fmt: skip


@pytest.mark.parametrize("stretch", [0.02, 0.2, 0.31])
@pytest.mark.parametrize("hypothetical", [1e-3, 0.4])
def test_slopes_of_the_rate_are_its_derivatives(stretch, hypothetical):
    _, p, q, drift, stiffness, _ = rates(stretch, 3.0, hypothetical)
    step = 1e-7
    ends = [rates(stretch + sign * step, 3.0, hypothetical) for sign in (-1, 1)]
    assert -p / q == pytest.approx((ends[1][0] - ends[0][0]) / (2 * step), rel=1e-4)
    assert stiffness == pytest.approx((ends[1][5] - ends[0][5]) / (2 * step), rel=1e-4)
    step = 1e-7 * hypothetical
    ends = [rates(stretch, 3.0, hypothetical + sign * step) for sign in (-1, 1)]
    assert drift / q == pytest.approx((ends[1][0] - ends[0][0]) / (2 * step), rel=1e-4)


@pytest.mark.parametrize("before", [1e-3, 0.05, 0.7])
@pytest.mark.parametrize("after", [1.0, 1.2])
@pytest.mark.parametrize("length_rate", [-6.0, 0.0, 6.0])
def test_stretch_is_advanced_with_second_order(before, after, length_rate):
    # steps so short that none is corrected or divided
    start, errors = 0.12, []
    exact = exact_stretch(start, length_rate, before, before * after, 0.01)
    for parts in (256, 512):
        stretch, gain = start, before * (after - 1) / parts
        for k in range(parts):
            stretch = advance(
                stretch, length_rate, before + k * gain, before + (k + 1) * gain, 0.01 / parts
            )
        errors.append(abs(stretch - exact))
    assert errors[1] < 1e-8 or 3.0 < errors[0] / errors[1] < 8.5


def force_at(stretch):
    return elements.series_force(stretch, *SE.values())[0]


@pytest.mark.parametrize("dt", [1e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("length_rate", [-8.0, -4.0, 0.0])
def test_force_leaves_the_eccentric_plateau_as_it_should(dt, length_rate):
    # held on the plateau by a stretch at half of V_max, then let go: one linear step sticks there
    held = elements.series_stretch_at(0.8 * 1.3, *SE.values())
    found = advance(held, length_rate, 0.8, 0.75, dt)
    exact = exact_stretch(held, length_rate, 0.8, 0.75, dt)
    assert force_at(found) == pytest.approx(force_at(exact), abs=3e-3)


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_slack_is_taken_up_without_overshoot(dt):
    hypothetical, stretch = 0.2, -0.05
    balance = elements.series_stretch_at(hypothetical, *SE.values())
    history = []
    for _ in range(200):
        stretch = advance(stretch, 0.0, hypothetical, hypothetical, dt)
        history.append(stretch)
    assert max(history) <= balance * 1.001
    assert history[-1] == pytest.approx(balance, rel=1e-3)
    exact = exact_stretch(-0.05, 0.0, hypothetical, hypothetical, dt)
    # the tolerance of a substep, 1e-3 F_max, is 3e-4 of stretch here
    assert history[0] == pytest.approx(exact, abs=3e-4)


@pytest.mark.parametrize("dt", [1e-3, 1e-2, 1.0])
def test_a_stiff_stretch_lands_near_its_equilibrium_at_any_step(dt):
    force = 1e-3
    stretch = 0.05
    for _ in range(40):
        stretch = advance(stretch, 0.0, force, force, dt)
    assert stretch == pytest.approx(elements.series_stretch_at(force, *SE.values()), rel=1e-3)


def test_patience_does_not_run_out_on_physiological_muscles():
    random = np.random.default_rng(0)
    errors = []
    for _ in range(100):
        before, after = random.uniform(0.01, 1), random.uniform(0.01, 1)
        # a tenth of what activation can change in 5 ms
        after = before + 0.1 * (after - before)
        stretch = elements.series_stretch_at(before * random.uniform(0.01, 1.35), *SE.values())
        length_rate = random.uniform(-1, 1) * CE["max_velocity"]
        found = advance(stretch, length_rate, before, after, 5e-3)
        exact = exact_stretch(stretch, length_rate, before, after, 5e-3)
        errors.append(abs(force_at(found) - force_at(exact)))
    # a step that stopped half way would be off by a tenth and more
    assert max(errors) < 0.02
    assert np.median(errors) < 1e-3


def staged(stretch, length_rate, hypothetical, dt):
    return scheme.staged_stretch(
        stretch, length_rate, hypothetical, CE["max_velocity"], SHARE, *list(CE.values())[1:],
        *SE.values(), dt,
    )  # fmt: skip


def test_where_rk4_can_follow_it_gets_the_plain_derivative():
    rate, p, q, *_ = rates(0.2, 2.0, 0.9)
    assert 1e-4 * p / q < 2
    assert staged(0.2, 2.0, 0.9, 1e-4) == (0.2, rate)


@pytest.mark.parametrize("length_rate", [-3.0, 3.0])
def test_rk4_feels_the_true_force_of_a_moving_muscle_that_is_faster_than_its_step(length_rate):
    hypothetical, h = 1e-3, 1e-3
    _, p, q, *_ = rates(1e-3, length_rate, hypothetical)
    assert h * p / q > 2
    stretch = 0.01
    for _ in range(100):
        k1 = staged(stretch, length_rate, hypothetical, h)[1]
        k2 = staged(stretch + h / 2 * k1, length_rate, hypothetical, h)[1]
        k3 = staged(stretch + h / 2 * k2, length_rate, hypothetical, h)[1]
        k4 = staged(stretch + h * k3, length_rate, hypothetical, h)[1]
        stretch += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    present, _ = staged(stretch, length_rate, hypothetical, h)
    shape = (CE["hill"], CE["plateau"], CE["slope_ratio"], CE["viscosity"])
    v = elements.contractile_velocity(force_at(present), hypothetical, *shape)[0]
    assert CE["max_velocity"] * v == pytest.approx(-length_rate, rel=1e-6)


def test_electrical_stimulation_skips_the_lag_of_excitation():
    parameters = (0.038, 0.011, 0.044)
    rest = (1e-3, 0.0, 1.0, 1.0, 0.3, 3.0, 2.0, 20.0, 0.3, 1.3, 1.0, 1e-3, 0.0)
    for staged in (False, True):
        states = {}
        for stimulated in (0.0, 1.0):
            n, a, s = 0.0, 0.0, 0.0
            for _ in range(5):
                rates = hill.rates(
                    staged, 1.0, n, a, s, 0.0, 0.0, 1e-3, *parameters, stimulated, *rest
                )
                n, a, s = (x + 1e-3 * r for x, r in zip((n, a, s), rates, strict=True))
            states[stimulated] = (n, a)
        assert states[1.0][0] == pytest.approx(1.0)
        assert states[1.0][1] == pytest.approx(1 - math.exp(-5e-3 / 0.011), rel=0.1)
        assert states[1.0][1] > 5 * states[0.0][1]


def wild_muscles(count):
    """Parameters of ``advance_stretch`` from anywhere in their ranges, and a timestep."""
    random = np.random.default_rng(7)

    def log(low, high):
        return float(np.exp(random.uniform(math.log(low), math.log(high))))

    for _ in range(count):
        contractile = (
            log(0.01, 1e4), float(random.uniform(0, 1)), log(0.05, 10),
            float(random.uniform(1.01, 3)), log(1e-3, 20), log(1e-6, 1),
        )  # fmt: skip
        series = log(1e-6, 1), log(0.01, 10), float(random.uniform(1, 10))
        yield contractile, series, log(1e-6, 1), log(1e-4, 1e-2)


def test_a_muscle_that_is_held_never_goes_past_its_equilibrium():
    for contractile, series, hypothetical, dt in wild_muscles(300):
        rest = elements.series_stretch_at(hypothetical, *series)
        for start in (0.0, 0.3 * rest, 1.001 * rest, elements.series_stretch_at(2.9, *series)):
            for advance_any in (scheme.advance_stretch, scheme.settled_stretch):
                forces = (hypothetical,) * (2 if advance_any is scheme.advance_stretch else 1)
                end = advance_any(start, 0.0, *forces, *contractile, *series, dt)
                force = elements.series_force(end, *series)[0]
                first = elements.series_force(start, *series)[0]
                low, high = min(first, hypothetical), max(first, hypothetical)
                # a step that is not divided may leave out 3e-3, and some of them add up
                assert low - 0.02 <= force <= high + 0.02, (contractile, series, dt, start)


def test_the_last_resort_of_a_step_is_backward_euler():
    for contractile, series, hypothetical, dt in wild_muscles(200):
        for rate in (-1.0, 0.0, 0.5):
            start = elements.series_stretch_at(0.5, *series)
            end = scheme.settled_stretch(start, rate, hypothetical, *contractile, *series, dt)
            # x - start - dt rate(x) rises through 0 at the end, within the bits of x
            below, above = (
                x
                - start
                - dt * scheme.stretch_rate(x, rate, hypothetical, *contractile, *series)[0]
                for x in (end - 1e-9 * abs(end) - 1e-15, end + 1e-9 * abs(end) + 1e-15)
            )
            assert below <= 0 <= above


@pytest.mark.parametrize("stimulated", [0.0, 1.0])
def test_excitation_and_activation_stay_inside_0_and_1_under_rk4(stimulated):
    random = np.random.default_rng(3)
    dt = 5e-3
    muscle = (0.0, 0.5, 0.5, 0.1, 3.0, 2.0, 6.0, 0.3, 1.3, 1.0, 1e-3, 0.0)  # the rest of it
    for _ in range(100):
        taus = np.exp(random.uniform(math.log(1e-6), 0, 3)).tolist()

        def rates(n, a, u, taus=taus):
            found = hill.rates(True, u, n, a, 0.0, 0.0, 0.0, dt, *taus, stimulated, 1e-3, *muscle)
            return np.array(found[:2])

        state = np.array([0.0, 0.0])
        for _ in range(60):
            u = float(random.choice([0.0, 1.0]))
            k1 = rates(*state, u)
            k2 = rates(*(state + 0.5 * dt * k1), u)
            k3 = rates(*(state + 0.5 * dt * k2), u)
            k4 = rates(*(state + dt * k3), u)
            state = state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            assert (state >= -1e-12).all()
            assert (state <= 1 + 1e-12).all()


def test_the_shortest_time_constants_overflow_nothing_under_stimulation():
    muscle = (0.0, 0.5, 0.5, 0.1, 3.0, 2.0, 6.0, 0.3, 1.3, 1.0, 1e-3, 0.0)
    for n, a in ((0.5, 0.5), (1.0, 0.0), (0.0, 1.0)):
        rates = hill.rates(
            False, 0.7, n, a, 0.0, 0.01, 0.0, 1e-2, 1e-6, 1e-6, 1e-6, 1.0, 1e-3, *muscle
        )
        assert all(map(math.isfinite, rates))
