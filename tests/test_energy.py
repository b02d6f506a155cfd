"""The power of muscles and plant: what contractile elements give, and where it goes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.readings import passive_energy, series_energy, tension
from mjhill.reference import plant_torque
from mjhill.spec import joint_spec

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
    added = 0.5 * timestep * joint.damping if heavier else 0.0
    gaps = []
    for run in recorded(system, integrator, timestep):
        balance = mjhill.energy(run)
        square = balance.kinetic * 2 / joint.inertia
        lacking = np.abs(balance.residual - 0.5 * added * square).max()
        gaps.append(balance.gap * lacking / np.abs(balance.residual).max())
    return max(gaps)


def muscle_gap(system: str | int, integrator: str, timestep: float) -> float:
    return max(mjhill.energy(run).muscle_gap for run in recorded(system, integrator, timestep))


@pytest.mark.parametrize("end", [-0.02, 0.2, 1.5])
def test_series_energy_is_the_work_that_stretches_the_element(muscle, end):
    stretch = np.linspace(0.0, end, 20001)  # the last end is past the limit
    force = [tension(muscle, each) for each in stretch.tolist()]
    expected = np.trapezoid(force, stretch)
    assert series_energy(muscle, stretch)[-1] == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("end", [-1.1, 0.9, -6.0, 5.0])
def test_passive_energy_is_the_work_that_bends_the_joint(elbow, end):
    passive = replace(elbow.passive, exponent_limit=2.0)
    joint = replace(elbow, passive=passive, stiffness=0.0)
    deviation = np.linspace(0.0, end, 20001)
    torque = [plant_torque(joint, joint.rest_angle + each) for each in deviation.tolist()]
    expected = -np.trapezoid(torque, deviation)
    assert passive_energy(passive, deviation)[-1] == pytest.approx(expected, rel=1e-6)


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


def test_energy_needs_every_step(pair):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.1, every=2)
    with pytest.raises(ValueError, match="energy needs a recording of every step"):
        mjhill.energy(run)
