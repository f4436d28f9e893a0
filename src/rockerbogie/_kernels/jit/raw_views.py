"""Memory access that numba lacks: unowned views, shifted views and gathers of grid nodes.

Each function exists twice: as an LLVM intrinsic for compiled kernels, and for plain Python (`mode`).
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

if not COMPILED:

    def unowned_view(array: Any) -> Any:
        """Return the array itself: plain Python needs no unowned views.

        Args:
            array: any array.
        """
        return array

    class _Window:
        """Array indexed as a part of a larger array, in place of a shifted pointer. Indices before the part raise."""

        def __init__(self, array: Any, row: int, col: int) -> None:
            self.array, self.row, self.col = array, row, col

        def __getitem__(self, at: tuple[int, int]) -> Any:
            row, col = at[0] - self.row, at[1] - self.col
            if row < 0 or col < 0:
                raise IndexError(f"node {at} lies before the first node of the window, {self.row, self.col}")
            return self.array[row, col]

    def window(array: Any, row: int, col: int) -> Any:
        """Return the array, indexed as the part of a larger array that begins at (row, col).

        Args:
            array: (m, n) part.
            row, col: its first indices in the larger array.
        """
        return _Window(array, row, col) if row or col else array

    def node_taker(size: int, lanes: int) -> Callable[..., None]:
        """Return a function that copies grid nodes into the lane array, as the compiled form below.

        Args:
            size: nodes on each side, 2 or 4.
            lanes: number of lanes.
        """

        def take(S: Any, column: int, row: int, grid: Any, to: int, apart: int) -> None:
            for l in range(lanes):
                i, j = int(S[column + l]), int(S[row + l])
                for m, n in np.ndindex(size, size):
                    S[to + (size * m + n) * apart + l] = grid[j + m, i + n]

        return take

else:

    def _unowned_view(typing_context: Any, array: Any) -> Any:
        """Return a view of an array without a reference count.

        The owner of the array must outlive the view. Reference counts are atomic. At a hundred views for each
        pose they cost as much time as the arithmetic.

        Args:
            typing_context: unused; numba passes it to every intrinsic.
            array: type of the array.
        """

        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            view = context.make_array(signature.args[0])(context, builder, args[0])
            view.meminfo = view.meminfo.type(None)
            view.parent = view.parent.type(None)
            return view._getvalue()

        return array(array), codegen

    unowned_view = intrinsic(_unowned_view)

    def _window(typing_context: Any, array: Any, row: Any, col: Any) -> Any:
        """Return an unowned view, indexed as the part of a larger array.

        The array has 2 axes; the part begins at (row, col). The address is moved back by (row, col), so that the larger
        array's indices reach the right elements. Indices outside the part are not checked and must not occur.

        Args:
            typing_context: unused; numba passes it to every intrinsic.
            array, row, col: types of the array and of the integers.
        """

        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            view = context.make_array(signature.args[0])(context, builder, args[0])
            steps = cgutils.unpack_tuple(builder, view.strides)
            back = [builder.mul(builder.neg(n), step) for n, step in zip(args[1:], steps, strict=True)]
            start = builder.gep(builder.bitcast(view.data, cgutils.voidptr_t), [builder.add(*back)])
            view.data = builder.bitcast(start, view.data.type)
            view.meminfo = view.meminfo.type(None)
            view.parent = view.parent.type(None)
            return view._getvalue()

        return array(array, types.intp, types.intp), codegen

    window = intrinsic(_window)

    _INTEGER, _NUMBER = ir.IntType(64), ir.DoubleType()
    _VECTOR = 8  # numbers in the widest registers

    def node_taker(size: int, lanes: int) -> Callable[..., None]:
        """Return a kernel that copies the grid nodes under each lane into the lane array.

        Lanes lie over different cells, but store the same nodes side by side. Copying one node at a time takes a load and
        a store for each. Loading a lane's whole row of nodes at once and transposing in registers takes less than half the time.

        Args:
            size: nodes on each side, 2 or 4.
            lanes: number of lanes, a multiple of 8.

        Returns:
            A kernel (S, column, row, grid, to, apart) that sets S[to + (size m + n) apart + lane] = grid[j + m, i + n] for
            0 ≤ m, n < size, where i = S[column + lane] and j = S[row + lane] are integers stored as floats. Indices are not
            checked: all nodes must exist, and the nodes of a row of the grid must be contiguous.
        """

        def take(typing_context: Any, S: Any, column: Any, row: Any, grid: Any, to: Any, apart: Any) -> Any:
            def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
                block = context.make_array(signature.args[0])(context, builder, args[0])
                nodes_array = context.make_array(signature.args[3])(context, builder, args[3])
                line, node = cgutils.unpack_tuple(builder, nodes_array.strides)
                origin = builder.bitcast(nodes_array.data, cgutils.voidptr_t)

                def at(row: Any, lane: int) -> Any:
                    address = builder.gep(block.data, [builder.add(row, _INTEGER(lane))])
                    return builder.bitcast(address, ir.VectorType(_NUMBER, _VECTOR).as_pointer())

                def integers(row: Any, lane: int) -> Any:
                    return builder.fptoui(builder.load(at(row, lane), align=8), ir.VectorType(_INTEGER, _VECTOR))

                for first in range(0, lanes, _VECTOR):
                    columns, rows = integers(args[1], first), integers(args[2], first)
                    starts = []
                    for l in range(_VECTOR):
                        i, j = (builder.extract_element(index, ir.IntType(32)(l)) for index in (columns, rows))
                        starts.append(builder.gep(origin, [builder.add(builder.mul(i, node), builder.mul(j, line))]))
                    for m in range(size):
                        nodes = []
                        for start in starts:
                            address = builder.gep(start, [builder.mul(line, _INTEGER(m))])
                            address = builder.bitcast(address, ir.VectorType(_NUMBER, size).as_pointer())
                            nodes.append(builder.load(address, align=8))
                        for n, column_nodes in enumerate(_transposed(builder, nodes)):
                            out = builder.add(args[4], builder.mul(args[5], _INTEGER(size * m + n)))
                            builder.store(column_nodes, at(out, first), align=8)
                return context.get_dummy_value()

            return types.void(S, types.intp, types.intp, grid, types.intp, types.intp), codegen

        return intrinsic(take)

    def _transposed(builder: Any, v: list[Any]) -> list[Any]:
        """Transpose 8 vectors of 2 or 4 numbers, in shuffles that processors have instructions for.

        Args:
            builder: LLVM instruction builder.
            v: 8 vectors of 2 or 4 numbers.

        Returns:
            2 or 4 vectors of 8 numbers.
        """

        def mix(a: Any, b: Any, which: list[int]) -> Any:
            return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), len(which)), which))

        def join(*parts: Any) -> Any:
            if len(parts) == 1:
                return parts[0]
            low, high = join(*parts[: len(parts) // 2]), join(*parts[len(parts) // 2 :])
            return mix(low, high, list(range(2 * low.type.count)))

        def zipped(a: Any, b: Any) -> list[Any]:
            return [mix(a, b, [0, 8, 2, 10, 4, 12, 6, 14]), mix(a, b, [1, 9, 3, 11, 5, 13, 7, 15])]

        if v[0].type.count == 2:
            return zipped(join(v[0], v[2], v[4], v[6]), join(v[1], v[3], v[5], v[7]))
        low, high = zipped(join(v[0], v[4]), join(v[1], v[5])), zipped(join(v[2], v[6]), join(v[3], v[7]))
        first, second = [0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]
        return [mix(low[n % 2], high[n % 2], first if n < 2 else second) for n in range(4)]
