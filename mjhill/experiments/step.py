"""A free joint under a step of excitation, as a second-order system (4.2.1, Table 2, eqs. 1-2).

The paper does not state the posture at the start of a step. Each step starts from the posture that
was identified with Table 2, or, in a joint without postures, from the angle of rest. The joint
starts at rest and relaxed, and its passive torque alone would take it back to the angle of rest.
Magnitudes are therefore compared from the angle of rest as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.responses import settling_time
from mjhill.analysis.second_order import SecondOrderStep, fit_step, step_response
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.joints.joint import Joint
from mjhill.lab.batch import joint_angles
from mjhill.lab.rig import as_joint, at_rest, build_rig, direction, record_run
from mjhill.lab.variants import (
    AS_IT_IS,
    FLAT,
    LINEAR,
    with_flat_torque,
    with_linear_elasticity,
)
from mjhill.literature.table2 import SHAPE_SPREAD, Row, rows_of
from mjhill.simulate.recording import Recording

_LONGEST = 10.0  # after which the slowest joint has settled [s]
_DELAYS, _SHORTEST = 5.0, 0.8  # a fit's window in mean delays of the slowest step, at least [s]
_MARGIN = 0.9  # of the ratio of excitations; a larger ratio of responses counts as proportional
_RESOLVED = 0.01  # least T2, as a share of T1; K and B divide by it

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class StepFit:
    """One step of excitation and its second-order fit.

    Attributes:
        muscle: The muscle.
        excitation: Its excitation [-].
        start: Joint angle at the start [rad].
        response: Movement of the joint in the muscle's direction [rad], shape (T,).
        fit: The second-order fit.
        stiffness: K = J/(T1 T2) [N·m/rad].
        damping: B = (T1 + T2) K [N·m·s/rad].
        gain: K MAG over excitation and maximum torque [-].
        row: The row of Table 2 for this step, if there is one.
    """

    muscle: str
    excitation: float
    start: float
    response: _Values
    fit: SecondOrderStep
    stiffness: float
    damping: float
    gain: float
    row: Row | None

    @property
    def name(self) -> str:
        """Muscle and excitation."""
        return f"{self.muscle} at {self.excitation:g}"

    @property
    def doubt(self) -> str:
        """Why the fit does not determine K, B and gain; empty where it does."""
        slow, fast = self.fit.time_constants
        if fast < _RESOLVED * slow:
            return "not determined: the fit is of first order, T2 is under 1 % of T1"
        if self.fit.misfit > SHAPE_SPREAD:
            return f"not determined: the fit leaves {self.fit.misfit:.0%} of the magnitude"
        return ""

    def measures(self) -> Iterator[Measure]:
        """MAG, T1 and T2, and K, B and gain from them, each beside Table 2."""
        fit, row = self.fit, self.row
        found = _as_printed(fit.magnitude, fit.time_constants)
        published = _as_printed(row.magnitude, row.time_constants) if row else [None] * len(found)
        names = (("MAG", "°"), ("T1", "ms"), ("T2", "ms"), ("T1 + T2", "ms"))
        source, note = ("paper", row.note) if row else ("", "")
        for (name, unit), value, wanted in zip(names, found, published, strict=True):
            span = None if wanted is None else (wanted, wanted)
            yield Measure(f"{self.name}: {name}", value, unit, span, source, note)
        values = (self.stiffness, self.damping, self.gain)
        units = (("K", "N·m/rad"), ("B", "N·m·s/rad"), ("gain", "-"))
        printed = (row.stiffness, row.damping, row.gain) if row else [None] * len(values)
        for (name, unit), value, wanted in zip(units, values, printed, strict=True):
            span = None if wanted is None else (wanted, wanted)
            determined = None if self.doubt else value
            yield Measure(f"{self.name}: {name}", determined, unit, span, source, self.doubt)
        yield Measure(f"{self.name}: left by the fit", 100 * fit.misfit, "% of MAG")


def fitted_step(
    joint: Joint,
    muscle: str,
    excitation: float,
    *,
    time: _Values,
    response: _Values,
    start: float,
    row: Row | None = None,
) -> StepFit:
    """The second-order fit of a response to a step; arguments as in ``StepFit``."""
    fit = fit_step(time, response)
    slow, fast = fit.time_constants
    stiffness = joint.inertia / (slow * fast)
    gain = stiffness * fit.magnitude / (excitation * joint.muscles[muscle].max_isometric_force)
    damping = fit.duration * stiffness
    return StepFit(muscle, excitation, start, response, fit, stiffness, damping, gain, row)


def _as_printed(magnitude: float, constants: tuple[float, float]) -> list[float]:
    """MAG [°], T1, T2 and their sum [ms]."""
    values = (degrees(magnitude), *(1e3 * t for t in constants), 1e3 * sum(constants))
    return [round(value, 6) for value in values]


@dataclass(frozen=True)
class Step(Result):
    """Steps of each muscle and their second-order fits.

    Attributes:
        joint: Name of the joint.
        time: Time [s], shape (T,).
        steps: The steps, by muscle, then by ascending excitation.
        proportion: Magnitude from the angle of rest at the highest excitation over that at the
            lowest [-], by muscle and condition: as it is, with a linear elasticity, and with a
            flat torque-angle relation. Both changes keep the magnitude at the lowest.
        recordings: The highest step of the first muscle.
    """

    title: ClassVar[str] = "Free step of excitation"
    section: ClassVar[str] = "4.2.1, Table 2"
    size: ClassVar[tuple[float, float]] = (9.0, 4.2)
    joint: str
    time: _Values
    steps: tuple[StepFit, ...]
    proportion: Mapping[str, Mapping[str, float]]
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    def pairs(self) -> Iterator[tuple[str, StepFit, StepFit]]:
        """Each muscle with its lowest and its highest step."""
        for muscle in self.proportion:
            own = [step for step in self.steps if step.muscle == muscle]
            yield muscle, own[0], own[-1]

    def measures(self) -> Iterator[Measure]:
        """Fits of each step beside Table 2, then ratios of magnitudes."""
        for step in self.steps:
            yield from step.measures()
        for muscle, ratios in self.proportion.items():
            for condition, ratio in ratios.items():
                name = f"{muscle}: ratio of magnitudes from rest, {condition}"
                yield Measure(name, ratio, "-")

    def claims(self) -> Iterator[Claim]:
        """What sect. 4.2.1 says about Table 2."""
        pairs = list(self.pairs())
        yield _claim(
            "The response is faster at a higher excitation: its time constants are shorter.",
            [high.fit.duration < low.fit.duration for _, low, high in pairs],
            [
                f"{muscle}: T1 + T2 {1e3 * low.fit.duration:.0f} ms at {low.excitation:g}, "
                f"{1e3 * high.fit.duration:.0f} ms at {high.excitation:g}"
                for muscle, low, high in pairs
            ],
        )
        yield self._not_proportional(pairs)
        yield _claim(
            "That is due primarily to the parallel elasticity (here: more than to the active "
            "torque-angle relation).",
            [
                ratios[LINEAR] > max(ratios[FLAT], ratios[AS_IT_IS])
                for ratios in self.proportion.values()
            ],
            [
                f"{muscle} from rest: {ratios[AS_IT_IS]:.2f} times as far, {LINEAR} "
                f"{ratios[LINEAR]:.2f}, {FLAT} {ratios[FLAT]:.2f}"
                for muscle, ratios in self.proportion.items()
            ],
        )
        sentence = "Stiffness K and viscosity B of the fit rise with the excitation."
        yield _rising(sentence, pairs, {"stiffness": " N·m/rad", "damping": " N·m·s/rad"}, 1)
        yield _rising("The gain of the fit falls as the excitation rises.", pairs, {"gain": ""}, -1)
        yield _claim(
            "A second-order system follows the response to a step fairly well (here: to within "
            f"{SHAPE_SPREAD:.0%} of its magnitude, r.m.s.).",
            [step.fit.misfit < SHAPE_SPREAD for step in self.steps],
            [f"{step.name}: {step.fit.misfit:.1%}" for step in self.steps],
        )

    def _not_proportional(self, pairs: list[tuple[str, StepFit, StepFit]]) -> Claim:
        factor = pairs[0][2].excitation / pairs[0][1].excitation
        ratios = {m: high.fit.magnitude / low.fit.magnitude for m, low, high in pairs}
        rest = {muscle: self.proportion[muscle][AS_IT_IS] for muscle in ratios}
        return _claim(
            "The magnitude of the response does not grow in proportion to the excitation.",
            [max(ratios[m], rest[m]) < _MARGIN * factor for m in ratios],
            [
                f"{m}: {factor:g} times the excitation goes {ratios[m]:.2f} times as far, "
                f"{rest[m]:.2f} times from the angle of rest"
                for m in ratios
            ],
        )

    def draw(self, figure: Any) -> None:
        """Each muscle's steps, their fits, and those of Table 2."""
        muscles = list(self.proportion)
        axes = figure.subplots(1, len(muscles), sharey=True, squeeze=False)[0]
        for axis, muscle, colour in zip(axes, muscles, MUSCLE_COLOURS, strict=False):
            for step in (step for step in self.steps if step.muscle == muscle):
                self._draw_step(axis, step, colour)
            axis.set_title(spoken(muscle), fontsize="medium")
            axis.set_xlabel("time [s]")
            axis.set_xlim(0, self.time[-1])
            axis.grid(alpha=0.3)
        axes[0].set_ylim(0, 1.06 * np.degrees(max(step.response.max() for step in self.steps)))
        axes[0].set_ylabel("angle from the start [°]")
        lines = {line.get_label(): line for line in axes[0].get_lines()}
        figure.legend(lines.values(), lines, loc="outside lower center", ncols=3)

    def _draw_step(self, axis: Any, step: StepFit, colour: Any) -> None:
        travel = np.degrees(step.response)
        axis.plot(self.time, travel, color=colour, lw=2.4, label="joint")
        fitted = step.fit.magnitude * step_response(self.time, *step.fit.time_constants)
        axis.plot(self.time, np.degrees(fitted), "k--", lw=1.1, label="second-order fit")
        if step.row:
            published = step.row.magnitude * step_response(self.time, *step.row.time_constants)
            axis.plot(self.time, np.degrees(published), "0.55", lw=1.8, ls=":", label="Table 2")
        end = (self.time[-1], travel[-1])
        offset: dict[str, Any] = {"xytext": (-4, -6), "textcoords": "offset points"}
        label = f"excitation {step.excitation:.0%}"
        axis.annotate(label, end, ha="right", va="top", **offset)

    def film(self) -> Recording | None:
        """The highest step of the first muscle."""
        return next(iter(self.recordings.values()), None)


