"""Forces of the least weighted sum of squares, and Cholesky factors."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .balance import EQUATIONS

Array = NDArray[np.float64]


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


@owning_njit
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


@owning_njit
def balance_exactly(columns: Array, count: int, extra: Array, more: int, b: Array, f: Array, y: Array) -> None:
    """Remove what rounding has left unbalanced, by the least relative change of the forces.

    Args:
        columns, count, extra, more, b: as for `least_norm`.
        f, y: (6, 3), (m,) forces, changed.
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
