"""The isometric twitch: a muscle's answer to one short full input, the joint clamped."""

from __future__ import annotations

from dataclasses import dataclass

from mjhill.comparison.responses import half_life
from mjhill.experiments.rig import UnmeasuredError, rig, run, still, strongest_angle
from mjhill.parameters import Joint
from mjhill.recording import Recording
from mjhill.signals import pulse

_PULSE = 2e-3  # [s]; Winters & Stark 1987, sect. 4.1.1
_TWITCH_TIME, _TETANUS_TIME = 1.0, 1.5  # [s]


@dataclass(frozen=True)
class Twitch:
    """A twitch, at the angle of the largest force.

    Attributes:
        contraction: From the start of the pulse to the peak of torque [s].
        half_relaxation: From the peak to half of it [s].
        share: Peak, as a share of the largest torque under lasting full input [-].
        run: The recording.
    """

    contraction: float
    half_relaxation: float
    share: float
    run: Recording


def twitch(joint: Joint, muscle: str) -> Twitch:
    """The twitch of a muscle to 2 ms of full input.

    Raises:
        UnmeasuredError: It has not half relaxed by the end of the run.
    """
    bench, angle, force = (
        rig(joint, clamped=True),
        strongest_angle(joint, muscle),
        f"{muscle}.force",
    )
    start, tetanic = still(bench, angle), still(bench, angle)
    single = run(bench, start, _TWITCH_TIME, excitation={muscle: pulse(1.0, 0.0, _PULSE)})
    lasting = run(bench, tetanic, _TETANUS_TIME, excitation={muscle: 1.0})[force]
    rise = single[force] - single[force][0]  # a relaxed muscle keeps a trace of tension
    half = half_life(single.time, rise)
    if half is None:
        raise UnmeasuredError(f"{muscle} has not half relaxed {_TWITCH_TIME:g} s after the pulse")
    peak = int(rise.argmax())
    share = float(rise[peak] / (lasting - lasting[0]).max())
    return Twitch(float(single.time[peak]), half, share, single)
