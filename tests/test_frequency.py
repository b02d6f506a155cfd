from math import pi, radians

import numpy as np
import pytest
from scipy.signal import lsim

from mjhill.analysis.frequency import (
    SecondOrderFrequency,
    decibel,
    fit_compliance,
    fit_second_order,
    octaves,
    response_at,
    second_order_band,
)

TIME = np.arange(4000) * 1e-3
BAND = octaves(0.25, 16.0)


def test_gain_and_phase_of_a_delayed_copy_are_exact():
    drive = 0.3 + 0.1 * np.sin(2 * pi * 2.0 * TIME)
    output = 1.0 + 0.25 * np.sin(2 * pi * 2.0 * (TIME - 0.05))
    response = response_at(TIME, drive, output, 2.0)
    assert response.gain == pytest.approx(2.5)
    assert response.phase == pytest.approx(-2 * pi * 2.0 * 0.05)
    assert response.coherence == pytest.approx(1.0)


def test_a_record_that_is_no_whole_number_of_cycles_gives_the_same():
    turning = 2 * pi * 1.7 * TIME
    response = response_at(TIME, np.sin(turning), 2 * np.cos(turning) + 5.0, 1.7)
    assert response.gain == pytest.approx(2.0)
    assert response.phase == pytest.approx(pi / 2)


def test_a_drift_does_no_harm():
    drive = np.sin(2 * pi * 2.0 * TIME)
    response = response_at(TIME, drive, 0.1 * drive + 3.0 * TIME, 2.0)
    assert (response.gain, response.phase) == pytest.approx((0.1, 0.0), abs=1e-9)
    assert response.coherence == pytest.approx(1.0)


def test_coherence_is_the_share_of_variance_at_the_driving_frequency():
    drive = np.sin(2 * pi * 2.0 * TIME)
    harmonic = 0.5 * np.sin(2 * pi * 4.0 * TIME)
    assert response_at(TIME, drive, drive + harmonic, 2.0).coherence == pytest.approx(0.8, abs=0.01)
    noise = np.random.default_rng(0).normal(size=len(TIME))
    assert response_at(TIME, drive, noise, 2.0).coherence < 0.02


def test_measured_response_of_a_simulated_oscillator_is_its_transfer_function():
    truth = SecondOrderFrequency(0.4, 3.0, 0.35)
    pulsation = 2 * pi * truth.natural_frequency
    system = ([0.4 * pulsation**2], [1.0, 2 * 0.35 * pulsation, pulsation**2])
    for frequency in (1.0, 3.0, 6.0):
        drive = np.sin(2 * pi * frequency * TIME)
        _, output, _ = lsim(system, drive, TIME)
        response = response_at(TIME[2000:], drive[2000:], output[2000:], frequency)
        expected = complex(truth.response(frequency))
        assert response.gain == pytest.approx(abs(expected), rel=1e-3)
        assert response.phase == pytest.approx(np.angle(expected), abs=1e-3)


@pytest.mark.parametrize("truth", [(0.4, 3.0, 0.35), (2.0, 0.7, 1.0), (1e-3, 5.0, 4.0)])
def test_second_order_fit_finds_the_system_it_was_given(truth):
    response = SecondOrderFrequency(*truth).response(BAND)
    fit = fit_second_order(BAND, np.abs(response), np.unwrap(np.angle(response)))
    assert (fit.gain, fit.natural_frequency, fit.damping_ratio) == pytest.approx(truth, rel=1e-4)


def test_second_order_fit_does_not_mind_whole_turns_of_phase():
    response = SecondOrderFrequency(1.0, 2.0, 0.5).response(BAND)
    gain, phase = np.abs(response), np.angle(response)
    one, other = (fit_second_order(BAND, gain, p) for p in (phase, phase + 2 * pi))
    assert one.damping_ratio == pytest.approx(other.damping_ratio, rel=1e-6)


