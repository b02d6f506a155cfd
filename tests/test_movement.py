"""A synthetic elbow is measured with noise, and found again."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

import mjhill
from mjhill.identification.free import free_parameters, value_of
from mjhill.identification.measurement import Measurement, read_measurement
from mjhill.identification.movement import _Problem, from_measurements
from mjhill.identification.trial import make_trial
from mjhill.lab.batch import joint_angles
from mjhill.lab.rig import UnmeasuredError, at_rest, build_rig, record_run
from mjhill.simulate.reference import plant_torque

NOISE = 0.003  # [rad], that of optical motion capture
TORQUE_NOISE = 0.3  # [N·m]
ONLY = (
    "damping",
    "elbow_flexor.max_isometric_force",
    "elbow_flexor.max_velocity",
    "elbow_extensor.excitation_tau",  # the extensor is at rest: nothing tells
)
INFORMED = ONLY[:3]


@pytest.fixture
def subject(elbow):
    """The elbow of someone else."""
    flexor = replace(elbow.muscles["elbow_flexor"], max_isometric_force=64.0, max_velocity=22.0)
    muscles = MappingProxyType({**elbow.muscles, "elbow_flexor": flexor})
    return replace(elbow, damping=0.2, muscles=muscles)


def moved(subject, duration=0.8, excitation=None, torque=None):
    """A recorded movement: a pulse of the flexor and a push, by default."""
    bench = build_rig(subject)
    return record_run(
        bench,
        at_rest(bench, subject.home_angle),
        duration,
        excitation=excitation or {"elbow_flexor": mjhill.pulse(0.6, 0.1, 0.3)},
        torque=torque or mjhill.pulse(3.0, 0.6, 0.1),
    )


def noisy(recording, seed=0, noise=NOISE):
    random = np.random.default_rng(seed)
    name = "elbow.angle"
    angle = recording[name] + noise * random.standard_normal(len(recording))
    return replace(recording, series={**recording.series, name: angle})


def measured(recording, pick=slice(None)):
    """A recording as a measurement, or some of its samples."""
    return Measurement(
        "movement",
        recording.time[pick],
        {name: recording[f"{name}.u"][pick] for name in ("elbow_flexor", "elbow_extensor")},
        recording["elbow.angle"][pick],
        recording["elbow.applied"][pick],
        simulated=float(recording.about["timestep"]),
    )


def held(subject, noise=TORQUE_NOISE, duration=0.5):
    """The elbow held still by a clamp whose torque is measured."""
    bench = build_rig(subject, added_inertia=1e9)  # no muscle turns it in the time of a run
    pulse = mjhill.pulse(0.6, 0.1, 0.3)
    recording = record_run(bench, at_rest(bench, 1.3), duration, excitation={"elbow_flexor": pulse})
    muscles = recording["elbow_extensor.force"] - recording["elbow_flexor.force"]
    random = np.random.default_rng(1)
    torque = muscles - plant_torque(subject, 1.3) + noise * random.standard_normal(len(recording))
    return replace(measured(recording), source="clamp", torque=torque)


def check(result, subject, names):
    """Whether the true values lie in the intervals of 99 %."""
    by_name = {estimate.name: estimate for estimate in result.estimates}
    for free in result.free:
        if free.name in names:
            estimate = by_name[free.name]
            spread = (estimate.high - estimate.low) / (2 * 1.96)
            off = abs(estimate.value - value_of(subject, free))
            assert off < 2.6 * spread, free.name
            assert estimate.informed > 0.9, free.name


def test_a_recording_saved_and_read_gives_the_joint_again(subject, tmp_path):
    path = noisy(moved(subject)).save(tmp_path / "elbow.csv")
    shares = []
    result, (prediction,) = from_measurements(
        "elbow", [read_measurement(path, subject)], only=ONLY, progress=shares.append
    )
    assert prediction.quantity == "angle"
    assert prediction.error == pytest.approx(NOISE, rel=0.1)  # 801 samples: 2.5 %, four times
    assert prediction.explained > 0.999
    check(result, subject, INFORMED)
    assert shares == sorted(shares)
    assert 0 < shares[0] <= shares[-1] <= 1


def test_what_the_data_do_not_tell_stays_in_the_middle_and_says_so(subject):
    result, _ = from_measurements("elbow", [measured(noisy(moved(subject)))], only=ONLY)
    untold = next(e for e in result.estimates if e.name == "elbow_extensor.excitation_tau")
    assert untold.informed < 0.01
    low, high = untold.bounds
    assert untold.value == pytest.approx(np.sqrt(low * high), rel=1e-3)
    assert untold.low == pytest.approx(low, rel=0.01)
    assert untold.high == pytest.approx(high, rel=0.01)


def test_only_what_is_named_is_fitted(elbow):
    measurement = measured(moved(replace(elbow, damping=0.2)))
    result, _ = from_measurements("elbow", [measurement], only=["damping"])
    assert [free.name for free in result.free] == ["damping"]
    assert result.joint == replace(elbow, damping=result.joint.damping)
    assert result.joint.damping == result.estimates[0].value


def test_a_joint_held_still_is_known_by_the_torque_that_holds_it(subject):
    names = ("elbow_flexor.max_isometric_force", "elbow_flexor.max_velocity")
    result, (prediction,) = from_measurements("elbow", [held(subject)], only=("damping", *names))
    assert prediction.quantity == "torque"
    assert prediction.error == pytest.approx(TORQUE_NOISE, rel=0.1)
    check(result, subject, names)
    damping = next(e for e in result.estimates if e.name == "damping")
    assert damping.informed < 0.01  # nothing moved


def test_a_movement_may_be_predicted_as_torque(elbow):
    subject = replace(elbow, damping=0.2)
    # slow enough for a path that is smoothed at 10 Hz, and still moving at its end
    movement = moved(
        subject,
        duration=0.6,
        excitation={"elbow_flexor": mjhill.Signal(lambda t: 0.1 - 0.1 * np.cos(9 * t))},
        torque=mjhill.Signal(lambda t: 1.5 - 1.5 * np.cos(9 * t)),
    )
    measurement = measured(noisy(movement, noise=1e-4))
    result, (prediction,) = from_measurements(
        "elbow", [measurement], only=["damping"], predict="torque"
    )
    assert prediction.quantity == "torque"
    np.testing.assert_array_equal(prediction.measured, measurement.torque)
    # smoothing bends the path by less than a degree, most where it ends
    assert prediction.error < 0.1 * np.ptp(measurement.torque)
    check(result, subject, ["damping"])


def test_two_measurements_tell_more_than_one(subject):
    movement, clamp = measured(noisy(moved(subject))), held(subject)
    alone, _ = from_measurements("elbow", [movement], only=INFORMED)
    both, predictions = from_measurements("elbow", [movement, clamp], only=INFORMED)
    assert [p.quantity for p in predictions] == ["angle", "torque"]
    assert [p.measurement.source for p in predictions] == ["movement", "clamp"]
    check(both, subject, INFORMED)
    for one, two in zip(alone.estimates, both.estimates, strict=True):
        # the noise is found anew, to some per cent
        assert two.high - two.low < 1.05 * (one.high - one.low), one.name


def test_each_measurement_may_be_predicted_in_its_own_way(subject):
    clamp = held(subject, duration=0.2)
    movement = measured(noisy(moved(subject, duration=0.2)))
    _, predictions = from_measurements(
        "elbow", [movement, clamp, clamp], only=["damping"], predict=["angle", "torque", "torque"]
    )
    assert [p.quantity for p in predictions] == ["angle", "torque", "torque"]


def test_a_noisy_angle_may_be_that_of_a_held_joint(subject):
    clamp = held(subject, duration=0.2)
    noise = 0.0035 * np.random.default_rng(3).standard_normal(len(clamp))
    _, (prediction,) = from_measurements(
        "elbow", [replace(clamp, angle=clamp.angle + noise)], only=["damping"]
    )
    assert np.ptp(noise) > 0.02
    assert prediction.quantity == "torque"


def test_times_may_be_uneven(subject):
    random = np.random.default_rng(2)
    recording = noisy(moved(subject))
    kept = np.sort(random.choice(np.arange(1, len(recording)), 400, replace=False))
    # the inputs go straight from sample to sample, so both ends of their jumps are kept
    jumps = [0, 99, 100, 399, 400, 599, 600, 699, 700, len(recording) - 1]
    result, (prediction,) = from_measurements(
        "elbow", [measured(recording, np.union1d(kept, jumps))], only=INFORMED
    )
    assert prediction.error == pytest.approx(NOISE, rel=0.1)
    check(result, subject, INFORMED)


TIMES = (*INFORMED, "elbow_flexor.excitation_tau")
FINE = 5e-5  # [s]


def really(subject, rate, excitation, delay=0.0, seed=0):
    """The true movement, by short steps, under an excitation of the flexor, as sampled."""
    steps = round(0.8 / FINE)
    middles = (np.arange(steps) + 0.5) * FINE
    inputs = np.stack([excitation(middles - delay), 0 * middles], axis=1)
    angle = joint_angles(
        [subject], start=subject.home_angle, excitation=inputs, steps=steps, timestep=FINE
    )[0]
    time = np.arange(round(0.8 * rate) + 1) / rate
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(time))
    return Measurement(
        "real", time, {"elbow_flexor": excitation(time), "elbow_extensor": 0 * time},
        angle[:: round(1 / (rate * FINE))] + noise, 0 * time,
    )  # fmt: skip


def pulses(time):
    edges = np.array([0.1, 0.3, 0.5, 0.56]) - 1e-9  # free of rounding
    on = np.searchsorted(edges, time) % 2 == 1
    return 0.6 * on


@pytest.mark.parametrize("rate", [100, 200, 1000])
def test_pulses_of_a_stimulator_are_held_from_sample_to_sample(subject, rate):
    measurement = really(subject, rate, pulses)
    result, (prediction,) = from_measurements("elbow", [measurement], only=TIMES)
    assert prediction.inputs == "held"
    assert prediction.error == pytest.approx(NOISE, rel=0.2)  # 81 samples
    for free, one in zip(result.free, result.estimates, strict=True):
        # twice the half width is 99.99 % of a normal distribution
        assert abs(one.value - value_of(subject, free)) < one.high - one.low, free.name


def test_joined_pulses_come_half_a_sample_early(subject):
    measurement = really(subject, 200, pulses)
    taus = {}
    for way in ("hold", "join"):
        result, (prediction,) = from_measurements("elbow", [measurement], only=TIMES, inputs=way)
        assert prediction.inputs == {"hold": "held", "join": "joined"}[way]
        # what is left is noise only where the inputs are right
        assert bool(prediction.notes) == (way == "join")
        taus[way] = result.estimates[-1].value
    assert taus["join"] > taus["hold"] + 1e-3  # the time constant makes up for some of it
    result, _ = from_measurements("elbow", [measurement], only=INFORMED, inputs="join", delay=True)
    assert result.delay.value == pytest.approx(2.5e-3, abs=0.5e-3)


def test_a_delay_of_the_output_is_found(subject):
    measurement = really(subject, 200, pulses, delay=0.03)
    result, (prediction,) = from_measurements("elbow", [measurement], only=INFORMED, delay=True)
    assert result.delay.low < 0.03 < result.delay.high
    assert result.delay.high - result.delay.low < 5e-3
    assert result.delay.bounds == (0.0, 0.1)
    assert prediction.error == pytest.approx(NOISE, rel=0.2)
    assert len(result.estimates) == len(result.free) == len(INFORMED)
    assert "\ndelay: 0.0" in str(result)
    without, (prediction,) = from_measurements("elbow", [measurement], only=TIMES)
    assert without.delay is None
    assert prediction.error > 5 * NOISE


def test_noise_of_a_measured_torque_widens_the_intervals(subject):
    # at 100 Hz, 0.3 N·m of it moves the elbow by more than the noise of its angle
    measurement = really(subject, 100, pulses)
    noise = TORQUE_NOISE * np.random.default_rng(5).standard_normal(len(measurement))
    quiet, _ = from_measurements("elbow", [measurement], only=INFORMED)
    shaken, _ = from_measurements("elbow", [replace(measurement, torque=noise)], only=INFORMED)
    for one, other, free in zip(quiet.estimates, shaken.estimates, quiet.free, strict=True):
        width = other.high - other.low
        assert width > 2 * (one.high - one.low), one.name
        assert abs(other.value - value_of(subject, free)) < width, one.name


def test_smooth_inputs_go_straight_between_samples(subject):
    # held from sample to sample, 100 Hz would lengthen the time constants by 5 ms
    smooth = mjhill.Signal(lambda t: 0.25 - 0.25 * np.cos(12 * t))
    movement = moved(subject, excitation={"elbow_flexor": smooth}, torque=smooth)
    recording = noisy(movement, noise=1e-4)
    name = "elbow_flexor.excitation_tau"
    result, _ = from_measurements(
        "elbow", [measured(recording, slice(None, None, 10))], only=(*INFORMED, name)
    )
    check(result, subject, [name])


def test_the_intervals_of_a_muscle_at_rest_hold_what_agrees_as_well(subject, monkeypatch):
    # a resting extensor drags a fast flexion only if it is slow enough, so its covariance
    # depends on where the solution happens to be; the true one is at the slow end of the bounds
    resting = "elbow_extensor.max_velocity"
    free = next(one for one in free_parameters("elbow") if one.name == resting)
    slow = replace(subject.muscles["elbow_extensor"], max_velocity=1.02 * free.low)
    muscles = MappingProxyType({**subject.muscles, "elbow_extensor": slow})
    someone = replace(subject, muscles=muscles)
    measurement = measured(noisy(moved(someone)))

    def found():
        result, _ = from_measurements("elbow", [measurement], only=(*ONLY, resting))
        return next(one for one in result.estimates if one.name == resting)

    estimate = found()
    assert estimate.low <= slow.max_velocity <= estimate.high
    monkeypatch.setattr(
        "mjhill.identification.movement.intervals", lambda _, solution, count: solution.ends[:count]
    )
    assert not found().low <= slow.max_velocity


def test_a_simulation_that_goes_bad_is_far_from_the_measurement(elbow, subject, monkeypatch):
    trial = make_trial(measured(moved(subject)))
    free = next(one for one in free_parameters("elbow") if one.name == "damping")
    problem = _Problem(elbow, (free,), (trial,), delay=False)
    points = np.zeros((problem.count, 3))
    points[0] = [-1.0, 0.0, 1.0]
    (sound,) = problem.predictions(points)

    def run(joints, **inputs):
        if any(joint.damping == free.value(0.0) for joint in joints):
            raise UnmeasuredError("elbow: MuJoCo warned 'badqacc'")
        return joint_angles(joints, **inputs)

    monkeypatch.setattr("mjhill.identification.trial.joint_angles", run)
    (found,) = problem.predictions(points)
    np.testing.assert_array_equal(found[[0, 2]], sound[[0, 2]])
    assert np.abs(found[1] - trial.measured).min() == pytest.approx(10 * trial.spread)


def test_a_measurement_may_begin_with_a_gap(subject):
    recording = noisy(moved(subject))
    kept = np.concatenate([[0], np.arange(80, len(recording))])
    _, (prediction,) = from_measurements("elbow", [measured(recording, kept)], only=INFORMED)
    assert prediction.error == pytest.approx(NOISE, rel=0.1)


@pytest.mark.parametrize("noise", [NOISE, 1e-4])
def test_a_measurement_may_begin_in_mid_movement(subject, noise):
    # pushed from the first sample on, the elbow has turned 7 degrees after 50 ms
    recording = noisy(moved(subject, torque=mjhill.pulse(6.0, 0.0, 0.1)), noise=noise, seed=2)
    result, (prediction,) = from_measurements("elbow", [measured(recording)], only=INFORMED)
    assert prediction.error == pytest.approx(noise, rel=0.15)
    check(result, subject, INFORMED)


def test_the_clock_of_a_measurement_may_start_anywhere(subject):
    measurement = measured(noisy(moved(subject)))
    later = replace(measurement, time=measurement.time + 100.0)
    ends = [
        from_measurements("elbow", [m], only=INFORMED)[0].joint.damping
        for m in (measurement, later)
    ]
    # times of 100 s have their last bits elsewhere, and the noise is found to 2 % only
    assert ends[0] == pytest.approx(ends[1], rel=1e-3)


# --- refusals


def still_life(**changes):
    """A joint that does nothing."""
    zeros = np.zeros(100)
    measurement = Measurement(
        "still.csv", np.arange(100) * 1e-3, {"elbow_flexor": zeros, "elbow_extensor": zeros},
        np.ones(100), zeros,
    )  # fmt: skip
    return replace(measurement, **changes)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"joint": "wing"}, "unknown joint 'wing'; there are: elbow"),
        ({"only": ["strength"]}, "elbow: unknown free parameter 'strength'; there are: damping"),
        ({"inputs": "held"}, "inputs must be one of hold, join, got 'held'"),
        ({"predict": "force"}, "predict must be one of angle, torque, got 'force'"),
        ({"only": ["postures.elbow_flexor"]}, "unknown free parameter 'postures.elbow_flexor'"),
        ({"predict": ["angle"] * 2}, "once, or once for each of the 1 measurements, got 2: angle"),
        ({"measurements": []}, "there is no measurement to fit; give at least one"),
        ({"predict": "angle"}, "still.csv: the angle never changes, so there is nothing to pred"),
        ({}, "still.csv: the torque never changes, so there is nothing to predict"),
    ],
)
def test_what_cannot_be_fitted_is_refused(arguments, message):
    defaults = {"joint": "elbow", "measurements": [still_life()], "only": ["damping"]}
    arguments = {**defaults, **arguments}
    with pytest.raises(ValueError, match=message):
        from_measurements(arguments.pop("joint"), arguments.pop("measurements"), **arguments)
