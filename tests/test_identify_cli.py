import json
from pathlib import Path

import matplotlib.image
import pytest
from click.testing import CliRunner

import mjhill
from mjhill.cli import main
from mjhill.joints.reader import parameter_file, read_joints
from mjhill.lab.rig import at_rest, build_rig, record_run

FILES = ["facts.png", "hip.png", "identify.json", "joints.toml", "report.md"]


def identify(*arguments):
    return CliRunner().invoke(main, ["identify", *map(str, arguments)])


def names(folder):
    return sorted(path.name for path in Path(folder).iterdir())


def refused(result, message, code=2):
    assert result.exit_code == code
    assert message in result.stderr
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.stderr


@pytest.fixture
def measurement(elbow, tmp_path):
    """A file of a short movement of the elbow."""
    bench = build_rig(elbow)
    recording = record_run(
        bench,
        at_rest(bench, elbow.home_angle),
        0.3,
        excitation={"elbow_flexor": mjhill.pulse(0.6, 0.05, 0.1)},
    )
    return recording.save(tmp_path / "measured.csv")


def test_a_joint_is_fitted_to_the_literature_and_written(tmp_path):
    result = identify("hip", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert names(tmp_path / "out") == FILES
    for title in ("Facts counted", "Joint hip", "Parameters"):
        assert title in result.stdout
    for name in FILES:
        assert name in result.stdout
    # what is written is what comes with mjhill, but for the last of its four digits
    joint = read_joints(tmp_path / "out" / "joints.toml")["hip"]
    assert joint.stiffness == pytest.approx(mjhill.JOINTS["hip"].stiffness, rel=2e-3)
    assert matplotlib.image.imread(tmp_path / "out" / "hip.png").std() > 0.01


def test_json_is_what_the_file_holds(tmp_path):
    result = identify("hip", "-o", tmp_path / "out", "--json")
    report = json.loads(result.stdout)
    assert report == json.loads((tmp_path / "out" / "identify.json").read_text(encoding="utf-8"))
    joint = read_joints(tmp_path / "out" / "joints.toml")["hip"]
    (row,) = (row for row in report["Parameters"] if row["parameter"] == "stiffness")
    assert row["value"] == pytest.approx(joint.stiffness, rel=5e-4)  # four digits
    assert row["95 % from"] <= row["value"] <= row["to"]
    assert report["Table 2"] == []
    assert all(row["source"] for row in report["Passive torques and ranges of motion"])


def test_a_measurement_is_fitted_and_the_other_parameters_stay(tmp_path, measurement):
    result = identify(
        "elbow", "-d", measurement, "--fit", "damping", "--fit", "stiffness",
        "-o", tmp_path / "out", "--json",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout)
    (row,) = report["Measurements"]
    assert (row["measurement"], row["samples"]) == (str(measurement), 301)
    assert row["variance explained [%]"] > 99.9
    assert [row["parameter"] for row in report["Parameters"]] == ["damping", "stiffness"]
    written = read_joints(tmp_path / "out" / "joints.toml")
    assert written["elbow"].damping == pytest.approx(mjhill.JOINTS["elbow"].damping, rel=0.01)
    assert written["elbow"].muscles == mjhill.JOINTS["elbow"].muscles
    assert {**written, "elbow": 0} == {**mjhill.JOINTS, "elbow": 0}
    assert names(tmp_path / "out") == ["elbow.png", "identify.json", "joints.toml"]


def test_a_trial_made_by_run_gives_the_truth_again(tmp_path):
    trial = tmp_path / "trial.csv"
    inputs = ("--excite", "elbow_flexor=0.6@0.1:0.5", "--torque", "elbow=2@1")
    run = CliRunner().invoke(
        main, ["run", "elbow", *inputs, "--duration", "1.5", "--output", str(trial)]
    )
    assert run.exit_code == 0, run.stderr
    flexor = mjhill.JOINTS["elbow"].muscles["elbow_flexor"]
    names = ("max_isometric_force", "excitation_tau")
    fits = [word for name in names for word in ("--fit", f"elbow_flexor.{name}")]
    result = identify("elbow", "-d", trial, *fits, "--delay", "-o", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout)
    (row,) = report["Measurements"]
    assert row["inputs"] == "held"
    *rows, delay = report["Parameters"]
    for name, row in zip(names, rows, strict=True):
        assert row["value"] == pytest.approx(getattr(flexor, name), rel=1e-4)
    assert (delay["parameter"], delay["bounds from"], delay["up to"]) == ("delay", 0.0, 0.1)
    assert delay["95 % from"] == 0.0
    assert delay["value"] < 1e-5


def test_inputs_are_joined_when_told_so(tmp_path, measurement):
    fit = ("elbow", "-d", measurement, "--fit", "damping", "-o", tmp_path / "out", "--json")
    for option, word in (("--join", "joined"), ("--hold", "held")):
        (row,) = json.loads(identify(*fit, option).stdout)["Measurements"]
        assert row["inputs"] == word


def test_a_bad_cell_is_named_and_nothing_is_written(tmp_path, measurement):
    lines = measurement.read_text(encoding="utf-8").splitlines()
    cells = lines[99].split(",")
    cells[lines[1].split(",").index("elbow.angle [rad]")] = "n/a"
    lines[99] = ",".join(cells)
    measurement.write_text("\n".join(lines), encoding="utf-8")
    result = identify("elbow", "-d", measurement, "-o", tmp_path / "out")
    refused(result, f"{measurement}: row 100, column 'elbow.angle [rad]': 'n/a' is not a number")
    assert names(tmp_path / "out") == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["wing"], "unknown joint 'wing'; there are: elbow, wrist"),
        (["-d", "x.csv"], "name the one joint that was measured, got 0"),
        (["elbow", "knee", "-d", "x.csv"], "name the one joint that was measured, got 2"),
        (["elbow", "--fit", "damping"], "--hold, --join and --delay go with --data"),
        (["elbow", "--torque", "0"], "--predict, --fit, --torque, --decimal, --hold"),
        (["elbow", "--predict", "angle"], "--predict, --fit, --torque, --decimal, --hold"),
        (["elbow", "--hold"], "--hold, --join and --delay go with --data"),
        (["elbow", "--delay"], "--hold, --join and --delay go with --data"),
    ],
)
def test_wrong_arguments_end_in_one_line_and_leave_no_folder(arguments, message):
    refused(identify(*arguments), message)
    assert not Path("out").exists()


