import os
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import imageio_ffmpeg
import mujoco
import numpy as np
import psutil
import pytest

from mjhill.draw import View, render, snapshot
from mjhill.draw.bellies import activation_colour, drawn_muscles, muscle_shapes, present_look
from mjhill.simulate.recording import Recording

ELBOW = Path(__file__).parent.parent / "models" / "elbow"
SMALL = {"size": (320, 240), "fps": 10}

NATIVE = """
<mujoco>
  <worldbody>
    <light pos="0 -1 2"/>
    <site name="origin" pos="0 0 0.5"/>
    <body>
      <joint name="slide" type="slide" axis="0 0 1"/>
      <geom size="0.05"/>
      <site name="insertion" pos="0.05 0 0.05"/>
    </body>
    <body pos="1 0 0">
      <freejoint name="floating"/>
      <geom type="box" size="0.1 0.05 0.02"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="rope"><site site="origin"/><site site="insertion"/></spatial>
  </tendon>
  <actuator>
    <muscle name="native" tendon="rope" force="25" lengthrange="0.2 0.6"/>
  </actuator>
</mujoco>
"""


@pytest.fixture(scope="module")
def elbow():
    return mujoco.MjModel.from_xml_path(str(ELBOW / "scene.xml"))


def recording(duration=1.0, angle=1.2, activation=0.5, force=30.0):
    """The elbow moving from 0 to ``angle``, with a flexor that does not change."""
    time = np.linspace(0, duration, 101)
    values = {
        "elbow.angle": angle * time / duration,
        "elbow_flexor.a": np.full_like(time, activation),
        "elbow_flexor.force": np.full_like(time, force),
        "elbow_extensor.a": np.zeros_like(time),
        "elbow_extensor.force": np.zeros_like(time),
    }
    units = dict.fromkeys(values, "-") | {
        "elbow_flexor.force": "N·m",
        "elbow_extensor.force": "N·m",
    }
    return Recording(time, values, units)


