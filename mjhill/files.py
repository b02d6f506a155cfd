"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A partial file beside ``path``, renamed to it on success and removed on any failure.

    The partial file keeps the suffix, so that writers which look at it work.

    Raises:
        FileNotFoundError: The folder does not exist.
        PermissionError: The folder or the file cannot be written.
        IsADirectoryError: ``path`` is a folder.
    """
    path = Path(path)
    check_writable(path)
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


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