def step(
    joint: str | Joint = "elbow",
    *,
    excitations: Sequence[float] = (0.1, 0.5),
    progress: Callable[[float], None] | None = None,
) -> Step:
    """Steps of excitation of each muscle of a free joint, its antagonist relaxed.

    Args:
        joint: The joint or its name.
        excitations: At least two, ascending [-]; the paper's are 0.1 and 0.5.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown, or the excitations do not ascend in (0, 1].
    """
    joint = as_joint(joint)
    if len(excitations) < 2 or list(excitations) != sorted({u for u in excitations if 0 < u <= 1}):
        raise ValueError(
            f"excitations must be at least two, ascending, in (0, 1], got {list(excitations)}"
        )
    report, setup = progress or (lambda _: None), build_rig(joint)
    tasks = [(muscle, float(u)) for muscle in joint.muscles for u in excitations]
    starts = [joint.postures.get(muscle, joint.rest_angle) for muscle, _ in tasks]
    responses = _responses([joint] * len(tasks), tasks, starts, setup.timestep)
    report(0.4)
    proportion = _proportions(joint, excitations[0], excitations[-1], setup.timestep)
    report(0.8)
    time = _window(responses, setup.timestep)
    rows = {(muscle, row.level): row for row in rows_of(joint) for muscle in row.muscles}
    steps = tuple(
        fitted_step(
            joint, *task, time=time, response=response[: len(time)], start=start, row=rows.get(task)
        )
        for task, start, response in zip(tasks, starts, responses, strict=True)
    )
    filmed = steps[len(excitations) - 1]
    begin, excitation = at_rest(setup, filmed.start), {filmed.muscle: filmed.excitation}
    recording = record_run(setup, begin, float(time[-1]), excitation=excitation)
    report(1.0)
    return Step(joint.name, time, steps, proportion, {filmed.name: recording})


