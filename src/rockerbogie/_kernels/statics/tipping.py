"""Hold margins: the least turn of gravity at which no forces hold a rover.

The gravity directions that a pose can hold are a convex cone, for its friction cones are convex and gravity's share of
the balance is linear. Every virtual motion v in which all contacts separate steeper than friction follows, u_n >= μ |u_t|,
bounds it by a half-space: gravity must not work in v. So the angle to the nearest such bound is that at which the centre of
mass starts to climb in v, asin(ẋ_z / |ẋ|). In one azimuth, the limit is where the least friction reaches μ; its virtual
motion gives a bound that is nearest in another azimuth, from which the next step starts (docs/stability.md).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .balance import EQUATIONS
from .cones import contact_velocities
from .least_norm import factor, solve_factored
from .mechanism import EXTRA, Mechanism

Array = NDArray[np.float64]

SIZE = EQUATIONS + 1
WEDGED = 50.0  # of the weight: largest sum of normal forces; more would wedge the rover between its contacts
NEWTON_STEPS = 150
BALANCED = 1e-5  # of the weight: residual of forces that count as balanced
GROWTH = 10.0  # of the force on s, from one point of the central path to the next
LAST_GAP = 2e-4  # duality gap at the last point
PRECISION = 1e-5  # rad, of a limit
STEEPEST = 100.0  # tangent beyond which an angle counts as a right one
AZIMUTHS = 8  # first directions of the search
STEPS = 8  # most steps from one azimuth to the next
COARSE, FINE = 0.1, 2e-3  # rad: first and last turns about the best azimuth
STAYS = 1e-2  # of the centre of mass's velocity: a contact that moves less stays
ON_EDGE = 1e-9  # m: a contact this close to the line of two others lies on it


class Work(NamedTuple):
    """Work arrays of `limit_in_azimuth`; its last equation bounds the sum of the normal forces."""

    columns: Array  # (6 + EXTRA + 1, 3, SIZE) generalized forces of n, t / μ, s / μ of each wheel, then of one force a row
    x: Array  # (6 + EXTRA + 1, 3) these forces
    dx: Array  # (6 + EXTRA + 1, 3) their step
    h: Array  # (3, 3) inverse Hessian of a cone's barrier
    g: Array  # (3, SIZE)
    m: Array  # (SIZE, SIZE)
    b: Array  # (SIZE,) weight that stays
    d: Array  # (SIZE,) weight that grows with the tangent of the angle
    p: Array  # (SIZE,) multipliers: the virtual motion
    q: Array  # (SIZE,)


@owning_njit
def new_work() -> Work:
    """Return empty work arrays."""
    rows = 6 + EXTRA + 1
    return Work(
        np.zeros((rows, 3, SIZE)), np.zeros((rows, 3)), np.zeros((rows, 3)), np.zeros((3, 3)), np.zeros((3, SIZE)),
        np.zeros((SIZE, SIZE)), np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE),
    )  # fmt: skip


@njit
def set_columns(m: Mechanism, count: int, more: int, friction: float, w: Work) -> None:
    """Fill the columns of all forces, the last that of the slack of the normal forces' bound.

    Args:
        m: filled by `assemble`, with `count` wheels in contact and `more` rows of `extra`.
        friction: friction coefficient.
        w: work arrays; `columns` is filled.
    """
    w.columns[:] = 0.0
    for i in range(count):
        for c in range(3):
            for k in range(EQUATIONS):
                w.columns[i, c, k] = m.columns[i, c, k] * (1.0 if c == 0 else friction)
        w.columns[i, 0, EQUATIONS] = 1.0
    for e in range(more):
        for k in range(EQUATIONS):
            w.columns[count + e, 0, k] = m.extra[e, k]
    w.columns[count + more, 0, EQUATIONS] = 1.0


@njit
def newton_step(cones: int, rows: int, force: float, s: float, w: Work) -> tuple[float, float, float]:
    """Fill the Newton step towards the most favourable barrier of forces that balance b + s d.

    Args:
        cones: number of rows of `x` that are friction cones.
        rows: number of rows of `x`.
        force: weight of s against the barrier.
        s: tangent of the angle.
        w: work arrays; `dx` and `p` are filled.

    Returns:
        The new s, the squared Newton decrement (NaN if there is no step), the residual of the balance.
    """
    w.m[:] = 0.0
    for k in range(SIZE):
        w.p[k], w.q[k] = -w.b[k], w.d[k]
    residual = 0.0
    for k in range(SIZE):
        total = -w.b[k] - s * w.d[k]
        for i in range(rows):
            for c in range(3 if i < cones else 1):
                total += w.columns[i, c, k] * w.x[i, c]
        residual = max(residual, abs(total))
        w.p[k] += 2.0 * (total + w.b[k] + s * w.d[k])
    for i in range(rows):
        if i < cones:
            set_barrier(w.x[i], w.h)
            for k in range(SIZE):
                for r in range(3):
                    w.g[r, k] = w.h[r, 0] * w.columns[i, 0, k] + w.h[r, 1] * w.columns[i, 1, k] + w.h[r, 2] * w.columns[i, 2, k]
            for k in range(SIZE):
                for j in range(k + 1):
                    for r in range(3):
                        w.m[k, j] += w.columns[i, r, k] * w.g[r, j]
        else:
            size = w.x[i, 0] ** 2
            for k in range(SIZE):
                for j in range(k + 1):
                    w.m[k, j] += size * w.columns[i, 0, k] * w.columns[i, 0, j]
    if not factor(w.m, SIZE):
        return s, math.nan, residual
    solve_factored(w.m, SIZE, w.p)
    solve_factored(w.m, SIZE, w.q)
    dp = dq = 0.0
    for k in range(SIZE):
        dp += w.d[k] * w.p[k]
        dq += w.d[k] * w.q[k]
    new = (force + dp) / dq
    decrement = 0.0
    for k in range(SIZE):
        w.p[k] -= new * w.q[k]
    for i in range(rows):
        x = w.x[i]
        if i < cones:
            set_barrier(x, w.h)
            det = x[0] * x[0] - x[1] * x[1] - x[2] * x[2]
            for c in range(3):
                w.dx[i, c] = x[c]
            for k in range(3):
                z = 0.0
                for n in range(SIZE):
                    z += w.columns[i, k, n] * w.p[n]
                for c in range(3):
                    w.dx[i, c] -= w.h[c, k] * z
            dx = w.dx[i]
            xd = x[0] * dx[0] - x[1] * dx[1] - x[2] * dx[2]
            dd = dx[0] * dx[0] - dx[1] * dx[1] - dx[2] * dx[2]
            decrement += (2.0 * xd * xd / det - dd) / det
        else:
            z = 0.0
            for n in range(SIZE):
                z += w.columns[i, 0, n] * w.p[n]
            w.dx[i, 0] = x[0] - x[0] * x[0] * z
            decrement += (w.dx[i, 0] / x[0]) ** 2
    return new, decrement, residual


@njit
def set_barrier(x: Array, h: Array) -> None:
    """Fill the inverse Hessian of the barrier -log(x0² - x1² - x2²) / 2.

    Args:
        x: (3,) a point inside the cone.
        h: (3, 3) filled.
    """
    det = x[0] * x[0] - x[1] * x[1] - x[2] * x[2]
    for r in range(3):
        for c in range(3):
            h[r, c] = 2.0 * x[r] * x[c]
    h[0, 0] -= det
    h[1, 1] += det
    h[2, 2] += det


@njit
def longest_step(cones: int, rows: int, w: Work) -> float:
    """Return the share, up to 1, of the step `dx` that stays inside all cones.

    Args:
        cones, rows: as for `newton_step`.
        w: work arrays with `x` and `dx`.
    """
    step = 1.0
    while step > 1e-12:
        good = True
        for i in range(rows):
            n = w.x[i, 0] + step * w.dx[i, 0]
            good &= n > 0.0
            if i < cones:
                t, s = w.x[i, 1] + step * w.dx[i, 1], w.x[i, 2] + step * w.dx[i, 2]
                good &= n * n - t * t - s * s > 0.0
        if good:
            break
        step *= 0.7
    return step if step == 1.0 else 0.9 * step


@njit
def limit_in_azimuth(m: Mechanism, count: int, more: int, travel: Array, azimuth: float, friction: float, w: Work) -> float:
    """Return the turn of gravity in one azimuth at which no forces hold the rover, rad.

    With gravity's horizontal part s, the balance is linear in forces and s; the largest s is found by a barrier method. NaN
    if it is not found.

    Args:
        m: filled by `assemble`, with `count` wheels in contact and `more` rows of `extra`.
        travel: (3, 9) velocity of the centre of mass for each generalized velocity.
        azimuth: rad.
        friction: friction coefficient.
        w: work arrays, `columns` as `set_columns` fills them; `x` is filled with the forces and `p` with the virtual motion.
    """
    rows = count + more + 1
    for k in range(EQUATIONS):
        w.b[k] = travel[2, k]
        w.d[k] = -(math.cos(azimuth) * travel[0, k] + math.sin(azimuth) * travel[1, k])
    w.b[EQUATIONS], w.d[EQUATIONS] = WEDGED, 0.0
    w.x[:] = 0.0
    for i in range(rows):
        w.x[i, 0] = 1.0 / count
    w.x[rows - 1, 0] = WEDGED - 1.0
    s, before, force = 0.0, 0.0, 1.0
    for _ in range(NEWTON_STEPS):
        new, decrement, residual = newton_step(count, rows, force, s, w)
        if math.isnan(decrement):
            return math.nan
        if decrement < 0.1 and residual < BALANCED:
            if rows / force < LAST_GAP:  # on the central path, the distance from the limit is proportional to 1 / force
                return math.atan(s + (s - before) / (GROWTH - 1.0))
            if s > STEEPEST:
                return 0.5 * math.pi
            before = s
            force *= GROWTH
            continue
        step = longest_step(count, rows, w)
        for i in range(rows):
            for c in range(3):
                w.x[i, c] += step * w.dx[i, c]
        s += step * (new - s)
    return math.nan


@njit
def climb(travel: Array, v: Array, way: Array) -> float:
    """Return the angle at which the centre of mass starts to climb in a motion, rad.

    Args:
        travel: as for `limit_in_azimuth`.
        v: (9,) the motion.
        way: (3,) filled with the velocity of the centre of mass.
    """
    for c in range(3):
        way[c] = 0.0
        for n in range(EQUATIONS):
            way[c] += travel[c, n] * v[n]
    size = math.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
    return math.asin(way[2] / size) if size > 0.0 else math.nan


@owning_njit
def hold_margin(
    m: Mechanism, count: int, more: int, travel: Array, friction: float, way: Array, stays: NDArray[np.bool_]
) -> tuple[float, bool]:
    """Find the least turn of gravity, in any azimuth, at which no forces hold the rover.

    Args:
        m: filled by `assemble`, with `count` wheels in contact and `more` rows of `extra`.
        travel: as for `limit_in_azimuth`.
        friction: friction coefficient.
        way: (3,) filled with the velocity of the centre of mass in the motion that then begins.
        stays: (6,) filled with True for wheels that stay in place in it.

    Returns:
        The angle, rad, 0 if no forces hold the rover as it stands, π/2 if it is not less, NaN if too few limits are found;
        True if no contact stays in place in that motion.
    """
    w, u, ue, move = new_work(), np.empty((6, 3)), np.empty(EXTRA), np.empty(3)
    set_columns(m, count, more, friction, w)
    best, found, slides = 0.5 * math.pi, 0.0, False
    stays[:] = False
    way[:] = 0.0
    first = math.atan2(m.axes[0, 1], m.axes[0, 0])
    start, turn, solved = 0, COARSE, 0
    while turn > FINE and best > 0.0 and (start <= AZIMUTHS or best < 0.5 * math.pi):
        # from evenly spaced azimuths towards the bounds found, then about the best one
        aside = turn if start % 2 == 0 else -turn
        azimuth = first + 2.0 * math.pi * start / AZIMUTHS if start < AZIMUTHS else found + aside
        improved, before = False, 0.5 * math.pi
        for _ in range(STEPS):
            angle = limit_in_azimuth(m, count, more, travel, azimuth, friction, w)
            solved += not math.isnan(angle)
            if not angle < before - PRECISION:
                break
            before = angle
            steepness = climb(travel, w.p, move)
            if angle < best:
                best, found, improved = max(angle, 0.0), azimuth, True
                way[:] = move
                stays[:] = False
                contact_velocities(m.columns, count, m.extra, more, w.p[:EQUATIONS], u, ue)
                size = math.sqrt(move[0] ** 2 + move[1] ** 2 + move[2] ** 2)
                slides = True
                for i in range(count):
                    still = math.sqrt(u[i, 0] ** 2 + u[i, 1] ** 2 + u[i, 2] ** 2) < STAYS * size
                    stays[m.who[i]] = still
                    slides &= not still
            if best == 0.0 or not steepness < angle - PRECISION or start >= AZIMUTHS:
                break
            azimuth = math.atan2(move[1], move[0])
        if start >= AZIMUTHS and not improved and start % 2 == 1:
            turn *= 0.4
        start += 1
    if solved < AZIMUTHS // 2:
        return math.nan, False
    return best, slides


@njit
def set_corners(point: Array, span: Array, corner: Array) -> None:
    """Fill the contact points of a pose, both ends of each contact line.

    Args:
        point: (6, 3) contact points, m; NaN where a wheel is off the ground.
        span: (6, 3) half of each contact line, m; 0: the contact is a point.
        corner: (12, 3) filled; NaN where there is no contact.
    """
    for i in range(6):
        long = span[i, 0] != 0.0 or span[i, 1] != 0.0
        for c in range(3):
            corner[i, c] = point[i, c] - (span[i, c] if long else 0.0)
            corner[i + 6, c] = point[i, c] + span[i, c] if long else math.nan


@njit
def force_angle(point: Array, cx: float, cy: float, cz: float) -> tuple[float, float]:
    """Return the force-angle measure and the energy margin of a rigid body of weight 1 N.

    Force-angle measure: Papadopoulos & Rey 1996, least over the edges of θ |d|, θ the angle between the weight and the normal
    from the edge to the centre of mass, d their distance. Energy margin: Messuri & Klein 1985, least height by
    which the centre of mass must rise to pass over an edge.

    Args:
        point: (n, 3) contact points, m; NaN where there is none.
        cx, cy, cz: centre of mass, m, in the same axes.

    Returns:
        rad m, m; both negative outside the support polygon; NaN with fewer than three contacts or all on a line.
    """
    least_angle, least_energy = math.inf, math.inf
    for i in range(len(point)):
        for j in range(len(point)):
            if i == j or math.isnan(point[i, 0]) or math.isnan(point[j, 0]):
                continue
            ex, ey, ez = point[j, 0] - point[i, 0], point[j, 1] - point[i, 1], point[j, 2] - point[i, 2]
            flat = math.hypot(ex, ey)
            if flat == 0.0:
                continue
            outer, inner = True, False
            for n in range(len(point)):
                if n != i and n != j and not math.isnan(point[n, 0]):
                    side = (ex * (point[n, 1] - point[i, 1]) - ey * (point[n, 0] - point[i, 0])) / flat
                    outer &= side >= -ON_EDGE
                    inner |= side > ON_EDGE
            if not (outer and inner):
                continue
            size = math.sqrt(ex * ex + ey * ey + ez * ez)
            ax, ay, az = ex / size, ey / size, ez / size
            rx, ry, rz = cx - point[i, 0], cy - point[i, 1], cz - point[i, 2]
            along = rx * ax + ry * ay + rz * az
            rx, ry, rz = rx - along * ax, ry - along * ay, rz - along * az  # from the edge to the centre of mass, across it
            radius = math.sqrt(rx * rx + ry * ry + rz * rz)
            ux, uy, uz = -az * ax, -az * ay, 1.0 - az * az  # up, across the edge
            up = math.sqrt(ux * ux + uy * uy + uz * uz)
            ux, uy, uz = ux / up, uy / up, uz / up
            inward = (ex * ry - ey * rx) / flat
            cosine = max(-1.0, min(1.0, (rx * ux + ry * uy + rz * uz) / radius))
            theta = math.copysign(math.acos(cosine), inward)
            least_angle = min(least_angle, theta * radius * math.sqrt(1.0 - cosine * cosine) * up)
            least_energy = min(least_energy, math.copysign(radius * up * (1.0 - cosine), inward))
    if least_angle == math.inf:
        return math.nan, math.nan
    return least_angle, least_energy
