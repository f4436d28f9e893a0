"""`njit`, defined once: cached on disk, IEEE division, nan kept as nan."""

from __future__ import annotations

import contextlib
import gc
import inspect
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import cgutils, event, types
from numba.extending import intrinsic, overload


def _drop_stale_cache() -> None:
    """Delete compiled kernels older than any kernel's source: numba itself looks only at the one file a function is in,
    and would go on using a callee's old code."""
    here = Path(__file__).parent
    newest = max(file.stat().st_mtime for file in here.glob("*.py"))
    for file in (here / "__pycache__").glob("*.nb?"):
        with contextlib.suppress(OSError):  # another process may be doing the same
            if file.stat().st_mtime < newest:
                file.unlink()


_drop_stale_cache()


class _Herald(event.Listener):  # type: ignore[misc]
    """Says once, where someone is watching, that kernels are being compiled, and rests the garbage collector meanwhile:
    nothing is thrown away, and to look for it took an eighth of the time."""

    def __init__(self) -> None:
        self.depth, self.said, self.collects = 0, False, False

    def on_start(self, _: event.Event) -> None:
        self.depth += 1
        if self.depth > 1:  # a kernel that another calls
            return
        self.collects = gc.isenabled()
        gc.disable()
        if not self.said and sys.stderr is not None and sys.stderr.isatty():
            print("rockerbogie: compiling kernels for this machine, some 15 s, once", file=sys.stderr, flush=True)
        self.said = True

    def on_end(self, _: event.Event) -> None:
        self.depth -= 1
        if self.depth == 0 and self.collects:
            gc.enable()


event.register("numba:compile", _Herald())

F = TypeVar("F", bound=Callable[..., Any])


def _compiled(function: F, **how: Any) -> Any:
    """One compiled kernel, whatever numbers written out it is called with: numba would compile it again for f(0) and f(1)."""
    made = numba.njit(cache=True, error_model="numpy", **how)(function)
    if not numba.config.DISABLE_JIT:
        chosen = made.get_call_template
        made.get_call_template = lambda args, kws: chosen(tuple(_any_integer(a) for a in args), kws)
    return made


def _any_integer(kind: Any) -> Any:
    return types.unliteral(kind) if isinstance(kind, types.IntegerLiteral) else kind  # type: ignore[attr-defined]


def njit(function: F) -> F:
    """Compile a scalar kernel. It runs without Python's lock, so that threads can share a batch."""
    made: F = _compiled(function, nogil=True)
    return made


def fused(function: F) -> F:
    """As `njit`; a product and the sum it goes into may be rounded once, together, where the machine can."""
    made: F = _compiled(function, nogil=True, fastmath={"contract"})
    return made


def welded(function: F) -> F:
    """Compile a kernel whose machine code goes into its caller's, where handing over its arguments would cost too much."""
    made: F = _compiled(function, nogil=True, forceinline=True)
    return made


def inlined(function: F) -> F:
    """Compile a kernel as part of its caller: a small one, or one that has a single caller. Each link of a chain of kernels
    would else be optimised again with all that hangs on it."""
    return numba.njit(cache=True, error_model="numpy", inline="always")(function)


Maker = Callable[[type], Callable[..., Any]]


def by_ground(function: Callable[..., Any]) -> Callable[[Maker], Maker]:
    """Compile calls of `function`, plain Python as it stands, as what is decorated makes for the type of its first argument,
    the ground: code for one kind of ground is not compiled for the other."""

    def register(make: Maker) -> Maker:
        def choose(ground: Any, *rest: Any) -> Any:
            return make(ground.instance_class)

        choose.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
        if not numba.config.DISABLE_JIT:
            overload(function, inline="always", strict=False, jit_options={"error_model": "numpy"})(choose)
        return make

    return register


if numba.config.DISABLE_JIT:

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

    bare = intrinsic(_bare)

    def _window(typing_context: Any, array: Any, row: Any, col: Any) -> Any:
        """A `bare` view (2 axes) that is indexed as the part of a larger array that begins at (row, col): its address is
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

        return array(array, numba.types.intp, numba.types.intp), codegen

    window = intrinsic(_window)


#: Fewer items than this are one thread's work: waking others takes longer, on a busy machine by milliseconds.
FEW = 512
#: Pieces of a batch are whole multiples of this: of whatever number of items a kernel takes together.
ROUND = 64


def spread(kernel: Callable[..., None], count: int, *args: Any) -> None:
    """Run a batch kernel on items 0..count, in pieces handed to as many threads as numba may use (NUMBA_NUM_THREADS,
    `threads`).

    The kernel takes `args`, then the first item and the one after the last. Each item is worked out by itself, so the
    result is the same for any number of threads.
    """
    if count <= FEW or numba.get_num_threads() == 1:
        kernel(*args, 0, count)
        return
    workers = int(numba.get_num_threads())
    kernel(*args, 0, 0)  # compiled or loaded before the threads would all wait for it
    piece = min(max(-(-count // (8 * workers * ROUND)) * ROUND, FEW // 2), 1 << 16)
    starts = iter(range(0, count, piece))  # one for all threads: to take the next is one step of the interpreter

    def work() -> None:
        for start in starts:
            kernel(*args, start, min(start + piece, count))

    with ThreadPoolExecutor(workers - 1) as pool:
        others = [pool.submit(work) for _ in range(workers - 1)]
        try:
            work()
        finally:
            for _ in starts:  # none is left, unless this thread was interrupted
                pass
        for other in others:
            other.result()


@contextlib.contextmanager
def threads(count: int | None) -> Iterator[int]:
    """Let batches run on `count` threads inside the block (None: all there are); yields how many that is."""
    before = int(numba.get_num_threads())
    numba.set_num_threads(count or int(numba.config.NUMBA_NUM_THREADS))
    try:
        yield int(numba.get_num_threads())
    finally:
        numba.set_num_threads(before)
