"""The muscle in every process that imports MuJoCo, whether or not it imports mjhill.

MuJoCo calls the entry points ``mujoco.plugins`` at the end of its import; ours is ``start``. It
puts stubs into the callbacks, which cost nothing until a model asks for them: the first muscle,
or the first joint with passive elasticity, makes them load the machine code and put it in their
place. ``MJHILL_AUTOLOAD=0`` in the environment leaves MuJoCo as it is.

Imports no other module of mjhill but ``engine.callbacks`` until then, because mjhill may itself
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

from mjhill.engine.callbacks import (
    NAMES,
    PROCESS,
    TYPES,
    Slot,
    global_pointer,
    read,
    restore,
)

VARIABLE = "MJHILL_AUTOLOAD"

# calls by models without our elasticity, after which making the guard is worth its 40 ms
_BEFORE_GUARD = 1000


def start() -> None:
    """Put the stubs into MuJoCo's callbacks; called by ``import mujoco``."""
    if os.environ.get(VARIABLE) == "0":
        return
    with PROCESS.lock:
        if PROCESS.automatic or PROCESS.installations:
            return
        served = {name: read(name) for name in NAMES}
        if any(slot.is_python for slot in served.values()):
            return  # cannot be passed on to from C; mjhill.install() does so
        try:
            _put_stubs(served)
        except BaseException:
            # import mujoco makes a warning of it and goes on, with callbacks as they were
            PROCESS.automatic.clear()
            PROCESS.served.clear()
            restore(served)
            raise


def _put_stubs(served: dict[str, Slot]) -> None:
    stubs = {
        "act_dyn": TYPES["act_dyn"](_act_dyn),
        "act_bias": TYPES["act_bias"](_act_bias),
        "passive": TYPES["passive"](_passive),
    }
    PROCESS.served.update(served)
    PROCESS.kept.append(stubs)
    for name, stub in stubs.items():
        getattr(mujoco, f"set_mjcb_{name}")(stub)
        PROCESS.automatic[name] = {_address(stub)}


class _Loaded:
    """What has been loaded for the first model that asked for it."""

    def __init__(self) -> None:
        self.functions: dict[str, Any] | None = None  # the machine code, as ctypes functions
        self.tried = False
        self.offsets: tuple[int, int] | None = None  # see _offsets
        self.looked = False
        self.foreign = 0  # calls of the passive stub by models without our elasticity
        self.guarded = False  # or tried to be; see _put_guard


_loaded = _Loaded()


def _act_dyn(m: int, d: int, actuator: int) -> float:
    return _actuator("act_dyn", m, d, actuator)


def _act_bias(m: int, d: int, actuator: int) -> float:
    return _actuator("act_bias", m, d, actuator)


def _actuator(name: str, m: int, d: int, actuator: int) -> float:
    from mjhill.muscles import BY_TAG

    offsets, passed_on = _offsets(), PROCESS.served[name].pointer
    if offsets and _tag(m + offsets[1], actuator) in BY_TAG:
        functions = _functions()
        # what cannot be computed must not look like a relaxed muscle
        return float(functions[name](m, d, actuator)) if functions else math.nan
    if passed_on:
        return float(TYPES[name](passed_on)(m, d, actuator))
    return 0.0 if offsets else math.nan


def _passive(m: int, d: int) -> None:
    from mjhill.engine.layout import NUSER_JNT

    offsets, passed_on = _offsets(), PROCESS.served["passive"].pointer
    if offsets and ctypes.c_int64.from_address(m + offsets[0]).value >= NUSER_JNT:
        functions = _functions()
        if functions:
            functions["passive"](m, d)
        return
    if passed_on:
        TYPES["passive"](passed_on)(m, d)
    _loaded.foreign += 1
    if offsets and _loaded.foreign >= _BEFORE_GUARD and not _loaded.guarded:
        with _interrupts_waiting():
            _put_guard(offsets[0], NUSER_JNT)


def _tag(pointer: int, actuator: int) -> float:
    """The first of an actuator's ten ``dynprm``, whose array a pointer at an address points to."""
    rows = ctypes.c_void_p.from_address(pointer).value
    assert rows is not None
    return ctypes.c_double.from_address(rows + 80 * actuator).value


def _offsets() -> tuple[int, int] | None:
    """Where ``nuser_jnt`` and ``actuator_dynprm`` are in ``mjModel``, checked once.

    None where that cannot be known, and while it is being checked, which runs a small model.
    """
    if _loaded.offsets is not None:
        return _loaded.offsets
    with PROCESS.lock:
        if not _loaded.looked:
            _loaded.looked = True
            try:
                from mjhill.engine.structs import offset, verify_fields

                with _interrupts_waiting():
                    verify_fields()
                nuser, rows = offset("mjModel.nuser_jnt"), offset("mjModel.actuator_dynprm")
                _loaded.offsets = nuser, rows
            except Exception as error:
                _say(error)
        return _loaded.offsets


def _say(error: Exception) -> None:
    print(f"mjhill: the muscle cannot run, its forces are not numbers: {error}", file=sys.stderr)


def _functions() -> dict[str, Any] | None:
    """The machine code, loaded at the first call and put in the place of the stubs."""
    with PROCESS.lock:
        if not _loaded.tried:
            _loaded.tried = True  # before, because loading makes a small model, which asks again
            try:
                with _interrupts_waiting():
                    _load()
            except Exception as error:
                _say(error)
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
    from mjhill.engine.machine_code import build

    code = build()
    PROCESS.kept.append(code)
    for index, name in enumerate(NAMES):
        code.chain[index] = PROCESS.served[name].pointer
    _loaded.functions = {name: TYPES[name](getattr(code, name)) for name in NAMES}
    _replace({name: getattr(code, name) for name in NAMES})


def _put_guard(nuser_jnt: int, enough: int) -> None:
    """A passive callback in C for models without our elasticity, which calls the stub for others.

    Python would cost each of their steps a microsecond and all threads their turns. Without a
    compiler it stays at that.

    Args:
        nuser_jnt: Where that is in ``mjModel`` [bytes].
        enough: The ``nuser_jnt`` of a model that may have our elasticity.
    """
    with PROCESS.lock:
        if _loaded.guarded or len(PROCESS.automatic["passive"]) > 1:
            return  # another thread has done it, or the machine code is there
        _loaded.guarded = True
        try:
            import llvmlite.binding as llvm
        except Exception:
            return
        [stub] = PROCESS.automatic["passive"]
        passed_on = PROCESS.served["passive"].pointer or 0
        call = "call void inttoptr (i64 {} to ptr)(ptr %m, ptr %d)"
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        library = (
            llvm.JITLibraryBuilder()
            .add_ir(
                f"""define void @mjhill_guard(ptr %m, ptr %d) {{
                  %p = getelementptr i8, ptr %m, i64 {nuser_jnt}
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
