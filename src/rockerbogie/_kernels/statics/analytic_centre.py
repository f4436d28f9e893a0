"""Analytic centre of the forces that balance in their friction cones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from .balance import EQUATIONS
from .cones import add_cone, inside
from .least_norm import factor, solve_factored

Array = NDArray[np.float64]

ITERATIONS = 40
BALANCED = 1e-12  # of the weight: residual of forces that count as balanced
DECREMENT = 0.5  # Newton decrement at which centring ends
SPREAD = 1e4  # of the weight: forces beyond it wedge the rover between its contacts, and have no centre
CENTRED, WEDGED, NO_CENTRE = range(3)


@owning_njit
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
