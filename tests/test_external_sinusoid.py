"""External torque sinusoids on a held joint."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.external_sinusoid import (
    Curve,
    Oscillation,
    external_sinusoid,
    frequency_responses,
)
from mjhill.lab.rig import UnmeasuredError, build_rig, muscle_torque, net_torque


@pytest.fixture(scope="module")
def elbow():
    return external_sinusoid("elbow", band=(0.5, 20.0))


def passive_joint(damping):
    """An elbow that is a spring and a damper, its muscles too weak to matter."""
    joint = mjhill.JOINTS["elbow"]
    weak = {
        name: replace(muscle, max_isometric_force=1e-6) for name, muscle in joint.muscles.items()
    }
    none = mjhill.Passive(k1_pos=0.0, k2_pos=1.0, k1_neg=0.0, k2_neg=1.0)
    return replace(joint, muscles=weak, passive=none, stiffness=10.0, damping=damping)


@pytest.mark.parametrize("damping", [0.5, 2.0])
def test_a_spring_and_a_damper_have_the_textbook_response(damping):
    """Also overdamped: at 2 N·m·s/rad the damping ratio is 1.3."""
    joint = passive_joint(damping)
    band = np.geomspace(0.5, 20.0, 16)
    oscillation = Oscillation("torque", {}, 0.1)
    (curve,) = frequency_responses(
        build_rig(joint, exact=True), joint.rest_angle, [oscillation], band
    )
    turning = 2 * np.pi * band
    truth = 1 / (joint.stiffness - joint.inertia * turning**2 + 1j * damping * turning)
    np.testing.assert_allclose(curve.gain, np.abs(truth), rtol=0.01)
    np.testing.assert_allclose(curve.phase, np.angle(truth), atol=0.02)
    assert curve.coherence.min() > 0.999
    natural = np.sqrt(joint.stiffness / joint.inertia) / (2 * np.pi)
    assert curve.resonance == pytest.approx(natural, rel=0.02)


def test_a_response_that_only_falls_has_no_resonance():
    band = np.array([1.0, 2.0, 4.0])
    flat = Curve(Oscillation("", {}), 0.0, band, 1 / band**3, np.zeros(3), np.ones(3))
    assert flat.resonance is None
    assert flat.low_gain == 1.0


def test_the_bias_is_what_the_muscle_holds(elbow):
    joint = mjhill.JOINTS["elbow"]
    for curve, share in zip(elbow.bias, (0.0, 0.1, 0.2, 0.4), strict=True):
        assert curve.oscillation.excitations == {"elbow_flexor": share, "elbow_extensor": 0.0}
        assert curve.bias == -net_torque(joint, curve.oscillation.excitations, elbow.angle)
    held = elbow.bias[0].bias - elbow.bias[3].bias
    assert held == pytest.approx(
        0.4 * muscle_torque(joint, "elbow_flexor", 1.0, elbow.angle), rel=0.01
    )


def test_cocontraction_needs_no_bias(elbow):
    assert all(abs(curve.bias) < 1e-9 for curve in elbow.cocontraction)


def test_at_high_frequency_only_inertia_is_left(elbow):
    """Gain 1/(J w²) and half a cycle late, however active the muscles are."""
    inertial = 1 / (mjhill.JOINTS["elbow"].inertia * (2 * np.pi * 20.0) ** 2)
    for curve in elbow.bias:
        assert curve.gain[-1] == pytest.approx(inertial, rel=0.4)
        assert np.degrees(curve.phase[-1]) == pytest.approx(-180, abs=20)


def test_half_the_torque_gives_the_same_gain():
    """Small enough to be linear."""
    pair = [
        external_sinusoid(
            "elbow",
            bias=(0.1, 0.2),
            cocontraction=(0.2, 0.5),
            band=(1.0, 8.0),
            angle=1.9,
            deflection=deflection,
        ).bias[0]
        for deflection in (0.02, 0.01)
    ]
    np.testing.assert_allclose(pair[0].gain, pair[1].gain, rtol=0.03)


def test_claims_follow_from_the_curves(elbow):
    assert [claim.holds for claim in elbow.claims()] == [True] * 3
    turned = replace(elbow, bias=elbow.bias[::-1], cocontraction=elbow.cocontraction[::-1])
    assert [claim.holds for claim in turned.claims()][:2] == [False] * 2
    one = replace(elbow, bias=elbow.bias[:1], neural=None)
    assert [claim.holds for claim in one.claims()] == [None, True, None]
    same = replace(elbow, neural=elbow.cocontraction[1])
    assert list(same.claims())[2].holds is False


def test_a_resonance_outside_the_band_decides_nothing():
    low = external_sinusoid("elbow", bias=(0.1, 0.4), cocontraction=(0.2, 0.5), band=(0.5, 4.0))
    assert [claim.holds for claim in low.claims()][:2] == [None, None]
    assert "not within the band" in next(low.claims()).evidence


def test_a_condition_that_is_not_held_is_reported():
    result = external_sinusoid("wrist", angle=0.0, cocontraction=(0.02, 0.5), bias=(0.0, 0.1),
                               band=(1.0, 8.0))  # fmt: skip
    assert [curve.oscillation.label for curve in result.cocontraction] == ["co-contraction 0.02"]
    assert (
        "drifts away"
        in {m.name: m.note for m in result.measures()}["response under co-contraction 0.5"]
    )
    with pytest.raises(UnmeasuredError, match="drifts away"):
        external_sinusoid("elbow", angle=1.0, cocontraction=(0.4, 0.5), bias=(0.3, 0.4))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"joint": "tail"}, "unknown joint 'tail'; there are: elbow"),
        ({"muscle": "biceps"}, "unknown muscle 'biceps'; there are: elbow_flexor, elbow_extensor"),
        ({"bias": (0.1, 1.2)}, "bias must be 2 or more ascending"),
        ({"cocontraction": (0.5, 0.2)}, "cocontraction must be 2 or more ascending"),
        ({"band": (5.0, 1.0)}, "band must ascend within 0.05 to 100 Hz, got 5.0 to 1.0 Hz"),
        ({"band": (1.0, 400.0)}, "band must ascend"),
        ({"angle": 9.0}, "angle must be in the range of elbow"),
        ({"deflection": -0.1}, "deflection must be in"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        external_sinusoid(**options)


def test_the_figure_and_the_numbers_are_there(elbow):
    figure = Figure(figsize=elbow.size)
    elbow.draw(figure)
    assert len(figure.axes) == 6
    assert elbow.film() is None
    shares = []
    external_sinusoid("eye", band=(5.0, 50.0), progress=shares.append)
    assert shares[-1] == 1.0
    assert len(elbow.as_dict()["claims"]) == 3
