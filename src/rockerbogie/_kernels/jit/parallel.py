"""Parallel loops over a batch, and the number of threads they use."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numba

from .uncompiled import first_calls

#: Batches smaller than this run on the calling thread: starting workers would take longer.
MIN_PARALLEL = 512
#: The sizes of the pieces of a batch are multiples of this, a multiple of the number of SIMD lanes.
CHUNK_MULTIPLE = 64


def parallel_for(
    kernel: Callable[..., None], count: int, *args: Any, piece: int | None = None, plain: Callable[..., None] | None = None
) -> None:
    """Run a batch kernel on items 0 to count − 1, in pieces, on several threads.

    Their number is numba's (see `threads`). Each item is computed by itself, so that the result is the same for any
    number of threads. An exception of the kernel ends the loop and is raised. A few items that do not take long are computed in
    plain Python while the kernel is not compiled (`uncompiled`).

    Args:
        kernel: called as `kernel(*args, start, stop)`; computes items start to stop − 1.
        count: number of items.
        args: arguments of the kernel before the range.
        piece: number of items of a piece, for items that take long. Default: by the size of the batch.
        plain: called in place of the kernel in plain Python; default: the kernel's own code.
    """
    if piece is None and first_calls.run(kernel, args, count, plain):
        return
    if count <= (MIN_PARALLEL if piece is None else piece) or numba.get_num_threads() == 1:
        kernel(*args, 0, count)
        return
    workers = int(numba.get_num_threads())
    kernel(*args, 0, 0)  # compile or load the kernel once, before the workers start
    if piece is None:
        piece = min(max(-(-count // (8 * workers * CHUNK_MULTIPLE)) * CHUNK_MULTIPLE, MIN_PARALLEL // 2), 1 << 16)
    starts = iter(range(0, count, piece))  # shared: taking the next element is one step of the interpreter

    def work() -> None:
        for start in starts:
            kernel(*args, start, min(start + piece, count))

    with ThreadPoolExecutor(workers - 1) as pool:
        others = [pool.submit(work) for _ in range(workers - 1)]
        try:
            work()
        finally:
            for _ in starts:  # if this thread was interrupted, leave no pieces to the workers
                pass
        for other in others:
            other.result()


@contextlib.contextmanager
def threads(count: int | None) -> Iterator[int]:
    """Set the number of threads of parallel loops inside a `with` block.

    Args:
        count: number of threads; None: as many as NUMBA_NUM_THREADS allows.

    Yields:
        The number of threads in use.
    """
    before = int(numba.get_num_threads())
    numba.set_num_threads(count or int(numba.config.NUMBA_NUM_THREADS))
    try:
        yield int(numba.get_num_threads())
    finally:
        numba.set_num_threads(before)
