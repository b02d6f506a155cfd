"""Machine code of the compiled callbacks: from the cache or the compiler, linked into the process.

numba's own cache is not used: it does not see the equations in other files nor the struct
offsets that the code is made for, and it loads the compiler to run what is compiled. Here the
code is kept under a fingerprint of all that it is made from.
"""

from __future__ import annotations

import ctypes
import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import llvmlite.binding as llvm

from mjhill.engine import code_cache
from mjhill.engine.callbacks import CHAIN_SYMBOL, READ_CONTROL, mujoco_library
from mjhill.engine.equations import source_digest
from mjhill.engine.structs import verify_fields

_UNUSED = (ctypes.c_void_p * 3)()
_NAMES = ("act_dyn", "act_bias", "passive")


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
    folder = code_cache.safe_folder()
    if folder is None:
        return _link(_compile())
    path = folder / f"{_fingerprint()}.code"
    with code_cache.alone(path):
        code = code_cache.read(path, _NAMES)
        if code is None:
            code = _compile()
            code_cache.write(path, code)
    return _link(code)


def _compile() -> code_cache.Code:
    from mjhill.engine.compiled import compile_callbacks

    # numba links what it compiles, though what it links is not what runs
    llvm.add_symbol(CHAIN_SYMBOL, ctypes.addressof(_UNUSED))
    llvm.add_symbol(READ_CONTROL, _read_control())
    return compile_callbacks()


def _fingerprint() -> str:
    """A name for all that the machine code depends on."""
    digest = hashlib.sha256()
    for package in ("mujoco", "numba", "llvmlite"):
        digest.update(version(package).encode())
    digest.update(llvm.get_host_cpu_name().encode())
    digest.update(llvm.get_host_cpu_features().flatten().encode())
    digest.update(source_digest())
    return digest.hexdigest()[:24]


def _link(code: code_cache.Code) -> MachineCode:
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
