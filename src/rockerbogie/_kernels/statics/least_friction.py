"""The least friction coefficient that holds a pose, by a primal-dual interior-point method.

    least μ   such that   Σ (n a_n + t a_t + s a_s) + Σ y e = b,   n μ ≥ |(t, s)|,   n, y ≥ 0

with (n, t, s) the contact force of each wheel and y the forces at joint limits and under the body. For a fixed μ the
constraints are second-order cones; in μ the problem is quasi-convex, so a point where the optimality conditions hold is the
minimum. With x = (n, t/μ, s/μ) and z = (u_n, μ u_t, μ u_s), u the velocities of the contacts in a virtual motion v of the
mechanism, these conditions are: balance; x and z in the cone t² + s² ≤ n²; x·z = 0; and Σ u_t·(t, s)/μ = -1, which
fixes the size of v. The virtual motion is the proof of the minimum: docs/forces.md.

The iteration starts from the analytic centre of the forces that hold at a larger μ, which lies on the central path, and
takes Mehrotra's predictor and corrector with Nesterov-Todd scaling. The forces balance exactly throughout, so the
friction coefficient they use bounds the minimum from above.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from .balance import EQUATIONS

Array = NDArray[np.float64]

GAP = 1e-9  # largest power x·z at the end: the error of μ is about this
ITERATIONS = 40
ROUNDS = 20
LEAST_GAP = 2e-8  # the least distance from the minimum at which a proof is tried
LAWSON_ROUNDS = 7
THIN = 0.03  # scale of tangential forces against normal ones in these rounds
LIGHT = 0.03  # of the weight: normal forces below it count as this
LEAST_SHARE = 1e-4
BALANCED = 1e-12  # of the weight: residual of forces that count as balanced
DECREMENT = 0.5  # Newton decrement at which centring ends
START = 0.5  # friction coefficient tried first where the rounds give none
WIDEST = 64.0  # friction coefficients above it do not count
SPREAD = 1e4  # of the weight: forces beyond it wedge the rover between its contacts, and have no centre
HELD, UNHELD, UNFINISHED, OFF_PATH = range(4)
CENTRED, WEDGED, NO_CENTRE = range(3)


@njit
def factor(a: Array, n: int) -> bool:
    """Replace the lower triangle of a symmetric matrix by its Cholesky factor.

    Args:
        a: (n, n), changed.
        n: size.

    Returns:
        False if the matrix is not positive definite.
    """
    for j in range(n):
        d = a[j, j]
        for k in range(j):
            d -= a[j, k] * a[j, k]
        if not d > 0.0:
            return False
        d = math.sqrt(d)
        a[j, j] = d
        for i in range(j + 1, n):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            a[i, j] = s / d
    return True


@njit
def solve_factored(a: Array, n: int, x: Array) -> None:
    """Solve L Lᵀ y = x.

    Args:
        a: (n, n) with L as its lower triangle.
        n: size.
        x: (n,) replaced by the solution.
    """
    for i in range(n):
        s = x[i]
        for k in range(i):
            s -= a[i, k] * x[k]
        x[i] = s / a[i, i]
    for i in range(n - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, n):
            s -= a[k, i] * x[k]
        x[i] = s / a[i, i]


@njit
def least_norm(
    columns: Array, count: int, extra: Array, more: int, b: Array, weight: Array, extra_weight: Array, f: Array, y: Array
) -> bool:
    """Fill the forces that balance b with the least sum of (force / weight)².

    Args:
        columns: (6, 3, 9) generalized forces of unit contact forces of `count` wheels.
        extra: (m, 9) generalized forces of unit forces at joint limits and under the body, of which `more` are used.
        b: (9,) generalized force to balance.
        weight: (6, 2) weights of the normal and of the tangential forces at each wheel.
        extra_weight: (m,) weights of the forces `extra`.
        f, y: (6, 3), (m,) filled.

    Returns:
        True if the balance can be met.
    """
    m = np.zeros((EQUATIONS, EQUATIONS))
    for i in range(count):
        for c in range(3):
            w = weight[i, min(c, 1)] ** 2
            for k in range(EQUATIONS):
                part = w * columns[i, c, k]
                for j in range(k + 1):
                    m[k, j] += part * columns[i, c, j]
    for e in range(more):
        for k in range(EQUATIONS):
            part = extra_weight[e] ** 2 * extra[e, k]
            for j in range(k + 1):
                m[k, j] += part * extra[e, j]
    if not factor(m, EQUATIONS):
        return False
    p = b.copy()
    solve_factored(m, EQUATIONS, p)
    for i in range(count):
        for c in range(3):
            s = 0.0
            for k in range(EQUATIONS):
                s += columns[i, c, k] * p[k]
            f[i, c] = s * weight[i, min(c, 1)] ** 2
    for e in range(more):
        s = 0.0
        for k in range(EQUATIONS):
            s += extra[e, k] * p[k]
        y[e] = s * extra_weight[e] ** 2
    return True


@njit
def even_friction(columns: Array, count: int, extra: Array, more: int, b: Array, f: Array, y: Array) -> float:
    """Fill forces that balance b with about the least friction, by reweighted least squares.

    Lawson's method: each round minimizes Σ λ (t² + s²) / n², with n from the round before, and multiplies the weights λ by the
    friction used.

    Args:
        columns, count, extra, more, b: as for `least_norm`.
        f, y: (6, 3), (m,) filled with the best forces found.

    Returns:
        The friction coefficient that they use; inf if every round has forces that pull.
    """
    least = math.inf
    share, load = np.full(6, 1.0 / count), np.full(6, 1.0 / count)
    weight, one = np.ones((6, 2)), np.ones(more)
    trial, trial_y = np.zeros((6, 3)), np.zeros(more)
    for _ in range(LAWSON_ROUNDS):
        for i in range(count):
            weight[i, 1] = THIN * load[i] / math.sqrt(count * share[i])
        if not least_norm(columns, count, extra, more, b, weight, one, trial, trial_y):
            break
        pulls, total, most = False, 0.0, 0.0
        for i in range(count):
            n = trial[i, 0]
            pulls |= not n > 0.0
            load[i] = max(n, LIGHT)
            used = math.sqrt(trial[i, 1] ** 2 + trial[i, 2] ** 2) / load[i]
            most = max(most, used)
            share[i] *= used
            total += share[i]
        for e in range(more):
            pulls |= not trial_y[e] > 0.0
        if not pulls and most < least:
            least = most
            f[:], y[:more] = trial, trial_y
        for i in range(count):
            share[i] = max(share[i] / total, LEAST_SHARE)
    return least


@njit
def inside(mu: float, count: int, f: Array, more: int, y: Array) -> bool:
    """Return True if all forces lie inside their friction cones.

    Args:
        mu: friction coefficient.
        count, more: numbers of rows of f and y in use.
        f, y: (6, 3), (m,) forces.
    """
    for i in range(count):
        n, t, s = f[i, 0], f[i, 1], f[i, 2]
        if not (n > 0.0 and mu * n * mu * n - t * t - s * s > 0.0):
            return False
    good = True
    for e in range(more):
        good &= y[e] > 0.0
    return good


@njit
def inside_dual(mu: float, count: int, u: Array, more: int, ue: Array) -> bool:
    """Return True if every contact separates steeply enough for the dual cone.

    Args:
        mu: friction coefficient.
        count, more: numbers of rows of u and ue in use.
        u, ue: (6, 3), (m,) velocities.
    """
    for i in range(count):
        n, t, s = u[i, 0], u[i, 1], u[i, 2]
        if not (n > 0.0 and n * n - mu * mu * (t * t + s * s) > 0.0):
            return False
    good = True
    for e in range(more):
        good &= ue[e] > 0.0
    return good


@njit
def contact_velocities(columns: Array, count: int, extra: Array, more: int, v: Array, u: Array, ue: Array) -> None:
    """Fill the velocities of contacts and joint limits in a motion.

    Args:
        columns, count, extra, more: as for `least_norm`.
        v: (9,) the motion.
        u, ue: (6, 3), (m,) filled.
    """
    for i in range(count):
        for c in range(3):
            s = 0.0
            for k in range(EQUATIONS):
                s += columns[i, c, k] * v[k]
            u[i, c] = s
    for e in range(more):
        s = 0.0
        for k in range(EQUATIONS):
            s += extra[e, k] * v[k]
        ue[e] = s


@njit
def centre(columns: Array, count: int, extra: Array, more: int, b: Array, mu: float, f: Array, y: Array, v: Array) -> int:
    """Move the forces to the analytic centre of those that balance b in their cones.

    Args:
        columns, count, extra, more, b: as for `least_norm`.
        mu: friction coefficient.
        f, y: (6, 3), (m,) forces inside their cones, replaced; they need not balance b yet.
        v: (9,) filled with the multipliers: the virtual motion whose contact velocities are the barrier's gradient.

    Returns:
        CENTRED, WEDGED if the forces grow beyond all bounds, NO_CENTRE.
    """
    m, p = np.empty((EQUATIONS, EQUATIONS)), np.empty(EQUATIONS)
    h = np.empty((6, 3, 3))
    g = np.empty((3, EQUATIONS))
    x, z, dx = np.empty((6, 3)), np.empty((6, 3)), np.empty((6, 3))
    dy = np.empty(more)
    trial, trial_y = np.empty((6, 3)), np.empty(more)
    for _ in range(ITERATIONS):
        m[:] = 0.0
        for k in range(EQUATIONS):
            p[k] = -b[k]
        for i in range(count):
            x[i, 0], x[i, 1], x[i, 2] = f[i, 0], f[i, 1] / mu, f[i, 2] / mu
            det = x[i, 0] * x[i, 0] - x[i, 1] * x[i, 1] - x[i, 2] * x[i, 2]
            for r in range(3):
                for c in range(3):
                    h[i, r, c] = 2.0 * x[i, r] * x[i, c]
            h[i, 0, 0] -= det
            h[i, 1, 1] += det
            h[i, 2, 2] += det
            add_cone(columns[i], h[i], mu, g, m)
            for k in range(EQUATIONS):
                s = x[i, 0] * columns[i, 0, k] + mu * (x[i, 1] * columns[i, 1, k] + x[i, 2] * columns[i, 2, k])
                p[k] += 2.0 * s
        for e in range(more):
            for k in range(EQUATIONS):
                p[k] += 2.0 * y[e] * extra[e, k]
                for j in range(k + 1):
                    m[k, j] += y[e] * y[e] * extra[e, k] * extra[e, j]
        residual = 0.0
        for k in range(EQUATIONS):
            residual = max(residual, abs(0.5 * (p[k] - b[k])))
        if not factor(m, EQUATIONS):
            return NO_CENTRE
        solve_factored(m, EQUATIONS, p)
        decrement = 0.0
        good = True
        for i in range(count):
            for c in range(3):
                s = 0.0
                for k in range(EQUATIONS):
                    s += columns[i, c, k] * p[k]
                z[i, c] = s if c == 0 else mu * s
            det = x[i, 0] * x[i, 0] - x[i, 1] * x[i, 1] - x[i, 2] * x[i, 2]
            for r in range(3):
                dx[i, r] = x[i, r] - (h[i, r, 0] * z[i, 0] + h[i, r, 1] * z[i, 1] + h[i, r, 2] * z[i, 2])
            # |dx|² in the barrier's metric: (2 (x·J dx)² / det - dx·J dx) / det
            xd = x[i, 0] * dx[i, 0] - x[i, 1] * dx[i, 1] - x[i, 2] * dx[i, 2]
            dd = dx[i, 0] * dx[i, 0] - dx[i, 1] * dx[i, 1] - dx[i, 2] * dx[i, 2]
            decrement += (2.0 * xd * xd / det - dd) / det
            good &= z[i, 0] > 0.0 and z[i, 0] * z[i, 0] - z[i, 1] * z[i, 1] - z[i, 2] * z[i, 2] > 0.0
        for e in range(more):
            s = 0.0
            for k in range(EQUATIONS):
                s += extra[e, k] * p[k]
            dy[e] = y[e] - y[e] * y[e] * s
            decrement += (dy[e] / y[e]) ** 2
            good &= s > 0.0
        if residual < BALANCED and good and decrement < DECREMENT * DECREMENT:
            v[:] = p
            return CENTRED
        step = 1.0
        while step > 1e-8:
            for i in range(count):
                trial[i, 0] = f[i, 0] + step * dx[i, 0]
                trial[i, 1], trial[i, 2] = f[i, 1] + step * mu * dx[i, 1], f[i, 2] + step * mu * dx[i, 2]
            for e in range(more):
                trial_y[e] = y[e] + step * dy[e]
            if inside(mu, count, trial, more, trial_y):
                break
            step *= 0.7
        if step < 1.0:
            step *= 0.9
        if step < 1e-6:
            return NO_CENTRE
        for i in range(count):
            f[i, 0] += step * dx[i, 0]
            f[i, 1] += step * mu * dx[i, 1]
            f[i, 2] += step * mu * dx[i, 2]
        for e in range(more):
            y[e] += step * dy[e]
        if f[0, 0] + f[1, 0] + f[2, 0] > SPREAD:
            return WEDGED
    return NO_CENTRE


@njit
def add_cone(columns: Array, h: Array, mu: float, g: Array, m: Array) -> None:
    """Add A H Aᵀ of one cone to the lower triangle of a matrix.

    Args:
        columns: (3, 9) generalized forces of unit contact forces, the rows of Aᵀ but for μ.
        h: (3, 3) H.
        mu: friction coefficient.
        g: (3, 9) filled with H Aᵀ.
        m: (9, 9) the matrix.
    """
    for k in range(EQUATIONS):
        a0, a1, a2 = columns[0, k], mu * columns[1, k], mu * columns[2, k]
        g[0, k] = h[0, 0] * a0 + h[0, 1] * a1 + h[0, 2] * a2
        g[1, k] = h[1, 0] * a0 + h[1, 1] * a1 + h[1, 2] * a2
        g[2, k] = h[2, 0] * a0 + h[2, 1] * a1 + h[2, 2] * a2
    for k in range(EQUATIONS):
        a0, a1, a2 = columns[0, k], mu * columns[1, k], mu * columns[2, k]
        for j in range(k + 1):
            m[k, j] += a0 * g[0, j] + a1 * g[1, j] + a2 * g[2, j]


@njit
def least_friction(
    columns: Array, count: int, extra: Array, more: int, b: Array, f: Array, y: Array, v: Array
) -> tuple[float, int, int]:
    """Find the forces that need the least friction.

    Args:
        columns: (6, 3, 9) generalized forces of unit contact forces (normal, traction, side) of the first `count` wheels.
        extra: (m, 9) generalized forces of unit forces at joint limits and under the body, of which `more` are used.
        b: (9,) generalized force to balance, of size about 1.
        f, y: (6, 3), (m,) filled with the forces, in the units of b.
        v: (9,) filled with the virtual motion that proves the minimum.

    Returns:
        The friction coefficient; HELD, UNHELD if no coefficient up to WIDEST holds, or UNFINISHED; iterations used.
    """
    used = even_friction(columns, count, extra, more, b, f, y)
    low, high, total = 0.0, WIDEST, 0  # no centre was found at low; from high the path was lost
    mu = used + 0.1 * (used + 0.02)
    even = used == math.inf
    if even:
        mu = START
    for _ in range(ROUNDS):
        if even:
            f[:] = y[:] = 1.0 / count
            f[:, 1:] = 0.0
        outcome = centre(columns, count, extra, more, b, mu, f, y, v)
        if outcome != NO_CENTRE:
            high = mu
        if outcome == CENTRED:
            mu, code, iterations = follow_path(columns, count, extra, more, b, mu, f, y, v)
            total += iterations
            if code != OFF_PATH:
                balance_exactly(columns, count, extra, more, b, f, y)
                return mu, code, total
        elif outcome == NO_CENTRE:
            if not even:
                even = True
                continue
            low = mu
        even = True
        mu = 2.0 * low if high == WIDEST and low > 0.0 else low + 0.6 * (high - low)
        if mu > WIDEST:
            return math.inf, UNHELD, total
    return mu, UNFINISHED, total


@njit
def balance_exactly(columns: Array, count: int, extra: Array, more: int, b: Array, f: Array, y: Array) -> None:
    """Remove what rounding has left unbalanced, by the least relative change of the forces.

    Args:
        columns, count, extra, more, b: as for `least_norm`.
        f, y: (6, 3), (m,) forces, corrected.
    """
    short, change, change_y = np.empty(EQUATIONS), np.zeros((6, 3)), np.zeros(more)
    weight = np.zeros((6, 2))
    for i in range(count):
        weight[i] = f[i, 0]
    unbalanced(columns, count, extra, more, b, f, y, short)
    if least_norm(columns, count, extra, more, short, weight, y, change, change_y):
        for i in range(count):
            for c in range(3):
                f[i, c] += change[i, c]
        for e in range(more):
            y[e] += change_y[e]


@njit
def friction_used(count: int, f: Array) -> float:
    """Return the largest ratio of tangential to normal force.

    Args:
        count: number of rows of f in use.
        f: (6, 3) forces.
    """
    used = 0.0
    for i in range(count):
        used = max(used, math.sqrt(f[i, 1] ** 2 + f[i, 2] ** 2) / f[i, 0])
    return used


@njit
def follow_path(
    columns: Array, count: int, extra: Array, more: int, b: Array, mu: float, f: Array, y: Array, v: Array
) -> tuple[float, int, int]:
    """Follow the central path from an analytic centre to the least friction coefficient.

    Args:
        columns, count, extra, more, b: as for `least_friction`.
        mu: friction coefficient at the centre.
        f, y, v: forces at the centre and their multipliers, replaced.

    Returns:
        As `least_friction`.
    """
    x, z = np.empty((6, 3)), np.empty((6, 3))
    u, ue = np.empty((6, 3)), np.empty(more)
    h, w = np.empty((6, 3, 3)), np.empty((6, 3))
    beta = np.empty(6)
    lam = np.empty((6, 3))
    g = np.empty((6, 3, EQUATIONS))
    m = np.empty((EQUATIONS, EQUATIONS))
    e, v_p, v_e, dv = np.empty(EQUATIONS), np.empty(EQUATIONS), np.empty(EQUATIONS), np.empty(EQUATIONS)
    r, dx, dz = np.empty((6, 3)), np.empty((6, 3)), np.empty((6, 3))
    ry, dy, dze = np.empty(more), np.empty(more), np.empty(more)
    du, due = np.empty((6, 3)), np.empty(more)
    tf, ty, tu, tue = np.empty((6, 3)), np.empty(more), np.empty((6, 3)), np.empty(more)
    a, c, short = np.empty(3), np.empty(3), np.empty(EQUATIONS)
    cones = count + more + 1
    contact_velocities(columns, count, extra, more, v, u, ue)
    size = 0.0
    for i in range(count):
        size -= (u[i, 1] * f[i, 1] + u[i, 2] * f[i, 2]) / mu
    size = 1.0 / (size + 1.0 / mu)
    price = size / mu  # multiplier of μ >= 0
    for k in range(EQUATIONS):
        v[k] *= size
    for iteration in range(ITERATIONS):
        contact_velocities(columns, count, extra, more, v, u, ue)
        power, left = mu * price, price - 1.0
        unbalanced(columns, count, extra, more, b, f, y, short)
        for i in range(count):
            x[i, 0], x[i, 1], x[i, 2] = f[i, 0], f[i, 1] / mu, f[i, 2] / mu
            z[i, 0], z[i, 1], z[i, 2] = u[i, 0], mu * u[i, 1], mu * u[i, 2]
            power += x[i, 0] * z[i, 0] + x[i, 1] * z[i, 1] + x[i, 2] * z[i, 2]
            left -= u[i, 1] * x[i, 1] + u[i, 2] * x[i, 2]
        for k in range(more):
            power += y[k] * ue[k]
        if power < GAP:
            return mu, HELD, iteration
        m[:] = 0.0
        e[:] = 0.0
        d = 0.0
        for i in range(count):
            dx_ = math.sqrt(max(x[i, 0] ** 2 - x[i, 1] ** 2 - x[i, 2] ** 2, 1e-300))
            dz_ = math.sqrt(max(z[i, 0] ** 2 - z[i, 1] ** 2 - z[i, 2] ** 2, 1e-300))
            dot = (x[i, 0] * z[i, 0] + x[i, 1] * z[i, 1] + x[i, 2] * z[i, 2]) / (dx_ * dz_)
            gamma = 1.0 / math.sqrt(2.0 * (1.0 + dot))
            w0 = gamma * (x[i, 0] / dx_ + z[i, 0] / dz_)
            w1 = gamma * (x[i, 1] / dx_ - z[i, 1] / dz_)
            w2 = gamma * (x[i, 2] / dx_ - z[i, 2] / dz_)
            w[i, 0], w[i, 1], w[i, 2] = w0, w1, w2
            b2 = dx_ / dz_
            beta[i] = math.sqrt(b2)
            h[i, 0, 0], h[i, 0, 1], h[i, 0, 2] = b2 * (2.0 * w0 * w0 - 1.0), 2.0 * b2 * w0 * w1, 2.0 * b2 * w0 * w2
            h[i, 1, 0], h[i, 1, 1], h[i, 1, 2] = h[i, 0, 1], b2 * (2.0 * w1 * w1 + 1.0), 2.0 * b2 * w1 * w2
            h[i, 2, 0], h[i, 2, 1], h[i, 2, 2] = h[i, 0, 2], h[i, 1, 2], b2 * (2.0 * w2 * w2 + 1.0)
            add_cone(columns[i], h[i], mu, g[i], m)
            h1 = h[i, 0, 1] * u[i, 1] + h[i, 0, 2] * u[i, 2]
            h2 = h[i, 1, 1] * u[i, 1] + h[i, 1, 2] * u[i, 2]
            h3 = h[i, 2, 1] * u[i, 1] + h[i, 2, 2] * u[i, 2]
            d += u[i, 1] * h2 + u[i, 2] * h3
            for k in range(EQUATIONS):
                e[k] += columns[i, 1, k] * x[i, 1] + columns[i, 2, k] * x[i, 2]
                e[k] -= columns[i, 0, k] * h1 + mu * (columns[i, 1, k] * h2 + columns[i, 2, k] * h3)
            scale_cone(w[i], beta[i], z[i], lam[i])
        for q in range(more):
            for k in range(EQUATIONS):
                for j in range(k + 1):
                    m[k, j] += y[q] / ue[q] * extra[q, k] * extra[q, j]
        if not factor(m, EQUATIONS):
            return mu, HELD if power < 1e-6 else UNFINISHED, iteration
        v_e[:] = e
        solve_factored(m, EQUATIONS, v_e)
        curvature = price / mu - d
        for k in range(EQUATIONS):
            curvature += e[k] * v_e[k]
        if not curvature > 0.0:
            return mu, OFF_PATH, iteration
        tau = power / cones
        sigma, step, dmu, dprice = 0.0, 1.0, 0.0, 0.0
        for phase in range(2):
            for i in range(count):
                if phase == 0:
                    r[i, 0], r[i, 1], r[i, 2] = -x[i, 0], -x[i, 1], -x[i, 2]
                else:
                    unscale_cone(w[i], beta[i], dx[i], a)
                    scale_cone(w[i], beta[i], dz[i], c)
                    s2 = step * step
                    l0, l1, l2 = lam[i, 0], lam[i, 1], lam[i, 2]
                    k0 = sigma * tau - (l0 * l0 + l1 * l1 + l2 * l2) - s2 * (a[0] * c[0] + a[1] * c[1] + a[2] * c[2])
                    k1 = -2.0 * l0 * l1 - s2 * (a[0] * c[1] + c[0] * a[1])
                    k2 = -2.0 * l0 * l2 - s2 * (a[0] * c[2] + c[0] * a[2])
                    det = l0 * l0 - l1 * l1 - l2 * l2
                    c[0] = (l0 * k0 - l1 * k1 - l2 * k2) / det
                    c[1] = (k1 - c[0] * l1) / l0
                    c[2] = (k2 - c[0] * l2) / l0
                    scale_cone(w[i], beta[i], c, r[i])
            for q in range(more):
                ry[q] = -y[q] if phase == 0 else (sigma * tau - step * step * dy[q] * dze[q]) / ue[q] - y[q]
            back = -price if phase == 0 else (sigma * tau - step * step * dmu * dprice) / mu - price
            rest = left * (1.0 - sigma) + back
            for k in range(EQUATIONS):
                v_p[k] = -short[k]
            for i in range(count):
                rest -= u[i, 1] * r[i, 1] + u[i, 2] * r[i, 2]
                for k in range(EQUATIONS):
                    v_p[k] += columns[i, 0, k] * r[i, 0] + mu * (columns[i, 1, k] * r[i, 1] + columns[i, 2, k] * r[i, 2])
            for q in range(more):
                for k in range(EQUATIONS):
                    v_p[k] += extra[q, k] * ry[q]
            solve_factored(m, EQUATIONS, v_p)
            dot = 0.0
            for k in range(EQUATIONS):
                dot += e[k] * v_p[k]
            dmu = (rest - dot) / curvature
            dprice = back - price / mu * dmu
            for k in range(EQUATIONS):
                dv[k] = v_p[k] + v_e[k] * dmu
            contact_velocities(columns, count, extra, more, dv, du, due)
            for i in range(count):
                dz[i, 0] = du[i, 0]
                dz[i, 1], dz[i, 2] = mu * du[i, 1] + u[i, 1] * dmu, mu * du[i, 2] + u[i, 2] * dmu
                for k in range(3):
                    dx[i, k] = r[i, k] - h[i, k, 0] * dz[i, 0] - h[i, k, 1] * dz[i, 1] - h[i, k, 2] * dz[i, 2]
            for q in range(more):
                dze[q] = due[q]
                dy[q] = ry[q] - y[q] / ue[q] * due[q]
            step = 1.0
            while step > 1e-10:
                new = mu + step * dmu
                if new > 0.0 and price + step * dprice > 0.0:
                    for i in range(count):
                        tf[i, 0] = f[i, 0] + step * dx[i, 0]
                        tf[i, 1] = f[i, 1] + step * (mu * dx[i, 1] + x[i, 1] * dmu)
                        tf[i, 2] = f[i, 2] + step * (mu * dx[i, 2] + x[i, 2] * dmu)
                        for k in range(3):
                            tu[i, k] = u[i, k] + step * du[i, k]
                    for q in range(more):
                        ty[q], tue[q] = y[q] + step * dy[q], ue[q] + step * due[q]
                    if inside(new, count, tf, more, ty) and inside_dual(new, count, tu, more, tue):
                        break
                step *= 0.9
            sigma = (1.0 - step) ** 3
        if step < 1.0:
            step *= 0.98
        if step < 1e-4:
            return mu, HELD if power < 1e-6 else OFF_PATH, iteration
        for i in range(count):
            f[i, 0] += step * dx[i, 0]
            f[i, 1] += step * (mu * dx[i, 1] + x[i, 1] * dmu)
            f[i, 2] += step * (mu * dx[i, 2] + x[i, 2] * dmu)
        for q in range(more):
            y[q] += step * dy[q]
        for k in range(EQUATIONS):
            v[k] += step * dv[k]
        mu += step * dmu
        price += step * dprice
    return mu, OFF_PATH, ITERATIONS


@njit
def unbalanced(columns: Array, count: int, extra: Array, more: int, b: Array, f: Array, y: Array, short: Array) -> None:
    """Fill the residual of the balance.

    Args:
        columns, count, extra, more, b: as for `least_norm`.
        f, y: (6, 3), (m,) forces.
        short: (9,) filled.
    """
    for k in range(EQUATIONS):
        short[k] = b[k]
        for i in range(count):
            for c in range(3):
                short[k] -= columns[i, c, k] * f[i, c]
        for e in range(more):
            short[k] -= extra[e, k] * y[e]


@njit
def scale_cone(w: Array, beta: float, x: Array, out: Array) -> None:
    """Fill the product of a Nesterov-Todd scaling with a vector.

    Args:
        w, beta: (3,) point and size of the scaling.
        x: (3,) the vector.
        out: (3,) filled.
    """
    dot = w[1] * x[1] + w[2] * x[2]
    part = x[0] + dot / (1.0 + w[0])
    out[0] = beta * (w[0] * x[0] + dot)
    out[1] = beta * (x[1] + part * w[1])
    out[2] = beta * (x[2] + part * w[2])


@njit
def unscale_cone(w: Array, beta: float, x: Array, out: Array) -> None:
    """Fill the product of an inverse Nesterov-Todd scaling with a vector.

    Args:
        w, beta, x, out: as for `scale_cone`.
    """
    dot = w[1] * x[1] + w[2] * x[2]
    part = -x[0] + dot / (1.0 + w[0])
    out[0] = (w[0] * x[0] - dot) / beta
    out[1] = (x[1] + part * w[1]) / beta
    out[2] = (x[2] + part * w[2]) / beta


@njit
def lower_bound(columns: Array, count: int, extra: Array, more: int, b: Array, mu: float, v: Array) -> float:
    """Return a friction coefficient proved too small, just below a minimum found.

    A virtual motion v proves that μ does not hold the pose if every contact separates with u_n > μ |u_t|, no limit is
    violated and gravity does work (v·b < 0): no force within the friction cones can then take up that work.

    Args:
        columns, count, extra, more, b: as for `least_friction`.
        mu: the minimum found.
        v: (9,) its virtual motion; replaced by the proof.

    Returns:
        The largest coefficient for which a proof was found, of `mu` less LEAST_GAP, 4 LEAST_GAP ...; 0 if there is none.
    """
    u, ue = np.empty((6, 3)), np.empty(more)
    m, w, proof = np.empty((EQUATIONS, EQUATIONS)), np.empty(EQUATIONS), np.empty(EQUATIONS)
    work = 0.0
    for k in range(EQUATIONS):
        work += v[k] * b[k]
    below = LEAST_GAP
    while below < mu:
        low = mu - below
        below *= 4.0
        contact_velocities(columns, count, extra, more, v, u, ue)
        if not inside_dual(low, count, u, more, ue):
            continue
        if work < 0.0:
            return low
        m[:] = 0.0  # the shift w that costs the contacts least of what they can spare, with w·b = 1
        for i in range(count):
            spare = u[i, 0] - low * math.sqrt(u[i, 1] ** 2 + u[i, 2] ** 2)
            for c in range(3):
                for k in range(EQUATIONS):
                    part = columns[i, c, k] * (mu / spare) ** 2
                    for j in range(k + 1):
                        m[k, j] += part * columns[i, c, j]
        for e in range(more):
            for k in range(EQUATIONS):
                part = extra[e, k] * (mu / ue[e]) ** 2
                for j in range(k + 1):
                    m[k, j] += part * extra[e, j]
        if not factor(m, EQUATIONS):
            continue
        w[:] = b
        solve_factored(m, EQUATIONS, w)
        size = 0.0
        for k in range(EQUATIONS):
            size += w[k] * b[k]
        shifted = 0.0
        for k in range(EQUATIONS):
            proof[k] = v[k] - 1.5 * work / size * w[k]
            shifted += proof[k] * b[k]
        contact_velocities(columns, count, extra, more, proof, u, ue)
        if shifted < 0.0 and inside_dual(low, count, u, more, ue):
            v[:] = proof
            return low
    return 0.0
