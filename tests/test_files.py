"""Files appear whole or not at all, also on a full disk, and what was left by the dead is swept."""

import multiprocessing
import os
import resource
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np
import pytest

import mjhill
from mjhill.draw.plot import plot_recording
from mjhill.files import partial_folder, replacing, sweep
from mjhill.identification.report import markdown


@pytest.fixture
def recording():
    time = np.arange(3000) * 1e-3
    rng = np.random.default_rng(0)
    series = {f"elbow.{name}": rng.normal(size=time.size) for name in ("angle", "velocity")}
    return mjhill.Recording(time, series, {"elbow.angle": "rad", "elbow.velocity": "rad/s"})


@contextmanager
def disk_with_room_for(size):
    """Files of this process may not grow past ``size`` bytes, as if the disk were full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def content(folder):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir() if path.is_file()}


@pytest.mark.parametrize("name", ["run.csv", "run.npz", "plot.png"])
@pytest.mark.parametrize("before", [None, b"the older one"])
def test_a_full_disk_leaves_what_was_there_before_and_is_named(tmp_path, recording, name, before):
    path = tmp_path / name
    if before is not None:
        path.write_bytes(before)
    write = plot_recording if name == "plot.png" else mjhill.Recording.save
    with (
        disk_with_room_for(4096),
        pytest.raises(OSError, match=rf"cannot write .*{name}: file too large; make room or"),
    ):
        write(recording, path)
    assert content(tmp_path) == ({} if before is None else {name: before})


def test_a_failure_leaves_what_was_there_before(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("before")

    def fail():
        with replacing(path) as partial:
            partial.write_text("after")
            raise RuntimeError("no")

    with pytest.raises(RuntimeError, match="no"):
        fail()
    assert content(tmp_path) == {"file.txt": b"before"}


def test_a_file_has_the_mode_that_the_user_has_chosen(tmp_path):
    mask = os.umask(0o027)
    try:
        with replacing(tmp_path / "file.txt") as partial:
            partial.write_text("text")
    finally:
        os.umask(mask)
    assert (tmp_path / "file.txt").stat().st_mode & 0o777 == 0o640


def test_a_name_as_long_as_the_file_system_allows_can_be_written(tmp_path):
    name = "é" * 125 + ".txt"
    with replacing(tmp_path / name) as partial:
        partial.write_text("text")
    assert content(tmp_path) == {name: b"text"}


def _hold(folder):
    with replacing(folder / "half.txt") as partial, partial_folder(folder, "part") as inner:
        partial.write_text("half of it")
        (inner / "file").write_text("half of it")
        time.sleep(60)


def test_what_a_killed_process_left_is_swept_and_what_a_living_one_writes_is_not(tmp_path):
    process = multiprocessing.get_context("spawn").Process(target=_hold, args=(tmp_path,))
    process.start()
    try:
        until = time.monotonic() + 30
        while not list(tmp_path.glob(".part*/file")):
            assert time.monotonic() < until
            time.sleep(0.02)
        sweep(tmp_path)
        assert len(list(tmp_path.iterdir())) == 2
        os.kill(process.pid, signal.SIGKILL)
    finally:
        process.kill()
        process.join()
    assert len(list(tmp_path.iterdir())) == 2
    with replacing(tmp_path / "next.txt") as partial:
        partial.write_text("next")
    assert content(tmp_path) == {"next.txt": b"next"}
    assert len(list(tmp_path.iterdir())) == 1


def test_folders_made_at_the_same_time_do_not_sweep_each_other_away(tmp_path):
    def make_many(name):
        for _ in range(200):
            with partial_folder(tmp_path, name) as folder:
                assert folder.is_dir()

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(make_many, "abcd"))
    assert not list(tmp_path.iterdir())


def test_a_sweep_leaves_links_and_files_of_others_alone(tmp_path):
    target = tmp_path / "mine.txt"
    target.write_text("mine")
    link = tmp_path / ".run.mjhill.1-0.partial.csv"
    link.symlink_to(target)
    other = tmp_path / ".run.1.partial.csv"  # a name that is none of ours
    other.write_text("other")
    sweep(tmp_path)
    assert link.is_symlink()
    assert content(tmp_path) == {target.name: b"mine", link.name: b"mine", other.name: b"other"}
    sweep(tmp_path / "no such folder")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_a_sweep_leaves_files_of_other_users_alone(tmp_path):
    path = tmp_path / ".run.mjhill.1-0.partial.csv"
    path.write_text("other")
    os.chown(path, 12345, 12345)
    sweep(tmp_path)
    assert path.exists()
    os.chown(path, 0, 0)
    sweep(tmp_path)
    assert not path.exists()


def test_a_name_that_is_a_formula_is_drawn_as_it_is(tmp_path):
    name = r"$\frac{1}{"  # matplotlib cannot parse it
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><worldbody><body><joint name="{name}"/><geom size=".1"/></body></worldbody>'
        "</mujoco>"
    )
    model = spec.compile()
    run = mjhill.record(model, mujoco.MjData(model), duration=0.01)
    plot_recording(run, tmp_path / "plot.png", title=name)
    assert (tmp_path / "plot.png").stat().st_size > 1000


def test_a_text_in_a_page_of_tables_ends_no_cell_and_begins_no_markup():
    page = markdown(
        {"Parameters": [{"source": "a | b\n<script>alert(1)</script> [x](javascript:y)"}]}
    )
    row = page.splitlines()[-1]
    assert row == r"| a \| b &lt;script>alert(1)&lt;/script> [x]\(javascript:y) |"
