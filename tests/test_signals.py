import copy
import dataclasses
import functools
import math
import operator
import pickle

import numpy as np
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


MADE = {
    "constant": lambda: mjhill.constant(0.5),
    "step": lambda: mjhill.step(0.5, 0.1),
    "pulse": lambda: mjhill.pulse(1.0, 0.25, 0.5),
    "sinusoid": lambda: mjhill.sinusoid(2.0, 4.0, 0.3),
    "sum": lambda: 0.1 + mjhill.step(0.5, 0.75) + 2 * mjhill.pulse(1.0, 0.25, 0.5),
    "own function": lambda: mjhill.Signal(math.sin, [0.5]),
}


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda signal: pickle.loads(pickle.dumps(signal))]
)
def test_a_copy_of_a_signal_is_equal_and_has_the_same_values(make, copied):
    signal = make()
    other = copied(signal)
    assert other == signal == make()
    assert hash(other) == hash(signal) == hash(make())
    times = np.linspace(-0.1, 1.3, 57).tolist()
    assert [other(t) for t in times] == [signal(t) for t in times]
    assert other.breaks == signal.breaks


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
def test_a_signal_as_a_dict_has_its_numbers(make):
    numbers = dataclasses.asdict(make())
    assert set(numbers) == {"value", "breaks"}


def test_signals_with_other_numbers_differ():
    assert mjhill.step(0.5, 0.1) != mjhill.step(0.5, 0.2)
    assert mjhill.constant(0.5) != mjhill.step(0.5)


def test_a_train_of_many_pulses_is_one_sum():
    pulses = [mjhill.pulse(1.0, 0.01 * k, 0.005) for k in range(3000)]
    train = functools.reduce(operator.add, pulses)
    assert pickle.loads(pickle.dumps(train)) == train
    assert [train(t) for t in (0.002, 0.007, 29.992, 31.0)] == [1.0, 0.0, 1.0, 0.0]


def test_a_sum_adds_from_the_left():
    signal = mjhill.constant(0.1) + 0.2 + 0.3
    assert signal(0.0) == 0.1 + 0.2 + 0.3
    assert (mjhill.constant(0.1) + (mjhill.constant(0.2) + 0.3))(0.0) == 0.1 + (0.2 + 0.3)
