"""MuJoCo's own ``<muscle>`` in the place of mjhill's, matched as far as its parameters allow.

MuJoCo's muscle is a force on a rigid tendon with one state. Its force at length L and velocity
V is ``F_max a FL(L) FV(V)`` with FL a bump of four parabolas and FV a parabola
(``mju_muscleGain``); its activation is one lag whose time constants depend on the activation
(``mju_muscleDynamics``, after Millard et al. 2013).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from mjhill.engine.install import without_python_callbacks
from mjhill.engine.layout import actuator_names, addresses, model_of_actuator, read_muscle
from mjhill.engine.spec import with_muscles
from mjhill.joints.reader import JOINTS
from mjhill.muscles import contractile_of
from mjhill.muscles.parts import Contractile
from mjhill.simulate.load import load, model_path

_LMIN = 0.5  # MuJoCo's default; it fixes the unit of length, not the curve
_UNUSED = 1.0  # scale and fpmax: without effect here, but the compiler wants them positive
_HALF_HEIGHT = math.sqrt(math.log(2))  # deviation, in Gaussian widths, at half of the peak


@dataclass(frozen=True)
class NativeMuscle:
    """Parameters of MuJoCo's muscle.

    Attributes:
        force: Maximum isometric force [N·m or N].
        unit_length: MuJoCo's L0, the unit of its length axis [rad or m]; 1 is the optimum.
        lmin: Length below which there is no active force [L0].
        lmax: Length above which there is none [L0].
        vmax: Shortening velocity without load [L0/s].
        fvmax: Force in fast lengthening, in units of isometric force [-].
        activation_tau: ``timeconst[0]`` [s].
        deactivation_tau: ``timeconst[1]`` [s].
    """

    force: float
    unit_length: float
    lmin: float
    lmax: float
    vmax: float
    fvmax: float
    activation_tau: float
    deactivation_tau: float


def native_muscle(muscle: Contractile) -> NativeMuscle:
    """The parameters of MuJoCo's muscle that come nearest to a muscle of mjhill.

    Its bump is half as high midway between the optimum and either end, so the ends lie twice as
    far from the optimum as the Gaussian's half height. Its time constants are those with which a
    full step of the control takes activation 63 % of the way in the same time.
    """
    unit = 2 * _HALF_HEIGHT * muscle.width_short / (1 - _LMIN)
    rise, fall = (muscle_delay(muscle, rising=rising) for rising in (True, False))
    return NativeMuscle(
        force=muscle.max_isometric_force,
        unit_length=unit,
        lmin=_LMIN,
        lmax=1 + 2 * _HALF_HEIGHT * muscle.width_long / unit,
        vmax=muscle.max_velocity / unit,
        fvmax=muscle.eccentric_plateau,
        activation_tau=rise / native_delay(1.0, rising=True),
        deactivation_tau=fall / native_delay(1.0, rising=False),
    )


def muscle_delay(muscle: Contractile, *, rising: bool) -> float:
    """Time [s] that activation takes for 1 - 1/e of the way after a step of the control.

    The lags in series are linear both ways, so the size of the step does not matter.
    """
    tau = muscle.activation_tau if rising else muscle.deactivation_tau
    if muscle.electrical_stimulation:
        return tau
    from scipy.optimize import brentq

    first, second = sorted((muscle.excitation_tau, tau))
    # it takes as long as the longer lag, and 1.073 of the sum where both are equal
    span = second, 2 * (first + second)
    left = partial(_two_lags_left, first=first, second=second)
    return float(brentq(lambda time: left(time) - math.exp(-1), *span, xtol=1e-15))


def _two_lags_left(time: float, first: float, second: float) -> float:
    """What is left of a step after two lags in series [-], ``first <= second``."""
    if second - first < 1e-6 * second:
        return (1 + time / second) * math.exp(-time / second)
    slow, fast = second * math.exp(-time / second), first * math.exp(-time / first)
    return (slow - fast) / (second - first)


def native_delay(excitation: float, *, rising: bool) -> float:
    """That time for MuJoCo's muscle between 0 and ``excitation``, in units of its time constant.

    The integral of ``tau(a)/(u - a)`` with ``tau(a) = 0.5 + 1.5 a`` on the way up from 0, and
    ``1/(0.5 + 1.5 a)`` on the way down to 0 (``mju_muscleDynamics``).
    """
    left = math.exp(-1)
    if rising:
        return 0.5 + 1.5 * excitation - 1.5 * excitation * (1 - left)
    return 2 * (1 + math.log((0.5 + 1.5 * excitation * left) / (0.5 + 1.5 * excitation)))


def native_model(model: str | Path) -> mujoco.MjModel:
    """A model with MuJoCo's muscles in the place of mjhill's.

    Args:
        model: A joint's name, such as ``"elbow"``, or a path to an MJCF file.

    Raises:
        ValueError: As ``mjhill.load``; or the file is not MJCF, or has no mjhill muscle.
    """
    return compiled(native_spec(read_spec(model)))


def native_spec(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """A copy of a model with MuJoCo's muscles in the place of mjhill's; all else is kept.

    Name, joint or tendon, gear and control range stay as they are, as does the joint's passive
    elasticity: its exponential part comes from mjhill's passive callback, as before. Keyframes keep
    the activation.

    Raises:
        ValueError: The model has no mjhill muscle.
    """

    def convert(actuator: mujoco.MjsActuator, muscle: Contractile, length0: float) -> None:
        native = native_muscle(muscle)
        optimum = length0 + muscle.optimal_length
        ends = [(end - 1) * native.unit_length for end in (native.lmin, native.lmax)]
        actuator.dyntype = mujoco.mjtDyn.mjDYN_MUSCLE
        actuator.gaintype = mujoco.mjtGain.mjGAIN_MUSCLE
        # fpmax must be positive for the compiler; without a bias there is no passive force
        actuator.biastype = mujoco.mjtBias.mjBIAS_NONE
        actuator.actdim = 1
        # given, so that the compiler does not simulate to find it
        actuator.lengthrange = [optimum + end for end in ends]
        actuator.dynprm = _row(native.activation_tau, native.deactivation_tau)
        actuator.gainprm = _row(
            native.lmin, native.lmax, native.force, _UNUSED, native.lmin, native.lmax,
            native.vmax, _UNUSED, native.fvmax,
        )  # fmt: skip
        actuator.biasprm = np.zeros(10)

    return converted(spec, convert, states=1)


def converted(
    spec: mujoco.MjSpec,
    convert: Callable[[mujoco.MjsActuator, Contractile, float], None],
    *,
    states: int,
) -> mujoco.MjSpec:
    """A copy of a model whose muscles were turned into something else.

    Args:
        spec: The model; stays as it is.
        convert: Called with each actuator that is a muscle, its parameters and its length at
            ``qpos0``; changes the actuator.
        states: Activations of the new actuator: 1, or 0 for none.

    Raises:
        ValueError: The model has no mjhill muscle.
    """
    model, result = compiled(spec), spec.copy()
    muscles: Mapping[str, tuple[Contractile, float]] = {
        name: (contractile_of(read_muscle(model, name)), float(model.actuator_length0[at.out]))
        for name, at in addresses(model)
    }
    if not muscles:
        raise ValueError("the model has no mjhill muscle; add one with mjhill.add_muscle")
    for name, actuator in zip(actuator_names(model), result.actuators, strict=True):
        if name in muscles:
            convert(actuator, *muscles[name])
    kept = _kept_states(model, states)
    for key in result.keys:
        if len(key.act) > 0:  # without them the compiler fills in its own
            key.act = [key.act[i] for i in kept]
    return result


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a copy of a model, which also works while Python callbacks are installed."""
    with without_python_callbacks():
        return spec.copy().compile()


