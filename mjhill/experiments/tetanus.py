"""Tetanus: lasting full excitation of an isometric muscle (sect. 4.1.2, Fig. 5b, Table 1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import degrees, exp, radians
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.second_order import SecondOrderStep, fit_step, step_response
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import legend_above, tidy
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometer import active_torque, electrically_stimulated, stiff_machine
from mjhill.lab.rig import as_joint, build_rig

_DURATION = 2.0  # [s]; ten times the slowest rise
_ANGLES = 15  # over the range of motion, its ends included, to find the largest torque
_SETTLED = 0.01  # the rise ends at this distance from the steady torque, as a share of it [-]
_MISFIT = 0.05  # RMS misfit up to which a response is like that of a second-order system [-]
_OVERSHOOT = 0.01  # overshoot up to which a response is overdamped [-]
_DISTINCT = 2e-3  # two times differ if they are farther apart [s]; two samples
_OFF = radians(5.0)  # an angle farther from the best is not the best
_BELOW = 0.01  # of the largest torque: a torque that is lower by more is below it


@dataclass(frozen=True)
class Contraction:
    """A maximal isometric contraction at mid-range.

    Attributes:
        torque: Active torque over the largest at any angle, at ``Tetanus.time`` [-], shape (T,).
        fit: The overdamped second-order step response that is closest to its rise.
        deviation: Largest distance between the two, as a share of the steady torque [-].
        rise: Time to 63 % of the steady torque [s].
    """

    torque: NDArray[np.float64]
    fit: SecondOrderStep
    deviation: float
    rise: float

    @property
    def steady(self) -> float:
        """Steady torque over the largest at any angle [-]."""
        return float(self.torque[-1])

    @property
    def overshoot(self) -> float:
        """How far torque exceeds its steady value, as a share of it [-]."""
        return max(0.0, float(self.torque.max()) / self.steady - 1.0)


@dataclass(frozen=True)
class Tetanus(Result):
    """Maximal isometric contractions of each muscle of a joint at mid-range.

    Attributes:
        joint: Name of the joint.
        angle: Mid-range [rad].
        time: Time from the start of the excitation [s], shape (T,).
        voluntary: Contraction under neural excitation, by muscle.
        electrical: Contraction under electrical stimulation, which bypasses neural excitation.
        largest: Largest active torque over the range of motion, by muscle [N·m].
        best: Angle of that torque, by muscle [rad].
        stiffness: Stiffness of the dynamometer [N·m/rad].
    """

    title: ClassVar[str] = "Isometric tetanus"
    section: ClassVar[str] = "4.1.2, Fig. 5b, Table 1"
    joint: str
    angle: float
    time: NDArray[np.float64]
    voluntary: Mapping[str, Contraction]
    electrical: Mapping[str, Contraction]
    largest: Mapping[str, float]
    best: Mapping[str, float]
    stiffness: float

    def measures(self) -> Iterator[Measure]:
        """The quantities of Table 1; its numbers are not in the scan of the paper."""
        for muscle in self.voluntary:
            kinds = (("", self.voluntary[muscle]), (", electrical", self.electrical[muscle]))
            for kind, found in kinds:
                slow, fast = found.fit.time_constants
                yield Measure(f"{muscle}{kind}, T1", 1e3 * slow, "ms")
                yield Measure(f"{muscle}{kind}, T2", 1e3 * fast, "ms", note=_damping(slow, fast))
                yield Measure(f"{muscle}{kind}, rise to 63 %", 1e3 * found.rise, "ms")
                yield Measure(f"{muscle}{kind}, misfit of T1 and T2", 1e2 * found.fit.misfit, "%")
            steady = self.voluntary[muscle].steady
            yield Measure(f"{muscle}, steady torque", steady, "-", note="of the largest torque")
            note = f"at {round(degrees(self.best[muscle]))}°"
            yield Measure(f"{muscle}, largest torque", self.largest[muscle], "N·m", note=note)
        yield Measure("mid-range", degrees(self.angle), "°")
        yield Measure("stiffness of the dynamometer", self.stiffness, "N·m/rad")

    def claims(self) -> Iterator[Claim]:
        """Like a second-order system, faster when stimulated, below the largest at mid-range."""
        pairs = {m: (self.voluntary[m], self.electrical[m]) for m in self.voluntary}
        yield Claim(
            "The rise of torque is like the step response of an overdamped second-order system.",
            "4.1.2, Fig. 5b, Table 1",
            all(
                one.fit.misfit <= _MISFIT and one.overshoot <= _OVERSHOOT
                for one in self.voluntary.values()
            ),
            "; ".join(
                f"{muscle}: T1 {1e3 * one.fit.time_constants[0]:.0f} and T2 "
                f"{1e3 * one.fit.time_constants[1]:.0f} ms leave {one.fit.misfit:.1%} (RMS; "
                f"at most {one.deviation:.1%}), overshoot {one.overshoot:.1%}"
                for muscle, one in self.voluntary.items()
            ),
        )
        yield Claim(
            "Under electrical stimulation, which bypasses neural excitation, it responds faster.",
            "4.1.2",
            all(one.rise - other.rise > _DISTINCT for one, other in pairs.values()),
            "; ".join(
                f"{muscle}: 63 % after {1e3 * other.rise:.0f} instead of {1e3 * one.rise:.0f} ms"
                for muscle, (one, other) in pairs.items()
            ),
        )
        yield self._below_largest()

    def _below_largest(self) -> Claim:
        """Whether torque at mid-range is clearly below the largest, where that is elsewhere."""
        off = {m: abs(self.angle - best) > _OFF for m, best in self.best.items()}
        low = {m: self.voluntary[m].steady < 1.0 - _BELOW for m in self.voluntary}
        evidence = "; ".join(
            f"{muscle}: {found.steady:.3f} at {round(degrees(self.angle))}°, largest at "
            f"{round(degrees(self.best[muscle]))}°"
            for muscle, found in self.voluntary.items()
        )
        return Claim(
            "Torque at mid-range stays below the largest where mid-range is not the best angle "
            f"(here: by over {_BELOW:.0%}, {degrees(_OFF):.0f}° or more from the best).",
            "4.1.2, Fig. 5b",
            all(low[m] for m in off if off[m]) if any(off.values()) else None,
            evidence,
        )

    def draw(self, figure: Any) -> None:
        """Torque over time, the second muscle's downward, and the fits."""
        from matplotlib.lines import Line2D

        axes = figure.subplots()
        handles = []
        time = 1e3 * self.time
        for index, muscle in enumerate(self.voluntary):
            up, colour = 1 if index == 0 else -1, MUSCLE_COLOURS[index]
            handles.append(Line2D([], [], color=colour, label=spoken(muscle)))
            one, other = self.voluntary[muscle], self.electrical[muscle]
            axes.plot(time, up * one.torque, color=colour, lw=2)
            axes.plot(time, up * other.torque, color=colour, ls="--", lw=1.2)
            fitted = one.fit.magnitude * step_response(self.time, *one.fit.time_constants)
            axes.plot(time, up * fitted, color="black", ls=":", lw=1.5)
        handles += [
            Line2D([], [], color="0.4", ls="--", label="electrical stimulation"),
            Line2D([], [], color="black", ls=":", label="second-order fit"),
        ]
        slowest = max(one.fit.duration for one in self.voluntary.values())
        axes.set_xlim(0, 1e3 * min(4 * slowest, _DURATION))
        axes.axhline(0, color="0.6", lw=0.8)
        axes.set_ylim(-1.1, 1.1)
        axes.set_xlabel("time [ms]")
        axes.set_ylabel("torque, of the largest over all angles [-]")
        tidy(axes)
        legend_above(figure, handles)


