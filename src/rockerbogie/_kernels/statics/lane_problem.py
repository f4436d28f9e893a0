"""Poses in the lanes of the primal-dual method: their contacts, weight and start."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..jit.raw_views import unowned_view
from ..jit.vectors import LANES
from .lane_pose import load_poses, rover_mass
from .lane_rows import (
    BOGIE_LEFT,
    BOGIE_RIGHT,
    BOUND,
    CONTACTS,
    EQUATIONS,
    LINK,
    LOADED,
    OX,
    OY,
    OZ,
    POSE_ROWS,
    PROBLEM,
    RESULT,
    ROCKER_RATE,
    ROWS,
    STATE,
    VECTORS,
    VX,
    VY,
    VZ,
    WHEEL,
    WHEELS,
)

Array = NDArray[np.float64]

CENTRE = 0.1  # power of each cone at the central point from which the methods start
NORMAL_FORCE = 0.3  # of the weight, at the start
BALANCED = 1e-9  # of the weight: residual of a central point
NEAR = 0.5  # of CENTRE: largest difference of a cone's power from it
CENTRE_STEPS = 12


class Block(NamedTuple):
    """Work arrays of a block of poses."""

    lanes: Array  # (ROWS LANES,) the lane array
    loaded: Array  # (POSE_ROWS LANES,) lane array of the poses that are loaded, but not yet in a lane
    queue: NDArray[np.int64]  # (5,) FIRST, COUNT and NEXT of `loaded`, AFTER, the pose to load then, and CAPACITY
    mass: float  # of the rover, kg
    contacts: NDArray[np.int64]  # (LANES,) number of contacts
    line: Array  # (LANES, 3, WHEELS, 3) half of each contact line over the reach; its velocities at unit rocker and bogie rate
    pose: NDArray[np.int64]  # (LANES,) index of the pose, -1: the lane is idle
    steps: NDArray[np.int64]  # (LANES,) steps taken for this pose
    first: NDArray[np.int64]  # (LANES,) steps taken before the present start
    on_path: NDArray[np.bool_]  # (LANES,) the central point is found


FIRST, COUNT, NEXT, AFTER, CAPACITY = range(5)
ANY, POINTS, LINES = range(3)  # poses to take: all, those whose contacts are points, those with a line


@owning_njit
def new_block(rover: Array, first: int, room: int) -> Block:
    """Return work arrays.

    Args:
        rover: (P_SIZE,) the packed rover.
        first: the first pose to load.
        room: number of contacts of a pose, WHEELS or CONTACTS. With CONTACTS, both ends of a line are contacts.
    """
    queue = np.zeros(5, np.int64)
    queue[AFTER], queue[CAPACITY] = first, room
    return Block(
        np.zeros(ROWS * LANES), np.zeros(POSE_ROWS * LANES), queue, rover_mass(rover), np.zeros(LANES, np.int64),
        np.zeros((LANES, 3, WHEELS, 3)), np.full(LANES, -1), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64),
        np.zeros(LANES, np.bool_),
    )  # fmt: skip


@owning_njit
def block_view(t: Block) -> Block:
    """Return unowned views of work arrays: passing them on counts no references.

    Args:
        t: work arrays, which must outlive the views.
    """
    return Block(
        unowned_view(t.lanes), unowned_view(t.loaded), unowned_view(t.queue), t.mass, unowned_view(t.contacts),
        unowned_view(t.line), unowned_view(t.pose), unowned_view(t.steps), unowned_view(t.first), unowned_view(t.on_path),
    )  # fmt: skip


@njit
def take_pose(
    t: Block, l: int, rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, span: Array,
    stops: NDArray[np.int8], belly_point: Array, kind: int, first: int, last: int,
) -> int:  # fmt: skip
    """Take the next pose with a contact, and none under its body, into a lane.

    Args:
        t: work arrays.
        l: lane.
        rover, yaw, steering, q, point, normal, span, stops, belly_point: as for `loads.loads_batch`.
        kind: ANY, POINTS or LINES: poses to take.
        first, last: range of poses.

    Returns:
        Its index; -1 if there is none.
    """
    lanes, loaded, queue = t.lanes, t.loaded, t.queue
    while True:
        if queue[NEXT] == queue[COUNT]:
            if queue[AFTER] >= last:
                return -1
            queue[FIRST], queue[COUNT], queue[NEXT] = queue[AFTER], min(LANES, last - queue[AFTER]), 0
            queue[AFTER] += queue[COUNT]
            fresh = queue[FIRST] == first
            load_poses(loaded, rover, yaw, steering, q, point, normal, stops, queue[FIRST], queue[COUNT], fresh)
        m, k = queue[NEXT], queue[FIRST] + queue[NEXT]
        queue[NEXT] += 1
        if kind != ANY and has_lines(span, k) != (kind == LINES):
            continue
        if loaded[LINK.contacts * LANES + m] > 0.0 and not touches_belly(belly_point[k if belly_point.shape[0] > 1 else 0]):
            break
    for r in range(LOADED):
        lanes[r * LANES + l] = loaded[r * LANES + m]
    _set_lines(t, l, span[k if span.shape[0] > 1 else 0])
    cones = 1.0 + lanes[LINK.contacts * LANES + l]
    for j in range(3):
        lanes[(PROBLEM.limit + j) * LANES + l] = lanes[(LINK.stop + j) * LANES + l]
        lanes[(PROBLEM.sign + j) * LANES + l] = lanes[(LINK.way + j) * LANES + l]
        cones += lanes[(LINK.stop + j) * LANES + l]
    lanes[(PROBLEM.limit + 3) * LANES + l] = lanes[(PROBLEM.sign + 3) * LANES + l] = 1.0
    lanes[PROBLEM.cones * LANES + l] = cones
    t.contacts[l], t.pose[l], t.steps[l] = int(lanes[LINK.contacts * LANES + l]), k, 0
    return k


@njit
def has_lines(span: Array, k: int) -> bool:
    """Return True if a wheel of a pose touches along its whole width.

    Args:
        span: as for `loads.loads_batch`.
        k: index of the pose.
    """
    row, found = k if span.shape[0] > 1 else 0, False
    for i in range(WHEELS):
        found |= span[row, i, 0] != 0.0 or span[row, i, 1] != 0.0
    return found


@njit
def _set_lines(t: Block, l: int, span: Array) -> None:
    """Set a lane's contact lines; with room for them, replace their middles by both ends.

    Args:
        t: work arrays, changed.
        l: lane.
        span: (WHEELS, 3) half of each line, m; 0: the contact is a point.
    """
    lanes, line = t.lanes, t.line[l]
    over = 1.0 / lanes[LINK.reach * LANES + l]
    lx, ly, lz = lanes[LINK.left * LANES + l], lanes[(LINK.left + 1) * LANES + l], lanes[(LINK.left + 2) * LANES + l]
    for i in range(WHEELS):
        on = lanes[(WHEEL.on + i) * LANES + l]
        x, y, z = on * span[i, 0] * over, on * span[i, 1] * over, on * span[i, 2] * over
        rocker, bogie = 1.0 if i % 2 == 0 else lanes[LINK.rate * LANES + l], 1.0 if i > 1 else 0.0
        line[0, i, 0], line[0, i, 1], line[0, i, 2] = x, y, z
        x, y, z = ly * z - lz * y, lz * x - lx * z, lx * y - ly * x
        for c, part in enumerate((x, y, z)):
            line[1, i, c], line[2, i, c] = rocker * part, bogie * part
        long = line[0, i, 0] != 0.0 or line[0, i, 1] != 0.0
        if t.queue[CAPACITY] == CONTACTS:
            lanes[(WHEEL.on + WHEELS + i) * LANES + l] = 1.0 if long else 0.0
            lanes[LINK.contacts * LANES + l] += 1.0 if long else 0.0
            for c in range(3):
                first = (CONTACTS * c + i) * LANES + l
                second = first + WHEELS * LANES
                for at in (WHEEL.normal, WHEEL.heading, WHEEL.turn):
                    lanes[at * LANES + second] = lanes[at * LANES + first]
                for j, at in enumerate((WHEEL.point, WHEEL.rocker, WHEEL.bogie)):
                    middle = lanes[at * LANES + first]
                    lanes[at * LANES + first], lanes[at * LANES + second] = middle - line[j, i, c], middle + line[j, i, c]


@njit
def set_force(t: Block, l: int, at: int, gx: float, gy: float, gz: float, bound: float) -> None:
    """Set a generalized force to that of gravity on all links, of the weight.

    Args:
        t: work arrays.
        l: lane.
        at: PROBLEM.b or PROBLEM.e.
        gx, gy, gz: gravity, as a direction.
        bound: bound of the sum of the normal forces.
    """
    lanes = t.lanes
    x, y, z = lanes[LINK.centre * LANES + l], lanes[(LINK.centre + 1) * LANES + l], lanes[(LINK.centre + 2) * LANES + l]
    lanes[(at + BOGIE_LEFT) * LANES + l] = _power(lanes, l, LINK.bogie_left, gx, gy, gz)
    lanes[(at + BOGIE_RIGHT) * LANES + l] = _power(lanes, l, LINK.bogie_right, gx, gy, gz)
    lanes[(at + ROCKER_RATE) * LANES + l] = _power(lanes, l, LINK.rocker, gx, gy, gz)
    lanes[(at + VX) * LANES + l], lanes[(at + VY) * LANES + l], lanes[(at + VZ) * LANES + l] = gx, gy, gz
    lanes[(at + OX) * LANES + l], lanes[(at + OY) * LANES + l] = y * gz - z * gy, z * gx - x * gz
    lanes[(at + OZ) * LANES + l], lanes[(at + BOUND) * LANES + l] = x * gy - y * gx, bound


@inlined
def _power(lanes: Array, l: int, at: int, gx: float, gy: float, gz: float) -> float:
    """Return the power of gravity on all links, of the weight, at unit rate of a joint.

    Args:
        lanes: the lane array.
        l: lane.
        at: LINK.rocker, LINK.bogie_left or LINK.bogie_right.
        gx, gy, gz: gravity, as a direction.
    """
    return lanes[at * LANES + l] * gx + lanes[(at + 1) * LANES + l] * gy + lanes[(at + 2) * LANES + l] * gz


@njit
def start(t: Block, l: int, mu: float, bound: float) -> None:
    """Start the way to the central point: normal forces alone, and velocities along the normals.

    With BOUND, these velocities are those of a motion.

    Args:
        t: work arrays.
        l: lane.
        mu: friction coefficient.
        bound: bound of the sum of the normal forces, of the weight.
    """
    lanes = t.lanes
    for r in range(VECTORS):
        normal = lanes[(WHEEL.normal + r) * LANES + l]
        lanes[(STATE.force + r) * LANES + l], lanes[(STATE.speed + r) * LANES + l] = NORMAL_FORCE * normal, normal
    for k in range(EQUATIONS):
        lanes[(STATE.v + k) * LANES + l] = 1.0 if k == BOUND else 0.0
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
    """Return the vector of a contact.

    Args:
        lanes: the lane array.
        start: first row of the vectors.
        i: contact.
        l: lane.
    """
    at = (start + i) * LANES + l
    return lanes[at], lanes[at + CONTACTS * LANES], lanes[at + 2 * CONTACTS * LANES]


@njit
def power(lanes: Array, i: int, l: int) -> tuple[float, float]:
    """Return the power of a contact force, and that of its normal part.

    Args:
        lanes: the lane array.
        i: contact.
        l: lane.
    """
    total = force = speed = 0.0
    for c in range(3):
        at = (CONTACTS * c + i) * LANES + l
        f, u = lanes[STATE.force * LANES + at], lanes[STATE.speed * LANES + at]
        n = lanes[WHEEL.normal * LANES + at]
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
    for i in range(t.queue[CAPACITY]):
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
