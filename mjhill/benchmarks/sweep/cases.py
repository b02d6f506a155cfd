"""Random systems and inputs; the kind and the number of a case determine all of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any
from zlib import crc32

import mujoco
import numpy as np

from mjhill.benchmarks.sweep.tendons import tendon_model
from mjhill.engine.spec import system_spec
from mjhill.joints.joint import Joint, Passive
from mjhill.joints.reader import JOINTS
from mjhill.joints.system import Coordinate, Movement, System
from mjhill.muscles.hill import Hill
from mjhill.simulate.signals import Signal, as_signal, pulse, sinusoid

DURATION = 0.6  # [s]
GRID = 0.01  # [s]: inputs jump at multiples of it, which every timestep of the sweep divides

_Random = np.random.Generator


@dataclass(frozen=True)
class Case:
    """A system, its inputs and where it starts.

    Attributes:
        kind: Kind of system, one of ``KINDS``.
        number: Number within the kind; both together determine the case.
        model: The system in MuJoCo.
        system: The system for the reference solver; None for spatial tendons.
        excitation: Excitation of each muscle.
        torque: External torque of each joint.
        start: Position of each joint, at rest, with muscles in steady state at ``tonic``.
        tonic: Excitation of each muscle before the start.
        movement: Prescribed movement of joints.
    """

    kind: str
    number: int
    model: mujoco.MjModel
    system: System | None
    excitation: Mapping[str, Signal]
    torque: Mapping[str, Signal]
    start: Mapping[str, float]
    tonic: Mapping[str, float]
    movement: Mapping[str, Movement] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def name(self) -> str:
        """Kind and number."""
        return f"{self.kind}:{self.number}"


def draw(kind: str, number: int) -> Case:
    """The case of a kind and number; always the same.

    Raises:
        ValueError: There is no such kind, or the number is negative.
    """
    if kind not in KINDS:
        raise ValueError(f"unknown kind of system {kind!r}; there are: {', '.join(KINDS)}")
    if number < 0:
        raise ValueError(f"a case has a number of 0 or more, got {number}")
    random = np.random.default_rng([crc32(kind.encode()), number])
    return _KINDS[kind](kind, number, random)


def _physiological(kind: str, number: int, random: _Random) -> Case:
    """A joint of the paper, each parameter varied within physiological ranges."""
    joint = _varied_joint(random)
    return _driven(kind, number, random, System.of(joint), joint.range)


def _wide(kind: str, number: int, random: _Random) -> Case:
    """Every parameter of the muscle over its whole range, at the scale of a joint."""
    force = _log(random, 0.1, 1000)
    width = _log(random, 0.1, 10)
    muscles = {}
    for name in ("puller", "opponent"):
        muscles[name] = Hill(
            max_isometric_force=force * _log(random, 0.1, 10),
            optimal_length=float(random.uniform(-2, 2)),
            width_short=width * _log(random, 0.3, 3),
            width_long=width * _log(random, 0.3, 3),
            max_velocity=_log(random, 0.5, 500),
            hill_shape=_log(random, 0.05, 10),
            series_stretch=_log(random, 0.01, 3),
            series_shape=_log(random, 0.01, 10),
            excitation_tau=_log(random, 1e-3, 1),
            activation_tau=_log(random, 1e-3, 1),
            deactivation_tau=_log(random, 1e-3, 1),
            eccentric_plateau=float(random.uniform(1.01, 3)),
            eccentric_slope_ratio=_log(random, 0.05, 20),
            velocity_activation=float(random.uniform(0, 1)),
            viscosity=_log(random, 1e-6, 1),
            activation_floor=_log(random, 1e-6, 0.1),
            series_limit=float(random.uniform(1, 10)),
            electrical_stimulation=bool(random.random() < 0.3),
        )
    hinge = Coordinate(
        inertia=force / _log(random, 30, 10000),
        damping=force * _log(random, 1e-4, 1e-1),
        stiffness=force * _log(random, 1e-2, 3),
        rest=0.0,
        passive=Passive(
            k1_pos=force * _log(random, 1e-4, 0.3),
            k2_pos=_log(random, 0.5, 8),
            k1_neg=force * _log(random, 1e-4, 0.3),
            k2_neg=_log(random, 0.5, 8),
        ),
    )
    system = System(
        name="wide",
        coordinates={"hinge": hinge},
        muscles=muscles,
        arms={"puller": {"hinge": -1.0}, "opponent": {"hinge": 1.0}},
    )
    return _driven(kind, number, random, system, (-1.0, 1.0))


def _slide(kind: str, number: int, random: _Random) -> Case:
    """A mass on a slide between two muscles in metres and newtons, geared 0.4 to 2.5."""
    optimal = _log(random, 0.04, 0.25)  # of the fibres [m]
    force = _log(random, 50, 2000)
    gears = {"puller": -_log(random, 0.4, 2.5), "opponent": _log(random, 0.4, 2.5)}
    muscles = {name: _linear_muscle(random, optimal, force) for name in gears}
    travel = 0.4 * optimal
    stiffness = force / travel * _log(random, 0.03, 0.3)
    slide = Coordinate(
        inertia=force / _log(random, 20, 500),
        damping=force * _log(random, 0.01, 0.3),
        stiffness=stiffness,
        rest=float(random.uniform(-0.3, 0.3)) * travel,
        passive=Passive(
            k1_pos=force * _log(random, 1e-3, 0.1),
            k2_pos=_log(random, 1, 4) / travel,
            k1_neg=force * _log(random, 1e-3, 0.1),
            k2_neg=_log(random, 1, 4) / travel,
        ),
        slide=True,
    )
    system = System(
        name="slide",
        coordinates={"slide": slide},
        muscles=muscles,
        arms={name: {"slide": gear} for name, gear in gears.items()},
    )
    return _driven(kind, number, random, system, (-travel, travel))


def _several(kind: str, number: int, random: _Random) -> Case:
    """One or two hinges with three to five muscles, some across both."""
    joints = [_varied_joint(random)]
    if random.random() < 0.6:
        joints.append(_varied_joint(random, joints[0].name))
    coordinates, muscles, arms = {}, {}, {}
    for index, joint in enumerate(joints):
        system = System.of(joint)
        name = f"hinge{index}"
        coordinates[name] = system.coordinates[joint.name]
        for k, (muscle, gear) in enumerate(joint.gears.items()):
            muscles[f"m{index}{k}"] = joint.muscles[muscle]
            arms[f"m{index}{k}"] = {name: gear}
    for extra in range(int(random.integers(1, 4) if len(joints) == 1 else random.integers(2))):
        joint = joints[0]
        pulls = float(random.choice([-1.0, 1.0]))
        part = _varied_muscle(random, list(joint.hill_muscles.values())[0 if pulls < 0 else 1])
        share = _log(random, 0.2, 0.8)
        muscles[f"x{extra}"] = replace(part, max_isometric_force=share * part.max_isometric_force)
        arms[f"x{extra}"] = {name: pulls * _log(random, 0.6, 1.2) for name in coordinates}
    system = System(name="several", coordinates=coordinates, muscles=muscles, arms=arms)
    return _driven(kind, number, random, system, joints[0].range)


def _stretch(kind: str, number: int, random: _Random) -> Case:
    """One muscle on a hinge that is stretched and let go, sinusoidally or in ramps."""
    joint = _varied_joint(random)
    name, muscle = list(joint.hill_muscles.items())[int(random.integers(2))]
    peak = muscle.max_velocity * float(random.uniform(0.3, 1.0))
    frequency = _log(random, 3, 12)
    phase = float(random.choice([0.0, math.pi]))
    rate = 2 * math.pi * frequency
    start = muscle.optimal_length
    movement = Movement(
        lambda t: start + peak / rate * (math.cos(phase) - math.cos(rate * t + phase)),
        lambda t: peak * math.sin(rate * t + phase),
    )
    coordinate = Coordinate(inertia=joint.inertia)
    system = System(
        name="stretch",
        coordinates={"hinge": coordinate},
        muscles={name: muscle},
        arms={name: {"hinge": 1.0}},
    )
    tonic = float(random.choice([0.0, random.uniform(0, 1)]))
    return Case(
        kind, number, system_spec(system).compile(), system,
        {name: _excitation(random, tonic)}, {}, {"hinge": muscle.optimal_length},
        {name: tonic}, {"hinge": movement},
    )  # fmt: skip


def _spatial(kind: str, number: int, random: _Random) -> Case:
    """A limb of one or two hinges with muscles on tendons that bend over points and cylinders."""
    model, force = tendon_model(random, _linear_muscle)
    names = [model.actuator(i).name for i in range(model.nu)]
    tonic = {name: _tonic(random) for name in names}
    joint = model.joint(0).name
    return Case(
        kind, number, model, None,
        {name: _excitation(random, tonic[name]) for name in names},
        {joint: _push(random, force)},
        {model.joint(i).name: float(random.uniform(-0.3, 0.3)) for i in range(model.njnt)}, tonic,
    )  # fmt: skip


_KINDS: dict[str, Callable[[str, int, _Random], Case]] = {
    "physiological": _physiological,
    "wide": _wide,
    "slide": _slide,
    "several": _several,
    "spatial": _spatial,
    "stretch": _stretch,
}
KINDS = tuple(_KINDS)


def _driven(
    kind: str, number: int, random: _Random, system: System, reach: tuple[float, float]
) -> Case:
    """A case of a system that moves freely, with random inputs."""
    low, high = reach
    tonic = {name: _tonic(random) for name in system.muscles}
    largest = max(muscle.max_isometric_force for muscle in system.muscles.values())
    return Case(
        kind,
        number,
        system_spec(system).compile(),
        system,
        {name: _excitation(random, tonic[name]) for name in system.muscles},
        {next(iter(system.coordinates)): _push(random, largest)},
        {name: float(low + (high - low) * random.uniform(0.2, 0.8)) for name in system.coordinates},
        tonic,
    )


def _tonic(random: _Random) -> float:
    return float(random.choice([0.0, 0.0, random.uniform(0.02, 0.3), 1.0]))


def _excitation(random: _Random, tonic: float) -> Signal:
    """An excitation that leaves its tonic value: a step, pulses, or a sinusoid."""
    onset = _on_grid(random, 0.0, 0.2)
    target = float(random.choice([0.0, 1.0, random.uniform(0, 1)]))
    forms = {"hold": 0.1, "step": 0.3, "pulse": 0.25, "pulses": 0.2, "sinusoid": 0.15}
    form = random.choice(list(forms), p=list(forms.values()))
    if form == "hold":
        return as_signal(tonic)
    if form == "step":
        return as_signal(tonic) + pulse(target - tonic, onset, 10.0)
    if form == "pulse":
        return as_signal(tonic) + pulse(target - tonic, onset, _on_grid(random, 0.02, 0.3))
    if form == "pulses":
        total = as_signal(tonic)
        for _ in range(int(random.integers(2, 5))):
            width = _on_grid(random, 0.01, 0.08)
            total = total + pulse(float(random.uniform(0, 1)) - tonic, onset, width)
            onset = round(onset + width + _on_grid(random, 0.01, 0.1), 6)
        return total
    return sinusoid(0.5 * target, _log(random, 0.5, 6)) + 0.5 * target


def _push(random: _Random, force: float) -> Signal:
    """An external torque: none, a step, an impulse, or a sinusoid."""
    forms = {"none": 0.4, "step": 0.2, "impulse": 0.25, "sinusoid": 0.15}
    form = random.choice(list(forms), p=list(forms.values()))
    size = force * float(random.choice([-1, 1]))
    onset = _on_grid(random, 0.0, 0.3)
    if form == "step":
        return pulse(0.4 * size * float(random.uniform(0, 1)), onset, 10.0)
    if form == "impulse":
        return pulse(2 * size * float(random.uniform(0.1, 1)), onset, _on_grid(random, 0.01, 0.03))
    if form == "sinusoid":
        return sinusoid(0.3 * size * float(random.uniform(0, 1)), _log(random, 1, 10))
    return as_signal(0.0)


def _varied_joint(random: _Random, name: str | None = None) -> Joint:
    joint = JOINTS[name or str(random.choice(list(JOINTS)))]
    return replace(
        joint,
        inertia=joint.inertia * _log(random, 0.7, 3),
        damping=joint.damping * _log(random, 0.3, 2),
        stiffness=joint.stiffness * _log(random, 0.5, 2),
        muscles={key: _varied_muscle(random, muscle) for key, muscle in joint.hill_muscles.items()},
    )


def _varied_muscle(random: _Random, muscle: Hill) -> Hill:
    """A muscle within the ranges of eq. 12 and Table 1 of Winters & Stark (1987), and beyond."""
    return replace(
        muscle,
        max_isometric_force=muscle.max_isometric_force * _log(random, 0.5, 2),
        optimal_length=muscle.optimal_length + 0.3 * muscle.width_short * _either(random),
        width_short=muscle.width_short * _log(random, 0.7, 1.5),
        width_long=muscle.width_long * _log(random, 0.7, 1.5),
        max_velocity=muscle.max_velocity * _log(random, 0.5, 2),
        series_stretch=muscle.series_stretch * _log(random, 0.5, 2),
        **_shape(random),
    )


def _linear_muscle(random: _Random, optimal: float, force: float) -> Hill:
    """A muscle in metres and newtons, from an optimal fibre length [m] and a typical force [N]."""
    return Hill(
        max_isometric_force=force * _log(random, 0.5, 2),
        optimal_length=optimal * float(random.uniform(-0.2, 0.2)),
        width_short=optimal * float(random.uniform(0.35, 0.6)),
        width_long=optimal * float(random.uniform(0.35, 0.6)),
        max_velocity=optimal * _log(random, 2, 12),
        series_stretch=optimal * _log(random, 0.05, 0.3),
        **_shape(random),
    )


def _shape(random: _Random) -> dict[str, Any]:
    """Time constants and shapes, which have no unit of length or force."""
    return {
        "hill_shape": float(random.uniform(0.1, 0.5)),
        "series_shape": float(random.uniform(2, 4)),
        "excitation_tau": _log(random, 0.02, 0.05),
        "activation_tau": _log(random, 0.005, 0.015),
        "deactivation_tau": _log(random, 0.02, 0.06),
        "eccentric_plateau": float(random.uniform(1.1, 1.8)),
        "eccentric_slope_ratio": _log(random, 1, 6),
        "velocity_activation": float(random.choice([0.0, random.uniform(0, 0.75)])),
        "viscosity": _log(random, 1e-3, 1e-2),
        "activation_floor": _log(random, 1e-3, 1e-2),
        "electrical_stimulation": bool(random.random() < 0.15),
    }


def _either(random: _Random) -> float:
    return float(random.uniform(-1, 1))


def _log(random: _Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


def _on_grid(random: _Random, low: float, high: float) -> float:
    return round(GRID * round(float(random.uniform(low, high)) / GRID), 6)
