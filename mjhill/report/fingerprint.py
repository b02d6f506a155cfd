"""What the numbers of an experiment depend on, as one word."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

_PACKAGE = Path(__file__).parent.parent
_NAME = _PACKAGE.name
_VERSIONS = (_NAME, "mujoco", "numpy", "scipy")


def fingerprint(module: str) -> str:
    """A word that changes with the sources of an experiment, the parameters or the versions.

    The sources are the module and those of mjhill that it imports, and they in turn; the
    parameters are all data files of the package.

    Args:
        module: Dotted name of the experiment's module, which is not imported.

    Raises:
        ImportError: There is no such module.
    """
    digest = hashlib.sha256()
    for package in _VERSIONS:
        digest.update(f"{package} {version(package)}\n".encode())
    data = sorted(path for suffix in ("csv", "toml") for path in _PACKAGE.rglob(f"*.{suffix}"))
    for path in [*sources(module), *data]:
        digest.update(path.name.encode() + b"\n" + path.read_bytes())
    return digest.hexdigest()[:16]


def sources(module: str) -> list[Path]:
    """The file of a module, and those of mjhill that it imports, in a fixed order.

    Raises:
        ImportError: There is no such module.
    """
    first = _file(module)
    if first is None:
        spec = find_spec(module)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(f"there is no module {module}")
        first = Path(spec.origin)
    found, waiting = {first}, [first]
    while waiting:
        text = waiting.pop().read_text(encoding="utf-8")
        new = set(_imports(text)) - found
        found |= new
        waiting += new
    return [first, *sorted(found - {first})]


@cache
def _imports(text: str) -> tuple[Path, ...]:
    """Files of mjhill that a source imports, at the top or inside its functions."""
    names = _imported_names(ast.parse(text))
    return tuple(path for name in names if (path := _file(name)) is not None)


def _imported_names(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            # from a package comes one of its modules, or a name that the package itself has
            for alias in node.names:
                module = f"{node.module}.{alias.name}"
                yield module if _file(module) else node.module


def _file(module: str) -> Path | None:
    """The file of one of mjhill's own modules."""
    top, *rest = module.split(".")
    if top != _NAME:
        return None
    path = _PACKAGE.joinpath(*rest)
    for file in (path / "__init__.py", path.with_suffix(".py")):
        if file.is_file():
            return file
    return None
