"""The distribution-moment muscle: moments of bonds beside Huxley's closed form."""

import dataclasses
import itertools
from math import sqrt

import numpy as np
import pytest
from scipy.integrate import quad

import mjhill
from mjhill.muscles import bonds, moments

F1, G1, G2 = bonds.RATES
RATES = (F1, G1, G2, bonds.STRETCHED_RATE)
FULL = moments.steady_moments(1.0, *RATES)[1]


def force(velocity, *rates):
    return moments.steady_moments(1.0, *rates, velocity)[1] / FULL


def test_the_unloaded_velocity_is_huxleys():
    assert bonds.unloaded_velocity(F1, G1, G2) == pytest.approx(4.0 * 0.5 * (F1 + G1), rel=1e-3)
    assert bonds.steady_force(0.0, F1, G1, G2) == 1.0


@pytest.mark.parametrize("share", [0.02, 0.1, 0.2, 0.3, 0.5, 0.75])
def test_in_shortening_the_force_is_near_huxleys(share):
    velocity = share * bonds.unloaded_velocity(F1, G1, G2)
    # 0.038 at a twentieth of the largest velocity: the worst
    assert abs(force(velocity, *RATES) - bonds.steady_force(velocity, F1, G1, G2)) < 0.04


def test_bonds_that_break_when_stretched_limit_the_force_of_lengthening():
    velocity = -0.5 * bonds.unloaded_velocity(F1, G1, G2)
    assert force(velocity, *RATES[:3], 0.0) > 3.5
    assert 1.0 < force(velocity, *RATES) < 1.2


def test_reactions_are_the_integrals_they_stand_for():
    m0, m1, m2 = 0.5, 0.3, 0.25
    mean = m1 / m0
    deviation = sqrt(m2 / m0 - mean**2)

    def bond_density(x):
        return m0 * np.exp(-0.5 * ((x - mean) / deviation) ** 2) / deviation / sqrt(2 * np.pi)

    def rate(x, power):
        f = bonds.attachment(x, F1)
        return x**power * (f - (f + bonds.detachment(x, *RATES[1:])) * bond_density(x))

    found = moments.reactions(m0, m1, m2, 1.0, *RATES)
    for power in range(3):
        edges = (mean - 12 * deviation, 0.0, 1.0, mean + 12 * deviation)
        exact = sum(quad(rate, a, b, args=(power,))[0] for a, b in itertools.pairwise(edges))
        assert found[power] == pytest.approx(exact, rel=1e-7)


def test_a_relaxed_muscle_has_few_bonds_and_a_variance():
    model = mjhill.muscle_model("dm")
    muscle = mjhill.JOINTS["elbow"].with_muscles("dm").muscles["elbow_flexor"]
    _, _, s, m0, m2 = model.ask(model.steady, muscle, u=0.0, length=0.0)
    assert 0 < m0 < 1e-3
    m1 = muscle.isometric_moment * model.ask(model.tension, muscle, s=s, length=0.0)
    assert m2 / m0 > (m1 / muscle.max_isometric_force / m0) ** 2
    assert moments.widened(0.0, 0.0, 0.0)[1] > 0


@pytest.mark.parametrize("timestep", [1e-4, 1e-3, 5e-3])
def test_a_muscle_that_is_stretched_until_its_bonds_break_stays_finite(timestep):
    import mujoco

    model = mjhill.load("elbow", muscle="dm")
    model.opt.timestep = timestep
    with mjhill.installed():
        data = mjhill.at_home(model)
        for step in range(round(1.0 / timestep)):
            data.ctrl[:] = (1.0, 0.0) if (step * timestep) % 0.4 < 0.2 else (0.05, 1.0)
            mujoco.mj_step(model, data)
            assert np.isfinite(data.act).all()
            for first in (0, 5):
                m0, m2 = data.act[first + 3 : first + 5]
                assert 0 < m0 < 1
                assert m2 > 0


@pytest.mark.parametrize(
    ("name", "value"),
    [("attachment_rate", -1.0), ("detachment_rate", 0.0), ("pushing_detachment_rate", 0.0),
     ("stretched_detachment_rate", -1.0), ("bond_reach", 0.0)],
)  # fmt: skip
def test_rates_that_cannot_be_are_refused(name, value):
    muscle = mjhill.JOINTS["elbow"].with_muscles("dm").muscles["elbow_flexor"]
    with pytest.raises(ValueError, match=f"{name} must be in"):
        dataclasses.replace(muscle, **{name: value})
