from dataclasses import replace

import numpy as np
import pytest
from made_joint import MUSCLE, make_joint
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.isovelocity import isovelocity
from mjhill.lab.dynamometer import (
    clamped_path,
    contractile_torque,
    stiff_machine,
    travel_time,
)
from mjhill.lab.rig import UnmeasuredError, muscle_torque
from mjhill.lab.torque_velocity import make_sweep, measure_curve, measure_isometric
from mjhill.muscles.readings import (
    contractile_force,
    shortening_velocity,
    steady_stretch,
    tension,
)

EVEN = replace(MUSCLE, width_short=50.0, width_long=50.0)  # as strong at any angle


def curve(muscle, velocities, before=1.0, angles=None):
    joint = make_joint(muscle)
    sweep = make_sweep(joint, "puller", np.array(velocities), angles)
    return sweep, measure_curve(joint, stiff_machine(joint), sweep, before=before)


# --- the machine's path and the contractile element


def test_a_clamped_path_has_its_velocity_once_up_to_speed_and_stops_at_its_end():
    time = np.linspace(0.0, 2.0, 20001)
    for start, end in ((-0.5, 1.0), (1.0, -0.5)):
        path = clamped_path(start, end, 2.0, time)
        arrival = travel_time(end - start, 2.0)
        assert path[0] == start
        assert path[-1] == pytest.approx(end)
        moving = (time > 0.041) & (time < arrival - 1e-3)
        speed = np.gradient(path, time)
        np.testing.assert_allclose(speed[moving], np.sign(end - start) * 2.0, rtol=1e-6)
        assert abs(path[time < arrival - 1e-3][-1] - end) > 1e-3
        assert abs(np.diff(path)).max() <= 2.0 * 1.001e-4


@pytest.mark.parametrize("velocity", [-20.0, -3.0, -0.1, 0.0, 0.1, 3.0, 9.0])
@pytest.mark.parametrize("activation", [0.3, 1.0])
def test_contractile_force_is_the_inverse_of_shortening_velocity(velocity, activation):
    muscle = replace(MUSCLE, velocity_activation=0.3)
    force = contractile_force(muscle, activation, 0.2, velocity)
    stretch = _stretch_at(muscle, force)
    found = shortening_velocity(muscle, activation, 0.2, stretch)
    assert found == pytest.approx(velocity, abs=1e-6)


def _stretch_at(muscle, force):
    from scipy.optimize import brentq

    return brentq(lambda x: tension(muscle, x) - force, 0.0, 1.0, xtol=1e-15)


def test_contractile_force_is_isometric_at_rest_and_nothing_past_the_largest_velocity():
    assert contractile_force(MUSCLE, 1.0, 0.0, 0.0) == pytest.approx(10.0)
    assert contractile_force(MUSCLE, 1.0, 0.0, 16.0) == 0.0
    assert contractile_force(MUSCLE, 1.0, 0.0, -1000.0) == pytest.approx(13.0, rel=0.1)
    held = tension(MUSCLE, steady_stretch(MUSCLE, 0.5, 0.3))
    assert contractile_force(MUSCLE, 0.5, 0.3, 0.0) == pytest.approx(held)


def test_a_gear_divides_velocity_and_multiplies_force():
    joint = make_joint(gears={"puller": -2.0, "opponent": 1.0})
    assert contractile_torque(joint, "puller", 1.0, 0.0, 3.0) == pytest.approx(
        2 * contractile_force(MUSCLE, 1.0, 0.0, 6.0)
    )


# --- curves


def test_a_contracted_muscle_as_strong_at_any_angle_gives_hills_curve():
    # nothing changes on the way, so the series element keeps its length once it has recoiled
    velocities = [1.0, 2.0, 4.0]
    _, found = curve(EVEN, velocities)
    for k, velocity in enumerate(velocities):
        hill = contractile_force(EVEN, 1.0, 0.0, velocity)
        assert found.at[-1, k] == pytest.approx(hill, rel=0.01)
        assert found.contractile[-1, k] == pytest.approx(hill, rel=0.01)


