"""Arguments that the kernels of equilibrium mode hand on to each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import Ground
from ..search.workspace import Work

Array = NDArray[np.float64]


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


@njit
def new_contacts(size: int) -> Contacts:
    """Return memory for contacts.

    Args:
        size: largest number of contacts.
    """
    return Contacts(np.empty(size), np.empty((size, 6)), np.empty(size, np.int64))


@njit
def new_program(size: int) -> Program:
    """Return memory for a quadratic program.

    Args:
        size: largest number of constraints.
    """
    return Program(np.empty((size, 6)), np.empty(size), np.empty((6, 6)), np.empty(6), np.zeros(size))
