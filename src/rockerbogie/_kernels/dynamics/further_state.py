"""Work arrays of further contacts of wheels on soil (`further_contacts`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.wheel import CONTACT_SIZE
from ..search.tread import ROOM
from ..statics.balance import EQUATIONS
from .contact_law import ROW

Array = NDArray[np.float64]

MOST = 12  # further contacts in the balance
UNKNOWNS = EQUATIONS + MOST
WAYS = 4  # rows of a contact's motion: normal, forward, to the left, link's rate about the axle


class Further(NamedTuple):
    """Work arrays of further contacts."""

    minima: Array  # (6, ROOM, CONTACT_SIZE) local minima of the gaps
    point: Array  # (6, 3) one of them for each wheel: contact points from the body's origin, m; NaN where there is none
    normal: Array  # (6, 3) their unit normals into the wheel
    columns: Array  # (6, 3, 9) their columns and directions, as those of `Station`
    frame: Array  # (6, 3, 3)
    trial: Array  # (WAYS, 9) ways of one of them
    room: Array  # (6,) least rate by which a contact of the wheel may close faster, m/s
    total: Array  # (6,) load of all contacts of a wheel over the weight; 0 without further ones
    by_total: Array  # (6, 9) change of the generalized forces of a wheel's contacts with its load
    ways: Array  # (MOST, WAYS, 9) of the contacts in the balance, by (w, lift rates)
    gap: Array  # (MOST,) m
    load: Array  # (MOST,) over the weight
    force: Array  # (MOST, ROW)
    z: Array  # (UNKNOWNS,) those of the first contacts, then a of each further one
    residual: Array  # (UNKNOWNS,)
    step: Array  # (UNKNOWNS,)
    jacobian: Array  # (UNKNOWNS * UNKNOWNS,)
    size: NDArray[np.int64]  # (1,) number of contacts in the balance
    wheel: NDArray[np.int64]  # (MOST,) of each
    listed: NDArray[np.int64]  # (6,) minima of each wheel
    slot: NDArray[np.int64]  # (6,) contact of each wheel that is being added; -1 for none
    order: NDArray[np.int64]  # (UNKNOWNS,)


FURTHER_SIZE = (
    6 * ROOM * CONTACT_SIZE + 102 + 18 * EQUATIONS + 54 + WAYS * EQUATIONS + MOST * (WAYS * EQUATIONS + 2 + ROW)
    + 3 * UNKNOWNS + UNKNOWNS * UNKNOWNS
)  # fmt: skip
FURTHER_INTEGERS = 13 + MOST + UNKNOWNS


@owning_njit
def new_further(buffer: Array, integers: NDArray[np.int64]) -> Further:
    """Return work arrays as unowned views into a buffer.

    Args:
        buffer: (FURTHER_SIZE,) memory; the caller must keep it alive.
        integers: (FURTHER_INTEGERS,) memory, the same.
    """
    b, k, n = unowned_view(buffer), unowned_view(integers), 6 * ROOM * CONTACT_SIZE
    minima = b[:n].reshape(6, ROOM, CONTACT_SIZE)
    point, normal = b[n : n + 18].reshape(6, 3), b[n + 18 : n + 36].reshape(6, 3)
    room, total = b[n + 36 : n + 42], b[n + 42 : n + 48]
    n += 48
    by_total = b[n : n + 54].reshape(6, EQUATIONS)
    n += 54
    columns = b[n : n + 18 * EQUATIONS].reshape(6, 3, EQUATIONS)
    n += 18 * EQUATIONS
    frame = b[n : n + 54].reshape(6, 3, 3)
    n += 54
    trial = b[n : n + WAYS * EQUATIONS].reshape(WAYS, EQUATIONS)
    n += WAYS * EQUATIONS
    ways = b[n : n + MOST * WAYS * EQUATIONS].reshape(MOST, WAYS, EQUATIONS)
    n += MOST * WAYS * EQUATIONS
    gap, load = b[n : n + MOST], b[n + MOST : n + 2 * MOST]
    n += 2 * MOST
    force = b[n : n + MOST * ROW].reshape(MOST, ROW)
    n += MOST * ROW
    z, residual = b[n : n + UNKNOWNS], b[n + UNKNOWNS : n + 2 * UNKNOWNS]
    n += 2 * UNKNOWNS
    step, jacobian = b[n : n + UNKNOWNS], b[n + UNKNOWNS : n + UNKNOWNS + UNKNOWNS * UNKNOWNS]
    return Further(
        minima, point, normal, columns, frame, trial, room, total, by_total, ways, gap, load, force, z, residual, step, jacobian,
        k[:1], k[1 : 1 + MOST], k[1 + MOST : 7 + MOST], k[7 + MOST : 13 + MOST], k[13 + MOST : 13 + MOST + UNKNOWNS],
    )  # fmt: skip


@njit
def rate_of(row: Array, y: Array) -> float:
    """Return a velocity of a contact.

    Args:
        row: (9,) of its ways.
        y: (9,) w and lift rates.
    """
    rate = 0.0
    for k in range(EQUATIONS):
        rate += row[k] * y[k]
    return rate
