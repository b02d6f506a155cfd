"""The same equations solved by SciPy's stiff solvers: what the MuJoCo path is measured against.

No MuJoCo in here: only the equations and the parameters.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mjhill.elements import passive_torque
from mjhill.joints.joint import Joint
from mjhill.joints.system import Coordinate, Movement, System
from mjhill.muscles import Muscle, MuscleModel, model_of, steady_states
from mjhill.muscles.model import arguments, units_of
from mjhill.simulate.recording import Recording
from mjhill.simulate.signals import Signal, as_signal, as_signals

Solver = Literal["Radau", "LSODA"]

_Vector = NDArray[np.float64]
_Rates = Callable[[float, list[float]], list[float]]


def simulate(
    system: Joint | System,
    excitation: Mapping[str, Signal | float],
    *,
    torque: Mapping[str, Signal | float] | Signal | float = 0.0,
    movement: Mapping[str, Movement] | None = None,
    duration: float,
    start: _Vector | None = None,
    sample: float = 1e-3,
    rtol: float = 1e-9,
    atol: float = 1e-11,
    solver: Solver = "Radau",
) -> Recording:
    """Solve the equations of a joint and its two muscles, or of any system.

    The solver restarts where an input jumps.

    Args:
        system: The joint or system.
        excitation: Excitation of each muscle, by name; a muscle not named gets 0.
        torque: External torque [N·m] or force [N] by coordinate; one value serves a joint.
        movement: Movements of coordinates that are prescribed, by name; the others are free.
        duration: Length of the run [s].
        start: State at time 0: position and velocity of each coordinate, then the states of each
            muscle; by default ``rest_state(system)``.
        sample: Interval of the recording [s].
        rtol: Relative tolerance of each step.
        atol: Absolute tolerance of each step.
        solver: SciPy's solver: ``"Radau"`` (implicit Runge-Kutta of order 5) or ``"LSODA"``
            (multistep, several times faster).

    Returns:
        The recording, with the names that ``mjhill.record`` gives; ``velocity`` of a muscle is
        the present one.

    Raises:
        ValueError: A name is unknown, or a number is not positive or not finite.
        RuntimeError: The solver gave up.
    """
    for what, value in (("duration", duration), ("sample", sample)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{what} must be positive, got {value}")
    whole = System.of(system) if isinstance(system, Joint) else system
    given = as_signals(excitation, whole.muscles, "muscle")
    excitations = {name: given.get(name, as_signal(0.0)) for name in whole.muscles}
    loads = _loads(whole, torque)
    movements = _known_movements(whole, movement or {})
    times: _Vector = np.arange(round(duration / sample) + 1, dtype=np.float64) * sample
    breaks = [signal.breaks for signal in (*excitations.values(), *loads.values())]
    breaks += [moved.breaks for moved in movements.values()]
    knots = _knots(breaks, float(times[-1]))
    state = rest_state(system) if start is None else np.array(start, dtype=np.float64)
    states = np.empty((len(times), len(state)))
    states[0] = state
    for begin, end in itertools.pairwise(knots):
        fuzz = 1e-9 * sample
        inside = (times > begin + fuzz) & (times <= end + fuzz)
        rates = _rates(whole, excitations, loads, movements, begin, end)
        solution = _solve(rates, begin, end, state, times[inside], rtol, atol, solver)
        states[inside] = solution[:, : inside.sum()].T
        state = solution[:, -1]
    for index, name in enumerate(whole.coordinates):
        if name in movements:
            states[:, 2 * index] = [movements[name].position(time) for time in times]
            states[:, 2 * index + 1] = [movements[name].velocity(time) for time in times]
    return _recorded(whole, excitations, loads, times, states, solver)


def rest_state(
    system: Joint | System,
    angle: float | Mapping[str, float] | None = None,
    excitation: Mapping[str, float] | None = None,
) -> _Vector:
    """State of a joint or system held still, its muscles steady.

    Args:
        system: The joint, or the system.
        angle: The position [rad or m], by coordinate or one for all; by default the joint's
            home angle, or the rest position of each coordinate.
        excitation: Steady excitation of each muscle; by default 0.

    Returns:
        Position and velocity of each coordinate, then the states of each muscle.
    """
    if isinstance(system, Joint):
        angle = system.home_angle if angle is None else angle
        system = System.of(system)
    if isinstance(angle, Mapping):
        positions = dict(angle)
    else:
        positions = {
            name: coordinate.rest if angle is None else float(angle)
            for name, coordinate in system.coordinates.items()
        }
    state: list[float] = []
    for name in system.coordinates:
        state += [positions[name], 0.0]
    for name, muscle in system.muscles.items():
        u = (excitation or {}).get(name, 0.0)
        state += steady_states(muscle, u, system.length(name, positions))
    return np.array(state)


def plant_torque(joint: Joint, angle: float) -> float:
    """Torque of a joint's passive elasticity at an angle [N·m]."""
    return _passive(System.of(joint).coordinates[joint.name], angle)


