"""Machine code of the compiled callbacks: from the cache or the compiler, linked into the process.

numba's own cache is not used: it does not see the equations in other files nor the struct
offsets that the code is made for, and it loads the compiler to run what is compiled. Here the
code is kept under a fingerprint of all that it is made from.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import llvmlite.binding as llvm
import numpy as np

from mjhill.callbacks.structs import mujoco_library, verify_fields
from mjhill.files import replacing

CHAIN_SYMBOL = "mjhill_chained_callbacks"  # three pointers: act_dyn, act_bias, passive
READ_CONTROL = "mj_readCtrl"
_UNUSED = (ctypes.c_void_p * 3)()
_NAMES = ("act_dyn", "act_bias", "passive")
_SOURCES = Path(__file__).parent.parent
_MADE_FROM = ("elements.py", "scheme.py", "layout.py", "callbacks/*.py")

_Code = dict[str, tuple[str, bytes]]  # name: symbol and object code


@dataclass(frozen=True)
class MachineCode:
    """Addresses of the three C functions, and the table of those they pass on to.

    Attributes:
        act_dyn: Address of ``mjcb_act_dyn``.
        act_bias: Address of ``mjcb_act_bias``.
        passive: Address of ``mjcb_passive``.
        chain: A ctypes array of three pointers, in that order.
        keep: What owns the code.
    """

    act_dyn: int
    act_bias: int
    passive: int
    chain: Any
    keep: Any


def build() -> MachineCode:
    """Load the callbacks from the cache, or compile them and keep them there.

    Raises:
        RuntimeError: MuJoCo's structs are not laid out as its headers say.
    """
    verify_fields()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    path = cache_folder() / f"{_fingerprint()}.npz"
    code = _read(path)
    if code is None:
        from mjhill.callbacks.compiled import compile_callbacks

        # numba links what it compiles, though what it links is not what runs
        llvm.add_symbol(CHAIN_SYMBOL, ctypes.addressof(_UNUSED))
        llvm.add_symbol(READ_CONTROL, _read_control())
        code = compile_callbacks()
        _write(path, code)
    return _link(code)


def cache_folder() -> Path:
    """Where machine code is kept: ``MJHILL_CACHE_DIR``, or the user's folder for caches."""
    from platformdirs import user_cache_path

    given = os.environ.get("MJHILL_CACHE_DIR")
    return Path(given) if given else user_cache_path("mjhill")


def _fingerprint() -> str:
    """A name for all that the machine code depends on."""
    digest = hashlib.sha256()
    for package in ("mujoco", "numba", "llvmlite"):
        digest.update(version(package).encode())
    digest.update(llvm.get_host_cpu_name().encode())
    digest.update(llvm.get_host_cpu_features().flatten().encode())
    for pattern in _MADE_FROM:
        for source in sorted(_SOURCES.glob(pattern)):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:24]


def _read(path: Path) -> _Code | None:
    """Code from the cache; None if it is not there, or damaged."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {
                name: (str(archive[f"{name}_symbol"]), archive[name].tobytes()) for name in _NAMES
            }
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None


def _write(path: Path, code: _Code) -> None:
    """Keep code in the cache, where there is a place that can be written."""
    arrays: dict[str, Any] = {}
    for name, (symbol, object_code) in code.items():
        arrays[name] = np.frombuffer(object_code, dtype=np.uint8)
        arrays[f"{name}_symbol"] = np.array(symbol)
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial:
            np.savez(partial, allow_pickle=False, **arrays)


def _link(code: _Code) -> MachineCode:
    chain = (ctypes.c_void_p * len(_NAMES))()
    jit = llvm.create_lljit_compiler()
    address, libraries = {}, []
    for name, (symbol, object_code) in code.items():
        library = (
            llvm.JITLibraryBuilder()
            .add_object_img(object_code)
            .add_current_process()  # for exp
            .import_symbol(CHAIN_SYMBOL, ctypes.addressof(chain))
            .import_symbol(READ_CONTROL, _read_control())
            .export_symbol(symbol)
            .link(jit, f"mjhill_{name}")
        )
        address[name] = library[symbol]
        libraries.append(library)
    return MachineCode(**address, chain=chain, keep=(jit, libraries))


def _read_control() -> int:
    """Address of MuJoCo's ``mj_readCtrl``."""
    address = ctypes.cast(mujoco_library().mj_readCtrl, ctypes.c_void_p).value
    assert address is not None
    return address
