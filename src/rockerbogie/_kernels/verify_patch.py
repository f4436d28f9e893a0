"""Lower bounds of (patch z - terrain z) over a box of a patch: a wheel's tread, or a face of the body's box.

A patch is the surface P(a, b) = C + b A + N(a), |a - middle| <= half_a, |b| <= half_b, with N(a) = cos(a) U + sin(a) V for
a tread (a = phi, b = s, |U| = |V| = radius) and N(a) = a U for a face. `docs/verification.md` derives the bounds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .jit import njit
from .verify_terrain import (
    BORDER,
    DXX,
    DXY,
    DYY,
    MXX,
    MXY,
    MYY,
    Field,
    bound_curvature,
    cell_at,
    cell_index,
    cell_known,
    height_above_plane,
    surface_in_cell,
)

Array = NDArray[np.float64]

# A patch: vectors C, A, U, V; half_a, half_b; 1 for a tread, 0 for a face; bound of the coordinates' size, m.
C, A, U, V = 0, 3, 6, 9
HALF_A, HALF_B, ROUND, REACH = range(12, 16)
PATCH_SIZE = 16

# Working array of a search: the box's middle P, N(a) and T = dN/da there; curvature ranges; best gap; rounding, m.
P, N, T, CURVATURE, BEST, ROUNDING, HOLES, TARGET = 0, 3, 6, 9, 15, 16, 17, 18
WORK_SIZE = 19

#: Cells a box may reach over, along each axis, for the bound by second derivatives.
CUBIC_SPAN, BILINEAR_SPAN = 3, 2
EPS = 2.0**-52


@njit
def place(patch: Array, a: float, b: float, w: Array) -> None:
    """Write the point P(a, b), N(a) and T(a).

    Args:
        patch: (PATCH_SIZE,).
        a: parameter.
        b: parameter.
        w: (WORK_SIZE,) receives P, N, T.

    Returns:
        Nothing.
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
    return abs(w[T + k]) * da + abs(patch[A + k]) * db + 0.5 * da * da * patch[ROUND] * math.hypot(patch[U + k], patch[V + k])


@njit
def keep_point(field: Field, patch: Array, w: Array, a: float, b: float) -> None:
    """Evaluate the gap at a point of the patch, and keep it if it is the lowest so far.

    Args:
        field: the terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) BEST is updated.
        a: parameter, limited to the patch.
        b: parameter, limited to the patch.

    Returns:
        Nothing.
    """
    a = min(max(a, -patch[HALF_A]), patch[HALF_A])
    b = min(max(b, -patch[HALF_B]), patch[HALF_B])
    c, s = (math.cos(a), math.sin(a)) if patch[ROUND] != 0.0 else (a, 0.0)
    x = patch[C] + b * patch[A] + c * patch[U] + s * patch[V]
    y = patch[C + 1] + b * patch[A + 1] + c * patch[U + 1] + s * patch[V + 1]
    z = patch[C + 2] + b * patch[A + 2] + c * patch[U + 2] + s * patch[V + 2]
    i, j, known = cell_at(field, x, y, w[HOLES] != 0.0)
    if known:
        gap = z - surface_in_cell(field, i, j, x, y)[0]
        w[BEST] = min(w[BEST], gap)


