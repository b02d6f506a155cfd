"""MuJoCo's three callbacks as slots to read and restore, and what this process put into them.

Imports nothing of mjhill, so that it can be loaded while mjhill itself is.
"""

from __future__ import annotations

import ctypes
import os
import threading
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import mujoco
from mujoco import _callbacks, _functions

NAMES = ("act_dyn", "act_bias", "passive")
# symbols that machine code is linked to: three pointers, in the order of NAMES; MuJoCo's function
CHAIN_SYMBOL, READ_CONTROL = "mjhill_chained_callbacks", "mj_readCtrl"
ACTUATOR = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)
GENERIC = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
TYPES: dict[str, Any] = {"act_dyn": ACTUATOR, "act_bias": ACTUATOR, "passive": GENERIC}
_C_FUNCTION: Any = GENERIC.__mro__[1]  # the base of every ctypes function


@dataclass(frozen=True)
class Slot:
    """What one callback held: the C pointer, and the object that MuJoCo's bindings hold for it."""

    pointer: int | None
    holder: Any

    @property
    def is_python(self) -> bool:
        """Whether the callback is a Python function, reached through the bindings."""
        return (
            self.pointer is not None
            and callable(self.holder)
            and not isinstance(self.holder, _C_FUNCTION)
        )


@dataclass
class Process:
    """What mjhill has put into the callbacks of this process.

    Attributes:
        lock: Held while callbacks are changed.
        installations: Those of ``mjhill.install``, the last one on top.
        automatic: Pointers that ``mjhill.engine.autoload`` has put there, by callback.
        served: The callbacks before those.
        linked: Machine code of ``mjhill.install``. Like all of this it is never freed, because
            MuJoCo may point to it as long as the process lives.
        kept: Stubs and machine code of ``mjhill.engine.autoload``.
    """

    lock: Any = field(default_factory=threading.RLock)
    installations: list[Any] = field(default_factory=list)
    automatic: dict[str, set[int]] = field(default_factory=dict)
    served: dict[str, Slot] = field(default_factory=dict)
    linked: Any = None
    kept: list[Any] = field(default_factory=list)


def _process() -> Process:
    """The one ``Process``: it outlives a reload of our modules, as the callbacks do."""
    held: Any = vars(_callbacks)
    if "_mjhill" not in held:
        process = held.setdefault("_mjhill", Process())
        # a child of fork has only the forking thread, so no other may hold the lock during it
        os.register_at_fork(
            before=process.lock.acquire,
            after_in_parent=process.lock.release,
            after_in_child=process.lock.release,
        )
    return held["_mjhill"]  # type: ignore[no-any-return]


PROCESS = _process()


@cache
def mujoco_library() -> ctypes.CDLL:
    """The MuJoCo library that the Python package has loaded."""
    return ctypes.CDLL(_functions.__file__)


def global_pointer(name: str) -> ctypes.c_void_p:
    """The global variable of MuJoCo that holds a callback."""
    return ctypes.c_void_p.in_dll(mujoco_library(), f"mjcb_{name}")


def read(name: str) -> Slot:
    """What a callback holds now."""
    return Slot(global_pointer(name).value, getattr(mujoco, f"get_mjcb_{name}")())


def restore(slots: dict[str, Slot]) -> None:
    """Put back what callbacks held."""
    for name, slot in slots.items():
        getattr(mujoco, f"set_mjcb_{name}")(slot.holder)
        global_pointer(name).value = slot.pointer


def is_automatic() -> bool:
    """Whether the callbacks are all those that ``mjhill.engine.autoload`` has put there."""
    return bool(PROCESS.automatic) and all(
        global_pointer(name).value in PROCESS.automatic[name] for name in NAMES
    )
