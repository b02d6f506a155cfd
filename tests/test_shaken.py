"""Simulations of a rig that go bad."""

from dataclasses import replace

import numpy as np
import pytest

import mjhill
from mjhill.experiments.external_sinusoid import Oscillation, frequency_responses
from mjhill.lab.dynamometer import run_paths, stiff_machine
from mjhill.lab.rig import UnmeasuredError, build_rig


@pytest.fixture
def wild(elbow):
    """An elbow whose springs are far too stiff for the timestep."""
    return replace(elbow, inertia=1e-9, stiffness=1e6)


def test_a_joint_that_cannot_be_simulated_has_no_frequency_response(wild):
    oscillation = Oscillation("torque", {}, 1e3)
    with pytest.raises(UnmeasuredError, match="elbow: MuJoCo warned"):
        frequency_responses(build_rig(wild), wild.rest_angle, [oscillation], np.array([2.0, 4.0]))


def test_a_joint_that_cannot_be_simulated_is_not_measured_on_the_dynamometer(wild):
    machine = stiff_machine(mjhill.JOINTS["elbow"])
    with pytest.raises(UnmeasuredError, match="elbow: MuJoCo warned"):
        run_paths(wild, machine, np.full(400, 1.0) + np.linspace(0, 1, 400))
