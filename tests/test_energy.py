"""The power of muscles and plant: what contractile elements give, and where it goes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import mujoco
import numpy as np
import pytest
from conftest import rest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

import mjhill
from mjhill.readings import tension
from mjhill.reference import plant_torque
from mjhill.spec import joint_spec

_Values = NDArray[np.float64]
_GAUSS = ((-np.sqrt(0.6), 5 / 18), (0.0, 8 / 18), (np.sqrt(0.6), 5 / 18))  # nodes and weights


@dataclass(frozen=True)
class Energy:
    """Work and stored energy of a joint and its muscles since the start of a recording [J].

    Attributes:
        time: When [s].
        contractile: Work of each muscle's contractile element.
        series: Energy gained by each muscle's series element.
        delivered: Work of each muscle on the joint.
        kinetic: Energy of motion gained.
        elastic: Energy gained by the passive elasticity.
        viscous: Loss in the passive viscosity.
        external: Work of the external torque on the joint.
    """

    time: _Values
    contractile: Mapping[str, _Values]
    series: Mapping[str, _Values]
    delivered: Mapping[str, _Values]
    kinetic: _Values
    elastic: _Values
    viscous: _Values
    external: _Values

    @property
    def gap(self) -> float:
        """Most that is missing or too much between work and energy, in units of the largest."""
        given = [*self.contractile.values(), self.external]
        spent = [*self.series.values(), self.kinetic, self.elastic, self.viscous]
        return _most([np.sum(given, axis=0) - np.sum(spent, axis=0)]) / _most([*given, *spent])

    @property
    def muscle_gap(self) -> float:
        """As ``gap``, of the muscles alone."""
        gaps = [
            self.contractile[name] - self.series[name] - self.delivered[name]
            for name in self.series
        ]
        return _most(gaps) / _most([*self.contractile.values(), self.external])


def energy(recording: mjhill.Recording, joint: mjhill.Joint) -> Energy:
    """Work and energy of a recording of ``joint_spec(joint)``, or of a model that moves alike.

    Work is mean force times displacement. MuJoCo's single-step integrators are semi-implicit:
    the new velocity moves the joint, q[k+1] = q[k] + h v[k+1]. So a recorded velocity is the
    mean over the step before its sample, the velocity at sample k is (v[k] + v[k+1])/2, and
    there is none at the last sample, which is left out. The force of sample k acts from
    half a step before it to half a step after it, so over a step acts the mean of the forces at
    its two ends. RK4's velocity is that of the sample itself, and an input is held from one
    sample to the next.

    Raises:
        ValueError: The recording does not have every step.
    """
    time, name = recording.time, joint.name
    if not np.allclose(np.diff(time), recording.about["timestep"]):
        raise ValueError("energy needs a recording of every step")
    fine = recording.about["integrator"] == "mjINT_RK4"
    angle, velocity = recording[f"{name}.angle"], recording[f"{name}.velocity"]
    applied = recording.series.get(f"{name}.applied", np.zeros(len(time)))
    pieces = _pieces(applied) if fine else []
    if not fine:
        velocity = np.append(0.5 * (velocity[:-1] + velocity[1:]), np.nan)
    contractile, series, delivered = {}, {}, {}
    for each, muscle in joint.muscles.items():
        force = recording[f"{each}.force"]
        shortened = _summed(recording[f"{each}.velocity"][1:] * np.diff(time))
        contractile[each] = _work(time, force, shortened, pieces)
        series[each] = _gained(series_energy(muscle, recording[f"{each}.stretch"]))
        delivered[each] = _work(time, -joint.gears[each] * force, angle, pieces)
    held = applied[:-1] if fine else 0.5 * (applied[:-1] + applied[1:])
    last = None if fine else -1
    return Energy(
        time[:last],
        {each: values[:last] for each, values in contractile.items()},
        {each: values[:last] for each, values in series.items()},
        {each: values[:last] for each, values in delivered.items()},
        _gained(0.5 * joint.inertia * velocity**2)[:last],
        _gained(elastic_energy(joint, angle))[:last],
        _work(time, joint.damping * velocity, angle, pieces)[:last],
        _summed(held * np.diff(angle))[:last],
    )


def series_energy(muscle: mjhill.Muscle, stretch: _Values) -> _Values:
    """Energy of the series element at a stretch [J]: the integral of its force."""
    taut = np.maximum(stretch, 0.0)
    rate = muscle.series_shape / muscle.series_stretch
    grown: _Values = _area(rate * taut, muscle.series_shape * muscle.series_limit) / rate
    scale = muscle.max_isometric_force / float(np.expm1(muscle.series_shape))
    return scale * (grown - taut)


def elastic_energy(joint: mjhill.Joint, angle: _Values) -> _Values:
    """Energy of the passive elasticity of a joint at an angle [J]: the integral of its torque."""
    deviation, passive = angle - joint.rest_angle, joint.passive
    stored: _Values = 0.5 * joint.stiffness * deviation**2
    for k1, k2, sign in (
        (passive.k1_pos, passive.k2_pos, 1.0),
        (passive.k1_neg, passive.k2_neg, -1.0),
    ):
        beyond = np.maximum(sign * deviation, 0.0)
        stored += k1 * (_area(k2 * beyond, passive.exponent_limit) / k2 - beyond)
    return stored


def _area(z: _Values, limit: float) -> _Values:
    """Integral from 0 to z of exp(z), which goes on straight past the limit."""
    past = np.maximum(z - limit, 0.0)
    area: _Values = np.expm1(np.minimum(z, limit)) + np.exp(limit) * (past + 0.5 * past**2)
    return area


def _work(time: _Values, force: _Values, way: _Values, pieces: list[slice]) -> _Values:
    """Work of a force along a way, up to each sample.

    By the mean of force at the ends of a step, which is of second order as the single-step
    integrators are at best. RK4 is of fourth order, so there force and way are splines over each
    of the pieces in which they are smooth.
    """
    if not pieces:
        return _summed(0.5 * (force[:-1] + force[1:]) * np.diff(way))
    done = []
    for piece in pieces:
        pull = CubicSpline(time[piece], force[piece])
        rate = CubicSpline(time[piece], way[piece]).derivative()
        half = 0.5 * np.diff(time[piece])
        middle = time[piece][:-1] + half
        nodes = [(middle + half * node, weight) for node, weight in _GAUSS]
        done.append(2 * half * sum(weight * pull(at) * rate(at) for at, weight in nodes))
    return _summed(np.concatenate(done))


def _pieces(applied: _Values) -> list[slice]:
    """Samples from one jump of the torque to the next, both included."""
    jumps = (np.flatnonzero(np.diff(applied)) + 1).tolist()
    edges = sorted({0, *jumps, len(applied) - 1})
    return [slice(begin, end + 1) for begin, end in itertools.pairwise(edges)]


def _summed(changes: _Values) -> _Values:
    return np.concatenate(([0.0], np.cumsum(changes)))


def _gained(values: _Values) -> _Values:
    return values - values[0]


def _most(values: list[_Values]) -> float:
    return max(float(np.abs(each).max()) for each in values)


SYSTEMS = ("elbow", "wrist", "knee", "ankle", "eye", 0, 1, 2, 3)  # numbers: variants of the elbow


def variant(seed: int) -> mjhill.Joint:
    """The elbow with parameters drawn at random."""
    random = np.random.default_rng(seed)
    elbow = mjhill.JOINTS["elbow"]
    varied = ("max_isometric_force", "width_short", "width_long", "max_velocity", "hill_shape")
    varied += ("series_stretch", "excitation_tau", "activation_tau", "deactivation_tau")
    muscles = {
        name: replace(
            muscle,
            **{each: getattr(muscle, each) * 2 ** random.uniform(-1, 1) for each in varied},
            series_shape=random.uniform(1, 5),
            eccentric_plateau=random.uniform(1.1, 1.8),
            eccentric_slope_ratio=random.uniform(0.5, 6),
            velocity_activation=random.uniform(0, 1),
        )
        for name, muscle in elbow.muscles.items()
    }
    plant = {
        each: getattr(elbow, each) * 2 ** random.uniform(-1, 1)
        for each in ("inertia", "damping", "stiffness")
    }
    return replace(elbow, muscles=muscles, **plant)


def movements(joint: mjhill.Joint) -> list[tuple[dict[str, mjhill.Signal], mjhill.Signal]]:
    """Excitations and torque: steps, pulses, a torque impulse, co-contraction with an impulse."""
    first, second = joint.muscles
    blow = 0.3 * min(muscle.max_isometric_force for muscle in joint.muscles.values())
    step, pulse, constant = mjhill.step, mjhill.pulse, mjhill.constant
    both = step(0.7, 0.02)
    return [
        ({first: step(0.8, 0.02), second: step(0.6, 0.22)}, constant(0)),
        ({first: pulse(1, 0.02, 0.12), second: pulse(1, 0.15, 0.1)}, constant(0)),
        ({first: constant(0.05), second: constant(0.05)}, pulse(blow, 0.1, 0.03)),
        ({first: both + pulse(0.3, 0.15, 0.1), second: both}, pulse(blow, 0.3, 0.03)),
    ]


def joint_of(system: str | int) -> mjhill.Joint:
    return variant(system) if isinstance(system, int) else mjhill.JOINTS[system]


@cache
def recorded(system: str | int, integrator: str, timestep: float) -> list[mjhill.Recording]:
    """The movements of a system."""
    joint = joint_of(system)
    model = joint_spec(joint).compile()
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    model.opt.timestep = timestep
    runs = []
    for excitation, torque in movements(joint):
        data, load = rest(model, joint.home_angle), {joint.name: torque}
        with mjhill.installed():
            run = mjhill.record(model, data, duration=0.4, excitation=excitation, torque=load)
        runs.append(run)
    return runs


def gap(system: str | int, integrator: str, timestep: float, heavier: bool = False) -> float:
    """The largest gap of the movements of a system; ``heavier`` by what damping adds in MuJoCo.

    MuJoCo's single-step integrators damp by the velocity at the end of the step. That is half a
    step later than the force, as if half a step of viscosity were added to the inertia.
    """
    joint = joint_of(system)
    if heavier:
        joint = replace(joint, inertia=joint.inertia + 0.5 * timestep * joint.damping)
    return max(energy(run, joint).gap for run in recorded(system, integrator, timestep))


def muscle_gap(system: str | int, integrator: str, timestep: float) -> float:
    joint = joint_of(system)
    return max(energy(run, joint).muscle_gap for run in recorded(system, integrator, timestep))


@pytest.mark.parametrize("end", [-0.02, 0.2, 1.5])
def test_series_energy_is_the_work_that_stretches_the_element(muscle, end):
    stretch = np.linspace(0.0, end, 20001)  # the last end is past the limit
    force = [tension(muscle, each) for each in stretch.tolist()]
    expected = np.trapezoid(force, stretch)
    assert series_energy(muscle, stretch)[-1] == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("end", [-1.1, 0.9, -6.0, 5.0])
def test_elastic_energy_is_the_work_that_bends_the_joint(elbow, end):
    joint = replace(elbow, passive=replace(elbow.passive, exponent_limit=2.0))
    angle = joint.rest_angle + np.linspace(0.0, end, 20001)
    torque = [plant_torque(joint, each) for each in angle.tolist()]
    expected = -np.trapezoid(torque, angle)
    assert elastic_energy(joint, angle)[-1] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("system", SYSTEMS)
def test_contractile_work_is_stretch_of_the_series_element_and_work_on_the_joint(system):
    coarse, fine = (muscle_gap(system, "IMPLICITFAST", timestep) for timestep in (1e-3, 5e-4))
    assert coarse < 3e-4
    assert fine < 0.35 * coarse  # second order


@pytest.mark.parametrize(
    ("system", "integrator"),
    [("elbow", "IMPLICITFAST"), ("elbow", "EULER"), ("knee", "IMPLICITFAST")],
)
def test_power_closes_to_0_3_percent_at_1_ms_and_with_first_order(system, integrator):
    found = [gap(system, integrator, timestep) for timestep in (1e-3, 5e-4, 2.5e-4)]
    assert found[0] < 3e-3
    assert found[1] < 0.55 * found[0]
    assert found[2] < 0.55 * found[1]


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_first_order_part_is_the_inertia_that_implicit_damping_adds(system):
    coarse, fine = (
        gap(system, "IMPLICITFAST", timestep, heavier=True) for timestep in (1e-3, 5e-4)
    )
    assert coarse < 3e-3
    assert fine < 0.35 * coarse  # second order


@pytest.mark.parametrize("system", ["elbow", "knee"])
def test_under_rk4_power_closes_to_a_millionth_at_a_quarter_of_a_millisecond(system):
    coarse, fine = (gap(system, "RK4", timestep) for timestep in (1e-3, 2.5e-4))
    assert coarse < 1e-4
    assert fine < 1e-6


def test_energy_needs_every_step(pair, elbow):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.1, every=2)
    with pytest.raises(ValueError, match="energy needs a recording of every step"):
        energy(run, elbow)
