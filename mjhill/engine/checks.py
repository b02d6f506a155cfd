"""Checks of a model before it runs: a compiled callback cannot raise an error."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.engine.layout import (
    NUSER_JNT,
    PASSIVE_TAG,
    SCALAR_JOINTS,
    Group,
    actuator_names,
    has_tag,
    ids_of,
    in_order,
    joint_names,
    moments,
    muscle_groups,
    read_muscles,
    read_passive,
    state_count,
)
from mjhill.engine.stability import Plant
from mjhill.muscles import BY_TAG
from mjhill.quantity import flags, quantities

# stiffness, in units of what a timestep can hold: from where forces ring, and from where 5 % may
# be lost; docs/numerics.md says how they were chosen
RINGING, COARSE = 0.7, 0.3
# timesteps a period below which a movement with little damping may be off by 5 %; under
# "discrete" it is off two to three times as much as under others
STEPS, STEPS_DISCRETE = 12, 30
# custom numeric with the options that a model is made for: gravity, timestep, integrator
MADE_FOR = "mjhill_made_for"

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """Something about a model that makes its results doubtful.

    Attributes:
        subject: What it is about: a joint or a muscle, and its name.
        problem: What is wrong with it, and the effect.
        remedy: What to do.
        severe: Whether results are meaningless, not only off by more than 5 %.
        timestep: The timestep [s] that would do, where it is too long.
    """

    subject: str
    problem: str
    remedy: str
    severe: bool
    timestep: float | None = None

    def __str__(self) -> str:
        """The finding as a sentence, with the remedy."""
        return f"{self.subject}: {self.problem}; {self.remedy}"


def check_model(model: mujoco.MjModel) -> tuple[Finding, ...]:
    """Check every muscle and passive elasticity of a model, and its timestep.

    Returns:
        What makes the results of a model in order doubtful. Over random systems
        (``mjhill bench sweep``), none without a finding was off by more than 5 % of its range,
        or 1.5 times what MuJoCo's own step of the joint is off.

    Raises:
        ValueError: An actuator is half a muscle or has no gear, a parameter is outside its
            bounds, a muscle model cannot follow RK4, a passive elasticity is incomplete or on a
            joint that cannot have one, or the timestep is not positive.

    Warns:
        RuntimeWarning: A finding is severe.
    """
    names = actuator_names(model)
    groups = muscle_groups(model)
    muscles = ids_of(groups)
    half = has_tag(model)
    half[muscles] = ~_whole(model)[muscles]
    for actuator in np.flatnonzero(half).tolist():
        _check_marks(model, actuator, names[actuator])
    if not all(map(_in_bounds, groups)):
        read_muscles(model)  # says which
    _check_gears(model, muscles, names)
    _check_elasticities(model)
    _check_stages(model, groups, names)
    timestep = float(model.opt.timestep)
    if not (math.isfinite(timestep) and timestep > 0):
        raise ValueError(f"timestep must be positive, got {timestep} s; set model.opt.timestep")
    findings = (
        *_fast_joints(model, names),
        *_fast_activation(model, groups, names),
        *_pushing(model, muscles, names),
        *_clipped(model, groups, muscles, names),
        *_powerless(model, muscles, names),
        *_cut_off(model, groups, muscles),
        *_made_otherwise(model),
    )
    for finding in findings:
        if finding.severe:
            warnings.warn(str(finding), RuntimeWarning, stacklevel=2)
    return findings


def _whole(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which actuators have all else that makes a tagged one a muscle."""
    return np.asarray(
        # as whole numbers: arrays compare with them a hundred times faster than with enums
        (model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_USER))
        & (model.actuator_gaintype == int(mujoco.mjtGain.mjGAIN_FIXED))
        & (model.actuator_biastype == int(mujoco.mjtBias.mjBIAS_USER))
        & (model.actuator_gainprm[:, 0] == 0)
        & (model.actuator_actlimited == 0)
        & (model.actuator_outnum == 1)
    )


