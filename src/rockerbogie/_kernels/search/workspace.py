"""The scratch memory of one thread, laid out once for a whole batch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..jit.raw_views import bare
from ..model.wheel import PLACE_SIZE, WHEEL_SIZE
from .tread import ROOM

Array = NDArray[np.float64]


class Work(NamedTuple):
    """What the kernels write in while they settle a pose."""

    feet: Array  # (6, 5) what steering decides: linkage.stand_feet
    axes: Array  # (3, 3) the body's directions
    knees: Array  # (4, 3) pivots
    wheels: Array  # (6, WHEEL_SIZE)
    touch: Array  # (6, PLACE_SIZE) where each wheel is nearest the ground
    rows: Array  # (6, 6) how the gaps change
    step: Array  # (6,)
    best: Array  # (PLACE_SIZE,)
    found: Array  # (ROOM, PLACE_SIZE) touching places
    none: Array  # (0, PLACE_SIZE) room for none, where only the lowest is sought


WORK_SIZE = 30 + 9 + 12 + 6 * WHEEL_SIZE + 6 * PLACE_SIZE + 36 + 6 + PLACE_SIZE * (1 + ROOM)


@njit
def lay_out(buffer: Array) -> Work:
    """Views into a buffer (WORK_SIZE,) that the caller must keep alive."""
    b = bare(buffer)
    n = 0
    feet = b[n : n + 30].reshape(6, 5)
    n += 30
    axes = b[n : n + 9].reshape(3, 3)
    n += 9
    knees = b[n : n + 12].reshape(4, 3)
    n += 12
    wheels = b[n : n + 6 * WHEEL_SIZE].reshape(6, WHEEL_SIZE)
    n += 6 * WHEEL_SIZE
    touch = b[n : n + 6 * PLACE_SIZE].reshape(6, PLACE_SIZE)
    n += 6 * PLACE_SIZE
    rows = b[n : n + 36].reshape(6, 6)
    n += 36
    step = b[n : n + 6]
    n += 6
    best = b[n : n + PLACE_SIZE]
    n += PLACE_SIZE
    found = b[n : n + ROOM * PLACE_SIZE].reshape(ROOM, PLACE_SIZE)
    none = found[:0]
    return Work(feet, axes, knees, wheels, touch, rows, step, best, found, none)
