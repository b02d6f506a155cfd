"""Byte offsets of MuJoCo's C structs, from its own declarations, checked against memory."""

from __future__ import annotations

import ctypes
from functools import cache
from importlib.metadata import version
from typing import Any

import mujoco
import numpy as np

_MADE_FOR = "4.0.0"  # the newest MuJoCo that all this was tested with
_SCALARS = {
    "mjtNum": ctypes.c_double,
    "float": ctypes.c_float,
    "int": ctypes.c_int,
    "mjtSize": ctypes.c_int64,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "mjtBool": ctypes.c_bool,
    "mjtByte": ctypes.c_ubyte,
    "char": ctypes.c_char,
}


# the fields that the compiled callbacks read and write
FIELDS = [
    *(f"mjModel.opt.{name}" for name in ("timestep", "integrator", "disableflags")),
    *(f"mjModel.actuator_{name}" for name in ("dyntype", "ctrladr", "outadr", "actadr", "actnum")),
    *(f"mjModel.actuator_{name}" for name in ("dynprm", "gainprm", "biasprm", "length0")),
    *(f"mjModel.actuator_{name}" for name in ("ctrllimited", "ctrlrange", "delay", "history")),
    *(f"mjModel.{name}" for name in ("njnt", "nuser_jnt", "jnt_user", "jnt_type", "jnt_qposadr")),
    *(f"mjModel.{name}" for name in ("jnt_dofadr", "dof_treeid", "qpos_spring")),
    *(f"mjData.{name}" for name in ("time", "ctrl", "act", "act_dot", "qpos", "qfrc_passive")),
    *(f"mjData.{name}" for name in ("actuator_length", "actuator_velocity", "tree_awake")),
]


@cache
def offset(path: str) -> int:
    """Byte offset of a field such as ``mjModel.opt.timestep`` from the start of its struct.

    Raises:
        RuntimeError: This MuJoCo has no such field, or one of a type unknown to us.
    """
    struct, *names = path.split(".")
    kind, total = _struct(struct), 0
    for name in names:
        field = getattr(kind, name, None)
        if field is None:
            raise RuntimeError(_mismatch(f"has no {path}"))
        total += field.offset
        kind = dict(kind._fields_)[name]
    return total


def _mismatch(what: str) -> str:
    """What is wrong with MuJoCo's structs, and the ways out of it."""
    return (
        f"MuJoCo {mujoco.__version__} {what}, so the compiled muscle of mjhill {version('mjhill')} "
        f"cannot run with it; it was made for MuJoCo {_MADE_FOR}. After an upgrade of mujoco: "
        "'pip install --upgrade mjhill', or go back with "
        f"'pip install mujoco=={_MADE_FOR}'. Meanwhile it runs, many times slower, with "
        'backend="python"'
    )


@cache
def _struct(name: str) -> Any:
    from mujoco.introspect.structs import STRUCTS

    if name not in STRUCTS:
        raise RuntimeError(_mismatch(f"has no struct {name}"))
    return type(name, (ctypes.Structure,), {"_fields_": _members(STRUCTS[name].fields)})


def _members(fields: Any) -> list[tuple[str, Any]]:
    return [(field.name, _ctype(getattr(field, "type", field))) for field in fields]


def _ctype(declared: Any) -> Any:
    """The ctypes type of a declaration of ``mujoco.introspect``."""
    kind = type(declared).__name__
    if kind == "PointerType":
        return ctypes.c_void_p
    if kind == "ArrayType":
        inner = _ctype(declared.inner_type)
        for extent in reversed(declared.extents):
            inner = inner * extent
        return inner
    if kind == "AnonymousStructDecl":
        return type("anonymous", (ctypes.Structure,), {"_fields_": _members(declared.fields)})
    if declared.name in _SCALARS:
        return _SCALARS[declared.name]
    if declared.name.startswith("mjt"):
        return ctypes.c_int  # an enum
    return _struct(declared.name)


def verify(model: mujoco.MjModel, data: mujoco.MjData, paths: list[str]) -> None:
    """Check offsets against a model and its data.

    Pointers must be those of the bound arrays, scalars must read as the bound values.

    Raises:
        RuntimeError: A field is not where it was computed to be; nothing may be read by it.
    """
    for path in paths:
        struct, *names = path.split(".")
        owner: Any = {"mjModel": model, "mjData": data}[struct]
        start = owner._address + offset(path)
        bound = owner
        for name in names:
            bound = getattr(bound, name)
        if isinstance(bound, np.ndarray):
            found = ctypes.c_void_p.from_address(start).value
            good = bound.size == 0 or found == bound.ctypes.data
        else:
            kind = ctypes.c_double if isinstance(bound, float) else ctypes.c_int
            good = kind.from_address(start).value == bound
        if not good:
            raise RuntimeError(_mismatch(f"keeps {path} elsewhere than its own declarations say"))


def verify_fields() -> None:
    """Check every field of ``FIELDS`` against a small model.

    Raises:
        RuntimeError: As ``verify``.
    """
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.00123" integrator="implicitfast">
          <flag clampctrl="disable"/></option><size nuser_jnt="7"/>
        <worldbody><body><joint name="j" ref="0.1"/><geom size="0.1"/></body></worldbody>
        <actuator><motor joint="j" delay="0.01" nsample="10"/>
          <general joint="j" dyntype="filter"/></actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.time = 0.5
    verify(model, data, FIELDS)