def _passive(coordinate: Coordinate, position: float) -> float:
    passive, deviation = coordinate.passive, position - coordinate.rest
    if passive is None:
        return -coordinate.stiffness * deviation
    return passive_torque(
        deviation,
        coordinate.stiffness,
        passive.k1_pos,
        passive.k2_pos,
        passive.k1_neg,
        passive.k2_neg,
        passive.exponent_limit,
    )


def _loads(
    system: System, torque: Mapping[str, Signal | float] | Signal | float
) -> dict[str, Signal]:
    """The external torque of every coordinate."""
    if not isinstance(torque, Mapping):
        if len(system.coordinates) > 1 and torque != 0.0:
            known = ", ".join(system.coordinates)
            raise ValueError(f"torque must be given by coordinate; there are: {known}")
        torque = dict.fromkeys(system.coordinates, torque)
    given = as_signals(torque, system.coordinates, "coordinate")
    return {name: given.get(name, as_signal(0.0)) for name in system.coordinates}


def _known_movements(system: System, movement: Mapping[str, Movement]) -> dict[str, Movement]:
    for name in movement:
        if name not in system.coordinates:
            known = ", ".join(system.coordinates)
            raise ValueError(f"unknown coordinate {name!r}; there are: {known}")
    return dict(movement)


def _rates(
    system: System,
    excitations: Mapping[str, Signal],
    loads: Mapping[str, Signal],
    movements: Mapping[str, Movement],
    begin: float,
    end: float,
) -> _Rates:
    """The right-hand side between two jumps of the inputs."""
    order = {name: index for index, name in enumerate(system.coordinates)}
    muscles = [
        (
            excitations[name],
            _equations(muscle),
            [(order[j], arm) for j, arm in system.arms[name].items()],
        )
        for name, muscle in system.muscles.items()
    ]
    spans = _spans(system)
    coordinates = [
        (coordinate, loads[name], movements.get(name))
        for name, coordinate in system.coordinates.items()
    ]
    last = end - 1e-9 * (end - begin)

    def rates(time: float, state: list[float]) -> list[float]:
        # an input that jumps at the end of the interval keeps its value from inside
        now = min(max(time, begin), last)
        result, forces, positions = [], [], []
        for index, (coordinate, load, movement) in enumerate(coordinates):
            position, velocity = state[2 * index], state[2 * index + 1]
            if movement is not None:
                position, velocity = movement.position(time), movement.velocity(time)
            positions.append(position)
            forces.append(
                load(now) - coordinate.damping * velocity + _passive(coordinate, position)
            )
            result += [velocity, 0.0]
        for (signal, equations, arms), span in zip(muscles, spans, strict=True):
            length = sum([arm * positions[joint] for joint, arm in arms])
            length_rate = sum([arm * result[2 * joint] for joint, arm in arms])
            rows, force = equations(signal(now), state[span], length, length_rate)
            result += rows
            for joint, arm in arms:
                forces[joint] -= arm * force
        for index, (coordinate, _, movement) in enumerate(coordinates):
            if movement is None:
                result[2 * index + 1] = forces[index] / coordinate.inertia
        return result

    return rates


def _spans(system: System) -> list[slice]:
    """Where the states of each muscle are."""
    first, spans = 2 * len(system.coordinates), []
    for muscle in system.muscles.values():
        count = model_of(muscle).state_count(muscle)
        spans.append(slice(first, first + count))
        first += count
    return spans


def _equations(
    muscle: Muscle,
) -> Callable[[float, list[float], float, float], tuple[list[float], float]]:
    """A muscle's rates and tension, as a function of u, its states, length and length rate."""
    model = model_of(muscle)
    if "states" in arguments(model.derivatives):
        return _array_equations(model, muscle)
    order = ("u", *model.state_names, "length", "length_rate")
    derivatives = model.bound(model.derivatives, muscle, order)
    tension = model.bound(model.tension, muscle, order)

    def values(
        u: float, states: list[float], length: float, length_rate: float
    ) -> tuple[list[float], float]:
        given = (u, *states, length, length_rate)
        return [*derivatives(*given)], tension(*given)

    return values


