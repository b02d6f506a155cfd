"""What the paper says about torque-velocity curves from velocity clamps, and what was measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees

import numpy as np
from numpy.typing import NDArray

from mjhill.experiments.result import Claim
from mjhill.experiments.trials.torque_velocity import Curve, Sweep

Values = NDArray[np.float64]

DIFFERENT = 0.05  # of the largest isometric torque: about what a repeated test differs by
_LOW = 0.2  # of the contractile element's largest velocity: what counts as low
_SEEN = 0.01  # deviation from which on there is one to explain, of the largest isometric torque
_MAIN = 0.5  # share of a deviation that goes with its main cause, at least
_SECTION = "4.1.3, Fig. 6"


@dataclass(frozen=True)
class Curves:
    """Torque-velocity curves of one muscle at V velocities, read at A angles.

    Attributes:
        shares: Velocities in units of the largest of the contractile element [-], shape (V,).
        largest: Largest isometric torque on the way [N·m].
        isometric: Isometric torque at the angles [N·m], shape (A,).
        own_best: Of the fully active contractile element, at best on the way [N·m], shape (V,).
        own: The same at the angles [N·m], shape (A, V).
        relaxed: Started relaxed.
        tensed: Started from steady full contraction.
        relaxed_compliant: Started relaxed, on the compliant machine.
        tensed_compliant: Started contracted, on the compliant machine.
        relaxed_bare: Started relaxed, the series element nearly removed.
        tensed_bare: Started contracted, the series element nearly removed.
        bare: Stretch of that, of the series element's own [-].
    """

    shares: Values
    largest: float
    isometric: Values
    own_best: Values
    own: Values
    relaxed: Curve
    tensed: Curve
    relaxed_compliant: Curve
    tensed_compliant: Curve
    relaxed_bare: Curve
    tensed_bare: Curve
    bare: float

    def measured(self) -> Iterator[tuple[str, Curve]]:
        """The curves with what sets them apart."""
        yield "started relaxed", self.relaxed
        yield "started contracted", self.tensed
        yield "started relaxed, compliant machine", self.relaxed_compliant
        yield "started contracted, compliant machine", self.tensed_compliant
        yield "started relaxed, hardly any series element", self.relaxed_bare
        yield "started contracted, hardly any series element", self.tensed_bare

    def nearest(self, share: float) -> int:
        """Index of the velocity nearest a share of the largest."""
        return int(np.abs(self.shares - share).argmin())


def claims(sweep: Sweep, curves: Curves) -> Iterator[Claim]:
    """The claims of sect. 4.1.3, all about velocities of shortening."""
    yield _differ(sweep, curves)
    yield _initial(sweep, curves)
    yield _location(sweep, curves)
    yield _clamp(sweep, curves)
    yield _low_velocity(sweep, curves)
    yield _cause(sweep, curves)


def _largest(sweep: Sweep, curves: Curves, difference: Values) -> tuple[float, str]:
    """Largest of a difference of torques [N·m] over shortening, of the largest isometric torque."""
    sizes = np.abs(np.atleast_2d(difference)).max(axis=0) / curves.largest
    sizes = np.where(sweep.shortening, sizes, 0.0)
    worst = int(sizes.argmax())
    own = curves.own_best[worst] / curves.largest
    velocity = f"{degrees(sweep.velocities[worst]):.0f}°/s"
    return float(
        sizes[worst]
    ), f"{sizes[worst]:.1%} (at {velocity}, where the contractile element gives {own:.0%})"


def _differ(sweep: Sweep, curves: Curves) -> Claim:
    pairs = (("relaxed", curves.relaxed), ("contracted", curves.tensed))
    found = {name: _largest(sweep, curves, curve.at - curves.own) for name, curve in pairs}
    return Claim(
        "Measured torque-velocity curves differ from the contractile element's own.",
        _SECTION,
        max(size for size, _ in found.values()) > DIFFERENT,
        "from the fully active contractile element at the same angle, in units of the largest "
        f"isometric torque: started relaxed up to {found['relaxed'][1]}, started contracted up "
        f"to {found['contracted'][1]}; {DIFFERENT:.0%} count as different",
    )


def _initial(sweep: Sweep, curves: Curves) -> Claim:
    size, where = _largest(sweep, curves, curves.tensed.at - curves.relaxed.at)
    peak, at_peak = _largest(sweep, curves, curves.tensed.peak - curves.relaxed.peak)
    return Claim(
        "The curves depend on the initial condition of the contraction.",
        "4.1.3, Fig. 6b",
        max(size, peak) > DIFFERENT,
        f"contracted less relaxed start, of the largest isometric torque: torque at an angle up "
        f"to {where}, peak torque up to {at_peak}",
    )


def _location(sweep: Sweep, curves: Curves) -> Claim:
    own = np.ptp(curves.own / curves.isometric[:, np.newaxis], axis=0)
    rows = []
    for curve in (curves.relaxed, curves.tensed):
        scaled = curve.at / curves.isometric[:, np.newaxis]
        rows.append(np.ptp(np.vstack([scaled, curve.peak / curves.largest]), axis=0) - own)
    beyond = [np.where(sweep.shortening, row, 0.0) for row in rows]
    size = max(float(row.max()) for row in beyond)
    where = [
        f"{row.max():.1%} at {degrees(sweep.velocities[row.argmax()]):.0f}°/s" for row in beyond
    ]
    return Claim(
        "They depend on where in the course of torque it is read: its peak, or at some angle.",
        "4.1.3, Fig. 6c",
        size > DIFFERENT,
        "spread of peak and torques at angles, each of its isometric value, beyond that of the "
        f"contractile element: started relaxed up to {where[0]}, contracted up to {where[1]}",
    )


def _clamp(sweep: Sweep, curves: Curves) -> Claim:
    found = [
        _largest(sweep, curves, np.vstack([soft.at - hard.at, soft.peak - hard.peak]))
        for soft, hard in (
            (curves.relaxed_compliant, curves.relaxed),
            (curves.tensed_compliant, curves.tensed),
        )
    ]
    return Claim(
        "They depend on how well the machine clamps the velocity.",
        "4.1.3",
        max(size for size, _ in found) > DIFFERENT,
        "compliant less stiff machine, of the largest isometric torque: started relaxed up to "
        f"{found[0][1]}, contracted up to {found[1][1]}",
    )


def _low_velocity(sweep: Sweep, curves: Curves) -> Claim:
    low = sweep.shortening & (curves.shares <= _LOW)
    found = [
        _largest(sweep, curves, np.where(low, curve.peak - curves.own_best, 0.0))
        for curve in (curves.relaxed, curves.tensed)
    ]
    return Claim(
        "At low velocities peak torque departs from Hill's curve, as some laboratories find.",
        "4.1.3",
        max(size for size, _ in found) > DIFFERENT if low.any() else None,
        f"up to {_LOW:.0%} of the largest velocity, from the contractile element at best, of the "
        f"largest isometric torque: started relaxed up to {found[0][1]}, contracted up to "
        f"{found[1][1]}; a peak is where the series element neither stretches nor recoils",
    )


def _cause(sweep: Sweep, curves: Curves) -> Claim:
    def error(*found: Curve) -> float:
        deviation = np.concatenate([(c.at - c.own)[:, sweep.shortening].ravel() for c in found])
        return float(np.sqrt(np.mean(deviation**2))) / curves.largest

    whole, bare = (
        error(curves.relaxed, curves.tensed),
        error(curves.relaxed_bare, curves.tensed_bare),
    )
    return Claim(
        "The series element is the main cause.",
        "4.1.3",
        bare < (1 - _MAIN) * whole if whole > _SEEN else None,
        "deviation from the contractile element at the angle and activation of the moment, RMS of "
        f"the largest isometric torque: {whole:.1%}, and {bare:.1%} with a series element that "
        f"stretches {curves.bare:.0%} as much",
    )