def test_an_unknown_parameter_is_refused_and_nothing_written(tmp_path, measurement):
    result = identify("elbow", "-d", measurement, "--fit", "strength", "-o", tmp_path / "out")
    refused(result, "unknown free parameter 'strength'; there are: damping")
    assert names(tmp_path / "out") == []


def test_a_measurement_that_is_not_there_is_refused(tmp_path):
    result = identify("elbow", "-d", "none.csv", "-o", tmp_path / "out")
    refused(result, "none.csv: there is no such file", code=1)


def test_an_output_that_is_no_folder_is_refused_before_the_fit(tmp_path):
    file = tmp_path / "out"
    file.write_text("mine")
    refused(identify("hip", "-o", file), str(file), code=1)
    refused(identify("hip", "-o", file / "deeper"), str(file), code=1)
    assert file.read_text() == "mine"


def test_a_file_to_be_written_that_is_a_folder_is_refused_before_the_fit(tmp_path):
    (tmp_path / "out" / "hip.png").mkdir(parents=True)
    refused(identify("hip", "-o", tmp_path / "out"), "it is a folder; give a file name", code=1)
    assert names(tmp_path / "out") == ["hip.png"]


def test_another_parameter_file_is_taken_with_its_comments(tmp_path):
    text = parameter_file().read_text(encoding="utf-8")
    hip = "# of one subject\n" + text[text.index("[hip]") : text.index("[head]")]
    (tmp_path / "mine.toml").write_text(hip, encoding="utf-8")
    result = identify("--parameters", tmp_path / "mine.toml", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    written = (tmp_path / "out" / "joints.toml").read_text(encoding="utf-8")
    assert written.startswith("# of one subject\n[hip]")
    assert list(read_joints(tmp_path / "out" / "joints.toml")) == ["hip"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[hip]", "[hip", "not a parameter file"),
        ("inertia = { value = ", "inertia = { value = -", "hip: inertia must be in (0, 10000]"),
        ("bounds = [", "bounds = [90.0, ", "must be two numbers, [low, high], got [90.0, "),
    ],
)
def test_a_malformed_parameter_file_is_refused(tmp_path, old, new, message):
    text = parameter_file().read_text(encoding="utf-8")
    start = text.index("[hip]")
    path = tmp_path / "mine.toml"
    path.write_text(text[:start] + text[start:].replace(old, new, 1), encoding="utf-8")
    refused(identify("hip", "--parameters", path), f"{path}: ")
    refused(identify("hip", "--parameters", path), message)
    assert not Path("out").exists()


@pytest.mark.parametrize("name", ["../trav", "/tmp/trav"])
def test_a_joint_named_like_a_path_is_refused_and_nothing_written(tmp_path, name):
    text = parameter_file().read_text(encoding="utf-8")
    hip = text[text.index("[hip]") : text.index("[head]")].replace("[hip", f'["{name}"')
    path = tmp_path / "mine.toml"
    path.write_text(hip, encoding="utf-8")
    result = identify(name, "--parameters", path, "-o", tmp_path / "out")
    refused(result, f"{path}: joint {name!r}: a name must be 1 to 64 letters")
    assert names(tmp_path) == ["mine.toml"]


@pytest.fixture
def cells(measurement):
    """Time, angle [rad], torque and excitations of the measurement, by title."""
    lines = measurement.read_text(encoding="utf-8").splitlines()[1:]
    table = [line.split(",") for line in lines]
    wanted = ("time [s]", "elbow.angle [rad]", "elbow_flexor.u [-]", "elbow_extensor.u [-]")
    return {title: [row[table[0].index(title)] for row in table[1:]] for title in wanted}


def saved(path, titles, cells, delimiter=","):
    rows = zip(*cells.values(), strict=True)
    path.write_text("\n".join(delimiter.join(row) for row in [titles, *rows]), encoding="utf-8")
    return path


def test_radians_called_degrees_fail_with_the_cause_and_leave_only_the_figure(tmp_path, cells):
    titles = ("time [s]", "angle [deg]", "flexor", "extensor")
    path = saved(tmp_path / "mine.csv", titles, cells)
    out = tmp_path / "out"
    result = identify(
        "elbow", "-d", path, "--torque", "0", "--predict", "angle", "--fit", "damping", "-o", out
    )
    refused(result, "the fit failed, as it explains less than 50 % of the variance", code=1)
    assert f"{path}: its angle is predicted worse than by its mean" in result.stderr
    assert "is its angle in radians, though its unit says degrees?" in result.stderr
    assert f"{out / 'elbow.png'} shows it, and no parameter file was written" in result.stderr
    assert result.stdout == ""
    assert names(out) == ["elbow.png"]
    assert matplotlib.image.imread(out / "elbow.png").std() > 0.01


def test_notes_on_a_file_are_printed_and_in_the_json(tmp_path, cells):
    titles = ("Time (s)", "Angle (rad)", "flexor", "extensor")
    commas = {title: [cell.replace(".", ",") for cell in column] for title, column in cells.items()}
    path = saved(tmp_path / "mine.csv", titles, commas, delimiter=";")
    arguments = ("elbow", "-d", path, "--fit", "damping", "--torque", "0", "-o", tmp_path / "out")
    notes = ["read with a decimal comma", "torque: 0 N·m, as given"]
    result = identify(*arguments)
    assert result.exit_code == 0, result.stderr
    for note in notes:
        assert f"note: {path}: {note}" in result.stdout
    report = json.loads(identify(*arguments, "--decimal", ",", "--json").stdout)
    assert report["Measurements"][0]["notes"] == notes


@pytest.mark.parametrize("option", [("--decimal", "."), ("--torque", "0")])
def test_an_option_of_files_is_given_once_or_once_for_each(tmp_path, measurement, option):
    arguments = [argument for file in (measurement,) * 3 for argument in ("-d", file)]
    result = identify("elbow", *arguments, *option, *option, "-o", tmp_path / "out")
    message = f"{option[0][2:]} must be given once, or once for each of the 3 measurements, got 2"
    refused(result, message)
    assert names(tmp_path / "out") == []
