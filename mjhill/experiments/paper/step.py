"""A free joint under a step of neural input, as a second-order system (the paper's Table 2).

Each step starts from the posture that was identified with Table 2, because the paper does not
state it, or from the angle of rest in a joint without postures. The joint starts still and relaxed,
so from a posture that is not the angle of rest it returns to that by its passive torque anyway;
magnitudes are therefore compared from the angle of rest as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.responses import settling_time
from mjhill.analysis.second_order import step_response
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.experiments.result import Claim, Measure, Result, spoken
from mjhill.experiments.trials.proportion import LONG, proportions, step_responses
from mjhill.experiments.trials.step_fit import StepFit, fitted_step
from mjhill.joints.joint import Joint
from mjhill.lab.rig import as_joint, at_rest, build_rig, record_run
from mjhill.lab.variants import AS_IT_IS, FLAT, LINEAR
from mjhill.literature.table2 import SHAPE_SPREAD, rows_of
from mjhill.simulate.recording import Recording

_DELAYS, _SHORTEST = 5.0, 0.8  # a fit's window in mean delays of the slowest step, least [s]
_MARGIN = 0.9  # of the ratio of inputs; a response above that share is as good as proportional


@dataclass(frozen=True)
class Step(Result):
    """Steps of each muscle and their second-order fits.

    Attributes:
        joint: Name of the joint.
        time: [s], shape (T,).
        steps: The steps, by muscle and then level.
        proportion: For each muscle, how many times as far the highest level takes the joint from
            the angle of rest as the lowest [-]: as it is, with a linear elasticity, and with a
            flat torque-angle relation, both such that the lowest goes as far as it does.
        recordings: The highest step of the first muscle.
    """

    title: ClassVar[str] = "Free step of input"
    section: ClassVar[str] = "4.2.1, Table 2"
    size: ClassVar[tuple[float, float]] = (9.0, 4.2)
    joint: str
    time: NDArray[np.float64]
    steps: tuple[StepFit, ...]
    proportion: Mapping[str, Mapping[str, float]]
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    def pairs(self) -> Iterator[tuple[str, StepFit, StepFit]]:
        """Each muscle with its lowest and its highest step."""
        for muscle in self.proportion:
            own = [step for step in self.steps if step.muscle == muscle]
            yield muscle, own[0], own[-1]

    def measures(self) -> Iterator[Measure]:
        """Fits of each step beside Table 2, then how far from proportional."""
        for step in self.steps:
            yield from step.measures()
        for muscle, ratios in self.proportion.items():
            for condition, ratio in ratios.items():
                name = f"{muscle}: ratio of magnitudes from rest, {condition}"
                yield Measure(name, ratio, "-")

    def claims(self) -> Iterator[Claim]:
        """What sect. 4.2.1 says of Table 2."""
        pairs = list(self.pairs())
        yield _claim(
            "The response is faster at a higher input: its time constants are shorter.",
            [high.fit.duration < low.fit.duration for _, low, high in pairs],
            [
                f"{muscle}: T1 + T2 {1e3 * low.fit.duration:.0f} ms at {low.level:g}, "
                f"{1e3 * high.fit.duration:.0f} ms at {high.level:g}"
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
        sentence = "Stiffness K and viscosity B of the fit rise with the input."
        yield _rising(sentence, pairs, {"stiffness": " N·m/rad", "damping": " N·m·s/rad"}, 1)
        yield _rising("The gain of the fit falls as the input rises.", pairs, {"gain": ""}, -1)
        yield _claim(
            "A second-order system follows the response to a step fairly well (here: to within "
            f"{SHAPE_SPREAD:.0%} of its magnitude, r.m.s.).",
            [step.fit.misfit < SHAPE_SPREAD for step in self.steps],
            [f"{step.name}: {step.fit.misfit:.1%}" for step in self.steps],
        )

    def _not_proportional(self, pairs: list[tuple[str, StepFit, StepFit]]) -> Claim:
        inputs = pairs[0][2].level / pairs[0][1].level
        ratios = {m: high.fit.magnitude / low.fit.magnitude for m, low, high in pairs}
        rest = {muscle: self.proportion[muscle][AS_IT_IS] for muscle in ratios}
        return _claim(
            "The magnitude of the response does not grow in proportion to the input.",
            [max(ratios[m], rest[m]) < _MARGIN * inputs for m in ratios],
            [
                f"{m}: {inputs:g} times the input goes {ratios[m]:.2f} times as far, "
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
        axis.annotate(f"input {step.level:.0%}", end, ha="right", va="top", **offset)

    def film(self) -> Recording | None:
        """The highest step of the first muscle."""
        return next(iter(self.recordings.values()), None)


def step(
    joint: str | Joint = "elbow",
    *,
    levels: Sequence[float] = (0.1, 0.5),
    progress: Callable[[float], None] | None = None,
) -> Step:
    """Steps of input to each muscle of a free joint, its antagonist off.

    Args:
        joint: The joint or its name.
        levels: Inputs [-], ascending, at least two; the paper's are 0.1 and 0.5.
        progress: Called with the share done, 0 to 1.

    Raises:
        ValueError: The joint is unknown, or the levels are not ascending in (0, 1].
    """
    joint = as_joint(joint)
    if len(levels) < 2 or list(levels) != sorted({u for u in levels if 0 < u <= 1}):
        raise ValueError(f"levels must be at least two, ascending, in (0, 1], got {list(levels)}")
    told, bench = progress or (lambda _: None), build_rig(joint)
    tasks = [(muscle, float(level)) for muscle in joint.muscles for level in levels]
    starts = [joint.postures.get(muscle, joint.rest_angle) for muscle, _ in tasks]
    responses = step_responses([joint] * len(tasks), tasks, starts, bench.timestep)
    told(0.4)
    proportion = proportions(joint, levels[0], levels[-1], bench.timestep)
    told(0.8)
    time = _window(responses, bench.timestep)
    rows = {(muscle, row.level): row for row in rows_of(joint) for muscle in row.muscles}
    steps = tuple(
        fitted_step(
            joint, *task, time=time, response=response[: len(time)], start=start, row=rows.get(task)
        )
        for task, start, response in zip(tasks, starts, responses, strict=True)
    )
    filmed = steps[len(levels) - 1]
    begin, excitation = at_rest(bench, filmed.start), {filmed.muscle: filmed.level}
    recording = record_run(bench, begin, float(time[-1]), excitation=excitation)
    told(1.0)
    return Step(joint.name, time, steps, proportion, {filmed.name: recording})


def _window(responses: NDArray[np.float64], timestep: float) -> NDArray[np.float64]:
    """Times of the fits [s]: five mean delays of the slowest step, longer if it still rings."""
    time = np.asarray(np.arange(responses.shape[1]) * timestep)
    delays = [float(np.trapezoid(1 - one / one[-1], time)) for one in responses]
    settled = max(settling_time(time, one) for one in responses)
    duration = min(LONG, max(_SHORTEST, _DELAYS * max(delays), settled))
    return time[: round(duration / timestep) + 1]


def _claim(sentence: str, holds: Sequence[bool], evidence: Sequence[str]) -> Claim:
    return Claim(sentence, Step.section, all(holds), "; ".join(evidence))


def _rising(
    sentence: str,
    pairs: list[tuple[str, StepFit, StepFit]],
    units: Mapping[str, str],
    sign: int,
) -> Claim:
    """Whether numbers of the fits go up (sign 1) or down (-1) with the input, by their units."""
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
