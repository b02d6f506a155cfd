"""The muscle in every process that imports MuJoCo, whether or not it imports mjhill.

MuJoCo calls the entry points ``mujoco.plugins`` at the end of its import; ours is ``start``. It
puts stubs into the callbacks, which cost nothing until a model asks for them: the first muscle,
or the first joint with passive elasticity, makes them load the machine code and put it in their
place. ``MJHILL_AUTOLOAD=0`` in the environment leaves MuJoCo as it is.

Imports no other module of mjhill but ``callbacks.slots`` until then, because mjhill may itself
be half imported when MuJoCo calls.
"""

from __future__ import annotations

import _thread
import ctypes
import math
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco

from mjhill.callbacks.slots import (
    NAMES,
    PROCESS,
    TYPES,
    global_pointer,
    read,
)

VARIABLE = "MJHILL_AUTOLOAD"


def start() -> None:
    """Put the stubs into MuJoCo's callbacks; called by ``import mujoco``."""
    if os.environ.get(VARIABLE) == "0":
        return
    with PROCESS.lock:
        if PROCESS.automatic or PROCESS.installations:
            return
        PROCESS.served.update((name, read(name)) for name in NAMES)
        if any(slot.is_python for slot in PROCESS.served.values()):
            PROCESS.served.clear()  # cannot be passed on to from C; mjhill.install() does so
            return
        stubs = {
            "act_dyn": TYPES["act_dyn"](_act_dyn),
            "act_bias": TYPES["act_bias"](_act_bias),
            "passive": TYPES["passive"](_passive),
        }
        PROCESS.kept.append(stubs)
        for name, stub in stubs.items():
            getattr(mujoco, f"set_mjcb_{name}")(stub)
            PROCESS.automatic[name] = {_address(stub)}


class _Loaded:
    """The machine code as ctypes functions, or why there is none."""

    def __init__(self) -> None:
        self.functions: dict[str, Any] | None = None
        self.tried = False
        self.structs: bool | None = None
        self.checking = False


_loaded = _Loaded()


def _act_dyn(m: int, d: int, actuator: int) -> float:
    return _actuator("act_dyn", m, d, actuator)


def _act_bias(m: int, d: int, actuator: int) -> float:
    return _actuator("act_bias", m, d, actuator)


def _actuator(name: str, m: int, d: int, actuator: int) -> float:
    known = _ready()
    if known and _is_muscle(m, actuator):
        functions = _functions()
        # what cannot be computed must not look like a relaxed muscle
        return float(functions[name](m, d, actuator)) if functions else math.nan
    passed_on = PROCESS.served[name].pointer
    if passed_on:
        return float(TYPES[name](passed_on)(m, d, actuator))
    return 0.0 if known else math.nan


def _passive(m: int, d: int) -> None:
    if _ready():
        from mjhill.layout import NUSER_JNT

        if _nuser_jnt(m) >= NUSER_JNT:
            functions = _functions()
            if functions:
                functions["passive"](m, d)
            return
        with _interrupts_waiting():
            _put_guard(NUSER_JNT)
    passed_on = PROCESS.served["passive"].pointer
    if passed_on:
        TYPES["passive"](passed_on)(m, d)


def _ready() -> bool:
    """Whether MuJoCo's structs are where the stubs look; the first call checks that."""
    if _loaded.structs is None:
        with PROCESS.lock:
            if _loaded.checking:
                return False  # by the small model of the check itself
            _loaded.checking = True
            try:
                with _interrupts_waiting():
                    import mjhill.layout  # noqa: F401
                    from mjhill.callbacks.structs import verify_fields

                    verify_fields()
                _loaded.structs = True
            except Exception as error:
                _loaded.structs = False
                _complain(error)
            finally:
                _loaded.checking = False
    return _loaded.structs


def _complain(error: Exception) -> None:
    print(f"mjhill: the muscle cannot run, its forces are not numbers: {error}", file=sys.stderr)


def _is_muscle(m: int, actuator: int) -> bool:
    from mjhill.callbacks.structs import offset
    from mjhill.layout import MUSCLE_TAG

    rows = ctypes.c_void_p.from_address(m + offset("mjModel.actuator_dynprm")).value
    assert rows is not None
    return ctypes.c_double.from_address(rows + 80 * actuator).value == MUSCLE_TAG


def _nuser_jnt(m: int) -> int:
    from mjhill.callbacks.structs import offset

    return ctypes.c_int64.from_address(m + offset("mjModel.nuser_jnt")).value


def _functions() -> dict[str, Any] | None:
    """The machine code, loaded at the first call and put in the place of the stubs."""
    with PROCESS.lock:
        if not _loaded.tried:
            _loaded.tried = True  # before, because loading makes a small model, which asks again
            try:
                with _interrupts_waiting():
                    _load()
            except Exception as error:
                _complain(error)
        return _loaded.functions


@contextmanager
def _interrupts_waiting() -> Iterator[None]:
    """Keep Ctrl-C waiting: raised in a callback from C it would be lost, and the load with it.

    The same for SIGTERM where the program turns it into an exception.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[int] = []
    before = {
        number: signal.signal(number, lambda arrived, _: waiting.append(arrived))
        for number in (signal.SIGINT, signal.SIGTERM)
        if callable(signal.getsignal(number))
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for arrived in waiting[:1]:  # soon, when the callback has returned
            threading.Timer(0.02, _thread.interrupt_main, (arrived,)).start()


def _load() -> None:
    from mjhill.callbacks.machine_code import build

    code = build()
    PROCESS.kept.append(code)
    for index, name in enumerate(NAMES):
        code.chain[index] = PROCESS.served[name].pointer
    _loaded.functions = {name: TYPES[name](getattr(code, name)) for name in NAMES}
    _replace({name: getattr(code, name) for name in NAMES})


def _put_guard(enough: int) -> None:
    """A passive callback in C for models without our elasticity, which calls the stub for others.

    Python would cost each of their steps a microsecond and all threads their turns.
    """
    import llvmlite.binding as llvm

    from mjhill.callbacks.structs import offset

    with PROCESS.lock:
        if len(PROCESS.automatic["passive"]) > 1:
            return  # another thread has done it
        [stub] = PROCESS.automatic["passive"]
        passed_on = PROCESS.served["passive"].pointer or 0
        call = "call void inttoptr (i64 {} to ptr)(ptr %m, ptr %d)"
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        library = (
            llvm.JITLibraryBuilder()
            .add_ir(
                f"""define void @mjhill_guard(ptr %m, ptr %d) {{
                  %p = getelementptr i8, ptr %m, i64 {offset("mjModel.nuser_jnt")}
                  %n = load i64, ptr %p
                  %few = icmp slt i64 %n, {enough}
                  br i1 %few, label %pass, label %ask
                ask:
                  {call.format(stub)}
                  ret void
                pass:
                  {call.format(passed_on) if passed_on else ""}
                  ret void
                }}"""
            )
            .export_symbol("mjhill_guard")
        )
        jit = llvm.create_lljit_compiler()
        linked = library.link(jit, "mjhill_guard")
        PROCESS.kept.append((jit, linked))
        _replace({"passive": linked["mjhill_guard"]})


def _replace(addresses: dict[str, int]) -> None:
    """Put C functions where those put there automatically still are."""
    for name, address in addresses.items():
        if global_pointer(name).value in PROCESS.automatic[name]:
            global_pointer(name).value = address
        PROCESS.automatic[name].add(address)


def _address(function: Any) -> int:
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address
