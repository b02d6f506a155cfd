"""The first swing as that of a second-order system."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from mjhill.analysis.responses import SecondOrder
from mjhill.analysis.swing import first_swing, second_order_response
from mjhill.experiments.external_impulse import swing_measures


def swung(stiffness, damping, inertia=0.1, width=0.02, duration=2.0):
    """A second-order system after a hit of 1 N·m, from rest."""
    step = 5e-4
    time = np.arange(round(duration / step) + 1) * step
    load = np.where(time < width - 0.5 * step, 1.0, 0.0)
    fit = SecondOrder(stiffness, damping, inertia)
    deflection = second_order_response(fit, time, load)
    _, velocity, _ = lsim(([1.0, 0.0], [inertia, damping, stiffness]), load, time, interp=False)
    return first_swing(time, deflection, velocity, load, inertia)


@pytest.mark.parametrize(("stiffness", "damping"), [(10.0, 0.4), (50.0, 1.0), (3.0, 2.0)])
def test_a_second_order_system_is_found_again(stiffness, damping):
    swing = swung(stiffness, damping)
    assert swing.stiffness == pytest.approx(stiffness, rel=0.01)
    assert swing.damping == pytest.approx(damping, rel=0.01)
    assert swing.fitted_inertia == pytest.approx(0.1, rel=0.01)
    assert swing.misfit < 0.005
    assert swing.natural_frequency == pytest.approx(
        np.sqrt(stiffness / 0.1) / (2 * np.pi), rel=0.01
    )
    assert swing.damping_ratio == pytest.approx(damping / 2 / np.sqrt(0.1 * stiffness), rel=0.02)


def test_an_undamped_swing_peaks_after_a_quarter_of_its_period():
    swing = swung(40.0, 0.0, width=0.001)
    period = 2 * np.pi * np.sqrt(0.1 / 40.0)
    assert swing.time_to_peak == pytest.approx(period / 4, abs=2e-3)
    assert swing.window == pytest.approx(period / 2, abs=4e-3)


def test_a_system_that_does_not_come_back_is_fitted_over_the_whole_run():
    swing = swung(0.0, 5.0, duration=0.4)
    assert swing.time_to_peak is None
    assert swing.window == pytest.approx(0.4)
    notes = {measure.name: measure.note for measure in swing_measures("x", swing)}
    assert "does not turn" in notes["time to peak, x"]


def test_a_system_that_runs_away_has_no_natural_frequency():
    swing = swung(-5.0, 1.0, duration=0.4)
    assert swing.stiffness < 0
    assert swing.natural_frequency is None
    assert swing.damping_ratio is None


def test_an_inertia_that_no_limb_has_is_not_seen():
    found = replace(swung(10.0, 0.4), fitted_inertia=-0.01)
    measures = {measure.name: measure for measure in swing_measures("x", found)}
    assert measures["fitted inertia J, x"].value is None
    assert "none above 0" in measures["fitted inertia J, x"].note
