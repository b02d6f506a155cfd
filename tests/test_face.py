"""The names that ``import mjhill`` gives."""

import subprocess
import sys

import mediapy
import numpy as np
import pytest
from test_render import frames_of

import mjhill
from mjhill.comparison.report import views_of


@pytest.fixture(scope="module")
def view():
    model = mjhill.load("elbow")
    with mjhill.installed():
        run = mjhill.record(
            model, mjhill.at_home(model), duration=0.2, excitation={"elbow_flexor": 0.5}
        )
    return mjhill.View(model, run)


def test_every_public_name_is_there_and_none_is_a_module_by_mistake():
    modules = {"experiments", "reference", "readings"}
    code = "import mjhill\nfor name in dir(mjhill): getattr(mjhill, name)"
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)
    for name in mjhill._LATER:
        assert callable(getattr(mjhill, name)) or name in modules, name
    assert callable(mjhill.install)
    assert callable(mjhill.energy)
    assert mjhill.readings.tension.__doc__
    with pytest.raises(AttributeError, match="has no attribute 'instal'"):
        mjhill.instal  # noqa: B018


def test_import_stays_light():
    code = "import sys, mjhill; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"matplotlib", "mediapy", "numba", "scipy", "mjhill.draw", "mjhill.experiments"}
    assert not heavy & set(done.stdout.split())


def test_frames_are_those_of_the_film(view, tmp_path):
    size = (320, 180)
    frames = list(mjhill.frames(view, fps=20, size=size))
    assert len(frames) == 4
    assert all(frame.shape == (180, 320, 3) and frame.dtype == np.uint8 for frame in frames)
    assert (frames[0] != frames[-1]).any()  # not one array four times
    film = frames_of(mjhill.render(view, tmp_path / "a.mp4", fps=20, size=size))
    assert len(film) == len(frames)
    for frame, coded in zip(frames, film, strict=True):
        # a film loses detail
        assert np.abs(frame.astype(float) - coded).mean() < 6


def test_frames_can_be_left_early_and_drawn_again(view):
    first = mjhill.frames(view, size=(64, 64))
    one = next(first)
    first.close()
    (again, *_) = mjhill.frames(view, size=(64, 64))
    np.testing.assert_array_equal(one, again)


def test_bad_options_of_frames_are_refused_at_once(view):
    with pytest.raises(ValueError, match="fps must be positive and finite, got 0"):
        mjhill.frames(view, fps=0)
    with pytest.raises(ValueError, match="there must be at least one view"):
        mjhill.frames([])


def test_a_recording_is_plotted(view, tmp_path):
    path = mjhill.plot(view.recording, tmp_path / "run.png")
    assert mediapy.read_image(path).ndim == 3


def test_a_joint_is_identified_from_python(tmp_path):
    found = mjhill.identify("wrist_rotation")
    assert found.joint.name == "wrist_rotation"
    assert "95 % interval" in str(found)
    assert found.predictions == ()
    with pytest.raises(ValueError, match="unknown joint 'toe'; there are: elbow"):
        mjhill.identify("toe")
    with pytest.raises(ValueError, match="inputs, delay, torque and decimal need measurements"):
        mjhill.identify("elbow", only=["damping"])


def test_muscles_are_compared_from_python():
    result = mjhill.compare("wrist", muscle="hill-rigid")
    assert result.rows
    ours, native = views_of(result)  # what the film shows
    assert (ours.model.na, native.model.na) == (4, 2)
