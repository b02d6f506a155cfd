"""Which properties of MuJoCo's muscle equal those of mjhill's, and which cannot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import mujoco

from mjhill.comparison.native import (
    NativeMuscle,
    compiled,
    muscle_delay,
    native_delay,
    native_spec,
    read_spec,
)
from mjhill.elements import hill_relation
from mjhill.engine.layout import address, muscle_names, read_muscle
from mjhill.muscles import contractile_of
from mjhill.muscles.hill import Hill
from mjhill.muscles.parts import Contractile

_PART = 0.5  # control at which the size dependence of MuJoCo's activation is shown


@dataclass(frozen=True)
class Match:
    """One quantity of one muscle, in both models.

    Attributes:
        muscle: The actuator's name.
        quantity: What it is.
        unit: Its unit.
        mjhill: Its value in mjhill's muscle; None if it is not a number.
        native: Its value in MuJoCo's muscle; None if it is not a number.
        how: How the values were matched, or why they could not be.
    """

    muscle: str
    quantity: str
    unit: str
    mjhill: float | None
    native: float | None
    how: str


def matching(model: str | Path, muscle: str | None = None) -> tuple[Match, ...]:
    """The matched and the unmatched quantities of each muscle of a model.

    The values of MuJoCo's muscle are read back from its compiled model.

    Args:
        model: A joint's name, such as ``"elbow"``, or a path to an MJCF file.
        muscle: Name of the muscle model that takes the place of ``hill``.

    Raises:
        ValueError: As ``native_model``.
    """
    spec = read_spec(model, muscle)
    ours, native = compiled(spec), compiled(native_spec(spec))
    rows: list[Match] = []
    for name in muscle_names(ours):
        units = _units(ours, name)
        one, other = contractile_of(read_muscle(ours, name)), read_native(native, name)
        rows += _matched(name, one, other, _optimum(native, name), units)
        rows += _unmatched(name, one, other, units)
    return tuple(rows)


def read_native(model: mujoco.MjModel, name: str) -> NativeMuscle:
    """The parameters of a MuJoCo muscle, from the model's arrays.

    Raises:
        KeyError: No actuator has this name.
    """
    i = model.actuator(name).id
    out = int(model.actuator_outadr[i])
    start, end, force, _, lmin, lmax, vmax, _, fvmax = model.actuator_gainprm[i, :9].tolist()
    low, high = model.actuator_lengthrange[out].tolist()
    rise, fall = model.actuator_dynprm[i, :2].tolist()
    return NativeMuscle(force, (high - low) / (end - start), lmin, lmax, vmax, fvmax, rise, fall)


def _optimum(model: mujoco.MjModel, name: str) -> float:
    """Length of largest active force, from that at ``qpos0``: where MuJoCo's scaled length is 1."""
    i = model.actuator(name).id
    out = int(model.actuator_outadr[i])
    unit = read_native(model, name).unit_length
    low = float(model.actuator_lengthrange[out, 0])
    zero = float(model.actuator_length0[out])
    return low + (1 - float(model.actuator_gainprm[i, 0])) * unit - zero


def _units(model: mujoco.MjModel, name: str) -> tuple[str, str]:
    """Units of the force and length of a muscle."""
    i = address(model, name).actuator
    joint = model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
    hinge = joint and model.jnt_type[model.actuator_trnid[i, 0]] == mujoco.mjtJoint.mjJNT_HINGE
    return ("N·m", "rad") if hinge else ("N", "m")


def _matched(
    name: str, ours: Contractile, native: NativeMuscle, optimum: float, units: tuple[str, str]
) -> list[Match]:
    force, length = units
    unit, half = native.unit_length, math.sqrt(math.log(2))
    below, above = 0.5 * (1 - native.lmin) * unit, 0.5 * (native.lmax - 1) * unit
    rise, fall = (native_delay(1.0, rising=rising) for rising in (True, False))
    rows = (
        (
            "maximum isometric force", force, ours.max_isometric_force, native.force,
            "force, given, so that scale is not used",
        ),
        ("optimal length from qpos0", length, ours.optimal_length, optimum, "lengthrange"),
        (
            "half of the force, below the optimum by", length, half * ours.width_short, below,
            "lmin: the bump is half as high midway to its end",
        ),
        (
            "half of the force, above the optimum by", length, half * ours.width_long, above,
            "lmax: the same",
        ),
        (
            "shortening velocity without load", f"{length}/s", ours.max_velocity,
            native.vmax * unit, "vmax",
        ),
        ("force in fast lengthening", "F_max", ours.eccentric_plateau, native.fvmax, "fvmax"),
        (
            "63 % of activation, step 0 to 1", "s", muscle_delay(ours, rising=True),
            rise * native.activation_tau, "timeconst: two lags against one that depends on a",
        ),
        (
            "63 % of deactivation, step 1 to 0", "s", muscle_delay(ours, rising=False),
            fall * native.deactivation_tau, "timeconst: the same",
        ),
        (
            "passive elasticity", "-", None, None,
            "the joint's in both; the muscle's own (fpmax) is left out",
        ),
    )  # fmt: skip
    return [Match(name, *row) for row in rows]


def _unmatched(
    name: str, ours: Contractile, native: NativeMuscle, units: tuple[str, str]
) -> list[Match]:
    stretch = ours.series_stretch if isinstance(ours, Hill) else 0.0
    rise = native_delay(_PART, rising=True) * native.activation_tau
    no = "not matched: "
    rows = (
        (
            "force at half of that velocity", "F_max", hill_relation(0.5, ours.hill_shape), 0.25,
            no + "Hill's A; MuJoCo's curve is one parabola (1 - v)^2",
        ),
        (
            "series element, stretch at F_max", units[1], stretch, 0.0,
            no + "MuJoCo's tendon is rigid",
        ),
        (
            "activation states", "-", 1.0 if ours.electrical_stimulation else 2.0, 1.0,
            no + "MuJoCo has no excitation lag, so its force starts to rise at once",
        ),
        (
            f"63 % of activation, step 0 to {_PART:g}", "s", muscle_delay(ours, rising=True), rise,
            no + "MuJoCo's time constant depends on activation",
        ),
        (
            "force at twice the half-force length", "F_max", 1 / 16, 0.0,
            no + "the bump ends there, the Gaussian does not",
        ),
    )  # fmt: skip
    return [Match(name, *row) for row in rows]
