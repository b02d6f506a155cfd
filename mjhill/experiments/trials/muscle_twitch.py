"""The isometric twitch of one muscle, and what is measured of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.responses import half_life
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometry import active_torque, stiff_machine, zeroed
from mjhill.lab.rig import (
    UnmeasuredError,
    at_rest,
    build_rig,
    direction,
    record_run,
    strongest_angle,
)
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import pulse

PULSE = 2e-3  # [s]; the neural impulse of Winters & Stark 1987, sect. 4.1.1
TWITCH_TIME = 1.0  # length of a run [s]
_TETANUS_TIME = 1.5  # [s]


@dataclass(frozen=True)
class MuscleTwitch:
    """A twitch, at the angle of the largest force.

    Attributes:
        angle: Where it was measured [rad].
        contraction: From the start of the pulse to the peak of torque [s].
        half_relaxation: From the peak to half of it [s].
        peak: Largest torque above that at rest [N·m].
        share: Peak, as a share of the largest torque under lasting full input [-].
        torque: At the dynamometer, above that at rest, at ``run.time`` [N·m], shape (T,).
        run: The recording.
    """

    angle: float
    contraction: float
    half_relaxation: float
    peak: float
    share: float
    torque: NDArray[np.float64]
    run: Recording


def muscle_twitch(joint: Joint, muscle: str, *, width: float = PULSE) -> MuscleTwitch:
    """The twitch of a muscle to full input of ``width`` [s], on a dynamometer.

    Its gauge is set to 0 at rest, so that passive torque does not count.

    Raises:
        UnmeasuredError: It has not half relaxed by the end of the run.
    """
    machine, angle = stiff_machine(joint), strongest_angle(joint, muscle)
    bench, along = build_rig(joint, machine=machine), direction(joint, muscle)
    single = record_run(
        bench,
        at_rest(bench, angle),
        TWITCH_TIME,
        excitation={
            "dynamometer": zeroed(joint, machine, angle),
            muscle: pulse(1.0, 0.0, width),
        },
    )
    reading = -along * single["dynamometer.force"]
    torque = reading - reading[0]
    half = half_life(single.time, torque)
    if half is None:
        raise UnmeasuredError(f"{muscle} has not half relaxed {TWITCH_TIME:g} s after the pulse")
    still_path = np.full(round(_TETANUS_TIME / bench.timestep), angle)
    _, lasting = active_torque(joint, machine, still_path, muscle)
    peak = int(torque.argmax())
    highest = float(torque[peak])
    share = highest / float(lasting.max())
    return MuscleTwitch(angle, float(single.time[peak]), half, highest, share, torque, single)
