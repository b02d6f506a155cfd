import pytest

import mjhill


def test_a_step_holds_its_level_from_its_start():
    signal = mjhill.step(0.5, 0.1)
    assert [signal(t) for t in (0.0, 0.0999, 0.1, 9.0)] == [0.0, 0.0, 0.5, 0.5]
    assert signal.breaks == (0.1,)


def test_a_pulse_ends_after_its_width():
    signal = mjhill.pulse(1.0, 0.25, 0.5)
    assert [signal(t) for t in (0.2, 0.25, 0.7, 0.75)] == [0.0, 1.0, 1.0, 0.0]
    assert signal.breaks == (0.25, 0.75)


def test_sums_keep_the_jumps_of_both():
    signal = 0.1 + mjhill.step(0.5, 0.75) + 2 * mjhill.pulse(1.0, 0.25, 0.5)
    assert signal.breaks == (0.25, 0.75)
    assert signal(0.5) == pytest.approx(2.1)
    assert signal(0.8) == pytest.approx(0.6)


def test_a_sinusoid_has_the_period_of_its_frequency():
    signal = mjhill.sinusoid(2.0, 4.0)
    assert signal(1 / 16) == pytest.approx(2.0)
    assert signal(0.25 + 1 / 16) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: mjhill.pulse(1.0, 0.0, 0.0), "width must be positive and finite, got 0"),
        (lambda: mjhill.sinusoid(1.0, -2.0), "frequency must be positive and finite, got -2"),
        (lambda: mjhill.step(float("inf")), "level must be finite, got inf"),
    ],
)
def test_bad_numbers_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
