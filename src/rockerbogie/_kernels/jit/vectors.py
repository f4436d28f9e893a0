"""Arithmetic on blocks of lanes: plain Python functions, compiled to SIMD instructions.

A function of rows computes with `Lanes`: each operation on them adds one vector instruction to the kernel that
calls the function. Loops and branches of the function run while it is compiled. In plain Python (`mode`), the same function
computes with numpy arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .mode import COMPILED

LANES = 8  # poses in a block: numbers in the widest registers
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_FLAGS = ("contract",)  # a product and the sum it enters may be rounded once


class Lanes:
    """Numbers or flags of all lanes, while a kernel is compiled."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def _operate(self, name: str, left: Any, right: Any) -> Lanes:
        """Return the result of an instruction.

        Args:
            name: builder method.
            left, right: lanes or numbers.
        """
        return Lanes(self.builder, getattr(self.builder, name)(_value(left), _value(right), flags=_FLAGS))

    def _compare(self, sign: str, other: Any) -> Lanes:
        """Return flags; False for NaN.

        Args:
            sign: comparison.
            other: lanes or a number.
        """
        return Lanes(self.builder, self.builder.fcmp_ordered(sign, self.value, _value(other)))

    def __add__(self, other: Any) -> Lanes:
        return self._operate("fadd", self, other)

    def __radd__(self, other: Any) -> Lanes:
        return self._operate("fadd", other, self)

    def __sub__(self, other: Any) -> Lanes:
        return self._operate("fsub", self, other)

    def __rsub__(self, other: Any) -> Lanes:
        return self._operate("fsub", other, self)

    def __mul__(self, other: Any) -> Lanes:
        return self._operate("fmul", self, other)

    def __rmul__(self, other: Any) -> Lanes:
        return self._operate("fmul", other, self)

    def __truediv__(self, other: Any) -> Lanes:
        return self._operate("fdiv", self, other)

    def __rtruediv__(self, other: Any) -> Lanes:
        return self._operate("fdiv", other, self)

    def __neg__(self) -> Lanes:
        return Lanes(self.builder, self.builder.fneg(self.value))

    def __lt__(self, other: Any) -> Lanes:
        return self._compare("<", other)

    def __gt__(self, other: Any) -> Lanes:
        return self._compare(">", other)

    def __ge__(self, other: Any) -> Lanes:
        return self._compare(">=", other)

    def __and__(self, other: Lanes) -> Lanes:
        return Lanes(self.builder, self.builder.and_(self.value, other.value))

    def __or__(self, other: Lanes) -> Lanes:
        return Lanes(self.builder, self.builder.or_(self.value, other.value))


def _value(x: Any) -> Any:
    """Return the LLVM value of lanes or of one number for all lanes.

    Args:
        x: lanes or a number.
    """
    return x.value if isinstance(x, Lanes) else ir.Constant(_VECTOR, [float(x)] * LANES)


def where(flag: Any, a: Any, b: Any) -> Any:
    """Return a in lanes whose flag is set, else b.

    Args:
        flag: flags.
        a, b: lanes or numbers.
    """
    if isinstance(flag, Lanes):
        return Lanes(flag.builder, flag.builder.select(flag.value, _value(a), _value(b)))
    return np.where(flag, a, b)


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller number in each lane; b if one is NaN.

    Args:
        a: lanes.
        b: lanes or a number.
    """
    return where(a < b, a, b)


def larger(a: Any, b: Any) -> Any:
    """Return the larger number in each lane; b if one is NaN.

    Args:
        a: lanes.
        b: lanes or a number.
    """
    return where(a > b, a, b)


def root(x: Any) -> Any:
    """Return square roots.

    Args:
        x: lanes.
    """
    if isinstance(x, Lanes):
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        instruction = cgutils.get_or_insert_function(x.builder.module, kind, f"llvm.sqrt.v{LANES}f64")
        return Lanes(x.builder, x.builder.call(instruction, [x.value]))
    return np.sqrt(x)


class NumpyRows:
    """Rows of a lane array, read and written as numpy arrays."""

    def __init__(self, lanes: Any) -> None:
        self.lanes = lanes

    def __getitem__(self, row: int) -> Any:
        return self.lanes[row * LANES : (row + 1) * LANES].copy()

    def __setitem__(self, row: int, value: Any) -> None:
        self.lanes[row * LANES : (row + 1) * LANES] = value


class _CompiledRows:
    """Rows of a lane array, read and written by vector instructions."""

    def __init__(self, builder: Any, data: Any) -> None:
        self.builder, self.data = builder, data

    def _address(self, row: int) -> Any:
        """Return the address of a row.

        Args:
            row: its number.
        """
        start = self.builder.gep(self.data, [ir.Constant(ir.IntType(64), row * LANES)])
        return self.builder.bitcast(start, _VECTOR.as_pointer())

    def __getitem__(self, row: int) -> Lanes:
        return Lanes(self.builder, self.builder.load(self._address(row), align=8))

    def __setitem__(self, row: int, value: Any) -> None:
        self.builder.store(_value(value), self._address(row), align=8)


class _CompiledNumbers:
    """Numbers of an array, each the same in all lanes."""

    def __init__(self, builder: Any, data: Any) -> None:
        self.builder, self.data = builder, data

    def __getitem__(self, index: int) -> Lanes:
        number = self.builder.load(self.builder.gep(self.data, [ir.Constant(ir.IntType(64), index)]), align=8)
        empty, first = ir.Constant(_VECTOR, ir.Undefined), ir.Constant(ir.IntType(32), 0)
        everywhere = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        lane = self.builder.insert_element(empty, number, first)
        return Lanes(self.builder, self.builder.shuffle_vector(lane, empty, everywhere))


def on_lanes(function: Callable[..., None], numbers: bool = False) -> Any:
    """Return a kernel that runs a function of the rows of a lane array.

    Args:
        function: reads and writes `rows[number]`; with `numbers`, its second argument gives the same number in all lanes.
        numbers: True if the kernel takes an array of numbers beside the lane array.

    Returns:
        A function (lanes) or (lanes, array) to call in compiled kernels.
    """
    if not COMPILED:

        def run(lanes: Any, *array: Any) -> None:
            """Run the function on numpy arrays.

            Args:
                lanes: the lane array.
                array: the array of numbers, if it is taken.
            """
            with np.errstate(all="ignore"):
                function(NumpyRows(lanes), *array)

        return run

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        """Add the function's instructions to the calling kernel.

        Args:
            context, builder, signature, args: as numba passes them.
        """
        data = [context.make_array(kind)(context, builder, x).data for kind, x in zip(signature.args, args, strict=True)]
        function(_CompiledRows(builder, data[0]), *(_CompiledNumbers(builder, x) for x in data[1:]))
        return context.get_dummy_value()

    def lower(typing_context: Any, lanes: Any) -> Any:
        """Return the kernel's signature and its code generator.

        Args:
            typing_context: unused; numba passes it to every intrinsic.
            lanes: type of the lane array.
        """
        return types.void(lanes), codegen

    def lower_with_numbers(typing_context: Any, lanes: Any, array: Any) -> Any:
        """Return the kernel's signature and its code generator.

        Args:
            typing_context: unused; numba passes it to every intrinsic.
            lanes, array: types of the lane array and of the array of numbers.
        """
        return types.void(lanes, array), codegen

    return intrinsic(lower_with_numbers if numbers else lower)
