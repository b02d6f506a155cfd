"""A parameter file says from which measurements its values are."""

import hashlib
import tomllib

import pytest

import mjhill
from mjhill import identification
from mjhill.identification.free import free_parameters
from mjhill.joints.reader import parameter_file, read_joints
from mjhill.lab.rig import at_rest, build_rig, record_run

ONLY = ["damping", "elbow_extensor.excitation_tau"]  # the extensor is at rest: nothing tells


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    elbow = mjhill.JOINTS["elbow"]
    rig = build_rig(elbow)
    recording = record_run(
        rig,
        at_rest(rig, elbow.home_angle),
        0.3,
        excitation={"elbow_flexor": mjhill.pulse(0.6, 0.05, 0.1)},
    )
    return recording.save(tmp_path_factory.mktemp("measured") / "trial.csv")


@pytest.fixture(scope="module")
def written(file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    identification.write(mjhill.identify("elbow", [file], only=ONLY), folder)
    return folder / "joints.toml"


def sources(path):
    """Sources of the two parameters, in the file."""
    elbow = tomllib.loads(path.read_text(encoding="utf-8"))["elbow"]
    extensor = elbow["muscles"]["elbow_extensor"]
    return elbow["damping"]["source"], extensor["excitation_tau"]["source"]


def bounds():
    """Those of the parameters, as text."""
    return {one.name: f"{one.low:g} to {one.high:g}" for one in free_parameters("elbow")}


def test_a_fitted_value_names_the_file_its_hash_and_where_its_bounds_come_from(file, written):
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    before, _ = sources(parameter_file())
    fitted, _ = sources(written)
    assert fitted.startswith(
        f"fitted to trial.csv (SHA-256 {digest[:12]}) within {bounds()['damping']}: "
    )
    assert "% from the data, 95 % interval " in fitted
    assert fitted.endswith(f"; bounds: {before}")
    joint = read_joints(written)["elbow"]
    assert joint.sources["damping"] == fitted
    assert joint.sources["stiffness"] == mjhill.JOINTS["elbow"].sources["stiffness"]


def test_a_value_that_the_data_do_not_inform_says_so(file, written):
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    _, untold = sources(written)
    assert untold.startswith(
        f"not informed by trial.csv (SHA-256 {digest[:12]}): 0 % from the data, so the value is "
        f"that of the bounds {bounds()[ONLY[1]]}; bounds: "
    )


def test_the_top_of_the_file_says_how_it_was_made(file, written):
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    head, _, rest = written.read_text(encoding="utf-8").partition("\n\n")
    assert all(line.startswith("# ") for line in head.splitlines())
    assert f"# elbow: fitted by mjhill {mjhill.__version__}, mjhill.identify" in head
    assert f"#   trial.csv: SHA-256 {digest}," in head
    assert "301 rows, angle predicted, 100.00 % of its variance explained" in head
    assert "#     inputs between rows: held\n" in head
    assert f"#   fitted: {', '.join(ONLY)}\n" in head
    assert "less than 10 % from the data and so the value of the bounds: elbow_extensor.exc" in head
    assert "is that of joints.toml, which comes with mjhill." in head
    assert str(file.parent) not in head
    assert rest.startswith(parameter_file().read_text(encoding="utf-8")[:100])


def test_the_file_is_made_again_the_same(file, written, tmp_path):
    identification.write(mjhill.identify("elbow", [file], only=ONLY), tmp_path)
    assert (tmp_path / "joints.toml").read_bytes() == written.read_bytes()


def test_a_second_fit_replaces_the_source_of_the_first_and_keeps_that_of_the_bounds(
    file, written, tmp_path
):
    result = mjhill.identify("elbow", [file], only=ONLY, parameters=written)
    identification.write(result, tmp_path, parameters=written)
    assert sources(tmp_path / "joints.toml") == sources(written)
    text = (tmp_path / "joints.toml").read_text(encoding="utf-8")
    digest = hashlib.sha256(written.read_bytes()).hexdigest()
    assert f"is that of joints.toml, SHA-256 {digest}." in text


def test_a_fit_to_the_literature_keeps_the_sources_and_the_top_of_the_file(tmp_path):
    identification.write(mjhill.identify("hip"), tmp_path)
    ours = (tmp_path / "joints.toml").read_text(encoding="utf-8")
    shipped = parameter_file().read_text(encoding="utf-8")
    assert ours[:500] == shipped[:500]
    assert "fitted to" not in ours


def test_many_files_and_odd_names_fit_on_a_line(file, tmp_path):
    paths = [tmp_path / f"a\n{index}.csv" for index in range(5)]
    for path in paths:
        path.write_bytes(file.read_bytes())
    identification.write(mjhill.identify("elbow", paths, only=["damping"]), tmp_path / "out")
    written = tmp_path / "out" / "joints.toml"
    fitted, _ = sources(written)
    assert "a\\n2.csv" in fitted
    assert " and 2 more, see the top of the file" in fitted
    assert "#   a\\n4.csv: SHA-256 " in written.read_text(encoding="utf-8")
    assert read_joints(written)
