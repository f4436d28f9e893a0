"""Records of a predicted drive's stations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import META_X, META_Y, META_Z
from ..model.linkage import P_RADIUS, Z
from .balance_residual import Motion
from .contact_law import FORCE, RIM, SINKAGE, TORQUE
from .drive_state import State
from .linear import copy_numbers
from .station import FREE, Station

Array = NDArray[np.float64]

# Columns of a record
R_X, R_Y, R_YAW = 0, 1, 2
R_Q = 3  # (6,)
R_RATE = 9  # (3,) of x, y and yaw, then (6,) of q
R_WHEEL = 18  # (6,) rad/s, and so on for blocks of six
R_COMMAND = 24
R_LOAD = 30  # N
R_TRACTION = 36
R_SIDE = 42
R_TORQUE = 48  # N m
R_ROLL_SLIP = 54  # m/s
R_SIDE_SLIP = 60
R_TURN = 66  # rad/s of the link about the axle
R_SINKAGE = 72  # m
R_WORK, R_LOSS, R_HEIGHT = 78, 79, 80  # J done by the motors, J dissipated, m of the centre of mass
R_STEPS = 81  # Newton steps of the balance
R_SCALE = 82  # slip scale of the friction law over the reference speed
R_SIZE = 83


@njit
def contact_motion(s: Station, m: Motion, i: int) -> tuple[float, float, float]:
    """Return a contact's velocity forward and to the left, m/s, and its link's rate.

    The rate is that about the axle, rad/s.

    Args:
        s, m: pose and motion.
        i: wheel.
    """
    ut = us = turn = 0.0
    for k in range(9):
        ut += s.ways[i, 0, k] * m.y[k]
        us += s.ways[i, 1, k] * m.y[k]
        turn += s.ways[i, 2, k] * m.y[k]
    return ut, us, turn


@njit
def record(rover: Array, steps: int, s: Station, m: Motion, state: State, meta: Array, out: Array) -> None:
    """Fill a record of a station; energies are filled by the caller.

    Args:
        rover: (P_SIZE,) packed rover.
        steps: Newton steps of the balance.
        s, m, state: of the station.
        meta: map header.
        out: (R_SIZE,) filled.
    """
    out[R_X], out[R_Y], out[R_YAW] = state.place[0] + meta[META_X], state.place[1] + meta[META_Y], state.place[2]
    copy_numbers(state.q, out[R_Q : R_Q + 6])
    out[R_Q + Z] += meta[META_Z]
    for k in range(FREE):
        out[R_RATE + k] = m.y[k]
    copy_numbers(state.rates, out[R_RATE + FREE : R_RATE + 9])
    weight = -s.weight[2]
    out[R_HEIGHT] = state.height[0] + meta[META_Z]
    for i in range(6):
        f, radius = m.force[i], rover[P_RADIUS + i]
        ut, us, turn = contact_motion(s, m, i)
        out[R_WHEEL + i], out[R_COMMAND + i] = f[RIM] / radius, state.rim[i] / radius
        out[R_LOAD + i], out[R_TRACTION + i], out[R_SIDE + i] = weight * m.load[i], weight * f[FORCE], weight * f[FORCE + 1]
        out[R_TORQUE + i], out[R_SINKAGE + i] = weight * f[TORQUE], f[SINKAGE]
        out[R_ROLL_SLIP + i], out[R_SIDE_SLIP + i], out[R_TURN + i] = ut - f[RIM], us, turn
    out[R_STEPS], out[R_SCALE] = steps, m.scale[0]