def _check_marks(model: mujoco.MjModel, actuator: int, name: str) -> None:
    """Say what a tagged actuator lacks of a muscle."""
    tag = float(model.actuator_dynprm[actuator, 0])
    if tag not in BY_TAG:
        known = ", ".join(f"{known:.0f} ({kind.name})" for known, kind in BY_TAG.items())
        raise ValueError(
            f"actuator {name!r} has the tag dynprm[0] = {tag:.0f}, of a muscle model that this "
            f"mjhill does not know; there are: {known}; a newer mjhill may know it"
        )
    kind, states = BY_TAG[tag], int(state_count(model, BY_TAG[tag], actuator))
    wanted = [
        ("dyntype", mujoco.mjtDyn(int(model.actuator_dyntype[actuator])), mujoco.mjtDyn.mjDYN_USER),
        (
            "gaintype",
            mujoco.mjtGain(int(model.actuator_gaintype[actuator])),
            mujoco.mjtGain.mjGAIN_FIXED,
        ),
        (
            "biastype",
            mujoco.mjtBias(int(model.actuator_biastype[actuator])),
            mujoco.mjtBias.mjBIAS_USER,
        ),
        ("actdim", int(model.actuator_actnum[actuator]), states),
        ("gainprm[0]", float(model.actuator_gainprm[actuator, 0]), 0.0),
        ("actlimited", bool(model.actuator_actlimited[actuator]), False),
        ("number of outputs", int(model.actuator_outnum[actuator]), 1),
    ]
    for what, found, needed in wanted:
        if found != needed:
            raise ValueError(
                f"actuator {name!r} is half a mjhill muscle: it has the tag "
                f"dynprm[0] = {tag:.0f} of the model {kind.name!r} but {what} is {_word(found)}, "
                f"not {_word(needed)}; set it, or add the muscle with mjhill.add_muscle"
            )


def _word(value: object) -> str:
    return str(getattr(value, "name", value)).rpartition("_")[2].lower()


def _in_bounds(group: Group) -> bool:
    """Whether the parameters of all muscles of a model are inside their bounds."""
    kind, good = group.model.parameters, np.ones(len(group.actuators), bool)
    for name in flags(kind):
        good &= (group.columns[name] == 0) | (group.columns[name] == 1)
    for name, quantity in quantities(kind):
        values = group.columns[name]
        above = values >= quantity.low if quantity.low_allowed else values > quantity.low
        good &= above & (values <= quantity.high)  # not so for NaN
    return bool(good.all())


def _check_stages(model: mujoco.MjModel, groups: list[Group], names: list[str]) -> None:
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return
    for group in groups:
        if not group.model.staged:
            raise ValueError(
                f"muscle {names[int(group.actuators[0])]!r} is of the model {group.model.name!r}, "
                "which RK4 cannot follow; set model.opt.integrator to implicitfast, implicit, "
                "Euler or discrete"
            )


def _check_gears(model: mujoco.MjModel, muscles: list[int], names: list[str]) -> None:
    gears = model.actuator_gear[model.actuator_outadr[muscles]]
    bad = ~np.isfinite(gears).all(axis=1) | ~gears.any(axis=1)
    for row in np.flatnonzero(bad).tolist():
        shown = " ".join(f"{value:g}" for value in gears[row])
        raise ValueError(
            f"muscle {names[muscles[row]]!r}: gear must be finite and not 0, got {shown}; "
            "with gear 0 it has no length and moves nothing"
        )


def _check_elasticities(model: mujoco.MjModel) -> None:
    if not model.nuser_jnt:
        return
    tagged = np.flatnonzero(model.jnt_user[:, 0] == PASSIVE_TAG).tolist()
    names = joint_names(model) if tagged else []
    for joint in tagged:
        if model.nuser_jnt < NUSER_JNT:
            raise ValueError(
                f"joint {names[joint]!r}: the user data of mjhill's passive elasticity has "
                f"{NUSER_JNT} numbers, and the model keeps {model.nuser_jnt} for each joint; "
                f"give all {NUSER_JNT}, or use mjhill.add_passive"
            )
        if model.jnt_type[joint] not in SCALAR_JOINTS:
            raise ValueError(
                f"joint {names[joint]!r}: passive elasticity needs a hinge or slide joint"
            )
        read_passive(model, names[joint])


