"""Central path from an analytic centre to the least friction coefficient."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from .balance import EQUATIONS
from .cones import add_cone, contact_velocities, inside, scale_cone, unscale_cone
from .least_norm import factor, solve_factored, unbalanced

Array = NDArray[np.float64]

GAP = 1e-9  # largest power x·z at the end: the error of μ is about this
ITERATIONS = 40
HELD, UNHELD, UNFINISHED, OFF_PATH = range(4)


@owning_njit
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
                    if inside(new, count, tf, more, ty) and inside(1.0 / new, count, tu, more, tue):
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
