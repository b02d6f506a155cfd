"""The first swing of a disturbed joint, as that of a second-order system."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lsim

from mjhill.analysis.responses import SecondOrder, second_order_fit
from mjhill.experiments.result import Measure

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Swing:
    """A joint that was disturbed, as a spring and a damper until it has swung out and back.

    A muscle yields within tenths of a second (its series element stretches at once, its contractile
    element follows), so that no one spring and damper describe both the swing and what comes later.
    The fit is therefore of twice the time to the first peak, half a cycle of an undamped system;
    of the whole run where there is no peak, or of a window that was asked for.

    Attributes:
        inertia: J of all that moves [kg·m²].
        peak: Largest deflection of the first swing; of the whole run where it does not turn [rad].
        time_to_peak: From the start; None where it does not turn [s].
        stiffness: K [N·m/rad].
        damping: B [N·m·s/rad].
        found_inertia: J that the same fit finds where it is not told [kg·m²].
        window: Length of what is fitted [s].
        misfit: Root mean square of what the fit leaves in that window, as a share of the peak [-].
        misfit_of_run: The same over the whole run [-].
    """

    inertia: float
    peak: float
    time_to_peak: float | None
    stiffness: float
    damping: float
    found_inertia: float
    window: float
    misfit: float
    misfit_of_run: float

    @property
    def natural_frequency(self) -> float | None:
        """Undamped, sqrt(K/J) / 2π [Hz]; None without a positive stiffness."""
        return sqrt(self.stiffness / self.inertia) / (2 * pi) if self.stiffness > 0 else None

    @property
    def damping_ratio(self) -> float | None:
        """B over 2 sqrt(J K) [-]; None without a positive stiffness."""
        if self.stiffness <= 0:
            return None
        return self.damping / (2 * sqrt(self.inertia * self.stiffness))


def first_swing(
    time: _Values,
    deflection: _Values,
    velocity: _Values,
    load: _Values,
    inertia: float,
    window: float | None = None,
) -> Swing:
    """The first swing, towards positive deflections, under a load.

    Args:
        time: Sample times from the start of the disturbance [s], evenly spaced, shape (T,).
        deflection: From the angle at the start [rad], shape (T,).
        velocity: [rad/s], shape (T,).
        load: What is added to the steady load [N·m], shape (T,).
        inertia: J of all that moves [kg·m²].
        window: Length of what is fitted [s]; see ``Swing`` for what it is without.
    """
    turns = np.flatnonzero((velocity[:-1] > 0) & (velocity[1:] <= 0))
    turned = int(turns[0]) + 1 if len(turns) else None
    end = len(time) if turned is None else min(2 * turned + 1, len(time))
    peak = float(deflection[:end].max())
    if window is not None:
        end = min(round(window / (time[1] - time[0])) + 1, len(time))
    series = (time[:end], deflection[:end], velocity[:end], load[:end])
    fit, free = second_order_fit(*series, inertia), second_order_fit(*series, None)
    left = deflection - second_order_response(fit, time, load)
    return Swing(
        inertia=inertia,
        peak=peak,
        time_to_peak=None if turned is None else float(time[turned] - time[0]),
        stiffness=fit.stiffness,
        damping=fit.damping,
        found_inertia=free.inertia,
        window=float(time[end - 1] - time[0]),
        misfit=float(np.sqrt(np.mean(left[:end] ** 2)) / peak),
        misfit_of_run=float(np.sqrt(np.mean(left**2)) / peak),
    )


def second_order_response(fit: SecondOrder, time: _Values, load: _Values) -> _Values:
    """Deflection [rad] of a second-order system under a load held over each step, from rest."""
    system = ([1.0], [fit.inertia, fit.damping, fit.stiffness])
    _, fitted, *_ = lsim(system, load, time - time[0], interp=False)
    return np.asarray(fitted)


def swing_measures(label: str, swing: Swing) -> Iterator[Measure]:
    """What to say of a swing; ``label`` says which."""
    unturned = "" if swing.time_to_peak else "it does not turn within the run"
    yield Measure(f"peak deflection, {label}", degrees(swing.peak), "°", note=unturned)
    yield Measure(f"time to peak, {label}", swing.time_to_peak, "s", note=unturned)
    yield Measure(f"stiffness K, {label}", swing.stiffness, "N·m/rad")
    yield Measure(f"viscosity B, {label}", swing.damping, "N·m·s/rad")
    found = swing.found_inertia if swing.found_inertia > 0 else None
    none = "" if found else "the fit that may choose it finds none above 0"
    yield Measure(f"inertia J, found, {label}", found, "kg·m²", note=none)
    yields = "" if swing.stiffness > 0 else "the fitted stiffness is not positive"
    yield Measure(f"natural frequency, {label}", swing.natural_frequency, "Hz", note=yields)
    yield Measure(f"damping ratio, {label}", swing.damping_ratio, "-", note=yields)
    yield Measure(f"misfit of the fit, {label}", swing.misfit, "-")
    yield Measure(f"misfit of the whole run, {label}", swing.misfit_of_run, "-")
