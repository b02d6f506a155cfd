"""One step of input to a free joint and its second-order fit (the paper's eqs. 1-2)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.second_order import SecondOrderStep, fit_step
from mjhill.experiments.result import Measure
from mjhill.joints.joint import Joint
from mjhill.literature.table2 import SHAPE_SPREAD, Row

_RESOLVED = 0.01  # least T2, as a share of T1; K and B divide by it

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class StepFit:
    """One step and its second-order fit.

    Attributes:
        muscle: The muscle.
        level: Its input [-].
        start: Angle at the start [rad].
        response: How far the joint has gone the muscle's way [rad], shape (T,).
        fit: The second-order fit.
        stiffness: K = J/(T1 T2) [N·m/rad].
        damping: B = (T1 + T2) K [N·m·s/rad].
        gain: K MAG over input and maximum torque [-].
        row: What Table 2 has of it, if anything.
    """

    muscle: str
    level: float
    start: float
    response: _Values
    fit: SecondOrderStep
    stiffness: float
    damping: float
    gain: float
    row: Row | None

    @property
    def name(self) -> str:
        """Muscle and input."""
        return f"{self.muscle} at {self.level:g}"

    @property
    def doubt(self) -> str:
        """Why K, B and gain say nothing; empty where they do."""
        slow, fast = self.fit.time_constants
        if fast < _RESOLVED * slow:
            return "not determined: the fit is of first order, T2 is under 1 % of T1"
        if self.fit.misfit > SHAPE_SPREAD:
            return f"not determined: the fit leaves {self.fit.misfit:.0%} of the magnitude"
        return ""

    def measures(self) -> Iterator[Measure]:
        """MAG, T1 and T2 beside Table 2; K, B and gain, which follow from them."""
        fit, row = self.fit, self.row
        ours = _as_printed(fit.magnitude, fit.time_constants)
        published = _as_printed(row.magnitude, row.time_constants) if row else [None] * len(ours)
        names = (("MAG", "°"), ("T1", "ms"), ("T2", "ms"), ("T1 + T2", "ms"))
        source, note = ("paper", row.note) if row else ("", "")
        for (name, unit), value, wanted in zip(names, ours, published, strict=True):
            span = None if wanted is None else (wanted, wanted)
            yield Measure(f"{self.name}: {name}", value, unit, span, source, note)
        values = (self.stiffness, self.damping, self.gain)
        units = (("K", "N·m/rad"), ("B", "N·m·s/rad"), ("gain", "-"))
        printed = (row.stiffness, row.damping, row.gain) if row else [None] * len(values)
        for (name, unit), value, wanted in zip(units, values, printed, strict=True):
            span = None if wanted is None else (wanted, wanted)
            seen = None if self.doubt else value
            yield Measure(f"{self.name}: {name}", seen, unit, span, source, self.doubt)
        yield Measure(f"{self.name}: left by the fit", 100 * fit.misfit, "% of MAG")


def fitted_step(
    joint: Joint,
    muscle: str,
    level: float,
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
    gain = stiffness * fit.magnitude / (level * joint.muscles[muscle].max_isometric_force)
    damping = fit.duration * stiffness
    return StepFit(muscle, level, start, response, fit, stiffness, damping, gain, row)


def _as_printed(magnitude: float, constants: tuple[float, float]) -> list[float]:
    """MAG [°], T1, T2 and their sum [ms]."""
    values = (degrees(magnitude), *(1e3 * t for t in constants), 1e3 * sum(constants))
    return [round(value, 6) for value in values]
