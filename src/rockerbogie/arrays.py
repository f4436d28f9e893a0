"""Batch axes of any shape, as the flat runs that kernels take."""

from __future__ import annotations

from collections.abc import Iterator
from types import EllipsisType

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def spanned(array: Array, shape: tuple[int, ...]) -> Array:
    """The array broadcast to a shape, taking no memory of its own; itself where it has that shape."""
    return array if array.shape == shape else np.broadcast_to(array, shape)


def once(array: Array) -> Array:
    """What a broadcast array holds, each item once: the axes along which it only repeats have length 1 (or 0)."""
    return array[tuple(slice(0, 1) if step == 0 else slice(None) for step in array.strides)]


def pieces(shape: tuple[int, ...], most: int) -> Iterator[tuple[int | slice | EllipsisType, ...]]:
    """Indices of runs of at most `most` items that together are the whole shape, in memory's order.

    Each is a slice of one axis at fixed places of those before it, so that numpy copies a run of a broadcast array
    quickly, and takes one of a whole array without copying.
    """
    axis, tail = len(shape), 1
    while axis > 0 and tail * shape[axis - 1] <= most:
        axis -= 1
        tail *= shape[axis]
    if axis == 0:
        yield (...,)
        return
    step = most // tail
    for head in np.ndindex(shape[: axis - 1]):
        for start in range(0, shape[axis - 1], step):
            yield (*head, slice(start, start + step))


def flat(array: Array, *tail: int) -> Array:
    """(n, *tail) contiguous and writable, for kernels are compiled for that kind of array alone; a copy of any other."""
    return (array if array.flags.carray else np.array(array, order="C")).reshape(-1, *tail)


def flat_steering(steering: Array) -> Array:
    """(n, 6) as `flat`, or (1, 6) where one steering serves all."""
    return flat(steering if any(steering.strides[:-1]) else steering[(slice(0, 1),) * (steering.ndim - 1)], 6)
