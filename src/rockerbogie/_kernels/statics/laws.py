"""Contact forces under laws that make the balance determinate.

Each law adds relations between the forces until there are as many unknowns as independent equations. Those of the first two are
linear, and solved in `lane_laws`:

- vertical: every contact force is parallel to gravity (less the acceleration): one unknown a wheel, six equations.
- equal torque: all driven axles carry the same torque, side forces are those of six equal lateral springs
  (λ + ω x, x the contact's forward position): six normal forces, the torque, λ and ω.
- equal slip: tangential forces are proportional to the normal force, as six wheels at equal slip on one friction curve have
  them: t = κ n, s = (λ + ω x) n, solved by Newton's method.
- frictionless sides: no side forces; of the tractions that balance, those with the least sum of squares.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .balance import EQUATIONS

Array = NDArray[np.float64]

UNKNOWNS = EQUATIONS
PIVOT = 1e-10  # smallest pivot, of the largest entry: below it a system is singular
NEWTON_STEPS = 30
BALANCED = 1e-12  # of the weight: residual at which Newton's method ends


@njit
def solve_linear(a: Array, b: Array, n: int) -> bool:
    """Solve a x = b by elimination with row pivoting.

    Args:
        a: (n, n), overwritten.
        b: (n,) replaced by the solution.
        n: size.

    Returns:
        False if a is singular.
    """
    largest = 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(a[i, j]))
    for k in range(n):
        row = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[row, k]):
                row = i
        if not abs(a[row, k]) > PIVOT * largest:
            return False
        if row != k:
            for j in range(k, n):
                a[k, j], a[row, j] = a[row, j], a[k, j]
            b[k], b[row] = b[row], b[k]
        for i in range(k + 1, n):
            part = a[i, k] / a[k, k]
            if part != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= part * a[k, j]
                b[i] -= part * b[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]
    return True


@owning_njit
def solve_with_multipliers(a: Array, b: Array, n: int, first: int) -> bool:
    """Solve a x = b by elimination with full pivoting, where equations may depend on each other.

    Args:
        a: (n, n), overwritten.
        b: (n,) replaced by the solution.
        n: size.
        first: index of the first multiplier; those of dependent equations are set to 0.

    Returns:
        False if the equations contradict each other, or another unknown is not determined.
    """
    order = np.arange(n)
    largest = 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(a[i, j]))
    rank = n
    for k in range(n):
        row, column = k, k
        for i in range(k, n):
            for j in range(k, n):
                if abs(a[i, j]) > abs(a[row, column]):
                    row, column = i, j
        if not abs(a[row, column]) > PIVOT * largest:
            rank = k
            break
        for j in range(n):
            a[k, j], a[row, j] = a[row, j], a[k, j]
        b[k], b[row] = b[row], b[k]
        for i in range(n):
            a[i, k], a[i, column] = a[i, column], a[i, k]
        order[k], order[column] = order[column], order[k]
        for i in range(k + 1, n):
            part = a[i, k] / a[k, k]
            for j in range(k, n):
                a[i, j] -= part * a[k, j]
            b[i] -= part * b[k]
    for k in range(rank, n):
        if abs(b[k]) > PIVOT or order[k] < first:
            return False
        b[k] = 0.0
    for k in range(rank - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= a[k, j] * b[j]
        b[k] /= a[k, k]
    x = b.copy()
    for k in range(n):
        b[order[k]] = x[k]
    return True


@owning_njit
def parallel_forces(columns: Array, count: int, frame: Array, gx: float, gy: float, gz: float, b: Array, n: Array) -> bool:
    """Fill the sizes of contact forces that are all parallel to gravity and balance b.

    Parallel forces balance across gravity and about it by themselves; the six other equations are found by projection.

    Args:
        columns: (6, 3, 9) generalized forces of unit contact forces of the first `count` wheels.
        count: number of wheels in contact; only 6 make the law determinate.
        frame: (6, 3, 3) directions of normal, traction and side, one a row.
        gx, gy, gz: gravity less the acceleration, m/s².
        b: (9,) generalized force to balance.
        n: (6,) filled, in the units of b.

    Returns:
        False if there is no unique solution.
    """
    if count != 6:
        return False
    g = math.sqrt(gx * gx + gy * gy + gz * gz)
    ux, uy, uz = -gx / g, -gy / g, -gz / g
    full = np.empty((6, EQUATIONS))
    for i in range(6):
        for k in range(EQUATIONS):
            full[i, k] = 0.0
        for c in range(3):
            part = ux * frame[i, c, 0] + uy * frame[i, c, 1] + uz * frame[i, c, 2]
            for k in range(EQUATIONS):
                full[i, k] += part * columns[i, c, k]
    # two directions across gravity: the moments about them, the force along gravity and the three joints are left
    if abs(ux) < 0.7:
        px, py, pz = 0.0, uz, -uy
    else:
        px, py, pz = -uz, 0.0, ux
    size = math.sqrt(px * px + py * py + pz * pz)
    px, py, pz = px / size, py / size, pz / size
    qx, qy, qz = uy * pz - uz * py, uz * px - ux * pz, ux * py - uy * px
    a = np.empty((6, 6))
    for i in range(6):
        a[0, i] = ux * full[i, 0] + uy * full[i, 1] + uz * full[i, 2]
        a[1, i] = px * full[i, 3] + py * full[i, 4] + pz * full[i, 5]
        a[2, i] = qx * full[i, 3] + qy * full[i, 4] + qz * full[i, 5]
        for k in range(3):
            a[3 + k, i] = full[i, 6 + k]
    n[0] = ux * b[0] + uy * b[1] + uz * b[2]
    n[1] = px * b[3] + py * b[4] + pz * b[5]
    n[2] = qx * b[3] + qy * b[4] + qz * b[5]
    for k in range(3):
        n[3 + k] = b[6 + k]
    return solve_linear(a, n, 6)


@njit
def spring_sides(columns: Array, forward: Array, k: int, matrix: Array, weight: Array) -> None:
    """Fill columns 7 and 8 of the system, side forces weight (λ + ω x), in one equation.

    Args:
        columns: (6, 3, 9) generalized forces of unit contact forces.
        forward: (6,) forward position x of each contact.
        k: the equation.
        matrix: (9, 9) the system; row k is changed.
        weight: (6,) weights of the six springs.
    """
    matrix[k, 7] = matrix[k, 8] = 0.0
    for i in range(6):
        matrix[k, 7] += weight[i] * columns[i, 2, k]
        matrix[k, 8] += weight[i] * forward[i] * columns[i, 2, k]


@owning_njit
def equal_slip(columns: Array, forward: Array, b: Array, f: Array) -> bool:
    """Fill the forces of six wheels at equal slip: t = κ n, s = (λ + ω x) n.

    Args:
        columns: (6, 3, 9) generalized forces of unit contact forces.
        forward: (6,) forward position of each contact, in any unit.
        b: (9,) generalized force to balance.
        f: (6, 3) in the units of b; its normal forces are the start of Newton's method, replaced by the solution.

    Returns:
        False if Newton's method does not converge.
    """
    a, r, n = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(EQUATIONS), np.empty(6)
    kappa = lam = turn = 0.0
    for i in range(6):
        n[i] = f[i, 0]
    for _ in range(NEWTON_STEPS):
        worst = 0.0
        for k in range(EQUATIONS):
            a[k, 6] = a[k, 7] = a[k, 8] = 0.0
            r[k] = b[k]
            for i in range(6):
                side = lam + turn * forward[i]
                a[k, i] = columns[i, 0, k] + kappa * columns[i, 1, k] + side * columns[i, 2, k]
                a[k, 6] += n[i] * columns[i, 1, k]
                r[k] -= n[i] * a[k, i]
            spring_sides(columns, forward, k, a, n)
            worst = max(worst, abs(r[k]))
        if worst < BALANCED:
            for i in range(6):
                f[i, 0], f[i, 1], f[i, 2] = n[i], kappa * n[i], (lam + turn * forward[i]) * n[i]
            return True
        if not solve_linear(a, r, UNKNOWNS):
            return False
        for i in range(6):
            n[i] += r[i]
        kappa += r[6]
        lam += r[7]
        turn += r[8]
    return False


@owning_njit
def frictionless_sides(columns: Array, count: int, b: Array, f: Array) -> bool:
    """Fill the forces without side forces whose tractions have the least sum of squares.

    Args:
        columns: (6, 3, 9) generalized forces of unit contact forces of the first `count` wheels.
        count: number of wheels in contact.
        b: (9,) generalized force to balance.
        f: (6, 3) filled, in the units of b.

    Returns:
        False if the balance cannot be met without side forces, or not uniquely.
    """
    size = 2 * 6 + EQUATIONS
    a, x = np.zeros((size, size)), np.zeros(size)
    for i in range(6):
        a[6 + i, 6 + i] = 1.0  # least t² / 2 under the balance, by its multipliers
        for k in range(EQUATIONS):
            if i < count:
                a[12 + k, i] = a[i, 12 + k] = columns[i, 0, k]
                a[12 + k, 6 + i] = a[6 + i, 12 + k] = columns[i, 1, k]
        if i >= count:
            a[i, i] = 1.0
    for k in range(EQUATIONS):
        x[12 + k] = b[k]
    if not solve_with_multipliers(a, x, size, 12):
        return False
    for i in range(6):
        f[i, 0], f[i, 1], f[i, 2] = x[i], x[6 + i], 0.0
    return True
