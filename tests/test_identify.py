"""A joint is fitted and its results are written from Python, as the command does it."""

import json
from dataclasses import replace

import pytest

import mjhill
from mjhill import identification
from mjhill.joints.reader import read_joints
from mjhill.lab.rig import at_rest, build_rig, record_run


@pytest.fixture(scope="module")
def hip():
    return mjhill.identify("hip")


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A short movement of an elbow with more damping, as a measurement file."""
    rig = build_rig(replace(mjhill.JOINTS["elbow"], damping=0.3))
    recording = record_run(
        rig,
        at_rest(rig, mjhill.JOINTS["elbow"].home_angle),
        0.3,
        excitation={"elbow_flexor": mjhill.pulse(0.6, 0.05, 0.1)},
    )
    return recording.save(tmp_path_factory.mktemp("measured") / "elbow.csv")


def test_a_fit_to_the_literature_can_be_printed_and_written(hip, tmp_path):
    assert "stiffness: " in str(hip)
    shares = []
    report = identification.write(hip, tmp_path / "new" / "folder", progress=shares.append)
    files = identification.output_files(["hip"], tmp_path / "new" / "folder")
    assert sorted(files.values()) == sorted((tmp_path / "new" / "folder").iterdir())
    assert json.loads(files["numbers"].read_text(encoding="utf-8")) == report
    assert [row["parameter"] for row in report["Parameters"]] == [one.name for one in hip.free]
    written = read_joints(files["parameters"])["hip"]
    assert written.stiffness == pytest.approx(hip.joint.stiffness, rel=5e-4)  # four digits
    page = files["page"].read_text(encoding="utf-8")
    for title, rows in report.items():  # the hip is not in Table 2
        assert (f"## {title}\n" in page) == bool(rows)


@pytest.mark.parametrize("read", [False, True])
def test_a_fit_to_a_file_or_to_a_measurement_is_the_same(file, tmp_path, read):
    elbow = mjhill.JOINTS["elbow"]
    measurement = identification.read_measurement(file, elbow) if read else file
    result = mjhill.identify("elbow", [measurement], only=["damping"])
    assert result.joint.damping == pytest.approx(0.3, rel=0.01)
    (prediction,) = result.predictions
    assert prediction.explained > 0.999
    report = identification.write(result, tmp_path)
    assert list(report) == ["Measurements", "Parameters"]
    files = identification.output_files(["elbow"], tmp_path, measured=True)
    assert sorted(files.values()) == sorted(tmp_path.iterdir())
    written = read_joints(files["parameters"])
    assert {**written, "elbow": 0} == {**mjhill.JOINTS, "elbow": 0}


def test_fits_of_both_kinds_are_written_into_one_parameter_file(hip, file, tmp_path):
    elbow = mjhill.identify("elbow", [file], only=["damping"])
    report = identification.write([elbow, hip], tmp_path)
    assert [row["measurement"] for row in report["Measurements"]] == [str(file)]
    assert {row["joint"] for row in report["Passive torques and ranges of motion"]} == {"hip"}
    assert {row["joint"] for row in report["Parameters"]} == {"elbow", "hip"}
    written = read_joints(tmp_path / "joints.toml")
    assert written["elbow"].damping == pytest.approx(0.3, rel=0.01)


def test_nothing_to_write_and_no_place_to_write_to_are_errors(hip, tmp_path):
    with pytest.raises(ValueError, match="there is no result to write"):
        identification.write([], tmp_path)
    (tmp_path / "hip.png").mkdir()
    with pytest.raises(IsADirectoryError, match=r"hip\.png"):
        identification.write(hip, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["hip.png"]


def test_notes_on_a_measurement_are_printed_and_written(file, tmp_path):
    measurement = identification.read_measurement(file, mjhill.JOINTS["elbow"])
    measurement = replace(measurement, notes=("read with a decimal comma",))
    result = mjhill.identify("elbow", [measurement], only=["damping"])
    assert str(result).splitlines()[-1] == f"note: {file}: read with a decimal comma"
    report = identification.write(result, tmp_path)
    assert report["Measurements"][0]["notes"] == ["read with a decimal comma"]
    text = (tmp_path / "joints.toml").read_text(encoding="utf-8")
    assert "\n#     read with a decimal comma\n" in text
