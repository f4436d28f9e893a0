"""Track of a rover: twists integrated to poses, with their covariance."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .layout import (
    N_DOUBT,
    N_DOUBT_LENGTH,
    N_HEIGHT,
    N_SHARED,
    N_SLIP_LENGTH,
    N_SLIP_TIME,
    T_COVARIANCE,
    T_DOUBTED,
    T_FLAT,
    T_LENGTH,
    T_MOVED,
    T_RIM,
    T_ROTATION,
    T_SLIP,
    T_START,
)

Array = NDArray[np.float64]

#: Rotation angle below which series replace quotients, rad.
SMALL = 1e-6
#: Above the share from which displacement is doubted, the doubt rises from none to all over this share of it.
RISE = 0.5


@njit
def rotation_of(roll: float, pitch: float, yaw: float, R: Array) -> None:
    """Compute Rz(yaw) Ry(pitch) Rx(roll).

    Args:
        roll, pitch, yaw: rad.
        R: (3, 3) filled.
    """
    cr, sr, cp, sp, cy, sy = (
        math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw),
    )  # fmt: skip
    R[0, 0], R[0, 1], R[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    R[1, 0], R[1, 1], R[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    R[2, 0], R[2, 1], R[2, 2] = -sp, cp * sr, cp * cr


@njit
def turned_by(R: Array, vector: Array, out: Array) -> None:
    """Compute the rotation R · exp(vector).

    Args:
        R: (3, 3).
        vector: (3,) axis times angle, rad.
        out: (3, 3) filled.
    """
    x, y, z = vector[0], vector[1], vector[2]
    angle = math.sqrt(x * x + y * y + z * z)
    first = math.sin(angle) / angle if angle > SMALL else 1.0
    half = math.sin(0.5 * angle)
    second = 2.0 * half * half / (angle * angle) if angle > SMALL else 0.5
    for r in range(3):
        a, b, c = R[r, 0], R[r, 1], R[r, 2]
        # row · exp(v) = row − first · (v × row) + second · (v × (v × row))
        px, py, pz = y * c - z * b, z * a - x * c, x * b - y * a
        qx, qy, qz = y * pz - z * py, z * px - x * pz, x * py - y * px
        out[r, 0], out[r, 1], out[r, 2] = a - first * px + second * qx, b - first * py + second * qy, c - first * pz + second * qz


@owning_njit
def turn_between(R: Array, S: Array, vector: Array) -> None:
    """Compute the rotation vector of RᵀS.

    Args:
        R, S: (3, 3).
        vector: (3,) filled with axis times angle, rad.
    """
    D = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            D[i, j] = R[0, i] * S[0, j] + R[1, i] * S[1, j] + R[2, i] * S[2, j]
    trace = D[0, 0] + D[1, 1] + D[2, 2]
    largest = 0
    for i in range(1, 3):
        if D[i, i] > D[largest, largest]:
            largest = i
    q = np.empty(4)  # quaternion, not normalised; the last is its scalar part
    if trace >= D[largest, largest]:
        q[0], q[1], q[2], q[3] = D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1], 1.0 + trace
    else:
        i = largest
        j, k = (i + 1) % 3, (i + 2) % 3
        q[i], q[j], q[k] = 1.0 - trace + 2.0 * D[i, i], D[j, i] + D[i, j], D[k, i] + D[i, k]
        q[3] = D[k, j] - D[j, k]
    sign = -1.0 if q[3] < 0.0 else 1.0
    size = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    angle = 2.0 * math.atan2(size, sign * q[3])
    scale = sign * (angle / size if size > 0.0 else 0.0)
    for i in range(3):
        vector[i] = scale * q[i]


@njit
def screw(phi: Array, rho: Array, out: Array) -> float:
    """Compute the displacement by a constant twist in unit time, V(phi) rho on SE(3).

    Args:
        phi: (3,) rotation vector, rad.
        rho: (3,) velocity in the moving frame times the time, m.
        out: (3,) filled with the displacement in the frame at the start, m.

    Returns:
        The angle of phi, rad.
    """
    angle = math.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    first, second = 0.5, 1.0 / 6.0
    if angle > SMALL:
        half = math.sin(0.5 * angle)
        first, second = 2.0 * half * half / (angle * angle), (angle - math.sin(angle)) / (angle * angle * angle)
    px, py, pz = phi[1] * rho[2] - phi[2] * rho[1], phi[2] * rho[0] - phi[0] * rho[2], phi[0] * rho[1] - phi[1] * rho[0]
    qx, qy, qz = phi[1] * pz - phi[2] * py, phi[2] * px - phi[0] * pz, phi[0] * py - phi[1] * px
    out[0], out[1], out[2] = (
        rho[0] + first * px + second * qx,
        rho[1] + first * py + second * qy,
        rho[2] + first * pz + second * qz,
    )
    return angle


@owning_njit
def turns_batch(attitude: Array, turn: Array, start: int, stop: int) -> None:
    """Compute the rotation vectors between consecutive attitudes.

    Args:
        attitude: (n + 1, 3) roll, pitch, yaw, rad.
        turn: (n, 3) filled, rad, in the body frame.
        start, stop: range of intervals.
    """
    R, S = np.empty((3, 3)), np.empty((3, 3))
    for k in range(start, stop):
        rotation_of(attitude[k, 0], attitude[k, 1], attitude[k, 2], R)
        rotation_of(attitude[k + 1, 0], attitude[k + 1, 1], attitude[k + 1, 2], S)
        turn_between(R, S, turn[k])


@owning_njit
def set_error_growth(P: Array, step: Array, added: Array) -> None:
    """Propagate the covariance of a pose over a displacement, in place.

    Args:
        P: (6, 6) of position and rotation about fixed axes, m² and rad²; replaced.
        step: (3,) displacement, m.
        added: (6, 6) covariance of the step itself.
    """
    # F = [1, −[step]×; 0, 1]: position errors grow by rotation error × step
    G = np.zeros((3, 3))
    G[0, 1], G[0, 2], G[1, 2] = step[2], -step[1], step[0]
    G[1, 0], G[2, 0], G[2, 1] = -step[2], step[1], -step[0]
    for i in range(3):
        for j in range(6):
            P[i, j] += G[i, 0] * P[3, j] + G[i, 1] * P[4, j] + G[i, 2] * P[5, j]
    for j in range(3):
        for i in range(6):
            P[i, j] += G[j, 0] * P[i, 3] + G[j, 1] * P[i, 4] + G[j, 2] * P[i, 5]
    for i in range(6):
        for j in range(6):
            P[i, j] += added[i, j]


@njit
def slip_share(state: Array) -> float:
    """Return the slip of the wheels against each other, as a share of their rim speed.

    Args:
        state: (T_SIZE,) of the track.

    Returns:
        RMS roll slip over RMS rim speed, both averaged over the last rolled distance; 0 before the wheels have turned.
    """
    return state[T_SLIP] / state[T_RIM] if state[T_RIM] > 0.0 else 0.0


@owning_njit
def advance(
    state: Array, noise: Array, time: float, twist: Array, covariance: Array, rolling: Array, attitude: Array, height: float,
    work: Array,
) -> None:  # fmt: skip
    """Continue a track by one interval.

    Args:
        state: (T_SIZE,) of the track, replaced.
        noise: (N_SIZE,).
        time: length of the interval, s.
        twist: (6,) of the body in its own frame, m/s and rad/s.
        covariance: (6, 6) or larger, of the twist.
        rolling: (2,) RMS roll slip and rim speed of six wheels, m/s.
        attitude: (3,) measured roll, pitch, yaw at the end, rad; NaN where not measured.
        height: z at the end, m, which replaces the integrated one; NaN if not known.
        work: (60,) scratch.
    """
    R = state[T_ROTATION : T_ROTATION + 9].reshape((3, 3))
    P = state[T_COVARIANCE : T_COVARIANCE + 36].reshape((6, 6))
    S, vector, rho, moved = work[:9].reshape((3, 3)), work[9:12], work[12:15], work[15:18]
    Q = work[18:54].reshape((6, 6))
    tilted = not (math.isnan(attitude[0]) or math.isnan(attitude[1]))
    headed = not math.isnan(attitude[2])
    if tilted and headed:
        rotation_of(attitude[0], attitude[1], attitude[2], S)
    else:
        for i in range(3):
            vector[i] = twist[3 + i] * time
        turned_by(R, vector, S)
        if tilted:
            rotation_of(attitude[0], attitude[1], math.atan2(S[1, 0], S[0, 0]), S)
    turn_between(R, S, vector)
    for i in range(3):
        rho[i] = twist[i] * time
    angle = screw(vector, rho, moved)
    speed = math.sqrt(twist[0] * twist[0] + twist[1] * twist[1] + twist[2] * twist[2])
    alike = noise[N_SLIP_LENGTH] / max(speed, 1e-9)
    alike = min(max(alike, time), max(time, noise[N_SLIP_TIME]))
    for a in range(2):
        for b in range(2):
            for i in range(3):
                for j in range(3):
                    value = 0.0
                    for m in range(3):
                        for n in range(3):
                            c = covariance[3 * a + m, 3 * b + n]
                            # wheels that rise come down again: motion along the body's z does not add up (N_HEIGHT)
                            bounded = tilted and ((a == 0 and m == 2) or (b == 0 and n == 2))
                            c = 0.0 if bounded or math.isnan(c) else min(1.0, max(-1.0, c))
                            value += R[i, m] * c * R[j, n]
                    Q[3 * a + i, 3 * b + j] = value * (time * alike)
    for k in range(6):
        if (k in (3, 4) and tilted) or (k == 5 and headed):
            Q[k] = 0.0
            Q[:, k] = 0.0
    step = rho
    for i in range(3):
        step[i] = R[i, 0] * moved[0] + R[i, 1] * moved[1] + R[i, 2] * moved[2]
    if not math.isnan(height):
        step[2] = height - state[T_START + 2] - state[T_MOVED + 2]
    set_error_growth(P, step, Q)
    half = min(0.5 * angle, 0.5 * math.pi)
    arc = half / math.sin(half) if half > SMALL else 1.0
    flat = math.sqrt(step[0] * step[0] + step[1] * step[1])
    state[T_FLAT] += flat * arc
    state[T_LENGTH] += math.sqrt(flat * flat + step[2] * step[2]) * arc
    kept = math.exp(-rolling[1] * time / noise[N_DOUBT_LENGTH])
    state[T_SLIP] = kept * state[T_SLIP] + (1.0 - kept) * rolling[0]
    state[T_RIM] = kept * state[T_RIM] + (1.0 - kept) * rolling[1]
    doubt = min(1.0, max(0.0, (slip_share(state) / noise[N_DOUBT] - 1.0) / RISE))
    for i in range(3):
        state[T_MOVED + i] += step[i]
        state[T_DOUBTED + i] += doubt * step[i]
    R[:] = S


@owning_njit
def track_batch(
    state: Array, noise: Array, dt: Array, motion: Array, covariance: Array, rolling: Array, attitude: Array, height: Array,
    T: Array, P: Array, lengths_slip: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Continue a track by intervals, and record each pose.

    Args:
        state: (T_SIZE,) of the track, replaced.
        noise: (N_SIZE,).
        dt: (n,) lengths of the intervals, s.
        motion: (n, 6 or more) twist, m/s and rad/s.
        covariance: (n, 6 or more, 6 or more) of the twist.
        rolling: (n, 2) RMS roll slip and rim speed of six wheels, m/s.
        attitude: (n, 3) measured roll, pitch, yaw at the ends, rad; NaN where not measured.
        height: (n,) or (1,) z at the ends, m, which replace the integrated ones; NaN where not known.
        T: (n, 4, 4) filled with T_world_body at the ends.
        P: (n, 6, 6) filled with the covariance of the pose, m² and rad².
        lengths_slip: (n, 3) filled with the horizontal and the three-dimensional length of the track, m, and the slip share.
        start, stop: range of intervals, in order.
    """
    work = np.empty(60)
    for k in range(start, stop):
        z = height[k if height.shape[0] > 1 else 0]
        advance(state, noise, dt[k], motion[k], covariance[k], rolling[k], attitude[k], z, work)
        set_pose(state, noise, T[k], P[k], lengths_slip[k])


