"""Time of a step with mjhill's muscles, with MuJoCo's and with none, in one interleaved run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.comparison.native import compiled, converted, native_spec, read_spec
from mjhill.engine.install import Backend, installed
from mjhill.engine.layout import muscle_names
from mjhill.muscles.parts import Contractile
from mjhill.simulate.run import check_warnings

_INTEGRATORS = tuple(mujoco.mjtIntegrator.__members__.values())
_EXCITATION = 0.3  # of one muscle; the others have a tenth of it


@dataclass(frozen=True)
class StepCost:
    """Time of a step [µs]: medians over the rounds, and half of their interquartile ranges.

    The time that a muscle adds and the ratio are computed within each round, in which the
    machine's speed is the same; the medians are taken afterwards.

    Attributes:
        bare: With motors instead of muscles.
        native: With MuJoCo's muscles.
        mjhill: With mjhill's muscles.
        bare_spread: Half of the interquartile range of ``bare``.
        native_spread: The same of ``native``.
        mjhill_spread: The same of ``mjhill``.
        native_per_muscle: Time that one of MuJoCo's muscles adds to the bare step [µs].
        mjhill_per_muscle: Time that one of mjhill's muscles adds [µs].
        ratio: A whole step with mjhill's muscles over one with MuJoCo's [-].
        muscles: Muscles in the model.
        muscle: Name of the muscle model that takes the place of ``hill``.
        rounds: Timed blocks of each model.
        steps: Steps in a block.
        backend: The back-end of mjhill's muscles.
        integrator: MuJoCo's integrator.
    """

    bare: float
    native: float
    mjhill: float
    bare_spread: float
    native_spread: float
    mjhill_spread: float
    native_per_muscle: float
    mjhill_per_muscle: float
    ratio: float
    muscles: int
    rounds: int
    steps: int
    backend: Backend
    integrator: str

    def as_dict(self) -> dict[str, Any]:
        """All values, ready for JSON."""
        return asdict(self)


def step_cost(
    model: str | Path = "elbow",
    *,
    muscle: str | None = None,
    rounds: int = 1000,
    steps: int = 200,
    backend: Backend = "compiled",
    integrator: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> StepCost:
    """Time steps of the bare plant, with MuJoCo's muscles and with mjhill's: A B C A B C ...

    Each round times one block of steps of each model, so that a slower machine slows all three.
    The excited muscle changes from block to block, so the joint moves. mjhill's callbacks are
    installed all the time: all three models have the joint's exponential elasticity.

    Args:
        model: A joint's name, such as ``"elbow"``, or a path to an MJCF file.
        muscle: Name of the muscle model that takes the place of ``hill``.
        rounds: Timed blocks of each model.
        steps: Steps in a block.
        backend: The back-end of mjhill's muscles.
        integrator: MuJoCo's integrator, such as ``"Euler"``; by default the model's own.
        progress: Called now and then with the share done, 0 to 1.

    Raises:
        ValueError: ``rounds`` or ``steps`` is less than 1, the integrator is unknown, or as
            ``native_model``.
        RuntimeError: MuJoCo warned of a bad state.
    """
    for what, value in (("rounds", rounds), ("steps", steps)):
        if value < 1:
            raise ValueError(f"{what} must be at least 1, got {value}")
    spec = read_spec(model, muscle)
    if integrator is not None:
        spec.option.integrator = _integrator(integrator)
    models = [compiled(kind) for kind in (bare_spec(spec), native_spec(spec), spec)]
    with installed(backend):
        times = _time_blocks(models, rounds, steps, progress)
    per_step = 1e6 * times / steps
    low, middle, high = np.quantile(per_step, [0.25, 0.5, 0.75], axis=0).tolist()
    names = ("bare", "native", "mjhill")
    spreads = [0.5 * (top - bottom) for top, bottom in zip(high, low, strict=True)]
    muscles = len(muscle_names(models[-1]))
    bare, native, ours = per_step.T
    return StepCost(
        **dict(zip(names, middle, strict=True)),
        **dict(zip([f"{name}_spread" for name in names], spreads, strict=True)),
        native_per_muscle=float(np.median(native - bare)) / muscles,
        mjhill_per_muscle=float(np.median(ours - bare)) / muscles,
        ratio=float(np.median(ours / native)),
        muscles=muscles,
        rounds=rounds,
        steps=steps,
        backend=backend,
        integrator=_integrator_name(models[-1].opt.integrator),
    )


def _time_blocks(
    models: list[mujoco.MjModel],
    rounds: int,
    steps: int,
    progress: Callable[[float], None] | None,
) -> NDArray[np.float64]:
    """Time [s] of each block of steps, shape (rounds, number of models)."""
    datas = [mujoco.MjData(model) for model in models]
    times = np.empty((rounds, len(models)))
    for block in range(-3, rounds):  # three to warm up, overwritten by the first
        for kind, (model, data) in enumerate(zip(models, datas, strict=True)):
            data.ctrl[:] = 0.1 * _EXCITATION
            data.ctrl[block % model.nu] = _EXCITATION
            start = time.perf_counter()
            mujoco.mj_step(model, data, nstep=steps)
            times[max(block, 0), kind] = time.perf_counter() - start
        if progress is not None and block >= 0:
            progress((block + 1) / rounds)
    for data in datas:
        check_warnings(data)
    return times


def bare_spec(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """A copy of a model in which a motor of the same strength replaces each mjhill muscle.

    Raises:
        ValueError: The model has no mjhill muscle.
    """

    def convert(actuator: mujoco.MjsActuator, muscle: Contractile, length0: float) -> None:
        del length0
        gear = -float(actuator.gear[0]) * muscle.max_isometric_force
        actuator.set_to_motor()
        actuator.actdim = -1  # left to the compiler
        actuator.gear = [gear, 0, 0, 0, 0, 0]
        for row in (actuator.dynprm, actuator.biasprm):
            row[:] = 0.0
        actuator.gainprm = [1.0] + [0.0] * 9

    return converted(spec, convert, states=0)


def _integrator_name(value: int) -> str:
    return str(mujoco.mjtIntegrator(value).name).removeprefix("mjINT_").lower()


def _integrator(name: str) -> int:
    known = {_integrator_name(int(each)): int(each) for each in _INTEGRATORS}
    if name.lower() not in known:
        raise ValueError(f"unknown integrator {name!r}; there are: {', '.join(known)}")
    return known[name.lower()]
