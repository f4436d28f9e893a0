"""Friction cones: membership, contact velocities, products with barriers and scalings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from .balance import EQUATIONS

Array = NDArray[np.float64]


@njit
def inside(mu: float, count: int, f: Array, more: int, y: Array) -> bool:
    """Return True if all forces lie inside their friction cones.

    The velocities of contacts lie inside the dual cones, u_n > μ |u_t|, if they lie inside the friction cones of 1 / μ.

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
def add_cone(columns: Array, h: Array, mu: float, g: Array, m: Array) -> None:
    """Add A H Aᵀ of one cone to the lower triangle of a matrix.

    Args:
        columns: (3, 9) generalized forces of unit contact forces, the rows of Aᵀ but for μ.
        h: (3, 3) H.
        mu: friction coefficient.
        g: (3, 9) filled with H Aᵀ.
        m: (9, 9) the matrix; changed.
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
        w, beta, x, out: as for `scale_cone`; out is filled.
    """
    dot = w[1] * x[1] + w[2] * x[2]
    part = -x[0] + dot / (1.0 + w[0])
    out[0] = (w[0] * x[0] - dot) / beta
    out[1] = (x[1] + part * w[1]) / beta
    out[2] = (x[2] + part * w[2]) / beta
