"""Lower bound of (patch z - terrain z) over one box; `docs/verification.md` derives it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from .patch import (
    BEST,
    CURVATURE,
    EPS,
    MISSING,
    REACH,
    TARGET,
    A,
    N,
    P,
    T,
    evaluate_point,
    keep_point,
    least_at,
    over_plane,
    reach,
    taylor_bound,
)
from .terrain import (
    BORDER,
    CURVATURE_SIZE,
    MXY,
    Cells,
    Field,
    bound_curvature,
    cell_at,
    cell_index,
    cell_known,
    height_above_plane,
    surface_in_cell,
)

Array = NDArray[np.float64]


class Box(NamedTuple):
    """Box of a patch's parameters."""

    a: float  # middle
    b: float
    da: float  # half ranges
    db: float
    rx: float  # m, bounds of |x - x at the middle| and of |y - y at the middle|
    ry: float


class Quadratic(NamedTuple):
    """Derivatives of the gap by a and b at the middle of a box."""

    ga: float
    gb: float
    gaa: float
    gab: float
    gbb: float


class Side(NamedTuple):
    """Constraint of one side of a cell: value (m) and derivatives at the middle of a box."""

    value: float
    by_a: float
    by_b: float
    by_aa: float


#: Cells a box may reach over, along each axis, for the bound by second derivatives.
CUBIC_SPAN, BILINEAR_SPAN = 3, 2


@njit
def bound_box(field: Field, patch: Array, w: Array, a: float, b: float, da: float, db: float) -> tuple[float, bool]:
    """Bound the gap over a box from below, and evaluate points that may have the lowest gap.

    Args:
        field: the terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) BEST is replaced.
        a: middle of the box.
        b: middle of the box.
        da: half range of a.
        db: half range of b.

    Returns:
        The lower bound without the allowance for rounding, m; True if the box is longer along a than along b, in x and y.
    """
    evaluate_point(patch, a, b, w)
    x, y, z = w[P], w[P + 1], w[P + 2]
    rx, ry = reach(patch, w, 0, da, db), reach(patch, w, 1, da, db)
    along_a = max(reach(patch, w, 0, da, 0.0), reach(patch, w, 1, da, 0.0)) >= max(abs(patch[A]), abs(patch[A + 1])) * db
    pad = 16.0 * EPS * patch[REACH] + (2.0 * BORDER if w[MISSING] != 0.0 else 0.0)
    i0 = cell_index(x - rx - pad, field.dx, field.first_col, field.last_col)
    i1 = cell_index(x + rx + pad, field.dx, field.first_col, field.last_col)
    j0 = cell_index(y - ry - pad, field.dy, field.first_row, field.last_row)
    j1 = cell_index(y + ry + pad, field.dy, field.first_row, field.last_row)
    i, j, known = cell_at(field, x, y, w[MISSING] != 0.0)
    h = hx = hy = hxx = hxy = hyy = 0.0
    if known:
        h, hx, hy, hxx, hxy, hyy = surface_in_cell(field, i, j, x, y)
        w[BEST] = min(w[BEST], z - h)
    span = CUBIC_SPAN if field.cubic else BILINEAR_SPAN
    bound = -math.inf
    if not known or i1 - i0 >= span or j1 - j0 >= span or not field.cubic:
        above, top = height_above_plane(field, Cells(i0, i1, j0, j1), x, y, h, hx, hy)
        bound = max(over_plane(patch, w, a, b, da, db, h + above, hx, hy), over_plane(patch, w, a, b, da, db, top, 0.0, 0.0))
    if bound >= w[TARGET] + w[BEST] or not known or i1 - i0 >= span or j1 - j0 >= span:
        return bound, along_a
    if field.cubic:
        bound_curvature(field, Cells(i0, i1, j0, j1), rx, ry, (hxx, hxy, hyy), w)
        low, at_a, at_b = taylor_bound(patch, w, z - h, hx, hy, da, db, rx, ry)
        if low < w[BEST]:
            keep_point(field, patch, w, a + at_a, b + at_b)
        return max(low, bound), along_a
    low = math.inf
    for row in range(j0, j1 + 1):
        for col in range(i0, i1 + 1):
            if w[MISSING] == 0.0 or cell_known(field, col, row):
                one = bound_over_cell(field, patch, w, Box(a, b, da, db, rx, ry), Cells(i0, i1, j0, j1), col, row)
                low = min(low, one)
    return max(low, bound), along_a


