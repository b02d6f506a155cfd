"""Files that appear whole or not at all."""

from __future__ import annotations

import atexit
import errno
import fcntl
import itertools
import os
import re
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mjhill import interrupts

_NUMBERS = itertools.count()
_own: dict[Path, int] = {}  # partial files and folders, and the process that made each
_PARTIAL = re.compile(r"\..*\.mjhill\.\d+-\d+\.partial(\.[^.]*)?", re.DOTALL)
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_LONGEST = 100  # of what is kept of a file's name in that of its partial file [byte]


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A partial file beside ``path``, renamed to it on success and removed on any failure.

    The partial file keeps the suffix, so that writers which look at it work. What a killed
    process has left in the folder is removed.

    Raises:
        FileNotFoundError: The folder does not exist.
        PermissionError: The folder or the file cannot be written.
        IsADirectoryError: ``path`` is a folder.
        OSError: The disk is full.
    """
    path = Path(path)
    check_writable(path)
    sweep(path.parent)
    with _locked(path.parent, path.stem, path.suffix, _make_file) as partial:
        try:
            yield partial
            interrupts.check()
            os.replace(partial, path)
        except OSError as error:
            if error.errno in _FULL:
                raise _full(path, error) from error
            raise


@contextmanager
def partial_folder(folder: Path, name: str) -> Iterator[Path]:
    """A hidden folder in ``folder``, gone when this returns; left ones are removed.

    Raises:
        OSError: It cannot be made.
    """
    sweep(folder)
    with _locked(folder, name, "", _make_folder) as partial:
        yield partial


def check_writable(path: Path) -> None:
    """Fail early, before long work, where ``path`` could not be written at its end.

    Raises:
        FileNotFoundError: The folder does not exist.
        PermissionError: The folder or the file cannot be written.
        IsADirectoryError: ``path`` is a folder.
    """
    folder = path.parent
    if not folder.is_dir():
        raise FileNotFoundError(f"cannot write {path}: the folder {folder} does not exist; make it")
    if path.is_dir():
        raise IsADirectoryError(f"cannot write {path}: it is a folder; give a file name")
    if not os.access(folder, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise PermissionError(f"cannot write {path}: permission denied; choose another place")


def sweep(folder: Path) -> None:
    """Remove the partial files and folders that killed processes of this user have left."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if _PARTIAL.fullmatch(entry.name):
                _remove_if_dead(Path(entry.path))


def _remove_if_dead(path: Path) -> None:
    with suppress(OSError):
        state = path.lstat()
        folder = stat.S_ISDIR(state.st_mode)
        if state.st_uid != os.geteuid() or not (folder or stat.S_ISREG(state.st_mode)):
            return
        file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # fails while its process lives
            _remove(path)
        finally:
            os.close(file)


@contextmanager
def _locked(folder: Path, stem: str, suffix: str, make: Callable[[Path], int]) -> Iterator[Path]:
    """Make a partial file or folder, hold a lock on it as long as this process lives, remove it."""
    short = os.fsdecode(os.fsencode(stem)[:_LONGEST])
    while True:
        name = f".{short}.mjhill.{os.getpid()}-{next(_NUMBERS)}.partial{suffix}"
        path = folder / name
        if path.exists():
            continue  # of another machine, in a folder that both share
        _own[path] = os.getpid()  # before it is there: an interrupt may come at any point
        file = -1
        try:
            file = make(path)
            with suppress(OSError):  # a file system without locks
                fcntl.flock(file, fcntl.LOCK_EX)
            if path.exists():  # else a sweep was faster than the lock
                yield path
                return
        finally:
            _remove(path)
            if file >= 0:
                os.close(file)
            del _own[path]


def _remove(path: Path) -> None:
    with suppress(OSError):
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


@atexit.register
def _remove_own() -> None:
    """Remove what an interrupt at an unlucky point has left."""
    for path, process in list(_own.items()):
        if process == os.getpid():
            _remove(path)


def _make_file(path: Path) -> int:
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)


def _make_folder(path: Path) -> int:
    while True:
        path.mkdir()
        with suppress(FileNotFoundError):  # a sweep was faster than the opening
            return os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)


def _full(path: Path, error: OSError) -> OSError:
    full = OSError(
        f"cannot write {path}: {(error.strerror or 'disk full').lower()}; "
        "make room or choose another place"
    )
    full.errno = error.errno
    return full
