"""Poses in the lanes of the primal-dual method: their contacts, weight and start."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..jit.vectors import LANES
from ..model.linkage import ROCKER, Z, forward_kinematics, right_rocker, set_hub_offsets
from ..model.wheel import WHEEL_SIZE
from .balance import EQUATIONS as BALANCE_EQUATIONS
from .balance import weight_column
from .lane_rows import BALANCE, BOUND, EQUATIONS, PROBLEM, RESULT, ROWS, STATE, WHEEL

Array = NDArray[np.float64]

CENTRE = 0.1  # power of each cone at the central point from which the methods start
NORMAL_FORCE = 0.3  # of the weight, at the start
BALANCED = 1e-9  # of the weight: residual of a central point
NEAR = 0.5  # of CENTRE: largest difference of a cone's power from it
CENTRE_STEPS = 12


class Block(NamedTuple):
    """Work arrays of a block of poses."""

    lanes: Array  # (ROWS LANES,) the lane array
    hub_offsets: Array  # (6, 5) as `linkage.set_hub_offsets` fills them
    q: Array  # (6,) pose with the body's origin at height 0
    axes: Array  # (LANES, 3, 3) the body's directions in the world, one a row
    pivots: Array  # (4, 3) rocker pivots, then bogie pivots, from the body's origin, m
    wheels: Array  # (LANES, 6, WHEEL_SIZE) wheels with the body's origin at (0, 0, 0)
    column: Array  # (9,) generalized force
    reach: Array  # (LANES,) the farthest contact's distance, m
    mass: Array  # (LANES,) kg
    contacts: NDArray[np.int64]  # (LANES,) number of wheels in contact
    pose: NDArray[np.int64]  # (LANES,) index of the pose, -1: the lane is idle
    steps: NDArray[np.int64]  # (LANES,) steps taken for this pose
    first: NDArray[np.int64]  # (LANES,) steps taken before the present start
    on_path: NDArray[np.bool_]  # (LANES,) the central point is found


@njit
def new_block() -> Block:
    """Return empty work arrays."""
    lanes = np.zeros(ROWS * LANES)
    return Block(
        lanes, np.empty((6, 5)), np.empty(6), np.empty((LANES, 3, 3)), np.empty((4, 3)), np.empty((LANES, 6, WHEEL_SIZE)),
        np.empty(BALANCE_EQUATIONS), np.empty(LANES), np.empty(LANES), np.zeros(LANES, np.int64), np.full(LANES, -1),
        np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES, np.bool_),
    )  # fmt: skip


@njit
def load_contacts(
    t: Block, l: int, rover: Array, yaw: float, steering: Array, q: Array, point: Array, normal: Array, stops: NDArray[np.int8]
) -> bool:
    """Fill contacts, limits and mass of a lane.

    Args:
        t: work arrays.
        l: lane.
        rover: (P_SIZE,) the packed rover.
        yaw: rad.
        steering: (6,) rad.
        q: (6,) pose.
        point, normal: (6, 3) contact points from the body's origin, m, NaN where a wheel is off the ground, and unit normals.
        stops: (3,) -1 or 1 where rocker, left or right bogie is at its low or high limit, else 0.

    Returns:
        False if there is no pose or no contact.
    """
    if math.isnan(q[Z]):
        return False
    t.q[:] = q
    t.q[Z] = 0.0
    set_hub_offsets(rover, steering, t.hub_offsets)
    axes, wheels, lanes = t.axes[l], t.wheels[l], t.lanes
    if not forward_kinematics(rover, t.hub_offsets, 0.0, 0.0, math.cos(yaw), math.sin(yaw), t.q, axes, t.pivots, wheels):
        return False
    _, slope = right_rocker(rover, t.q[ROCKER])
    reach, contacts = 0.0, 0
    for i in range(6):
        if not math.isnan(point[i, 0]):
            reach = max(reach, max(abs(point[i, 0]), abs(point[i, 1])))
            contacts += 1
    if contacts == 0:
        return False
    t.reach[l], t.contacts[l], over = reach, contacts, 1.0 / reach
    ax, ay, az = axes[1, 0], axes[1, 1], axes[1, 2]
    for i in range(6):
        on = not math.isnan(point[i, 0])
        for r in range(12):
            lanes[(WHEEL.normal + 6 * r + i) * LANES + l] = 0.0
        lanes[(WHEEL.on + i) * LANES + l] = 1.0 if on else 0.0
        lanes[(WHEEL.normal + 12 + i) * LANES + l] = 1.0
        if not on:
            continue
        for c in range(3):
            lanes[(WHEEL.normal + 6 * c + i) * LANES + l] = normal[i, c]
            lanes[(WHEEL.point + 6 * c + i) * LANES + l] = over * point[i, c]
        for level in range(2 if i > 1 else 1):
            start, base = (WHEEL.rocker, i % 2) if level == 0 else (WHEEL.bogie, 2 + i % 2)
            rate = over * slope if level == 0 and i % 2 == 1 else over
            x, y, z = point[i, 0] - t.pivots[base, 0], point[i, 1] - t.pivots[base, 1], point[i, 2] - t.pivots[base, 2]
            lanes[(start + i) * LANES + l] = rate * (ay * z - az * y)
            lanes[(start + 6 + i) * LANES + l] = rate * (az * x - ax * z)
            lanes[(start + 12 + i) * LANES + l] = rate * (ax * y - ay * x)
    limits = 0
    for j in range(3):
        lanes[(PROBLEM.limit + j) * LANES + l] = 1.0 if stops[j] != 0 else 0.0
        lanes[(PROBLEM.sign + j) * LANES + l] = -1.0 * stops[j]
        limits += 1 if stops[j] != 0 else 0
    lanes[(PROBLEM.limit + 3) * LANES + l] = lanes[(PROBLEM.sign + 3) * LANES + l] = 1.0
    lanes[PROBLEM.cones * LANES + l] = 1.0 + contacts + limits
    return True


@njit
def set_weight(t: Block, l: int, rover: Array, gx: float, gy: float, gz: float) -> None:
    """Fill `column` with the generalized force of gravity on the links, and set the mass.

    Args:
        t: work arrays, as `load_contacts` leaves them.
        l: lane.
        rover: (P_SIZE,) the packed rover.
        gx, gy, gz: gravity less the rover's acceleration, m/s².
    """
    t.mass[l] = weight_column(rover, t.hub_offsets, t.q, t.axes[l], t.pivots, gx, gy, gz, t.column)
    for n in range(3, BALANCE_EQUATIONS):
        t.column[n] /= t.reach[l]


@njit
def set_problem(t: Block, l: int, bound: float, size: float) -> None:
    """Set the generalized force to balance to `column` times a number.

    Args:
        t: work arrays.
        l: lane.
        bound: bound of the sum of the normal forces, of the weight.
        size: the number.
    """
    for n in range(BALANCE_EQUATIONS):
        t.lanes[(PROBLEM.b + BALANCE[n]) * LANES + l] = size * t.column[n]
    t.lanes[(PROBLEM.b + BOUND) * LANES + l] = bound


@njit
def start(t: Block, l: int, mu: float, bound: float) -> None:
    """Start the way to the central point: normal forces alone, and velocities along the normals.

    Args:
        t: work arrays.
        l: lane.
        mu: friction coefficient.
        bound: bound of the sum of the normal forces, of the weight.
    """
    lanes = t.lanes
    for r in range(18):
        normal = lanes[(WHEEL.normal + r) * LANES + l]
        lanes[(STATE.force + r) * LANES + l], lanes[(STATE.speed + r) * LANES + l] = NORMAL_FORCE * normal, normal
    for k in range(EQUATIONS):
        lanes[(STATE.v + k) * LANES + l] = 0.0
    for j in range(3):
        lanes[(STATE.y + j) * LANES + l], lanes[(STATE.w + j) * LANES + l] = NORMAL_FORCE, 1.0
    slack = max(bound - 1.0, 1.0)
    lanes[(STATE.y + 3) * LANES + l], lanes[(STATE.w + 3) * LANES + l] = slack, NORMAL_FORCE / slack
    lanes[STATE.theta * LANES + l], lanes[STATE.mu * LANES + l] = 0.0, mu
    lanes[STATE.price * LANES + l] = NORMAL_FORCE / mu
    lanes[PROBLEM.free * LANES + l], lanes[PROBLEM.target * LANES + l] = 0.0, CENTRE
    t.first[l], t.on_path[l] = t.steps[l], False


@njit
def vector(lanes: Array, start: int, i: int, l: int) -> tuple[float, float, float]:
    """Return the vector of a wheel.

    Args:
        lanes: the lane array.
        start: first row of the vectors.
        i: wheel.
        l: lane.
    """
    return lanes[(start + i) * LANES + l], lanes[(start + 6 + i) * LANES + l], lanes[(start + 12 + i) * LANES + l]


@njit
def power(lanes: Array, i: int, l: int) -> tuple[float, float]:
    """Return the power of a contact force, and that of its normal part.

    Args:
        lanes: the lane array.
        i: wheel.
        l: lane.
    """
    total = force = speed = 0.0
    for c in range(3):
        f, u = lanes[(STATE.force + 6 * c + i) * LANES + l], lanes[(STATE.speed + 6 * c + i) * LANES + l]
        n = lanes[(WHEEL.normal + 6 * c + i) * LANES + l]
        total += f * u
        force += n * f
        speed += n * u
    return total, force * speed


@njit
def is_central(t: Block, l: int) -> bool:
    """Return True if forces balance and each cone's power is about CENTRE.

    Args:
        t: work arrays.
        l: lane.
    """
    lanes, furthest = t.lanes, 0.0
    for i in range(6):
        if lanes[(WHEEL.on + i) * LANES + l] > 0.0:
            furthest = max(furthest, abs(power(lanes, i, l)[0] - CENTRE))
    left = lanes[RESULT.short * LANES + l] * (1.0 - lanes[RESULT.alpha * LANES + l])
    return left < BALANCED and furthest < NEAR * CENTRE


@njit
def touches_belly(belly_point: Array) -> bool:
    """Return True if the body's box has a contact.

    Args:
        belly_point: (BELLY, 3) contacts, NaN where there is none.
    """
    touches = False
    for j in range(belly_point.shape[0]):
        touches |= not math.isnan(belly_point[j, 0])
    return touches
