"""A joint fitted to the literature: Table 2, passive torques, ranges of motion and facts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.evidence import Evidence, evidence_on
from mjhill.identification.fit import Identified, Residuals, Solution, intervals, solve
from mjhill.identification.free import Free, free_parameters, joint_at, joint_with, pin
from mjhill.identification.measures import Memory
from mjhill.identification.pulls import held_back, pushed
from mjhill.joints.joint import Joint
from mjhill.joints.reader import read_joints
from mjhill.literature.facts import Entry

PRIOR = 0.6  # weight of the priors
_LIGAMENTS = 1.0  # where k1 starts, in deviations: with none at all, a fit can miss them
_DIFFERENCE, _TOLERANCE = 1e-2, 1e-4  # for derivatives, and of the fit [standard deviations]

_Values = NDArray[np.float64]


def from_literature(
    joint: str,
    parameters: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
    *,
    fixed: Mapping[str, float] = MappingProxyType({}),
    start: str = "relaxed",
    facts: Sequence[Entry] | None = None,
) -> Identified:
    """Fit the free parameters of a joint to everything published about it.

    That is Table 2, passive torques, ranges of motion and facts. Deterministic: it starts from the
    bounds, not from the values in the file. Table 2 and the passive data are fitted first, then
    the facts are added.

    Args:
        joint: The joint's name.
        parameters: The parameter file; by default the one that comes with mjhill.
        progress: Called with the share done, 0 to 1.
        fixed: Parameters that are not fitted, and their values. A name such as ``hill_shape`` is
            that of every muscle, ``elbow_flexor.hill_shape`` that of one.
        start: How the joint starts a step of Table 2: ``relaxed``, or ``held`` by the antagonist,
            which is then switched off.
        facts: Facts to fit to; by default those that come with mjhill and are not held out.

    Raises:
        ValueError: The file has no such joint, nothing is published about it, a fixed parameter
            is not free or outside its bounds, the start is unknown, or a fact is held out.
        RuntimeError: The fit did not settle.
    """
    free, pinned = pin(free_parameters(joint, parameters), fixed)
    known = joint_with(read_joints(parameters)[joint], pinned)
    result = fit_evidence(_evidence(known, start, facts), free, progress)
    return replace(result, pinned=tuple(pinned))


def fit_evidence(
    evidence: Evidence, free: Sequence[Free], progress: Callable[[float], None] | None = None
) -> Identified:
    """Fit parameters of a joint to what is published about it.

    Args:
        evidence: What is published, and the joint.
        free: The parameters.
        progress: Called with the share done, 0 to 1.

    Raises:
        RuntimeError: The fit did not settle.
    """
    memory: Memory = {}

    def all_residuals(points: _Values) -> _Values:
        return evidence.residuals(free, points, memory)

    def without_facts(points: _Values) -> _Values:
        return replace(evidence, facts=()).residuals(free, points)

    def fit(residuals: Residuals, begin: _Values, told: Callable[[float], None]) -> Solution:
        return solve(
            residuals,
            len(free),
            told,
            start=begin,
            prior=PRIOR,
            difference=_DIFFERENCE,
            tolerance=_TOLERANCE,
        )

    say = progress or (lambda share: None)
    # facts say little where nothing moves as it should
    first = fit(without_facts, _begin(free), lambda share: say(0.5 * share))
    solution = fit(all_residuals, first.deviations, lambda share: say(0.5 + 0.5 * share))
    ends = intervals(all_residuals, solution, len(free), PRIOR)
    estimates = solution.estimates(free, ends, PRIOR)
    labels = [*evidence.labels, *(f"bounds of {item.name}" for item in free)]
    found, slopes = solution.residuals, solution.jacobian
    at_bound = [index for index, one in enumerate(estimates) if one.at_bound]
    for index in at_bound:
        by = pushed(labels, found, slopes[:, index], solution.deviations[index] > 0)
        estimates[index] = replace(estimates[index], pushed_by=by)
    return Identified(
        joint_at(evidence.joint, free, solution.deviations),
        tuple(free),
        tuple(estimates),
        start=evidence.start,
        held_back=MappingProxyType(held_back(labels, found, slopes, at_bound)),
    )


def _begin(free: Sequence[Free]) -> _Values:
    """Deviations at which a fit begins: the middles of the bounds, with some ligaments."""
    return np.array([_LIGAMENTS if item.path[-1] in ("k1_pos", "k1_neg") else 0.0 for item in free])


def check_evidence(
    joints: Iterable[str],
    parameters: str | Path | None = None,
    fixed: Mapping[str, float] = MappingProxyType({}),
) -> None:
    """Refuse joints without published data, before long work on others.

    Args:
        joints: Their names.
        parameters: The parameter file; by default the one that comes with mjhill.
        fixed: Parameters that are to be fixed, and their values.

    Raises:
        ValueError: There is such a joint, or it does not have what is to be fixed; the message
            names it.
    """
    known = read_joints(parameters)
    for name in joints:
        _evidence(known[name])
        try:
            pin(free_parameters(name, parameters), fixed)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None


def _evidence(
    joint: Joint, start: str = "relaxed", facts: Sequence[Entry] | None = None
) -> Evidence:
    evidence = evidence_on(joint, start=start, facts=facts)
    if not (evidence.steps or evidence.torques or evidence.ends):
        raise ValueError(
            f"nothing published on {joint.name!r} comes with mjhill; give a measurement"
        )
    return evidence
