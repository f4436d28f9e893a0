"""Motion of the body in one interval, from joint sensors (docs/odometry.md)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.linkage import P_BOGIE_PIVOT, P_HUB, P_OFFSET, P_PIVOT, P_RADIUS, right_rocker
from .layout import (
    R_BOGIE,
    R_BOGIE_RATE,
    R_GYRO,
    R_ROCKER,
    R_ROCKER_RATE,
    R_STEERING,
    R_STEERING_RATE,
    R_TILT,
    R_TILT_RATE,
    R_WHEEL,
    W_GYRO,
    W_JOINT_RATE,
    W_LEAST,
    W_LIFT,
    W_OUTLIER,
    W_PRIOR_JOINT,
    W_PRIOR_LEAST,
    W_PRIOR_TILT,
    W_ROLL,
    W_ROUNDS,
    W_SIDE,
    W_SOIL,
    W_STANDING,
    W_STEEPEST,
    W_TILT_RATE,
    W_WHEELBASE,
)
from .least_squares import least_squares

Array = NDArray[np.float64]

#: Unknowns: twist, rocker rate, bogie rates. Most equations: 18 of contacts, 3 of joints, 3 of gyro, 2 of tilt, 2 of priors.
UNKNOWNS, EQUATIONS = 9, 28
#: Columns of a wheel's frame: hub, then axes x (forward), y (along the axle) and z of its axle.
HUB, FORWARD, AXLE, UP = 0, 3, 6, 9
#: Rows of a contact: along its path, across it, off the terrain, and pitch of its link.
ALONG, ACROSS, OFF, PITCH = 0, 1, 2, 3
#: Column of a wheel's plane after its normal.
ASIDE = 3
#: Column of the steering in a contact's row, after the unknowns.
TURN = 9


@njit
def set_wheels(rover: Array, steers: NDArray[np.bool_], reading: Array, frame: Array, joint: Array) -> None:
    """Compute the frames of the axles in the body, and their velocity by each joint.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        reading: (R_SIZE,) readings; rocker, bogie and steering are used.
        frame: (6, 12) filled with HUB, FORWARD, AXLE and UP, (3,) each.
        joint: (6, 4, 6) filled with the twist of the body about the standing wheel, by the rates of rocker, left and right bogie,
            and steering.
    """
    right, slope = right_rocker(rover, reading[R_ROCKER])
    joint[:] = 0.0
    for i in range(6):
        side = i % 2
        arm = right if side else reading[R_ROCKER]
        rate = slope if side else 1.0
        px, py, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 1], rover[P_PIVOT + 3 * side + 2]
        ox, oy, oz, link = px, py, pz, arm
        if i >= 2:
            at = P_BOGIE_PIVOT + 3 * side
            c, s = math.cos(arm), math.sin(arm)
            ox, oy, oz = px + c * rover[at] + s * rover[at + 2], py + rover[at + 1], pz - s * rover[at] + c * rover[at + 2]
            link = arm + reading[R_BOGIE + side]
            joint[i, 1 + side, 0], joint[i, 1 + side, 2], joint[i, 1 + side, 4] = oz, -ox, -1.0
        joint[i, 0, 0], joint[i, 0, 2], joint[i, 0, 4] = pz * rate, -px * rate, -rate
        cl, sl = math.cos(link), math.sin(link)
        cs, ss = math.cos(reading[R_STEERING + i]), math.sin(reading[R_STEERING + i])
        bx, by = rover[P_OFFSET + 2 * i], rover[P_OFFSET + 2 * i + 1]
        fx, fy, fz = rover[P_HUB + 3 * i] + bx, rover[P_HUB + 3 * i + 1] + by, rover[P_HUB + 3 * i + 2]
        if steers[i]:
            sx, sy, sz = ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz
            joint[i, 3, 0], joint[i, 3, 1], joint[i, 3, 2] = -sy * cl, -sz * sl + sx * cl, sy * sl
            joint[i, 3, 3], joint[i, 3, 5] = -sl, -cl
        fx, fy = fx - cs * bx + ss * by, fy - ss * bx - cs * by
        frame[i, HUB], frame[i, HUB + 1], frame[i, HUB + 2] = ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz
        frame[i, FORWARD], frame[i, FORWARD + 1], frame[i, FORWARD + 2] = cs * cl, ss, -cs * sl
        frame[i, AXLE], frame[i, AXLE + 1], frame[i, AXLE + 2] = -ss * cl, cs, ss * sl
        frame[i, UP], frame[i, UP + 1], frame[i, UP + 2] = sl, 0.0, cl


@njit
def hub_plane(frame: Array, normal: Array) -> None:
    """Compute the normal of the plane nearest to the six hubs, by height.

    Args:
        frame: (6, 12) of `set_wheels`.
        normal: (3,) filled with a unit vector in the body.
    """
    x = y = z = xx = xy = yy = xz = yz = 0.0
    for i in range(6):
        x, y, z = x + frame[i, HUB] / 6.0, y + frame[i, HUB + 1] / 6.0, z + frame[i, HUB + 2] / 6.0
    for i in range(6):
        dx, dy, dz = frame[i, HUB] - x, frame[i, HUB + 1] - y, frame[i, HUB + 2] - z
        xx, xy, yy, xz, yz = xx + dx * dx, xy + dx * dy, yy + dy * dy, xz + dx * dz, yz + dy * dz
    area = xx * yy - xy * xy
    a, b = (yy * xz - xy * yz) / area, (xx * yz - xy * xz) / area
    length = math.sqrt(a * a + b * b + 1.0)
    normal[0], normal[1], normal[2] = -a / length, -b / length, 1.0 / length


@njit
def set_contact_rows(rover: Array, frame: Array, joint: Array, planes: Array, contact: Array, rows: Array) -> None:
    """Compute the contact rows of six wheels, as `motion.jacobian.contact_rows` defines them.

    Args:
        rover: (P_SIZE,) packed rover.
        frame, joint: of `set_wheels`.
        planes: (6, 4) normal of the terrain at each wheel, in the body, and place of its contact along the axle, m.
        contact: (6,) contact angles, rad.
        rows: (6, 4, 10) filled with ALONG, ACROSS, OFF and PITCH, over the unknowns and the steering rate.
    """
    for i in range(6):
        c, s = math.cos(contact[i]), math.sin(contact[i])
        normal, aside = planes[i], planes[i, ASIDE]
        f, a, u = frame[i, FORWARD : FORWARD + 3], frame[i, AXLE : AXLE + 3], frame[i, UP : UP + 3]
        xx, xy, xz = c * f[0] - s * u[0], c * f[1] - s * u[1], c * f[2] - s * u[2]
        r = rover[P_RADIUS + i]
        mx = frame[i, HUB] - r * (s * f[0] + c * u[0])
        my = frame[i, HUB + 1] - r * (s * f[1] + c * u[1])
        mz = frame[i, HUB + 2] - r * (s * f[2] + c * u[2])
        sx, sy, sz = normal[1] * xz - normal[2] * xy, normal[2] * xx - normal[0] * xz, normal[0] * xy - normal[1] * xx
        length = math.sqrt(sx * sx + sy * sy + sz * sz)
        rows[i, ALONG, 0], rows[i, ALONG, 1], rows[i, ALONG, 2] = xx, xy, xz
        rows[i, ACROSS, 0], rows[i, ACROSS, 1], rows[i, ACROSS, 2] = sx / length, sy / length, sz / length
        rows[i, OFF, 0], rows[i, OFF, 1], rows[i, OFF, 2] = normal[0], normal[1], normal[2]
        for k in range(3):
            vx, vy, vz = rows[i, k, 0], rows[i, k, 1], rows[i, k, 2]
            if k == OFF:
                mx, my, mz = mx + aside * a[0], my + aside * a[1], mz + aside * a[2]
            rows[i, k, 3], rows[i, k, 4], rows[i, k, 5] = my * vz - mz * vy, mz * vx - mx * vz, mx * vy - my * vx
        rows[i, PITCH, 0] = rows[i, PITCH, 1] = rows[i, PITCH, 2] = 0.0
        rows[i, PITCH, 3], rows[i, PITCH, 4], rows[i, PITCH, 5] = a[0], a[1], a[2]
        for k in range(4):
            for j in range(4):
                value = 0.0
                for n in range(6):
                    value -= rows[i, k, n] * joint[i, j, n]
                rows[i, k, 6 + j] = value


@njit
def set_equation(A: Array, count: int, row: Array, value: float, sigma: float) -> int:
    """Add a whitened equation, row · unknowns = value, if its value is not NaN.

    Args:
        A: (EQUATIONS, UNKNOWNS + 1) equations; row `count` is written.
        count: number of equations so far.
        row: (UNKNOWNS or more,) coefficients.
        value: right side.
        sigma: standard deviation of the value.

    Returns:
        The number of equations.
    """
    if math.isnan(value):
        return count
    for n in range(UNKNOWNS):
        A[count, n] = row[n] / sigma
    A[count, UNKNOWNS] = value / sigma
    return count + 1


@njit
def set_sensors(reading: Array, weights: Array, speed: float, roll: float, pitch: float, row: Array, A: Array, count: int) -> int:
    """Add the equations of suspension sensors, gyro and inclinometer, and priors of the rest.

    Args:
        reading: (R_SIZE,) readings.
        weights: (W_SIZE,) standard deviations.
        speed: of the wheels, m/s.
        roll, pitch: rad.
        row: (UNKNOWNS,) scratch.
        A: (EQUATIONS, UNKNOWNS + 1) equations; row `count` is written.
        count: number of equations so far.

    Returns:
        The number of equations.
    """
    row[:] = 0.0
    distance = speed / weights[W_WHEELBASE]
    least = weights[W_PRIOR_LEAST]
    prior = weights[W_PRIOR_JOINT] * distance + least
    bogies = not (math.isnan(reading[R_BOGIE_RATE]) and math.isnan(reading[R_BOGIE_RATE + 1]))
    for k in range(3):
        value, sigma = reading[R_ROCKER_RATE + k], weights[W_JOINT_RATE]
        if math.isnan(value) and not (k > 0 and bogies):
            value, sigma = 0.0, prior
        row[6 + k] = 1.0
        count = set_equation(A, count, row, value, sigma)
        row[6 + k] = 0.0
    for k in range(3):
        row[3 + k] = 1.0
        count = set_equation(A, count, row, reading[R_GYRO + k], weights[W_GYRO])
        row[3 + k] = 0.0
    tilted = not (math.isnan(reading[R_TILT_RATE]) and math.isnan(reading[R_TILT_RATE + 1]))
    spun = not (math.isnan(reading[R_GYRO]) and math.isnan(reading[R_GYRO + 1]))
    if tilted or not spun:
        sigma = weights[W_TILT_RATE] if tilted else weights[W_PRIOR_TILT] * distance + least
        cr, sr, slope = math.cos(roll), math.sin(roll), math.tan(pitch)
        row[3], row[4], row[5] = 1.0, sr * slope, cr * slope
        count = set_equation(A, count, row, reading[R_TILT_RATE] if tilted else 0.0, sigma)
        row[3], row[4], row[5] = 0.0, cr, -sr
        count = set_equation(A, count, row, reading[R_TILT_RATE + 1] if tilted else 0.0, sigma)
    return count


@njit
def set_soil_slip(frame: Array, contact: Array, roll: float, pitch: float, weights: Array, rim: Array, expected: Array) -> None:
    """Compute the slip of each wheel that the soil gives on the slope under it.

    Args:
        frame: (6, 12) of `set_wheels`.
        contact: (6,) contact angles, rad.
        roll, pitch: of the body, rad.
        weights: (W_SIZE,); slip per unit of slope.
        rim: (6,) speeds of the rims without sign, m/s.
        expected: (6, 3) filled with roll slip, side slip and lift (0), m/s.
    """
    ux, uy, uz = -math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)
    for i in range(6):
        c, s = math.cos(contact[i]), math.sin(contact[i])
        ahead = left = 0.0
        for n in range(3):
            up = ux if n == 0 else (uy if n == 1 else uz)
            ahead += up * (c * frame[i, FORWARD + n] - s * frame[i, UP + n])
            left += up * frame[i, AXLE + n]
        expected[i, 0], expected[i, 1] = -weights[W_SOIL] * ahead * rim[i], -weights[W_SOIL + 1] * left * rim[i]
        expected[i, 2] = 0.0


@owning_njit
def motion_batch(
    rover: Array, steers: NDArray[np.bool_], weights: Array, reading: Array, climb: Array,
    motion: Array, covariance: Array, residual: Array, contact: Array, normals: Array, rolling: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Compute the motion of each interval, together with the contact angles.

    Each hub moves along its own tread's tangent, and off the plane of all six wheels at the rate that leaves the body's
    `climb`. Without one, the mean rate off the plane is 0. A wheel whose slip exceeds the outlier's share loses weight.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        weights: (W_SIZE,).
        reading: (n, R_SIZE).
        climb: (n,) or (1,) speed of the body off the plane of its wheels, m/s; NaN if it is not known.
        motion: (n, 9) filled with the twist, m/s and rad/s, and the rates of rocker and bogies, rad/s.
        covariance: (n, 9, 9) filled with the covariance of the motion.
        residual: (n, 6, 3) filled with roll slip, side slip and lift, m/s; expected ones included.
        contact: (n, 6) filled with the contact angles, rad.
        normals: (n, 3) filled with the normal of the hubs' plane in the body.
        rolling: (n, 2) filled with the RMS over six wheels of unexpected roll slip and of rim speed, m/s.
        start, stop: range of intervals.
    """
    frame, joint, rows, same = np.empty((6, 12)), np.empty((6, 4, 6)), np.empty((6, 4, 10)), np.zeros((6, 4))
    A, row, inverse = np.empty((EQUATIONS, UNKNOWNS + 1)), np.empty(UNKNOWNS), np.empty((UNKNOWNS, UNKNOWNS))
    plane, expected, sigma, rolled, rim = np.empty(6), np.empty((6, 3)), np.empty(6), np.empty(6), np.empty(6)
    for k in range(start, stop):
        now, x, normal = reading[k], motion[k], normals[k]
        set_wheels(rover, steers, now, frame, joint)
        hub_plane(frame, normal)
        for i in range(6):
            ahead = normal[0] * frame[i, FORWARD] + normal[1] * frame[i, FORWARD + 1] + normal[2] * frame[i, FORWARD + 2]
            plane[i] = math.atan2(ahead, normal[0] * frame[i, UP] + normal[2] * frame[i, UP + 2])
            rolled[i] = rover[P_RADIUS + i] * now[R_WHEEL + i]
            rim[i] = abs(rolled[i])
            same[i, :ASIDE] = normal
        contact[k] = plane
        roll, pitch = now[R_TILT], now[R_TILT + 1]
        if math.isnan(roll) or math.isnan(pitch):
            roll, pitch = math.atan2(normal[1], normal[2]), -math.asin(min(1.0, max(-1.0, normal[0])))
        set_soil_slip(frame, plane, roll, pitch, weights, rim, expected)
        rim.sort()
        speed = 0.5 * (rim[2] + rim[3])
        usual = weights[W_ROLL] * speed + weights[W_LEAST]
        sigma[:] = usual
        upward = climb[k if climb.shape[0] > 1 else 0]
        for _ in range(int(weights[W_ROUNDS])):
            set_contact_rows(rover, frame, joint, same, contact[k], rows)
            count = 0
            for i in range(6):
                turned = now[R_STEERING_RATE + i]
                along = rolled[i] + expected[i, 0] - rows[i, ALONG, TURN] * turned
                count = set_equation(A, count, rows[i, ALONG], along, sigma[i])
                side = expected[i, 1] - rows[i, ACROSS, TURN] * turned
                count = set_equation(A, count, rows[i, ACROSS], side, weights[W_SIDE] * speed + weights[W_LEAST])
                off = expected[i, 2] - rows[i, OFF, TURN] * turned
                count = set_equation(A, count, rows[i, OFF], off, weights[W_LIFT] * speed + weights[W_LEAST])
            count = set_sensors(now, weights, speed, roll, pitch, row, A, count)
            least_squares(A, count, x, covariance[k], inverse)
            rise = 0.0
            for i in range(6):
                for j in range(3):
                    value = 0.0
                    for n in range(UNKNOWNS):
                        value += rows[i, j, n] * x[n]
                    residual[k, i, j] = value
                pitching = 0.0
                for n in range(3, UNKNOWNS):
                    pitching += rows[i, PITCH, n] * x[n]
                along, off = residual[k, i, ALONG] + rover[P_RADIUS + i] * pitching, residual[k, i, OFF]  # of the hub
                sine = off / along if abs(along) > weights[W_STANDING] else 0.0
                contact[k, i] = plane[i] - math.asin(min(weights[W_STEEPEST], max(-weights[W_STEEPEST], sine)))
                rise -= off / 6.0
                slip = (residual[k, i, ALONG] - rolled[i] + rows[i, ALONG, TURN] * now[R_STEERING_RATE + i]) - expected[i, 0]
                slip /= weights[W_OUTLIER] * usual
                sigma[i] = usual * max(1.0, slip * slip)
                expected[i, 2] = off
            if not math.isnan(upward):
                rise = upward - (normal[0] * x[0] + normal[1] * x[1] + normal[2] * x[2])
            for i in range(6):
                expected[i, 2] += rise
                for j in range(3):
                    residual[k, i, j] += rows[i, j, TURN] * now[R_STEERING_RATE + i]
                residual[k, i, ALONG] -= rolled[i]
        rolling[k, 0] = rolling[k, 1] = 0.0
        for i in range(6):
            rolling[k, 0] += (residual[k, i, ALONG] - expected[i, 0]) ** 2 / 6.0
            rolling[k, 1] += rolled[i] * rolled[i] / 6.0
        rolling[k, 0], rolling[k, 1] = math.sqrt(rolling[k, 0]), math.sqrt(rolling[k, 1])
