import os
import subprocess
import sys

import pytest

from mjhill.engine import code_cache

CODE = {"act_dyn": ("first", b"\x01\x02"), "passive": ("second", b"\x03")}
NAMES = ("act_dyn", "passive")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("MJHILL_CACHE_DIR", str(folder))
    return folder


@pytest.fixture
def kept(folder):
    path = code_cache.safe_folder() / "x.code"
    code_cache.write(path, CODE)
    return path


def test_code_is_read_back_as_it_was(kept):
    assert code_cache.read(kept, NAMES) == CODE


def test_nobody_else_can_write_what_is_kept_even_without_a_umask(folder):
    before = os.umask(0)
    try:
        path = code_cache.safe_folder() / "x.code"
        code_cache.write(path, CODE)
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert path.stat().st_mode & 0o777 == 0o600
    assert [entry.name for entry in folder.iterdir()] == ["x.code"]


def refused(path, reason):
    with pytest.warns(RuntimeWarning, match=reason) as warned:
        assert code_cache.read(path, NAMES) is None
    assert str(path) in str(warned[0].message)


def test_every_flipped_bit_and_every_length_is_found(kept):
    content = kept.read_bytes()
    for index in range(0, len(content), 7):
        changed = bytearray(content)
        changed[index] ^= 1 << index % 8
        kept.write_bytes(changed)
        refused(kept, "damaged")
    for length in range(0, len(content), 13):
        kept.write_bytes(content[:length])
        refused(kept, "damaged")


def test_a_file_that_others_can_write_is_not_run(kept):
    kept.chmod(0o666)
    refused(kept, "other users can write it")


def test_a_symbolic_link_is_not_followed(kept):
    kept.rename(kept.with_name("real"))
    kept.symlink_to(kept.with_name("real"))
    refused(kept, "symbolic link")


def test_a_pipe_does_not_hang(kept):
    kept.unlink()
    os.mkfifo(kept, 0o600)
    refused(kept, "no plain file")
    code_cache.write(kept, CODE)  # and is replaced
    assert code_cache.read(kept, NAMES) == CODE


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_a_file_or_folder_of_another_user_is_not_run(kept, folder):
    os.chown(kept, 12345, 12345)
    refused(kept, "belongs to another user")
    os.chown(folder, 12345, 12345)
    with pytest.warns(RuntimeWarning, match="belongs to another user"):
        assert code_cache.safe_folder() != folder


def test_a_folder_that_others_can_write_is_passed_over(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.warns(RuntimeWarning, match=f"other users can write in the folder {folder}"):
        assert code_cache.safe_folder() == tmp_path / "home" / "mjhill"


def test_a_folder_below_one_that_others_can_write_is_passed_over(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    outer = tmp_path / "outer"
    outer.mkdir()
    outer.chmod(0o777)
    monkeypatch.setenv("MJHILL_CACHE_DIR", str(outer / "inner"))
    with pytest.warns(RuntimeWarning, match=f"chmod go-w {outer}"):
        assert code_cache.safe_folder() == tmp_path / "home" / "mjhill"
    outer.chmod(0o1777)  # sticky, as /tmp
    assert code_cache.safe_folder() == outer / "inner"


def test_processes_that_start_at_once_with_an_empty_cache_compile_once(folder):
    code = (
        "import sys, mjhill, mujoco\n"
        "m = mjhill.load('elbow'); d = mujoco.MjData(m)\n"
        "with mjhill.installed():\n d.ctrl[0] = 1; mujoco.mj_step(m, d, nstep=20)\n"
        "print(d.qpos[0], 'numba' in sys.modules)"
    )
    started = [
        subprocess.Popen([sys.executable, "-W", "error", "-c", code], stdout=subprocess.PIPE)
        for _ in range(6)
    ]
    results = [process.communicate(timeout=300)[0].split() for process in started]
    assert [process.returncode for process in started] == [0] * 6
    assert len({angle for angle, _ in results}) == 1
    assert [compiled for _, compiled in results].count(b"True") == 1


def test_what_a_killed_process_left_is_removed_by_the_next_that_compiles(kept, folder):
    (folder / f".{kept.name}.1.partial").write_bytes(b"half")
    code_cache.write(kept, CODE)
    assert [entry.name for entry in folder.iterdir()] == [kept.name]
