import copy
import dataclasses
import io
import json
import os
import pickle
import struct
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.simulate import recording_files


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
        ("", "not a mjhill recording"),
        ("# {}\ntime [s],x [m]\n0.0,abc\n", r"line 3, column 'x \[m\]': 'abc' is not a number"),
        ("# {}\ntime [s],x [m]\n0.0,1.0\n1.0\n", "line 4 must have 2 cells as the header, got 1"),
        ("# {}\ntime [s],x [m],y [m]\n0.0,1.0\n2.0,3.0\n4.0,5.0\n", "line 3 must have 3 cells"),
        ("# {}\ntime [s],x [m]\n0.0,1.0\n\n1.0,2.0\n", "line 4 must have 2 cells .* got 0"),
        ("# {}\ntime [s],x\n0.0,1.0\n", r"title of column 2 must read 'name \[unit\]', got 'x'"),
        ("# {}\ntime [s],x [m],x [rad]\n0.0,1.0,2.0\n", "column 3 has the name of another, 'x'"),
        ("# [1]\ntime [s]\n0.0\n", "must be a JSON object"),
        ("# {\ntime [s]\n0.0\n", "no JSON"),
        (f"# {'[' * 100_000}\ntime [s]\n0.0\n", "no JSON"),
        (f'# {{"x": {"1" * 10_000}}}\ntime [s]\n0.0\n', "no JSON"),
        ('# {"x": [1]}\ntime [s]\n0.0\n', "must hold texts and numbers, got .* for 'x'"),
        ('# {"format": 9}\ntime [s]\n0.0\n', "format 9, .* upgrade mjhill"),
        ('# {"format": 2}\ntime [s]\n0.0\n', "'about' and 'muscles' must be JSON objects"),
        ('# {"format": 2, "about": {}, "muscles": {"m": {"x": 1}}}\ntime [s]\n0.0\n', "muscle 'm'"),
        (f'# {{}}\ntime [s],"{"x" * 200_000} [m]"\n0.0,1.0\n', "field larger than field limit"),
        ('# {}\ntime [s],x [m]\n0.0,"1.0\n', "damaged recording"),
    ],
)
def test_a_file_that_is_no_recording_is_refused(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=f"bad.csv: .*{message}"):
        mjhill.Recording.load(path)


def test_series_must_fit_the_time_and_have_a_unit():
    with pytest.raises(ValueError, match="must have the shape of time"):
        mjhill.Recording(np.zeros(3), {"x": np.zeros(2)}, {"x": "m"})
    with pytest.raises(ValueError, match="series 'x' has no unit"):
        mjhill.Recording(np.zeros(3), {"x": np.zeros(3)}, {})


@pytest.fixture
def run(pair):
    """A real recording, with the parameters of its muscles."""
    with mjhill.installed():
        return mjhill.record(pair, rest(pair), duration=0.02, excitation={"elbow_flexor": 0.5})


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_run_comes_back_whole_and_with_its_muscles(run, tmp_path, suffix):
    loaded = mjhill.Recording.load(run.save(tmp_path / f"run{suffix}"))
    assert loaded == run
    assert list(loaded.muscles) == ["elbow_flexor", "elbow_extensor"]
    assert loaded.muscles == run.muscles


ODD_NAMES = [
    "time", "meta", "file", "allow_pickle", "series", "arr_0", "time [s]", "a [b]", "a, b", 'a"b',
    "'", "a\nb", "a\rb", "a\r\nb", "\x1b[31mred", "a\x00b", "../../up", "/etc/x.npy", "x.npy",
    "meta.json", " x ", "#", "# {}", "=1+1", "é·µ θ", "\u2028", "x" * 10_000, "a [m] [rad", "[",
    "]",
]  # fmt: skip


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_any_name_comes_back(tmp_path, suffix):
    series = {name: np.array([float(i), -0.0, 1 / 3]) for i, name in enumerate(ODD_NAMES)}
    units = {name: ("-", "N·m", "", "rad/s")[i % 4] for i, name in enumerate(ODD_NAMES)}
    odd = mjhill.Recording(np.arange(3.0), series, units, {"\n": "\x1b", "é": 1e-300})
    assert mjhill.Recording.load(odd.save(tmp_path / f"odd{suffix}")) == odd