def frames_of(path):
    """The frames of a video, shape (N, H, W, 3), decoded by ffmpeg."""
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    about = subprocess.run([ffmpeg, "-i", path], capture_output=True, text=True, check=False).stderr
    width, height = map(int, re.search(r"Video: .* (\d+)x(\d+)", about).groups())
    decode = [ffmpeg, "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    pixels = subprocess.run(decode, capture_output=True, check=True).stdout
    return np.frombuffer(pixels, np.uint8).reshape(-1, height, width, 3)


def redness(image):
    """How much red exceeds the other channels in each pixel, shape (H, W)."""
    channels = image.astype(int)
    return channels[..., 0] - channels[..., 1:].max(axis=-1)


def saved(model):
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def encoders():
    return [p for p in psutil.Process().children(recursive=True) if "ffmpeg" in p.name()]


def run_python(program, **environment):
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "MUJOCO_GL")}
    return subprocess.run(
        [sys.executable, "-c", program],
        env=kept | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_video_has_the_frames_and_the_size_asked_for(elbow, tmp_path):
    done = []
    path = render(
        View(elbow, recording(), "Elbow"),
        tmp_path / "elbow.mp4",
        progress=lambda k, n: done.append((k, n)),
        **SMALL,
    )
    assert frames_of(path).shape == (10, 240, 320, 3)
    assert done == [(k + 1, 10) for k in range(10)]
    assert list(tmp_path.iterdir()) == [path]


def test_slow_motion_takes_more_frames_of_the_same_run(elbow, tmp_path):
    path = render(View(elbow, recording(0.4)), tmp_path / "slow.mp4", speed=0.25, **SMALL)
    assert len(frames_of(path)) == 16


def test_the_cursor_runs_over_the_curves_at_an_even_pace(elbow, tmp_path):
    frames = frames_of(
        render(View(elbow, recording()), tmp_path / "a.mp4", size=(640, 360), fps=10)
    )
    # only the cursor darkens whole columns of the plots, the right half of the frame
    columns = [int(frame[30:, 330:].mean(axis=(0, 2))[20:].argmin()) for frame in frames]
    steps = np.diff(columns)
    assert steps.min() > 10
    assert np.ptp(steps) <= 2  # one pixel of rounding, one of the encoder's chroma


def test_frames_change_with_the_pose_and_panels_show_their_own_run(elbow, tmp_path):
    views = [View(elbow, recording(angle=0.0)), View(elbow, recording(angle=2.0))]
    frames = frames_of(render(views, tmp_path / "two.mp4", size=(640, 360), fps=4)).astype(int)
    left, right = frames[:, 30:130, :300], frames[:, 30:130, 320:620]

    def changed(before, after):
        return (np.abs(before - after) > 40).mean()  # more than the encoder's own error

    assert changed(left[0], right[0]) < 1e-3  # the same pose
    assert changed(left[0], left[-1]) < 1e-3
    assert changed(right[0], right[-1]) > 0.02


def test_a_gif_can_be_written(elbow, tmp_path):
    path = render(View(elbow, recording(0.3)), tmp_path / "elbow.gif", **SMALL)
    assert path.read_bytes().startswith(b"GIF89a")
    assert len(frames_of(path)) == 3


def test_a_belly_gets_redder_with_activation(elbow):
    red = [
        np.sort(redness(snapshot(elbow, recording(activation=a), 0.5, size=(320, 240))).ravel())
        for a in (0.0, 0.5, 1.0)
    ]
    strongest = [values[-100:].mean() for values in red]  # the skin is reddish, the belly red
    assert strongest[1] > strongest[0] + 20
    assert strongest[2] > strongest[1] + 50


def test_a_belly_gets_thicker_with_force(elbow):
    areas = [
        (redness(snapshot(elbow, recording(activation=1, force=f), 0.5)) > 120).sum()
        for f in (0.0, 15.0, 61.5)
    ]
    assert areas[1] > 1.3 * areas[0]
    assert areas[2] > 1.3 * areas[1]


def test_activation_colour_runs_from_slate_to_red_and_never_back():
    colours = activation_colour(np.linspace(0, 1, 50))
    assert np.all(np.diff(colours[:, 0]) > 0)
    assert np.all(np.diff(colours[:, 1]) < 0)


@pytest.mark.parametrize("angle", [0.0, 0.7, 1.4, 2.0, 2.6])
def test_muscle_paths_are_unbroken_and_stay_out_of_the_elbow(elbow, angle):
    data = mujoco.MjData(elbow)
    data.qpos[0] = angle
    mujoco.mj_fwdKinematics(elbow, data)
    joint = data.xanchor[0]
    for muscle in drawn_muscles(elbow, None):
        strand = [s for s in muscle_shapes(elbow, data, muscle, 0.0) if not s.belly]
        for before, after in pairwise(strand):
            np.testing.assert_allclose(before.end, after.start)
        length = sum(float(np.linalg.norm(s.end - s.start)) for s in strand)
        # chords of the arc are a little shorter than the arc
        assert length == pytest.approx(float(data.ten_length[muscle.tendon]), rel=0.01)
        middles = [(s.start + s.end) / 2 - joint for s in strand]
        assert min(np.hypot(m[0], m[2]) for m in middles) > 0.024


def test_a_native_muscle_is_drawn_along_the_tendon_it_acts_on():
    model = mujoco.MjModel.from_xml_string(NATIVE)
    (muscle,) = drawn_muscles(model, None)
    assert (muscle.name, muscle.max_force, muscle.tendon) == ("native", 25.0, 0)
    assert snapshot(model, size=(128, 96)).shape == (96, 128, 3)


def test_slides_and_free_joints_are_put_back(tmp_path):
    model = mujoco.MjModel.from_xml_string(NATIVE)
    time = np.array([0.0, 1.0])
    values = {"slide.position": np.array([0.0, 0.2])}
    values |= {f"floating.qpos{i}": np.full(2, v) for i, v in enumerate((1, 0, 0, 1, 0, 0, 0))}
    run = Recording(time, values, dict.fromkeys(values, "-"))
    before, after = (snapshot(model, run, t, size=(320, 240)).astype(int) for t in (0.0, 1.0))
    assert np.abs(before - after).max() > 30
    assert len(frames_of(render(View(model, run), tmp_path / "a.mp4", size=(64, 64), fps=5))) == 5


def test_a_dollar_sign_in_the_legend_is_a_dollar_sign(tmp_path):
    # two joints, so that the plot of angles has a legend; the first name would be a wrong formula
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="$\\frac$"/><geom size="0.1"/>
        <body><joint name="other"/><geom size="0.1"/></body></body></worldbody></mujoco>"""
    )
    values = {"$\\frac$.angle": np.zeros(2), "other.angle": np.ones(2)}
    run = Recording(np.array([0.0, 0.4]), values, dict.fromkeys(values, "rad"))
    assert render(View(model, run), tmp_path / "a.mp4", size=(640, 360), fps=5).exists()


def test_the_users_model_is_left_as_it_was(elbow, tmp_path):
    before = saved(elbow)
    render(View(elbow, recording(0.2)), tmp_path / "elbow.mp4", **SMALL)
    snapshot(elbow, recording(), size=(2000, 1200))  # more than the model's offscreen buffer
    assert saved(elbow) == before


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt])
def test_a_failure_leaves_no_file_and_no_encoder(elbow, tmp_path, error):
    path = tmp_path / "elbow.mp4"

    def fail(done, total):
        if done == 3:
            assert len(encoders()) == 1
            raise error

    with pytest.raises(error):
        render(View(elbow, recording()), path, progress=fail, **SMALL)
    assert list(tmp_path.iterdir()) == []
    assert encoders() == []
    render(View(elbow, recording(0.2)), path, **SMALL)  # and the next one works
    assert path.exists()


def test_a_dead_encoder_is_reported_and_leaves_no_file(elbow, tmp_path):
    def kill(done, total):
        if done == 2:
            for process in encoders():
                process.kill()
                process.wait()

    with pytest.raises(RuntimeError, match="the video encoder stopped"):
        render(View(elbow, recording()), tmp_path / "elbow.mp4", progress=kill, **SMALL)
    assert list(tmp_path.iterdir()) == []
    assert encoders() == []


def test_a_full_disk_is_reported_and_leaves_no_file(tmp_path):
    program = (
        "import resource, mujoco, numpy as np\n"
        "from mjhill.simulate.recording import Recording; from mjhill.draw import View, render\n"
        "m = mujoco.MjModel.from_xml_string('<mujoco/>')\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))\n"
        f"path = {str(tmp_path / 'a.mp4')!r}\n"
        "try: render(View(m, Recording(np.array([0, 1.0]), {}, {})), path, size=(64, 64))\n"
        "except RuntimeError as error: print(error)"
    )
    result = run_python(program)
    assert "the video encoder stopped" in result.stdout, result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"size": (321, 240)}, "even for the encoder, got 321 x 240; use 322 x 240"),
        ({"size": (10, 240)}, "64 to 8192 pixels"),
        ({"fps": 0}, "fps must be positive and finite, got 0"),
        ({"speed": float("nan")}, "speed must be positive and finite, got nan"),
        ({"camera": "front"}, "unknown camera 'front'; the model's cameras are: side"),
    ],
)
def test_bad_arguments_are_refused(elbow, tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        render(View(elbow, recording()), tmp_path / "a.mp4", **(SMALL | change))
    assert list(tmp_path.iterdir()) == []


def test_a_recording_of_another_model_is_refused(elbow, tmp_path):
    empty = Recording(np.zeros(1), {}, {})
    with pytest.raises(ValueError, match=r"no series 'elbow\.angle', which joint 'elbow'"):
        render(View(elbow, empty), tmp_path / "a.mp4")
    with pytest.raises(ValueError, match="at least one view"):
        render([], tmp_path / "a.mp4")


def test_an_output_that_cannot_be_written_is_refused_before_the_first_frame(elbow, tmp_path):
    done = []
    for name, error in (("a.avi", ValueError), ("missing/a.mp4", FileNotFoundError)):
        with pytest.raises(error):
            render(View(elbow, recording()), tmp_path / name, progress=lambda *k: done.append(k))
    with pytest.raises(ValueError, match=r"\.png"):
        snapshot(elbow, path=tmp_path / "a.jpg")
    assert done == []


def test_a_snapshot_without_a_recording_shows_the_home_key(elbow, tmp_path):
    home = float(elbow.key_qpos[0, 0])
    rest = recording(angle=home, activation=0, force=0)
    image = snapshot(elbow, path=tmp_path / "home.png", size=(320, 240))
    np.testing.assert_array_equal(image, snapshot(elbow, rest, 1.0, size=(320, 240)))
    assert (tmp_path / "home.png").read_bytes().startswith(b"\x89PNG")


def test_rendering_needs_no_screen_and_no_setting():
    program = (
        "import mujoco; from mjhill.draw import snapshot\n"
        f"m = mujoco.MjModel.from_xml_path({str(ELBOW / 'scene.xml')!r})\n"
        "print(snapshot(m, size=(64, 64)).std() > 5)"
    )
    result = run_python(program)
    assert result.stdout.strip() == "True", result.stderr


def test_a_machine_without_opengl_is_told_what_to_install():
    program = (
        "import mujoco; from mjhill.draw import snapshot\n"
        f"m = mujoco.MjModel.from_xml_path({str(ELBOW / 'scene.xml')!r})\n"
        "try: snapshot(m, size=(64, 64))\n"
        "except RuntimeError as error: print(error)"
    )
    # a device that is not there: what a machine without a driver looks like to EGL
    result = run_python(program, MUJOCO_GL="egl", MUJOCO_EGL_DEVICE_ID="99")
    assert "libegl1 libgles2 libgl1-mesa-dri" in result.stdout, result.stderr


def test_the_drawn_tendons_of_the_elbow_do_not_change_its_motion():
    spec = mujoco.MjSpec.from_file(str(ELBOW / "elbow.xml"))
    model = spec.compile()
    for tendon in list(spec.tendons):
        spec.delete(tendon)
    bare = spec.compile()
    assert (model.ntendon, bare.ntendon) == (2, 0)
    motions = []
    for m in (model, bare):
        data = mujoco.MjData(m)
        mujoco.mj_step(m, data, nstep=500)  # the passive plant on its own
        motions.append((data.qpos[0], data.qvel[0]))
    assert motions[0] == motions[1]
    assert motions[0][0] > 0.5


def test_muscles_can_be_drawn_into_the_scene_of_any_renderer():
    program = """
import mujoco, mjhill
m = mjhill.load("elbow")
d = mjhill.at_home(m)
mjhill.install()
with mujoco.Renderer(m, 240, 320) as renderer:
    for d.ctrl[0] in (0, 1):
        mjhill.equilibrate(m, d)
        mujoco.mj_forward(m, d)
        renderer.update_scene(d, camera="side")
        mjhill.draw_muscles(renderer.scene, m, d)
        image = renderer.render().astype(int)
        print((image[..., 0] - image[..., 1:].max(axis=-1) > 120).sum())
"""
    result = run_python(program, MUJOCO_GL="egl")
    assert result.returncode == 0, result.stderr
    rest, active = map(int, result.stdout.split())
    assert active > rest + 100  # the plain tendons are a little red


def test_a_native_muscle_shows_its_present_activation_and_force():
    model = mujoco.MjModel.from_xml_string(NATIVE)
    data = mujoco.MjData(model)
    data.act[0] = 0.7
    mujoco.mj_forward(model, data)
    (muscle,) = drawn_muscles(model, None)
    activation, force = present_look(data, muscle)
    assert activation == 0.7
    assert force == pytest.approx(-data.actuator_force[0] / 25)
    assert force > 0.1