def read_spec(model: str | Path, muscle: str | None = None) -> mujoco.MjSpec:
    """The spec of a joint's model or of an MJCF file, checked as ``mjhill.load`` checks it.

    Args:
        model: A joint's name, or a path.
        muscle: Name of the muscle model that takes the place of ``hill``; see ``mjhill.load``.

    Raises:
        ValueError: As ``mjhill.load``; or the file is not MJCF.
    """
    load(model, muscle)
    path = model_path(str(model)) if str(model) in JOINTS else Path(model)
    if path.suffix == ".mjb":
        raise ValueError(f"{path}: a binary model cannot be changed; give its MJCF file (.xml)")
    spec = mujoco.MjSpec.from_file(str(path))
    return spec if muscle is None else with_muscles(spec, muscle)


def _kept_states(model: mujoco.MjModel, states: int) -> list[int]:
    """Indices into ``act`` of what is kept: a of each muscle, all of everything else."""
    kept: list[int] = []
    for i in range(model.nactuator):
        first = int(model.actuator_actadr[i])
        kind = model_of_actuator(model, i)
        if kind is not None:
            kept += [first + kind.state_names.index(kind.activation)][:states]
        else:
            kept += range(first, first + int(model.actuator_actnum[i]))
    return kept


def _row(*values: float) -> np.ndarray:
    return np.array([*values, *[0.0] * (10 - len(values))])