def _array_equations(
    model: MuscleModel, muscle: Muscle
) -> Callable[[float, list[float], float, float], tuple[list[float], float]]:
    order = ("states", "state_rates", "u", *model.state_names, "length", "length_rate")
    derivatives = model.bound(model.derivatives, muscle, order)
    tension = model.bound(model.tension, muscle, order)

    def values(
        u: float, states: list[float], length: float, length_rate: float
    ) -> tuple[list[float], float]:
        array, rates = np.array(states), np.zeros(len(states))
        named = states[: len(model.states)]
        given = (array, rates, u, *named, length, length_rate)
        derivatives(*given)
        return rates.tolist(), tension(*given)

    return values


def _knots(breaks: Iterable[tuple[float, ...]], end: float) -> list[float]:
    """Times of restart: 0, every jump inside the run, its end; sums of signals may repeat one."""
    knots = [0.0]
    for time in sorted(itertools.chain.from_iterable(breaks)):
        if knots[-1] + 1e-9 < time < end - 1e-9:
            knots.append(time)
    return [*knots, end]


def _solve(
    rates: _Rates,
    begin: float,
    end: float,
    state: _Vector,
    times: _Vector,
    rtol: float,
    atol: float,
    solver: Solver,
) -> Any:
    from scipy.integrate import solve_ivp

    result = solve_ivp(
        lambda time, values: rates(time, values.tolist()),
        (begin, end),
        state,
        method=solver,
        t_eval=np.unique(np.append(np.minimum(times, end), end)),
        rtol=rtol,
        atol=atol,
        max_step=0.02,  # no short pulse of a smooth input is stepped over
    )
    if not result.success:
        raise RuntimeError(f"the reference solver stopped at {result.t[-1]:g} s: {result.message}")
    return result.y


def _recorded(
    system: System,
    excitations: Mapping[str, Signal],
    loads: Mapping[str, Signal],
    times: _Vector,
    states: _Vector,
    solver: Solver,
) -> Recording:
    series: dict[str, _Vector] = {}
    units: dict[str, str] = {}
    for index, (name, coordinate) in enumerate(system.coordinates.items()):
        position, unit = ("position", "m") if coordinate.slide else ("angle", "rad")
        series[f"{name}.{position}"], units[f"{name}.{position}"] = states[:, 2 * index], unit
        series[f"{name}.velocity"] = states[:, 2 * index + 1]
        units[f"{name}.velocity"] = f"{unit}/s"
    for name, load in loads.items():
        series[f"{name}.applied"] = np.array([load(time) for time in times])
        units[f"{name}.applied"] = "N" if system.coordinates[name].slide else "N·m"
    order = {name: 2 * index for index, name in enumerate(system.coordinates)}
    for (name, muscle), span in zip(system.muscles.items(), _spans(system), strict=True):
        arms = system.arms[name].items()
        lengths = np.sum([arm * states[:, order[joint]] for joint, arm in arms], axis=0)
        length_rates = np.sum([arm * states[:, order[joint] + 1] for joint, arm in arms], axis=0)
        u = np.array([excitations[name](time) for time in times])
        columns = _muscle_series(muscle, u, states[:, span], lengths, length_rates)
        kinds = units_of(not system.slides(name))
        for quantity, (kind, values) in columns.items():
            series[f"{name}.{quantity}"], units[f"{name}.{quantity}"] = values, kinds[kind]
    about: dict[str, str | float] = {"joint": system.name, "solver": f"SciPy {solver}"}
    return Recording(times, {k: np.ascontiguousarray(v) for k, v in series.items()}, units, about)


def _muscle_series(
    muscle: Muscle, u: _Vector, states: _Vector, lengths: _Vector, length_rates: _Vector
) -> dict[str, tuple[str, _Vector]]:
    """Kind of unit and values of each series of a muscle, by quantity."""
    model, equations = model_of(muscle), _equations(muscle)
    columns = {"u": ("-", u)}
    for k, state in enumerate(model.states):
        if state.share:
            columns[state.name] = "-", states[:, k]
    order = ("states", "u", *model.state_names, "length", "length_rate")
    named = states[:, : len(model.states)].T
    numbers = (v.tolist() for v in (u, *named, lengths, length_rates))
    given = list(zip(states, *numbers, strict=True))
    for quantity, (kind, equation) in model.readings.items():
        value = model.bound(equation, muscle, order)
        columns[quantity] = kind, np.array([value(*row) for row in given])
    rows = zip(*(v.tolist() for v in (u, states, lengths, length_rates)), strict=True)
    columns["force"] = "force", np.array([equations(*row)[1] for row in rows])
    return columns
