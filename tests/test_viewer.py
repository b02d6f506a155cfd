import os
import signal
import subprocess
import sys
import textwrap
import threading
from contextlib import contextmanager

import mujoco
import pytest
from screen import open_screen, wait_for

import mjhill
from mjhill.draw.viewer import Player

SPACE, MINUS, EQUAL, BACKSPACE, RIGHT, LEFT = 32, 45, 61, 259, 262, 263


@pytest.fixture(scope="module")
def screen():
    with open_screen() as opened:
        yield opened


@pytest.fixture
def elbow():
    model = mjhill.load("elbow")
    with mjhill.installed():
        yield model


def paused(model):
    data = mjhill.at_home(model)
    return Player(model, data, running=False, speed=1.0), data


def pressed(player, *keys):
    for key in keys:
        player.press(key)
    player.play(0.0)


def red(picture):
    """How many pixels are as red as a belly at full activation, which skin is not."""
    return int((picture[..., 0] - picture[..., 1:].max(axis=-1) > 120).sum())


def command(*arguments, **environment):
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(
        [sys.executable, "-m", "mjhill", *arguments],
        env=kept | environment, capture_output=True, text=True, check=False,
    )  # fmt: skip


@contextmanager
def on(screen, *arguments):
    """A process of Python's on a virtual screen, killed at the end or after two minutes."""
    with subprocess.Popen(
        [sys.executable, *arguments],
        env=screen.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        timer = threading.Timer(120, process.kill)
        timer.start()
        try:
            yield process
        finally:
            timer.cancel()
            process.kill()


def test_arrows_step_to_and_fro_while_paused(elbow):
    player, data = paused(elbow)
    data.ctrl[0] = 1.0
    pressed(player, RIGHT, RIGHT, RIGHT)
    assert data.time == pytest.approx(3 * elbow.opt.timestep)
    pressed(player, LEFT)
    after_two = data.qpos[0], data.act.tolist()
    assert data.time == pytest.approx(2 * elbow.opt.timestep)
    pressed(player, RIGHT, LEFT)
    assert (data.qpos[0], data.act.tolist()) == after_two
    pressed(player, LEFT, LEFT, LEFT, LEFT)  # there is nothing before the start
    assert data.time == 0


def test_time_goes_on_only_while_running_and_by_the_speed(elbow):
    player, data = paused(elbow)
    player.play(0.01)
    assert data.time == 0
    pressed(player, SPACE)
    ends = []
    for key in (None, MINUS, EQUAL):
        if key:
            pressed(player, key)
        before = data.time
        for _ in range(50):
            player.play(0.002)
        ends.append(data.time - before)
    assert ends == pytest.approx([0.1, 0.05, 0.1], abs=elbow.opt.timestep)
    pressed(player, SPACE)
    player.play(0.01)
    assert data.time == pytest.approx(sum(ends))


def test_a_machine_that_is_too_slow_shows_slow_motion_and_does_not_stall(elbow):
    elbow.opt.timestep = 1e-6  # more steps than a frame has time for
    player, data = paused(elbow)
    pressed(player, SPACE)
    player.play(10.0)
    first = data.time
    assert 0 < first <= 0.1
    player.play(0.0)
    assert data.time - first < 2e-6  # what was missed is not made up for


def test_backspace_and_a_reset_by_the_window_go_back_to_the_start(elbow):
    player, data = paused(elbow)
    start = data.qpos[0], data.act.tolist()
    for reset in (lambda: pressed(player, BACKSPACE), lambda: mujoco.mj_resetData(elbow, data)):
        data.ctrl[0] = 1.0
        pressed(player, RIGHT)
        reset()
        player.notice_reset()
        assert (data.qpos[0], data.act.tolist()) == start
        assert (data.time, data.ctrl[0]) == (0, 0)


def test_a_warning_pauses_until_the_start_again(elbow):
    player, data = paused(elbow)
    data.qvel[0] = 1e11
    pressed(player, RIGHT)
    assert "MuJoCo warned 'badqvel'" in player.problem
    assert any("badqvel" in words for *_, words in player.texts())
    pressed(player, SPACE)
    assert not player.running
    pressed(player, BACKSPACE, SPACE)
    player.play(0.01)
    assert (player.problem, player.running, data.time > 0) == ("", True, True)


def test_bad_arguments_are_refused_before_a_window_opens():
    model = mjhill.load("elbow")
    with pytest.raises(ValueError, match=r"speed must be in \[1/64, 4\], got 5"):
        mjhill.view(model, speed=5)
    data = mujoco.MjData(model)
    data.ctrl[1] = float("nan")
    with pytest.raises(ValueError, match=r"data.ctrl\[1\] must be finite"):
        mjhill.view(model, data)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems always have a display")
@pytest.mark.parametrize(
    ("display", "reason"),
    [({}, "neither DISPLAY nor WAYLAND_DISPLAY is set"), ({"DISPLAY": ":987"}, "display :987")],
)
def test_without_a_display_the_command_says_so_in_a_line(display, reason):
    done = command("view", "elbow", **display)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: no display to open a window on (")
    assert reason in line
    assert "`mjhill video MODEL`" in line


def test_the_window_shows_activation_and_obeys_keys(screen):
    program = """
    import threading, time, mjhill
    model = mjhill.load("elbow")
    data = mjhill.at_home(model)

    def watch():
        last = 0
        while True:
            step = round(data.time / model.opt.timestep)
            if step != last:
                print(step, flush=True)
            last = step
            time.sleep(0.01)

    threading.Thread(target=watch, daemon=True).start()
    mjhill.view(model, data, paused=True)
    print("closed", mjhill.installed_backend(), flush=True)
    data = mjhill.at_home(model)
    data.ctrl[0] = 1.0
    mjhill.equilibrate(model, data)
    mjhill.view(model, data, paused=True)
    print("closed", set(model.tendon_group.tolist()))
    """
    with on(screen, "-c", textwrap.dedent(program)) as process:
        wait_for(lambda: screen.picture().std() > 30)
        assert red(screen.picture()) < 20
        for key, step in (("Right", 1), ("Right", 2), ("Left", 1)):
            screen.press(key)
            assert process.stdout.readline() == f"{step}\n"
        screen.press("ctrl+q")
        assert process.stdout.readline() == "closed None\n"
        wait_for(lambda: red(screen.picture()) > 500)
        screen.press("ctrl+q")
        assert process.stdout.read().endswith("closed {0}\n")
        assert process.wait() == 0
        assert process.stderr.read() == ""


def test_the_command_runs_until_it_is_interrupted(screen):
    with on(screen, "-m", "mjhill", "view", "elbow") as process:
        wait_for(lambda: screen.picture().std() > 30)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
        assert (process.stdout.read(), process.stderr.read()) == ("", "interrupted\n")
