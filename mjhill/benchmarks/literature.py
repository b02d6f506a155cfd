"""Fits of the joints to the literature in other ways, and with each fact left out in turn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from mjhill.benchmarks.result import Result
from mjhill.identification.evidence import Evidence, evidence_on
from mjhill.identification.facts import facts
from mjhill.identification.fit import Identified
from mjhill.identification.free import free_parameters, joint_with, pin
from mjhill.identification.literature_fit import fit_evidence
from mjhill.identification.measures import measure as measure_fact
from mjhill.identification.rows import fact_counts, published_rows, step_rows
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.lab.rig import UnmeasuredError
from mjhill.literature.facts import Entry, read_entries

KINDS = ("variants", "facts")
_CONSTANT = {"velocity_activation": 0.0}

Progress = Callable[[float], None]


def measure(kinds: Sequence[str] = (), progress: Progress | None = None) -> Result:
    """How the joints agree with the literature when they are fitted otherwise.

    Args:
        kinds: ``variants``, other fits of all joints, which is the default; or ``facts``, each
            fact in fits without that fact, without all facts and without Table 2.
        progress: Called with the share done, from 0 to 1.

    Raises:
        ValueError: There is no such kind, or there are several.
    """
    kind = kinds[0] if len(kinds) == 1 else KINDS[0]
    if len(kinds) > 1 or kind not in KINDS:
        raise ValueError(f"--kind must be one of {', '.join(KINDS)}, got {', '.join(kinds)}")
    say = progress or (lambda share: None)
    return _variants(say) if kind == "variants" else _each_fact(say)


def _as_shipped(evidence: Evidence) -> Evidence:
    return evidence


def _without_facts(evidence: Evidence) -> Evidence:
    return replace(evidence, facts=())


def _without_table2(evidence: Evidence) -> Evidence:
    return replace(evidence, steps=())


def _with_all_facts(evidence: Evidence) -> Evidence:
    every = [replace(fact, held_out=False) for fact in read_entries()]
    return evidence_on(evidence.joint, start=evidence.start, facts=every)


def _held(evidence: Evidence) -> Evidence:
    return replace(evidence, start="held")


_VARIANTS: Mapping[str, tuple[Callable[[Evidence], Evidence], Mapping[str, float]]] = {
    "as shipped": (_as_shipped, {}),
    "V_max constant": (_as_shipped, _CONSTANT),
    "antagonist holds the start": (_held, {}),
    "without facts": (_without_facts, {}),
    "without Table 2": (_without_table2, {}),
    "held-out facts fitted too": (_with_all_facts, {}),
}


def _fitted(
    joint: str,
    change: Callable[[Evidence], Evidence] = _as_shipped,
    fixed: Mapping[str, float] | None = None,
) -> Identified:
    free, pinned = pin(free_parameters(joint), fixed or {})
    return fit_evidence(change(evidence_on(joint_with(JOINTS[joint], pinned))), free)


def _variants(say: Progress) -> Result:
    rows = []
    total = len(_VARIANTS) * len(JOINTS)
    for index, (name, (change, fixed)) in enumerate(_VARIANTS.items()):
        results = []
        for done, joint in enumerate(JOINTS, 1):
            results.append(_fitted(joint, change, fixed))
            say((index * len(JOINTS) + done) / total)
        rows.append({"fit": name, **_agreement(results)})
    notes = (
        "Facts: how many lie within one / two published standard deviations, of those that the "
        "shipped fit uses and of those that it does not.",
        "Passive: published passive torques and ranges of motion inside their interval.",
    )
    return Result("Other fits of the joints to the literature", rows, notes)


def _agreement(results: Sequence[Identified]) -> dict[str, Any]:
    joints: dict[str, Joint] = {one.joint.name: one.joint for one in results}
    steps = [row for one in results for row in step_rows(one.joint, one.start)]
    passive = [row for one in results for row in published_rows(one.joint)]
    fitted, held_out, _ = fact_counts(facts(joints))

    def shares(row: Mapping[str, Any]) -> str:
        return f"{row['within 1 SD']} / {row['within 2 SD']} of {row['count']}"

    return {
        "MAG off at most [%]": max(abs(row["off [%]"]) for row in steps),
        "T1 + T2 off at most [%]": max(abs(row["T1 + T2 off [%]"]) for row in steps),
        "passive": f"{sum(row['outside by'] is None for row in passive)} of {len(passive)}",
        "fitted facts": shares(fitted),
        "held-out facts": shares(held_out),
        "on a bound": sum(item.at_bound for one in results for item in one.estimates),
    }


def _each_fact(say: Progress) -> Result:
    entries = read_entries()
    joints = list(dict.fromkeys(fact.joint for fact in entries))
    used = [fact for fact in entries if not fact.held_out]
    total, done = 3 * len(joints) + len(used), 0
    others: dict[str, list[Joint]] = {}
    for joint in joints:
        others[joint] = []
        for change in (_as_shipped, _without_facts, _without_table2):
            others[joint].append(_fitted(joint, change).joint)
            done += 1
            say(done / total)
    rows = []
    for fact in entries:
        shipped, table2, facts_alone = (_deviation(fact, one) for one in others[fact.joint])
        left_out = None
        if not fact.held_out:

            def without(evidence: Evidence, left: Entry = fact) -> Evidence:
                return replace(evidence, facts=tuple(one for one in evidence.facts if one != left))

            left_out = _deviation(fact, _fitted(fact.joint, without).joint)
            done += 1
            say(done / total)
        rows.append(
            {
                "joint": fact.joint,
                "fact": fact.quantity,
                "use": "held out" if fact.held_out else "fitted",
                "as shipped": shipped,
                "left out": left_out,
                "without facts": table2,
                "without Table 2": facts_alone,
            }
        )
    return Result("Facts in other fits [published SD]", rows, (_left_out_note(rows),))


def _left_out_note(rows: Sequence[Mapping[str, Any]]) -> str:
    left = [row for row in rows if row["use"] == "fitted"]
    sizes = [abs(row["left out"]) for row in left if row["left out"] is not None]
    one, two = (sum(size <= most for size in sizes) for most in (1, 2))
    return (
        f"Each fitted fact left out in turn: of {len(left)}, {one} lie within one published "
        f"standard deviation and {two} within two."
    )


def _deviation(fact: Entry, joint: Joint) -> float | None:
    try:
        return float(fact.deviation(measure_fact(fact, [joint])[0]))
    except UnmeasuredError:
        return None
