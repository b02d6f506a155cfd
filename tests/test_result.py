"""What an experiment gives, in words for people."""

import pytest

from mjhill.experiments import Claim, Measure
from mjhill.experiments.result import spoken


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("ankle_dorsiflexor: 91 ms", "ankle dorsiflexor: 91 ms"),
        ("flexor_carpi_radialis", "flexor carpi radialis"),
        ("V_max of long head", "V_max of long head"),
        ("", ""),
    ],
)
def test_identifiers_become_words_and_symbols_stay(text, wanted):
    assert spoken(text) == wanted


def test_measures_and_claims_are_in_words_for_people():
    measure = Measure("elbow_flexor: T1", 1.0, "ms", note="wrist_rotation drifts away")
    assert (measure.name, measure.note) == ("elbow flexor: T1", "wrist rotation drifts away")
    assert Claim("It is.", "4", True, "elbow_flexor: 1 ms").evidence == "elbow flexor: 1 ms"