@njit
def bound_over_cell(field: Field, patch: Array, w: Array, box: Box, cells: Cells, col: int, row: int) -> float:
    """Bound the gap over the part of a box that lies over one bilinear cell.

    Where the box crosses the cell's sides, multipliers >= 0 of the sides' constraints keep the bound sharp: the dual of the
    linear program that the box, the cell and the tangents make has its optimum at one of six points, all of which are tried.

    Args:
        field: bilinear terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) with P, N, T of the box's middle; BEST is replaced, CURVATURE is overwritten.
        box: the box.
        cells: cells that the box reaches over, at most two along each axis.
        col: column of the cell.
        row: row of the cell.

    Returns:
        Lower bound, m.
    """
    a, b, da, db, rx, ry = box
    i0, i1, j0, j1 = cells
    x, y, z = w[P], w[P + 1], w[P + 2]
    h, hx, hy, _, twist, _ = surface_in_cell(field, col, row, x, y)
    for k in range(CURVATURE_SIZE):
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
    # points over the sides, for the upper bound, and the multipliers there
    caa = -(w[N + 2] - hx * w[N] - hy * w[N + 1]) - 2.0 * twist * w[T] * w[T + 1]
    cbb, cab = -2.0 * twist * patch[A] * patch[A + 1], -twist * (w[T] * patch[A + 1] + w[T + 1] * patch[A])
    side_x = side_y = 0.0
    model = Quadratic(ga, gb, caa, cab, cbb)
    if sx != 0.0:
        side_x = try_side(field, patch, w, box, Side(cx, xa, xb, -sx * w[N]), model)
    if sy != 0.0:
        side_y = try_side(field, patch, w, box, Side(cy, ya, yb, -sy * w[N + 1]), model)
    node_x = node_y = 0.0
    if det != 0.0:
        p, q = (xb * cy - yb * cx) / det, (ya * cx - xa * cy) / det
        p, q = min(max(p, -da), da), min(max(q, -db), db)
        for _ in range(2):
            curved = caa - sx * w[N] * node_x - sy * w[N + 1] * node_y
            na, nb = ga + curved * p + cab * q, gb + cab * p + cbb * q
            node_x, node_y = max((ya * nb - yb * na) / det, 0.0), max((xb * na - xa * nb) / det, 0.0)
        keep_point(field, patch, w, a + p, b + q)
    target = w[BEST] + w[TARGET]
    slack = 16.0 * EPS * patch[REACH] + (2.0 * BORDER if w[MISSING] != 0.0 else 0.0)
    for trial in range(7):
        lx = ly = 0.0
        if trial == 0:
            lx = side_x
        elif trial == 1:
            ly = side_y
        elif trial == 2:
            lx, ly = node_x, node_y
        elif trial == 3 and xa != 0.0:
            lx = -ga / xa
        elif trial == 4 and xb != 0.0:
            lx = -gb / xb
        elif trial == 5 and ya != 0.0:
            ly = -ga / ya
        elif trial == 6 and yb != 0.0:
            ly = -gb / yb
        if lx < 0.0 or ly < 0.0 or (lx == 0.0 and ly == 0.0) or not math.isfinite(lx + ly):
            continue
        raised = f + lx * cx + ly * cy - slack * (lx + ly)
        if raised <= low:  # the bound would not be greater
            continue
        one, _, _ = taylor_bound(patch, w, raised, hx - lx * sx, hy - ly * sy, da, db, rx, ry)
        low = max(low, one)
        if low >= target:
            return low
    return low


@njit
def try_side(field: Field, patch: Array, w: Array, box: Box, side: Side, model: Quadratic) -> float:
    """Evaluate the gap at the lowest point of the box over the side of a cell.

    Args:
        field: bilinear terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) BEST is replaced.
        box: the box.
        side: the side.
        model: derivatives of the gap.

    Returns:
        The side's multiplier there: minus the gap's derivative over the constraint's, 0 if that is negative.
    """
    a, b, da, db, _, _ = box
    c, ca, cb, curl = side
    ga, gb, caa, cab, cbb = model
    if abs(ca) * da >= abs(cb) * db:
        if ca == 0.0:
            return 0.0
        caa += curl * max(-ga / ca, 0.0)
        s = -cb / ca
        g, k = gb + s * ga - s * caa * c / ca - cab * c / ca, cbb + s * (2.0 * cab + s * caa)
        q = least_at(g, k, db)
        p = -(c + cb * q) / ca
        multiplier = -(ga + caa * p + cab * q) / ca
        p = -(c + cb * q + 0.5 * curl * p * p) / ca
    else:
        caa += curl * max(-gb / cb, 0.0)
        s = -ca / cb
        g, k = ga + s * gb - s * cbb * c / cb - cab * c / cb, caa + s * (2.0 * cab + s * cbb)
        p = least_at(g, k, da)
        q = -(c + ca * p + 0.5 * curl * p * p) / cb
        multiplier = -(gb + cab * p + cbb * q) / cb
    keep_point(field, patch, w, min(max(a + p, a - da), a + da), min(max(b + q, b - db), b + db))
    return max(multiplier, 0.0)
