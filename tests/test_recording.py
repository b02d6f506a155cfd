import numpy as np
import pytest

import mjhill


@pytest.fixture
def recording():
    generator = np.random.default_rng(1)
    time = np.arange(20) * 1e-3
    series = {"elbow.angle": generator.normal(size=20), "m.force": generator.normal(size=20) / 3}
    series["m.force"][3] = np.nan
    series["elbow.angle"][0] = 5e-324
    units = {"elbow.angle": "rad", "m.force": "N·m"}
    return mjhill.Recording(time, series, units, {"model": "test", "timestep": 1e-3})


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_recording_comes_back_with_the_same_bits(recording, tmp_path, suffix):
    path = recording.save(tmp_path / f"run{suffix}")
    loaded = mjhill.Recording.load(path)
    np.testing.assert_array_equal(loaded.time, recording.time)
    assert list(loaded) == list(recording)
    for name in recording:
        assert loaded[name].tobytes() == recording[name].tobytes()
    assert loaded.units == recording.units
    assert loaded.about == recording.about


def test_csv_is_read_by_other_tools(recording, tmp_path):
    path = recording.save(tmp_path / "run.csv")
    table = np.genfromtxt(path, delimiter=",", skip_header=2)
    np.testing.assert_array_equal(table[:, 0], recording.time)
    np.testing.assert_array_equal(table[:, 1], recording["elbow.angle"])
    assert path.read_text(encoding="utf-8").splitlines()[1] == (
        "time [s],elbow.angle [rad],m.force [N·m]"
    )


def test_an_unknown_series_lists_those_there_are(recording):
    with pytest.raises(KeyError, match=r"no series 'x'; there are: elbow.angle, m.force"):
        recording["x"]


def test_an_unknown_suffix_says_which_there_are(recording, tmp_path):
    with pytest.raises(ValueError, match=r"must end in .csv or .npz"):
        recording.save(tmp_path / "run.xls")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_says_so(recording, tmp_path):
    with pytest.raises(FileNotFoundError, match="the folder .* does not exist; make it"):
        recording.save(tmp_path / "missing" / "run.csv")


def test_a_failed_save_leaves_the_old_file_and_nothing_else(recording, tmp_path, monkeypatch):
    path = recording.save(tmp_path / "run.csv")
    before = path.read_bytes()
    broken = mjhill.Recording(recording.time, recording.series, recording.units, {"x": object()})
    with pytest.raises(TypeError):
        broken.save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "not a mjhill recording"),
        ("# {}\ntime [s],x [m]\n0.0,abc\n", "damaged recording"),
        ("# {}\ntime [s],x [m]\n0.0\n1.0,2.0\n", "damaged recording"),
    ],
)
def test_a_file_that_is_no_recording_is_refused(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        mjhill.Recording.load(path)


def test_series_must_fit_the_time_and_have_a_unit():
    with pytest.raises(ValueError, match="must have the shape of time"):
        mjhill.Recording(np.zeros(3), {"x": np.zeros(2)}, {"x": "m"})
    with pytest.raises(ValueError, match="series 'x' has no unit"):
        mjhill.Recording(np.zeros(3), {"x": np.zeros(3)}, {})
