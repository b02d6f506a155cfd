"""Simulated measurements fitted back: do the intervals of 95 % hold the truth that often?

A true joint is drawn from the priors of a fit, moved or held in steps of 0.05 ms, sampled, and
measured with noise. Some of its parameters are fitted, the others are known. Pulses and steps
change at samples, as from a digital stimulator; chirps are smooth, and sampled as they pass.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from math import radians
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.benchmarks.result import Result
from mjhill.engine.install import installed
from mjhill.identification.fit import Estimate
from mjhill.identification.free import DEVIATIONS, free_parameters, joint_at, value_of
from mjhill.identification.measurement import Measurement
from mjhill.identification.movement import fit_trials
from mjhill.identification.trial import make_trial
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.lab.batch import driving_torques, joint_angles

NAMES = ("elbow", "wrist", "knee", "head", "eye")
KINDS = ("pulses", "steps", "chirps")
RATES = (100, 200, 1000)  # [Hz]
COUNT = 900  # fits in all
GOAL = 92.0  # [%] of the intervals, at least
DURATION = 1.0  # [s]
FINE = 5e-5  # [s]
ANGLE_NOISE = radians(0.2)  # [rad], white, that of motion capture
TORQUE_NOISE = 2e-3  # of the strongest muscle, white
FEWEST, MOST = 3, 5  # fitted parameters
HELD = 4  # one of so many joints is held still, and its torque predicted

_CHUNK = 5
_ALL = "all"
_Values = NDArray[np.float64]
Progress = Callable[[float], None]
_Job = tuple[str, str, int, int]  # joint, kind, rate and number


@dataclass(frozen=True)
class Fit:
    """One fit to a simulated measurement.

    Attributes:
        case: Its name, such as ``elbow:pulses:200:7``.
        quantity: What was predicted.
        taken: How the inputs were taken to go on between samples.
        truth: The true value of each fitted parameter, in the parameter's unit.
        estimates: Their estimates; none where the fit did not settle.
    """

    case: str
    quantity: str
    taken: str
    truth: tuple[float, ...]
    estimates: tuple[Estimate, ...]

    @property
    def held(self) -> int:
        """Number of intervals that hold the truth."""
        pairs = zip(self.estimates, self.truth, strict=False)
        return sum(one.low <= value <= one.high for one, value in pairs)

    def is_of(self, joint: str = _ALL, kind: str = _ALL, rate: str = _ALL) -> bool:
        """Whether the fit is of a joint, a kind of inputs and a sampling rate; ``all`` is any."""
        wanted = (joint, kind, rate)
        return all(a in (_ALL, b) for a, b in zip(wanted, self.case.split(":"), strict=False))


def measure(
    kinds: Sequence[str] = (),
    count: int | None = None,
    case: str | None = None,
    progress: Progress | None = None,
) -> Result:
    """How many of the intervals hold the truth, by joint, inputs and sampling rate.

    Args:
        kinds: Kinds of inputs; by default all.
        count: Fits in all, divided evenly.
        case: One fit instead, such as ``elbow:pulses:200:7``.
        progress: Called with the share done, from 0 to 1.

    Raises:
        ValueError: A kind or case is unknown.
    """
    if case is not None:
        return _detail(fit(*_job(case)))
    for kind in kinds:
        if kind not in KINDS:
            raise ValueError(f"unknown kind of inputs {kind!r}; there are: {', '.join(KINDS)}")
    return table(study(kinds or KINDS, count or COUNT, progress=progress))


def study(
    kinds: Sequence[str] = KINDS,
    count: int = COUNT,
    processes: int | None = None,
    progress: Progress | None = None,
) -> list[Fit]:
    """Fit ``count`` simulated measurements, in parallel.

    Args:
        kinds: Kinds of inputs.
        count: Fits in all, divided evenly between joints, kinds and rates.
        processes: How many processes; by default one for each core. 1 means this process.
        progress: Called with the share done, from 0 to 1.
    """
    cells = list(product(NAMES, kinds, RATES))
    jobs: list[_Job] = [(*cells[k % len(cells)], k // len(cells)) for k in range(count)]
    fits: list[Fit] = []
    with installed():  # compiles once, before the processes start
        if processes == 1:
            return _fits(jobs)
    chunks = [jobs[first : first + _CHUNK] for first in range(0, count, _CHUNK)]
    with (
        tempfile.TemporaryDirectory() as folder,  # MuJoCo writes a log to the working folder
        ProcessPoolExecutor(processes, initializer=os.chdir, initargs=(folder,)) as pool,
    ):
        for found in pool.map(_fits, chunks):
            fits += found
            if progress is not None:
                progress(len(fits) / count)
    return fits


def _fits(jobs: Sequence[_Job]) -> list[Fit]:
    return [fit(*job) for job in jobs]


def fit(name: str, kind: str, rate: int, number: int) -> Fit:
    """Draw a joint and a measurement, and fit it.

    Args:
        name: The joint.
        kind: Kind of inputs.
        rate: Samples a second [Hz].
        number: Which one of them.
    """
    case = f"{name}:{kind}:{rate}:{number}"
    random = np.random.default_rng([1987, NAMES.index(name), KINDS.index(kind), rate, number])
    free = [item for item in free_parameters(name) if item.path[0] != "postures"]
    joint = joint_at(JOINTS[name], free, _normal(random, len(free)))
    chosen = random.choice(len(free), random.integers(FEWEST, MOST + 1), replace=False)
    fitted = [free[k] for k in sorted(chosen)]
    truth = tuple(value_of(joint, item) for item in fitted)
    trial = make_trial(_measured(joint, kind, rate, random, held=number % HELD == HELD - 1))
    try:
        result, _ = fit_trials(joint, fitted, [trial])
    except RuntimeError:
        return Fit(case, trial.quantity, trial.inputs, truth, ())
    return Fit(case, trial.quantity, trial.inputs, truth, result.estimates)


def _normal(random: np.random.Generator, count: int) -> _Values:
    """Deviations of parameters from the middles of their bounds, inside these."""
    drawn = random.standard_normal(count)
    while (outside := np.abs(drawn) > DEVIATIONS).any():
        drawn[outside] = random.standard_normal(outside.sum())
    return drawn


def _measured(
    joint: Joint, kind: str, rate: int, random: np.random.Generator, *, held: bool
) -> Measurement:
    """A measurement of a joint with noise, held at an angle or moving."""
    steps = round(DURATION / FINE)
    fine: _Values = (np.arange(steps, dtype=np.float64) + 0.5) * FINE
    time: _Values = np.arange(round(DURATION * rate) + 1, dtype=np.float64) / rate
    strongest = max(muscle.max_isometric_force for muscle in joint.muscles.values())
    signals = [_signal(kind, rate, random) for _ in range(3)]
    flexor, extensor, push = ((signal(fine), signal(time)) for signal in signals)
    # one muscle strongly, the other weakly
    tops = random.permutation([random.uniform(0.2, 0.6), random.uniform(0.0, 0.2)])
    true = np.stack([tops[0] * flexor[0], tops[1] * extensor[0]], axis=1)
    pushed = random.choice([-1, 1]) * random.uniform(0.03, 0.08) * strongest
    every = round(1 / (rate * FINE))
    if held:
        angle = np.full(len(time), random.uniform(*joint.range))
        path = np.full(steps + 1, angle[0])
        inputs = np.concatenate([true, true[-1:]])
        run = driving_torques([joint], path=path, before=true[0], excitation=inputs, timestep=FINE)
        torque = run[0, ::every]
    else:
        run = joint_angles(
            [joint], start=joint.home_angle, before=true[0], excitation=true,
            torque=pushed * push[0], steps=steps, timestep=FINE,
        )  # fmt: skip
        angle, torque = run[0, ::every], pushed * push[1]
    excitation = dict(zip(joint.muscles, (tops[0] * flexor[1], tops[1] * extensor[1]), strict=True))
    return Measurement(
        "simulated", time, excitation,
        angle + ANGLE_NOISE * random.standard_normal(len(time)),
        torque + TORQUE_NOISE * strongest * random.standard_normal(len(time)),
    )  # fmt: skip


def _signal(kind: str, rate: int, random: np.random.Generator) -> Callable[[_Values], _Values]:
    """A signal from 0 to 1 as a function of times [s]."""
    if kind == "chirps":
        slow, fast, phase = random.uniform(0.5, 1.5), random.uniform(2.0, 4.0), random.uniform(0, 6)
        return lambda time: (
            0.5
            - 0.5
            * np.cos(phase + 2 * np.pi * time * (slow + 0.5 * (fast - slow) * time / DURATION))
        )
    count = random.integers(2, 5)
    starts = np.sort(random.uniform(0.05, 0.9, count) * DURATION)
    if kind == "pulses":
        levels = np.ones(count)
        ends = starts + random.uniform(0.03, 0.15, count)
    else:
        levels = random.uniform(0, 1, count)
        ends = np.append(starts[1:], 2 * DURATION)
    starts, ends = np.round(starts * rate), np.round(ends * rate)

    def held(time: _Values) -> _Values:
        sample = np.floor(time * rate + 1e-6)[:, None]  # free of rounding
        on = (starts <= sample) & (sample < ends)
        return np.asarray((on * levels).max(axis=1))

    return held


def table(fits: Sequence[Fit]) -> Result:
    """A row for each joint and kind of inputs, one for each of these alone, and one for all."""
    rows = []
    for name in (*NAMES, _ALL):
        for kind in (*KINDS, _ALL):
            group = [one for one in fits if one.is_of(joint=name, kind=kind)]
            if group:
                rows.append(_row(name, kind, group, GOAL if name == kind == _ALL else None))
    failed = [one.case for one in fits if not one.estimates]
    notes = (
        f"{DURATION:g} s each; noise, white: {np.degrees(ANGLE_NOISE):g}° and "
        f"{100 * TORQUE_NOISE:g} % of the strongest muscle; {FEWEST} to {MOST} parameters fitted, "
        f"the others known; one joint of {HELD} held still, its torque predicted",
        "hold the truth: share of the intervals of 95 %, also by sampling rate; from the data: "
        "mean share of the prior's variance that the data took away",
        f"did not settle: {', '.join(failed) or 'none'}; one again: mjhill bench intervals --case "
        f"{fits[0].case}",
    )
    return Result(f"Intervals of fits, MuJoCo {mujoco.__version__}", rows, notes)


def _row(joint: str, kind: str, fits: Sequence[Fit], goal: float | None) -> dict[str, Any]:
    told = [estimate.informed for one in fits for estimate in one.estimates]
    held = _share_held(fits)
    by_rate = {
        f"at {rate} Hz [%]": _share_held([one for one in fits if one.is_of(rate=str(rate))])
        for rate in RATES
    }
    return {
        "joint": joint,
        "inputs": kind,
        "fits": len(fits),
        "intervals": sum(len(one.truth) for one in fits),
        "hold the truth [%]": held,
        **by_rate,
        "from the data [%]": 100 * float(np.mean(told)) if told else None,
        "goal": goal,
        "met": None if goal is None or held is None else held >= goal,
    }


def _share_held(fits: Sequence[Fit]) -> float | None:
    """Share of the intervals that hold the truth [%]; None where there are none."""
    count = sum(len(one.truth) for one in fits)
    return 100 * sum(one.held for one in fits) / count if count else None


def _job(case: str) -> _Job:
    """The job of a case by its name."""
    name, kind, rate, number = [*case.split(":"), "", "", ""][:4]
    if (
        name not in NAMES
        or kind not in KINDS
        or rate not in map(str, RATES)
        or not number.isdecimal()
    ):
        raise ValueError(
            f"a case is named JOINT:KIND:RATE:NUMBER, such as {NAMES[0]}:{KINDS[0]}:{RATES[0]}:7, "
            f"with a joint of {', '.join(NAMES)}, a kind of {', '.join(KINDS)}, and a rate of "
            f"{', '.join(map(str, RATES))}, got {case!r}"
        )
    return name, kind, int(rate), int(number)


def _detail(one: Fit) -> Result:
    """A row for each parameter of one fit."""
    rows = [
        {
            "parameter": estimate.name,
            "truth": value,
            "value": estimate.value,
            "95 % from": estimate.low,
            "to": estimate.high,
            "from the data [%]": 100 * estimate.informed,
            "held": estimate.low <= value <= estimate.high,
        }
        for estimate, value in zip(one.estimates, one.truth, strict=False)
    ]
    settled = "" if one.estimates else ": did not settle"
    title = f"{one.case}{settled}"
    return Result(title, rows, (f"{one.quantity} predicted; inputs: {one.taken}",))
