"""The energy balance of a recording: work of the muscles, energy stored and lost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjhill.frozen import FrozenDict
from mjhill.muscles import Muscle, model_of
from mjhill.simulate.recording import Recording, shown

_Values = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Energy:
    """Work and energy of a model and its muscles since the start of a recording [J].

    Every array has the shape (T,) and is 0 at the first sample. ``docs/energy.md`` has the
    equations.

    Attributes:
        time: When [s].
        contractile: Work of each muscle's contractile element, by muscle; the loss in its
            viscosity is already taken off.
        viscosity: Loss in the viscosity beside each contractile element.
        series: Energy gained by each series element.
        withheld: Work of each series element that MuJoCo does not apply, because of a
            ``forcerange`` or a disabled group; otherwise 0.
        delivered: Work of each muscle on the skeleton.
        kinetic: Energy of motion gained.
        gravity: Energy gained in the field of gravity.
        elastic: Energy gained by the passive elasticity of each joint, by joint.
        springs: Energy gained by other springs: of tendons, of ball and free joints.
        damping: Loss in the damping of joints and tendons.
        external: Work of the external torques and forces.
        constraint: Work of contacts, limits, friction and equalities.
        other: Work of other actuators, of limits on a joint's actuator force, of fluids.
    """

    time: _Values
    contractile: Mapping[str, _Values]
    viscosity: Mapping[str, _Values]
    series: Mapping[str, _Values]
    withheld: Mapping[str, _Values]
    delivered: Mapping[str, _Values]
    kinetic: _Values
    gravity: _Values
    elastic: Mapping[str, _Values]
    springs: _Values
    damping: _Values
    external: _Values
    constraint: _Values
    other: _Values

    @property
    def residual(self) -> _Values:
        """What the balance lacks [J], shape (T,): work done less energy gained and lost."""
        total: _Values = np.sum(self._given(), axis=0) - np.sum(self._spent(), axis=0)
        return total

    @property
    def gap(self) -> float:
        """Largest residual, in units of the largest work or energy in the balance [-]."""
        return _share([self.residual], [*self._given(), *self._spent()])

    @property
    def muscle_residual(self) -> Mapping[str, _Values]:
        """What the balance of each muscle lacks [J], shape (T,), by muscle."""
        return FrozenDict(
            {
                name: work - self.series[name] - self.withheld[name] - self.delivered[name]
                for name, work in self.contractile.items()
            }
        )

    @property
    def muscle_gap(self) -> float:
        """Largest residual of a muscle, in units of the largest work of one or from outside [-]."""
        return _share(
            list(self.muscle_residual.values()), [*self.contractile.values(), self.external]
        )

    def at_end(self) -> dict[str, float]:
        """Every term of the balance at the last sample [J], by what it is."""
        return {what: float(values[-1]) for what, values in self._terms()}

    def __str__(self) -> str:
        """The balance at the last sample, a line for each term that is not 0 throughout."""
        lines = [f"energy balance of {self.time[-1] - self.time[0]:g} s [J]"]
        shown_terms = [(what, values) for what, values in self._terms() if values.any()]
        width = max((len(what) for what, _ in shown_terms), default=0)
        lines += [f"{shown(what):<{width}} {values[-1]:12.6f}" for what, values in shown_terms]
        lines.append(f"largest residual: {100 * self.gap:.2g} % of the largest term")
        return "\n".join(lines)

    def _given(self) -> list[_Values]:
        return [*self.contractile.values(), self.external, self.constraint, self.other]

    def _spent(self) -> list[_Values]:
        return [
            *self.series.values(), *self.withheld.values(), self.kinetic, self.gravity,
            *self.elastic.values(), self.springs, self.damping,
        ]  # fmt: skip

    def _terms(self) -> Iterator[tuple[str, _Values]]:
        for name, values in self.contractile.items():
            yield f"work of contractile element, {name}", values
        yield "work of external loads", self.external
        yield "work of constraints", self.constraint
        yield "work of others", self.other
        for name, values in self.series.items():
            yield f"gained by series element, {name}", values
        for name, values in self.withheld.items():
            yield f"not passed on by MuJoCo, {name}", values
        yield "gained in motion", self.kinetic
        yield "gained in gravity", self.gravity
        for name, values in self.elastic.items():
            yield f"gained by elasticity, {name}", values
        yield "gained by other springs", self.springs
        yield "lost to damping", self.damping
        yield "residual", self.residual


def energy(recording: Recording) -> Energy:
    """The energy balance of a recording of every step.

    Args:
        recording: What ``record`` returned, or the same loaded from a file.

    Raises:
        ValueError: The recording does not have every step, or not the series that it takes.
    """
    time, none = recording.time, np.zeros(len(recording))
    step = recording.about.get("timestep")
    if "model.kinetic_energy" not in recording.series or not isinstance(step, float):
        raise ValueError(
            "energy needs a recording that mjhill.record made; this one has no series "
            "'model.kinetic_energy' or no timestep"
        )
    if not np.allclose(np.diff(time), step, rtol=1e-6, atol=1e-9):
        raise ValueError(
            f"energy needs a recording of every step, here of {step:g} s; record with every=1"
        )

    def of_model(quantity: str) -> _Values:
        return _gained(recording.series.get(f"model.{quantity}", none))

    def of_muscles(*quantities: str) -> FrozenDict[str, _Values]:
        """The first of some quantities that each muscle has; 0 without any."""
        found = {}
        for name in recording.muscles:
            known = [f"{name}.{q}" for q in quantities if f"{name}.{q}" in recording.series]
            found[name] = _gained(recording[known[0]]) if known else none
        return FrozenDict(found)

    elastic = {
        name.removesuffix(".passive_energy"): _gained(values)
        for name, values in recording.series.items()
        if name.endswith(".passive_energy")
    }
    muscles = recording.muscles.items()
    return Energy(
        time=time,
        contractile=of_muscles("contractile_work", "work"),
        viscosity=FrozenDict({name: _viscosity(recording, name, each) for name, each in muscles}),
        series=of_muscles("series_energy"),
        withheld=FrozenDict({name: _withheld(recording, name) for name in recording.muscles}),
        delivered=of_muscles("work"),
        kinetic=of_model("kinetic_energy"),
        gravity=of_model("gravity_energy"),
        elastic=FrozenDict(elastic),
        springs=of_model("spring_energy"),
        damping=of_model("damping_loss"),
        external=of_model("external_work"),
        constraint=of_model("constraint_work"),
        other=of_model("other_work"),
    )


def _viscosity(recording: Recording, name: str, muscle: Muscle) -> _Values:
    """Loss inside a muscle's contractile element, up to each sample."""
    recorded = {
        series.removeprefix(f"{name}."): values
        for series, values in recording.series.items()
        if series.startswith(f"{name}.")
    }
    return model_of(muscle).viscous_loss(muscle, recording.time, recorded)


def _withheld(recording: Recording, name: str) -> _Values:
    tension = recording.series.get(f"{name}.tension")
    if tension is None:
        return np.zeros(len(recording))
    rest = tension - recording[f"{name}.force"]
    return _summed(-0.5 * (rest[:-1] + rest[1:]) * np.diff(recording[f"{name}.length"]))


def _gained(values: _Values) -> _Values:
    gained: _Values = values - values[0]
    return gained


def _summed(changes: _Values) -> _Values:
    return np.concatenate(([0.0], np.cumsum(changes)))


def _share(lacking: list[_Values], terms: list[_Values]) -> float:
    largest = _most(terms)
    return _most(lacking) / largest if largest else 0.0


def _most(values: list[_Values]) -> float:
    return max((float(np.abs(each).max()) for each in values), default=0.0)