def _fast_joints(model: mujoco.MjModel, names: list[str]) -> Iterator[Finding]:
    """Findings on joints that muscles make too stiff for the timestep, one for each joint."""
    timestep = float(model.opt.timestep)
    discrete = model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE
    steps = STEPS_DISCRETE if discrete else STEPS
    parts = Plant.parts(model)
    overloads = [mode for part in parts for mode in part.overloads(timestep, COARSE)]
    swings = [swing for part in parts for swing in part.swings(2 * math.pi / (steps * timestep))]
    if not overloads and not swings:
        return
    enough = min(part.longest(timestep, COARSE) for part in parts)
    enough = min([enough, *(0.999 * swing.period / steps for swing in swings)])
    remedy = f"set model.opt.timestep to {_rounded_down(enough):g} s or less"
    joints, found = joint_names(model), dict[int, Finding]()
    for mode in sorted(overloads, key=lambda mode: -mode.load):
        severe = mode.load >= RINGING
        effect = (
            f"and from {RINGING:g} on forces ring from step to step, and above 1 ever more"
            if severe
            else f"and from {COARSE:g} on results may be off by 5 %"
        )
        muscles = ", ".join(repr(names[muscle]) for muscle in mode.muscles)
        what = f"with its muscles at full force ({muscles}) its stiffness" if muscles else "damping"
        problem = (
            f"{what} is {mode.load:.2g} of what a timestep of {timestep:g} s can hold, {effect}"
        )
        subject = f"joint {joints[mode.joint]!r}"
        found.setdefault(mode.joint, Finding(subject, problem, remedy, severe, enough))
    for swing in swings:
        problem = (
            f"with its muscles at full force it swings with little damping and a period of "
            f"{swing.period:.2g} s, {swing.period / timestep:.2g} timesteps; below {steps} results "
            "may be off by 5 %"
        )
        subject = f"joint {joints[swing.joint]!r}"
        found.setdefault(swing.joint, Finding(subject, problem, remedy, False, enough))
    yield from found.values()


def _rounded_down(timestep: float) -> float:
    """A timestep [s] with two digits, no longer than the given one."""
    unit = 10.0 ** (math.floor(math.log10(timestep)) - 1)
    return math.floor(timestep / unit * (1 + 1e-12)) * unit


def _fast_activation(
    model: mujoco.MjModel, groups: list[Group], names: list[str]
) -> Iterator[Finding]:
    """Findings on time constants that RK4 cannot follow; other integrators are exact there."""
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return
    timestep = float(model.opt.timestep)
    for group in groups:
        for what, taus in group.ask(group.model.time_constants).items():
            for row in np.flatnonzero(timestep > taus).tolist():
                tau = float(taus[row])
                yield Finding(
                    f"muscle {names[int(group.actuators[row])]!r}",
                    f"timestep over {what} is {timestep / tau:.3g}, past 1, so RK4 slows it down "
                    "and the result may be off by 5 %",
                    f"set model.opt.timestep to {tau:.2g} s or less, or another integrator",
                    False,
                    tau,
                )


def _pushing(model: mujoco.MjModel, muscles: list[int], names: list[str]) -> Iterator[Finding]:
    """Findings on muscles that push: their tendon's length counts backwards."""
    gears = model.actuator_gear[model.actuator_outadr[muscles], 0]
    on_tendon = model.actuator_trntype[muscles] == int(mujoco.mjtTrn.mjTRN_TENDON)
    for row in np.flatnonzero(on_tendon & (gears < 0)).tolist():
        actuator, gear = muscles[row], float(gears[row])
        first = int(model.tendon_adr[model.actuator_trnid[actuator, 0]])
        # a fixed tendon is a sum of joint angles, whose sign is free
        if model.wrap_type[first] != mujoco.mjtWrap.mjWRAP_JOINT:
            yield Finding(
                f"muscle {names[actuator]!r}",
                f"its gear on the tendon is {gear:g}, so it pushes where a muscle pulls",
                "make the gear positive",
                True,
            )


def _clipped(
    model: mujoco.MjModel, groups: list[Group], muscles: list[int], names: list[str]
) -> Iterator[Finding]:
    """Findings on muscles whose force MuJoCo limits; the muscle's states do not follow that."""
    outs = model.actuator_outadr[muscles]
    limited = model.actuator_forcelimited[outs].astype(bool)
    if not limited.any():
        return
    largest, _ = in_order(groups, "lengthening")
    low, high = model.actuator_forcerange[outs].T
    for row in np.flatnonzero(limited & ((low > -largest) | (high < 0))).tolist():
        yield Finding(
            f"muscle {names[muscles[row]]!r}",
            f"its forcerange, {low[row]:g} to {high[row]:g}, cuts off forces that its tendon "
            f"carries (tension is negative, to {-largest[row]:.3g})",
            "take the forcerange away",
            True,
        )