@pytest.mark.parametrize(
    ("name", "unit", "message"),
    [
        ("", "m", "must be text of 1 to 10000, got 0 characters"),
        ("x" * 10_001, "m", "must be text of 1 to 10000, got 10001 characters"),
        (3, "m", "must be text of 1 to 10000, got 3"),
        ("\ud800", "m", "cannot be written as UTF-8; rename it"),
        ("x", "[m]", r"without brackets, got '\[m\]'"),
        ("x", "m\n", "must be short printable text"),
        ("x", 1, "must be short printable text"),
    ],
)
def test_a_name_or_unit_that_could_not_be_saved_is_refused(name, unit, message):
    with pytest.raises(ValueError, match=message):
        mjhill.Recording(np.zeros(1), {name: np.zeros(1)}, {name: unit})


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
@pytest.mark.parametrize("samples", [0, 1, 3])
def test_short_and_empty_recordings_come_back(tmp_path, suffix, samples):
    for names in ([], ["x"], ["x", "y"]):
        series = {name: np.arange(samples) / 7 for name in names}
        short = mjhill.Recording(np.arange(float(samples)), series, dict.fromkeys(names, "m"))
        assert mjhill.Recording.load(short.save(tmp_path / f"short{suffix}")) == short


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_random_bits_come_back(tmp_path, suffix):
    values = np.random.default_rng(3).integers(0, 2**64, (4, 500), np.uint64).view(np.float64)
    values[np.isnan(values)] = np.nan  # decimals keep the sign of one, but no payload
    values[0, :6] = [np.nan, -np.nan, np.inf, -np.inf, -0.0, 5e-324]
    series = {str(i): row for i, row in enumerate(values)}
    noise = mjhill.Recording(np.arange(500.0), series, dict.fromkeys(series, "-"))
    assert mjhill.Recording.load(noise.save(tmp_path / f"noise{suffix}")) == noise


@pytest.mark.parametrize(
    "copied",
    [
        copy.copy,
        copy.deepcopy,
        lambda value: pickle.loads(pickle.dumps(value)),
        dataclasses.replace,
    ],
)
def test_a_copy_of_a_recording_is_equal(run, copied):
    other = copied(run)
    assert other == run
    other = copy.deepcopy(other)
    other["elbow.angle"][3] += 1e-12
    assert other != run
    assert run != "something else"


def test_a_recording_as_a_dict_holds_its_series(run):
    values = dataclasses.asdict(run)
    np.testing.assert_array_equal(values["series"]["elbow.angle"], run["elbow.angle"])
    assert values["muscles"]["elbow_flexor"]["max_velocity"] > 1


def test_values_that_are_not_real_numbers_are_refused():
    for values in (np.array([1j]), np.array(["a"]), np.array([None]), [object()]):
        with pytest.raises(ValueError, match="series 'x' must hold real numbers, got"):
            mjhill.Recording(np.zeros(1), {"x": values}, {"x": "m"})
    with pytest.raises(ValueError, match=r"time must have one dimension, got shape \(2, 2\)"):
        mjhill.Recording(np.zeros((2, 2)), {}, {})
    whole = mjhill.Recording(np.arange(2), {"x": np.arange(2)}, {"x": "m"})
    assert whole["x"].dtype == np.float64