@njit
def set_pose(state: Array, noise: Array, T: Array, P: Array, lengths_slip: Array) -> None:
    """Compute pose, covariance, lengths and slip share of a track's state.

    Args:
        state: (T_SIZE,) of the track.
        noise: (N_SIZE,).
        T: (4, 4) filled with T_world_body.
        P: (6, 6) filled, with the error of the length that all wheels share, that of the wheels' mean height, and that of
            doubted displacement, which may not have happened at all.
        lengths_slip: (3,) filled with the lengths, m, and the slip share.
    """
    for i in range(3):
        for j in range(3):
            T[i, j] = state[T_ROTATION + 3 * i + j]
        T[i, 3] = state[T_START + i] + state[T_MOVED + i]
        T[3, i] = 0.0
    T[3, 3] = 1.0
    for i in range(6):
        for j in range(6):
            P[i, j] = state[T_COVARIANCE + 6 * i + j]
    for i in range(3):
        for j in range(3):
            P[i, j] += noise[N_SHARED] * state[T_MOVED + i] * state[T_MOVED + j]
            P[i, j] += state[T_DOUBTED + i] * state[T_DOUBTED + j]
    P[2, 2] += noise[N_HEIGHT] * min(state[T_LENGTH] / noise[N_SLIP_LENGTH], 1.0)
    lengths_slip[0], lengths_slip[1], lengths_slip[2] = state[T_FLAT], state[T_LENGTH], slip_share(state)
