"""Eight numbers at a time inside compiled kernels: a vector type of eight float64 and the few operations gravity needs.

Numba leaves the loops over orders of a harmonic series scalar, because it cannot prove their arrays apart. These
intrinsics say what is wanted: LLVM maps <8 x double> to one, two or four registers of the machine at hand. In plain
Python (``NUMBA_DISABLE_JIT=1``) the same names work on small numpy arrays.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils, errors
from numba.extending import intrinsic, models, register_model

LANES = 8
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


class Float64x8(types.Type):
    """Numba type of eight float64 lanes; lives in registers, never in Python."""

    def __init__(self) -> None:
        super().__init__(name="Float64x8")


float64x8 = Float64x8()


@register_model(Float64x8)
class _Float64x8Model(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _VECTOR)


def _checked(array):
    good = isinstance(array, types.Array) and (array.ndim, array.layout, array.dtype) == (1, "C", types.float64)
    if not good:
        raise errors.TypingError(f"lanes are loaded from and stored to contiguous float64 vectors, not {array}.")
    return array


def _pointer(context, builder, array_type, array, index):
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


@intrinsic
def _load(typingctx, array, index):
    def codegen(context, builder, signature, args):
        return builder.load(_pointer(context, builder, signature.args[0], *args), align=8)

    return float64x8(_checked(array), types.intp), codegen


@intrinsic
def _store(typingctx, array, index, vector):
    def codegen(context, builder, signature, args):
        builder.store(args[2], _pointer(context, builder, signature.args[0], *args[:2]), align=8)
        return context.get_dummy_value()

    return types.void(_checked(array), types.intp, float64x8), codegen


@intrinsic
def _splat(typingctx, number):
    def codegen(context, builder, signature, args):
        one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), args[0], ir.Constant(ir.IntType(32), 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), zeros)

    return float64x8(types.float64), codegen


@intrinsic
def _mul(typingctx, a, b):
    return float64x8(float64x8, float64x8), lambda context, builder, signature, args: builder.fmul(*args)


@intrinsic
def _muladd(typingctx, a, b, c):
    def codegen(context, builder, signature, args):
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)  # fused where the machine can, never a call
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.fmuladd.v{LANES}f64"), args)

    return float64x8(float64x8, float64x8, float64x8), codegen


if config.DISABLE_JIT:

    def load(array, index):
        """Lanes array[index], ..., array[index + 7]."""
        return array[index : index + LANES].copy()

    def store(array, index, vector):
        """Write the lanes to array[index], ..., array[index + 7]."""
        array[index : index + LANES] = vector

    def splat(number):
        """The same number in all lanes."""
        return np.full(LANES, number)

    def mul(a, b):
        """a b, lane by lane."""
        return a * b

    def muladd(a, b, c):
        """a b + c, lane by lane, fused where the machine can."""
        return a * b + c

else:
    load, store, splat, mul, muladd = _load, _store, _splat, _mul, _muladd