def _responses(
    joints: Sequence[Joint],
    tasks: Sequence[tuple[str, float]],
    starts: Sequence[float],
    timestep: float,
) -> _Values:
    """Movement in the muscle's direction after a step [rad], shape (N, steps + 1).

    Args:
        joints: N joints that differ in numbers only.
        tasks: Muscle and excitation for each.
        starts: Angle at the start for each [rad].
        timestep: Timestep [s].
    """
    names = list(joints[0].muscles)
    excitation = np.zeros((len(tasks), 1, len(names)))
    for i, (muscle, u) in enumerate(tasks):
        excitation[i, 0, names.index(muscle)] = u
    steps = round(_LONGEST / timestep)
    found = joint_angles(
        joints, start=starts, excitation=excitation, steps=steps, timestep=timestep
    )
    signs = np.array([direction(joints[0], muscle) for muscle, _ in tasks])
    return np.asarray(signs[:, None] * (found - found[:, :1]))


def _proportions(
    joint: Joint, low: float, high: float, timestep: float
) -> dict[str, dict[str, float]]:
    """``Step.proportion`` for two excitations."""
    names, count = list(joint.muscles), len(joint.muscles)

    def magnitudes(joints: Sequence[Joint], excitation: float) -> _Values:
        tasks = [(name, excitation) for name in names] * (len(joints) // count)
        return _responses(joints, tasks, [joint.rest_angle] * len(tasks), timestep)[:, -1]

    lows = magnitudes([joint] * count, low)
    conditions: dict[str, list[Joint]] = {
        AS_IT_IS: [joint] * count,
        LINEAR: [with_linear_elasticity(joint, *pair) for pair in zip(names, lows, strict=True)],
        FLAT: [with_flat_torque(joint, *pair) for pair in zip(names, lows, strict=True)],
    }
    highs = magnitudes([one for several in conditions.values() for one in several], high)
    ratios = highs.reshape(len(conditions), count) / lows
    return {
        muscle: dict(zip(conditions, ratios[:, k].tolist(), strict=True))
        for k, muscle in enumerate(names)
    }


def _window(responses: _Values, timestep: float) -> _Values:
    """Times of the fits [s]: five mean delays of the slowest step, longer if it still rings."""
    time = np.asarray(np.arange(responses.shape[1]) * timestep)
    delays = [float(np.trapezoid(1 - one / one[-1], time)) for one in responses]
    settled = max(settling_time(time, one) for one in responses)
    duration = min(_LONGEST, max(_SHORTEST, _DELAYS * max(delays), settled))
    return time[: round(duration / timestep) + 1]


def _claim(sentence: str, holds: Sequence[bool], evidence: Sequence[str]) -> Claim:
    return Claim(sentence, Step.section, all(holds), "; ".join(evidence))


def _rising(
    sentence: str,
    pairs: list[tuple[str, StepFit, StepFit]],
    units: Mapping[str, str],
    sign: int,
) -> Claim:
    """Whether numbers of the fits rise (sign 1) or fall (-1) with the excitation.

    ``units`` has the unit of each number by its attribute of ``StepFit``.
    """
    holds: list[bool | None] = []
    evidence = []
    for muscle, low, high in pairs:
        doubt = low.doubt or high.doubt
        if doubt:
            holds.append(None)
            evidence.append(f"{muscle}: {doubt}")
            continue
        for name, unit in units.items():
            before, after = getattr(low, name), getattr(high, name)
            holds.append(sign * (after - before) > 0)
            evidence.append(f"{muscle}: {name} {before:.3g} to {after:.3g}{unit}")
    verdict = False if False in holds else None if None in holds else True
    return Claim(sentence, Step.section, verdict, "; ".join(evidence))
