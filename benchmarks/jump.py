"""A call to an address, for numba: steps of other solvers may ask for the rates of compiled kernels."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def jump(typingctx: Any, address: Any, record: Any, number: Any, array: Any) -> Any:
    """Call the routine at an address with the data of two arrays and a number between."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        real = ir.DoubleType()
        pointer = real.as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, real, pointer])
        first, second = (context.make_array(signature.args[i])(context, builder, arguments[i]).data for i in (1, 3))
        routine = builder.inttoptr(arguments[0], kind.as_pointer())
        builder.call(routine, [first, arguments[2], second])
        return context.get_dummy_value()

    return types.void(types.int64, record, types.float64, array), generate
