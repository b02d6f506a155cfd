"""A model with mjhill's muscles and with MuJoCo's: the same trials, measured side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.analysis import responses
from mjhill.comparison.cost import StepCost
from mjhill.comparison.match import Match, matching
from mjhill.comparison.native import compiled, native_spec, read_spec
from mjhill.engine.equilibrium import at_home, equilibrate
from mjhill.engine.install import installed
from mjhill.engine.layout import addresses, joint_names, moments, read_muscle
from mjhill.simulate.recording import Recording
from mjhill.simulate.run import record
from mjhill.simulate.signals import Signal, pulse

STEP_TIME = 2.0  # [s]
PULSES_TIME, PULSE_WIDTH = 1.5, 0.1  # [s]
QUIET, IMPULSE_WIDTH, AFTER = 0.1, 0.02, 1.0  # before an impulse, its width, after its start [s]
_FITS = (("first 50 ms", 0.05), ("first 300 ms", 0.3))  # of the response to an impulse [s]
_IMPULSE_SHARE = 0.15  # of the agonist's maximum
_SETTLING_BLOCK, _SETTLING_BLOCKS = 0.25, 240  # [s], number
_REST_SPEED = 1e-5  # [rad/s or m/s]

Measure = tuple[str, str, float | None]  # quantity, unit, value; None where it was not seen


@dataclass(frozen=True)
class Pair:
    """A joint and two muscles that pull it in opposite directions.

    Attributes:
        joint: The model's only joint.
        coordinate: ``angle`` or ``position``, as recordings name it.
        agonist: The first muscle that pulls towards positive positions.
        antagonist: The first muscle that pulls the other way.
        max_force: Maximum isometric force of the agonist [N·m or N].
        max_load: The load on the joint at that force [N·m or N].
    """

    joint: str
    coordinate: str
    agonist: str
    antagonist: str
    max_force: float
    max_load: float


def find_pair(model: mujoco.MjModel) -> Pair:
    """The only joint of a model, and its first muscle in each direction at the home pose.

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


def run_step(model: mujoco.MjModel, pair: Pair, excitation: float) -> Recording:
    """A step of the agonist's excitation from the home pose, the antagonist at rest."""
    excitations = {pair.agonist: excitation, pair.antagonist: 0.0}
    data = at_home(model)
    settle_muscles(model, data, 0.0)
    return record(model, data, duration=STEP_TIME, excitation=excitations)


def run_pulses(model: mujoco.MjModel, pair: Pair) -> Recording:
    """A full pulse of the agonist and then one of the antagonist, from the home pose."""
    excitations: Mapping[str, Signal] = {
        pair.agonist: pulse(1.0, 0.0, PULSE_WIDTH),
        pair.antagonist: pulse(1.0, PULSE_WIDTH, PULSE_WIDTH),
    }
    data = at_home(model)
    settle_muscles(model, data, 0.0)
    return record(model, data, duration=PULSES_TIME, excitation=excitations)


def run_impulse(
    model: mujoco.MjModel, pair: Pair, excitation: float, position: float, impulse: float
) -> Recording:
    """A short load on the joint, at rest at ``position`` with both muscles at ``excitation``.

    A constant load holds the joint there before the impulse and stays on afterwards.
    """
    data = mujoco.MjData(model)
    data.qpos[0] = position
    settle_muscles(model, data, excitation)
    mujoco.mj_forward(model, data)
    own = data.qfrc_passive[0] + data.qfrc_actuator[0] + data.qfrc_constraint[0]
    load = pulse(impulse, QUIET, IMPULSE_WIDTH) + float(data.qfrc_bias[0] - own)
    return record(model, data, duration=QUIET + AFTER, torque={pair.joint: load})


def rest_position(model: mujoco.MjModel, excitation: float) -> float:
    """Where the joint comes to rest with all muscles at ``excitation``, from the home pose.

    Raises:
        RuntimeError: It does not come to rest.
    """
    data = at_home(model)
    settle_muscles(model, data, excitation)
    block = max(1, round(_SETTLING_BLOCK / model.opt.timestep))
    for _ in range(_SETTLING_BLOCKS):
        mujoco.mj_step(model, data, nstep=block)
        if abs(data.qvel[0]) < _REST_SPEED:
            return float(data.qpos[0])
    raise RuntimeError(
        f"with its muscles at {excitation:g} the joint still moves at {data.qvel[0]:.2g} per "
        f"second after {_SETTLING_BLOCK * _SETTLING_BLOCKS:g} s; choose another excitation"
    )


