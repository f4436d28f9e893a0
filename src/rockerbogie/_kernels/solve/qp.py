"""A small strictly convex quadratic program.

The method is the dual active-set method of Goldfarb & Idnani (1983).

    minimize  c·d + d·B d / 2   with   n_k·d ≥ b_k

It starts at the unconstrained minimum and adds one violated constraint after another, so no feasible start is needed.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..model.tolerances import CONSTRAINT_SLACK

Array = NDArray[np.float64]


@njit
def invert(a: Array, out: Array) -> bool:
    """Invert a symmetric positive definite matrix by elimination.

    Args:
        a: (n, n) matrix; overwritten.
        out: (n, n) filled with the inverse.

    Returns:
        False if the matrix is not positive definite.
    """
    n = a.shape[0]
    for i in range(n):
        for j in range(n):
            out[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        pivot = a[k, k]
        if not pivot > 0.0:
            return False
        for j in range(n):
            a[k, j] /= pivot
            out[k, j] /= pivot
        for i in range(n):
            if i != k:
                f = a[i, k]
                if f != 0.0:
                    for j in range(n):
                        a[i, j] -= f * a[k, j]
                        out[i, j] -= f * out[k, j]
    return True


@inlined
def most_violated(n: Array, b: Array, count: int, d: Array) -> tuple[float, int]:
    """Find the constraint that a step violates most.

    Args:
        n: (m, size) constraint normals.
        b: (m,) constraint bounds.
        count: number of constraints.
        d: (size,) step.

    Returns:
        Its slack, negative, and its index; -1 if no constraint is violated by more than `CONSTRAINT_SLACK`.
    """
    worst, pick = -CONSTRAINT_SLACK, -1
    for k in range(count):
        s = -b[k]
        for j in range(d.size):
            s += n[k, j] * d[j]
        if s < worst:
            worst, pick = s, k
    return worst, pick


@njit
def directions(
    inverse: Array, n: Array, active: NDArray[np.int64], k_active: int, normal: Array,
    h: Array, m: Array, minv: Array, r: Array, z: Array,
) -> bool:  # fmt: skip
    """Compute the directions of the step and of the multipliers for one more constraint.

    Args:
        inverse: (size, size) inverse of B.
        n: (m, size) constraint normals.
        active: indices of the active constraints.
        k_active: their number.
        normal: (size,) normal of the constraint to add.
        h: (size + 1, size) products of `inverse` and the normals of the active constraints, one a row; that of the constraint
            to add is written after them.
        m, minv: (size, size) scratch.
        r: (size,) filled with the decrease of each multiplier.
        z: (size,) filled with the direction that keeps the active constraints.

    Returns:
        False if the active constraints are dependent.
    """
    size, hn = normal.size, h[k_active]
    for i in range(size):
        hn[i] = 0.0
        for j in range(size):
            hn[i] += inverse[i, j] * normal[j]
    for a in range(k_active):
        for e in range(k_active):
            total = 0.0
            for i in range(size):
                total += n[active[a], i] * h[e, i]
            m[a, e] = total
    if k_active > 0 and not invert(m[:k_active, :k_active], minv[:k_active, :k_active]):
        return False
    for a in range(k_active):
        r[a] = 0.0
    for e in range(k_active):
        dot = 0.0
        for j in range(size):
            dot += n[active[e], j] * hn[j]
        for a in range(k_active):
            r[a] += minv[a, e] * dot
    for i in range(size):
        z[i] = hn[i]
        for a in range(k_active):
            z[i] -= h[a, i] * r[a]
    return True


@inlined
def first_to_drop(u: Array, r: Array, k_active: int) -> tuple[float, int]:
    """Find the active constraint whose multiplier becomes 0 first.

    Args:
        u: multipliers.
        r: their decreases.
        k_active: number of active constraints.

    Returns:
        Length of the step at which it becomes 0, and its index; inf and -1 if there is none.
    """
    dual, drop = math.inf, -1
    for a in range(k_active):
        if r[a] > 1e-14 and u[a] / r[a] < dual:
            dual, drop = u[a] / r[a], a
    return dual, drop


@owning_njit
def solve_qp(inverse: Array, c: Array, n: Array, b: Array, count: int, d: Array, force: Array) -> bool:
    """Solve the quadratic program.

    Args:
        inverse: (size, size) inverse of B.
        c: (size,) linear term.
        n: (m, size) constraint normals.
        b: (m,) constraint bounds.
        count: number of constraints, at most m.
        d: (size,) filled with the minimum.
        force: (m,) filled up to `count` with the multipliers, 0 or more.

    Returns:
        False if the constraints cannot all hold, or if the iterations do not suffice.
    """
    size = c.size
    active = np.empty(size, np.int64)
    u = np.empty(size + 1)
    normal = np.empty(size)
    h = np.empty((size + 1, size))
    z, r = np.empty(size), np.empty(size)
    m, minv = np.empty((size, size)), np.empty((size, size))
    k_active = 0
    for i in range(size):
        total = 0.0
        for j in range(size):
            total -= inverse[i, j] * c[j]
        d[i] = total
    for _ in range(20 * (size + count)):
        worst, pick = most_violated(n, b, count, d)
        if pick < 0:
            for k in range(count):
                force[k] = 0.0
            for a in range(k_active):
                force[active[a]] = u[a]
            return True
        for j in range(size):
            normal[j] = n[pick, j]
        fresh = 0.0
        while True:
            if not directions(inverse, n, active, k_active, normal, h, m, minv, r, z):
                return False
            dual, drop = first_to_drop(u, r, k_active)
            zn = scale = 0.0
            for j in range(size):
                zn += z[j] * normal[j]
                scale += h[k_active, j] * normal[j]
            full = -worst / zn if k_active < size and zn > 1e-12 * scale else math.inf
            step = min(dual, full)
            if step == math.inf:
                return False
            for a in range(k_active):
                u[a] -= step * r[a]
            fresh += step
            if full < math.inf:
                for j in range(size):
                    d[j] += step * z[j]
                worst += step * zn
            if step == full:
                active[k_active] = pick
                u[k_active] = fresh
                k_active += 1
                break
            for a in range(drop, k_active - 1):
                active[a], u[a] = active[a + 1], u[a + 1]
                for j in range(size):
                    h[a, j] = h[a + 1, j]
            k_active -= 1
    return False
