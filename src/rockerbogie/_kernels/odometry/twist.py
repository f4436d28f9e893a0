"""Twist of the body from its sensors by least squares (`motion.body_twist`)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.linkage import P_RADIUS
from .commands import set_planes, set_rows
from .layout import (
    E_ACROSS,
    E_ALONG,
    E_GYRO,
    E_JOINT,
    E_OFF,
    E_PRIOR_JOINT,
    E_PRIOR_TILT,
    E_SIZE,
    E_TILT,
    R_BOGIE_RATE,
    R_GYRO,
    R_ROCKER_RATE,
    R_STEERING_RATE,
    R_TILT,
    R_TILT_RATE,
    R_WHEEL,
)
from .least_squares import least_squares
from .motion import ALONG, TURN, UNKNOWNS, set_contact_rows, set_equation, set_wheels

Array = NDArray[np.float64]


@njit
def set_tilt_rows(tilt: Array, rows: Array) -> None:
    """Compute the rates of roll and pitch by angular velocity (eq. 10).

    Args:
        tilt: (2,) roll and pitch, rad; NaN for a pose without attitude.
        rows: (2, UNKNOWNS) filled; ωx and ωy themselves for a pose without attitude.
    """
    rows[:] = 0.0
    rows[0, 3] = rows[1, 4] = 1.0
    if not (math.isnan(tilt[0]) or math.isnan(tilt[1])):
        cr, sr, slope = math.cos(tilt[0]), math.sin(tilt[0]), math.tan(tilt[1])
        rows[0, 4], rows[0, 5], rows[1, 4], rows[1, 5] = sr * slope, cr * slope, cr, -sr


@owning_njit
def twist_batch(
    rover: Array, steers: NDArray[np.bool_], reading: Array, steering: Array, contact: Array, planes: Array, turned: bool,
    attitude: bool, slip: Array, sigma: Array, A: Array, is_open: NDArray[np.bool_], motion: Array, covariance: Array,
    rows: Array, residual: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Solve for the twist of each pose.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        reading: (n, R_SIZE).
        steering, contact: (n, 6) angles at which the wheels stand on the terrain, rad.
        planes: (n, 6, 4) of the terrain, as `set_contact_rows` takes them; (0, 6, 4): upright wheels at these angles.
        turned: True if the steering of `reading` differs from these angles: the contact angles are then computed from the planes.
        attitude: True if the poses have an attitude: their rates then add no equation where roll or pitch is NaN. False: the
            rates are ωx and ωy.
        slip: (n, 6, 3) or (1, 6, 3) expected roll slip, side slip and lift, m/s.
        sigma: (n, E_SIZE) or (1, E_SIZE) standard deviations.
        A: (n, E_SIZE, UNKNOWNS + 1) filled with the whitened equations.
        is_open: (n,) filled with True where they do not determine the motion.
        motion: (n, UNKNOWNS) filled with twist and rates of rocker and bogies, where they are determined.
        covariance: (n, UNKNOWNS, UNKNOWNS) filled, where they are determined.
        rows: (n, 6, 4, 10) filled with the contact rows.
        residual: (n, 6, 3) filled with roll slip, side slip and lift, m/s; of a motion of 0 where it is not determined.
        start, stop: range of poses.
    """
    frame, joint, upright = np.empty((6, 12)), np.empty((6, 4, 6)), np.empty((6, 4))
    tilts, row, inverse = np.empty((2, UNKNOWNS)), np.empty(UNKNOWNS), np.empty((UNKNOWNS, UNKNOWNS))
    system, angles = np.empty((E_SIZE, UNKNOWNS + 1)), np.empty(6)
    for k in range(start, stop):
        y, s, expected, count = reading[k], sigma[k if sigma.shape[0] > 1 else 0], slip[k if slip.shape[0] > 1 else 0], 0
        if planes.shape[0] == 0:
            set_planes(rover, steers, y, steering[k], contact[k], upright)
        plane = upright if planes.shape[0] == 0 else planes[k]
        if turned:
            set_rows(rover, steers, y, plane, frame, joint, angles, rows[k])
        else:
            set_wheels(rover, steers, y, frame, joint)
            set_contact_rows(rover, frame, joint, plane, contact[k], rows[k])
        for j in range(3):
            first = E_ALONG if j == 0 else (E_ACROSS if j == 1 else E_OFF)
            for i in range(6):
                right = rover[P_RADIUS + i] * y[R_WHEEL + i] + expected[i, j] if j == ALONG else expected[i, j]
                right -= rows[k, i, j, TURN] * y[R_STEERING_RATE + i]
                if not math.isnan(rows[k, i, j, :UNKNOWNS].sum()):
                    count = set_equation(system, count, rows[k, i, j], right, s[first + i])
        row[:] = 0.0
        bogies = not (math.isnan(y[R_BOGIE_RATE]) and math.isnan(y[R_BOGIE_RATE + 1]))
        for j in range(3):
            seen = not math.isnan(y[R_ROCKER_RATE]) if j == 0 else bogies
            row[6 + j] = 1.0
            count = set_equation(system, count, row, y[R_ROCKER_RATE + j], s[E_JOINT + j])
            if not seen and s[E_PRIOR_JOINT + j] < math.inf:
                count = set_equation(system, count, row, 0.0, s[E_PRIOR_JOINT + j])
            row[6 + j] = 0.0
        for j in range(3):
            row[3 + j] = 1.0
            count = set_equation(system, count, row, y[R_GYRO + j], s[E_GYRO + j])
            row[3 + j] = 0.0
        turning = not (math.isnan(y[R_GYRO]) and math.isnan(y[R_GYRO + 1]))
        tilting = not (math.isnan(y[R_TILT_RATE]) and math.isnan(y[R_TILT_RATE + 1]))
        if not (attitude and (math.isnan(y[R_TILT]) or math.isnan(y[R_TILT + 1]))):
            set_tilt_rows(y[R_TILT : R_TILT + 2], tilts)
            for j in range(2):
                count = set_equation(system, count, tilts[j], y[R_TILT_RATE + j], s[E_TILT + j])
                if not (turning or tilting) and s[E_PRIOR_TILT + j] < math.inf:
                    count = set_equation(system, count, tilts[j], 0.0, s[E_PRIOR_TILT + j])
        A[k, :count] = system[:count]
        A[k, count:] = 0.0
        is_open[k] = not (count >= UNKNOWNS and least_squares(system, count, motion[k], covariance[k], inverse))
        for i in range(6):
            for j in range(3):
                value = 0.0
                for n in range(0 if is_open[k] else UNKNOWNS):
                    value += rows[k, i, j, n] * motion[k, n]
                value += rows[k, i, j, TURN] * y[R_STEERING_RATE + i]
                residual[k, i, j] = value - rover[P_RADIUS + i] * y[R_WHEEL + i] if j == ALONG else value
