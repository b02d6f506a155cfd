"""Where machine code is kept between processes, and which files are trusted.

What is found here is run, so only files that no other user can have written are trusted: plain
files of this user, with their digest in front, in a folder that others cannot write.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import io
import os
import stat
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

Code = dict[str, tuple[str, bytes]]  # name: symbol and object code

_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_WAIT = 60.0  # seconds for which a process that compiles is waited for
_DIGEST = hashlib.sha256().digest_size


class UntrustedError(Exception):
    """Something in the cache that must not be run; the message says what and why."""


def cache_folder() -> Path:
    """Where machine code is kept: ``MJHILL_CACHE_DIR``, or the user's folder for caches."""
    given = os.environ.get("MJHILL_CACHE_DIR")
    return Path(given) if given else _user_folder()


def _user_folder() -> Path:
    from platformdirs import user_cache_path

    return user_cache_path("mjhill")


def safe_folder() -> Path | None:
    """The first folder that can be used, made if need be; None if code cannot be kept."""
    for folder in dict.fromkeys((cache_folder(), _user_folder())):
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        try:
            _check_folder(folder)
        except UntrustedError as error:
            _warn(f"{error}; machine code is not kept there")
        except OSError:
            continue
        else:
            return folder
    return None


def _check_folder(folder: Path) -> None:
    real = folder.resolve(strict=True)
    for place in (real, *real.parents):
        state = place.stat()
        if state.st_uid not in (os.geteuid(), 0):
            raise UntrustedError(f"the folder {place} belongs to another user")
        # in a sticky folder such as /tmp others cannot replace our files
        others = _OTHERS if place == real else stat.S_IWOTH
        if state.st_mode & others and not (place != real and state.st_mode & stat.S_ISVTX):
            raise UntrustedError(f"other users can write in the folder {place}; chmod go-w {place}")


def read(path: Path, names: tuple[str, ...]) -> Code | None:
    """Code from the cache; None if there is none, or with a warning if it cannot be trusted."""
    try:
        content = _trusted(path)
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            return {
                name: (str(archive[f"{name}_symbol"]), archive[name].tobytes()) for name in names
            }
    except FileNotFoundError:
        return None
    except (UntrustedError, OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        _warn(f"{path} is not used and made again: {error}")
        return None


def _trusted(path: Path) -> bytes:
    if path.is_symlink():
        raise UntrustedError("it is a symbolic link")
    # a FIFO would block
    file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with open(file, "rb") as opened:
        state = os.fstat(file)
        if not stat.S_ISREG(state.st_mode):
            raise UntrustedError("it is no plain file")
        if state.st_uid != os.geteuid():
            raise UntrustedError("it belongs to another user")
        if state.st_mode & _OTHERS:
            raise UntrustedError("other users can write it")
        content = opened.read()
    if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
        raise UntrustedError("it is damaged")
    return content[_DIGEST:]


def write(path: Path, code: Code) -> None:
    """Keep code in the cache, whole or not at all; a full disk is no error."""
    archive = io.BytesIO()
    arrays = {name: np.frombuffer(object_code, np.uint8) for name, (_, object_code) in code.items()}
    arrays |= {f"{name}_symbol": np.array(symbol) for name, (symbol, _) in code.items()}
    np.savez(archive, allow_pickle=False, **arrays)
    content = archive.getvalue()
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    with contextlib.suppress(OSError):
        for left in path.parent.glob(f".{path.name}.*.partial"):
            left.unlink()  # by a killed process: one at a time makes this file
        try:
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
            with open(os.open(partial, flags, 0o600), "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            os.replace(partial, path)
        finally:
            partial.unlink(missing_ok=True)


@contextlib.contextmanager
def alone(path: Path) -> Iterator[None]:
    """One process at a time makes ``path``; the others wait, up to a limit."""
    lock = path.with_name(f"{path.name}.lock")
    try:
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        file = os.open(lock, flags, 0o600)
    except OSError:
        yield
        return
    try:
        end = time.monotonic() + _WAIT
        while time.monotonic() < end:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError:
                time.sleep(0.05)
        yield
    finally:
        os.close(file)


def _warn(message: str) -> None:
    warnings.warn(f"mjhill's cache of machine code: {message}", RuntimeWarning, stacklevel=2)