def members(recording, tmp_path):
    path = recording.save(tmp_path / "good.npz")
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(path, contents, compression=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return path


def test_numpy_reads_an_npz(run, tmp_path):
    with np.load(run.save(tmp_path / "run.npz"), allow_pickle=False) as archive:
        names = json.loads(archive["meta.json"])["names"]
        np.testing.assert_array_equal(archive["time"], run.time)
        row = archive["series"][names.index("elbow_flexor.force")]
    np.testing.assert_array_equal(row, run["elbow_flexor.force"])


def npy(values):
    file = io.BytesIO()
    np.lib.format.write_array(file, values)
    return file.getvalue()


def claiming(shape):
    """An array that says it has a shape, and holds two numbers."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return npy(np.zeros(1))[:10] + header.encode() + bytes(16)


BAD_MEMBERS = {
    "no meta": ({"meta.json": None}, "its members must be meta.json, time.npy and series.npy"),
    "no time": ({"time.npy": None}, "its members must be"),
    "more": ({"more.npy": b""}, "its members must be"),
    "meta is no JSON": ({"meta.json": b"{"}, "no JSON"),
    "meta is binary": ({"meta.json": b"\xff\xfe"}, "damaged recording"),
    "meta is deep": ({"meta.json": b"[" * 10**6}, "no JSON"),
    "meta is a list": ({"meta.json": b"[]"}, "must be a JSON object"),
    "meta lacks names": ({"meta.json": b'{"format": 2}'}, "a name and a unit for each of the 2"),
    "names are numbers": ({"meta.json": b'{"names": [1, 2], "units": ["", ""]}'}, "a name and"),
    "names twice": (
        {"meta.json": b'{"format": 2, "names": ["x", "x"], "units": ["m", "m"]}'},
        "two series have the same name",
    ),
    "meta is long": ({"meta.json": b" " * (2**24 + 1)}, "meta.json is longer than 16777216 bytes"),
    "no array": ({"time.npy": b"hello"}, "time.npy must be an array of floats in 1 dimensions"),
    "an empty array": ({"time.npy": b""}, "time.npy must be an array of floats"),
    "other floats": ({"time.npy": npy(np.zeros(20, np.float32))}, "must be an array of floats"),
    "Fortran": ({"series.npy": npy(np.zeros((20, 2)).T)}, "must be an array of floats"),
    "too flat": ({"series.npy": npy(np.zeros(40))}, "series.npy must be an array of floats in 2"),
    "other length": ({"series.npy": npy(np.zeros((2, 7)))}, "must have the shape of time"),
    "a billion rows": (
        {"series.npy": claiming("(2, 1000000000)")}, "says it has shape .* holds 16 bytes",
    ),
    "negative rows": ({"series.npy": claiming("(-1, -2)")}, "must be an array of floats"),
    "pickle": (
        {"series.npy": pickle.dumps(np.zeros(2))}, "series.npy must be an array of floats",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), BAD_MEMBERS.values(), ids=BAD_MEMBERS)
def test_an_npz_that_is_no_recording_is_refused(recording, tmp_path, changes, message):
    contents = {**members(recording, tmp_path), **changes}
    contents = {name: content for name, content in contents.items() if content is not None}
    path = packed(tmp_path / "bad.npz", contents)
    with pytest.raises(ValueError, match=f"bad.npz: .*{message}"):
        mjhill.Recording.load(path)


class _Bomb:
    """What a pickle runs when it is loaded."""

    def __reduce__(self):
        return os.system, ("touch ran",)


def test_a_pickle_in_an_npz_is_not_run(recording, tmp_path):
    file = io.BytesIO()
    np.lib.format.write_array(file, np.array([[_Bomb()]], dtype=object), allow_pickle=True)
    contents = {**members(recording, tmp_path), "series.npy": file.getvalue()}
    for path, content in (
        (packed(tmp_path / "a.npz", contents), None),
        (tmp_path / "b.npz", pickle.dumps(_Bomb())),
        (tmp_path / "c.npz", file.getvalue()),
    ):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(ValueError, match="not a|damaged recording"):
            mjhill.Recording.load(path)
    assert not (tmp_path / "ran").exists()
    pickle.loads(pickle.dumps(_Bomb()))  # the bomb is a bomb
    assert (tmp_path / "ran").exists()


LOADS = """
import resource, sys, mjhill
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]), resource.RLIM_INFINITY))
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    mjhill.Recording.load(sys.argv[1])
except ValueError as error:
    print(error)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024, "MiB")
