"""The scratch memory of one thread, allocated once for a whole batch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from ..jit.raw_views import unowned_view
from ..model.wheel import CONTACT_SIZE, WHEEL_SIZE
from .tread import ROOM

Array = NDArray[np.float64]


class Work(NamedTuple):
    """Scratch arrays of the kernels while they solve one pose."""

    hub_offsets: Array  # (6, 5) what steering decides: linkage.stand_feet
    axes: Array  # (3, 3) the body's directions
    pivots: Array  # (4, 3) pivots
    wheels: Array  # (6, WHEEL_SIZE)
    touch: Array  # (6, CONTACT_SIZE) where each wheel is nearest the ground
    rows: Array  # (6, 6) how the gaps change
    step: Array  # (6,)
    lowest: Array  # (CONTACT_SIZE,)
    contacts: Array  # (ROOM, CONTACT_SIZE) touching places
    none: Array  # (0, CONTACT_SIZE) room for none, where only the lowest is sought


WORK_SIZE = 30 + 9 + 12 + 6 * WHEEL_SIZE + 6 * CONTACT_SIZE + 36 + 6 + CONTACT_SIZE * (1 + ROOM)


@owning_njit
def lay_out(buffer: Array) -> Work:
    """Return views into a buffer.

    Args:
        buffer: (WORK_SIZE,) memory; the caller must keep it alive.
    """
    b = unowned_view(buffer)
    n = 0
    hub_offsets = b[n : n + 30].reshape(6, 5)
    n += 30
    axes = b[n : n + 9].reshape(3, 3)
    n += 9
    pivots = b[n : n + 12].reshape(4, 3)
    n += 12
    wheels = b[n : n + 6 * WHEEL_SIZE].reshape(6, WHEEL_SIZE)
    n += 6 * WHEEL_SIZE
    touch = b[n : n + 6 * CONTACT_SIZE].reshape(6, CONTACT_SIZE)
    n += 6 * CONTACT_SIZE
    rows = b[n : n + 36].reshape(6, 6)
    n += 36
    step = b[n : n + 6]
    n += 6
    lowest = b[n : n + CONTACT_SIZE]
    n += CONTACT_SIZE
    contacts = b[n : n + ROOM * CONTACT_SIZE].reshape(ROOM, CONTACT_SIZE)
    none = contacts[:0]
    return Work(hub_offsets, axes, pivots, wheels, touch, rows, step, lowest, contacts, none)
