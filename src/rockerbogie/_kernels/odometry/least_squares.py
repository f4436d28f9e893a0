"""Linear least squares of one small system, by Householder reflections."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit

Array = NDArray[np.float64]

#: A system is singular if a pivot is smaller than this share of the largest.
SINGULAR = 1e-9


@njit
def least_squares(A: Array, count: int, x: Array, covariance: Array, inverse: Array) -> bool:
    """Solve whitened equations and compute the covariance of the solution.

    Args:
        A: (rows, n + 1) equations, the last column is the right side; overwritten.
        count: number of equations in use, at least n.
        x: (n,) filled with the solution of least squares; NaN if the system is singular.
        covariance: (n, n) filled with (AᵀA)⁻¹; infinite if the system is singular.
        inverse: (n, n) scratch.

    Returns:
        False if the system is singular.
    """
    n = x.size
    largest = 0.0
    for c in range(n):
        norm = 0.0
        for r in range(c, count):
            norm += A[r, c] * A[r, c]
        norm = math.sqrt(norm)
        largest = max(largest, norm)
        if not norm > 0.0:
            A[c, c] = 0.0
            continue
        pivot = -norm if A[c, c] > 0.0 else norm
        first = A[c, c] - pivot
        A[c, c] = pivot
        scale = -1.0 / (pivot * first)  # 2 / vᵀv
        for k in range(c + 1, n + 1):
            product = first * A[c, k]
            for r in range(c + 1, count):
                product += A[r, c] * A[r, k]
            product *= scale
            A[c, k] -= product * first
            for r in range(c + 1, count):
                A[r, k] -= product * A[r, c]
    for c in range(n):
        if not abs(A[c, c]) > SINGULAR * largest:
            x[:] = math.nan
            covariance[:] = math.inf
            return False
    for c in range(n - 1, -1, -1):
        value = A[c, n]
        for k in range(c + 1, n):
            value -= A[c, k] * x[k]
        x[c] = value / A[c, c]
    for k in range(n):  # inverse of the triangle
        inverse[k, k] = 1.0 / A[k, k]
        for c in range(k - 1, -1, -1):
            value = 0.0
            for j in range(c + 1, k + 1):
                value -= A[c, j] * inverse[j, k]
            inverse[c, k] = value / A[c, c]
    for i in range(n):
        for j in range(i, n):
            value = 0.0
            for k in range(j, n):
                value += inverse[i, k] * inverse[j, k]
            covariance[i, j] = covariance[j, i] = value
    return True
