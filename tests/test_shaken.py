"""Simulations on the bench that go bad."""

from dataclasses import replace

import numpy as np
import pytest
from mjhill.lab.dynamometry import runs, stiff_machine

import mjhill
from mjhill.experiments.trials.sinusoids import shaken
from mjhill.lab.drives import Drive
from mjhill.lab.rig import UnmeasuredError, rig


@pytest.fixture
def wild(elbow):
    """An elbow whose springs are far too stiff for the steps of the bench."""
    return replace(elbow, inertia=1e-9, stiffness=1e6)


def test_a_joint_that_cannot_be_simulated_is_not_shaken(wild):
    drive = Drive("shaken", 0.0, {}, 1e3)
    with pytest.raises(UnmeasuredError, match="elbow: MuJoCo warned"):
        shaken(rig(wild), wild.rest_angle, [drive], np.array([2.0, 4.0]))


def test_a_joint_that_cannot_be_simulated_is_not_measured_on_the_dynamometer(wild):
    machine = stiff_machine(mjhill.JOINTS["elbow"])
    with pytest.raises(UnmeasuredError, match="elbow: MuJoCo warned"):
        runs(wild, machine, np.full(400, 1.0) + np.linspace(0, 1, 400))
