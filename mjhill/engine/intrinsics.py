"""Reads and writes at computed addresses, and calls through pointers, for compiled callbacks."""

from __future__ import annotations

from typing import Any

import numba
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils

from mjhill.engine.callbacks import CHAIN_SYMBOL, READ_CONTROL
from mjhill.muscles import MuscleModel
from mjhill.muscles.model import ARRAYS, CONTEXT, FIRST_SLOT

intrinsic: Any = extending.intrinsic  # its wrappers are called without the typing context

_F64, _I64, _I32, _I8 = ir.DoubleType(), ir.IntType(64), ir.IntType(32), ir.IntType(8)


def _loader(llvm_type: ir.Type, numba_type: Any) -> Any:
    @intrinsic
    def load(typingctx: Any, address: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            value = builder.load(builder.inttoptr(args[0], llvm_type.as_pointer()))
            return builder.zext(value, _I64) if llvm_type is _I8 else value

        return numba_type(types.int64), codegen

    return load


load_double = _loader(_F64, types.float64)
load_int = _loader(_I32, types.int32)
load_pointer = _loader(_I64, types.int64)
load_byte = _loader(_I8, types.int64)


@intrinsic
def store_double(typingctx: Any, address: Any, value: Any) -> Any:
    """Write a double at an address."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[1], builder.inttoptr(args[0], _F64.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.int64, types.float64), codegen


@intrinsic
def store_tuple(typingctx: Any, address: Any, values: Any) -> Any:
    """Write the doubles of a tuple from an address on."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        for k in range(len(values)):
            at = builder.add(args[0], _I64(8 * k))
            value = builder.extract_value(args[1], k)
            builder.store(value, builder.inttoptr(at, _F64.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.int64, values), codegen


@intrinsic
def _as_pointer(typingctx: Any, address: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], _F64.as_pointer())

    return types.CPointer(types.float64)(types.int64), codegen


@numba.njit(forceinline=True)
def as_array(address: int, count: int) -> Any:
    """Doubles from an address on as an array, shape (count,)."""
    return numba.carray(_as_pointer(address), (count,))  # type: ignore[attr-defined]


def argument_row(names: tuple[str, ...], model: MuscleModel) -> Any:
    """A function that collects what an equation asks for by name, arrays left out, as a tuple.

    Its arguments are the addresses of the states and of their rates, the context of
    ``CONTEXT``, and the addresses of ``dynprm``, ``gainprm`` and ``biasprm``.
    """
    wanted = [name for name in names if name not in ARRAYS]
    given = ("act", "act_dot", *CONTEXT, *FIRST_SLOT)
    kinds = [types.boolean if name == "staged" else types.float64 for name in wanted]
    taken = [types.int64, types.int64, types.boolean, *[types.float64] * 4, *[types.int64] * 3]
    result = types.Tuple(kinds)

    @intrinsic
    def row(
        typingctx: Any, act: Any, act_dot: Any, staged: Any, u: Any, length: Any, length_rate: Any,
        timestep: Any, dynprm: Any, gainprm: Any, biasprm: Any,
    ) -> Any:  # fmt: skip
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            have = dict(zip(given, args, strict=True))

            def load(start: str, index: int) -> Any:
                at = builder.add(have[start], _I64(8 * index))
                return builder.load(builder.inttoptr(at, _F64.as_pointer()))

            def value(name: str) -> Any:
                if name in CONTEXT:
                    return have[name]
                if name in model.slots:
                    return load(*model.slots[name])
                if name in model.state_names:
                    return load("act", model.state_names.index(name))
                return load("act_dot", model.state_names.index(name.removesuffix("_rate")))

            return context.make_tuple(builder, signature.return_type, [value(n) for n in wanted])

        return result(*taken), codegen

    return row


def _chained(builder: Any, index: int) -> Any:
    """The pointer number ``index`` of the chained callbacks."""
    table_type = ir.ArrayType(_I64, 3)
    table = builder.module.globals.get(CHAIN_SYMBOL)
    if table is None:
        table = ir.GlobalVariable(builder.module, table_type, CHAIN_SYMBOL)
        table.linkage = "external"
    return builder.load(builder.gep(table, [_I32(0), _I32(index)]))


def _chained_actuator(index: int) -> Any:
    @intrinsic
    def call(typingctx: Any, model: Any, data: Any, actuator: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = _chained(builder, index)
            result = cgutils.alloca_once_value(builder, _F64(0.0))
            with builder.if_then(cgutils.is_not_null(builder, pointer)):
                kind = ir.FunctionType(_F64, [_I64, _I64, _I32])
                function = builder.inttoptr(pointer, kind.as_pointer())
                builder.store(builder.call(function, args), result)
            return builder.load(result)

        return types.float64(types.int64, types.int64, types.int32), codegen

    return call


chained_act_dyn = _chained_actuator(0)
chained_act_bias = _chained_actuator(1)


@intrinsic
def chained_passive(typingctx: Any, model: Any, data: Any) -> Any:
    """Call the passive callback that was installed before mjhill's, if there was one."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _chained(builder, 2)
        with builder.if_then(cgutils.is_not_null(builder, pointer)):
            kind = ir.FunctionType(ir.VoidType(), [_I64, _I64])
            builder.call(builder.inttoptr(pointer, kind.as_pointer()), args)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), codegen


@intrinsic
def read_delayed_control(
    typingctx: Any, model: Any, data: Any, actuator: Any, time: Any, interpolation: Any
) -> Any:
    """``mj_readCtrl``: the control of an actuator with a delay."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        m, d, i, t, order = args
        result = cgutils.alloca_once_value(builder, _F64(0.0))
        pointer = _F64.as_pointer()
        kind = ir.FunctionType(pointer, [_I64, _I64, _I32, _F64, pointer, _I32])
        function = cgutils.get_or_insert_function(builder.module, kind, READ_CONTROL)
        found = builder.call(function, [m, d, i, t, result, order])
        builder.store(
            builder.load(builder.select(cgutils.is_null(builder, found), result, found)), result
        )
        return builder.load(result)

    arguments = (types.int64, types.int64, types.int32, types.float64, types.int32)
    return types.float64(*arguments), codegen
