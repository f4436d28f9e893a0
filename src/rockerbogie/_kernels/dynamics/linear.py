"""Small systems of linear equations by LU decomposition with row pivoting."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined

Array = NDArray[np.float64]


@inlined
def copy_numbers(source: Array, target: Array) -> None:
    """Copy the numbers of one array to another that does not overlap it.

    Args:
        source: (n,).
        target: (n,) filled.
    """
    for k in range(target.shape[0]):
        target[k] = source[k]


@fma_njit
def decompose(a: Array, order: NDArray[np.int64]) -> bool:
    """Decompose a square matrix into triangular factors, in place.

    Args:
        a: (n, n) matrix; replaced by its factors.
        order: (n,) filled with the row exchanged with each row.

    Returns:
        False if the matrix is singular to rounding, or not finite.
    """
    n = a.shape[0]
    for k in range(n):
        p, big = k, abs(a[k, k])
        for i in range(k + 1, n):
            if abs(a[i, k]) > big:
                p, big = i, abs(a[i, k])
        order[k] = p
        if not 1e-300 < big < math.inf:
            return False
        if p != k:
            for j in range(n):
                a[k, j], a[p, j] = a[p, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            factor = a[i, k] * inverse
            a[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
    return True


@fma_njit
def solve(a: Array, order: NDArray[np.int64], b: Array) -> None:
    """Solve a x = b with the factors of a.

    Args:
        a, order: of `decompose`.
        b: (n,) right side; replaced by x.
    """
    n = a.shape[0]
    for k in range(n):
        p = order[k]
        if p != k:
            b[k], b[p] = b[p], b[k]
        for j in range(k):
            b[k] -= a[k, j] * b[j]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= a[k, j] * b[j]
        b[k] /= a[k, k]


@fma_njit
def solve_transposed(a: Array, order: NDArray[np.int64], b: Array) -> None:
    """Solve aᵀ x = b with the factors of a.

    Args:
        a, order: of `decompose`.
        b: (n,) right side; replaced by x.
    """
    n = a.shape[0]
    for k in range(n):
        for j in range(k):
            b[k] -= a[j, k] * b[j]
        b[k] /= a[k, k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= a[j, k] * b[j]
    for k in range(n - 1, -1, -1):
        p = order[k]
        if p != k:
            b[k], b[p] = b[p], b[k]
