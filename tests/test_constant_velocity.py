"""The second set of joints, whose V_max does not rise with activation."""

import mjhill
from mjhill.identification.literature_fit import from_literature
from mjhill.identification.report import parameter_text
from mjhill.joints.reader import parameter_file

CONSTANT = {"velocity_activation": 0.0}


def test_it_has_the_same_joints_without_that_term():
    joints = mjhill.read_joints("constant_velocity")
    assert list(joints) == list(mjhill.JOINTS)
    for joint in joints.values():
        for muscle in joint.muscles.values():
            assert muscle.velocity_activation == 0.0
            assert muscle.sources["velocity_activation"].startswith("fixed by mjhill identify")


def test_the_file_is_what_identify_writes():
    text = parameter_file("constant_velocity").read_text(encoding="utf-8")
    hip = from_literature("hip", fixed=CONSTANT)
    written = parameter_text([hip])
    begin, end = "\n[hip]\n", "\n[head]\n"
    assert written.partition("\n\n")[0] == text.partition("\n\n")[0]
    assert (
        written.partition(begin)[2].partition(end)[0] == text.partition(begin)[2].partition(end)[0]
    )


def test_a_fit_that_starts_from_it_keeps_the_term_away():
    hip = from_literature("hip", "constant_velocity")
    assert {muscle.velocity_activation for muscle in hip.joint.muscles.values()} == {0.0}
    assert not [item for item in hip.free if "velocity_activation" in item.name]
