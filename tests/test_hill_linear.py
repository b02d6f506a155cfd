"""``hill-linear``: responses add up, and elements are those of ``hill`` at an operating point."""

from dataclasses import replace

import numpy as np
import pytest

import mjhill
from mjhill.lab.batch import joint_angles
from mjhill.ladder import rung
from mjhill.muscles import model_of, steady_tension
from mjhill.muscles.readings import series_stiffness, steady_stretch


def travels(joint, excitations):
    """Angle of a free joint over 0.6 s, one row for each pair of excitations, for 100 ms each."""
    inputs = np.zeros((len(excitations), 600, 2))
    inputs[:, 100:200] = np.array(excitations)[:, None]
    return joint_angles(
        [joint] * len(excitations), start=joint.home_angle + 0.2, excitation=inputs, steps=600,
        timestep=1e-3,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["elbow", "ankle", "wrist"])
def test_responses_add_up_and_those_of_hill_do_not(name):
    joint = mjhill.JOINTS[name]
    levels = [(0.0, 0.0), (0.3, 0.0), (0.0, 0.5), (0.3, 0.5), (0.6, 0.0)]
    off = {}
    for kind in ("hill-linear", "hill"):
        still, one, other, both, double = travels(rung(kind, joint), levels)
        size = np.ptp(double - still)
        sum_ = np.abs((one - still) + (other - still) - (both - still)).max()
        off[kind] = max(sum_, np.abs(2 * (one - still) - (double - still)).max()) / size
    assert off["hill-linear"] < 1e-6
    assert off["hill"] > 1e-2


@pytest.mark.parametrize("name", ["elbow", "ankle", "eye"])
def test_it_does_as_hill_at_the_operating_point(name):
    joint = mjhill.JOINTS[name]
    linear = joint.with_muscles("hill-linear")
    for muscle, own in joint.muscles.items():
        home = joint.gears[muscle] * joint.home_angle
        made = linear.muscles[muscle]
        for u in (0.1, 0.5, 1.0):
            wanted = steady_tension(own, u, home)
            assert steady_tension(made, u, home) == pytest.approx(wanted, rel=1e-9)
        assert made.stiffness == series_stiffness(own, steady_stretch(own, 0.5, home))
        hill, states = model_of(own), mjhill.muscles.steady_states(own, 0.5, home)
        context = {"a": states[1], "length": home}
        nudge = 1e-6 * own.series_stretch
        shortening = hill.ask(
            hill.readings["velocity"][1], own, **context, s=states[2] + nudge
        )  # a stretch less by a nudge
        slope = made.stiffness * nudge / shortening
        assert made.damping == pytest.approx(slope, rel=1e-3)


def test_its_spring_pushes():
    """A muscle that is stretched pulls, and one that is let back pushes: the dashpot does both."""
    model = mjhill.load("elbow", muscle="hill-linear")
    with mjhill.installed():
        run = mjhill.record(
            model,
            mjhill.at_home(model),
            duration=2.0,
            excitation={"elbow_flexor": mjhill.pulse(1.0, 0.05, 0.3)},
        )
    full = mjhill.JOINTS["elbow"].muscles["elbow_extensor"].max_isometric_force
    assert run["elbow_extensor.force"].max() > 0.01 * full
    assert run["elbow_extensor.force"].min() < -0.01 * full


def test_a_stimulated_muscle_is_refused():
    joint = mjhill.JOINTS["elbow"]
    shocked = {k: replace(m, electrical_stimulation=True) for k, m in joint.muscles.items()}
    with pytest.raises(ValueError, match="electrical_stimulation cannot be made one of 'hill-lin"):
        replace(joint, muscles=shocked).with_muscles("hill-linear")


def test_parameters_out_of_bounds_are_refused():
    made = mjhill.JOINTS["elbow"].with_muscles("hill-linear").muscles["elbow_flexor"]
    for name in ("stiffness", "damping"):
        with pytest.raises(ValueError, match=f"{name} must be in "):
            replace(made, **{name: 0.0})