@njit
def least_quadratic(g: float, k: float, low: float, high: float) -> float:
    """Return the minimum of g t + k t^2 / 2 over low <= t <= high.

    Args:
        g: slope at t = 0.
        k: second derivative.
        low: lower end.
        high: upper end.

    Returns:
        The minimum.
    """
    if k > 0.0 and low * k < -g < high * k:
        return -0.5 * g * g / k
    return min(low * (g + 0.5 * k * low), high * (g + 0.5 * k * high))


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
    """Bound f(a, b) = P_z - h(P_x, P_y) over a box by its value, slopes and the ranges of its second derivatives.

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
        The lower bound, m; the minimum (a, b) of f's own quadratic, relative to the middle.
    """
    mxx, dxx, mxy = w[CURVATURE + MXX], w[CURVATURE + DXX], w[CURVATURE + MXY]
    dxy, myy, dyy = w[CURVATURE + DXY], w[CURVATURE + MYY], w[CURVATURE + DYY]
    ax, ay, x, y = patch[A], patch[A + 1], w[T], w[T + 1]
    ga = w[T + 2] - hx * x - hy * y
    gb = patch[A + 2] - hx * ax - hy * ay
    faa = 0.0
    tx = ty = 0.0
    caa = 0.0
    if patch[ROUND] != 0.0:
        bx, by = math.hypot(patch[U], patch[V]), math.hypot(patch[U + 1], patch[V + 1])
        bn = math.hypot(patch[U + 2] - hx * patch[U] - hy * patch[U + 1], patch[V + 2] - hx * patch[V] - hy * patch[V + 1])
        sx, sy = abs(w[N]), abs(w[N + 1])
        tx, ty = sx * da + 0.5 * bx * da * da, sy * da + 0.5 * by * da * da
        nx, ny = min(sx + abs(x) * da + 0.5 * bx * da * da, bx), min(sy + abs(y) * da + 0.5 * by * da * da, by)
        ex, ey = (abs(mxx) + dxx) * rx + (abs(mxy) + dxy) * ry, (abs(mxy) + dxy) * rx + (abs(myy) + dyy) * ry
        caa = -(w[N + 2] - hx * w[N] - hy * w[N + 1])
        faa = caa - abs(ga) * da - 0.5 * bn * da * da - ex * nx - ey * ny
    qaa = mxx * x * x + 2.0 * mxy * x * y + myy * y * y
    caa -= qaa
    px, py = abs(x) + tx, abs(y) + ty
    faa -= qaa + 2.0 * (abs(mxx * x + mxy * y) * tx + abs(mxy * x + myy * y) * ty)
    faa -= abs(mxx) * tx * tx + 2.0 * abs(mxy) * tx * ty + abs(myy) * ty * ty
    faa -= dxx * px * px + 2.0 * dxy * px * py + dyy * py * py
    if db == 0.0:
        best_a = -ga / caa if caa > 0.0 else (-math.inf if ga > 0.0 else math.inf)
        return f + least_quadratic(ga, faa, -da, da), min(max(best_a, -da), da), 0.0
    cbb = -(mxx * ax * ax + 2.0 * mxy * ax * ay + myy * ay * ay)
    fbb = cbb - (dxx * ax * ax + 2.0 * dxy * abs(ax * ay) + dyy * ay * ay)
    cab = -(mxx * x * ax + mxy * (x * ay + y * ax) + myy * y * ay)
    mix = abs(cab) + dxx * abs(ax) * px + dxy * (abs(ay) * px + abs(ax) * py) + dyy * abs(ay) * py
    mix += abs(mxx * ax + mxy * ay) * tx + abs(mxy * ax + myy * ay) * ty
    t = db / da
    bound = least_quadratic(ga, faa - mix * t, -da, da) + least_quadratic(gb, fbb - mix / t, -db, db)
    if faa > 0.0 and mix > 0.0:
        t = faa / mix
        bound = max(bound, -abs(ga) * da + least_quadratic(gb, fbb - mix / t, -db, db))
        t *= 0.5
        bound = max(bound, least_quadratic(ga, 0.5 * faa, -da, da) + least_quadratic(gb, fbb - mix / t, -db, db))
    # the minimum of the quadratic at the middle: for the upper bound only
    a = b = 0.0
    free = cbb - cab * cab / caa if caa > 0.0 else -1.0
    if free > 0.0:
        b = min(max(-(gb - cab * ga / caa) / free, -db), db)
    else:
        b = -db if gb - (cab * ga / caa if caa > 0.0 else 0.0) > 0.0 else db
    g = ga + cab * b
    a = min(max(-g / caa, -da), da) if caa > 0.0 else (-da if g > 0.0 else da)
    return f + bound, a, b


