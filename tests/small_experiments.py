"""Experiments small enough for tests: real runs, real figures."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from mjhill import JOINTS
from mjhill.experiments.result import Claim, Measure, Result
from mjhill.lab.rig import at_rest, build_rig, record_run, strongest_angle
from mjhill.report import Entry
from mjhill.simulate.recording import Recording

HOSTILE = "<script>alert(1)</script> & \"quoted\" 'text' {{ 7 * 7 }}"


@dataclass(frozen=True)
class Rise(Result):
    """Rise of a muscle's torque, the joint held or free."""

    joint: str
    run: Recording
    peak: float

    title: ClassVar[str] = f"Rise {HOSTILE}"
    section: ClassVar[str] = "4.1.2, Fig. 5b"
    size: ClassVar[tuple[float, float]] = (9.0, 4.0)

    def measures(self):
        published = (0.5 * self.peak, 0.9 * self.peak)
        yield Measure("peak torque", np.float64(self.peak), "N·m", published, "paper")
        yield Measure("level", 0.5, "-", (0.5, 0.5), HOSTILE)
        yield Measure("time of fall", None, "s", note=f"it does not fall, {HOSTILE}")
        yield Measure("smallest", 1.7e-5, "N·m/rad")

    def claims(self):
        rises = bool(np.all(np.diff(self.run[next(iter(self.forces()))]) >= 0))
        yield Claim(f"Torque rises: {HOSTILE}", "4.1.2", rises, f"least step {0.25:g} N·m")
        yield Claim("Torque falls.", "4.1.2", not rises, f"evidence {HOSTILE}")
        yield Claim("It hurts.", "4", None, "no one was asked")

    def forces(self):
        return [name for name in self.run if name.endswith(".force")]

    def draw(self, figure):
        axes = figure.subplots()
        for name in self.forces():
            axes.plot(self.run.time, self.run[name], label=name)
        axes.set(xlabel="time [s]", ylabel="torque [N·m]")
        axes.legend()

    def film(self):
        return self.run


def rise(joint="elbow", *, level=0.5, duration=0.05, exact=False, progress=None):
    bench = build_rig(JOINTS[joint], exact=exact)
    muscle = next(iter(JOINTS[joint].muscles))
    start = at_rest(bench, strongest_angle(JOINTS[joint], muscle))
    recording = record_run(bench, start, duration, excitation={muscle: level})
    progress(0.5)
    return Rise(joint, recording, float(recording[f"{muscle}.force"].max()))


def failing(joint="elbow", *, progress=None):
    raise ValueError(f"the {joint} would not <b>move</b>")


def crashing(joint="elbow", *, progress=None):
    os._exit(7)


def not_finite(joint="elbow", *, progress=None):
    return Rise(joint, rise(joint, progress=progress).run, float("nan"))


def signalled(joint="elbow", *, progress=None):
    os.kill(os.getpid(), signal.SIGINT)
    return rise(joint, progress=progress)


def endless(joint="elbow", *, progress=None):
    Path(os.environ["AT_WORK"]).touch()
    while True:  # and reports nothing, so that a broken pipe does not end it
        time.sleep(0.02)


def entry(name, *joints, filmed=False, id=None):
    return Entry(id or name, f"small_experiments:{name}", joints or ("elbow",), filmed)