def settle_muscles(model: mujoco.MjModel, data: mujoco.MjData, excitation: float) -> None:
    """Set all controls to ``excitation`` and the muscles' states to their steady values."""
    data.ctrl[:] = excitation
    native = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_MUSCLE
    data.act[model.actuator_actadr[native]] = excitation
    equilibrate(model, data)


def step_measures(pair: Pair, run: Recording) -> Iterator[Measure]:
    """Measures of the response to a step."""
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
    """Measures of the response to a pair of pulses."""
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
    """Measures of the response to an impulse on a joint with ``inertia`` [kg·m² or kg].

    Stiffness and damping are those of a second-order fit, over the first 50 ms (short-range
    stiffness, before the contractile element yields) and over the first 300 ms.
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
    """Values and unit for a table: angles in degrees."""
    values, unit = run[name], run.units[name]
    degrees = {"rad": "°", "rad/s": "°/s"}
    return (np.degrees(values), degrees[unit]) if unit in degrees else (values, unit)


def inertia(model: mujoco.MjModel, position: float) -> float:
    """Inertia of all that the joint moves [kg·m² or kg]."""
    data = mujoco.MjData(model)
    data.qpos[0] = position
    mujoco.mj_forward(model, data)
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, dense)
    return float(dense[0, 0])


@dataclass(frozen=True)
class Row:
    """One measured quantity.

    Attributes:
        task: The task it was measured in, a key of ``Comparison.recordings``.
        quantity: What it is.
        unit: Its unit.
        mjhill: With mjhill's muscles; None if the run was too short to show it.
        native: With MuJoCo's muscles; None for the same reason.
    """

    task: str
    quantity: str
    unit: str
    mjhill: float | None
    native: float | None

    @property
    def ratio(self) -> float | None:
        """mjhill's value over MuJoCo's [-]; None where there is none."""
        if self.mjhill is None or not self.native:
            return None
        return self.mjhill / self.native


@dataclass(frozen=True)
class Comparison:
    """Both kinds of muscle on the same tasks.

    Attributes:
        model: Name or path of the model.
        pair: The joint and its muscles.
        tasks: A description of each task, by task.
        matching: Which properties of the two muscles are equal, and which cannot be.
        rows: The measures.
        recordings: By task, and then by ``mjhill`` or ``native``.
        cost: Time of a step; None if it was not measured.
        muscle: The muscle model in the place of ``hill``; None if it stayed.
    """

    model: str
    pair: Pair
    tasks: Mapping[str, str]
    matching: tuple[Match, ...]
    rows: tuple[Row, ...]
    recordings: Mapping[str, Mapping[str, Recording]]
    cost: StepCost | None = None
    muscle: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """Everything except the recordings, ready for JSON."""
        return {
            "model": self.model,
            "muscle": self.muscle,
            "pair": asdict(self.pair),
            "tasks": dict(self.tasks),
            "matching": [asdict(match) for match in self.matching],
            "rows": [{**asdict(row), "ratio": row.ratio} for row in self.rows],
            "cost": None if self.cost is None else self.cost.as_dict(),
        }


def compare(
    model: str | Path = "elbow",
    *,
    muscle: str | None = None,
    excitation: float = 0.5,
    cocontraction: tuple[float, float] = (0.1, 0.5),
    impulse: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Comparison:
    """Run a model with mjhill's muscles and with MuJoCo's through the same tasks; measure both.

    The tasks are ``step`` and ``pulses`` from the home pose, and ``impulse <co-contraction>``: a
    load for 20 ms on the joint at rest, with both muscles co-contracted. All impulses start from
    one posture, in which mjhill's model rests at the first co-contraction; a constant load holds
    the joint there. Both models have the joint's exponential elasticity from mjhill's callbacks.

    Args:
        model: A joint's name, such as ``"elbow"``, or a path to an MJCF file with one joint.
        muscle: Name of the muscle model that takes the place of ``hill``, such as ``hill-rigid``.
        excitation: Excitation of the step, in (0, 1].
        cocontraction: Two different excitations of both muscles, in (0, 1].
        impulse: Torque [N·m] or force [N] of the impulse; by default 15 % of the load at the
            agonist's maximum isometric force.
        progress: Called after each task with the share done, 0 to 1.

    Raises:
        ValueError: An argument is out of range, the model does not have exactly one joint with
            an antagonistic pair, or as ``native_model``.
        RuntimeError: MuJoCo warned of a bad state, or the joint does not come to rest.
    """
    _check_arguments(excitation, cocontraction, impulse)
    spec = read_spec(model, muscle)
    models = {"mjhill": compiled(spec), "native": compiled(native_spec(spec))}
    pair = find_pair(models["mjhill"])
    load = _IMPULSE_SHARE * pair.max_load if impulse is None else impulse
    with installed():
        posture = rest_position(models["mjhill"], cocontraction[0])
        runs: dict[str, Callable[[mujoco.MjModel], Recording]] = {
            "step": partial(run_step, pair=pair, excitation=excitation),
            "pulses": partial(run_pulses, pair=pair),
        }
        for each in cocontraction:
            runs[_impulse(each)] = partial(
                run_impulse, pair=pair, excitation=each, position=posture, impulse=load
            )
        recordings = {}
        for index, (task, run) in enumerate(runs.items()):
            recordings[task] = {side: run(models[side]) for side in models}
            if progress is not None:
                progress((index + 1) / len(runs))
    first = recordings[_impulse(cocontraction[0])]["mjhill"]
    return Comparison(
        str(model),
        pair,
        _tasks(pair, first, excitation, cocontraction, load),
        matching(model, muscle),
        tuple(_rows(pair, recordings, inertia(models["mjhill"], posture))),
        recordings,
        muscle=muscle,
    )


def check(model: str | Path, muscle: str | None = None) -> None:
    """Check at once whether a model can be compared.

    Raises:
        ValueError: As ``compare``.
    """
    spec = read_spec(model, muscle)
    compiled(native_spec(spec))
    find_pair(compiled(spec))


def _check_arguments(
    excitation: float, cocontraction: tuple[float, float], impulse: float | None
) -> None:
    named = [("excitation", excitation), *(("cocontraction", each) for each in cocontraction)]
    for name, value in named:
        if not 0 < value <= 1:
            raise ValueError(f"{name} must be in (0, 1], got {value}")
    if len({f"{each:g}" for each in cocontraction}) != 2:
        raise ValueError(f"cocontraction must be two different ones, got {cocontraction}")
    if impulse is not None and not (np.isfinite(impulse) and impulse > 0):
        raise ValueError(f"impulse must be positive and finite, got {impulse}")


def _tasks(
    pair: Pair,
    run: Recording,
    excitation: float,
    cocontraction: tuple[float, float],
    impulse: float,
) -> dict[str, str]:
    """A description of each task; ``run`` is one of the impulses."""
    posture, unit = shown(run, f"{pair.joint}.{pair.coordinate}")
    where = f"{posture[0]:.4g}{unit if unit == '°' else ' ' + unit}"
    load_unit = run.units[f"{pair.joint}.applied"]
    pulse, short = (f"{1e3 * width:g} ms" for width in (PULSE_WIDTH, IMPULSE_WIDTH))
    words = {
        "step": f"{pair.agonist} at {excitation:g} from the home pose",
        "pulses": f"{pair.agonist} at 1 for {pulse}, then {pair.antagonist}, from the home pose",
    }
    for each in cocontraction:
        words[_impulse(each)] = (
            f"{impulse:.3g} {load_unit} for {short} on the joint at rest at {where}, "
            f"both muscles at {each:g}"
        )
    return words


def _impulse(cocontraction: float) -> str:
    return f"impulse {cocontraction:g}"


def _rows(
    pair: Pair, recordings: Mapping[str, Mapping[str, Recording]], inertia: float
) -> Iterator[Row]:
    measures: dict[str, Callable[[Recording], Iterator[Measure]]] = {
        "step": partial(step_measures, pair),
        "pulses": partial(pulses_measures, pair),
    }
    for task, sides in recordings.items():
        measure = measures.get(task, partial(impulse_measures, pair, inertia))
        both = zip(measure(sides["mjhill"]), measure(sides["native"]), strict=True)
        for (quantity, unit, ours), (_, _, native) in both:
            yield Row(task, quantity, unit, ours, native)