@njit
def bound_box(field: Field, patch: Array, w: Array, a: float, b: float, da: float, db: float) -> tuple[float, bool]:
    """Bound the gap over a box from below, and try points of the box for the lowest gap.

    Args:
        field: the terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) BEST is updated.
        a: middle of the box.
        b: middle of the box.
        da: half range of a.
        db: half range of b.

    Returns:
        The lower bound without the allowance for rounding, m; True if the box is longer along a than along b, in x and y.
    """
    place(patch, a, b, w)
    x, y, z = w[P], w[P + 1], w[P + 2]
    rx, ry = reach(patch, w, 0, da, db), reach(patch, w, 1, da, db)
    along_a = max(reach(patch, w, 0, da, 0.0), reach(patch, w, 1, da, 0.0)) >= max(abs(patch[A]), abs(patch[A + 1])) * db
    pad = 16.0 * EPS * patch[REACH] + (2.0 * BORDER if w[HOLES] != 0.0 else 0.0)
    i0 = cell_index(x - rx - pad, field.dx, field.first_col, field.last_col)
    i1 = cell_index(x + rx + pad, field.dx, field.first_col, field.last_col)
    j0 = cell_index(y - ry - pad, field.dy, field.first_row, field.last_row)
    j1 = cell_index(y + ry + pad, field.dy, field.first_row, field.last_row)
    i, j, known = cell_at(field, x, y, w[HOLES] != 0.0)
    h = hx = hy = hxx = hxy = hyy = 0.0
    if known:
        h, hx, hy, hxx, hxy, hyy = surface_in_cell(field, i, j, x, y)
        w[BEST] = min(w[BEST], z - h)
    span = CUBIC_SPAN if field.cubic else BILINEAR_SPAN
    bound = -math.inf
    if not known or i1 - i0 >= span or j1 - j0 >= span or not field.cubic:
        above, top = height_above_plane(field, i0, i1, j0, j1, x, y, h, hx, hy)
        bound = max(over_plane(patch, w, a, b, da, db, h + above, hx, hy), over_plane(patch, w, a, b, da, db, top, 0.0, 0.0))
    if bound >= w[TARGET] + w[BEST] or not known or i1 - i0 >= span or j1 - j0 >= span:
        return bound, along_a
    if field.cubic:
        bound_curvature(field, i0, i1, j0, j1, rx, ry, hxx, hxy, hyy, w[CURVATURE : CURVATURE + 6])
        low, at_a, at_b = taylor_bound(patch, w, z - h, hx, hy, da, db, rx, ry)
        keep_point(field, patch, w, a + at_a, b + at_b)
        return max(low, bound), along_a
    low = math.inf
    for row in range(j0, j1 + 1):
        for col in range(i0, i1 + 1):
            if w[HOLES] == 0.0 or cell_known(field, col, row):
                one = bound_over_cell(field, patch, w, a, b, da, db, rx, ry, col, row, i0, i1, j0, j1)
                low = min(low, one)
    return max(low, bound), along_a


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


