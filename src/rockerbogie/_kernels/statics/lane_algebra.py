"""Linear equations of all lanes."""

from __future__ import annotations

from typing import Any

from ..jit.vectors import larger, smaller, where

PIVOT = 1e-14  # smallest pivot, of its diagonal element


def dots(a: list[Any], b: list[Any]) -> Any:
    """Return the scalar product of two lists.

    Args:
        a, b: lists of one length.
    """
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def factor(m: list[list[Any]], size: int) -> list[Any]:
    """Replace the lower triangle of a matrix M by L of M = L D Lᵀ, without the diagonal of L.

    Args:
        m: (size, size) None where an element is 0; replaced.
        size: number of rows.

    Returns:
        Reciprocals of the diagonal of D.
    """
    over: list[Any] = []
    scaled: list[list[Any]] = [[None] * size for _ in range(size)]  # L D
    for j in range(size):
        d = m[j][j]
        least = d * PIVOT
        for k in range(j):
            if m[j][k] is not None:
                d = d - scaled[j][k] * m[j][k]
        over.append(1.0 / larger(d, least))
        for i in range(j + 1, size):
            s = m[i][j]
            for k in range(j):
                if m[i][k] is not None and m[j][k] is not None:
                    s = -(scaled[i][k] * m[j][k]) if s is None else s - scaled[i][k] * m[j][k]
            scaled[i][j] = s
            m[i][j] = None if s is None else s * over[j]
    return over


def solve(m: list[list[Any]], over: list[Any], x: list[Any]) -> list[Any]:
    """Return the solution of L D Lᵀ y = x.

    Args:
        m, over: as `factor` leaves them.
        x: right-hand side.
    """
    size, y = len(over), list(x)
    for i in range(size):
        for k in range(i):
            if m[i][k] is not None:
                y[i] = y[i] - m[i][k] * y[k]
    for i in range(size - 1, -1, -1):
        y[i] = y[i] * over[i]
        for k in range(i + 1, size):
            if m[k][i] is not None:
                y[i] = y[i] - m[k][i] * y[k]
    return y


def solve_pivoted(a: list[list[Any]], b: list[Any], pivot: float) -> tuple[list[Any], Any]:
    """Return the solution of a x = b by elimination with row pivoting in each lane.

    Args:
        a: (n, n) rows.
        b: (n,) right-hand side.
        pivot: smallest pivot of a regular matrix, of its largest element.

    Returns:
        x, and flags that are set where the matrix is regular.
    """
    size, rows = len(b), [[*row, x] for row, x in zip(a, b, strict=True)]
    largest, least = b[0] * 0.0, b[0] * 0.0 + 1e300
    for row in a:
        for element in row:
            largest = larger(largest, magnitude(element))
    for k in range(size):
        for i in range(k + 1, size):
            swap = magnitude(rows[i][k]) > magnitude(rows[k][k])
            for j in range(k, size + 1):
                rows[k][j], rows[i][j] = where(swap, rows[i][j], rows[k][j]), where(swap, rows[k][j], rows[i][j])
        least = smaller(least, magnitude(rows[k][k]))
        over = 1.0 / rows[k][k]
        for i in range(k + 1, size):
            part = rows[i][k] * over
            for j in range(k + 1, size + 1):
                rows[i][j] = rows[i][j] - part * rows[k][j]
        rows[k][k] = over
    x: list[Any] = [None] * size
    for k in range(size - 1, -1, -1):
        total = rows[k][size]
        for j in range(k + 1, size):
            total = total - rows[k][j] * x[j]
        x[k] = total * rows[k][k]
    return x, least > pivot * largest


def magnitude(x: Any) -> Any:
    """Return absolute values.

    Args:
        x: lanes.
    """
    return larger(x, -x)
