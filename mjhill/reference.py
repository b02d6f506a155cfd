"""The same joint solved by SciPy's stiff solver: the yardstick for the MuJoCo path.

No MuJoCo in here: only the equations and the parameters.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.elements import activation_rate, excitation_rate, passive_torque
from mjhill.parameters import Joint
from mjhill.readings import shortening_velocity, steady_stretch, tension
from mjhill.recording import Recording
from mjhill.signals import Signal, as_signal, as_signals

_Vector = NDArray[np.float64]


def simulate(
    joint: Joint,
    excitation: Mapping[str, Signal | float],
    *,
    torque: Signal | float = 0.0,
    duration: float,
    start: _Vector | None = None,
    sample: float = 1e-3,
    rtol: float = 1e-9,
    atol: float = 1e-11,
) -> Recording:
    """Solve the eight equations of a joint and its two muscles.

    Implicit Runge-Kutta of order 5 (SciPy's Radau), restarted wherever an input jumps.

    Args:
        joint: The joint.
        excitation: Neural input of each muscle, by name; a muscle not named gets 0.
        torque: External torque [N·m].
        duration: Length of the run [s].
        start: State at time 0, shape (8,): angle, velocity, then n, a, s of each muscle; by
            default ``rest_state(joint)``.
        sample: Interval of the recording [s].
        rtol: Relative tolerance of each step.
        atol: Absolute tolerance of each step.

    Returns:
        The recording, with the names that ``mjhill.record`` gives.

    Raises:
        ValueError: A muscle is unknown, or a number is not positive or not finite.
        RuntimeError: The solver gave up.
    """
    for what, value in (("duration", duration), ("sample", sample)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{what} must be positive, got {value}")
    inputs = as_signals(excitation, joint.muscles, "muscle")
    inputs = {name: inputs.get(name, as_signal(0.0)) for name in joint.muscles}
    load = as_signal(torque)
    times: _Vector = np.arange(round(duration / sample) + 1, dtype=np.float64) * sample
    knots = _knots([*inputs.values(), load], float(times[-1]))
    state = rest_state(joint) if start is None else np.array(start, dtype=np.float64)
    states = np.empty((len(times), len(state)))
    states[0] = state
    for begin, end in itertools.pairwise(knots):
        fuzz = 1e-9 * sample
        inside = (times > begin + fuzz) & (times <= end + fuzz)
        rates = _rates(joint, inputs, load, begin, end)
        solution = _solve(rates, begin, end, state, times[inside], rtol, atol)
        states[inside] = solution[:, : inside.sum()].T
        state = solution[:, -1]
    return _recorded(joint, inputs, load, times, states)


def rest_state(
    joint: Joint, angle: float | None = None, excitation: Mapping[str, float] | None = None
) -> _Vector:
    """State of a joint held still at an angle, its muscles steady, shape (8,).

    Args:
        joint: The joint.
        angle: The angle [rad]; by default the joint's home angle.
        excitation: Steady input of each muscle; by default 0.
    """
    theta = joint.home_angle if angle is None else angle
    state = [theta, 0.0]
    for name, muscle in joint.muscles.items():
        u = (excitation or {}).get(name, 0.0)
        length = joint.gears[name] * theta
        state += [u, u, length - steady_stretch(muscle, u, length)]
    return np.array(state)


def _rates(
    joint: Joint, inputs: Mapping[str, Signal], load: Signal, begin: float, end: float
) -> Callable[[float, _Vector], _Vector]:
    """The right-hand side between two jumps of the inputs."""

    def rates(time: float, state: _Vector) -> _Vector:
        # an input that jumps at the end of the interval keeps its value from inside
        now = min(max(time, begin), end - 1e-9 * (end - begin))
        theta, velocity, *muscles = state.tolist()
        total = load(now) - joint.damping * velocity + plant_torque(joint, theta)
        result = [velocity, 0.0]
        for index, (name, muscle) in enumerate(joint.muscles.items()):
            n, a, s = muscles[3 * index : 3 * index + 3]
            source = inputs[name](now) if muscle.electrical_stimulation else n
            length = joint.gears[name] * theta
            result += [
                excitation_rate(inputs[name](now), n, muscle.excitation_tau),
                activation_rate(source, a, muscle.activation_tau, muscle.deactivation_tau),
                -shortening_velocity(muscle, a, length, length - s),
            ]
            total -= joint.gears[name] * tension(muscle, length - s)
        result[1] = total / joint.inertia
        return np.array(result)

    return rates


def plant_torque(joint: Joint, angle: float) -> float:
    """Torque of a joint's passive elasticity at an angle [N·m]."""
    passive = joint.passive
    return passive_torque(
        angle - joint.rest_angle,
        joint.stiffness,
        passive.k1_pos,
        passive.k2_pos,
        passive.k1_neg,
        passive.k2_neg,
        passive.exponent_limit,
    )


def _knots(signals: list[Signal], end: float) -> list[float]:
    """Times of restart: 0, every jump inside the run, its end; sums of inputs may repeat one."""
    knots = [0.0]
    for time in sorted(time for signal in signals for time in signal.breaks):
        if knots[-1] + 1e-9 < time < end - 1e-9:
            knots.append(time)
    return [*knots, end]


def _solve(
    rates: Callable[[float, _Vector], _Vector],
    begin: float,
    end: float,
    state: _Vector,
    times: _Vector,
    rtol: float,
    atol: float,
) -> Any:
    from scipy.integrate import solve_ivp

    result = solve_ivp(
        rates,
        (begin, end),
        state,
        method="Radau",
        t_eval=np.unique(np.append(np.minimum(times, end), end)),
        rtol=rtol,
        atol=atol,
        max_step=0.02,  # no short pulse of a smooth input is stepped over
    )
    if not result.success:
        raise RuntimeError(f"the reference solver stopped at {result.t[-1]:g} s: {result.message}")
    return result.y


def _recorded(
    joint: Joint,
    inputs: Mapping[str, Signal],
    load: Signal,
    times: _Vector,
    states: _Vector,
) -> Recording:
    series = {f"{joint.name}.angle": states[:, 0], f"{joint.name}.velocity": states[:, 1]}
    units = {f"{joint.name}.angle": "rad", f"{joint.name}.velocity": "rad/s"}
    series[f"{joint.name}.applied"] = np.array([load(time) for time in times])
    units[f"{joint.name}.applied"] = "N·m"
    for index, (name, muscle) in enumerate(joint.muscles.items()):
        n, a, s = states[:, 2 + 3 * index : 5 + 3 * index].T
        length = joint.gears[name] * states[:, 0]
        rows = list(zip(a.tolist(), length.tolist(), (length - s).tolist(), strict=True))
        columns = {
            "u": ("-", np.array([inputs[name](time) for time in times])),
            "n": ("-", n),
            "a": ("-", a),
            "velocity": ("rad/s", np.array([shortening_velocity(muscle, *row) for row in rows])),
            "stretch": ("rad", length - s),
            "force": ("N·m", np.array([tension(muscle, stretch) for _, _, stretch in rows])),
        }
        for quantity, (unit, values) in columns.items():
            series[f"{name}.{quantity}"] = np.ascontiguousarray(values)
            units[f"{name}.{quantity}"] = unit
    about: dict[str, str | float] = {"joint": joint.name, "solver": "SciPy Radau"}
    return Recording(times, {k: np.ascontiguousarray(v) for k, v in series.items()}, units, about)
