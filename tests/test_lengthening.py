from dataclasses import replace
from math import radians

import numpy as np
import pytest
from made_joint import MUSCLE, make_joint
from matplotlib.figure import Figure

import mjhill
from mjhill.experiments.lengthening import lengthening
from mjhill.lab.rig import muscle_torque

EVEN = replace(MUSCLE, width_short=50.0, width_long=50.0)  # as strong at any angle
ONE = {"velocities": [3.0], "excitations": [1.0]}


def stretched(joint, **options):
    """The one stretch of an experiment with one velocity and one input."""
    ((found,),) = lengthening(joint, **{**ONE, **options}).stretches.values()
    return found


@pytest.mark.parametrize("level", [0.3, 1.0])
def test_a_muscle_as_strong_at_any_angle_carries_hills_hyperbola_inverted(level):
    velocity, hill = 3.0, MUSCLE.hill_shape
    c = 0.3 * hill / (1 + hill)  # as steep at rest as when shortening
    w = velocity / MUSCLE.max_velocity
    wanted = 1 + 0.3 * w / (w + c) + MUSCLE.viscosity * w / level
    found = stretched(make_joint(EVEN), excitations=[level], amplitude=radians(60))
    assert found.end == pytest.approx(wanted, rel=2e-3)
    assert found.contractile == pytest.approx(wanted, rel=1e-3)


def test_a_higher_plateau_is_reached_and_is_not_the_papers():
    found = lengthening(make_joint(replace(EVEN, eccentric_plateau=1.8)), excitations=[1.0])
    assert found.stretches[1.0][-1].end > 1.5
    plateau, *_ = found.claims()
    assert not plateau.holds


def test_torque_is_isometric_before_the_stretch_and_long_after_it():
    joint = make_joint()
    found = stretched(joint)
    start, end = (angle * radians(15) for angle in (1, -1))  # the puller is long at negative angles
    rest = [muscle_torque(joint, "puller", 0.0, angle) for angle in (start, end)]
    for measured, angle, trace in ((0, start, rest[0]), (-1, end, rest[1])):
        wanted = muscle_torque(joint, "puller", 1.0, angle) - trace
        assert found.torque[measured] == pytest.approx(wanted, rel=2e-3)
    assert found.relative[0] == pytest.approx(1.0, abs=1e-9)
    assert abs(found.residual) < 2e-3
    assert found.recovery(0.01) < 0.2


def test_torque_that_does_not_come_back_is_not_said_to():
    found = lengthening(make_joint(), **ONE)
    (one,) = found.stretches[1.0]
    high = replace(one, relative=one.relative + 0.1)
    assert high.recovery(0.01) is None
    assert one.recovery(0.01) == pytest.approx(
        float(one.time[np.abs(one.relative - 1) > 0.01][-1]) - one.stop + 1e-3, abs=1e-9
    )
    *_, kept = replace(found, stretches={1.0: (high,)}).claims()
    assert not kept.holds
    assert "isometric: not always" in kept.evidence


def test_a_longer_series_element_takes_longer_to_come_back():
    times = [
        stretched(make_joint(replace(EVEN, series_stretch=x))).recovery(0.01) for x in (0.1, 0.3)
    ]
    assert times[0] < times[1]


def test_a_muscle_is_stretched_the_way_it_lengthens():
    joint = make_joint()
    for muscle, along in (("puller", -1), ("opponent", 1)):
        found = lengthening(joint, muscle=muscle, **ONE)
        assert found.end - found.start == pytest.approx(along * radians(30))
        assert np.ptp(found.film()["joint.angle"]) == pytest.approx(radians(30), rel=0.02)


def test_mirrored_muscles_are_alike():
    alike = make_joint(passive=mjhill.Passive(k1_pos=0.3, k2_pos=2, k1_neg=0.3, k2_neg=2))
    one, other = (stretched(alike, muscle=name) for name in alike.muscles)
    np.testing.assert_allclose(one.torque, other.torque, rtol=1e-6)


def test_the_eye_is_measured_drawn_filmed_and_ready_for_json():
    shares: list[float] = []
    found = lengthening("eye", progress=shares.append)
    figure = Figure(figsize=found.size, layout="constrained")
    found.draw(figure)
    assert len(figure.axes) == 4
    numbers = found.as_dict()
    assert all(np.isfinite(measure["value"]) for measure in numbers["measures"])
    assert [claim["holds"] for claim in numbers["claims"]] == [True, True, True]
    assert shares[-1] == 1.0
    assert found.film()["dynamometer.force"].shape == found.film().time.shape


def test_bad_options_are_refused():
    with pytest.raises(ValueError, match="unknown joint 'toe'"):
        lengthening("toe")
    with pytest.raises(ValueError, match="unknown muscle 'biceps'; there are: elbow_flexor"):
        lengthening("elbow", muscle="biceps")
    for velocity in (0.0, float("nan"), float("inf"), 1e4):
        with pytest.raises(ValueError, match="a clamp velocity must not be 0 and at most"):
            lengthening("elbow", velocities=[1.0, velocity])
    with pytest.raises(ValueError, match="velocities must be positive, got -1.0 rad/s"):
        lengthening("elbow", velocities=[-1.0])
    with pytest.raises(ValueError, match="velocities must not be empty; give at least one"):
        lengthening("elbow", velocities=[])
    for amplitude in (0.0, -0.1, 3.0, float("nan")):
        with pytest.raises(ValueError, match=r"amplitude must be in \(0, 2.5\] rad"):
            lengthening("elbow", amplitude=amplitude)
    for level in (0.0, 1.1, float("nan")):
        with pytest.raises(ValueError, match=r"excitations must be one or more in \(0, 1\]"):
            lengthening("elbow", excitations=[0.5, level])
