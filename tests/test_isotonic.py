from dataclasses import replace
from functools import cache
from math import degrees, radians

import numpy as np
import pytest
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.isotonic import (
    BOTH,
    INERTIA,
    NAIVE,
    RELEASE,
    Isotonic,
    isotonic,
    torque_velocity_curve,
)
from mjhill.lab.rig import UnmeasuredError


@cache
def elbow_release() -> Isotonic:
    return isotonic()


def test_the_element_is_recovered_once_the_limb_is_subtracted():
    errors = elbow_release().errors()
    assert errors[BOTH] < 0.03
    assert errors[BOTH] < errors[NAIVE]


def test_what_is_subtracted_leaves_the_force_of_the_muscle():
    result = elbow_release()
    torques = result.estimates()[BOTH]
    for torque, recording in zip(torques, result.recordings.values(), strict=True):
        angle = recording["elbow.angle"]
        passed = int(np.argmax(angle >= result.angle))
        net = recording["elbow_flexor.force"] - recording["elbow_extensor.force"]
        # the acceleration of a step is read from the velocities around it
        assert torque == pytest.approx(net[passed], abs=0.02 * result.held)


def test_the_joint_stays_until_the_load_drops():
    for recording in elbow_release().recordings.values():
        before = recording["elbow.angle"][recording.time < RELEASE]
        assert np.ptp(before) < 1e-6


def test_the_heavier_the_load_the_slower_the_joint():
    velocities = [point.velocity for point in elbow_release().points]
    assert np.all(np.diff(velocities) < 0)


def test_the_torque_velocity_curve_is_hills(elbow):
    muscle = replace(elbow.muscles["elbow_flexor"], velocity_activation=0.0, viscosity=1e-6)
    velocity, torque = torque_velocity_curve(muscle, muscle.optimal_length)
    assert torque[0] == pytest.approx(muscle.max_isometric_force)
    assert velocity[-1] == pytest.approx(muscle.max_velocity, rel=1e-3)
    share, speed = torque / muscle.max_isometric_force, velocity / muscle.max_velocity
    a = muscle.hill_shape
    np.testing.assert_allclose((share + a) * (speed + a), (1 + a) * a, rtol=1e-3)


def test_a_heavy_limb_makes_the_bare_load_useless_and_inertia_is_why(elbow):
    result = isotonic(replace(elbow, inertia=0.8, damping=0.0))
    errors, claims = result.errors(), list(result.claims())
    assert errors[NAIVE] > 0.1
    assert errors[INERTIA] < 0.5 * errors[NAIVE]
    assert [claim.holds for claim in claims] == [True, True]


def test_in_a_light_limb_inertia_is_not_why(elbow):
    result = isotonic(replace(elbow, inertia=0.005), loads=(0.2, 0.4, 0.6, 0.8))
    errors = result.errors()
    assert errors[INERTIA] == pytest.approx(errors[NAIVE], abs=0.02)
    assert errors[BOTH] < 0.03
    assert next(iter(result.claims())).holds is False


def test_angles_can_be_chosen():
    result = isotonic(angle=radians(90), start=radians(50), loads=(0.1, 0.3, 0.5))
    assert (degrees(result.angle), degrees(result.start)) == pytest.approx((90, 50))
    first = next(iter(result.recordings.values()))
    assert first["elbow.angle"][0] == pytest.approx(radians(50))


def test_mirrored_muscles_read_alike():
    loads = (0.1, 0.3, 0.6)
    left, right = (
        isotonic("head", muscle=muscle, loads=loads) for muscle in mjhill.JOINTS["head"].muscles
    )
    assert left.errors() == pytest.approx(right.errors(), rel=1e-6)


def test_loads_that_do_not_pass_the_angle_are_said(elbow):
    result = isotonic(loads=(0.05, 0.1, 0.2, 0.95), duration=0.25)
    assert len(result.missed) == 1
    unseen = [measure for measure in result.measures() if measure.value is None]
    assert [measure.note for measure in unseen] == ["not passed"]


def test_the_figure_has_runs_and_torque_against_velocity():
    figure = Figure(figsize=Isotonic.size, layout="constrained")
    elbow_release().draw(figure)
    assert [axis.get_ylabel() for axis in figure.axes] == ["angle [°]", "torque [N·m]"]


def test_the_film_is_the_lightest_load():
    film = elbow_release().film()
    assert film is elbow_release().recordings["5%"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"joint": "shoulder"}, "unknown joint 'shoulder'"),
        ({"muscle": "biceps"}, "unknown muscle 'biceps'; there are: elbow_flexor"),
        ({"loads": (0.5, 0.1, 0.7)}, "loads must be at least 3, ascending"),
        ({"loads": (0.1, 0.5, 1.0)}, "in .0, 1. of the torque held"),
        ({"duration": 0.01}, "duration must be above 0.05 s"),
        ({"angle": 9.0}, "angle and start must be in the range of elbow, 0 to 143°"),
        ({"angle": 1.0, "start": 1.5}, "elbow_flexor must pull from start to angle"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        isotonic(**options)


def test_too_few_loads_that_pass_are_refused():
    with pytest.raises(UnmeasuredError, match="give lighter loads"):
        isotonic(loads=(0.7, 0.8, 0.9), duration=0.1)
