"""Tetanus: lasting full input to an isometric muscle (sect. 4.1.2, Fig. 5b, Table 1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import degrees, exp, radians
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.second_order import SecondOrderStep, fit_step, step_response
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.figures.drawing import legend_above, tidy
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.joints.joint import Joint
from mjhill.lab.dynamometry import active_torque, stiff_machine, stimulated
from mjhill.lab.rig import as_joint, build_rig

_DURATION = 2.0  # [s]; ten times the slowest rise
_ANGLES = 15  # at which the largest torque is sought, ends of the range of motion included
_SETTLED = 0.01  # distance from the steady level, as a share of it, that ends the rise [-]
_LIKE = (
    0.05  # root mean square misfit up to which a response is like that of a second-order system [-]
)
_OVERSHOOT = 0.01  # past which a response is not overdamped [-]
_TOLD_APART = 2e-3  # [s]; two samples
_OFF = radians(5.0)  # distance from the optimum that counts as off it
_BELOW = 0.01  # of the largest torque: what counts as below it


@dataclass(frozen=True)
class Contraction:
    """A maximal isometric contraction at mid-range.

    Attributes:
        torque: Active torque, of the largest over all angles, at ``Tetanus.time`` [-], shape (T,).
        fit: The overdamped second-order step response nearest to its rise.
        deviation: Largest distance between the two, of the steady level [-].
        rise: Time to 63 % of the steady level [s].
    """

    torque: NDArray[np.float64]
    fit: SecondOrderStep
    deviation: float
    rise: float

    @property
    def level(self) -> float:
        """Steady torque, of the largest over all angles [-]."""
        return float(self.torque[-1])

    @property
    def overshoot(self) -> float:
        """How far it goes past its steady level, as a share of it [-]."""
        return max(0.0, float(self.torque.max()) / self.level - 1.0)


@dataclass(frozen=True)
class Tetanus(Result):
    """Maximal isometric contractions of each muscle of a joint at mid-range.

    Attributes:
        joint: Name of the joint.
        angle: Mid-range [rad].
        time: From the start of the input [s], shape (T,).
        voluntary: By muscle, under neural input.
        electrical: By muscle, under electrical stimulation, which bypasses neural excitation.
        largest: Largest active torque over the range of motion, by muscle [N·m].
        best: Angle of that, by muscle [rad].
        stiffness: Of the dynamometer [N·m/rad].
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
        """What Table 1 lists, whose numbers the scan of the paper lacks."""
        for muscle in self.voluntary:
            kinds = (("", self.voluntary[muscle]), (", electrical", self.electrical[muscle]))
            for kind, found in kinds:
                slow, fast = found.fit.time_constants
                yield Measure(f"{muscle}{kind}, T1", 1e3 * slow, "ms")
                yield Measure(f"{muscle}{kind}, T2", 1e3 * fast, "ms", note=_damping(slow, fast))
                yield Measure(f"{muscle}{kind}, rise to 63 %", 1e3 * found.rise, "ms")
                yield Measure(f"{muscle}{kind}, misfit of T1 and T2", 1e2 * found.fit.misfit, "%")
            level = self.voluntary[muscle].level
            yield Measure(f"{muscle}, steady level", level, "-", note="of the largest torque")
            note = f"at {round(degrees(self.best[muscle]))}°"
            yield Measure(f"{muscle}, largest torque", self.largest[muscle], "N·m", note=note)
        yield Measure("mid-range", degrees(self.angle), "°")
        yield Measure("stiffness of the dynamometer", self.stiffness, "N·m/rad")

    def claims(self) -> Iterator[Claim]:
        """Second-order-like, faster when stimulated, below 1 off the optimum."""
        pairs = {m: (self.voluntary[m], self.electrical[m]) for m in self.voluntary}
        yield Claim(
            "The rise of torque is like the step response of an overdamped second-order system.",
            "4.1.2, Fig. 5b, Table 1",
            all(
                one.fit.misfit <= _LIKE and one.overshoot <= _OVERSHOOT
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
            all(one.rise - other.rise > _TOLD_APART for one, other in pairs.values()),
            "; ".join(
                f"{muscle}: 63 % after {1e3 * other.rise:.0f} instead of {1e3 * one.rise:.0f} ms"
                for muscle, (one, other) in pairs.items()
            ),
        )
        yield self._below_one()

    def _below_one(self) -> Claim:
        """Whether the level is clearly below 1 where mid-range is not the optimum."""
        off = {m: abs(self.angle - best) > _OFF for m, best in self.best.items()}
        low = {m: self.voluntary[m].level < 1.0 - _BELOW for m in self.voluntary}
        evidence = "; ".join(
            f"{muscle}: {found.level:.3f} at {round(degrees(self.angle))}°, largest at "
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

    On a dynamometer; torque is the gauge's reading above that of the relaxed joint, as a share of
    the largest of 15 angles over the range of motion and mid-range.

    Args:
        joint: The joint, or the name of one.
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
    voluntary, electrical, largest, best = {}, {}, {}, {}
    for count, muscle in enumerate(subject.muscles, 1):
        runs, torque = active_torque(subject, machine, path, muscle)
        strongest = int(torque[:, -1].argmax())
        largest[muscle], best[muscle] = float(torque[strongest, -1]), float(grid[strongest])
        _, faster = active_torque(stimulated(subject), machine, path[middle], muscle)
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
    # the fit is to the rise: a long steady part would hide how it misses
    settled = int(np.flatnonzero(np.abs(torque - end) > _SETTLED * end)[-1])
    window = slice(0, min(round(1.5 * settled), len(time)))
    fit = fit_step(time[window], torque[window])
    fitted = fit.magnitude * step_response(time, *fit.time_constants)
    deviation = float(np.abs(fitted - torque).max()) / end
    return Contraction(torque, fit, deviation, float(time[risen.argmax()]))


def _damping(slow: float, fast: float) -> str:
    return "equal to T1: critically damped, as near as it can be" if slow < 1.01 * fast else ""
