"""A fit that explains too little fails, and says what may be wrong."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import mjhill
from mjhill.identification import FitError
from mjhill.identification.measurement import Measurement
from mjhill.identification.movement import Prediction
from mjhill.lab.rig import at_rest, build_rig, record_run


@pytest.fixture(scope="module")
def measured():
    """The shipped elbow, moved by a flexor and a push."""
    elbow = mjhill.JOINTS["elbow"]
    rig = build_rig(elbow)
    recording = record_run(
        rig,
        at_rest(rig, elbow.home_angle),
        0.5,
        excitation={"elbow_flexor": mjhill.pulse(0.3, 0.05, 0.1)},
        torque=mjhill.pulse(-6.0, 0.2, 0.2),
    )
    return Measurement(
        "trial.csv",
        recording.time,
        {name: recording[f"{name}.u"] for name in elbow.muscles},
        recording["elbow.angle"],
        recording["elbow.applied"],
    )


def fit(measurement, **options):
    return mjhill.identify("elbow", [measurement], only=["damping"], **options)


def test_a_sound_measurement_passes(measured):
    assert fit(measured).predictions[0].explained > 0.999


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ({"angle": lambda m: np.radians(m.angle)}, "is its angle in radians, though its unit says"),
        ({"angle": lambda m: np.pi - m.angle}, "Write 180 deg less the angle."),
        ({"torque": lambda m: -m.torque}, "has its torque the wrong sign? It is that on the joint"),
        (
            {
                "excitation": lambda m: dict(
                    zip(m.excitation, [*m.excitation.values()][::-1], strict=True)
                )
            },
            "are its muscles swapped?",
        ),
    ],
    ids=["radians", "between the segments", "sign of the torque", "swapped"],
)
def test_a_common_fault_is_named(measured, fault, cause):
    wrong = replace(measured, **{name: change(measured) for name, change in fault.items()})
    with pytest.raises(FitError) as caught:
        fit(wrong, predict="angle")
    message = str(caught.value)
    assert message.startswith("elbow: the fit failed, as it explains less than 50 % of the var")
    assert "trial.csv: " in message
    assert cause in message
    assert "Then 100 % are explained even before the fit" in message
    assert caught.value.result.predictions[0].explained < 0.5


def test_an_offset_explains_nothing(measured):
    angle = measured.angle
    spread = float(np.std(angle))

    def explained(predicted):
        return Prediction(measured, "angle", angle, predicted).explained

    assert explained(angle) == 1.0
    assert explained(angle + 0.5 * spread) == pytest.approx(0.75)
    assert explained(angle + spread) == pytest.approx(0.0)
    assert explained(np.full_like(angle, angle.mean())) == pytest.approx(0.0)
    assert explained(angle + 2 * spread) == pytest.approx(-3.0)


def test_a_fault_that_is_none_of_the_common_ones_says_where_to_look(measured):
    noise = np.random.default_rng(0).normal(1.2, 0.2, len(measured))
    with pytest.raises(FitError, match="look at the units, the sign and zero of the angle"):
        fit(replace(measured, angle=noise))


def test_one_bad_measurement_among_good_ones_is_named_alone(measured):
    noise = np.random.default_rng(0).normal(1.2, 0.2, len(measured))
    bad = replace(measured, source="bad.csv", angle=noise)
    with pytest.raises(FitError) as caught:
        mjhill.identify("elbow", [measured, bad], only=["damping"])
    assert "bad.csv: " in str(caught.value)
    assert "trial.csv" not in str(caught.value)
    assert len(caught.value.result.predictions) == 2


def test_the_error_survives_a_process(measured):
    with pytest.raises(FitError) as caught:
        fit(replace(measured, angle=np.pi - measured.angle))
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)


def test_options_of_files_are_refused_for_what_has_been_read(measured):
    with pytest.raises(ValueError, match="trial.csv: torque and decimal are about files"):
        fit(measured, torque=0.0)
    with pytest.raises(ValueError, match="torque and decimal need measurements"):
        mjhill.identify("elbow", decimal=",")