@pytest.mark.parametrize("truth", [(30.0, 0.5, 0.02), (2.0, 6.0, 0.05), (1e3, 1.0, 0.02)])
def test_a_fit_to_compliance_finds_the_system_it_was_given(truth):
    stiffness, damping, inertia = truth
    band = np.linspace(1.0, 15.0, 30)
    s = 2j * pi * band
    fit, explained = fit_compliance(band, 1 / (inertia * s**2 + damping * s + stiffness))
    assert tuple(fit) == pytest.approx(truth, rel=1e-6)
    assert explained == pytest.approx(1.0)


def test_a_fit_to_compliance_is_nearer_than_any_system_beside_it():
    band = np.linspace(1.0, 15.0, 30)
    s = 2j * pi * band
    compliance = 1 / (0.02 * s**2 + 0.5 * s + 40.0 + 400.0 * s / (s + 20.0))  # no second order

    def misfit(stiffness, damping, inertia):
        return np.sum(np.abs(1 / (inertia * s**2 + damping * s + stiffness) - compliance) ** 2)

    fit, explained = fit_compliance(band, compliance)
    least = misfit(*fit)
    assert explained == pytest.approx(1 - least / np.sum(np.abs(compliance) ** 2))
    for place in range(3):
        for factor in (0.99, 1.01):
            beside = list(fit)
            beside[place] *= factor
            assert misfit(*beside) > least


def test_a_second_order_system_is_second_order_over_the_whole_band():
    response = SecondOrderFrequency(1.0, 2.0, 0.5).response(BAND)
    _, highest = second_order_band(BAND, np.abs(response), np.angle(response))
    assert highest == BAND[-1]


def test_a_lag_in_series_ends_the_band_and_a_slower_lag_ends_it_sooner():
    second = SecondOrderFrequency(1.0, 1.0, 0.7).response(BAND)
    ends = []
    for tau in (0.02, 0.1):
        response = second / (1 + 2j * pi * BAND * tau) ** 3
        ends.append(second_order_band(BAND, np.abs(response), np.angle(response))[1])
    assert ends[1] < ends[0] < BAND[-1]


def test_the_fit_of_a_band_is_off_by_no_more_than_allowed():
    response = SecondOrderFrequency(1.0, 1.0, 0.7).response(BAND) / (1 + 0.4j * BAND) ** 2
    gain, phase = np.abs(response), np.angle(response)
    fit, highest = second_order_band(BAND, gain, phase)
    inside = highest >= BAND
    gain_errors, phase_errors = fit.errors(BAND[inside], gain[inside], phase[inside])
    assert np.abs(gain_errors).max() <= 3.0
    assert np.abs(phase_errors).max() <= radians(30.0)


def test_decibels_are_twenty_for_ten():
    assert decibel([1.0, 10.0, 0.1]).tolist() == pytest.approx([0.0, 20.0, -20.0])
    assert decibel([2.0], reference=2.0).tolist() == pytest.approx([0.0])


def test_octaves_are_evenly_spaced_and_end_at_both_ends():
    assert octaves(1.0, 4.0, 1).tolist() == pytest.approx([1.0, 2.0, 4.0])


@pytest.mark.parametrize("frequency", [0.2, 300.0])
def test_a_record_that_cannot_show_the_frequency_is_refused(frequency):
    with pytest.raises(ValueError, match="at least one cycle and four samples"):
        response_at(TIME, TIME, TIME, frequency)


def test_a_drive_without_the_frequency_is_refused():
    with pytest.raises(ValueError, match="the input signal does not contain 2 Hz"):
        response_at(TIME, np.zeros_like(TIME), np.sin(TIME), 2.0)


def test_a_fit_of_one_frequency_or_without_gain_is_refused():
    with pytest.raises(ValueError, match="needs at least two frequencies"):
        fit_second_order([1.0], [1.0], [0.0])
    with pytest.raises(ValueError, match="positive"):
        fit_second_order([1.0, 2.0], [1.0, 0.0], [0.0, 0.0])
    with pytest.raises(ValueError, match="0 < low < high"):
        octaves(4.0, 1.0)
