"""Impedance of held joints: closed forms, and simulated oscillations that are the truth."""

from dataclasses import replace
from math import exp, pi, radians, sqrt

import made_joint
import numpy as np
import pytest
from made_joint import MUSCLE

import mjhill
from mjhill.analysis.frequency import fit_compliance, response_at
from mjhill.experiments.external_sinusoid import Oscillation, frequency_responses
from mjhill.identification.facts import facts
from mjhill.identification.measures import measure
from mjhill.joints.system import Movement
from mjhill.lab.impedance import (
    held_impedance,
    joint_impedance,
    passive_stiffness,
    stiffness_slope,
)
from mjhill.lab.postures import static_stiffness
from mjhill.lab.rig import UnmeasuredError, build_rig, muscle_torque
from mjhill.literature.facts import read_entries
from mjhill.simulate.reference import plant_torque, rest_state, simulate

NO_ELASTICITY = mjhill.Passive(k1_pos=0.0, k2_pos=1.0, k1_neg=0.0, k2_neg=1.0)
LIMP = replace(MUSCLE, max_isometric_force=1e-9)
EVEN = replace(MUSCLE, width_short=1e3, width_long=1e3)  # as strong at any length
BAND = np.linspace(1.0, 15.0, 29)


def make_joint(muscle: mjhill.Hill = MUSCLE, **changes) -> mjhill.Joint:
    return made_joint.make_joint(muscle, **{"passive": NO_ELASTICITY, **changes})


def torque_on(joint, held, angle, position, velocity, acceleration, duration, sample):
    """Time, deflection and the torque that moves a joint along a path, by SciPy's solver."""
    movement = Movement(lambda t: angle + position(t), velocity)
    run = simulate(
        joint, held, movement={joint.name: movement}, duration=duration, sample=sample,
        start=rest_state(joint, angle, held), solver="LSODA", rtol=1e-7, atol=1e-10,
    )  # fmt: skip
    deflection = np.array([position(t) for t in run.time])
    torque = [
        joint.inertia * acceleration(t) + joint.damping * velocity(t)
        - plant_torque(joint, angle + position(t))
        for t in run.time
    ]  # fmt: skip
    pulls = sum(joint.gears[name] * run[f"{name}.force"] for name in joint.muscles)
    return run.time, deflection, torque + pulls


def simulated(joint, held, angle, amplitude, frequency):
    """Torque over angle of a simulated oscillation [N·m/rad]: two cycles, after a second."""
    omega, cycles = 2 * pi * frequency, np.ceil(frequency) + 2
    time, deflection, torque = torque_on(
        joint, held, angle,
        lambda t: amplitude * np.sin(omega * t),
        lambda t: amplitude * omega * np.cos(omega * t),
        lambda t: -amplitude * omega**2 * np.sin(omega * t),
        cycles / frequency, 1 / (64 * frequency),
    )  # fmt: skip
    last = slice(-128, None)
    found = response_at(time[last], deflection[last], torque[last], frequency)
    return found.gain * np.exp(1j * found.phase)


# --- closed forms


@pytest.mark.parametrize("stiffness", [5.0, 40.0])
@pytest.mark.parametrize("band", [(1.0, 15.0), (1.0, 30.0)])
def test_both_readings_of_a_joint_without_muscle_are_its_spring(stiffness, band):
    joint = make_joint(LIMP, stiffness=stiffness, damping=0.2)
    found = held_impedance(joint, "puller", share=0.0, angle=0.1, band=band)
    s = 2j * pi * found.frequencies
    np.testing.assert_allclose(found.impedance, 0.01 * s**2 + 0.2 * s + stiffness, rtol=1e-6)
    assert found.stiffness("storage") == pytest.approx(stiffness, rel=1e-6)
    assert found.stiffness("second_order") == pytest.approx(stiffness, rel=1e-6)
    assert found.second_order.inertia == pytest.approx(0.01, rel=1e-6)
    assert found.damping_ratio == pytest.approx(0.2 / (2 * sqrt(0.01 * stiffness)), rel=1e-6)
    assert found.explained == pytest.approx(1.0)


def test_a_muscle_is_a_spring_in_series_with_the_slope_of_hills_relation():
    joint = make_joint(EVEN, gears={"puller": -0.5, "opponent": 0.5})
    held = 0.4 * 10.0  # [N·m] of the muscle; at a gear of 0.5 the joint has half
    # slopes of eq. 7 and eq. 3 by hand: rate times force above that at no stretch; 1 + 1/A
    spring = 3.0 / 0.2 * (held + 10.0 / (exp(3.0) - 1))
    damper = (held * (1 + 1 / 0.3) + 1e-3 * 10.0) / 15.0
    s = 2j * pi * BAND
    muscle = spring * damper * s / (spring + damper * s)
    relaxed = joint_impedance(joint, {"puller": 0.0}, 0.0, BAND)
    found = joint_impedance(joint, {"puller": 0.4}, 0.0, BAND)
    # a relaxed muscle holds the floor of 0.001 F_max, of which this is the closed form too
    spring, damper = 3.0 / 0.2 * (0.01 + 10.0 / (exp(3.0) - 1)), (0.01 * (1 + 1 / 0.3) + 0.01) / 15
    floor = spring * damper * s / (spring + damper * s)
    np.testing.assert_allclose(found - relaxed, 0.25 * (muscle - floor), rtol=1e-5)


