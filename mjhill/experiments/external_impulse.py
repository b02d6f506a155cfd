"""An external torque impulse at several co-contractions (sect. 4.3.1, Fig. 9).

A body is fixed to the limb, as in Houk (1963). Two muscles hold the joint in balance, and a short
external torque acts on it. The paper does not give inertia, impulse or posture. Here:

- the body has the inertia of the limb;
- the small impulse deflects the joint by 5° at the lowest co-contraction, the large one is three
  times as large;
- the posture is the home angle if the joint stays there at every co-contraction, else the angle at
  which it is most stable;
- one burst of excitation replaces the reflexes of Fig. 9c.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from math import degrees, log, radians, sqrt
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.swing import Swing
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.drawing import shades, tidy
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.joints.joint import Joint
from mjhill.lab.impulse import Impulse, ImpulseResponse
from mjhill.lab.postures import (
    NotHeld,
    balancing_excitations,
    check_angle,
    check_ascending,
    check_between,
    held_cocontractions,
    stablest_angle,
)
from mjhill.lab.rig import UnmeasuredError, as_joint, at_rest, direction, record_run
from mjhill.lab.variants import with_linear_elements
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import pulse

_STRONG = 2.0  # least factor from lowest to highest co-contraction of a strong dependence
_SHRUNK = 0.5  # largest share of a logarithmic rise that counts as a much smaller one
_BURST_START, _BURST_WIDTH = 0.05, 0.04  # after the impulse, like a medium-latency reflex [s]
_COMPARED = 0.4  # time from the impulse over which excitation and torque are compared [s]
_LATEST = 0.2  # largest shift of torque against excitation [s]
_FOLLOWS = sqrt(0.5)  # correlation at which excitation explains half of the torque's variance
_MOVES = 0.1  # least change of torque that counts, in units of the largest change
_SHOWN = 0.6  # time axis of the figure [s]


@dataclass(frozen=True)
class Burst:
    """Excitation and torque of a muscle that an impulse stretches and that then gets a burst.

    Attributes:
        muscle: The muscle with the burst.
        start: Start of the burst, after the start of the impulse [s].
        width: Duration of the burst [s].
        height: What the burst adds to the excitation [-].
        correlation: Correlation of torque with excitation over 0.4 s [-].
        shifted_correlation: The largest correlation with a later torque [-].
        shift: How much later that torque is [s].
        before: Largest change of the muscle's torque before the burst, over the largest of all [-].
        other: Largest change of the other muscles' torque, at constant excitation, over the same.
        delay: Time from the middle of the burst to the peak of the torque that it adds [s].
        run: The recording.
        without: The recording of the same impulse without a burst.
    """

    muscle: str
    start: float
    width: float
    height: float
    correlation: float
    shifted_correlation: float
    shift: float
    before: float
    other: float
    delay: float
    run: Recording = field(repr=False)
    without: Recording = field(repr=False)

    def measures(self) -> Iterator[Measure]:
        """How torque and excitation are related."""
        note = f"{self.muscle}, {1e3 * self.width:.0f} ms of excitation"
        yield Measure("correlation of torque with excitation", self.correlation, "-", note=note)
        yield Measure("the same, torque later", self.shifted_correlation, "-", note=note)
        yield Measure("how much later", self.shift, "s", note=note)
        yield Measure("time from burst to peak of the torque it adds", self.delay, "s", note=note)
        yield Measure("change of torque before the burst, of the largest", self.before, "-")
        yield Measure("change of the other muscle's torque, of the largest", self.other, "-")

    def claim(self) -> Claim:
        """Whether torque follows excitation."""
        return Claim(
            "The muscles' torques do not follow transients of their neural inputs.",
            "4.3.1, Fig. 9c",
            self.correlation < _FOLLOWS and max(self.before, self.other) > _MOVES,
            f"{1e3 * self.width:.0f} ms of excitation and the torque of {self.muscle} have a "
            f"correlation of {self.correlation:.2f} ({_FOLLOWS:.2f} would be half of the variance; "
            f"the best is {self.shifted_correlation:.2f}, {1e3 * self.shift:.0f} ms later); the "
            f"added torque peaks {1e3 * self.delay:.0f} ms after the middle of the burst; before "
            f"the burst, at constant excitation, the torque has changed by {self.before:.0%} of "
            "the largest change; that of the other muscle, whose excitation is constant, changes "
            f"by {self.other:.0%}",
        )


@dataclass(frozen=True)
class ExternalImpulse(Result):
    """Responses to impulses.

    Attributes:
        joint: Name of the joint.
        angle: The posture [rad].
        sign: 1 if the impulse is towards positive angles, else -1.
        added_inertia: Inertia of the body [kg·m²].
        excitations: Excitation of each muscle [-], by co-contraction at which the joint stays.
        not_held: Co-contractions at which the joint does not stay, and why.
        small: Responses to the small impulse, by rising co-contraction.
        large: Responses to the large impulse.
        linear: Responses to the small impulse with linear series and contractile elements.
        burst: A large impulse and a burst of excitation, at the middle co-contraction.
        recordings: All runs.
    """

    title: ClassVar[str] = "Torque impulse at several co-contraction levels"
    section: ClassVar[str] = "4.3.1, Fig. 9"
    size: ClassVar[tuple[float, float]] = (9.0, 8.0)
    joint: str
    angle: float
    sign: float
    added_inertia: float
    excitations: Mapping[float, Mapping[str, float]]
    not_held: tuple[NotHeld, ...]
    small: tuple[ImpulseResponse, ...]
    large: tuple[ImpulseResponse, ...]
    linear: tuple[ImpulseResponse, ...]
    burst: Burst
    recordings: Mapping[str, Recording] = field(default_factory=dict, repr=False)

    def measures(self) -> Iterator[Measure]:
        """Deflection, its time and the second-order fit of every response."""
        yield Measure("posture", degrees(self.angle), "°")
        yield Measure("added inertia", self.added_inertia, "kg·m²")
        for name, responses in (("small", self.small), ("large", self.large)):
            yield Measure(f"impulse, {name}", responses[0].impulse, "N·m·s")
            for one in responses:
                yield from swing_measures(f"{name} at {one.cocontraction:g}", one.swing)
        for one in self.linear:
            label = f"linear elements at {one.cocontraction:g}"
            yield Measure(f"stiffness K, {label}", one.swing.stiffness, "N·m/rad")
            yield Measure(f"viscosity B, {label}", one.swing.damping, "N·m·s/rad")
        yield from self.burst.measures()
        for lost in self.not_held:
            yield Measure(f"response at {lost.label}", None, "°", note=lost.reason)

    def claims(self) -> Iterator[Claim]:
        """The five claims of the section."""
        yield self._claim(
            "The response to an impulse depends strongly on co-contraction: "
            "it falls as that rises (here: to half or less).",
            strongly_rises([1 / one.swing.peak for one in self.small]),
            "peaks " + _listed(self.small, _peak),
        )
        yield self._claim(
            "Stiffness and viscosity of the response rise with co-contraction.",
            _stiffens(self.small),
            _listed(self.small, _impedance),
        )
        yield self._claim(
            "A larger impulse gives a similar picture.",
            all(a.swing.peak > b.swing.peak for a, b in pairwise(self.large))
            and _stiffens(self.large),
            f"{self.large[0].impulse / self.small[0].impulse:.3g} times the impulse: peaks "
            f"{_listed(self.large, _peak)}; {_listed(self.large, _impedance)}",
        )
        yield self.burst.claim()
        steep, flat = _rises(self.small), _rises(self.linear)
        yield self._claim(
            "The cause is the nonlinearity of series and contractile element: linear ones show no "
            "such effect, as their stiffness does not depend on the operating range.",
            all(map(_shrinks, steep, flat)),
            f"from the lowest to the highest co-contraction K rises by a factor of {steep[0]:.3g} "
            f"and B by {steep[1]:.3g}; with linear elements by {flat[0]:.3g} and {flat[1]:.3g}",
        )

    def _claim(self, sentence: str, holds: bool, evidence: str) -> Claim:
        """A claim about several co-contractions, undecided if the joint stays at only one."""
        decided = len(self.small) > 1
        return Claim(sentence, self.section, holds if decided else None, evidence)

    def film(self) -> Recording:
        """The large impulse at the middle co-contraction."""
        return self.large[len(self.large) // 2].run

    def draw(self, figure: Any) -> None:
        """Deflections, the burst and the torques, K and B against co-contraction."""
        grid = figure.subplots(3, 2)
        for axes, responses, name in zip(grid[0], (self.small, self.large), "ab", strict=True):
            self._draw_deflections(axes, responses, name)
        self._draw_burst(grid[1, 0], grid[2, 0])
        self._draw_impedance(grid[1, 1], "stiffness", "K [N·m/rad]")
        self._draw_impedance(grid[2, 1], "damping", "B [N·m·s/rad]")
        grid[1, 1].set_title("second-order fits of the first swing", fontsize=10)
        grid[1, 1].legend(frameon=False, fontsize=8)
        grid[2, 1].set_xlabel("co-contraction [-]")
        figure.align_ylabels(grid)

    def _draw_deflections(
        self, axes: Any, responses: tuple[ImpulseResponse, ...], name: str
    ) -> None:
        for one, shade in zip(responses, shades(len(responses)), strict=True):
            moved = np.degrees(self.sign * (one.run[f"{self.joint}.angle"] - self.angle))
            axes.plot(1e3 * one.run.time, moved, color=shade, label=f"{one.cocontraction:g}")
        axes.set_xlim(0, 1e3 * min(_SHOWN, responses[0].run.time[-1]))
        axes.set_title(f"{name}  impulse of {responses[0].impulse:.2g} N·m·s", fontsize=10)
        axes.set_xlabel("time [ms]")
        axes.set_ylabel("deflection [°]")
        axes.legend(title="co-contraction", title_fontsize=8, frameon=False, fontsize=8)
        tidy(axes)

    def _draw_burst(self, upper: Any, lower: Any) -> None:
        """Excitation and torque of both muscles; dashed without the burst."""
        run, time = self.burst.run, 1e3 * self.burst.run.time
        muscles = [name.removesuffix(".u") for name in run if name.endswith(".u")]
        for muscle, colour in zip(muscles, MUSCLE_COLOURS, strict=False):
            upper.plot(time, run[f"{muscle}.u"], color=colour, label=spoken(muscle))
            lower.plot(time, self.burst.without[f"{muscle}.force"], color=colour, ls="--", lw=1)
            lower.plot(time, run[f"{muscle}.force"], color=colour)
        upper.set_title("c  a burst of excitation during the response", fontsize=10)
        upper.set_ylabel("excitation [-]")
        upper.set_ylim(0, None)
        upper.legend(frameon=False, fontsize=8)
        lower.set_ylabel("torque [N·m]")
        lower.set_xlabel("time [ms]; dashed: without the burst")
        for axes in (upper, lower):
            axes.set_xlim(0, 1e3 * min(_SHOWN, run.time[-1]))
            tidy(axes)

    def _draw_impedance(self, axes: Any, what: str, label: str) -> None:
        series = (
            (self.small, "small impulse", "-", "0.0"),
            (self.large, "large impulse", "-", "0.55"),
            (self.linear, "linear elements", "--", "0.0"),
        )
        for responses, name, style, shade in series:
            values = [getattr(one.swing, what) for one in responses]
            cocontractions = [one.cocontraction for one in responses]
            axes.plot(cocontractions, values, style, marker="o", ms=4, color=shade, label=name)
        axes.set_ylabel(label)
        axes.set_xlim(0, None)
        axes.set_ylim(0, None)
        tidy(axes)


def external_impulse(
    joint: str | Joint = "elbow",
    *,
    cocontraction: Sequence[float] = (0.02, 0.2, 0.5),
    angle: float | None = None,
    added_inertia: float | None = None,
    deflection: float = radians(5.0),
    larger: float = 3.0,
    width: float = 0.02,
    burst: float = 0.3,
    duration: float = 1.5,
    progress: Callable[[float], None] | None = None,
) -> ExternalImpulse:
    """Apply torque impulses to a joint at several co-contractions.

    Args:
        joint: A joint or its name.
        cocontraction: Co-contractions [-], ascending.
        angle: The posture [rad]; by default the home angle or, if the joint does not stay there
            at every co-contraction, the angle at which it is most stable.
        added_inertia: Inertia of a body fixed to the limb [kg·m²]; by default the limb's.
        deflection: Peak deflection by the small impulse at the lowest co-contraction [rad].
        larger: The large impulse over the small one [-].
        width: Duration of the impulse [s].
        burst: What a burst of 40 ms adds to the excitation of the stretched muscle [-].
        duration: Duration of a run [s].
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown or an option is out of range.
        UnmeasuredError: The joint stays at none of the co-contractions.
    """
    joint = as_joint(joint)
    body = joint.inertia if added_inertia is None else added_inertia
    wanted = check_ascending("cocontraction", cocontraction, 0.0, 1.0)
    check_angle(joint, angle)
    check_between("deflection", deflection, 0.0, 0.5 * (joint.range[1] - joint.range[0]), "rad")
    check_between("larger", larger, 1.0, 100.0, "")
    check_between("burst", burst, 0.0, 1.0, "")
    check_between("duration", duration, 0.3, 60.0, "s")
    check_between("width", width, 0.0, 0.25 * duration, "s")
    check_between("added_inertia", body + joint.inertia, 0.0, 1e4, "kg·m² with the limb's")
    if angle is None:
        angle = stablest_angle(joint, [partial(balancing_excitations, joint, u) for u in wanted])
    held, not_held = held_cocontractions(joint, wanted, angle)
    sign = 1.0 if angle < 0.5 * sum(joint.range) else -1.0  # to the side with more room
    impulse = Impulse(angle, sign, body, width, duration)
    size = impulse.size_for(joint, next(iter(held.values())), deflection)
    report = progress or (lambda _: None)
    responses = _responses(impulse, joint, held, (size, larger * size), report)
    middle = list(held.values())[len(held) // 2]
    answer = impulse_with_burst(impulse, joint, middle, size=larger * size, height=burst)
    report(1.0)
    runs = {f"{k} at {r.cocontraction:g}": r.run for k, some in responses.items() for r in some}
    recordings = MappingProxyType({**runs, "burst": answer.run})
    return ExternalImpulse(
        joint.name, angle, sign, body, held, not_held, **responses, burst=answer,
        recordings=recordings,
    )  # fmt: skip


def _responses(
    impulse: Impulse,
    joint: Joint,
    held: Mapping[float, Mapping[str, float]],
    sizes: tuple[float, float],
    report: Callable[[float], None],
) -> dict[str, tuple[ImpulseResponse, ...]]:
    """Responses to the small and the large impulse, and to the small one with linear elements.

    ``report`` is called with the share done; the burst that follows counts as one co-contraction.
    """
    linear = with_linear_elements(joint, list(held.values())[len(held) // 2], impulse.angle)
    small, large = sizes
    cases = {"small": (joint, small), "large": (joint, large), "linear": (linear, small)}
    sets: dict[str, list[ImpulseResponse]] = {name: [] for name in cases}
    for done, (u, excitations) in enumerate(held.items()):
        for name, (subject, size) in cases.items():
            sets[name].append(impulse.response(subject, u, excitations, size))
        report((done + 1) / (len(held) + 1))
    return {name: tuple(responses) for name, responses in sets.items()}


def impulse_with_burst(
    impulse: Impulse, joint: Joint, excitations: Mapping[str, float], *, size: float, height: float
) -> Burst:
    """An impulse, and 50 ms later a burst of 40 ms in the muscle that it stretches.

    Args:
        impulse: How the impulse acts.
        joint: The joint.
        excitations: Excitations that hold the joint [-].
        size: Size of the impulse [N·m·s].
        height: What the burst adds to the excitation, which is limited to 1 [-].

    Raises:
        UnmeasuredError: The excitation is 1 already.
    """
    rig, torque = impulse.rig(joint), impulse.torque(size)
    muscle = next(name for name in excitations if direction(joint, name) == -impulse.sign)
    height = min(height, 1.0 - excitations[muscle])
    if height <= 0:
        raise UnmeasuredError(f"the excitation of {muscle} is 1, so no burst can be added to it")
    burst = excitations[muscle] + pulse(height, _BURST_START, _BURST_WIDTH)
    run, without = (
        record_run(
            rig,
            at_rest(rig, impulse.angle, excitations),
            impulse.duration,
            excitation=changed,
            torque=torque,
        )
        for changed in ({muscle: burst}, {})
    )
    count = min(round(_COMPARED / rig.timestep), len(run))
    change = {name: run[f"{name}.force"] - run[f"{name}.force"][0] for name in excitations}
    torque_change, excitation = change[muscle][:count], run[f"{muscle}.u"][:count]
    largest = float(np.abs(change[muscle]).max())
    others = max(float(np.abs(change[name]).max()) for name in excitations if name != muscle)
    added = (run[f"{muscle}.force"] - without[f"{muscle}.force"])[:count]
    shifts = range(round(_LATEST / rig.timestep) + 1)
    shifted = [_correlation(excitation[: count - k], torque_change[k:]) for k in shifts]
    best = int(np.argmax(shifted))
    before = torque_change[: round(_BURST_START / rig.timestep)]
    return Burst(
        muscle=muscle,
        start=_BURST_START,
        width=_BURST_WIDTH,
        height=height,
        correlation=shifted[0],
        shifted_correlation=shifted[best],
        shift=best * rig.timestep,
        before=float(np.abs(before).max()) / largest,
        other=others / largest,
        delay=float(np.abs(added).argmax()) * rig.timestep - _BURST_START - 0.5 * _BURST_WIDTH,
        run=run,
        without=without,
    )


def swing_measures(label: str, swing: Swing) -> Iterator[Measure]:
    """Measures of a swing; ``label`` says which swing."""
    unturned = "" if swing.time_to_peak else "it does not turn within the run"
    yield Measure(f"peak deflection, {label}", degrees(swing.peak), "°", note=unturned)
    yield Measure(f"time to peak, {label}", swing.time_to_peak, "s", note=unturned)
    yield Measure(f"stiffness K, {label}", swing.stiffness, "N·m/rad")
    yield Measure(f"viscosity B, {label}", swing.damping, "N·m·s/rad")
    fitted = swing.fitted_inertia if swing.fitted_inertia > 0 else None
    none = "" if fitted else "a fit with J unknown finds none above 0"
    yield Measure(f"fitted inertia J, {label}", fitted, "kg·m²", note=none)
    yields = "" if swing.stiffness > 0 else "the fitted stiffness is not positive"
    yield Measure(f"natural frequency, {label}", swing.natural_frequency, "Hz", note=yields)
    yield Measure(f"damping ratio, {label}", swing.damping_ratio, "-", note=yields)
    yield Measure(f"misfit of the fit, {label}", swing.misfit, "-")
    yield Measure(f"misfit of the whole run, {label}", swing.misfit_of_run, "-")


def strongly_rises(values: Sequence[float]) -> bool:
    """Whether each number is above the one before, and the last at least twice the first."""
    return all(a < b for a, b in pairwise(values)) and values[-1] >= _STRONG * values[0]


def _listed(responses: Sequence[ImpulseResponse], text: Callable[[Swing], str]) -> str:
    return ", ".join(f"{text(one.swing)} at {one.cocontraction:g}" for one in responses)


def _peak(swing: Swing) -> str:
    return f"{degrees(swing.peak):.2f}°"


def _impedance(swing: Swing) -> str:
    return f"K {swing.stiffness:.3g} N·m/rad and B {swing.damping:.3g} N·m·s/rad"


def _stiffens(responses: Sequence[ImpulseResponse]) -> bool:
    """Whether K and B rise with each co-contraction."""
    pairs = [(a.swing, b.swing) for a, b in pairwise(responses)]
    return all(a.stiffness < b.stiffness and a.damping < b.damping for a, b in pairs)


def _rises(responses: Sequence[ImpulseResponse]) -> tuple[float, float]:
    """K and B at the highest co-contraction over those at the lowest."""
    low, high = responses[0].swing, responses[-1].swing
    return high.stiffness / low.stiffness, high.damping / low.damping


def _shrinks(steep: float, flat: float) -> bool:
    """Whether a rise that was there has become much smaller."""
    return steep > 1 and flat > 0 and abs(log(flat)) <= _SHRUNK * log(steep)


def _correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    return float(np.corrcoef(first, second)[0, 1])
