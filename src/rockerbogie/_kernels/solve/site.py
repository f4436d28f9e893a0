"""Arguments that the kernels of equilibrium mode hand on to each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from ..jit.raw_views import unowned_view
from ..model.ground import Ground
from ..search.box_points import NEAR_ROOM
from ..search.tread import ROOM
from ..search.workspace import Work

Array = NDArray[np.float64]

LISTED = 6 * (ROOM + 1) + NEAR_ROOM  # contacts of a pose, at most


class Site(NamedTuple):
    """A rover at a fixed x, y and yaw over a terrain, and the memory to work with."""

    ground: Ground
    rover: Array  # (P_SIZE,) packed rover
    x: float  # m: the body's origin from the map's first node
    y: float
    cy: float  # cos and sin of yaw
    sy: float
    work: Work  # scratch; work.hub_offsets holds the steering


class Contacts(NamedTuple):
    """A list of contacts and near contacts."""

    gap: Array  # (n,) m
    rows: Array  # (n, 6) change of each gap per unit of each unknown
    owner: NDArray[np.int64]  # (n,) wheel, or 6 for the body


class Program(NamedTuple):
    """Memory of a quadratic program in the six unknowns."""

    n: Array  # (k, 6) constraints n·d ≥ b
    b: Array  # (k,)
    inverse: Array  # (6, 6) inverse of the Hessian
    d: Array  # (6,) solution: a step
    force: Array  # (k,) multipliers of the constraints


class Memory(NamedTuple):
    """Memory of the search for an equilibrium."""

    contacts: Contacts  # room for ROWS
    cuts: Contacts  # room for CUTS
    program: Program  # room for CONSTRAINTS


CUTS = 24  # contacts met by steps that were not taken, at most
ROWS = LISTED + CUTS
CONSTRAINTS = ROWS + 6 + 12  # contacts, joint limits, trust region
MEMORY_SIZE = 7 * (ROWS + CUTS) + 8 * CONSTRAINTS + 36 + 6
OWNERS = ROWS + CUTS


@owning_njit
def lay_out_memory(buffer: Array, owners: NDArray[np.int64]) -> Memory:
    """Return views into two buffers.

    Args:
        buffer: (MEMORY_SIZE,) memory; the caller must keep it alive.
        owners: (OWNERS,) memory, the same.
    """
    b, o, n = unowned_view(buffer), unowned_view(owners), 0
    contacts = Contacts(b[:ROWS], b[ROWS : 7 * ROWS].reshape(ROWS, 6), o[:ROWS])
    n = 7 * ROWS
    cuts = Contacts(b[n : n + CUTS], b[n + CUTS : n + 7 * CUTS].reshape(CUTS, 6), o[ROWS:])
    n += 7 * CUTS
    normals = b[n : n + 6 * CONSTRAINTS].reshape(CONSTRAINTS, 6)
    n += 6 * CONSTRAINTS
    bounds, force = b[n : n + CONSTRAINTS], b[n + CONSTRAINTS : n + 2 * CONSTRAINTS]
    n += 2 * CONSTRAINTS
    return Memory(contacts, cuts, Program(normals, bounds, b[n : n + 36].reshape(6, 6), b[n + 36 : n + 42], force))
