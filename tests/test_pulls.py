"""What pulls a fit, on linear problems whose answer is known."""

import numpy as np
import pytest

from mjhill.identification.pulls import held_back, pushed


def balance(slopes, wanted):
    """Residuals at the least-squares solution of a linear problem."""
    slopes = np.array(slopes, dtype=float)
    point = np.linalg.lstsq(slopes, np.array(wanted, dtype=float), rcond=None)[0]
    return slopes @ point - wanted, slopes


def test_what_disagrees_about_a_parameter_holds_each_other_back():
    # a and b want different values of the first parameter; c alone decides the second
    residuals, slopes = balance([[1, 0], [1, 0], [0, 1]], [1.0, 3.0, 5.0])
    assert held_back(["a", "b", "c"], residuals, slopes, ()) == {"a": "b", "b": "a", "c": ""}


def test_residuals_of_one_label_count_together():
    residuals, slopes = balance([[1], [1], [1], [1]], [0.0, 2.0, 2.1, 4.0])
    found = held_back(["low", "middle", "middle", "high"], residuals, slopes, ())
    assert found["low"].split("; ")[0] == "high"
    assert found["high"].split("; ")[0] == "low"


def test_a_parameter_on_a_bound_takes_no_part():
    residuals, slopes = balance([[1, 0], [1, 0], [0, 1], [0, 1]], [1.0, 3.0, 5.0, 6.0])
    free = held_back(list("abcd"), residuals, slopes, ())
    assert free["c"] == "d"
    assert held_back(list("abcd"), residuals, slopes, [1])["c"] == ""


@pytest.mark.parametrize("upper", [True, False])
def test_what_wants_more_pushes_to_the_upper_bound(upper):
    # residuals are simulated less wanted: a negative one with a rising slope wants more
    labels, slopes = ["more", "less"], np.array([1.0, 1.0])
    residuals = np.array([-2.0, 1.0])
    assert pushed(labels, residuals, slopes, upper=upper) == ("more" if upper else "less")