def test_at_low_frequencies_the_impedance_is_the_slope_of_the_steady_torque():
    joint = made_joint.make_joint(MUSCLE)
    for held in ({}, {"puller": 0.3}, {"puller": 0.4, "opponent": 0.2}):
        (slow,) = joint_impedance(joint, held, 0.3, [1e-6])
        assert slow.real == pytest.approx(static_stiffness(joint, held, 0.3), rel=1e-4)


# --- simulated oscillations


@pytest.mark.parametrize(
    ("name", "muscle", "share", "angle"),
    [
        ("elbow", "elbow_flexor", 0.2, radians(90)),
        ("ankle", "ankle_plantarflexor", 0.1, 0.0),
        ("eye", "lateral_rectus", 0.3, 0.1),
    ],
)
def test_a_small_simulated_oscillation_has_the_impedance(name, muscle, share, angle):
    joint, held = mjhill.JOINTS[name], {muscle: share}
    linear = joint_impedance(joint, held, angle, [2.0, 13.0])
    # the torque of the inertia is exact in both, so only what is left is compared; 0.005° at 13 Hz
    # is 7 mrad/s, a thousandth of what Hill's relation is curved over
    for frequency, expected in zip((2.0, 13.0), linear, strict=True):
        mass = joint.inertia * (2 * pi * frequency) ** 2
        found = simulated(joint, held, angle, radians(0.005), frequency)
        assert abs(found - expected) < 0.005 * abs(expected + mass)


def test_the_simulation_in_mujoco_has_the_impedance():
    joint, held = made_joint.make_joint(MUSCLE), {"puller": 0.3}
    frequency = np.array([1.0, 3.0, 8.0])
    linear = joint_impedance(joint, held, 0.1, frequency)
    rig = build_rig(joint, exact=True)
    curve, *_ = frequency_responses(rig, 0.1, [Oscillation("held", held, torque=1e-4)], frequency)
    found = 1 / (curve.gain * np.exp(1j * curve.phase))
    # a cycle of the lowest frequency is measured after one in which the oscillation grows
    np.testing.assert_allclose(found, linear, rtol=0.005)


@pytest.mark.parametrize(("ratio", "tolerance"), [(1.0, 0.005), (2.0, 0.03), (4.0, 0.07)])
def test_a_kink_of_hills_relation_counts_with_the_mean_of_its_slopes(ratio, tolerance):
    joint = make_joint(replace(MUSCLE, eccentric_slope_ratio=ratio), inertia=1e-9, damping=0.0)
    linear = joint_impedance(joint, {"puller": 0.3}, 0.2, [4.0])[0]
    found = simulated(joint, {"puller": 0.3}, 0.2, radians(0.01), 4.0)
    assert abs(found - linear) < tolerance * abs(linear)


def test_a_wider_oscillation_finds_less_stiffness():
    joint, held, angle = mjhill.JOINTS["elbow"], {"elbow_flexor": 0.2}, radians(90)
    frequency = np.array([2.0, 5.0, 10.0])
    mass = joint.inertia * (2 * pi * frequency) ** 2
    small = joint_impedance(joint, held, angle, frequency).real + mass
    wide = [
        np.array([simulated(joint, held, angle, radians(size), f).real for f in frequency]) + mass
        for size in (0.5, 2.0)
    ]
    assert (wide[1] < wide[0]).all()
    assert (wide[0] < small).all()
    assert wide[0].mean() == pytest.approx(small.mean(), rel=0.12)


@pytest.mark.parametrize(("spread", "tolerance"), [(0.02, 0.01), (0.25, 0.07)])
def test_a_random_movement_of_the_ankle_finds_the_second_order_system(spread, tolerance):
    # a standard deviation of 0.25° is 1.4° from end to end
    joint, held = mjhill.JOINTS["ankle"], {"ankle_plantarflexor": 0.3}
    lines = np.arange(1.0, 31.0)  # every line of a second, with even amplitude and random phase
    phases = np.random.default_rng(1).uniform(0, 2 * pi, len(lines))
    omega, size = 2 * pi * lines, radians(spread) / sqrt(0.5 * len(lines))
    _, deflection, torque = torque_on(
        joint, held, 0.0,
        lambda t: size * np.sin(omega * t + phases).sum(),
        lambda t: size * (omega * np.cos(omega * t + phases)).sum(),
        lambda t: -size * (omega**2 * np.sin(omega * t + phases)).sum(),
        2.0, 1 / 256,
    )  # fmt: skip
    last = slice(-256, None)  # one period, after another
    spectra = [np.fft.rfft(values[last])[1:31] for values in (deflection, torque)]
    found, explained = fit_compliance(lines, spectra[0] / spectra[1])
    expected, share = fit_compliance(lines, 1 / joint_impedance(joint, held, 0.0, lines))
    assert tuple(found) == pytest.approx(tuple(expected), rel=tolerance)
    assert explained == pytest.approx(share, abs=tolerance)
    assert share > 0.9


