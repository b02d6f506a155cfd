"""Put callbacks into MuJoCo, and restore everything.

MuJoCo's callbacks are process-wide. Ours are pure functions of model and data, so one
installation serves every model and thread; actuators that are not ours, and passive forces, are
passed on to what was installed before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from threading import get_ident
from typing import Any, Literal, get_args

import mujoco

from mjhill.engine import python as python_backend
from mjhill.engine.callbacks import (
    NAMES,
    PROCESS,
    TYPES,
    Slot,
    global_pointer,
    is_automatic,
    read,
    restore,
)

Backend = Literal["compiled", "python"]

_lock = PROCESS.lock
_stack: list[_Installation] = PROCESS.installations


@dataclass(eq=False)
class _Installation:
    backend: Backend
    before: dict[str, Slot]
    ours: dict[str, Slot]
    served: dict[str, Slot]
    thread: int


def install(backend: Backend = "compiled") -> None:
    """Put the muscle's callbacks into MuJoCo, for every model of this process.

    Load models first: with ``backend="python"``, MuJoCo cannot compile a model that has user
    actuators while a Python callback is installed (google-deepmind/mujoco issue 1014);
    ``mjhill.load`` works at any time.

    Args:
        backend: ``"compiled"`` (machine code, any number of threads) or ``"python"`` (plain
            Python: slow, debuggable, single-threaded).

    Raises:
        ValueError: There is no such back-end.
        RuntimeError: Another callback has replaced one that mjhill installed, or MuJoCo's
            structs differ from its own declarations.
    """
    _install(backend)


def _install(backend: Backend) -> _Installation:
    if backend not in get_args(Backend):
        known = " or ".join(map(repr, get_args(Backend)))
        raise ValueError(f"backend must be {known}, got {backend!r}")
    with _lock:
        if _stack:
            _check_still_ours(_stack[-1])
        before = {name: read(name) for name in NAMES}
        # other actuators are served by the callbacks from before our first installation
        served = _stack[0].served if _stack else _others(before)
        try:
            (_put_compiled if backend == "compiled" else _put_python)(served)
        except BaseException:
            restore(before)
            raise
        ours = {name: read(name) for name in NAMES}
        _stack.append(_Installation(backend, before, ours, served, get_ident()))
        return _stack[-1]


def uninstall() -> None:
    """Undo the last ``install``: each callback is again what it was before.

    Raises:
        RuntimeError: Nothing is installed, or a callback was replaced meanwhile; it is
            restored even so.
    """
    with _lock:
        if not _stack:
            raise RuntimeError("mjhill is not installed; call mjhill.install() first")
        _uninstall(_stack[-1])


def _uninstall(installation: _Installation) -> None:
    with _lock:
        if installation not in _stack:
            raise RuntimeError("mjhill was uninstalled meanwhile; call mjhill.install() again")
        above = _stack.index(installation) + 1
        if above < len(_stack):  # of another thread, which goes on with its own
            _stack[above].before = installation.before
            _stack.remove(installation)
            return
        replaced = _replaced(_stack.pop())
        _put_back(installation.before)
    if replaced:
        raise RuntimeError(
            f"{_listed(replaced)} replaced while mjhill was installed, and now removed; "
            "install other callbacks before mjhill, which passes on to them"
        )


@contextmanager
def installed(backend: Backend = "compiled") -> Iterator[None]:
    """``install`` for the length of a ``with`` block, and exactly what was there after it.

    Blocks of several threads may overlap: callbacks are restored when the last one ends.

    Raises:
        ValueError: There is no such back-end.
        RuntimeError: As ``install`` and ``uninstall``.
    """
    installation = _install(backend)
    try:
        yield
    except BaseException as error:
        try:
            _uninstall(installation)
        except RuntimeError as second:
            error.add_note(str(second))
        raise
    _uninstall(installation)


def installed_backend() -> Backend | None:
    """The back-end now in place, or None; ``"compiled"`` where autoload has put it there.

    Raises:
        RuntimeError: A callback was replaced since it was installed.
    """
    with _lock:
        if not _stack:
            return "compiled" if is_automatic() else None
        _check_still_ours(_stack[-1])
        return _stack[-1].backend


@contextmanager
def without_python_callbacks() -> Iterator[None]:
    """Take Python callbacks out while a model is compiled: with them that fails."""
    with _lock:
        present = {name: read(name) for name in NAMES}
        held = {name: slot for name, slot in present.items() if slot.is_python}
        try:
            for name in held:
                global_pointer(name).value = None
            yield
        finally:
            for name, slot in held.items():
                global_pointer(name).value = slot.pointer


def _others(before: dict[str, Slot]) -> dict[str, Slot]:
    """What callbacks held; for those of autoload, what they held before."""
    ours = PROCESS.automatic
    return {
        name: PROCESS.served[name] if slot.pointer in ours.get(name, ()) else slot
        for name, slot in before.items()
    }


def _put_compiled(served: dict[str, Slot]) -> None:
    compiled = _compiled()
    for index, name in enumerate(NAMES):
        compiled.chain[index] = served[name].pointer
        function = TYPES[name](getattr(compiled, name))
        if served[name].is_python or (_of_other_threads() and read(name).is_python):
            # the bindings must go on holding the Python function: we pass on to it, or another
            # thread is about to call it
            global_pointer(name).value = getattr(compiled, name)
        else:
            getattr(mujoco, f"set_mjcb_{name}")(function)


def _of_other_threads() -> bool:
    return any(installation.thread != get_ident() for installation in _stack)


def _put_python(served: dict[str, Slot]) -> None:
    for name in NAMES:
        next_ = _callable(name, served[name])
        if name == "passive":
            function: Callable[..., Any] = partial(_passive, next_)
        else:
            function = partial(_actuator, getattr(python_backend, name), next_)
        getattr(mujoco, f"set_mjcb_{name}")(function)


def _actuator(
    ours: Callable[..., float | None],
    next_: Callable[..., float] | None,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    actuator: int,
) -> float:
    result = ours(model, data, actuator)
    if result is None:
        return next_(model, data, actuator) if next_ else 0.0
    return result


def _passive(next_: Callable[..., None] | None, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    if next_:
        next_(model, data)
    python_backend.passive(model, data)


def _callable(name: str, slot: Slot) -> Callable[..., Any] | None:
    """What a slot held, as a Python function of model, data and, for actuators, the id."""
    if slot.pointer is None:
        return None
    if slot.is_python:
        return slot.holder  # type: ignore[no-any-return]
    function = TYPES[name](slot.pointer)
    return lambda model, data, *actuator: function(model._address, data._address, *actuator)


def _put_back(slots: dict[str, Slot]) -> None:
    """Restore callbacks; keep a Python function that another thread may be about to call."""
    for name, slot in slots.items():
        if _of_other_threads() and not slot.is_python and read(name).is_python:
            global_pointer(name).value = slot.pointer
        else:
            restore({name: slot})


def _replaced(installation: _Installation) -> list[str]:
    """Callbacks that are no longer those we installed.

    All Python callbacks share one C pointer, so there the function itself is compared.
    """
    now = {name: read(name) for name in NAMES}
    return [
        name
        for name, slot in installation.ours.items()
        if now[name].pointer != slot.pointer
        or (slot.is_python and now[name].holder is not slot.holder)
    ]


def _check_still_ours(installation: _Installation) -> None:
    replaced = _replaced(installation)
    if replaced:
        raise RuntimeError(
            f"{_listed(replaced)} replaced since mjhill was installed; call mjhill.uninstall(), "
            "which restores what was there before, and install the other callback first"
        )


def _listed(names: list[str]) -> str:
    callbacks = ", ".join(f"mjcb_{name}" for name in names)
    return f"{callbacks} {'was' if len(names) == 1 else 'were'}"


def _compiled() -> Any:
    """The machine code, linked once in the process."""
    if PROCESS.linked is None:
        from mjhill.engine.machine_code import build

        PROCESS.linked = build()
    return PROCESS.linked