"""


@pytest.mark.parametrize("honest", [True, False])
def test_a_bomb_is_refused_before_it_takes_memory(recording, tmp_path, honest):
    contents = members(recording, tmp_path)
    path = tmp_path / "bomb.npz"
    rows = 2**25 if honest else 20  # 512 MiB
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("meta.json", contents["meta.json"])
        archive.writestr("time.npy", contents["time.npy"])
        with archive.open("series.npy", "w", force_zip64=True) as file:
            file.write(claiming(f"(2, {rows})")[:128])
            for _ in range(32):
                file.write(bytes(2**24))
    if not honest:  # the archive says less than there is
        (info,) = [each for each in archive.infolist() if each.filename == "series.npy"]
        said = struct.pack("<Q", info.file_size)
        data = path.read_bytes()
        small = struct.pack("<Q", 128 + 2 * 20 * 8)
        path.write_bytes(data.replace(said, small).replace(said[:4], small[:4]))
    done = subprocess.run(
        [sys.executable, "-c", LOADS, path, str(3 * 2**30)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    message, memory = done.stdout.splitlines()
    assert ("unpacks to" if honest else "Bad CRC-32") in message
    assert int(memory.split()[0]) < 50
    assert path.stat().st_size < 2**24


def test_a_recording_of_mostly_zeros_is_written_so_that_it_can_be_read(tmp_path, monkeypatch):
    monkeypatch.setattr(recording_files, "SMALL", 2**16)
    zeros = {str(i): np.zeros(2000) for i in range(200)}
    still = mjhill.Recording(np.arange(2000.0), zeros, dict.fromkeys(zeros, "m"))
    assert mjhill.Recording.load(still.save(tmp_path / "still.npz")) == still


def problem(path):
    try:
        mjhill.Recording.load(path)
    except ValueError as error:
        return str(error)
    return None


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_damage_is_one_kind_of_error_that_names_the_file(run, tmp_path, suffix):
    path = run.save(tmp_path / f"run{suffix}")
    good = path.read_bytes()
    random = np.random.default_rng(11)
    refused = 0
    for trial in range(300):
        bad = bytearray(good)
        if trial % 3 == 0:
            bad = bad[: random.integers(len(bad))]
        elif trial % 3 == 1:
            for at in random.integers(len(bad), size=random.integers(1, 5)):
                bad[at] ^= 1 << int(random.integers(8))
        else:
            first, last = sorted(random.integers(len(bad), size=2))
            bad[first:last] = random.bytes(random.integers(50))
        path.write_bytes(bad)
        message = problem(path)
        refused += message is not None
        assert message is None or message.startswith(f"{path}: ")
        assert message is None or message.isprintable()
    assert refused > (150 if suffix == ".npz" else 100)


def test_a_folder_or_pipe_is_no_recording(tmp_path):
    (tmp_path / "folder.csv").mkdir()
    os.mkfifo(tmp_path / "pipe.npz")  # reading one would wait for ever
    for name in ("folder.csv", "pipe.npz"):
        with pytest.raises(
            ValueError, match=f"{name}: not a mjhill recording: it is not a regular"
        ):
            mjhill.Recording.load(tmp_path / name)


def test_a_recording_that_is_missing_is_a_missing_file(tmp_path):
    for suffix in (".csv", ".npz"):
        with pytest.raises(FileNotFoundError):
            mjhill.Recording.load(tmp_path / f"none{suffix}")


def test_a_missing_series_is_named_so_that_it_can_be_printed():
    odd = mjhill.Recording(np.zeros(1), {"\x1b[2J": np.zeros(1)}, {"\x1b[2J": "m"})
    with pytest.raises(KeyError) as refused:
        odd["x"]
    assert refused.value.args[0].isprintable()
