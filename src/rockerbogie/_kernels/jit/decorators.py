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
from numba.core import event, types
from numba.extending import overload


def _drop_stale_cache() -> None:
    """Delete compiled kernels older than any kernel's source: numba itself looks only at the one file a function is in,
    and would go on using a callee's old code."""
    here = Path(__file__).parents[1]
    newest = max(file.stat().st_mtime for file in here.rglob("*.py"))
    for file in here.rglob("__pycache__/*.nb?"):
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
            print("rockerbogie: compiling kernels for this machine, some 15 to 20 s, once", file=sys.stderr, flush=True)
        self.said = True

    def on_end(self, _: event.Event) -> None:
        self.depth -= 1
        if self.depth == 0 and self.collects:
            gc.enable()


event.register("numba:compile", _Herald())

F = TypeVar("F", bound=Callable[..., Any])


def _compiled(function: F, **how: Any) -> Any:
    """One compiled kernel, whatever is written out where it is called: numba would compile it again for f(0), f(1), f(True)."""
    made = numba.njit(cache=True, error_model="numpy", **how)(function)
    if not numba.config.DISABLE_JIT:
        chosen = made.get_call_template
        made.get_call_template = lambda args, kws: chosen(tuple(_any_value(a) for a in args), kws)
    return made


def _any_value(kind: Any) -> Any:
    written_out = isinstance(kind, types.Literal) and isinstance(kind.literal_value, int)  # True and False are, too
    return types.unliteral(kind) if written_out else kind  # type: ignore[attr-defined]


def njit(function: F) -> F:
    """Compile a scalar kernel. It runs without Python's lock, so that threads can share a batch."""
    made: F = _compiled(function, nogil=True)
    return made


def fma_njit(function: F) -> F:
    """As `njit`; a product and the sum it goes into may be rounded once, together, where the machine can."""
    made: F = _compiled(function, nogil=True, fastmath={"contract"})
    return made


def force_inlined(function: F) -> F:
    """Compile a kernel whose machine code goes into its caller's, where handing over its arguments would cost too much."""
    made: F = _compiled(function, nogil=True, forceinline=True)
    return made


def inlined(function: F) -> F:
    """Compile a kernel as part of its caller: a small one, or one that has a single caller. Each link of a chain of kernels
    would else be optimised again with all that hangs on it."""
    return numba.njit(cache=True, error_model="numpy", inline="always")(function)


Maker = Callable[[type], Callable[..., Any]]


def specialize_on_ground(function: Callable[..., Any]) -> Callable[[Maker], Maker]:
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


#: Fewer items than this are one thread's work: waking others takes longer, on a busy machine by milliseconds.
MIN_PARALLEL = 512
#: Pieces of a batch are whole multiples of this: of whatever number of items a kernel takes together.
CHUNK_MULTIPLE = 64


def parallel_for(kernel: Callable[..., None], count: int, *args: Any) -> None:
    """Run a batch kernel on items 0..count, in pieces handed to as many threads as numba may use (NUMBA_NUM_THREADS,
    `threads`).

    The kernel takes `args`, then the first item and the one after the last. Each item is worked out by itself, so the
    result is the same for any number of threads.
    """
    if count <= MIN_PARALLEL or numba.get_num_threads() == 1:
        kernel(*args, 0, count)
        return
    workers = int(numba.get_num_threads())
    kernel(*args, 0, 0)  # compiled or loaded before the threads would all wait for it
    piece = min(max(-(-count // (8 * workers * CHUNK_MULTIPLE)) * CHUNK_MULTIPLE, MIN_PARALLEL // 2), 1 << 16)
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