def _powerless(model: mujoco.MjModel, muscles: list[int], names: list[str]) -> Iterator[Finding]:
    """Findings on muscles whose force MuJoCo leaves out."""
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_ACTUATION):
        yield Finding(
            "the model",
            "actuation is disabled, so no muscle exerts a force",
            "clear the flag mjDSBL_ACTUATION in model.opt.disableflags",
            True,
        )
    if not model.opt.disableactuator:
        return
    for actuator in muscles:
        group = int(model.actuator_group[actuator])
        # MuJoCo can disable groups 0 to 30
        if 0 <= group <= 30 and model.opt.disableactuator >> group & 1:
            yield Finding(
                f"muscle {names[actuator]!r}",
                f"its group {group} is disabled, so it exerts no force",
                "enable the group in model.opt.disableactuator",
                True,
            )


def _cut_off(model: mujoco.MjModel, groups: list[Group], muscles: list[int]) -> Iterator[Finding]:
    """Findings on joints and tendons that limit the force of all their actuators together."""
    if not groups or not (model.jnt_actfrclimited.any() or model.tendon_actfrclimited.any()):
        return
    (forces,) = in_order(groups, "max_isometric_force")
    outs, ids = model.actuator_outadr[muscles], model.actuator_trnid[muscles, 0]
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    torques = np.abs(moments(model, data)[outs] * forces[:, None]).max(axis=0)
    names = joint_names(model)
    for joint in np.flatnonzero(model.jnt_actfrclimited).tolist():
        strongest = float(torques[model.jnt_dofadr[joint]])
        yield from _too_weak(f"joint {names[joint]!r}", model.jnt_actfrcrange[joint], strongest)
    on_tendon = model.actuator_trntype[muscles] == int(mujoco.mjtTrn.mjTRN_TENDON)
    for tendon in np.unique(ids[on_tendon]).tolist():
        if model.tendon_actfrclimited[tendon]:
            rows = on_tendon & (ids == tendon)
            strongest = float((forces * np.abs(model.actuator_gear[outs, 0]))[rows].max())
            subject = f"tendon {model.tendon(tendon).name!r}"
            yield from _too_weak(subject, model.tendon_actfrcrange[tendon], strongest)


def _too_weak(subject: str, limits: _Values, strongest: float) -> Iterator[Finding]:
    low, high = limits.tolist()
    if min(-low, high) < strongest:
        yield Finding(
            subject,
            f"its actuatorfrcrange, {low:g} to {high:g}, cuts off forces of its muscles (one "
            f"alone pulls with {strongest:.3g})",
            "make the range wider, or take it away",
            True,
        )


def _made_otherwise(model: mujoco.MjModel) -> Iterator[Finding]:
    """Findings on attached parts, for which the options of the whole model hold now."""
    for index in range(model.nnumeric):
        numeric = model.numeric(index)
        part = numeric.name.replace(MADE_FOR, "")
        if MADE_FOR not in numeric.name or len(numeric.data) != 5 or not part:
            continue
        x, y, z, timestep, integrator = numeric.data.tolist()
        made = _options(x, y, z, timestep, integrator)
        x, y, z = model.opt.gravity.tolist()
        now = _options(x, y, z, model.opt.timestep, model.opt.integrator)
        changed = [(old, new) for old, new in zip(made, now, strict=True) if old != new]
        if changed:
            yield Finding(
                f"attached model {part!r}",
                f"it was made for {', '.join(old for old, _ in changed)}, and the model it is part "
                f"of has {', '.join(new for _, new in changed)}"
                + (", so a limb without tonic input falls" if made[0] != now[0] else ""),
                "set model.opt if that is not meant",
                False,
            )


def _options(x: float, y: float, z: float, timestep: float, integrator: float) -> tuple[str, ...]:
    """Options in words that differ where the options do."""
    name = mujoco.mjtIntegrator(int(integrator)).name.removeprefix("mjINT_").lower()
    return (
        f"gravity {x:g} {y:g} {z:g} m/s²",
        f"a timestep of {timestep:g} s",
        f"integrator {name}",
    )
