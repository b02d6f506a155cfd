"""The noise of a fit: its size, how it hangs together, and what a noisy input adds."""

import numpy as np
import pytest

from mjhill.identification.noise import correlation_time, noise_of, white_noise

RANDOM = np.random.default_rng(11)


def smoothed(count, decay):
    """Noise whose correlation falls by a factor ``decay`` from sample to sample."""
    values = RANDOM.standard_normal(count)
    for k in range(1, count):
        values[k] += decay * values[k - 1]
    return values


def test_white_noise_counts_sample_by_sample():
    times = [correlation_time(RANDOM.standard_normal(1000)) for _ in range(50)]
    assert np.mean(times) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("decay", [0.5, 0.9])
def test_noise_that_hangs_together_counts_as_fewer_samples(decay):
    # (1 + r)/(1 - r) of a first-order process
    times = [correlation_time(smoothed(5000, decay)) for _ in range(20)]
    assert np.mean(times) == pytest.approx((1 + decay) / (1 - decay), rel=0.1)


def test_the_worth_of_a_smooth_disturbance_does_not_depend_on_its_sampling():
    fine = np.convolve(RANDOM.standard_normal(20000), np.hanning(200), mode="same")
    ratio = correlation_time(fine) / correlation_time(fine[::10])
    assert ratio == pytest.approx(10, rel=0.1)


def test_residuals_of_nothing_count_sample_by_sample():
    assert correlation_time(np.zeros(100)) == 1.0


def test_white_noise_is_seen_on_a_smooth_signal_and_on_steps():
    time = np.arange(2000) * 5e-3
    noise = 0.1 * RANDOM.standard_normal(2000)
    for signal in (np.zeros(2000), 3 * np.sin(20 * time), 5.0 * (time % 1 > 0.5)):
        assert white_noise(signal + noise) == pytest.approx(0.1, rel=0.1)


def test_what_is_set_and_not_measured_has_no_noise():
    time = np.arange(200) * 5e-3
    assert white_noise(0.5 * (time > 0.3)) == 0.0


def test_noise_of_the_input_is_told_from_that_of_the_output():
    count, output = 1000, 0.3
    shapes = np.cos(np.outer(np.pi * (np.arange(count) + 0.5) / count, np.arange(20)))
    errors = shapes / (1 + np.arange(20))
    scales, sums = [], []
    for _ in range(20):
        left = output * RANDOM.standard_normal(count) + errors @ RANDOM.standard_normal(20)
        noise = noise_of(left, errors, 0, 1.0)
        scales.append(noise.scale)
        sums.append(np.mean(noise.whiten(left) ** 2))
    # correlation times scatter about 1 from above
    assert np.mean(scales) == pytest.approx(1 / output, rel=0.1)
    assert np.mean(sums) == pytest.approx(1.0, abs=0.1)


def test_whitening_is_the_square_root_of_the_inverse_covariance():
    errors = RANDOM.standard_normal((30, 4))
    noise = noise_of(RANDOM.standard_normal(30), errors, 0, 1.0)
    deviation = 1 / noise.scale
    roots = noise.whiten(np.eye(30))
    covariance = np.linalg.inv(roots @ roots)
    # the effect of the input is in units of the white noise, not of what hangs together
    added = covariance - deviation**2 * np.eye(30)
    ratio = added / (errors @ errors.T)
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-6)
    assert ratio[0, 0] >= 0.99


def test_parameters_fitted_take_their_share_of_the_residuals():
    left = RANDOM.standard_normal(100)
    none, some = (noise_of(left, np.zeros((100, 0)), count, 1.0).scale for count in (0, 19))
    assert some == pytest.approx(0.9 * none)
