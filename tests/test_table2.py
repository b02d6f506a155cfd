import pytest

import mjhill
from mjhill.literature import table2 as module
from mjhill.literature.table2 import rows_of, table2


def printed_plants():
    """J, B and K as printed, in the order of the rows."""
    lines = [
        line
        for line in module._DATA.read_text(encoding="utf-8").splitlines()
        if not line.startswith("#")
    ]
    columns = lines[0].split(",")
    first = columns.index("J_kgm2")
    return [tuple(float(cell) for cell in line.split(",")[first : first + 3]) for line in lines[1:]]


def stiffness_off(constants, plant):
    """How far K is from J/(T1 T2), as a share."""
    inertia, _, stiffness = plant
    return abs(inertia / (constants[0] * constants[1]) / stiffness - 1)


def damping_off(constants, plant):
    """How far B is from (T1 + T2) K, as a share."""
    _, damping, stiffness = plant
    return abs(sum(constants) * stiffness / damping - 1)


def test_there_are_the_22_rows_of_the_paper():
    rows = table2()
    assert len(rows) == 22
    assert {row.level for row in rows} == {0.1, 0.5}
    assert len({(row.movement, row.level) for row in rows}) == 22


def test_every_row_has_a_joint_and_muscles_that_exist():
    for row in table2():
        assert set(row.muscles) <= set(mjhill.JOINTS[row.joint].muscles), row.movement
        assert row.muscles


def test_every_joint_has_its_rows_and_no_others():
    for joint in mjhill.JOINTS.values():
        assert rows_of(joint) == [row for row in table2() if row.joint == joint.name]
    assert rows_of(mjhill.JOINTS["hip"]) == []
    muscles = [muscle for row in rows_of(mjhill.JOINTS["eye"]) for muscle in row.muscles]
    assert sorted(muscles) == ["lateral_rectus"] * 2 + ["medial_rectus"] * 2


def test_numbers_are_in_si_and_in_order():
    for row in table2():
        assert 0.3 < row.magnitude < 2.2  # 17 to 126 degrees
        assert 0.4 > row.time_constants[0] >= row.time_constants[1] > 0.01


def test_rows_without_a_note_keep_what_is_printed():
    for row in table2():
        if not row.note:
            assert row.time_constants == row.printed, row.movement


CORRECTED = [
    pytest.param(row, plant, id=f"{row.movement} {row.level}")
    for row, plant in zip(table2(), printed_plants(), strict=True)
    if row.time_constants != row.printed
]


def test_five_rows_are_corrected_and_say_why():
    assert len(CORRECTED) == 5
    assert all(parameter.values[0].note for parameter in CORRECTED)


@pytest.mark.parametrize(("row", "plant"), CORRECTED)
def test_corrected_time_constants_agree_with_j_b_and_k(row, plant):
    if "J = 0.010" in row.note:
        plant = (0.010, *plant[1:])
    # K has two digits, so it is rounded by up to 2 %; B has one or two, up to 15 % with K's
    assert stiffness_off(row.time_constants, plant) < 0.02
    assert damping_off(row.time_constants, plant) < 0.15
    assert stiffness_off(row.printed, plant) > 0.05


@pytest.mark.parametrize(
    ("row", "plant"),
    [(row, plant) for row, plant in zip(table2(), printed_plants(), strict=True) if not row.note],
)
def test_rows_without_a_note_agree_with_j_b_and_k(row, plant):
    # T1, T2, B and K have one or two digits
    assert stiffness_off(row.time_constants, plant) < 0.07
    assert damping_off(row.time_constants, plant) < 0.15
