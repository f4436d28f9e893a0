"""Batch shapes, broadcast to the arrays that kernels take, and checks of numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REAL = (int, float, np.number)
NOT_REAL = (bool, np.complexfloating)  # subclasses of those


def is_number(value: object) -> bool:
    """Return True for one finite real number; False for an array, text, a bool or None.

    Args:
        value: any object.

    Returns:
        True or False.
    """
    if not isinstance(value, REAL) or isinstance(value, NOT_REAL):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an int beyond the largest float
        return False


def floats(value: object) -> Array:
    """Return numbers as an array of floats.

    NumPy alone takes text such as "3" and bools for numbers, and the hidden values of a masked array.

    Args:
        value: a number, or numbers in any form that NumPy takes as an array.

    Returns:
        (...) float64, NaN where it is masked; not a copy of an array of floats.

    Raises:
        TypeError: text, bools, dates or complex numbers.
        ValueError, OverflowError: rows of different length; a number beyond the largest float.
    """
    if type(value) is np.ndarray and value.dtype == float:
        return value
    array = np.asarray(value)
    kind = array.dtype.kind
    if kind not in "fiuO" or (kind == "O" and any(isinstance(item, str | bytes | bool) for item in array.flat)):
        if array.ndim == 0 or array.size == 0:
            raise TypeError(f"{value!r:.60} is not a number")
        first = next(item for item in array.flat if kind != "O" or isinstance(item, str | bytes | bool))
        raise TypeError(f"{first!s:.40} ({type(first).__name__}) is not a number")
    numbers = np.asarray(array, dtype=float)
    return np.where(np.ma.getmaskarray(value), np.nan, numbers) if np.ma.isMaskedArray(value) else numbers


def spanned(array: Array, shape: tuple[int, ...]) -> Array:
    """Return the array broadcast to a shape, without copying.

    Args:
        array: any array that broadcasts to `shape`.
        shape: the shape to return.

    Returns:
        Read-only view of that shape, or the array itself.
    """
    return array if array.shape == shape else np.broadcast_to(array, shape)


def once(array: Array) -> Array:
    """Return the distinct items of a broadcast array.

    Args:
        array: (...) any array.

    Returns:
        View in which each axis with stride 0 has length 1 (or 0).
    """
    return array[tuple(slice(0, 1) if step == 0 else slice(None) for step in array.strides)]


def pieces(shape: tuple[int, ...], most: int) -> Iterator[tuple[int | slice | EllipsisType, ...]]:
    """Yield indices of parts of at most `most` items that cover the shape once.

    Parts are in memory order. Each index is a slice of one axis with fixed indices on the axes before it. numpy then copies a
    part of a broadcast array quickly and takes a part of a contiguous array without copying.

    Args:
        shape: batch shape.
        most: largest number of items of a part, at least 1.

    Yields:
        Indices into arrays of that shape.
    """
    axis, tail = len(shape), 1
    while axis > 0 and tail * shape[axis - 1] <= most:
        axis -= 1
        tail *= shape[axis]
    if axis == 0:
        yield (...,)
        return
    step = most // tail
    for lead in np.ndindex(shape[: axis - 1]):
        for start in range(0, shape[axis - 1], step):
            yield (*lead, slice(start, start + step))


def flat(array: Array, *tail: int) -> Array:
    """Return the array as (n, *tail), contiguous and writable, as kernels require.

    Args:
        array: (..., *tail).
        tail: lengths of the last axes that are kept.

    Returns:
        (n, *tail) view, or a copy if the array is not contiguous or not writable.
    """
    return (array if array.flags.carray else np.array(array, order="C")).reshape(-1, *tail)


def flat_steering(steering: Array) -> Array:
    """Return steering angles as (n, 6), or (1, 6) if all poses share them.

    Args:
        steering: (..., 6) rad; shared if it was broadcast along every batch axis.

    Returns:
        (n, 6) or (1, 6), rad, as `flat`.
    """
    return flat(steering if any(steering.strides[:-1]) else steering[(slice(0, 1),) * (steering.ndim - 1)], 6)


def frozen(value: Any) -> Any:
    """Return a read-only copy of an array.

    An array that is read-only and owns its data is returned as it is.

    Args:
        value: an array, or anything else, which is returned as it is.

    Returns:
        The copy.
    """
    if not isinstance(value, np.ndarray) or (not value.flags.writeable and value.base is None):
        return value
    copy = value.copy()
    copy.flags.writeable = False
    return copy
