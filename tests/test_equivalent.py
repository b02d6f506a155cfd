import dataclasses

import numpy as np
import pytest

import mjhill
from mjhill.muscles.equivalent import (
    anatomical_muscle,
    stretch_at_force,
    torque_at_length,
    torque_at_velocity,
)

TRICEPS = dict(
    max_force=624.3, fibre_length=0.1138, tendon_length=0.098, moment_arm=0.02,
    optimal_length=0.8, fast_fibres=0.6, fibre_speed=5.0,
)  # fmt: skip


def synergists():
    return [
        anatomical_muscle(**TRICEPS),
        anatomical_muscle(**{**TRICEPS, "fast_fibres": 0.4, "moment_arm": 0.025}),
        anatomical_muscle(**{**TRICEPS, "max_force": 300.0, "optimal_length": 0.5}),
    ]


def assert_same(first, second, rel=1e-6):
    for field in dataclasses.fields(first):
        if field.name != "sources":
            assert getattr(first, field.name) == pytest.approx(getattr(second, field.name), rel=rel)


def test_one_muscle_is_its_own_equivalent(muscle):
    assert_same(mjhill.equivalent_muscle([muscle]), muscle)


def test_equal_muscles_add_up_in_strength_alone(muscle):
    both = mjhill.equivalent_muscle([muscle, muscle])
    twice = dataclasses.replace(muscle, max_isometric_force=2 * muscle.max_isometric_force)
    assert_same(both, twice)


def test_the_sum_of_torques_is_met_at_every_velocity():
    muscles = synergists()
    equivalent = mjhill.equivalent_muscle(muscles)
    at_optimum = sum(muscle.max_isometric_force for muscle in muscles)
    velocities = np.linspace(0, 20, 50)
    summed = torque_at_velocity(muscles, velocities) / at_optimum
    single = torque_at_velocity([equivalent], velocities) / equivalent.max_isometric_force
    assert np.abs(summed - single).max() < 0.02


def test_the_sum_of_torques_is_met_at_every_length():
    muscles = synergists()
    equivalent = mjhill.equivalent_muscle(muscles)
    lengths = np.linspace(-1.5, 3.0, 50)
    summed = torque_at_length(muscles, lengths)
    single = torque_at_length([equivalent], lengths)
    assert np.abs(summed - single).max() < 0.02 * summed.max()
    assert equivalent.max_isometric_force < sum(m.max_isometric_force for m in muscles)


def test_stretches_are_averaged_with_stronger_muscles_weighted_more():
    stiff = anatomical_muscle(**TRICEPS)
    soft = dataclasses.replace(
        stiff, series_stretch=2 * stiff.series_stretch,
        max_isometric_force=3 * stiff.max_isometric_force,
    )  # fmt: skip
    equivalent = mjhill.equivalent_muscle([stiff, soft])
    shares = np.array([0.1, 0.5, 1.0])
    expected = 0.25 * stretch_at_force(stiff, shares) + 0.75 * stretch_at_force(soft, shares)
    np.testing.assert_allclose(stretch_at_force(equivalent, shares), expected, rtol=1e-6)


def test_anatomy_gives_torques_and_angles_over_the_moment_arm():
    near, far = (anatomical_muscle(**{**TRICEPS, "moment_arm": r}) for r in (0.02, 0.04))
    assert near.max_isometric_force == pytest.approx(624.3 * 0.02)
    assert far.max_isometric_force == pytest.approx(2 * near.max_isometric_force)
    assert far.max_velocity == pytest.approx(near.max_velocity / 2)
    assert far.series_stretch == pytest.approx(near.series_stretch / 2)


def test_faster_fibres_have_shorter_time_constants_within_equation_12():
    slow, fast = (anatomical_muscle(**{**TRICEPS, "fast_fibres": x}) for x in (0.0, 1.0))
    assert (fast.excitation_tau, slow.excitation_tau) == pytest.approx((0.020, 0.050))
    assert (fast.activation_tau, slow.activation_tau) == pytest.approx((0.005, 0.015))
    assert (fast.deactivation_tau, slow.deactivation_tau) == pytest.approx((0.020, 0.060))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"moment_arm": 0.0}, "moment_arm must be positive, got 0.0"),
        ({"fibre_length": float("nan")}, "fibre_length must be positive, got nan"),
        ({"fast_fibres": 1.2}, r"fast_fibres must be in \[0, 1\], got 1.2"),
    ],
)
def test_impossible_anatomy_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        anatomical_muscle(**{**TRICEPS, **change})


def test_no_muscle_has_no_equivalent(muscle):
    with pytest.raises(ValueError, match="needs at least one muscle"):
        mjhill.equivalent_muscle([])
    stimulated = dataclasses.replace(muscle, electrical_stimulation=True)
    with pytest.raises(ValueError, match="electrical_stimulation must be the same"):
        mjhill.equivalent_muscle([muscle, stimulated])
