"""Trials of an antagonistic pair: a step, a pair of pulses, a hit on the co-contracted joint.

They run on a model with one joint, whose muscles are ours or MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.analysis import responses
from mjhill.engine.equilibrium import at_home, equilibrate
from mjhill.engine.layout import addresses, joint_names, moments, read_muscle
from mjhill.simulate.recording import Recording
from mjhill.simulate.run import record
from mjhill.simulate.signals import Signal, pulse

STEP_TIME = 2.0  # [s]
PULSES_TIME, PULSE_WIDTH = 1.5, 0.1  # [s]
QUIET, HIT_WIDTH, AFTER = 0.1, 0.02, 1.0  # before a hit, its width, after its start [s]
_FITS = (("first 50 ms", 0.05), ("first 300 ms", 0.3))  # of the response to a hit [s]
_SETTLING_BLOCK, _SETTLING_BLOCKS = 0.25, 240  # [s], number
_REST_SPEED = 1e-5  # [rad/s or m/s]

Measure = tuple[str, str, float | None]  # quantity, unit, value; None where it was not seen


@dataclass(frozen=True)
class Pair:
    """A joint and two muscles that pull it either way.

    Attributes:
        joint: The model's only joint.
        coordinate: ``angle`` or ``position``, as recordings name it.
        agonist: The first muscle that pulls towards positive positions.
        antagonist: The first muscle that pulls the other way.
        max_force: Maximum isometric force of the agonist [N·m or N].
        max_load: What that puts on the joint [N·m or N].
    """

    joint: str
    coordinate: str
    agonist: str
    antagonist: str
    max_force: float
    max_load: float


def find_pair(model: mujoco.MjModel) -> Pair:
    """The joint of a model with our muscles, and the first muscle that pulls each way at home.

    Raises:
        ValueError: The model has not exactly one hinge or slide joint, or no muscle for one of
            the two directions.
    """
    kinds = {
        int(mujoco.mjtJoint.mjJNT_HINGE): "angle",
        int(mujoco.mjtJoint.mjJNT_SLIDE): "position",
    }
    if model.njnt != 1 or int(model.jnt_type[0]) not in kinds:
        raise ValueError(
            f"a comparison needs a model with one hinge or slide joint, this one has {model.njnt} "
            "joints; take the joint of interest into a model of its own"
        )
    data = at_home(model)
    mujoco.mj_fwdPosition(model, data)
    arms = moments(model, data)
    # force is negative when a muscle pulls, so it moves the joint against its moment
    pulls = {name: -float(arms[at.out, 0]) for name, at in addresses(model)}
    agonist = next((name for name, pull in pulls.items() if pull > 0), None)
    antagonist = next((name for name, pull in pulls.items() if pull < 0), None)
    if agonist is None or antagonist is None:
        raise ValueError(
            "a comparison needs a muscle for each direction of the joint, these pull the same "
            f"way: {', '.join(pulls) or 'none'}"
        )
    joint, coordinate = joint_names(model)[0], kinds[int(model.jnt_type[0])]
    force = read_muscle(model, agonist).max_isometric_force
    return Pair(joint, coordinate, agonist, antagonist, force, force * pulls[agonist])


def run_step(model: mujoco.MjModel, pair: Pair, level: float) -> Recording:
    """The agonist at ``level`` from the home pose on, the antagonist at rest."""
    inputs = {pair.agonist: level, pair.antagonist: 0.0}
    data = at_home(model)
    settle_muscles(model, data, 0.0)
    return record(model, data, duration=STEP_TIME, excitation=inputs)


def run_pulses(model: mujoco.MjModel, pair: Pair) -> Recording:
    """A full pulse of the agonist and then one of the antagonist, from the home pose."""
    inputs: Mapping[str, Signal] = {
        pair.agonist: pulse(1.0, 0.0, PULSE_WIDTH),
        pair.antagonist: pulse(1.0, PULSE_WIDTH, PULSE_WIDTH),
    }
    data = at_home(model)
    settle_muscles(model, data, 0.0)
    return record(model, data, duration=PULSES_TIME, excitation=inputs)


def run_impulse(
    model: mujoco.MjModel, pair: Pair, level: float, position: float, hit: float
) -> Recording:
    """A short load ``hit`` on the joint, at rest at ``position`` with both muscles at ``level``.

    A constant load keeps it at rest there until it is hit, and goes on after that.
    """
    data = mujoco.MjData(model)
    data.qpos[0] = position
    settle_muscles(model, data, level)
    mujoco.mj_forward(model, data)
    own = data.qfrc_passive[0] + data.qfrc_actuator[0] + data.qfrc_constraint[0]
    load = pulse(hit, QUIET, HIT_WIDTH) + float(data.qfrc_bias[0] - own)
    return record(model, data, duration=QUIET + AFTER, torque={pair.joint: load})


def rest_position(model: mujoco.MjModel, level: float) -> float:
    """Where the joint comes to rest with all muscles at ``level``, from the home pose.

    Raises:
        RuntimeError: It does not come to rest.
    """
    data = at_home(model)
    settle_muscles(model, data, level)
    block = max(1, round(_SETTLING_BLOCK / model.opt.timestep))
    for _ in range(_SETTLING_BLOCKS):
        mujoco.mj_step(model, data, nstep=block)
        if abs(data.qvel[0]) < _REST_SPEED:
            return float(data.qpos[0])
    raise RuntimeError(
        f"with its muscles at {level:g} the joint still moves at {data.qvel[0]:.2g} per second "
        f"after {_SETTLING_BLOCK * _SETTLING_BLOCKS:g} s; choose another level"
    )


def settle_muscles(model: mujoco.MjModel, data: mujoco.MjData, level: float) -> None:
    """Set the controls to ``level`` and every muscle's states to what they settle at."""
    data.ctrl[:] = level
    native = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_MUSCLE
    data.act[model.actuator_actadr[native]] = level
    equilibrate(model, data)


