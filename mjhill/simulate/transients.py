"""Moments of a recording in which a muscle does something impossible."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.muscles import Muscle, model_of
from mjhill.muscles.model import STRONGEST
from mjhill.simulate.recording import Recording

FASTEST = 1.5  # V_max
_MARGIN = 1.05  # on what elements carry: the scheme is off by less
_LEAD = 0.01  # of the series element's stretch at F_max

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Transient:
    """A muscle that did something impossible.

    Attributes:
        muscle: Its name.
        kind: ``"force"``, ``"velocity"`` or ``"push"``.
        time: When it was worst [s].
        value: Force [N·m or N] or shortening velocity [rad/s or m/s] then.
        limit: What is possible, in the same unit and with the same sign.
        unit: That unit.
        samples: Number of samples beyond the limit.
        first: Time of the first of them [s].
        cause: The most likely cause.
        remedy: What to do.
    """

    muscle: str
    kind: str
    time: float
    value: float
    limit: float
    unit: str
    samples: int
    first: float
    cause: str
    remedy: str

    def __str__(self) -> str:
        """The finding in one line."""
        often = f"{self.samples} samples from {self.first:.6g} s on, " if self.samples > 1 else ""
        what = {
            "force": f"a force of {self.value:.4g} {self.unit}, and its elements carry at most "
            f"{self.limit:.4g}",
            "velocity": f"a contractile element that {_moves(self.value)} at "
            f"{abs(self.value):.4g} {self.unit}, beyond {abs(self.limit):.4g}, which is "
            f"{FASTEST:g} times its largest velocity",
            "push": f"a force of {self.value:.4g} {self.unit}: it pushes, and a muscle only pulls",
        }[self.kind]
        return (
            f"muscle {self.muscle!r} did what no muscle can at {self.time:.6g} s: {what} "
            f"({often}{self.cause}); {self.remedy}"
        )


def transients(recording: Recording) -> tuple[Transient, ...]:
    """Moments in which mjhill muscles did something impossible, at most one of each kind for each.

    - *force*: more than the contractile element can hold, F_max times the eccentric plateau and
      what its viscosity adds at the fastest lengthening that the joints have yet made; in no case
      more than 3 F_max, at which a muscle tears.
    - *velocity*: the contractile element shortens faster than 1.5 V_max, or lengthens faster than
      that without a cause.
    - *push*: a force below 0.

    Causes of lengthening are joints that move, as in the antagonist of a fast movement, and a
    series element that recoils while the muscle relaxes. Both can be faster than V_max.

    Args:
        recording: What ``record`` returned; muscles whose parameters it does not hold are skipped.

    Returns:
        The findings, by muscle; empty if there are none.
    """
    return tuple(
        finding
        for name, muscle in recording.muscles.items()
        if f"{name}.length_rate" in recording.series
        for finding in _of_muscle(recording, name, muscle)
    )


def _of_muscle(recording: Recording, name: str, muscle: Muscle) -> Iterator[Transient]:
    force = recording[f"{name}.force"]
    tension = recording.series.get(f"{name}.tension", force)
    rate = recording[f"{name}.length_rate"]
    velocity = recording.series.get(f"{name}.velocity", np.zeros_like(rate))
    unit = recording.units[f"{name}.length_rate"]
    model = model_of(muscle)
    largest = model.ask(model.max_velocity, muscle) if model.max_velocity else np.inf
    fastest = FASTEST * largest
    if recording.about.get("integrator") == "mjINT_RK4" and len(recording) > 1:
        # its force is that of a stretch a little later, see staged_stretch; not always equally so
        compliance = model.ask(model.compliance, muscle)
        fastest += _LEAD * compliance / float(np.diff(recording.time).min())
    before = np.concatenate((rate[:1], rate[:-1]))
    lengthened = np.maximum.accumulate(np.maximum(rate, 0.0))
    slow, more = model.ask(model.lengthening, muscle)
    held = _MARGIN * slow + more * lengthened
    carried = np.minimum(held, STRONGEST * muscle.max_isometric_force)
    checks = {  # values, their excess, the limit
        "force": (tension, tension - carried, carried),
        "velocity": (
            velocity,
            np.maximum(velocity, -velocity - _explained(recording, name, tension <= held))
            - fastest,
            np.copysign(fastest, velocity),
        ),
        "push": (force, -force - 1e-9 * muscle.max_isometric_force, np.zeros_like(force)),
    }
    if not model.pulls_only:
        del checks["push"]
    jumped = _jumps(recording, name, before, fastest)
    for kind, (values, excess, limits) in checks.items():
        beyond = ~(excess <= 0)  # so also what is not a number
        if not beyond.any():
            continue
        worst = int(np.argmax(np.where(beyond, np.nan_to_num(excess, nan=np.inf), -np.inf)))
        cause, remedy = _reason(kind, worst, jumped)
        if kind == "force" and tension[worst] <= held[worst]:
            speed = f"{lengthened[worst]:.3g} {unit}"
            if model.max_velocity:
                speed += f", {lengthened[worst] / largest:.3g} times V_max"
            cause = f"it is lengthened at up to {speed}, which tears it"
            remedy = "look for an inertia, a speed or a max_velocity that is too small or too large"
        yield Transient(
            name, kind, float(recording.time[worst]), float(values[worst]), float(limits[worst]),
            unit if kind == "velocity" else recording.units[f"{name}.force"],
            int(beyond.sum()), float(recording.time[np.argmax(beyond)]), cause, remedy,
        )  # fmt: skip


def _explained(recording: Recording, name: str, sound: NDArray[np.bool_]) -> _Values:
    """Lengthening of the contractile element that has a cause [rad/s or m/s], shape (T,).

    The joints move, or the series element recoils from a force that was ``sound``.
    """
    rate = recording[f"{name}.length_rate"]
    stretch = recording.series.get(f"{name}.stretch", np.zeros_like(rate))
    before = np.concatenate((rate[:1], rate[:-1]))
    recoil = np.where(sound[:-1], -np.diff(stretch) / np.diff(recording.time), 0.0)
    at_first = np.inf if sound[0] else 0.0
    explained: _Values = np.maximum(np.maximum(rate, before), 0.0)
    return explained + np.maximum(np.concatenate(([at_first], recoil)), 0.0)


def _jumps(recording: Recording, name: str, before: _Values, fastest: float) -> NDArray[np.bool_]:
    """Where a length changes faster than the joints' velocities can make it, shape (T,)."""
    rate, length = recording[f"{name}.length_rate"], recording[f"{name}.length"]
    grown = np.diff(length) / np.diff(recording.time)
    low, high = np.minimum(rate, before)[1:], np.maximum(rate, before)[1:]
    return np.concatenate(([False], np.abs(grown - np.clip(grown, low, high)) > fastest))


def _reason(kind: str, worst: int, jumped: NDArray[np.bool_]) -> tuple[str, str]:
    """Cause and remedy of a finding."""
    if kind == "push":
        return (
            "MuJoCo applies another force than the tension, as with a forcerange",
            "take the forcerange off the actuator",
        )
    if jumped[max(worst - 2, 0) : worst + 1].any():
        return (
            "its length jumps there, as where a tendon slips off the geom that it wraps",
            "give the geom a sidesite, or lead the tendon so that it cannot slip off",
        )
    return (
        "the timestep is too long for this movement, or the state was set during the run",
        "lower the timestep; mjhill.check_model says which would do",
    )


def _moves(velocity: float) -> str:
    return "shortens" if velocity > 0 else "lengthens"