def tetanus(
    joint: str | Joint = "elbow", *, progress: Callable[[float], None] | None = None
) -> Tetanus:
    """Maximal isometric contractions of each muscle of a joint, one at a time, at mid-range.

    On a dynamometer. Torque is the gauge's reading above that of the relaxed joint, as a share of
    the largest at 15 angles over the range of motion.

    Args:
        joint: The joint or its name.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown.
    """
    subject = as_joint(joint)
    machine = stiff_machine(subject)
    grid = np.linspace(*subject.range, _ANGLES)  # an odd number: mid-range is one of them
    middle = _ANGLES // 2
    steps = round(_DURATION / build_rig(subject).timestep)
    path = np.repeat(grid[:, np.newaxis], steps, axis=1)
    stimulated = electrically_stimulated(subject)
    voluntary, electrical, largest, best = {}, {}, {}, {}
    for count, muscle in enumerate(subject.muscles, 1):
        runs, torque = active_torque(subject, machine, path, muscle)
        strongest = int(torque[:, -1].argmax())
        largest[muscle], best[muscle] = float(torque[strongest, -1]), float(grid[strongest])
        _, faster = active_torque(stimulated, machine, path[middle], muscle)
        voluntary[muscle] = _contraction(runs.time, torque[middle] / largest[muscle])
        electrical[muscle] = _contraction(runs.time, faster[0] / largest[muscle])
        if progress:
            progress(count / len(subject.muscles))
    return Tetanus(
        subject.name, float(grid[middle]), runs.time, voluntary, electrical, largest, best,
        machine.stiffness,
    )  # fmt: skip


def _contraction(time: NDArray[np.float64], torque: NDArray[np.float64]) -> Contraction:
    end = float(torque[-1])
    risen = torque >= (1.0 - exp(-1.0)) * end
    # the fit is to the rise only: over a long steady part its misfit would look small
    settled = int(np.flatnonzero(np.abs(torque - end) > _SETTLED * end)[-1])
    window = slice(0, min(round(1.5 * settled), len(time)))
    fit = fit_step(time[window], torque[window])
    fitted = fit.magnitude * step_response(time, *fit.time_constants)
    deviation = float(np.abs(fitted - torque).max()) / end
    return Contraction(torque, fit, deviation, float(time[risen.argmax()]))


def _damping(slow: float, fast: float) -> str:
    return (
        "equal to T1: as close to critical damping as the fit allows" if slow < 1.01 * fast else ""
    )
