"""Memory in ways that numba itself does not offer: views that are not counted, arrays seen from elsewhere, the nodes around
many places read at once.

Each is given twice: for compiled kernels in the compiler's own terms, and in plain Python for where nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

if config.DISABLE_JIT:

    def bare(array: Any) -> Any:
        """The array itself: there is nothing to gain in plain Python."""
        return array

    class _Window:
        """What `window` gives where there are no pointers to move. Indices beside the window raise."""

        def __init__(self, array: Any, row: int, col: int) -> None:
            self.array, self.row, self.col = array, row, col

        def __getitem__(self, at: tuple[int, int]) -> Any:
            row, col = at[0] - self.row, at[1] - self.col
            if row < 0 or col < 0:
                raise IndexError(f"node {at} lies before the window's first, {self.row, self.col}")
            return self.array[row, col]

    def window(array: Any, row: int, col: int) -> Any:
        """The array, indexed as the part of a larger one that begins at (row, col)."""
        return _Window(array, row, col) if row or col else array

    def node_taker(size: int, lanes: int) -> Callable[..., None]:
        """As below."""

        def take(S: Any, column: int, row: int, grid: Any, to: int, apart: int) -> None:
            for l in range(lanes):
                i, j = int(S[column + l]), int(S[row + l])
                for m, n in np.ndindex(size, size):
                    S[to + (size * m + n) * apart + l] = grid[j + m, i + n]

        return take

else:

    def _bare(typing_context: Any, array: Any) -> Any:
        """A view of an array that is not counted as a reference to it.

        Counting is atomic, and at a hundred views a pose costs as much as the arithmetic. Whoever owns the array must
        outlive the view.
        """

        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            view = context.make_array(signature.args[0])(context, builder, args[0])
            view.meminfo = view.meminfo.type(None)
            view.parent = view.parent.type(None)
            return view._getvalue()

        return array(array), codegen

    unowned_view = intrinsic(_bare)

    def _window(typing_context: Any, array: Any, row: Any, col: Any) -> Any:
        """A `unowned_view` view (2 axes) that is indexed as the part of a larger array that begins at (row, col): its address is
        moved back by so much, so that the larger one's indices meet what they should. No index may go beside the part."""

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

    _WHOLE, _NUMBER, _TOGETHER = ir.IntType(64), ir.DoubleType(), 8  # lanes, as many as the widest registers hold

    def node_taker(size: int, lanes: int) -> Callable[..., None]:
        """A kernel (S, column, row, grid, to, apart): S[to + (size m + n) apart + lane] = grid[j + m, i + n] for m, n < size
        (2 or 4), where i = S[column + lane] and j = S[row + lane] are whole numbers, for all of `lanes` (a multiple of 8).

        Lanes lie over different cells, but each wants the same few nodes side by side. One by one that is a load and a store for
        each; a whole row of a lane's nodes in one load, turned round in registers, takes less than half the time. Nothing is
        checked: all these nodes must be there, and a row's must lie side by side.
        """

        def take(typing_context: Any, S: Any, column: Any, row: Any, grid: Any, to: Any, apart: Any) -> Any:
            def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
                block = context.make_array(signature.args[0])(context, builder, args[0])
                ground = context.make_array(signature.args[3])(context, builder, args[3])
                line, node = cgutils.unpack_tuple(builder, ground.strides)
                origin = builder.bitcast(ground.data, cgutils.voidptr_t)

                def at(row: Any, lane: int) -> Any:
                    place = builder.gep(block.data, [builder.add(row, _WHOLE(lane))])
                    return builder.bitcast(place, ir.VectorType(_NUMBER, _TOGETHER).as_pointer())

                def whole(row: Any, lane: int) -> Any:
                    return builder.fptoui(builder.load(at(row, lane), align=8), ir.VectorType(_WHOLE, _TOGETHER))

                for first in range(0, lanes, _TOGETHER):
                    columns, rows = whole(args[1], first), whole(args[2], first)
                    starts = []
                    for l in range(_TOGETHER):
                        i, j = (builder.extract_element(index, ir.IntType(32)(l)) for index in (columns, rows))
                        starts.append(builder.gep(origin, [builder.add(builder.mul(i, node), builder.mul(j, line))]))
                    for m in range(size):
                        nodes = []
                        for start in starts:
                            address = builder.gep(start, [builder.mul(line, _WHOLE(m))])
                            address = builder.bitcast(address, ir.VectorType(_NUMBER, size).as_pointer())
                            nodes.append(builder.load(address, align=8))
                        for n, turned in enumerate(_turned(builder, nodes)):
                            out = builder.add(args[4], builder.mul(args[5], _WHOLE(size * m + n)))
                            builder.store(turned, at(out, first), align=8)
                return context.get_dummy_value()

            return types.void(S, types.intp, types.intp, grid, types.intp, types.intp), codegen

        return intrinsic(take)

    def _turned(builder: Any, v: list[Any]) -> list[Any]:
        """Eight vectors of 2 or 4 numbers as 2 or 4 vectors of eight, by steps that processors have instructions for."""

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
        near, far = [0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]
        return [mix(low[n % 2], high[n % 2], near if n < 2 else far) for n in range(4)]
