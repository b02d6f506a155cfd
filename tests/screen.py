"""A virtual X screen: its picture, and keys for the window on it."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

TOOLS = ("Xvfb", "xdotool")
PROBE = """
import glfw, sys
glfw.init() or sys.exit("no GLFW")
glfw.create_window(64, 64, "", None, None) or sys.exit("no OpenGL")
"""


class Screen:
    """An Xvfb with a display of its own; ``environment`` is for the processes that use it."""

    def __init__(self, size=(1200, 800)):
        self.folder = tempfile.TemporaryDirectory()
        number, write = os.pipe()
        self.process = subprocess.Popen(
            [
                "Xvfb", "-displayfd", str(write), "-fbdir", self.folder.name,
                "-screen", "0", "{}x{}x24".format(*size), "-nolisten", "tcp",
            ],
            pass_fds=(write,), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(write)
        with os.fdopen(number) as file:
            display = file.readline().strip()
        self.environment = {**os.environ, "DISPLAY": f":{display}"}
        self.environment.pop("WAYLAND_DISPLAY", None)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.terminate()
        self.process.wait()
        self.folder.cleanup()

    def picture(self):
        """What is on the screen, RGB, shape (height, width, 3)."""
        file = (Path(self.folder.name) / "Xvfb_screen0").read_bytes()
        header = np.frombuffer(file, ">u4", 25)  # as X11/XWDFile.h has it
        size, height, row, colours = (int(header[i]) for i in (0, 5, 12, 19))
        pixels = np.frombuffer(file, np.uint8, height * row, size + 12 * colours)
        return pixels.reshape(height, -1, 4)[..., 2::-1].astype(int)

    def press(self, key):
        """Press a key in the window of MuJoCo."""
        found = subprocess.run(
            ["xdotool", "search", "--name", "MuJoCo"],
            env=self.environment, capture_output=True, text=True, check=True,
        )  # fmt: skip
        window = found.stdout.split()[-1]
        subprocess.run(
            ["xdotool", "key", "--window", window, key], env=self.environment, check=True
        )


def wait_for(condition, seconds=60.0):
    """Wait until a function gives something true."""
    until = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < until, "it never came true"
        time.sleep(0.05)
    return value


def open_screen():
    """A virtual screen on which GLFW opens windows; without one the test is skipped."""
    for tool in TOOLS:
        if shutil.which(tool) is None:
            pytest.skip(f"there is no {tool}")
    screen = Screen()
    probe = subprocess.run(
        [sys.executable, "-c", PROBE],
        env=screen.environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if probe.returncode:
        screen.__exit__()
        pytest.skip(f"no window on a virtual screen: {probe.stderr}")
    return screen
