"""Patches (a tread, or a face of the body's box) and the parts of their lower bounds.

A patch is the surface P(a, b) = C + b A + N(a), |a - middle| <= half_a, |b| <= half_b, with N(a) = cos(a) U + sin(a) V for
a tread (a = phi, b = s, |U| = |V| = radius) and N(a) = a U for a face. `docs/verification.md` derives the bounds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from .terrain import DXX, DXY, DYY, MXX, MXY, MYY, Field, cell_at, surface_in_cell

Array = NDArray[np.float64]

# A patch: vectors C, A, U, V; half_a, half_b; 1 for a tread, 0 for a face; bound of the coordinates' size, m;
# amplitude of N's x, y, z for a tread, 0 for a face, m.
C, A, U, V = 0, 3, 6, 9
HALF_A, HALF_B, ROUND, REACH, AMPLITUDE = range(12, 17)
PATCH_SIZE = 19

# Working array of a search: the box's middle P, N(a) and T = dN/da there; curvature ranges; best gap; rounding, m.
# CURVATURE is 0, as `terrain.bound_curvature` writes there.
CURVATURE, P, N, T, BEST, ROUNDING, MISSING, TARGET = 0, 6, 9, 12, 15, 16, 17, 18
WORK_SIZE = 19

EPS = 2.0**-52
#: A quadratic whose determinant is less than this times its diagonal is bounded by one that is not convex.
NEARLY_SINGULAR = 1e-6


@njit
def evaluate_point(patch: Array, a: float, b: float, w: Array) -> None:
    """Write the point P(a, b), N(a) and T(a).

    Args:
        patch: (PATCH_SIZE,).
        a: parameter.
        b: parameter.
        w: (WORK_SIZE,) filled with P, N, T.
    """
    if patch[ROUND] != 0.0:
        c, s = math.cos(a), math.sin(a)
        for k in range(3):
            w[N + k] = c * patch[U + k] + s * patch[V + k]
            w[T + k] = c * patch[V + k] - s * patch[U + k]
            w[P + k] = patch[C + k] + b * patch[A + k] + w[N + k]
    else:
        for k in range(3):
            w[N + k] = 0.0  # minus the second derivative of P by a
            w[T + k] = patch[U + k]
            w[P + k] = patch[C + k] + b * patch[A + k] + a * patch[U + k]


@njit
def reach(patch: Array, w: Array, k: int, da: float, db: float) -> float:
    """Bound how far coordinate k moves from the box's middle.

    Args:
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) with N, T of the middle.
        k: 0 for x, 1 for y, 2 for z.
        da: half range of a.
        db: half range of b.

    Returns:
        Bound, m.
    """
    return abs(w[T + k]) * da + abs(patch[A + k]) * db + 0.5 * da * da * patch[AMPLITUDE + k]


@njit
def keep_point(field: Field, patch: Array, w: Array, a: float, b: float) -> None:
    """Evaluate the gap at a point of the patch, and keep it if it is the lowest so far.

    Args:
        field: the terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) BEST is replaced.
        a: parameter, limited to the patch.
        b: parameter, limited to the patch.
    """
    a = min(max(a, -patch[HALF_A]), patch[HALF_A])
    b = min(max(b, -patch[HALF_B]), patch[HALF_B])
    c, s = (math.cos(a), math.sin(a)) if patch[ROUND] != 0.0 else (a, 0.0)
    x = patch[C] + b * patch[A] + c * patch[U] + s * patch[V]
    y = patch[C + 1] + b * patch[A + 1] + c * patch[U + 1] + s * patch[V + 1]
    z = patch[C + 2] + b * patch[A + 2] + c * patch[U + 2] + s * patch[V + 2]
    i, j, known = cell_at(field, x, y, w[MISSING] != 0.0)
    if known:
        gap = z - surface_in_cell(field, i, j, x, y)[0]
        w[BEST] = min(w[BEST], gap)


@njit
def least_on_arc(p: float, q: float, a: float, da: float) -> float:
    """Return the minimum of p cos(t) + q sin(t) over |t - a| <= da.

    Args:
        p: factor of the cosine.
        q: factor of the sine.
        a: middle, rad.
        da: half range, rad.

    Returns:
        The minimum.
    """
    size = math.hypot(p, q)
    away = math.atan2(-q, -p) - a
    away = abs(away - 2.0 * math.pi * math.floor(away / (2.0 * math.pi) + 0.5))
    return -size if away <= da else -size * math.cos(away - da)


@njit
def taylor_bound(
    patch: Array, w: Array, f: float, hx: float, hy: float, da: float, db: float, rx: float, ry: float
) -> tuple[float, float, float]:
    """Bound f = P_z - h(P_x, P_y) over a box by its value, slopes and second derivatives.

    Args:
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) with N, T of the box's middle and the ranges of h's second derivatives.
        f: value at the middle, m.
        hx: slope of h along x there.
        hy: slope of h along y there.
        da: half range of a.
        db: half range of b.
        rx: bound of |x - x at the middle| over the box, m.
        ry: the same along y, m.

    Returns:
        The lower bound, m; where (a, b) the bounding quadratic is lowest, relative to the middle.
    """
    mxx, dxx, mxy = w[CURVATURE + MXX], w[CURVATURE + DXX], w[CURVATURE + MXY]
    dxy, myy, dyy = w[CURVATURE + DXY], w[CURVATURE + MYY], w[CURVATURE + DYY]
    ax, ay, x, y = patch[A], patch[A + 1], w[T], w[T + 1]
    ga = w[T + 2] - hx * x - hy * y
    gb = patch[A + 2] - hx * ax - hy * ay
    faa = 0.0
    tx = ty = 0.0
    if patch[ROUND] != 0.0:
        bx, by = patch[AMPLITUDE], patch[AMPLITUDE + 1]
        bn = math.hypot(patch[U + 2] - hx * patch[U] - hy * patch[U + 1], patch[V + 2] - hx * patch[V] - hy * patch[V + 1])
        sx, sy = abs(w[N]), abs(w[N + 1])
        tx, ty = sx * da + 0.5 * bx * da * da, sy * da + 0.5 * by * da * da
        nx, ny = min(sx + abs(x) * da + 0.5 * bx * da * da, bx), min(sy + abs(y) * da + 0.5 * by * da * da, by)
        ex, ey = (abs(mxx) + dxx) * rx + (abs(mxy) + dxy) * ry, (abs(mxy) + dxy) * rx + (abs(myy) + dyy) * ry
        faa = -(w[N + 2] - hx * w[N] - hy * w[N + 1]) - abs(ga) * da - 0.5 * bn * da * da - ex * nx - ey * ny
    qaa = mxx * x * x + 2.0 * mxy * x * y + myy * y * y
    px, py = abs(x) + tx, abs(y) + ty
    faa -= qaa + 2.0 * (abs(mxx * x + mxy * y) * tx + abs(mxy * x + myy * y) * ty)
    faa -= abs(mxx) * tx * tx + 2.0 * abs(mxy) * tx * ty + abs(myy) * ty * ty
    faa -= dxx * px * px + 2.0 * dxy * px * py + dyy * py * py
    if db == 0.0:
        a = least_at(ga, faa, da)
        return f + a * (ga + 0.5 * faa * a), a, 0.0
    fbb = -(mxx * ax * ax + 2.0 * mxy * ax * ay + myy * ay * ay) - (dxx * ax * ax + 2.0 * dxy * abs(ax * ay) + dyy * ay * ay)
    cab = -(mxx * x * ax + mxy * (x * ay + y * ax) + myy * y * ay)
    mix = dxx * abs(ax) * px + dxy * (abs(ay) * px + abs(ax) * py) + dyy * abs(ay) * py
    mix += abs(mxx * ax + mxy * ay) * tx + abs(mxy * ax + myy * ay) * ty
    bound, a, b = least_in_box(ga, gb, faa, cab, fbb, da, db)
    return f + bound - mix * da * db, a, b


@njit
def least_in_box(ga: float, gb: float, faa: float, fab: float, fbb: float, da: float, db: float) -> tuple[float, float, float]:
    """Return the minimum over a box of ga a + gb b + (faa a^2 + 2 fab a b + fbb b^2) / 2.

    Args:
        ga: slope along a.
        gb: slope along b.
        faa: second derivative.
        fab: mixed second derivative.
        fbb: second derivative.
        da: half range of a.
        db: half range of b.

    Returns:
        The minimum, and where it is (a, b). It lies on the boundary unless the quadratic is convex.
    """
    det = faa * fbb - fab * fab
    if faa > 0.0 and det > 0.0:
        if det < NEARLY_SINGULAR * faa * fbb:
            fbb = (1.0 - NEARLY_SINGULAR) * fab * fab / faa  # less: valid for a lower bound, and not convex
        else:
            a, b = (fab * gb - fbb * ga) / det, (fab * ga - faa * gb) / det
            if abs(a) <= da and abs(b) <= db:
                return a * (ga + 0.5 * faa * a) + b * (gb + fab * a + 0.5 * fbb * b), a, b
    best, at_a, at_b = math.inf, 0.0, 0.0
    for side in range(4):
        sign = 1.0 if side % 2 else -1.0
        if side < 2:
            a = sign * da
            b = least_at(gb + fab * a, fbb, db)
        else:
            b = sign * db
            a = least_at(ga + fab * b, faa, da)
        value = a * (ga + 0.5 * faa * a) + b * (gb + fab * a + 0.5 * fbb * b)
        if value < best:
            best, at_a, at_b = value, a, b
    return best, at_a, at_b


@njit
def least_at(g: float, k: float, d: float) -> float:
    """Return the t at which g t + k t^2 / 2 is lowest over |t| <= d, for bounds over a part.

    Args:
        g: slope at t = 0.
        k: second derivative.
        d: half range.

    Returns:
        t.
    """
    if abs(g) < k * d:
        return -g / k
    return -d if g > 0.0 else d


@njit
def over_plane(patch: Array, w: Array, a: float, b: float, da: float, db: float, h: float, hx: float, hy: float) -> float:
    """Return the least height of a box of the patch over a plane.

    Args:
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) with P of the middle.
        a: middle of the box.
        b: middle of the box.
        da: half range of a.
        db: half range of b.
        h: the plane's height under the middle, m.
        hx: slope along x.
        hy: slope along y.

    Returns:
        The minimum, m.
    """
    gb = patch[A + 2] - hx * patch[A] - hy * patch[A + 1]
    p = patch[U + 2] - hx * patch[U] - hy * patch[U + 1]
    if patch[ROUND] == 0.0:
        return w[P + 2] - h - abs(gb) * db - abs(p) * da
    q = patch[V + 2] - hx * patch[V] - hy * patch[V + 1]
    here = w[N + 2] - hx * w[N] - hy * w[N + 1]
    return w[P + 2] - h - here - abs(gb) * db + least_on_arc(p, q, a, da)
