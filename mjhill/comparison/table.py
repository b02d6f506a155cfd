"""The same plant and inputs with MuJoCo's muscles and with ours: what differs, and by how much."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mjhill.comparison import trials
from mjhill.comparison.cost import StepCost
from mjhill.comparison.match import Match, matching
from mjhill.comparison.native import compiled, native_spec, read_spec
from mjhill.comparison.trials import Pair
from mjhill.engine.install import installed
from mjhill.simulate.recording import Recording

_HIT_SHARE = 0.15  # of the agonist's maximum


@dataclass(frozen=True)
class Row:
    """One measured quantity.

    Attributes:
        task: The task it was measured in, a key of ``Comparison.recordings``.
        quantity: What it is.
        unit: Its unit.
        mjhill: With our muscles; None where the run was too short to show it.
        native: With MuJoCo's; None likewise.
    """

    task: str
    quantity: str
    unit: str
    mjhill: float | None
    native: float | None

    @property
    def ratio(self) -> float | None:
        """Ours over MuJoCo's [-]; None where there is none."""
        if self.mjhill is None or not self.native:
            return None
        return self.mjhill / self.native


@dataclass(frozen=True)
class Comparison:
    """Both kinds of muscle on the same tasks.

    Attributes:
        model: What was compared.
        pair: The joint and its muscles.
        tasks: What was done, in words, by task.
        matching: What the two kinds of muscle share, and what they cannot.
        rows: What was measured.
        recordings: By task, and then by ``mjhill`` or ``native``.
        cost: What a step takes; None where it was not measured.
    """

    model: str
    pair: Pair
    tasks: Mapping[str, str]
    matching: tuple[Match, ...]
    rows: tuple[Row, ...]
    recordings: Mapping[str, Mapping[str, Recording]]
    cost: StepCost | None = None

    def as_dict(self) -> dict[str, Any]:
        """All but the recordings, as what JSON can hold."""
        return {
            "model": self.model,
            "pair": asdict(self.pair),
            "tasks": dict(self.tasks),
            "matching": [asdict(match) for match in self.matching],
            "rows": [{**asdict(row), "ratio": row.ratio} for row in self.rows],
            "cost": None if self.cost is None else self.cost.as_dict(),
        }


def compare(
    model: str | Path = "elbow",
    *,
    level: float = 0.5,
    levels: tuple[float, float] = (0.1, 0.5),
    hit: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Comparison:
    """Run a model with our muscles and with MuJoCo's through the same tasks and measure both.

    The tasks are ``step`` and ``pulses`` from the home pose, and ``impulse <level>``: a load for
    20 ms on the joint at rest, with both muscles co-contracted. Every hit finds the joint in one
    posture, where ours comes to rest at the first level; a constant load holds it there. With
    MuJoCo's muscles, our callbacks add the joint's exponential elasticity, as they do with ours.

    Args:
        model: A joint's name, such as ``"elbow"``, or a path to an MJCF file with one joint.
        level: Input of the step, in (0, 1].
        levels: Two inputs of co-contraction, in (0, 1].
        hit: Torque [N·m] or force [N] on the joint; without it, 15 % of what the agonist's
            maximum isometric force puts there.
        progress: Called after each task with the share done, 0 to 1.

    Raises:
        ValueError: An input is out of range, the model has not one joint with an antagonistic
            pair, or as ``native_model``.
        RuntimeError: MuJoCo warned of a bad state, or the joint does not come to rest.
    """
    _check_inputs(level, levels, hit)
    spec = read_spec(model)
    models = {"mjhill": compiled(spec), "native": compiled(native_spec(spec))}
    pair = trials.find_pair(models["mjhill"])
    load = _HIT_SHARE * pair.max_load if hit is None else hit
    with installed():
        posture = trials.rest_position(models["mjhill"], levels[0])
        runs: dict[str, Callable[[mujoco.MjModel], Recording]] = {
            "step": partial(trials.run_step, pair=pair, level=level),
            "pulses": partial(trials.run_pulses, pair=pair),
        }
        for each in levels:
            runs[_impulse(each)] = partial(
                trials.run_impulse, pair=pair, level=each, position=posture, hit=load
            )
        recordings = {}
        for index, (task, run) in enumerate(runs.items()):
            recordings[task] = {side: run(models[side]) for side in models}
            if progress is not None:
                progress((index + 1) / len(runs))
    return Comparison(
        str(model),
        pair,
        _tasks(pair, recordings[_impulse(levels[0])]["mjhill"], level, levels, load),
        matching(model),
        tuple(_rows(pair, recordings, trials.inertia(models["mjhill"], posture))),
        recordings,
    )


def check(model: str | Path) -> None:
    """Look whether a model can be compared, which takes no time.

    Raises:
        ValueError: As ``compare``.
    """
    spec = read_spec(model)
    compiled(native_spec(spec))
    trials.find_pair(compiled(spec))


def _check_inputs(level: float, levels: tuple[float, float], hit: float | None) -> None:
    for name, value in (("level", level), *(("levels", each) for each in levels)):
        if not 0 < value <= 1:
            raise ValueError(f"{name} must be in (0, 1], got {value}")
    if len({f"{each:g}" for each in levels}) != 2:
        raise ValueError(f"levels must be two different ones, got {levels}")
    if hit is not None and not (np.isfinite(hit) and hit > 0):
        raise ValueError(f"hit must be positive and finite, got {hit}")


def _tasks(
    pair: Pair, run: Recording, level: float, levels: tuple[float, float], hit: float
) -> dict[str, str]:
    """What is done in each task, in words; ``run`` is of a hit."""
    posture, unit = trials.shown(run, f"{pair.joint}.{pair.coordinate}")
    where = f"{posture[0]:.4g}{unit if unit == '°' else ' ' + unit}"
    load_unit = run.units[f"{pair.joint}.applied"]
    pulse, blow = (f"{1e3 * width:g} ms" for width in (trials.PULSE_WIDTH, trials.HIT_WIDTH))
    words = {
        "step": f"{pair.agonist} at {level:g} from the home pose",
        "pulses": f"{pair.agonist} at 1 for {pulse}, then {pair.antagonist}, from the home pose",
    }
    for each in levels:
        words[_impulse(each)] = (
            f"{hit:.3g} {load_unit} for {blow} on the joint at rest at {where}, "
            f"both muscles at {each:g}"
        )
    return words


def _impulse(level: float) -> str:
    return f"impulse {level:g}"


def _rows(
    pair: Pair, recordings: Mapping[str, Mapping[str, Recording]], inertia: float
) -> Iterator[Row]:
    measures: dict[str, Callable[[Recording], Iterator[trials.Measure]]] = {
        "step": partial(trials.step_measures, pair),
        "pulses": partial(trials.pulses_measures, pair),
    }
    for task, sides in recordings.items():
        measure = measures.get(task, partial(trials.impulse_measures, pair, inertia))
        both = zip(measure(sides["mjhill"]), measure(sides["native"]), strict=True)
        for (quantity, unit, ours), (_, _, native) in both:
            yield Row(task, quantity, unit, ours, native)
