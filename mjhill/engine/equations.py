"""The functions that muscle models give to a compiler, found by following their calls."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import BuiltinFunctionType, FunctionType
from typing import Any

from mjhill.elements import passive_torque
from mjhill.muscles import MODELS, MuscleModel

ALLOWED = ("exp", "log", "sqrt", "erf")  # functions of ``math`` that equations may call


def compiled_functions(models: Iterable[MuscleModel] = MODELS) -> list[Callable[..., Any]]:
    """The equations that are compiled: rates and force of each model, and passive torque."""
    return [passive_torque, *(f for model in models for f in (model.rates, model.force))]


def with_callees(functions: Iterable[Callable[..., Any]]) -> list[FunctionType]:
    """Functions and all that they call, those that are called first.

    Raises:
        TypeError: One uses what cannot be compiled; the message says what and where.
    """
    found: dict[FunctionType, None] = {}
    open_: list[FunctionType] = []

    def visit(function: Any) -> None:
        if function in found:
            return
        if function in open_:
            raise TypeError(f"equation {function.__qualname__} calls itself")
        open_.append(function)
        for value in globals_of(function).values():
            if isinstance(value, FunctionType):
                visit(value)
        open_.pop()
        found[function] = None

    for function in functions:
        visit(function)
    return list(found)


def globals_of(function: FunctionType) -> dict[str, Any]:
    """The functions and numbers of its module that a function uses, by the names it has for them.

    Raises:
        TypeError: One is neither; the message says which.
    """
    used: dict[str, Any] = {}
    for name in _names(function.__code__):
        if name not in function.__globals__:
            continue  # a builtin, or an attribute
        value = function.__globals__[name]
        allowed = isinstance(value, (FunctionType, int, float)) or (
            isinstance(value, BuiltinFunctionType) and value.__name__ in ALLOWED
        )
        if not allowed:
            raise TypeError(
                f"equation {function.__module__}.{function.__qualname__} uses {name!r}; it may "
                f"use numbers, functions like itself, and {', '.join(ALLOWED)} of math"
            )
        used[name] = value
    return used


def _names(code: Any) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if inspect.iscode(constant):
            yield from _names(constant)


def source_digest(models: Iterable[MuscleModel] = MODELS) -> bytes:
    """A digest of all that the compiled muscle is made from, but for versions of packages.

    These are the files of the equations, found as the compiler finds them, the numbers they use,
    the tables of the models, and the files of this package.
    """
    models, digest = list(models), hashlib.sha256()
    functions = with_callees(compiled_functions(models))
    files = {Path(function.__code__.co_filename) for function in functions}
    for path in [*sorted(files), *sorted(Path(__file__).parent.glob("*.py"))]:
        digest.update(path.read_bytes() if path.is_file() else b"")
    for function in functions:
        digest.update(function.__code__.co_code + repr(function.__code__.co_consts).encode())
        numbers = {k: v for k, v in globals_of(function).items() if isinstance(v, (int, float))}
        digest.update(repr(sorted(numbers.items())).encode())
    for model in models:
        table = (model.name, model.tag, model.state_names, model.bins, model.slots)
        digest.update(repr(table).encode())
    return digest.digest()
