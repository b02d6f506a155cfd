"""Work, power and energy over a run, from the samples that it leaves.

Work is primary: mean force times displacement, summed. Power is its mean rate since the sample
before, as the ``velocity`` of a muscle is.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.engine.layout import SCALAR_JOINTS, has_passive, joint_names, muscle_ids, read_passive
from mjhill.joints.joint import passive_energy
from mjhill.simulate.samples import Samples, has_other_springs

_Values = NDArray[np.float64]
_GAUSS = ((-np.sqrt(0.6), 5 / 18), (0.0, 8 / 18), (np.sqrt(0.6), 5 / 18))  # nodes and weights


@dataclass(frozen=True)
class Path:
    """How work is summed between the samples of a run.

    MuJoCo's single-step integrators are of second order at best, and so is the mean of the force
    at the two ends of a step. RK4 is of fourth order, so there force and way are splines over
    each of the pieces in which they are smooth.

    Attributes:
        time: Times of the samples [s].
        pieces: Samples from one jump of the load to the next, both included; none where the
            mean of the two ends is used.
    """

    time: _Values
    pieces: tuple[slice, ...] = ()

    @staticmethod
    def of(model: mujoco.MjModel, samples: Samples, every: int) -> Path:
        """The path of a run."""
        if every > 1 or model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
            return Path(samples.time)
        loads = samples.arrays["qfrc_applied"]
        jumps = (np.flatnonzero(np.diff(loads, axis=0).any(axis=1)) + 1).tolist()
        edges = sorted({0, *jumps, len(loads) - 1})
        pairs = itertools.pairwise(edges)
        return Path(samples.time, tuple(slice(begin, end + 1) for begin, end in pairs))

    def work(self, force: _Values, way: _Values) -> _Values:
        """Work of a force [N·m or N] along a way [rad or m] up to each sample [J], shape (T,)."""
        if not self.pieces:
            return _summed(0.5 * (force[:-1] + force[1:]) * np.diff(way))
        from scipy.interpolate import CubicSpline

        done = []
        for piece in self.pieces:
            pull = CubicSpline(self.time[piece], force[piece])
            rate = CubicSpline(self.time[piece], way[piece]).derivative()
            half = 0.5 * np.diff(self.time[piece])
            middle = self.time[piece][:-1] + half
            nodes = [(middle + half * node, weight) for node, weight in _GAUSS]
            done.append(2 * half * sum(weight * pull(at) * rate(at) for at, weight in nodes))
        return _summed(np.concatenate(done))

    def work_at(self, forces: _Values, velocities: _Values, held: bool = False) -> _Values:
        """Work of forces on moving degrees of freedom up to each sample [J], shape (T,).

        Args:
            forces: Shape (T, nv).
            velocities: As MuJoCo has them, shape (T, nv).
            held: Whether a force keeps its value from one sample to the next, as inputs do.
        """
        steps = np.diff(self.time)[:, None]
        if not self.pieces:
            return _summed(0.5 * (forces[:-1] + forces[1:]) * velocities[1:] * steps)
        from scipy.interpolate import CubicSpline

        done = []
        for piece in self.pieces:
            load = np.ones_like(forces[piece]) if held else forces[piece]
            power = CubicSpline(self.time[piece], load * velocities[piece]).antiderivative()
            gained = np.diff(power(self.time[piece]), axis=0)
            done.append(gained * forces[piece][:-1] if held else gained)
        return _summed(np.concatenate(done))

    def power(self, work: _Values, first: float) -> _Values:
        """Mean rate of a work since the sample before [W]; ``first`` for the first sample."""
        return np.concatenate(([first], np.diff(work) / np.diff(self.time)))


def joint_energies(model: mujoco.MjModel, samples: Samples) -> Iterator[tuple[str, _Values]]:
    """Name of each elastic hinge and slide, and the energy in its elasticity [J]."""
    for joint, name in enumerate(joint_names(model)):
        if model.jnt_type[joint] not in SCALAR_JOINTS:
            continue
        stored, exponential = _spring(model, samples, joint), has_passive(model, joint)
        if exponential:
            stored += passive_energy(read_passive(model, name), _deviation(model, samples, joint))
        if exponential or stored.any():
            yield name, stored


def _deviation(model: mujoco.MjModel, samples: Samples, joint: int) -> _Values:
    at = int(model.jnt_qposadr[joint])
    deviation: _Values = samples.column("qpos", at) - model.qpos_spring[at]
    return deviation


def _spring(model: mujoco.MjModel, samples: Samples, joint: int) -> _Values:
    """Energy in the spring of a hinge or slide, whose force is -(k0 + k1 x + k2 x²) x [J]."""
    deviation = _deviation(model, samples, joint)
    stored = np.zeros_like(deviation)
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_SPRING:
        factors = [float(model.jnt_stiffness[joint]), *model.jnt_stiffnesspoly[joint].tolist()]
        for power, factor in enumerate(factors, start=2):
            if factor:
                stored += factor * deviation**power / power
    return stored


def model_mechanics(
    model: mujoco.MjModel, samples: Samples, path: Path, every: int
) -> Iterator[tuple[str, _Values]]:
    """Name and values [J] of the energies and works of a whole model.

    What is 0 throughout because the model has nothing of the kind is left out. Works need every
    step.
    """
    yield "kinetic_energy", samples.kinetic
    if samples.gravity.any():
        yield "gravity_energy", samples.gravity
    if has_other_springs(model):
        yield "spring_energy", _other_springs(model, samples)
    if every > 1:
        return
    arrays, velocities = samples.arrays, samples.arrays["qvel"]
    if arrays["qfrc_applied"].any() or samples.pushed.any():
        applied = path.work_at(arrays["qfrc_applied"], velocities, held=True)
        yield "external_work", applied + path.work_at(samples.pushed, velocities)
    works = {
        "damping_loss": -_present(arrays["qfrc_damper"], path),
        "constraint_work": arrays["qfrc_constraint"],
        "other_work": _other_forces(model, samples),
    }
    for name, forces in works.items():
        if forces.any():
            yield name, path.work_at(forces, velocities)


def _other_springs(model: mujoco.MjModel, samples: Samples) -> _Values:
    """Energy in springs of tendons, flexes, ball and free joints [J]."""
    scalar = np.flatnonzero(np.isin(model.jnt_type, SCALAR_JOINTS)).tolist()
    stored = samples.springs.copy()
    for joint in scalar:
        stored -= _spring(model, samples, joint)
    return stored


def _present(damping: _Values, path: Path) -> _Values:
    """Damping at the velocity of the sample itself; see ``Sampler``."""
    if path.pieces or len(damping) < 2:
        return damping
    ahead = 2 * damping[-1:] - damping[-2:-1]
    return 0.5 * (damping + np.concatenate((damping[1:], ahead)))


def _other_forces(model: mujoco.MjModel, samples: Samples) -> _Values:
    """Generalised forces of other actuators, of limits on muscles, of fluids and adhesion."""
    arrays = samples.arrays
    forces = arrays["qfrc_actuator"] + arrays["qfrc_fluid"] + arrays["qfrc_adhesion"]
    held = model.jnt_actgravcomp[model.dof_jntid].astype(bool)
    forces[:, held] -= arrays["qfrc_gravcomp"][:, held]  # has its energy in that of gravity
    outs = {int(model.actuator_outadr[actuator]) for actuator in muscle_ids(model)}
    for (out, dof), slope in samples.arms.items():
        if out in outs:
            forces[:, dof] -= slope * arrays["actuator_force"][:, out]
    noise = 1e-12 * np.abs(arrays["qfrc_actuator"]).max(initial=0.0)
    forces[np.abs(forces) <= noise] = 0.0
    return forces


def _summed(changes: _Values) -> _Values:
    each = changes if changes.ndim == 1 else changes.sum(axis=1)
    return np.concatenate(([0.0], np.cumsum(each)))
