"""Commands for a wanted motion: the steering at which wheels roll, and their rates."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.linkage import P_RADIUS
from .layout import R_SIZE, R_STEERING, R_STEERING_RATE
from .least_squares import least_squares
from .motion import ACROSS, ALONG, FORWARD, OFF, TURN, UNKNOWNS, UP, set_contact_rows, set_wheels

Array = NDArray[np.float64]

#: Iterations of the steering, each of which reduces the error to a tenth or less; change that ends them, rad; least speed with a
#: direction, m/s.
ITERATIONS, SETTLED, STANDING = 12, 1e-13, 1e-12


@njit
def set_rows(
    rover: Array,
    steers: NDArray[np.bool_],
    reading: Array,
    normals: Array,
    frame: Array,
    joint: Array,
    contact: Array,
    rows: Array,
) -> None:
    """Compute contact rows of wheels that stand on given planes.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        reading: (R_SIZE,) rocker, bogie and steering angles.
        normals: (6, 3) of the planes in the body.
        frame, joint: scratch, as of `set_wheels`.
        contact: (6,) filled with contact angles, rad.
        rows: (6, 4, 10) filled, as of `set_contact_rows`.
    """
    set_wheels(rover, steers, reading, frame, joint)
    for i in range(6):
        ahead = up = 0.0
        for n in range(3):
            ahead += normals[i, n] * frame[i, FORWARD + n]
            up += normals[i, n] * frame[i, UP + n]
        contact[i] = math.atan2(ahead, up)
    set_contact_rows(rover, frame, joint, normals, contact, rows)


@njit
def on_terrain(rows: Array, wanted: Array, motion: Array, A: Array, x: Array, square: Array, inverse: Array) -> None:
    """Compute the motion with the wanted vx, vy and ωz in which no wheel leaves its plane.

    Args:
        rows: (6, 4, 10) contact rows.
        wanted: (3,) vx, vy, m/s, and ωz, rad/s.
        motion: (9,) filled with twist and rates of rocker and bogies; NaN if there is none.
        A, x, square, inverse: (6, 7), (6,), (6, 6) and (6, 6) scratch.
    """
    for i in range(6):
        lift = rows[i, OFF]
        A[i, 0], A[i, 1], A[i, 2], A[i, 3], A[i, 4], A[i, 5] = lift[2], lift[3], lift[4], lift[6], lift[7], lift[8]
        A[i, 6] = -(lift[0] * wanted[0] + lift[1] * wanted[1] + lift[5] * wanted[2])
    least_squares(A, 6, x, square, inverse)
    motion[0], motion[1], motion[5] = wanted[0], wanted[1], wanted[2]
    motion[2], motion[3], motion[4], motion[6], motion[7], motion[8] = x[0], x[1], x[2], x[3], x[4], x[5]


@njit
def commands(
    rover: Array, steers: NDArray[np.bool_], reading: Array, contact: Array, wanted: Array, limit: Array,
    fixed: bool, turn: Array, motion: Array, rates: Array, slip: Array,
) -> None:  # fmt: skip
    """Compute steering and wheel rates for a wanted motion (`motion.wheel_commands`).

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        reading: (R_SIZE,) present rocker, bogie and steering angles, rad, and steering rates, rad/s, which wheels roll with.
        contact: (6,) present contact angles, rad, which give the planes that the wheels stand on.
        wanted: (3,) vx, vy, m/s, and ωz, rad/s.
        limit: (6,) largest steering angles, rad.
        fixed: True to keep the present steering.
        turn: (6,) filled with the steering at which no wheel slips sideways, rad; not limited.
        motion: (9,) filled with twist and rates of rocker and bogies at the limited steering.
        rates: (6,) filled with wheel rates at the limited steering, rad/s.
        slip: (6,) filled with slip across the wheels at the limited steering, m/s.
    """
    frame, joint, rows, normals = np.empty((6, 12)), np.empty((6, 4, 6)), np.empty((6, 4, 10)), np.empty((6, 3))
    A, x, square, inverse, touch = np.empty((6, 7)), np.empty(6), np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
    now = np.empty(R_SIZE)
    now[:] = reading
    set_wheels(rover, steers, reading, frame, joint)
    for i in range(6):
        c, s = math.cos(contact[i]), math.sin(contact[i])
        turn[i] = reading[R_STEERING + i]
        for n in range(3):
            normals[i, n] = s * frame[i, FORWARD + n] + c * frame[i, UP + n]
    for attempt in range(0 if fixed else 2):
        for _ in range(ITERATIONS):
            now[R_STEERING : R_STEERING + 6] = turn
            set_rows(rover, steers, now, normals, frame, joint, touch, rows)
            on_terrain(rows, wanted, motion, A, x, square, inverse)
            largest = 0.0
            for i in range(6):
                along = across = 0.0
                for n in range(UNKNOWNS):
                    along += rows[i, ALONG, n] * motion[n]
                    across += rows[i, ACROSS, n] * motion[n]
                if not steers[i] or not math.hypot(along, across) >= STANDING:
                    continue
                ahead = -1.0 if along < 0.0 else 1.0
                change = math.atan2(ahead * across, ahead * along)
                turn[i] += change
                largest = max(largest, abs(change))
            if largest < SETTLED:
                break
        flipped = False
        for i in range(6):
            other = turn[i] - math.copysign(math.pi, turn[i])
            if attempt == 0 and abs(turn[i]) > limit[i] and abs(other) <= limit[i]:
                turn[i] = other
                flipped = True
        if not flipped:
            break
    for i in range(6):
        now[R_STEERING + i] = min(limit[i], max(-limit[i], turn[i]))
    set_rows(rover, steers, now, normals, frame, joint, touch, rows)
    on_terrain(rows, wanted, motion, A, x, square, inverse)
    for i in range(6):
        along = rows[i, ALONG, TURN] * reading[R_STEERING_RATE + i]
        slip[i] = rows[i, ACROSS, TURN] * reading[R_STEERING_RATE + i]
        for n in range(UNKNOWNS):
            along += rows[i, ALONG, n] * motion[n]
            slip[i] += rows[i, ACROSS, n] * motion[n]
        rates[i] = along / rover[P_RADIUS + i]