@njit
def bound_over_cell(
    field: Field,
    patch: Array,
    w: Array,
    a: float,
    b: float,
    da: float,
    db: float,
    rx: float,
    ry: float,
    col: int,
    row: int,
    i0: int,
    i1: int,
    j0: int,
    j1: int,
) -> float:
    """Bound the gap over the part of a box that lies over one bilinear cell.

    Where the box crosses the cell's sides, multipliers >= 0 of the sides' constraints keep the bound sharp: the dual of the
    linear program that the box, the cell and the tangents make has its optimum at one of six points, all of which are tried.

    Args:
        field: bilinear terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) with P, N, T of the box's middle; BEST is updated, CURVATURE is overwritten.
        a: middle of the box.
        b: middle of the box.
        da: half range of a.
        db: half range of b.
        rx: bound of |x - x at the middle|, m.
        ry: the same along y, m.
        col: the cell.
        row: the cell.
        i0: first column that the box reaches over; at most one more follows.
        i1: last column.
        j0: first row.
        j1: last row.

    Returns:
        Lower bound, m.
    """
    x, y, z = w[P], w[P + 1], w[P + 2]
    h, hx, hy, _, twist, _ = surface_in_cell(field, col, row, x, y)
    for k in range(6):
        w[CURVATURE + k] = 0.0
    w[CURVATURE + MXY] = twist
    f = z - h
    low, at_a, at_b = taylor_bound(patch, w, f, hx, hy, da, db, rx, ry)
    target = w[BEST] + w[TARGET]
    if low >= target:
        return low
    keep_point(field, patch, w, a + at_a, b + at_b)
    # constraints sx (x - x of the side) <= 0 and the same along y; 0 where the box does not cross the side
    sx = (1.0 if col == i0 else -1.0) if i1 > i0 else 0.0
    sy = (1.0 if row == j0 else -1.0) if j1 > j0 else 0.0
    cx, cy = sx * (x - i1 * field.dx), sy * (y - j1 * field.dy)
    ga, gb = w[T + 2] - hx * w[T] - hy * w[T + 1], patch[A + 2] - hx * patch[A] - hy * patch[A + 1]
    xa, xb, ya, yb = sx * w[T], sx * patch[A], sy * w[T + 1], sy * patch[A + 1]
    det = xa * yb - xb * ya
    for trial in range(5):
        lx = ly = 0.0
        if trial == 0 and xa != 0.0:
            lx = -ga / xa
        elif trial == 1 and xb != 0.0:
            lx = -gb / xb
        elif trial == 2 and ya != 0.0:
            ly = -ga / ya
        elif trial == 3 and yb != 0.0:
            ly = -gb / yb
        elif trial == 4 and det != 0.0:
            lx, ly = (ya * gb - yb * ga) / det, (xb * ga - xa * gb) / det
        if lx < 0.0 or ly < 0.0 or (lx == 0.0 and ly == 0.0) or not math.isfinite(lx + ly):
            continue
        slack = 16.0 * EPS * patch[REACH] + (2.0 * BORDER if w[HOLES] != 0.0 else 0.0)
        raised = f + lx * cx + ly * cy - slack * (lx + ly)
        one, _, _ = taylor_bound(patch, w, raised, hx - lx * sx, hy - ly * sy, da, db, rx, ry)
        low = max(low, one)
        if low >= target:
            return low
    # points on the sides, for the upper bound only
    caa = -(w[N + 2] - hx * w[N] - hy * w[N + 1]) - 2.0 * twist * w[T] * w[T + 1]
    cbb, cab = -2.0 * twist * patch[A] * patch[A + 1], -twist * (w[T] * patch[A + 1] + w[T + 1] * patch[A])
    if sx != 0.0:
        try_side(field, patch, w, a, b, da, db, cx, xa, xb, ga, gb, caa, cab, cbb, sx * patch[U], sx * patch[V])
    if sy != 0.0:
        try_side(field, patch, w, a, b, da, db, cy, ya, yb, ga, gb, caa, cab, cbb, sy * patch[U + 1], sy * patch[V + 1])
    if det != 0.0:
        keep_point(
            field, patch, w, min(max(a + (xb * cy - yb * cx) / det, a - da), a + da),
            min(max(b + (ya * cx - xa * cy) / det, b - db), b + db),
        )  # fmt: skip
    return low


@njit
def try_side(
    field: Field,
    patch: Array,
    w: Array,
    a: float,
    b: float,
    da: float,
    db: float,
    c: float,
    ca: float,
    cb: float,
    ga: float,
    gb: float,
    caa: float,
    cab: float,
    cbb: float,
    u: float,
    v: float,
) -> None:
    """Try the lowest point of the box over the side of a cell, for the lowest gap.

    Args:
        field: bilinear terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) BEST is updated.
        a: middle of the box.
        b: middle of the box.
        da: half range of a.
        db: half range of b.
        c: the side's constraint at the middle, m.
        ca: its derivative by a.
        cb: its derivative by b.
        ga: the gap's derivative by a.
        gb: the gap's derivative by b.
        caa: the gap's second derivative.
        cab: the same.
        cbb: the same.
        u: the constraint's factor of cos(a).
        v: the constraint's factor of sin(a).

    Returns:
        Nothing.
    """
    curl = -(math.cos(a) * u + math.sin(a) * v) if patch[ROUND] != 0.0 else 0.0
    if abs(ca) * da >= abs(cb) * db:
        if ca == 0.0:
            return
        s = -cb / ca
        g, k = gb + s * ga - s * caa * c / ca - cab * c / ca, cbb + s * (2.0 * cab + s * caa)
        q = min(max(-g / k, -db), db) if k > 0.0 else (-db if g > 0.0 else db)
        p = -(c + cb * q) / ca
        p = -(c + cb * q + 0.5 * curl * p * p) / ca
    else:
        s = -ca / cb
        g, k = ga + s * gb - s * cbb * c / cb - cab * c / cb, caa + s * (2.0 * cab + s * cbb)
        p = min(max(-g / k, -da), da) if k > 0.0 else (-da if g > 0.0 else da)
        q = -(c + ca * p + 0.5 * curl * p * p) / cb
    keep_point(field, patch, w, min(max(a + p, a - da), a + da), min(max(b + q, b - db), b + db))
