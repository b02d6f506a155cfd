"""What the numbers of an experiment depend on, as one word."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

_PACKAGE = Path(__file__).parent.parent
_SUFFIXES = (".py", ".csv", ".toml")
_VERSIONS = (_PACKAGE.name, "mujoco", "numpy", "scipy")


def fingerprint(module: str) -> str:
    """A word that changes with any source or data file of mjhill, the module, or a version.

    Args:
        module: Dotted name of the experiment's module, which is not imported.

    Raises:
        ImportError: There is no such module.
    """
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"there is no module {module}")
    return hashlib.sha256(_own() + Path(spec.origin).read_bytes()).hexdigest()[:16]


@cache
def _own() -> bytes:
    """A digest of mjhill's own files and of the packages that compute with it."""
    digest = hashlib.sha256()
    for package in _VERSIONS:
        digest.update(f"{package} {version(package)}\n".encode())
    for path in sorted(_PACKAGE.rglob("*")):
        if path.suffix in _SUFFIXES:
            digest.update(str(path.relative_to(_PACKAGE)).encode() + path.read_bytes())
    return digest.digest()
