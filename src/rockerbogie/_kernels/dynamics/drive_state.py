"""Work arrays of a predicted drive: its station and an earlier one, wheels off the ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.wheel import CONTACT_SIZE
from ..search.workspace import Work
from .balance_residual import Motion
from .linear import copy_numbers

Array = NDArray[np.float64]


class Drive(NamedTuple):
    """Settings of one drive."""

    friction: float  # coefficient; on soil, of the start of a solve
    soil: bool  # True if wheel forces are tabulated
    tables: Array  # (m, size) packed tables
    table_of: NDArray[np.int64]  # (6,) table of each wheel
    gravity: float  # m/s²
    torque: Array  # (6,) torque limits, N m
    reference: float  # m/s, fastest commanded rim speed


class State(NamedTuple):
    """Work arrays of one drive at one station."""

    station: Array  # (STATION,) the next ten
    place: Array  # (3,) x, y, m from the map's first node, and yaw, rad
    q: Array  # (6,) pose
    rates: Array  # (6,) of the pose
    w: Array  # (3,) rates of x, y and yaw
    power: Array  # (2,) of the motors and dissipated, W
    height: Array  # (1,) of the centre of mass, m
    raised: Array  # (6,) gaps, m
    rising: Array  # (6,) their rates, m/s
    free: Array  # (6,) 1 for a wheel off the ground at the start of the step, else 0
    several: Array  # (1,) 1 if further contacts are in the balance, else 0
    rim: Array  # (6,) commanded rim speeds, m/s
    limit: Array  # (6,) torque limits over the weight, m
    slope: Array  # (6,) scratch
    total: Array  # (TOTAL,) sums of the stages: w, power and rising
    kept: Array  # (KEPT,) an earlier station, with the unknowns of its balance and its contacts
    kept_place: Array  # (3,) in `kept`, like the next three
    kept_height: Array  # (1,)
    kept_raised: Array  # (6,)
    kept_free: Array  # (6,)


STATION, UNKNOWNS, TOTAL = 40, 9, 11
KEPT = STATION + UNKNOWNS + 6 * CONTACT_SIZE
STATE_SIZE = STATION + 18 + TOTAL + KEPT
LIFTED = 1e-9  # m: a wheel with a larger gap is off the ground


@owning_njit
def new_state(buffer: Array) -> State:
    """Return work arrays as unowned views into a buffer.

    Args:
        buffer: (STATE_SIZE,) memory; the caller must keep it alive.
    """
    b = unowned_view(buffer)
    kept, rest = b[STATION + 18 + TOTAL :], b[STATION:]
    return State(
        b[:STATION], b[:3], b[3:9], b[9:15], b[15:18], b[18:20], b[20:21], b[21:27], b[27:33], b[33:39], b[39:40],
        rest[:6], rest[6:12], rest[12:18], rest[18 : 18 + TOTAL], kept, kept[:3], kept[20:21], kept[21:27], kept[33:39],
    )  # fmt: skip


@njit
def keep(state: State, work: Work, m: Motion) -> None:
    """Copy a station to `state.kept`.

    Args:
        state, work, m: of the station.
    """
    kept = state.kept
    copy_numbers(state.station, kept[:STATION])
    copy_numbers(m.z, kept[STATION : STATION + UNKNOWNS])
    contacts = kept[STATION + UNKNOWNS :]
    for i in range(6):
        copy_numbers(work.touch[i], contacts[CONTACT_SIZE * i : CONTACT_SIZE * (i + 1)])


@njit
def restore(state: State, work: Work, m: Motion) -> None:
    """Return to the station in `state.kept`.

    Args:
        state, work, m: filled.
    """
    kept = state.kept
    copy_numbers(kept[:STATION], state.station)
    copy_numbers(kept[STATION : STATION + UNKNOWNS], m.z)
    contacts = kept[STATION + UNKNOWNS :]
    for i in range(6):
        copy_numbers(contacts[CONTACT_SIZE * i : CONTACT_SIZE * (i + 1)], work.touch[i])


@njit
def set_on_ground(state: State) -> None:
    """Set all gaps to 0.

    Args:
        state: raised and free are changed.
    """
    for i in range(6):
        state.raised[i] = state.free[i] = 0.0


@njit
def set_raised(state: State, i: int, gap: float) -> None:
    """Set a wheel's gap at the end of a step.

    Args:
        state: raised and free are changed.
        i: wheel.
        gap: m; below LIFTED, the wheel is on the ground.
    """
    state.free[i] = 1.0 if gap > LIFTED else 0.0
    state.raised[i] = gap * state.free[i]


@njit
def any_free(free: Array) -> bool:
    """Return True if a wheel is off the ground.

    Args:
        free: (6,) 1 for such wheels, else 0.
    """
    found = False
    for i in range(6):
        found |= free[i] != 0.0
    return found
