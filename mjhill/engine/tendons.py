"""Muscle paths that jump: a tendon that slips off its wrap changes its length in no time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjhill.engine.checks import Finding
from mjhill.engine.layout import (
    SCALAR_JOINTS,
    actuator_names,
    in_order,
    joint_names,
    moments,
    muscle_groups,
    muscle_ids,
)

JUMP = 0.25  # jump of a path, in units of its muscle's compliance, that is a finding
_POSITIONS = 100  # at which each joint is looked at
_POSES = 4  # random poses of the other joints, beside qpos0
_HALVINGS = 20  # of an interval in which a path seems to jump

_Values = NDArray[np.float64]


def check_tendons(model: mujoco.MjModel) -> tuple[Finding, ...]:
    """Move each joint through its range and look for muscle paths whose length jumps.

    Others stay at ``qpos0``, then at a few random positions (always the same). A joint without a
    range is moved through a turn; a slide without one is left alone. Takes about a second for a
    leg of 80 muscles.

    Returns:
        A severe finding for each muscle that jumps, at the first place found.
    """
    muscles = [actuator for actuator in muscle_ids(model) if _is_spatial(model, actuator)]
    if not muscles:
        return ()
    sweep = _Sweep.of(model, muscles)
    ranges = {joint: span for joint in range(model.njnt) if (span := _range(model, joint))}
    random, found = np.random.default_rng(0), dict[int, Finding]()
    for pose in range(1 + _POSES):
        start = model.qpos0.copy()
        if pose:
            for joint, (low, high) in ranges.items():
                start[model.jnt_qposadr[joint]] = random.uniform(low, high)
        for joint, (low, high) in ranges.items():
            for row, place, jump in sweep.jumps(start, joint, low, high):
                if muscles[row] not in found:
                    others = "at qpos0" if pose == 0 else "elsewhere in their range"
                    found[muscles[row]] = _finding(model, muscles[row], joint, place, jump, others)
    return tuple(found[actuator] for actuator in muscles if actuator in found)


def _finding(
    model: mujoco.MjModel, actuator: int, joint: int, place: float, jump: float, others: str
) -> Finding:
    hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    where = f"{math.degrees(place):.3g}°" if hinge else f"{place:.3g} m"
    stretch = _compliances(model)[actuator]
    return Finding(
        f"muscle {actuator_names(model)[actuator]!r}",
        f"its length jumps by {1e3 * jump:.3g} mm where joint {joint_names(model)[joint]!r} passes "
        f"{where} (other joints {others}): its tendon slips off a wrapping geom; its whole "
        f"force comes with a change of length of {1e3 * stretch:.3g} mm",
        "move the geom, its sidesite or the path's sites so that the tendon stays on the geom over "
        "the whole range of the joint, or narrow that range",
        True,
    )


@dataclass(frozen=True)
class _Sweep:
    """Lengths and moment arms of muscles at any position of a joint."""

    model: mujoco.MjModel
    data: mujoco.MjData
    outs: NDArray[np.int32]
    limits: _Values

    @staticmethod
    def of(model: mujoco.MjModel, muscles: list[int]) -> _Sweep:
        compliances = _compliances(model)
        limits = JUMP * np.array([compliances[actuator] for actuator in muscles])
        return _Sweep(model, mujoco.MjData(model), model.actuator_outadr[muscles], limits)

    def jumps(
        self, start: _Values, joint: int, low: float, high: float
    ) -> Iterator[tuple[int, float, float]]:
        """Row of each muscle that jumps as a joint moves, position of the joint, and size."""
        self.data.qpos[:] = start
        places = np.linspace(low, high, _POSITIONS)
        lengths, arms = map(np.array, zip(*(self._at(joint, p) for p in places), strict=True))
        unexplained = _unexplained(places, lengths, arms)
        for row in np.flatnonzero((unexplained > self.limits).any(axis=0)).tolist():
            k = int(np.argmax(unexplained[:, row]))
            place, jump = self._narrowed(joint, row, places[k], places[k + 1])
            if jump > self.limits[row]:
                yield row, place, jump

    def _narrowed(self, joint: int, row: int, low: float, high: float) -> tuple[float, float]:
        """Where in an interval a length jumps, and by how much: of two halves the one with more."""
        for _ in range(_HALVINGS):
            places = np.array([low, (low + high) / 2, high])
            lengths, arms = map(np.array, zip(*(self._at(joint, p) for p in places), strict=True))
            halves = _unexplained(places, lengths[:, [row]], arms[:, [row]])[:, 0]
            low, high = (low, places[1]) if halves[0] >= halves[1] else (places[1], high)
        return low, float(halves.max())

    def _at(self, joint: int, position: float) -> tuple[_Values, _Values]:
        model, data = self.model, self.data
        data.qpos[model.jnt_qposadr[joint]] = position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_transmission(model, data)
        arms = moments(model, data)[self.outs, model.jnt_dofadr[joint]]
        return data.actuator_length[self.outs].copy(), arms


def _compliances(model: mujoco.MjModel) -> dict[int, float]:
    """Change of length by which the force of each muscle goes from 0 to the largest, by id."""
    (values,) = in_order(muscle_groups(model), "compliance")
    return dict(zip(muscle_ids(model), values.tolist(), strict=True))


def _unexplained(places: _Values, lengths: _Values, arms: _Values) -> _Values:
    """How much more lengths change between places than moment arms say, shape (n - 1, nmuscle)."""
    expected = (arms[1:] + arms[:-1]) / 2 * np.diff(places)[:, None]
    return np.abs(np.diff(lengths, axis=0) - expected)


def _is_spatial(model: mujoco.MjModel, actuator: int) -> bool:
    if model.actuator_trntype[actuator] != mujoco.mjtTrn.mjTRN_TENDON:
        return False
    tendon = model.actuator_trnid[actuator, 0]
    first, count = model.tendon_adr[tendon], model.tendon_num[tendon]
    wraps = (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER))
    return bool(np.isin(model.wrap_type[first : first + count], wraps).any())


def _range(model: mujoco.MjModel, joint: int) -> tuple[float, float] | None:
    """Positions that a joint may take; None for one that is not moved."""
    if model.jnt_type[joint] not in SCALAR_JOINTS:
        return None
    if model.jnt_limited[joint]:
        low, high = model.jnt_range[joint].tolist()
        return low, high
    hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    return (-math.pi, math.pi) if hinge else None
