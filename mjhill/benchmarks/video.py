"""Video: frames per second beside MuJoCo's renderer alone, and memory by length."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import mujoco

from mjhill.benchmarks.result import Result
from mjhill.draw import View, render
from mjhill.simulate.load import model_path
from mjhill.simulate.recording import Recording
from mjhill.simulate.scripted import run

SIZE, FPS, ROUNDS = (1280, 720), 30, 5
SHORT, LONG = 5.0, 60.0  # of film [s]
SHARE, GROWTH = 0.9, 1.05  # goals: of the renderer's frames, of the short film's memory [-]
_ALONE = """
import time
import mujoco
width, height = {size}
model = mujoco.MjModel.from_xml_path({path!r})
model.vis.global_.offwidth, model.vis.global_.offheight = width, height
data = mujoco.MjData(model)
start = time.perf_counter()
with mujoco.Renderer(model, height, width) as renderer:
    for angle in {angles}:
        data.qpos[0] = angle
        mujoco.mj_fwdPosition(model, data)
        renderer.update_scene(data, camera="side")
        renderer.render()
    print(time.perf_counter() - start)
"""
_PAGE = os.sysconf("SC_PAGE_SIZE")


def measure() -> Result:
    """Frame rates, interleaved, and resident memory at the last frame."""
    model, recording = run("elbow", {}, {}, duration=4.0)
    frames = round(FPS * recording.time[-1])
    alone, ours = [], []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        for _ in range(ROUNDS):
            alone.append(frames / _render_alone(recording, frames))
            start = time.perf_counter()
            render(View(model, recording), path, fps=FPS, size=SIZE)
            ours.append(frames / (time.perf_counter() - start))
        memory = {length: _memory(model, recording, length, path) for length in (SHORT, LONG)}
    rates = {
        "MuJoCo's renderer alone": statistics.median(alone),
        "mjhill: film with curves, encoded, start and end included": statistics.median(ours),
    }
    base = statistics.median(alone)
    rows: list[dict[str, Any]] = []
    for what, rate in rates.items():
        wanted, share = rate != base, rate / base
        rows.append(
            {
                "what": what,
                "goal": f"≥ {SHARE:g} of the renderer" if wanted else None,
                "value": rate,
                "unit": "frames/s",
                "share": share,
                "met": share >= SHARE if wanted else None,
            }
        )
    for length, size in memory.items():
        wanted, share = length != SHORT, size / memory[SHORT]
        rows.append(
            {
                "what": f"memory at the end of {length:g} s of film",
                "goal": f"≤ {GROWTH:g} of the short film's" if wanted else None,
                "value": size,
                "unit": "MiB",
                "share": share,
                "met": share <= GROWTH if wanted else None,
            }
        )
    notes = (
        f"elbow, {SIZE[0]}x{SIZE[1]}, {frames} frames, {ROUNDS} rounds A B A B ..., medians",
        "share: of the renderer's frames, and of the short film's memory, which must not grow with "
        "the length",
    )
    return Result("Video", rows, notes)


def _render_alone(recording: Recording, frames: int) -> float:
    """Seconds that MuJoCo's renderer needs for the same frames.

    In a new process, because MuJoCo reads MUJOCO_GL when it is imported.
    """
    angles = recording["elbow.angle"][:: len(recording) // frames][:frames]
    program = _ALONE.format(path=str(model_path("elbow")), size=SIZE, angles=angles.tolist())
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "MUJOCO_GL": os.environ.get("MUJOCO_GL", "egl")},
    )
    return float(done.stdout)


def _memory(model: mujoco.MjModel, recording: Recording, length: float, path: Path) -> float:
    """Resident memory [MiB] at the last frame of a film in slow motion of that length."""
    seen: list[float] = []

    def progress(done: int, total: int) -> None:
        if done >= total - 1:
            resident = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
            seen.append(resident * _PAGE / 2**20)

    speed = float(recording.time[-1]) / length
    render(View(model, recording), path, fps=FPS, size=(640, 360), speed=speed, progress=progress)
    return seen[-1]
