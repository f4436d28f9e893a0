"""The balance equations of one pose: contributions of its contacts and joint limits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.linkage import P_RADIUS, Z, forward_kinematics, set_hub_offsets
from ..model.wheel import WHEEL_SIZE
from .balance import EQUATIONS, contact_columns, force_column, weight_column

Array = NDArray[np.float64]

BELLY = 4  # contacts under the body
EXTRA = 3 + BELLY  # rocker, left and right bogie at a limit, and the belly
ON_BELLY = 3  # owner of a contact under the body


class Mechanism(NamedTuple):
    """Work arrays of one pose; moments are divided by `reach`, the farthest contact's distance."""

    hub_offsets: Array  # (6, 5) as `linkage.set_hub_offsets` fills them
    q: Array  # (6,) pose with the body's origin at height 0
    axes: Array  # (3, 3) the body's directions in the world, one a row
    pivots: Array  # (4, 3) rocker pivots, then bogie pivots, from the body's origin, m
    wheels: Array  # (6, WHEEL_SIZE) wheels with the body's origin at (0, 0, 0)
    columns: Array  # (6, 3, 9) generalized forces of unit normal force, traction and side force
    frame: Array  # (6, 3, 3) directions of the three, one a row
    who: NDArray[np.int64]  # (6,) wheel of each row of `columns` and `frame`
    radius: Array  # (6,) radius of these wheels, m
    forward: Array  # (6,) forward position of these contacts over the reach
    extra: Array  # (EXTRA, 9) generalized forces of unit forces at joint limits and under the body
    owner: NDArray[np.int64]  # (EXTRA,) 0 rocker, 1 and 2 bogies, ON_BELLY
    loose_columns: Array  # (6, 3, 9) and (6, 3, 3) columns and frames in wheel order, 0 without contact
    loose_frame: Array


@owning_njit
def new_mechanism() -> Mechanism:
    """Return empty work arrays."""
    return Mechanism(
        np.empty((6, 5)), np.empty(6), np.empty((3, 3)), np.empty((4, 3)), np.empty((6, WHEEL_SIZE)),
        np.empty((6, 3, EQUATIONS)), np.empty((6, 3, 3)), np.zeros(6, np.int64), np.zeros(6), np.zeros(6),
        np.zeros((EXTRA, EQUATIONS)), np.zeros(EXTRA, np.int64), np.empty((6, 3, EQUATIONS)), np.empty((6, 3, 3)),
    )  # fmt: skip


@owning_njit
def assemble(
    m: Mechanism, rover: Array, yaw: float, steering: Array, q: Array, point: Array, normal: Array,
    stops: NDArray[np.int8], belly_point: Array, belly_normal: Array,
) -> tuple[int, int, float]:  # fmt: skip
    """Fill the balance equations of one pose.

    Args:
        m: work arrays, filled.
        rover: (P_SIZE,) the packed rover.
        yaw: rad.
        steering: (6,) rad.
        q: (6,) pose.
        point, normal: (6, 3) contact points from the body's origin, m, NaN where a wheel is off the ground, and unit normals.
        stops: (3,) -1 or 1 where rocker, left or right bogie is at its low or high limit, else 0.
        belly_point, belly_normal: (BELLY, 3) contacts of the body's box, NaN where there is none.

    Returns:
        Number of wheels in contact (0 if there is no pose), number of rows of `extra` in use, reach in m.
    """
    if math.isnan(q[Z]):
        return 0, 0, 0.0
    m.q[:] = q
    m.q[Z] = 0.0
    set_hub_offsets(rover, steering, m.hub_offsets)
    if not forward_kinematics(rover, m.hub_offsets, 0.0, 0.0, math.cos(yaw), math.sin(yaw), m.q, m.axes, m.pivots, m.wheels):
        return 0, 0, 0.0
    contact_columns(rover, m.q, m.axes, m.pivots, m.wheels, point, normal, m.loose_columns, m.loose_frame)
    count, reach = 0, 0.0
    for i in range(6):
        if math.isnan(point[i, 0]):
            continue
        m.who[count] = i
        m.columns[count] = m.loose_columns[i]
        m.frame[count] = m.loose_frame[i]
        m.radius[count] = rover[P_RADIUS + i]
        reach = max(reach, abs(point[i, 0]), abs(point[i, 1]))
        m.forward[count] = point[i, 0] * m.axes[0, 0] + point[i, 1] * m.axes[0, 1] + point[i, 2] * m.axes[0, 2]
        count += 1
    more = 0
    for j in range(3):
        if stops[j] != 0:
            m.extra[more] = 0.0
            m.extra[more, 6 + j] = -1.0 * stops[j] * reach  # unit force at the reach, back from the limit
            m.owner[more] = j
            more += 1
    for j in range(BELLY):
        if not math.isnan(belly_point[j, 0]):
            m.extra[more] = 0.0
            force_column(
                0.0, False, 0, m.axes, m.pivots, belly_point[j, 0], belly_point[j, 1], belly_point[j, 2],
                belly_normal[j, 0], belly_normal[j, 1], belly_normal[j, 2], m.extra[more],
            )  # fmt: skip
            m.owner[more] = ON_BELLY
            more += 1
    for n in range(3, EQUATIONS):
        for i in range(count):
            for c in range(3):
                m.columns[i, c, n] /= reach
        for j in range(more):
            m.extra[j, n] /= reach
    for i in range(count):
        m.forward[i] /= reach
    return count, more, reach


@njit
def gravity_column(m: Mechanism, rover: Array, reach: float, gx: float, gy: float, gz: float, column: Array) -> float:
    """Fill the generalized force of gravity on all links, moments over the reach.

    Args:
        m: filled by `assemble`.
        rover: (P_SIZE,) the packed rover.
        reach: as `assemble` returns it, m.
        gx, gy, gz: gravity less the rover's acceleration, m/s².
        column: (9,) filled, N.

    Returns:
        The rover's mass, kg.
    """
    mass = weight_column(rover, m.hub_offsets, m.q, m.axes, m.pivots, gx, gy, gz, column)
    for n in range(3, EQUATIONS):
        column[n] /= reach
    return mass
