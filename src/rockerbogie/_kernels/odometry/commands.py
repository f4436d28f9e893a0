"""Commands for a wanted motion: the steering at which wheels roll, and their rates."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.linkage import P_RADIUS
from .layout import C_MOTION, C_RATE, C_SIDE_SLIP, C_TURN, C_TURN_SLIP, R_STEERING, R_STEERING_RATE
from .least_squares import least_squares
from .motion import ACROSS, ALONG, ASIDE, FORWARD, OFF, TURN, UNKNOWNS, UP, set_contact_rows, set_wheels

Array = NDArray[np.float64]

#: Most iterations of the steering, each of which reduces the error to about a tenth; change that ends them, rad; least speed
#: with a direction, m/s.
ITERATIONS, SETTLED, STANDING = 24, 1e-13, 1e-12


@njit
def set_rows(
    rover: Array,
    steers: NDArray[np.bool_],
    reading: Array,
    planes: Array,
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
        planes: (6, 4) of the terrain, as `set_contact_rows` takes them.
        frame, joint: scratch, as of `set_wheels`.
        contact: (6,) filled with contact angles, rad.
        rows: (6, 4, 10) filled, as of `set_contact_rows`.
    """
    set_wheels(rover, steers, reading, frame, joint)
    for i in range(6):
        ahead = up = 0.0
        for n in range(3):
            ahead += planes[i, n] * frame[i, FORWARD + n]
            up += planes[i, n] * frame[i, UP + n]
        contact[i] = math.atan2(ahead, up)
    set_contact_rows(rover, frame, joint, planes, contact, rows)


@owning_njit
def set_planes(rover: Array, steers: NDArray[np.bool_], reading: Array, steering: Array, contact: Array, planes: Array) -> None:
    """Compute the planes that upright wheels stand on at given steering and contact angles.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        reading: (R_SIZE,) rocker and bogie angles.
        steering, contact: (6,) angles, rad.
        planes: (6, 4) filled, as `set_contact_rows` takes them.
    """
    frame, joint, stood = np.empty((6, 12)), np.empty((6, 4, 6)), reading.copy()
    stood[R_STEERING : R_STEERING + 6] = steering
    set_wheels(rover, steers, stood, frame, joint)
    for i in range(6):
        c, s = math.cos(contact[i]), math.sin(contact[i])
        planes[i, ASIDE] = 0.0
        for n in range(3):
            planes[i, n] = s * frame[i, FORWARD + n] + c * frame[i, UP + n]


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


@owning_njit
def commands(
    rover: Array, steers: NDArray[np.bool_], reading: Array, planes: Array, wanted: Array, limits: Array, fixed: bool, out: Array
) -> None:
    """Compute steering and wheel rates for a wanted motion (`motion.wheel_commands`).

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        reading: (R_SIZE,) rocker and bogie angles, steering angles to start from, rad; steering rates that wheels roll with,
            rad/s.
        planes: (6, 4) of the terrain, as `set_contact_rows` takes them.
        wanted: (3,) vx, vy, m/s, and ωz, rad/s.
        limits: (2, 6) steering angles beyond which a wheel is turned by half a turn, and largest steering angles, rad.
        fixed: True to keep the present steering.
        out: (C_SIZE,) filled.
    """
    frame, joint, rows = np.empty((6, 12)), np.empty((6, 4, 6)), np.empty((6, 4, 10))
    A, x, square, inverse, contact = np.empty((6, 7)), np.empty(6), np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
    now = reading.copy()
    turn, motion = out[C_TURN : C_TURN + 6], out[C_MOTION : C_MOTION + UNKNOWNS]
    for i in range(6):
        turn[i] = reading[R_STEERING + i]
    for attempt in range(0 if fixed else 2):
        for _ in range(ITERATIONS):
            now[R_STEERING : R_STEERING + 6] = turn
            set_rows(rover, steers, now, planes, frame, joint, contact, rows)
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
            if attempt == 0 and abs(turn[i]) > limits[0, i] and abs(other) <= limits[0, i]:
                turn[i] = other
                flipped = True
        if not flipped:
            break
    for i in range(6):
        now[R_STEERING + i] = min(limits[1, i], max(-limits[1, i], turn[i]))
    set_rows(rover, steers, now, planes, frame, joint, contact, rows)
    on_terrain(rows, wanted, motion, A, x, square, inverse)
    for i in range(6):
        along = rows[i, ALONG, TURN] * reading[R_STEERING_RATE + i]
        across = rows[i, ACROSS, TURN] * reading[R_STEERING_RATE + i]
        for n in range(UNKNOWNS):
            along += rows[i, ALONG, n] * motion[n]
            across += rows[i, ACROSS, n] * motion[n]
        c, s, about = math.cos(contact[i]), math.sin(contact[i]), 0.0
        for n in range(3):
            spin = motion[3 + n]
            for j in range(3):
                spin -= joint[i, j, 3 + n] * motion[6 + j]
            about += (s * frame[i, FORWARD + n] + c * frame[i, UP + n]) * spin
        out[C_RATE + i], out[C_SIDE_SLIP + i], out[C_TURN_SLIP + i] = along / rover[P_RADIUS + i], across, about


@owning_njit
def commands_batch(
    rover: Array, steers: NDArray[np.bool_], reading: Array, steering: Array, contact: Array, planes: Array, wanted: Array,
    limits: Array, fixed: bool, out: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Compute `commands` for each pose.

    Args:
        rover, steers, limits, fixed: as `commands` takes them.
        reading: (n, R_SIZE).
        steering, contact: (n, 6) angles at which upright wheels stand on the terrain, rad; used if there are no planes.
        planes: (n, 6, 4) of the terrain, or (0, 6, 4).
        wanted: (n, 3).
        out: (n, C_SIZE) filled.
        start, stop: range of poses.
    """
    upright = np.empty((6, 4))
    for k in range(start, stop):
        if planes.shape[0] == 0:
            set_planes(rover, steers, reading[k], steering[k], contact[k], upright)
        commands(rover, steers, reading[k], upright if planes.shape[0] == 0 else planes[k], wanted[k], limits, fixed, out[k])
