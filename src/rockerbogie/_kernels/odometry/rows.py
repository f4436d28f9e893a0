"""Rows of sensor readings of the odometry filter: checks, and the interval between two rows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .layout import (
    R_GYRO,
    R_ROCKER,
    R_ROCKER_RATE,
    R_STEERING,
    R_STEERING_RATE,
    R_TILT,
    R_TILT_RATE,
    R_WHEEL,
    S_ATTITUDE,
    S_GYRO,
    S_ROCKER,
    S_STEERING,
    S_TURN,
    S_WHEEL,
)
from .track import rotation_of, turn_between

Array = NDArray[np.float64]

#: Angle, rad, or rate, rad/s, from which a reading is an error of the sensor.
TOO_LARGE = 1e9


@njit
def clean_row(row: Array, steers: NDArray[np.bool_]) -> bool:
    """Replace readings that are too large by NaN; set steering of fixed wheels and summed turn.

    Args:
        row: (S_SIZE,), changed.
        steers: (6,) True for wheels that steer.

    Returns:
        True if all wheels have readings.
    """
    for n in range(S_TURN):
        if abs(row[n]) >= TOO_LARGE:
            row[n] = math.nan
    turns, steered = True, False
    for i in range(6):
        turns &= not math.isnan(row[S_WHEEL + i])
        steered |= not math.isnan(row[S_STEERING + i])
    for i in range(6):
        if not steers[i]:
            row[S_STEERING + i] = 0.0 if steered else math.nan
    row[S_TURN : S_TURN + 3] = 0.0
    return turns


@owning_njit
def set_turn(a: Array, b: Array, turn: Array) -> None:
    """Compute the rotation vector between the attitudes of two rows.

    Args:
        a, b: (S_SIZE,).
        turn: (3,) filled, rad, in the body frame; 0 if a row has no attitude.
    """
    turn[:] = 0.0
    for n in range(S_ATTITUDE, S_ATTITUDE + 3):
        if not (math.isfinite(a[n]) and math.isfinite(b[n])):
            return
    R, S = np.empty((3, 3)), np.empty((3, 3))
    rotation_of(a[S_ATTITUDE], a[S_ATTITUDE + 1], a[S_ATTITUDE + 2], R)
    rotation_of(b[S_ATTITUDE], b[S_ATTITUDE + 1], b[S_ATTITUDE + 2], S)
    turn_between(R, S, turn)


@owning_njit
def follow_row(last: Array, row: Array, summed: bool) -> None:
    """Continue heading and summed turn of a row from the one before: no wraps of the heading.

    Args:
        last: (S_SIZE,) the row before.
        row: (S_SIZE,), changed.
        summed: True to sum turns.
    """
    yaw, before = row[S_ATTITUDE + 2], last[S_ATTITUDE + 2]
    if math.isfinite(yaw) and math.isfinite(before):
        row[S_ATTITUDE + 2] = yaw + 2 * math.pi * np.rint((before - yaw) / (2 * math.pi))
    row[S_TURN : S_TURN + 3] = last[S_TURN : S_TURN + 3]
    if summed:
        turn = np.empty(3)
        set_turn(last, row, turn)
        row[S_TURN : S_TURN + 3] += turn


@njit
def interval_reading(a: Array, b: Array, A: Array, B: Array, dt: float, by_rate: bool, smoothed: bool, reading: Array) -> None:
    """Compute the readings of the interval between two rows.

    Args:
        a, b: (S_SIZE,) the rows.
        A, B: (S_SIZE,) these rows smoothed.
        dt: time between them, s.
        by_rate: True if the rows hold wheel rates, False if they hold wheel angles.
        smoothed: True if A and B differ from a and b.
        reading: (R_SIZE,) filled.
    """
    reading[:] = math.nan
    for i in range(6):
        turned = 0.5 * (b[S_WHEEL + i] + a[S_WHEEL + i]) if by_rate else (B[S_WHEEL + i] - A[S_WHEEL + i]) / dt
        steering = 0.5 * (b[S_STEERING + i] + a[S_STEERING + i])
        steered = (B[S_STEERING + i] - A[S_STEERING + i]) / dt
        reading[R_WHEEL + i] = turned
        reading[R_STEERING + i] = 0.0 if math.isnan(steering) else steering
        reading[R_STEERING_RATE + i] = 0.0 if math.isnan(steered) else steered
    for j in range(3):  # rocker and bogies
        joint = 0.5 * (b[S_ROCKER + j] + a[S_ROCKER + j])
        reading[R_ROCKER + j] = 0.0 if math.isnan(joint) else joint
        reading[R_ROCKER_RATE + j] = (B[S_ROCKER + j] - A[S_ROCKER + j]) / dt
    roll = 0.5 * (b[S_ATTITUDE] + a[S_ATTITUDE])
    pitch = 0.5 * (b[S_ATTITUDE + 1] + a[S_ATTITUDE + 1])
    tilted, headed = math.isfinite(roll) and math.isfinite(pitch), math.isfinite(b[S_ATTITUDE + 2] + a[S_ATTITUDE + 2])
    turning = False
    for j in range(3):
        turning |= math.isfinite(0.5 * (b[S_GYRO + j] + a[S_GYRO + j]))
    if tilted and headed:
        if smoothed:
            for j in range(3):
                reading[R_GYRO + j] = (B[S_TURN + j] - A[S_TURN + j]) / dt
        else:
            set_turn(a, b, reading[R_GYRO : R_GYRO + 3])
            for j in range(3):
                reading[R_GYRO + j] /= dt
    elif turning:
        for j in range(3):
            reading[R_GYRO + j] = 0.5 * (b[S_GYRO + j] + a[S_GYRO + j])
    elif headed and not tilted:  # a compass: only the angular velocity about z
        reading[R_GYRO + 2] = (B[S_ATTITUDE + 2] - A[S_ATTITUDE + 2]) / dt
    if tilted:
        reading[R_TILT], reading[R_TILT + 1] = roll, pitch
        if not headed:
            for j in range(2):
                reading[R_TILT_RATE + j] = (B[S_ATTITUDE + j] - A[S_ATTITUDE + j]) / dt
