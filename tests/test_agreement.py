"""The rows of a report: what of the literature a fitted joint meets, and what is on a bound."""

from dataclasses import replace

import numpy as np
import pytest

import mjhill
from mjhill.identification.evidence import evidence_on
from mjhill.identification.facts import facts
from mjhill.identification.free import free_parameters
from mjhill.identification.literature_fit import from_literature
from mjhill.identification.rows import agreement_rows, bound_rows, fact_counts, step_rows


@pytest.fixture(scope="module")
def hip():
    return from_literature("hip")


@pytest.fixture(scope="module")
def hip_facts(hip):
    return facts({"hip": hip.joint})


def test_every_piece_of_evidence_has_one_row(hip, hip_facts):
    rows = agreement_rows(hip, hip.joint, hip_facts)
    assert len(rows) == len({row["quantity"] for row in rows}) == 6 + 4
    assert {row["met"] for row in rows} == {"yes"}
    held_out = [fact.quantity for fact in hip_facts if fact.held_out]
    marked = [row["quantity"] for row in rows if row["against"] == "held out"]
    assert [quantity.rpartition(" [")[0] for quantity in marked] == held_out


def test_what_is_not_met_names_what_is_against_it(hip, hip_facts):
    moved = replace(hip.joint, stiffness=200.0)
    rows = {row["quantity"]: row for row in agreement_rows(hip, moved, hip_facts)}
    stiff = rows["passive torque at 90° [N·m]"]
    assert stiff["met"] == "no"
    assert stiff["against"]


def test_facts_are_counted_by_their_use(hip_facts):
    fitted, held_out, every = fact_counts(hip_facts)
    assert (fitted["count"], held_out["count"], every["count"]) == (3, 1, 4)
    assert every["within 2 SD"] == fitted["within 2 SD"] + held_out["within 2 SD"] == 4


def test_a_parameter_on_a_bound_says_where_the_bound_is_from_and_what_pushes(hip):
    (row,) = bound_rows(hip)
    assert (row["parameter"], row["side"]) == ("hip_extensor.optimal_length", "upper")
    assert row["bound"] == 1.65
    assert row["the bound is"].startswith("Anderson, Madigan & Nussbaum 2007")
    assert row["better beyond it"]


def test_each_residual_has_a_label():
    evidence = evidence_on(mjhill.JOINTS["head"])
    free = free_parameters("head")
    assert evidence.residuals(free, np.zeros((len(free), 1))).shape == (len(evidence.labels), 1)


def test_the_share_of_recoil_is_the_way_to_rest():
    joint = mjhill.JOINTS["elbow"]
    (row,) = [row for row in step_rows(joint) if row["movement"] == "Elbow flexion"][:1]
    way = np.degrees(joint.rest_angle - joint.postures["elbow_flexor"])
    assert row["recoil [%]"] == pytest.approx(100 * way / row["MAG [°]"])
