"""The first swing of a disturbed joint, fitted as that of a mass on a spring and a damper."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from mjhill.analysis.responses import SecondOrder, second_order_fit

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Swing:
    """A disturbed joint as a spring and a damper, until it has swung out and back.

    A muscle yields within tenths of a second: its series element stretches at once, its
    contractile element follows. So one spring and damper cannot describe both the swing and what
    comes later. The fit therefore takes twice the time to the first peak, which is half a cycle of
    an undamped system. It takes the whole run if there is no peak, or a given window.

    Attributes:
        inertia: Inertia J of everything that moves [kg·m²].
        peak: Largest deflection of the first swing, or of the run if the joint never turns [rad].
        time_to_peak: Time from the start [s]; None if the joint never turns.
        stiffness: K [N·m/rad].
        damping: B [N·m·s/rad].
        fitted_inertia: J from a second fit, in which it is unknown too [kg·m²].
        window: Length of the fitted part [s].
        misfit: Root mean square residual in that part, in units of the peak [-].
        misfit_of_run: The same over the whole run [-].
    """

    inertia: float
    peak: float
    time_to_peak: float | None
    stiffness: float
    damping: float
    fitted_inertia: float
    window: float
    misfit: float
    misfit_of_run: float

    @property
    def natural_frequency(self) -> float | None:
        """Undamped natural frequency, sqrt(K/J) / 2π [Hz]; None unless K is positive."""
        return sqrt(self.stiffness / self.inertia) / (2 * pi) if self.stiffness > 0 else None

    @property
    def damping_ratio(self) -> float | None:
        """B over 2 sqrt(J K) [-]; None unless K is positive."""
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
        deflection: Angle from that at the start [rad], shape (T,).
        velocity: Angular velocity [rad/s], shape (T,).
        load: Torque in addition to the steady load [N·m], shape (T,).
        inertia: Inertia J of everything that moves [kg·m²].
        window: Length of the fitted part [s]; see ``Swing`` for the default.
    """
    turns = np.flatnonzero((velocity[:-1] > 0) & (velocity[1:] <= 0))
    turned = int(turns[0]) + 1 if len(turns) else None
    end = len(time) if turned is None else min(2 * turned + 1, len(time))
    peak = float(deflection[:end].max())
    if window is not None:
        end = min(round(window / (time[1] - time[0])) + 1, len(time))
    series = (time[:end], deflection[:end], velocity[:end], load[:end])
    fit, free = second_order_fit(*series, inertia), second_order_fit(*series, None)
    residual = deflection - second_order_response(fit, time, load)
    return Swing(
        inertia=inertia,
        peak=peak,
        time_to_peak=None if turned is None else float(time[turned] - time[0]),
        stiffness=fit.stiffness,
        damping=fit.damping,
        fitted_inertia=free.inertia,
        window=float(time[end - 1] - time[0]),
        misfit=float(np.sqrt(np.mean(residual[:end] ** 2)) / peak),
        misfit_of_run=float(np.sqrt(np.mean(residual**2)) / peak),
    )


def second_order_response(fit: SecondOrder, time: _Values, load: _Values) -> _Values:
    """Deflection [rad] of a second-order system from rest under a load, constant over each step.

    Args:
        fit: Stiffness, damping and inertia.
        time: Evenly spaced sample times [s], shape (T,).
        load: Load from each sample to the next [N·m], shape (T,).
    """
    system = ([1.0], [fit.inertia, fit.damping, fit.stiffness])
    from scipy.signal import lsim  # takes more than a second to import

    _, fitted, *_ = lsim(system, load, time - time[0], interp=False)
    return np.asarray(fitted)
