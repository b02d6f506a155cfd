"""How commands end: interrupted, killed, out of disk, with nobody to read what they print."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import matplotlib.image
import psutil
import pytest

import mjhill
from mjhill import interrupts
from mjhill.cli.printing import progress_bar
from mjhill.files import replacing

MJHILL = (sys.executable, "-m", "mjhill")
# how long to wait for something that comes soon on a machine with other work [s]
PATIENCE = 60.0


class Command:
    """A command in a process group of its own, to which Ctrl-C goes as in a terminal."""

    def __init__(self, *arguments, **options):
        self.process = subprocess.Popen(
            [*MJHILL, *arguments],
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            **options,
        )

    def wait_for(self, pattern):
        """Wait until a file or folder of that name is there."""
        until = time.monotonic() + PATIENCE
        while not list(Path().glob(pattern)):
            assert time.monotonic() < until
            assert self.process.poll() is None, self.process.stderr.read()
            time.sleep(0.005)

    def end(self, number):
        """Send a signal to the group; gives the exit code and what was said."""
        group = psutil.Process(self.process.pid).children(recursive=True)
        os.killpg(self.process.pid, number)
        try:
            _, errors = self.process.communicate(timeout=PATIENCE)
        finally:
            self.process.kill()
        assert psutil.wait_procs(group, timeout=10)[1] == []
        return self.process.returncode, errors


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*.*"))


def assert_whole(folder):
    for path in Path(folder).rglob("*.*"):
        if path.suffix == ".csv":
            assert len(mjhill.Recording.load(path)) > 100
        elif path.suffix == ".png":
            matplotlib.image.imread(path)
        elif path.suffix == ".json":
            json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("arguments", "begun", "number", "code"),
    [
        (("video", "elbow"), "out/.*.mp4", signal.SIGINT, 130),
        (("video", "elbow"), "out/.*.mp4", signal.SIGTERM, 143),
        (("run", "elbow", "-d", "2000"), "out", signal.SIGTERM, 143),
        (("identify", "elbow"), "out/identify", signal.SIGINT, 130),
    ],
)
def test_an_interrupted_command_leaves_no_file(arguments, begun, number, code):
    command = Command(*arguments)
    command.wait_for(begun)
    returned, errors = command.end(number)
    assert returned == code
    assert errors == ("interrupted\n" if number == signal.SIGINT else "")
    assert files("out") == []


@pytest.mark.parametrize(
    ("arguments", "begun", "left"),
    [
        (("demo",), "out/.*.mp4", ["demo-elbow.csv", "demo-elbow.png"]),
        (("compare", "--no-cost"), "out/compare/elbow/.*.csv", None),
    ],
)
def test_what_an_interrupted_command_has_written_by_then_is_whole(arguments, begun, left):
    command = Command(*arguments)
    command.wait_for(begun)
    assert command.end(signal.SIGINT) == (130, "interrupted\n")
    assert left is None or files("out") == left
    assert not [name for name in files("out") if "partial" in name]
    assert_whole("out")


def test_a_killed_command_leaves_nothing_under_the_final_name_and_the_next_one_cleans_up():
    command = Command("run", "elbow", "-d", "10")
    command.wait_for("out/.*.csv")
    assert command.end(signal.SIGKILL)[0] == -signal.SIGKILL
    (left,) = files("out")
    assert left.startswith(".run-elbow.mjhill.")
    subprocess.run([*MJHILL, "run", "elbow", "-d", "0.01", "-o", "out/next.csv"], check=True)
    assert files("out") == ["next.csv"]


@pytest.mark.parametrize("arguments", [("run", "elbow"), ("video", "elbow", "-d", "0.3")])
def test_a_full_disk_ends_in_one_line_and_leaves_no_file(arguments):
    def small_disk():
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))

    run = subprocess.run(
        [*MJHILL, *arguments], capture_output=True, text=True, preexec_fn=small_disk, check=False
    )
    assert run.returncode == 1
    assert run.stderr.startswith("error: ")
    assert run.stderr.count("\n") == 1
    assert files("out") == []


def test_a_command_whose_reader_has_gone_ends_quietly():
    run = subprocess.run(
        ["bash", "-c", f"{sys.executable} -m mjhill info elbow | true; echo ${{PIPESTATUS[0]}}"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stderr == ""
    assert run.stdout == f"{128 + signal.SIGPIPE}\n"


@pytest.mark.parametrize("arguments", ["list", "--help", "info eye --json"])
def test_a_full_disk_behind_the_output_ends_in_one_line(arguments):
    with Path("/dev/full").open("w") as full:
        run = subprocess.run(
            [*MJHILL, *arguments.split()], stdout=full, stderr=subprocess.PIPE, text=True,
            check=False,
        )  # fmt: skip
    assert run.returncode == 1
    assert run.stderr == "error: [Errno 28] No space left on device\n"


def test_a_command_with_closed_streams_does_its_work():
    subprocess.run(
        ["bash", "-c", f"{sys.executable} -m mjhill run elbow -d 0.2 <&- >&- 2>&-"], check=True
    )
    assert files("out") == ["run-elbow.csv"]
    assert_whole("out")


def test_an_interrupt_whose_exception_was_lost_comes_again():
    with interrupts.handled():
        with suppress(KeyboardInterrupt):  # as a callback from C, or __del__, loses it
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            interrupts.check()
        with progress_bar("working") as progress, pytest.raises(KeyboardInterrupt):
            progress(0.5)
        with pytest.raises(KeyboardInterrupt), replacing("file.txt") as partial:
            partial.write_text("text")
        assert files(".") == []
        interrupts.acknowledge()
        interrupts.check()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_signal_that_is_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupts.handled():
            signal.raise_signal(signal.SIGHUP)
            interrupts.check()
    finally:
        signal.signal(signal.SIGHUP, before)


LOST = """
import os, signal, sys, threading, time
import mujoco
import mjhill.engine.structs as structs
real = structs.verify_fields
def slow():
    os.kill(os.getpid(), signal.SIGINT)  # while the muscle is being loaded
    time.sleep(0.1)
    real()
structs.verify_fields = slow
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
try:
    data.ctrl[:] = 1
    mujoco.mj_step(model, data)
    time.sleep(5)
except KeyboardInterrupt:
    mujoco.mj_step(model, data, 20)
    sys.exit(0 if data.actuator_force.min() < -0.01 else 3)
sys.exit(4)
"""


def test_ctrl_c_while_the_first_muscle_is_loaded_is_raised_and_the_muscle_works():
    environment = {k: v for k, v in os.environ.items() if k != "MJHILL_AUTOLOAD"}
    run = subprocess.run(
        [sys.executable, "-c", LOST, str(mjhill.model_path("elbow"))],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert "Exception ignored" not in run.stderr
