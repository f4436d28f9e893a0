"""Linkage, contacts and masses of LANES poses at once, as the lanes of statics take them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..jit.vectors import LANES, larger, on_lanes, root, where
from ..model.linkage import (
    BOGIE_L,
    P_BODY,
    P_BOGIE,
    P_BOGIE_PIVOT,
    P_HUB,
    P_OFFSET,
    P_PIVOT,
    P_ROCKER,
    P_WHEEL,
    PITCH,
    ROCKER,
    ROLL,
    Z,
    right_rocker,
)
from ..model.sincos import C1, C2, C3, C4, C5, C6, FAR, PART_1, PART_2, PART_3, S1, S2, S3, S4, S5, S6
from ..model.tolerances import MIN_COS_TILT
from .cone_scaling import Vector, read, write
from .lane_rows import CONTACTS, LINK, POSE, WHEEL

Array = NDArray[np.float64]

WHOLE = 6755399441055744.0  # 1.5 · 2^52: adding and subtracting it rounds to the nearest integer


def sine_cosine(a: Any) -> tuple[Any, Any]:
    """Return sine and cosine, to two units in the last place: `model.sincos` on lanes.

    Args:
        a: rad, at most `FAR` in magnitude.
    """
    turns = (a * (2.0 / math.pi) + WHOLE) - WHOLE
    x = ((a - turns * PART_1) - turns * PART_2) - turns * PART_3
    z = x * x
    s = x + x * z * (S1 + z * (S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))))
    c = 1.0 - 0.5 * z + z * z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))
    quarter = turns - 4.0 * ((turns * 0.25 + WHOLE) - WHOLE)  # -2 to 2
    odd = (quarter * quarter > 0.5) & (quarter * quarter < 2.0)
    sine, cosine = where(odd, c, s), where(odd, s, c)
    sine = where((quarter < -0.5) | (quarter > 1.5), -sine, sine)
    return sine, where((quarter > 0.5) | (quarter < -1.5), -cosine, cosine)


def _vector(numbers: Any, at: int) -> Vector:
    """Return three consecutive numbers as a vector.

    Args:
        numbers: rows or the packed rover.
        at: index of the first.
    """
    return Vector(numbers[at], numbers[at + 1], numbers[at + 2])


def _put(rows: Any, at: int, value: Vector) -> None:
    """Set three consecutive rows.

    Args:
        rows: rows of the lane array; three are written.
        at: the first row.
        value: vector.
    """
    rows[at], rows[at + 1], rows[at + 2] = value.parts


def _place(rows: Any, rover: Any) -> None:
    """Compute link and contact rows of all lanes.

    Args:
        rows: rows of the lane array (`lane_rows`); POSE, WHEEL.normal, WHEEL.on, LINK.contacts are read, LINK and WHEEL filled.
        rover: the packed rover.
    """
    (sy, cy), (sp, cp), (sr, cr) = (sine_cosine(rows[at]) for at in (POSE.yaw, POSE.pitch, POSE.roll))
    ahead = Vector(cy * cp, sy * cp, -sp)
    left = Vector(cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr)
    up = Vector(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr)
    reach = ahead.x * 0.0
    for i in range(6):
        p = read(rows, POSE.point, i)
        reach = larger(reach, larger(larger(p.x, -p.x), larger(p.y, -p.y)))
    reach = where(reach > 0.0, reach, 1.0)
    over = 1.0 / reach
    mass = rover[P_BODY]
    body = _vector(rover, P_BODY + 1)
    moment = (ahead * body.x + left * body.y + up * body.z) * mass  # mass times centre of mass
    rocker_moment, upright = ahead * 0.0, ahead.x * 0.0 + 1.0
    for side in range(2):
        s, c = sine_cosine(rows[POSE.rocker + side])
        rocker_x, rocker_z = ahead * c - up * s, ahead * s + up * c
        at = _vector(rover, P_PIVOT + 3 * side)
        pivot = ahead * at.x + left * at.y + up * at.z
        at = _vector(rover, P_BOGIE_PIVOT + 3 * side)
        arm = rocker_x * at.x + left * at.y + rocker_z * at.z  # bogie pivot from rocker pivot
        s, c = sine_cosine(rows[POSE.rocker + side] + rows[POSE.bogie + side])
        bogie_x, bogie_z = ahead * c - up * s, ahead * s + up * c
        at, m = _vector(rover, P_ROCKER + 4 * side + 1), rover[P_ROCKER + 4 * side]
        on_rocker, rocker_mass = (rocker_x * at.x + left * at.y + rocker_z * at.z) * m, m
        at, m = _vector(rover, P_BOGIE + 4 * side + 1), rover[P_BOGIE + 4 * side]
        on_bogie, bogie_mass = (bogie_x * at.x + left * at.y + bogie_z * at.z) * m, m
        for group in range(3):
            i = 2 * group + side
            x, z, base = (rocker_x, rocker_z, pivot) if group == 0 else (bogie_x, bogie_z, pivot + arm)
            c, s, hub = rows[POSE.steer + i], rows[POSE.steer + 6 + i], read(rows, POSE.hub, i)
            at, m = _vector(rover, P_WHEEL + 4 * i + 1), rover[P_WHEEL + 4 * i]
            a, b, d = hub.x + c * at.x - s * at.y, hub.y + s * at.x + c * at.y, hub.z + at.z
            centre = (x * a + left * b + z * d) * m
            if group == 0:
                on_rocker, rocker_mass = on_rocker + centre, rocker_mass + m
            else:
                on_bogie, bogie_mass = on_bogie + centre, bogie_mass + m
            on, p, n = rows[WHEEL.on + i], read(rows, POSE.point, i), read(rows, WHEEL.normal, i)
            axle = left * c - x * s
            upright = where(1.0 - axle.z * axle.z > MIN_COS_TILT * MIN_COS_TILT, upright, 0.0)
            heading = axle.cross(n)
            heading = heading * (1.0 / root(heading.dot(heading)))
            turn = (p - (base + x * hub.x + left * hub.y + z * hub.z)).cross(axle) * over
            swing = left.cross(p - pivot) * (over * on)
            write(rows, WHEEL.rocker, i, swing if side == 0 else swing * rows[POSE.rate])
            write(rows, WHEEL.bogie, i, left.cross(p - base) * (over * on) if group > 0 else ahead * 0.0)
            write(rows, WHEEL.point, i, p * over)
            write(rows, WHEEL.heading, i, heading)
            write(rows, WHEEL.turn, i, turn)
        _put(rows, LINK.bogie_left if side == 0 else LINK.bogie_right, left.cross(on_bogie))
        whole = on_rocker + on_bogie + arm * bogie_mass
        rocker_moment = rocker_moment + (whole if side == 0 else whole * rows[POSE.rate])
        moment = moment + whole + pivot * (rocker_mass + bogie_mass)
        mass = mass + rocker_mass + bogie_mass
    scale = over / mass
    for row in (LINK.bogie_left, LINK.bogie_right):
        _put(rows, row, _vector(rows, row) * scale)
    _put(rows, LINK.rocker, left.cross(rocker_moment) * scale)
    _put(rows, LINK.centre, moment * scale)
    _put(rows, LINK.forward, ahead)
    _put(rows, LINK.left, left)
    rows[LINK.rate] = rows[POSE.rate]
    rows[LINK.reach] = reach
    rows[LINK.contacts] = rows[LINK.contacts] * upright


place = on_lanes(_place, numbers=True)


@inlined
def rover_mass(rover: Array) -> float:
    """Return the mass of all links, kg.

    Args:
        rover: (P_SIZE,) the packed rover.
    """
    mass = rover[P_BODY]
    for side in range(2):
        mass += rover[P_ROCKER + 4 * side] + rover[P_BOGIE + 4 * side]
    for i in range(6):
        mass += rover[P_WHEEL + 4 * i]
    return mass


@njit
def load_poses(
    lanes: Array, rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, stops: NDArray[np.int8],
    first: int, count: int, fresh: bool,
) -> None:  # fmt: skip
    """Fill link and contact rows with consecutive poses; spare lanes repeat the last one.

    Args:
        lanes: the lane array; written.
        rover: (P_SIZE,) the packed rover.
        yaw: (n,) rad.
        steering: (n, 6) or (1, 6) rad.
        q: (n, 6) poses.
        point, normal: (n, 6, 3) contact points from the body's origin, m, NaN where a wheel is off the ground, and unit normals.
        stops: (n, 3) -1 or 1 where rocker, left or right bogie is at its low or high limit, else 0.
        first, count: first pose, and number of poses.
        fresh: True for a new lane array: steering that all poses share is set only then.
    """
    for l in range(LANES):
        k = first + min(l, count - 1)
        here, contacts = not math.isnan(q[k, Z]), 0.0
        lanes[POSE.yaw * LANES + l] = yaw[k] if abs(yaw[k]) < FAR else math.atan2(math.sin(yaw[k]), math.cos(yaw[k]))
        lanes[POSE.roll * LANES + l], lanes[POSE.pitch * LANES + l] = (q[k, ROLL], q[k, PITCH]) if here else (0.0, 0.0)
        left = q[k, ROCKER] if here else 0.0
        right, rate = right_rocker(rover, left)
        lanes[POSE.rocker * LANES + l], lanes[(POSE.rocker + 1) * LANES + l], lanes[POSE.rate * LANES + l] = left, right, rate
        for side in range(2):
            lanes[(POSE.bogie + side) * LANES + l] = q[k, BOGIE_L + side] if here else 0.0
        if fresh or steering.shape[0] > 1:
            _steer(lanes, l, rover, steering[k if steering.shape[0] > 1 else 0])
        for i in range(6):
            on = here and not math.isnan(point[k, i, 0])
            contacts += 1.0 if on else 0.0
            lanes[(WHEEL.on + i) * LANES + l] = 1.0 if on else 0.0
            for c in range(3):
                lanes[(POSE.point + CONTACTS * c + i) * LANES + l] = point[k, i, c] if on else 0.0
                lanes[(WHEEL.normal + CONTACTS * c + i) * LANES + l] = normal[k, i, c] if on else (1.0 if c == 2 else 0.0)
        for j in range(3):
            lanes[(LINK.stop + j) * LANES + l] = 1.0 if stops[k, j] != 0 else 0.0
            lanes[(LINK.way + j) * LANES + l] = -1.0 * stops[k, j]
        lanes[LINK.contacts * LANES + l] = contacts
    place(lanes, rover)


@inlined
def _steer(lanes: Array, l: int, rover: Array, steering: Array) -> None:
    """Set the steering of a lane: `linkage.set_hub_offsets`.

    Args:
        lanes: the lane array; written.
        l: lane.
        rover: (P_SIZE,) the packed rover.
        steering: (6,) rad.
    """
    for i in range(6):
        c, s = math.cos(steering[i]), math.sin(steering[i])
        ox, oy = rover[P_OFFSET + 2 * i], rover[P_OFFSET + 2 * i + 1]
        lanes[(POSE.hub + i) * LANES + l] = rover[P_HUB + 3 * i] + ox - (c * ox - s * oy)
        lanes[(POSE.hub + CONTACTS + i) * LANES + l] = rover[P_HUB + 3 * i + 1] + oy - (s * ox + c * oy)
        lanes[(POSE.hub + 2 * CONTACTS + i) * LANES + l] = rover[P_HUB + 3 * i + 2]
        lanes[(POSE.steer + i) * LANES + l], lanes[(POSE.steer + 6 + i) * LANES + l] = c, s
