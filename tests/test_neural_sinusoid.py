from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
import pytest
from matplotlib.figure import Figure

import mjhill
from mjhill.analysis.frequency import octaves
from mjhill.experiments.neural_sinusoid import NeuralSinusoid, neural_sinusoid
from mjhill.lab.postures import resting_angle
from mjhill.simulate.reference import rest_state, simulate
from mjhill.simulate.signals import constant, sinusoid

FEW = (0.5, 1.0, 2.0, 4.0, 8.0)


@cache
def elbow_sinusoid() -> NeuralSinusoid:
    return neural_sinusoid(frequencies=octaves(0.25, 16.0, 2).tolist())


def linear_elbow() -> mjhill.Joint:
    """An elbow of two equal muscles of which little but their activation is left."""
    elbow = mjhill.JOINTS["elbow"]
    flexor = replace(
        elbow.muscles["elbow_flexor"],
        max_velocity=5e3,
        velocity_activation=0.0,
        width_short=1e3,
        width_long=1e3,
        series_stretch=1e-2,
        deactivation_tau=elbow.muscles["elbow_flexor"].activation_tau,
    )
    return replace(
        elbow,
        stiffness=50.0,
        damping=3.0,
        passive=replace(elbow.passive, k1_pos=0.0, k1_neg=0.0),
        muscles={"elbow_flexor": flexor, "elbow_extensor": flexor},
    )


@cache
def linear_sinusoid() -> NeuralSinusoid:
    return neural_sinusoid(linear_elbow(), frequencies=FEW, amplitudes=(0.05, 0.2))


def test_a_linear_joint_answers_as_its_transfer_function():
    joint, result = linear_elbow(), linear_sinusoid()
    muscle = joint.muscles["elbow_flexor"]
    s = 2j * pi * np.array(FEW)
    lags = (1 + s * muscle.excitation_tau) * (1 + s * muscle.activation_tau)
    plant = joint.inertia * s**2 + joint.damping * s + joint.stiffness
    expected = 2 * muscle.max_isometric_force / (lags * plant)
    for sweep in result.sweeps().values():
        np.testing.assert_allclose(sweep.gain, np.abs(expected), rtol=0.06)
        np.testing.assert_allclose(sweep.phase, np.unwrap(np.angle(expected)), atol=0.08)
        assert sweep.coherence.min() > 0.999


def test_a_linear_joint_does_not_depend_on_amplitude_and_the_claim_falls():
    holds = [claim.holds for claim in linear_sinusoid().claims()]
    assert holds[0] is True
    assert holds[3] is False
    assert holds[4] is False


def test_the_elbow_bears_out_what_the_paper_says_of_neural_sinusoids():
    assert [claim.holds for claim in elbow_sinusoid().claims()] == [True] * 5


def test_gain_is_the_swing_that_the_stiff_solver_finds(elbow):
    sweep = elbow_sinusoid().sweeps()["0.25 ± 0.25"]
    at = int(np.argmin(np.abs(sweep.frequency - 2.0)))
    levels = dict.fromkeys(elbow.muscles, 0.25)
    excitation = {
        name: constant(0.25) + sinusoid(sign * 0.25, 2.0)
        for name, sign in zip(elbow.muscles, (1, -1), strict=True)
    }
    start = rest_state(elbow, resting_angle(elbow, levels), levels)
    reference = simulate(elbow, excitation, duration=2.0, start=start)
    late = reference["elbow.angle"][reference.time > 1.5]
    assert 0.5 * np.ptp(late) == pytest.approx(0.25 * sweep.gain[at], rel=0.05)


def test_gain_falls_and_phase_lags_more_towards_high_frequencies():
    for sweep in elbow_sinusoid().sweeps().values():
        assert sweep.gain[-1] < 0.1 * sweep.gain[0]
        assert sweep.phase[-1] < sweep.phase[0] < 0


def test_bandwidth_is_where_the_gain_is_three_decibels_down():
    sweep = elbow_sinusoid().amplitudes[0]
    gain = np.exp(np.interp(np.log(sweep.bandwidth), np.log(sweep.frequency), np.log(sweep.gain)))
    assert gain / sweep.gain[0] == pytest.approx(10 ** (-3 / 20), rel=0.01)


def test_a_gain_that_stays_up_has_no_bandwidth():
    sweep = elbow_sinusoid().amplitudes[0]
    assert replace(sweep, gain=np.ones_like(sweep.gain)).bandwidth is None


def test_a_joint_is_at_rest_between_equal_muscles(elbow):
    head = mjhill.JOINTS["head"]
    assert resting_angle(head, dict.fromkeys(head.muscles, 0.3)) == pytest.approx(0.0, abs=1e-9)
    stronger = resting_angle(elbow, {"elbow_flexor": 0.2, "elbow_extensor": 0.05})
    assert stronger > resting_angle(elbow)


def test_the_film_swings_both_ways(elbow):
    film = elbow_sinusoid().film()
    assert film is not None
    both = film["elbow_flexor.u"] + film["elbow_extensor.u"]
    np.testing.assert_allclose(both, 0.5, atol=1e-12)
    assert np.ptp(film["elbow.angle"]) > 0.05


def test_the_figure_has_gain_phase_and_coherence_by_amplitude_and_by_offset():
    figure = Figure(figsize=NeuralSinusoid.size, layout="constrained")
    elbow_sinusoid().draw(figure)
    assert len(figure.axes) == 6
    assert figure.axes[0].get_title() == "by amplitude"
    assert figure.axes[1].get_title() == "by offset"


def test_measures_are_named_once():
    names = [measure.name for measure in elbow_sinusoid().measures()]
    assert len(names) == len(set(names))
    assert "0.25 ± 0.1: second order up to" in names


def test_progress_is_told_to_the_end():
    shares: list[float] = []
    neural_sinusoid(frequencies=(2.0, 4.0, 8.0, 16.0), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"joint": "shoulder"}, "unknown joint 'shoulder'"),
        ({"amplitudes": (0.1, 0.3)}, "offset ± amplitude must stay in .0, 1., got 0.25 ± 0.3"),
        ({"offsets": (0.25, 0.95)}, "got 0.95 ± 0.1"),
        ({"amplitudes": (0.1,)}, "amplitudes must be at least two, ascending"),
        ({"offsets": (0.5, 0.25)}, "offsets must be at least two, ascending"),
        ({"frequencies": (1.0, 2.0)}, "frequencies must be at least four, ascending"),
        ({"frequencies": (1.0, 2.0, 4.0, 200.0)}, "in .0, 100. Hz"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        neural_sinusoid(**options)
