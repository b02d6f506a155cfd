"""Inputs between samples: held or joined, on time or late."""

import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.identification.inputs import is_held, simulated_step, step_means

TIME = np.arange(201) * 5e-3


def chirp(time):
    return 0.5 - 0.5 * np.cos(2 * np.pi * time * (1 + 2 * time))


@pytest.mark.parametrize(
    "values",
    [
        0.6 * ((TIME > 0.1) & (TIME < 0.3)),
        0.3 * (TIME > 0.5),
        np.where(np.arange(201) % 20 == 7, 1.0, 0.0),  # stimuli of one sample
        np.random.default_rng(0).integers(0, 2, 201).astype(float),  # a random binary sequence
        np.repeat(np.random.default_rng(1).uniform(0, 1, 41), 5)[:201],
        2.0 * (TIME > 0.5) + 0.02 * np.random.default_rng(2).standard_normal(201),
    ],
    ids=["pulse", "step", "stimuli", "binary", "levels", "noisy step"],
)
def test_plateaus_with_jumps_are_held(values):
    assert is_held(values)


def burst(samples):
    """An envelope at rest for most of the time, that rises and falls in some samples."""
    values = np.zeros(201)
    values[120 : 120 + samples] = np.sin(np.linspace(0, np.pi, samples)) ** 2
    return values


@pytest.mark.parametrize(
    "values",
    [
        chirp(TIME),
        chirp(TIME) + 0.02 * np.random.default_rng(3).standard_normal(201),
        burst(20),
        burst(70),
        np.round(chirp(TIME), 2),
        0.02 * np.random.default_rng(4).standard_normal(201),
        np.full(201, 0.3),
    ],
    ids=["chirp", "noisy chirp", "burst", "slow burst", "rounded", "noise", "constant"],
)
def test_smooth_signals_are_joined(values):
    assert not is_held(values)


def test_means_of_a_held_input_are_those_of_its_values():
    values = np.array([0.0, 1.0, 0.4, 0.4])
    time = np.array([0.0, 0.1, 0.2, 0.3])
    edges = np.array([-0.1, 0.0, 0.05, 0.1, 0.15, 0.25, 0.35])
    means = step_means(time, values, edges, hold=True)
    np.testing.assert_allclose(means, [0.0, 0.0, 0.0, 1.0, 0.7, 0.4], atol=1e-12)


def test_means_of_a_joined_input_are_those_of_straight_lines():
    edges = np.linspace(0, 1, 1001)
    means = step_means(TIME, 3 * TIME, edges, hold=False)
    np.testing.assert_allclose(means, 3 * (edges[1:] + edges[:-1]) / 2, atol=1e-12)


@pytest.mark.parametrize("hold", [True, False])
def test_a_late_input_is_the_same_input_later(hold):
    values = chirp(TIME)
    edges = np.linspace(0, 1, 1001)
    delays = np.array([0.0, 0.013, 0.05])
    late = step_means(TIME, values, edges, hold=hold, delay=delays)
    assert late.shape == (3, 1000)
    for delay, row in zip(delays, late, strict=True):
        shifted = step_means(TIME + delay, values, edges, hold=hold)
        np.testing.assert_allclose(row, shifted, atol=1e-12)


def test_means_change_smoothly_with_the_delay():
    values = (TIME > 0.3).astype(float)
    edges = np.linspace(0, 1, 1001)
    later = step_means(TIME, values, edges, hold=True, delay=np.array([0.0, 2e-4, 4e-4]))
    np.testing.assert_allclose(later.sum(axis=1) * 1e-3, later[0].sum() * 1e-3 - [0, 2e-4, 4e-4])


@pytest.mark.parametrize(("integrator", "step"), [("implicitfast", 1e-3), ("RK4", None)])
def test_a_recording_says_by_which_steps_it_was_made(tmp_path, pair, integrator, step):
    import mujoco

    pair.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    with mjhill.installed():
        recording = mjhill.record(pair, rest(pair), duration=0.1, torque={"elbow": 0.1})
    path = recording.save(tmp_path / "run.csv")
    assert simulated_step(path) == (step and pair.opt.timestep)


@pytest.mark.parametrize("first", ["time,angle", "# by hand", '# {"about": 3}', "# [1]", ""])
def test_another_file_was_not_simulated(tmp_path, first):
    path = tmp_path / "measured.csv"
    path.write_text(f"{first}\n0,1\n", encoding="utf-8")
    assert simulated_step(path) is None
