"""A measurement made ready: the run of a joint that is to predict it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.inputs import is_held, step_means
from mjhill.identification.measurement import Measurement
from mjhill.identification.noise import white_noise
from mjhill.joints.joint import Joint
from mjhill.lab.batch import driving_torques, joint_angles

_OTHER = {"angle": "torque", "torque": "angle"}
_HELD = 0.02  # [rad], a joint that moves less is taken as held still
_SMOOTHING = 10.0  # [Hz], cut-off of the path of a driven joint, usual for human movement
_LONGEST_STEP = 1e-3  # [s]
_REFINEMENT = 8  # steps of the finer run to one
_EVEN = 1e-3  # of an interval, by which samples may be off and still count as even
_FASTEST_MODE = 20.0  # [Hz], of the noise of a torque; above, inertia lets little through
_MOST_MODES = 200
_START_SPAN = 0.05  # [s] from whose samples the start is guessed
_LEAST_SPREAD = 1e-6  # [rad] and [rad/s]

_Values = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """A measurement, and the run that is to predict it.

    Attributes:
        measurement: The measurement.
        quantity: What is predicted: ``angle`` [rad] or ``torque`` [N·m].
        time: Times of the samples from the first [s], shape (T,).
        grid: Times of the steps [s], shape (S,).
        held: By input, each muscle and ``torque``: whether a value lasts until the next sample,
            or straight lines join them.
        torque: External torque over each step [N·m], shape (S,), or (K, S) for K joints.
        path: Angle at each step [rad] where the torque is predicted, shape (S,), or (K, S) for K
            joints; else None.
        start: Angle [rad] and velocity [rad/s] at time 0, shape (2,).
        start_spread: Their standard deviations, shape (2,).
        finer: The same with shorter steps; None for a recording of a simulation, whose steps are
            those of the grid.
    """

    measurement: Measurement
    quantity: str
    time: _Values
    grid: _Values
    held: Mapping[str, bool]
    torque: _Values
    path: _Values | None
    start: _Values
    start_spread: _Values
    finer: Trial | None

    @property
    def measured(self) -> _Values:
        """The quantity as measured, shape (T,)."""
        return np.asarray(getattr(self.measurement, self.quantity))

    @property
    def spread(self) -> float:
        """Largest less smallest of it, in its unit."""
        return float(np.ptp(self.measured))

    @property
    def inputs(self) -> str:
        """How the inputs that change go on between samples, in words."""
        values = dict(self.measurement.excitation)
        if self.path is None:
            values["torque"] = self.measurement.torque
        used = {name: self.held[name] for name, of in values.items() if np.ptp(of) > 0}
        if len(set(used.values())) > 1:
            held = ", ".join(name for name, held in used.items() if held)
            return f"{held} held, the others joined"
        return "none" if not used else "held" if all(used.values()) else "joined"

    def predict(
        self, joints: Sequence[Joint], offsets: _Values, delays: _Values | None = None
    ) -> _Values:
        """What joints do, shape (joints, T).

        Args:
            joints: The joints.
            offsets: Deviations of their starts, shape (2, joints).
            delays: By how much their excitations come late [s], shape (joints,); by default not.
        """
        timestep = float(self.grid[1])
        muscles = list(joints[0].muscles)
        excitation = self._excitation(muscles, np.zeros(1) if delays is None else delays)
        before = [self.measurement.excitation[name][0] for name in muscles]
        if self.path is not None:
            run = driving_torques(
                joints,
                path=self.path,
                before=before,
                excitation=excitation,
                timestep=timestep,
            )
        else:
            start, velocity = self.start[:, None] + self.start_spread[:, None] * offsets
            run = joint_angles(
                joints,
                start=start,
                velocity=velocity,
                before=before,
                excitation=excitation[:, :-1],
                torque=self.torque[..., :-1],
                steps=len(self.grid) - 1,
                timestep=timestep,
            )
        return np.array([np.interp(self.time, self.grid, row) for row in run])

    def _excitation(self, muscles: Sequence[str], delays: _Values) -> _Values:
        """Excitation of muscles over each step, shape (K, S, muscles), at K delays [s]."""
        means = [
            _means(self.measurement, self.measurement.excitation[name], self.grid,
                   self.held[name], delays)
            for name in muscles
        ]  # fmt: skip
        return np.stack(means, axis=-1)

    def correction(self, joint: Joint, offsets: _Values, delays: _Values | None = None) -> _Values:
        """What endlessly short steps would add to a prediction, shape (T,).

        An error of first order in the step is extrapolated from the steps of ``finer``. It
        changes little with the parameters, so a fit finds it once for many predictions.

        Args:
            joint: The joint.
            offsets: Deviations of its start, shape (2, 1).
            delays: By how much its excitations come late [s], shape (1,).
        """
        if self.finer is None:
            return np.zeros(len(self.time))
        coarse, fine = (trial.predict([joint], offsets, delays)[0] for trial in (self, self.finer))
        return np.asarray((fine - coarse) * (_REFINEMENT / (_REFINEMENT - 1)))

    def input_errors(
        self, joint: Joint, offsets: _Values, delays: _Values | None = None
    ) -> _Values:
        """What noise of the measured torque, or of the path, does to a prediction, shape (T, K).

        The noise is white over the samples, of the size that they show. It is taken apart into
        cosines, each of its own random size, the slow ones first. Fast ones move no joint, and
        are smoothed out of a path.

        Args:
            joint: The joint.
            offsets: Deviations of its start, shape (2, 1).
            delays: By how much its excitations come late [s], shape (1,).

        Returns:
            For each cosine, of a size of one standard deviation, what it adds. None (K = 0) where
            that input has no noise.
        """
        count, measurement = len(self.time), self.measurement
        given = measurement.torque if self.path is None else measurement.angle
        size = white_noise(given)
        if measurement.simulated or size == 0:
            return np.zeros((count, 0))
        fastest = _FASTEST_MODE if self.path is None else _SMOOTHING
        modes = min(count, _MOST_MODES, int(np.ceil(2 * fastest * self.time[-1])))
        if self.path is not None and _is_still(given):
            modes = 1  # all that is used is the mean
        places = np.pi * (np.arange(count) + 0.5) / count
        cosines = np.sqrt(2 / count) * size * np.cos(np.outer(np.arange(modes), places))
        cosines[0] /= np.sqrt(2)
        disturbed = self._disturbed(np.concatenate([cosines, np.zeros((1, count))]))
        found = disturbed.predict([joint] * (modes + 1), offsets, delays)
        return np.asarray((found[:-1] - found[-1]).T)

    def _disturbed(self, rows: _Values) -> Trial:
        """The same with K series more, shape (K, T), on the torque or path, for K joints."""
        if self.path is None:
            more = [_means(self.measurement, row, self.grid, self.held["torque"]) for row in rows]
            return replace(self, torque=self.torque + np.array(more))
        if _is_still(self.measurement.angle):
            return replace(self, path=self.path + rows.mean(axis=1)[:, None])
        smooth = [_smoothed(self.time, row, self.grid) for row in rows]
        return replace(self, path=self.path + np.array(smooth))


def make_trial(
    measurement: Measurement, predict: str | None = None, inputs: str | None = None
) -> Trial:
    """A measurement of a joint made ready.

    Args:
        measurement: The measurement.
        predict: ``angle`` or ``torque``; by default torque where the joint is held still.
        inputs: ``hold`` or ``join``; by default each input as it looks, and in a recording of a
            simulation held.

    Raises:
        ValueError: What is to be predicted never changes.
    """
    quantity = predict or ("torque" if _is_still(measurement.angle) else "angle")
    if np.ptp(getattr(measurement, quantity)) == 0:
        raise ValueError(
            f"{measurement.source}: the {quantity} never changes, so there is nothing to "
            f"predict; predict the {_OTHER[quantity]} instead"
        )
    time = measurement.time - measurement.time[0]
    interval = _interval(time)
    timestep = measurement.simulated
    if timestep is None:
        timestep = interval / float(np.ceil(interval / _LONGEST_STEP - 1e-6))
    elif inputs is None and abs(interval - timestep) < _EVEN * timestep:
        inputs = "hold"
    values = {**measurement.excitation, "torque": measurement.torque}
    held = {
        name: is_held(of) if inputs is None else inputs == "hold" for name, of in values.items()
    }
    start = _start(time, measurement.angle)

    def at(step: float, finer: Trial | None) -> Trial:
        steps = int(np.ceil(time[-1] / step - 1e-6))  # free of rounding
        grid: _Values = np.arange(steps + 1, dtype=np.float64) * step
        torque = _means(measurement, measurement.torque, grid, held["torque"])
        path = _path(time, measurement.angle, grid) if quantity == "torque" else None
        return Trial(measurement, quantity, time, grid, held, torque, path, *start, finer)

    return at(timestep, None if measurement.simulated else at(timestep / _REFINEMENT, None))


def _means(
    measurement: Measurement,
    values: _Values,
    grid: _Values,
    held: bool,
    delays: _Values | float = 0.0,
) -> _Values:
    """Mean of an input over each step that begins on a grid, shape (..., S), at delays [s]."""
    time = measurement.time - measurement.time[0]
    if measurement.simulated and not held:
        time = time + 0.5 * measurement.simulated  # a recorded input is that of mid-step
    edges = np.append(grid, grid[-1] + grid[1])
    return step_means(time, values, edges, hold=held, delay=delays)


def _interval(time: _Values) -> float:
    """The interval of samples [s]: exact where they are even, else their median."""
    interval = float(np.median(np.diff(time)))
    even = np.linspace(0.0, time[-1], len(time))
    if np.abs(time - even).max() < _EVEN * interval:
        return float(time[-1]) / (len(time) - 1)
    return interval


def _is_still(angle: _Values) -> bool:
    """Whether a joint is held: but for noise, as 19 of 20 samples show, it does not move."""
    return float(np.ptp(np.quantile(angle, (0.025, 0.975)))) < _HELD


def _path(time: _Values, angle: _Values, grid: _Values) -> _Values:
    """Angle at each step of a grid: smoothed, or the mean where the joint is held."""
    if _is_still(angle):
        return np.full_like(grid, float(np.mean(angle)))
    return _smoothed(time, angle, grid)


def _smoothed(time: _Values, angle: _Values, grid: _Values) -> _Values:
    from scipy.signal import butter, sosfiltfilt

    path = np.interp(grid, time, angle)
    timestep = float(grid[1])
    cutoff = min(_SMOOTHING, 0.4 / float(np.median(np.diff(time))))
    sections = butter(2, cutoff, fs=1 / timestep, output="sos")
    # ends go on for a period and a half of the cut-off, else the last torques are far off
    beyond = min(round(1.5 / (cutoff * timestep)), len(path) - 1)
    return np.asarray(sosfiltfilt(sections, path, padlen=beyond))


def _start(time: _Values, angle: _Values) -> tuple[_Values, _Values]:
    """Angle [rad] and velocity [rad/s] at time 0, and their spreads, from the first samples.

    By a parabola, as the joint may already be speeding up. Its distance to a straight line is
    doubted too: noise is not all that it can miss, and the bounds of a fit are hard.
    """
    # six samples or more, though the first come late where times are uneven
    first = time <= max(_START_SPAN, time[:6].max())
    parabola, covariance = np.polyfit(time[first], angle[first], 2, cov=True)
    line = np.polyfit(time[first], angle[first], 1)
    spread = np.abs(parabola[1:] - line) + 2 * np.sqrt(np.diag(covariance)[1:])
    return parabola[:0:-1], spread[::-1] + _LEAST_SPREAD