def step_measures(pair: Pair, run: Recording) -> Iterator[Measure]:
    """What is measured in the answer to a step."""
    time = run.time
    position, unit = shown(run, f"{pair.joint}.{pair.coordinate}")
    speed, speed_unit = shown(run, f"{pair.joint}.velocity")
    yield "travel", unit, float(position[-1] - position[0])
    share = responses.progress_of_step(position)
    yield "time to 10 % of travel", "s", responses.time_to(time, share, 0.1)
    yield "rise time, 10 to 90 %", "s", responses.rise_time(time, position)
    yield "peak velocity", speed_unit, float(speed.max())
    yield "time of peak velocity", "s", float(time[speed.argmax()])
    yield "overshoot, of travel", "%", 100 * responses.overshoot(position)
    yield "settling time, to 5 %", "s", responses.settling_time(time, position)


def pulses_measures(pair: Pair, run: Recording) -> Iterator[Measure]:
    """What is measured in the answer to a pair of pulses."""
    time = run.time
    position, unit = shown(run, f"{pair.joint}.{pair.coordinate}")
    speed, speed_unit = shown(run, f"{pair.joint}.velocity")
    force = f"{pair.agonist}.force"
    yield "peak excursion", unit, float(position.max() - position[0])
    yield "time of peak excursion", "s", float(time[position.argmax()])
    yield "peak velocity", speed_unit, float(speed.max())
    yield "peak velocity back", speed_unit, float(-speed.min())
    start = responses.time_to(time, run[force], 0.1 * pair.max_force)
    yield f"{pair.agonist}: 10 % of F_max after", "s", start
    yield f"{pair.agonist}: peak force", run.units[force], float(run[force].max())


def impulse_measures(pair: Pair, inertia: float, run: Recording) -> Iterator[Measure]:
    """What is measured in the answer to a hit on a joint that moves ``inertia``.

    Stiffness and damping are those of a second-order fit, over the first 50 ms (short-range
    stiffness, before the contractile element has given way) and over the first 300 ms.
    """
    start = int(np.searchsorted(run.time, QUIET - 1e-9))
    time = run.time[start:]
    position, unit = shown(run, f"{pair.joint}.{pair.coordinate}")
    deflection = position[start:] - position[start]
    yield "peak deflection", unit, float(deflection.max())
    yield "time of peak", "s", float(time[deflection.argmax()] - time[0])
    yield "from the peak to half of it", "s", responses.half_life(time, deflection)
    load = run[f"{pair.joint}.applied"]
    for window, length in _FITS:
        part = slice(start, start + int(np.searchsorted(time, time[0] + length)))
        coordinate = run[f"{pair.joint}.{pair.coordinate}"][part]
        fit = responses.second_order_fit(
            run.time[part],
            coordinate - coordinate[0],
            run[f"{pair.joint}.velocity"][part],
            load[part] - load[0],
            inertia,
        )
        units = [run.units[f"{pair.joint}.{name}"] for name in ("applied", pair.coordinate)]
        yield f"stiffness, {window}", "/".join(units), fit.stiffness
        yield f"damping, {window}", "·s/".join(units), fit.damping
    yield "load that holds the joint", run.units[f"{pair.joint}.applied"], float(load[0])


def shown(run: Recording, name: str) -> tuple[NDArray[np.float64], str]:
    """Values and unit as people read them: angles in degrees."""
    values, unit = run[name], run.units[name]
    degrees = {"rad": "°", "rad/s": "°/s"}
    return (np.degrees(values), degrees[unit]) if unit in degrees else (values, unit)


def inertia(model: mujoco.MjModel, position: float) -> float:
    """What the joint moves [kg·m² or kg]."""
    data = mujoco.MjData(model)
    data.qpos[0] = position
    mujoco.mj_forward(model, data)
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, dense)
    return float(dense[0, 0])