def test_a_muscle_with_hardly_any_series_element_gives_the_contractile_elements_own():
    quick = replace(MUSCLE, series_stretch=0.004)
    for before in (0.0, 1.0):
        _, found = curve(quick, [0.5, 1.0, 2.0, 4.0, -1.0], before)
        np.testing.assert_allclose(found.at, found.contractile, atol=0.01 * 10.0)


def test_a_series_element_carries_more_than_the_contractile_element_while_it_recoils():
    _, found = curve(replace(EVEN, series_stretch=0.5), [10.0])
    above = (found.at - found.contractile)[:, 0]
    assert above[0] > above[1] > above[2] > 0


def test_the_isometric_torque_is_the_muscles_own():
    joint = make_joint()
    sweep = make_sweep(joint, "puller", np.array([1.0]), np.array([-0.5, 0.0, 0.4]))
    largest, at = measure_isometric(joint, stiff_machine(joint), sweep)
    wanted = [muscle_torque(joint, "puller", 1.0, angle) for angle in sweep.angles]
    np.testing.assert_allclose(at, wanted, rtol=5e-3)
    assert largest == pytest.approx(10.0, rel=5e-3)


# --- the experiment


def test_mirrored_muscles_have_the_same_curves():
    alike = make_joint(passive=mjhill.Passive(k1_pos=0.3, k2_pos=2, k1_neg=0.3, k2_neg=2))
    one, other = (
        isovelocity(alike, muscle=name, velocities=[1.0, 5.0]).curves.relaxed
        for name in alike.muscles
    )
    np.testing.assert_allclose(one.at, other.at, rtol=1e-6)
    np.testing.assert_allclose(one.peak, other.peak, rtol=1e-6)


def test_without_a_series_element_to_remove_there_is_nothing_to_explain():
    quick = make_joint(replace(MUSCLE, series_stretch=0.005), inertia=0.05)
    found = isovelocity(quick, velocities=[1.0, 2.0, 4.0])
    claims = {claim.sentence[:12]: claim.holds for claim in found.claims()}
    assert claims["The series e"] is None
    assert claims["The curves d"] is False
    assert found.curves.rigid > 0.02  # the steps allow no less
    with pytest.raises(UnmeasuredError, match="so stiff a series element"):
        isovelocity(replace(quick, inertia=0.005), velocities=[1.0])


def test_the_eye_is_measured_drawn_filmed_and_ready_for_json():
    shares: list[float] = []
    found = isovelocity("eye", progress=shares.append)
    figure = Figure(figsize=found.size, layout="constrained")
    found.draw(figure)
    assert len(figure.axes) == 4
    numbers = found.as_dict()
    assert all(np.isfinite(measure["value"]) for measure in numbers["measures"])
    assert {claim["holds"] for claim in numbers["claims"]} <= {True, False}
    assert shares[-1] == 1.0
    film = found.film()
    low, high = mjhill.JOINTS["eye"].range
    assert 0.7 * (high - low) < np.ptp(film["eye.angle"]) < high - low
    # clamped: in mid-film the joint moves at one velocity
    middle = film["eye.velocity"][len(film) // 2 : -20]
    assert np.ptp(middle) < 0.02 * abs(middle.mean())


@pytest.mark.parametrize("velocity", [0.0, float("nan"), float("inf"), -float("inf"), 1e3, -1e3])
def test_an_impossible_clamp_velocity_is_refused(velocity):
    with pytest.raises(ValueError, match=r"clamp velocity must not be 0 and at most .* got"):
        isovelocity("elbow", velocities=[1.0, velocity])


def test_other_bad_options_are_refused():
    with pytest.raises(ValueError, match="unknown joint 'toe'"):
        isovelocity("toe")
    with pytest.raises(ValueError, match="unknown muscle 'biceps'; there are: elbow_flexor"):
        isovelocity("elbow", muscle="biceps")
    with pytest.raises(ValueError, match="velocities must have one above 0"):
        isovelocity("elbow", velocities=[-1.0])
    with pytest.raises(ValueError, match="velocities must be a list of numbers"):
        isovelocity("elbow", velocities=[])
    for angle in (0.0, 3.0, float("nan")):
        with pytest.raises(ValueError, match="torque can be read between .* got"):
            isovelocity("elbow", angles=[1.0, angle])