# --- held joints


def test_a_joint_is_stiffer_the_more_its_muscle_holds():
    joint = make_joint(damping=0.2)
    for reading in ("storage", "second_order"):
        held = [
            held_impedance(joint, "puller", share=share, angle=0.0, band=(1.0, 30.0))
            for share in (0.1, 0.3)
        ]
        torque, stiffness = (
            [one.torque for one in held],
            [one.stiffness(reading) for one in held],
        )
        assert torque[1] > torque[0] > 0
        assert stiffness[1] > stiffness[0] > joint.stiffness
        rise = (stiffness[1] - stiffness[0]) / (torque[1] - torque[0])
        assert stiffness_slope(held, reading) == pytest.approx(rise)


def test_the_held_torque_is_the_muscles_and_the_posture_is_rest_unless_given():
    joint = make_joint(rest_angle=0.2)
    found = held_impedance(joint, "puller", share=0.3)
    assert found.torque == pytest.approx(muscle_torque(joint, "puller", 0.3, 0.2))
    there = held_impedance(joint, "puller", share=0.3, angle=0.2)
    assert np.array_equal(found.impedance, there.impedance)


def test_an_unstable_posture_has_no_second_order_stiffness_but_the_reason():
    # past the optimum a quick muscle on a stiff tendon pulls less the more it is stretched
    muscle = replace(MUSCLE, width_long=0.3, max_velocity=1000.0, series_stretch=0.01)
    joint = make_joint(muscle, stiffness=0.0)
    found = held_impedance(joint, "puller", share=0.5, angle=-0.25)
    with pytest.raises(UnmeasuredError, match="joint at -14.3° with puller at 0.5, no inertia"):
        found.stiffness("second_order")
    with pytest.raises(UnmeasuredError, match="above 0 are like it"):
        _ = found.damping_ratio
    assert found.stiffness("storage") < 0


def test_passive_stiffness_is_the_mean_slope_at_rest():
    assert passive_stiffness(make_joint(stiffness=7.0), 0.02) == pytest.approx(7.0)
    passive = mjhill.Passive(k1_pos=0.5, k2_pos=2.0, k1_neg=0.25, k2_neg=2.0)
    joint = make_joint(passive=passive, rest_angle=0.3)
    # 1 of the spring, k1 k2 of each side
    assert passive_stiffness(joint, 1e-5) == pytest.approx(1.0 + (1.0 + 0.5) / 2, rel=1e-3)


def test_what_cannot_be_held_is_refused():
    joint = make_joint()
    for options, message in (
        ({"band": (15.0, 1.0)}, "band must be two ascending frequencies above 0 Hz, got"),
        ({"band": (0.0, 1.0)}, "band must be two ascending frequencies above 0 Hz, got"),
        ({"share": 1.5}, r"share must be in \[0, 1\], got 1.5"),
    ):
        with pytest.raises(ValueError, match=message):
            held_impedance(joint, "puller", **{"share": 0.1, **options})
    with pytest.raises(ValueError, match="unknown muscle 'pusher'; there are: puller, opponent"):
        held_impedance(joint, "pusher", share=0.1)
    with pytest.raises(ValueError, match="unknown reading 'loss'; there are: storage, second_ord"):
        held_impedance(joint, "puller", share=0.1).stiffness("loss")
    with pytest.raises(ValueError, match="of the model 'hill-rigid', and this needs one of the mo"):
        held_impedance(joint.with_muscles("hill-rigid"), "puller", share=0.1)


# --- the facts


def test_every_fact_that_is_read_from_an_impedance_is_measured_on_the_joints_that_come_along():
    entries = [entry for entry in read_entries() if "band" in entry.arguments]
    assert {entry.measure for entry in entries} >= {"held_stiffness", "stiffness_slope"}
    for entry in entries:
        (value,) = measure(entry, [mjhill.JOINTS[entry.joint]])
        assert value > 0


def test_the_elbows_stiffness_is_read_as_the_study_did_and_its_note_has_the_other_reading():
    elbow = mjhill.JOINTS["elbow"]
    found = {fact.quantity: fact for fact in facts({"elbow": elbow})}
    levels = [
        held_impedance(elbow, "elbow_flexor", share=share, angle=radians(90), band=(1.0, 15.0))
        for share in (0.1, 0.2, 0.3, 0.5)
    ]
    stiffness = found["stiffness while the flexor holds 20 % of its maximum"]
    assert stiffness.measured == pytest.approx(levels[1].storage)
    assert stiffness.note == (
        f"second-order reading: {levels[1].second_order.stiffness:.3g}; "
        f"the second-order fit explains {levels[1].explained:.0%}"
    )
    slope = found["rise of stiffness with the flexor's torque, 10 to 50 %"]
    assert slope.measured == pytest.approx(stiffness_slope(levels, "storage"))
    other = stiffness_slope(levels, "second_order")
    assert slope.note.startswith(f"second-order reading: {other:.3g}; ")
    assert found["passive stiffness at rest"].note == ""
