"""Branch and bound for the minimum of (patch z - terrain z), for `rockerbogie.verify`.

It shares no code with the kernels that settle. A box of the patch is bounded from below (`verify_box`), and dropped if no
point of it can lie more than the tolerance under the lowest point found. The box with the lowest bound is halved next, until
none is left or the work limit is reached; the bracket is valid in both cases. `docs/verification.md` has the derivation.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .box import bound_box
from .patch import (
    AMPLITUDE,
    BEST,
    EPS,
    HALF_A,
    HALF_B,
    MISSING,
    REACH,
    ROUND,
    ROUNDING,
    TARGET,
    WORK_SIZE,
    A,
    C,
    P,
    U,
    V,
    evaluate_point,
    reach,
)
from .terrain import BORDER, Field, cell_index, cell_known, make_field, survey

Array = NDArray[np.float64]

TREADS, FACES = 6, 3
PATCHES = TREADS + FACES
#: Boxes that a tread is divided into around its rim before the search, and their half range of the angle.
SECTORS = 8
# A box in the heap: its lower bound, middle (a, b), half ranges, and 1 if it is longer along a.
LOW, MIDDLE_A, MIDDLE_B, RANGE_A, RANGE_B, LONG_A = range(6)
BOX_SIZE = 6
# What is written about a patch.
ON_MAP, KNOWN, CLOSED = 1, 2, 4


@njit
def push_box(heap: Array, size: int, low: float, a: float, b: float, da: float, db: float, long_a: bool) -> int:
    """Add a box to the heap, whose first row has the lowest bound.

    Args:
        heap: (room, BOX_SIZE) changed.
        size: boxes in it.
        low: the box's lower bound, m.
        a: middle.
        b: middle.
        da: half range of a.
        db: half range of b.
        long_a: True if the box is to be halved along a.

    Returns:
        The new size.
    """
    k = size
    while k > 0:
        parent = (k - 1) // 2
        if heap[parent, LOW] <= low:
            break
        for n in range(BOX_SIZE):
            heap[k, n] = heap[parent, n]
        k = parent
    heap[k, LOW], heap[k, MIDDLE_A], heap[k, MIDDLE_B], heap[k, RANGE_A], heap[k, RANGE_B] = low, a, b, da, db
    heap[k, LONG_A] = 1.0 if long_a else 0.0
    return size + 1


@njit
def pop_box(heap: Array, size: int) -> int:
    """Remove the first box of the heap.

    Args:
        heap: (room, BOX_SIZE) changed.
        size: boxes in it, at least 1.

    Returns:
        The new size.
    """
    size -= 1
    low, k = heap[size, LOW], 0
    while 2 * k + 1 < size:
        child = 2 * k + 1
        if child + 1 < size and heap[child + 1, LOW] < heap[child, LOW]:
            child += 1
        if heap[child, LOW] >= low:
            break
        for n in range(BOX_SIZE):
            heap[k, n] = heap[child, n]
        k = child
    for n in range(BOX_SIZE):
        heap[k, n] = heap[size, n]
    return size


@njit
def search_patch(field: Field, patch: Array, w: Array, heap: Array, limit: int) -> tuple[float, bool, int]:
    """Bracket the minimum of (patch z - terrain z).

    Args:
        field: the terrain, known under the whole patch.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) BEST, TARGET, MISSING are read; BEST becomes the lowest value found, if that is lower.
        heap: (limit + 2 SECTORS, BOX_SIZE) working memory.
        limit: boxes that may be bounded.

    Returns:
        Lower bound of the patch's values or of BEST, without the allowance for rounding, m; True if the bracket is closed; the
        boxes bounded.
    """
    size, done = 0, 0
    closed = math.inf
    sectors = SECTORS if patch[ROUND] != 0.0 else 1
    da, db = patch[HALF_A] / sectors, patch[HALF_B]
    for k in range(sectors):
        a = -patch[HALF_A] + (2 * k + 1) * da
        low, long_a = bound_box(field, patch, w, a, 0.0, da, db)
        size = push_box(heap, size, low, a, 0.0, da, db, long_a)
    done = sectors
    while size > 0:
        low = heap[0, LOW]
        if low >= w[BEST] + w[TARGET]:
            return min(closed, low), True, done
        if done + 2 > limit:
            return min(closed, low), False, done
        a, b, da, db = heap[0, MIDDLE_A], heap[0, MIDDLE_B], heap[0, RANGE_A], heap[0, RANGE_B]
        step_a, step_b = (0.5 * da, 0.0) if heap[0, LONG_A] != 0.0 else (0.0, 0.5 * db)
        size = pop_box(heap, size)
        for side in range(2):
            sign = 2.0 * side - 1.0
            ca, cb, ha, hb = a + sign * step_a, b + sign * step_b, da - step_a, db - step_b
            child, long_a = bound_box(field, patch, w, ca, cb, ha, hb)
            child = max(child, low)
            if child >= w[BEST] + w[TARGET]:
                closed = min(closed, child)
            else:
                size = push_box(heap, size, child, ca, cb, ha, hb, long_a)
        done += 2
    return closed, True, done


@njit
def known_under(field: Field, patch: Array, w: Array, heap: Array, limit: int) -> tuple[bool, bool]:
    """Return whether every point of a patch lies over known cells, or within `BORDER` of one.

    Args:
        field: the terrain.
        patch: (PATCH_SIZE,).
        w: (WORK_SIZE,) overwritten.
        heap: (limit + 2 SECTORS, BOX_SIZE) scratch, used as a stack.
        limit: boxes that may be looked at.

    Returns:
        True if it does; False instead of the truth if the second is False, as the work limit was reached.
    """
    sectors = SECTORS if patch[ROUND] != 0.0 else 1
    size, da = 0, patch[HALF_A] / sectors
    for k in range(sectors):
        heap[size, MIDDLE_A], heap[size, MIDDLE_B] = -patch[HALF_A] + (2 * k + 1) * da, 0.0
        heap[size, RANGE_A], heap[size, RANGE_B] = da, patch[HALF_B]
        size += 1
    for _ in range(limit):
        if size == 0:
            return True, True
        size -= 1
        a, b, da, db = heap[size, MIDDLE_A], heap[size, MIDDLE_B], heap[size, RANGE_A], heap[size, RANGE_B]
        evaluate_point(patch, a, b, w)
        x, y = w[P], w[P + 1]
        rx, ry = reach(patch, w, 0, da, db), reach(patch, w, 1, da, db)
        if near_known(field, x, y, rx, ry):
            continue
        if not any_known(field, x, y):
            return False, True
        if rx <= BORDER and ry <= BORDER:
            continue
        along_a = max(reach(patch, w, 0, da, 0.0), reach(patch, w, 1, da, 0.0))
        along_b = max(abs(patch[A]), abs(patch[A + 1])) * db
        step_a, step_b = (0.5 * da, 0.0) if along_a >= along_b else (0.0, 0.5 * db)
        for side in range(2):
            sign = 2.0 * side - 1.0
            heap[size, MIDDLE_A], heap[size, MIDDLE_B] = a + sign * step_a, b + sign * step_b
            heap[size, RANGE_A], heap[size, RANGE_B] = da - step_a, db - step_b
            size += 1
    return False, False


@njit
def near_known(field: Field, x: float, y: float, rx: float, ry: float) -> bool:
    """Return True if a rectangle is shown to lie within `BORDER` of known cells, in x and in y.

    The rectangle is made smaller by `BORDER` on each side. Along an axis where less than that would be left, it is replaced by
    one line, which lies as far from the middle as all points of the rectangle allow, on one side or on the other.

    Args:
        field: the terrain.
        x: middle, m.
        y: middle, m.
        rx: half side along x, m.
        ry: half side along y, m.

    Returns:
        True if the cells under one of the smaller rectangles are all known.
    """
    for side in range(4):
        if (side % 2 == 1 and rx >= BORDER) or (side // 2 == 1 and ry >= BORDER):
            continue
        px, py, hx, hy = x, y, max(rx - BORDER, 0.0), max(ry - BORDER, 0.0)
        if rx < BORDER:
            px += (BORDER - rx) if side % 2 else (rx - BORDER)
        if ry < BORDER:
            py += (BORDER - ry) if side // 2 else (ry - BORDER)
        if all_known(field, px - hx, px + hx, py - hy, py + hy):
            return True
    return False


@njit
def all_known(field: Field, x0: float, x1: float, y0: float, y1: float) -> bool:
    """Return True if all cells are known that a rectangle reaches over.

    Args:
        field: the terrain.
        x0: lower side, m.
        x1: upper side, m.
        y0: lower side, m.
        y1: upper side, m.

    Returns:
        True if they are.
    """
    if x0 < field.first_col * field.dx - BORDER or x1 > (field.last_col + 1) * field.dx + BORDER:
        return False
    if y0 < field.first_row * field.dy - BORDER or y1 > (field.last_row + 1) * field.dy + BORDER:
        return False
    i0, i1 = cell_index(x0, field.dx, field.first_col, field.last_col), cell_index(x1, field.dx, field.first_col, field.last_col)
    j0, j1 = cell_index(y0, field.dy, field.first_row, field.last_row), cell_index(y1, field.dy, field.first_row, field.last_row)
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            if not cell_known(field, i, j):
                return False
    return True


@njit
def any_known(field: Field, x: float, y: float) -> bool:
    """Return True if a cell within `BORDER` of a point is known.

    Args:
        field: the terrain.
        x: position, m.
        y: position, m.

    Returns:
        True if one is.
    """
    reach = 1.01 * BORDER  # rounding of the positions
    for side in range(4):
        px, py = x + (reach if side % 2 else -reach), y + (reach if side // 2 else -reach)
        if cell_known(field, int(math.floor(px / field.dx)), int(math.floor(py / field.dy))):
            return True
    return False


@njit
def prepare_patch(field: Field, patch: Array, w: Array, heap: Array, tolerance: float, limit: int) -> int:
    """Check that a patch lies over known terrain, and set the allowance for rounding.

    Args:
        field: the terrain.
        patch: (PATCH_SIZE,); REACH and AMPLITUDE are written.
        w: (WORK_SIZE,); ROUNDING, TARGET, MISSING are written.
        heap: (limit + 2 SECTORS, BOX_SIZE) working memory.
        tolerance: width of the bracket wanted, m.
        limit: boxes that may be looked at.

    Returns:
        ON_MAP, KNOWN and CLOSED, added; CLOSED: the two flags are certain.
    """
    size = 0.0
    low_x = low_y = high_x = high_y = 0.0
    for k in range(3):
        half = patch[HALF_B] * abs(patch[A + k])
        patch[AMPLITUDE + k] = math.hypot(patch[U + k], patch[V + k]) if patch[ROUND] != 0.0 else 0.0
        half += patch[AMPLITUDE + k] + (0.0 if patch[ROUND] != 0.0 else patch[HALF_A] * abs(patch[U + k]))
        if not math.isfinite(patch[C + k] + half):
            return 0
        size = max(size, abs(patch[C + k]) + half)
        if k == 0:
            low_x, high_x = patch[C] - half, patch[C] + half
        elif k == 1:
            low_y, high_y = patch[C + 1] - half, patch[C + 1] + half
    patch[REACH] = size
    if low_x < -BORDER or high_x > field.width + BORDER or low_y < -BORDER or high_y > field.depth + BORDER:
        return CLOSED
    i0 = cell_index(low_x - 2.0 * BORDER, field.dx, field.first_col, field.last_col)
    i1 = cell_index(high_x + 2.0 * BORDER, field.dx, field.first_col, field.last_col)
    j0 = cell_index(low_y - 2.0 * BORDER, field.dy, field.first_row, field.last_row)
    j1 = cell_index(high_y + 2.0 * BORDER, field.dy, field.first_row, field.last_row)
    missing, highest, slope = survey(field, i0, i1, j0, j1)
    if low_x < field.first_col * field.dx or high_x > (field.last_col + 1) * field.dx:
        missing = True  # beyond the window, or on the map's edge: look closely
    if low_y < field.first_row * field.dy or high_y > (field.last_row + 1) * field.dy:
        missing = True
    w[MISSING] = 1.0 if missing else 0.0
    w[ROUNDING] = EPS * (192.0 * highest + 32.0 * size * (1.0 + slope))
    w[TARGET] = 2.0 * w[ROUNDING] - tolerance
    if not missing:
        return ON_MAP + KNOWN + CLOSED
    known, certain = known_under(field, patch, w, heap, limit)
    return ON_MAP + (KNOWN if known else 0) + (CLOSED if certain else 0)


@owning_njit
def verify_batch(
    grid: Array,
    meta: Array,
    patches: Array,
    tolerance: float,
    limit: int,
    bracket: Array,
    flags: NDArray[np.uint8],
    boxes: NDArray[np.int64],
    start: int,
    stop: int,
) -> None:
    """Bracket the gap of every tread and the body's clearance, poses start..stop.

    Args:
        grid: the terrain's grid.
        meta: (META_SIZE,) map header.
        patches: (n, PATCHES, PATCH_SIZE) the six treads and the body's three lower faces; REACH and AMPLITUDE are written.
        tolerance: width of the bracket wanted, m.
        limit: boxes that may be bounded for each tread, and for the body.
        bracket: (n, TREADS + 1, 2) filled with the lower and upper bound of each gap and of the clearance, m; NaN if unknown.
        flags: (n, TREADS + 1) filled with ON_MAP, KNOWN, CLOSED, added.
        boxes: (n, TREADS + 1) filled with how many boxes were bounded.
        start: first pose.
        stop: one past the last pose.
    """
    field = make_field(grid, meta)
    heap = np.empty((limit + 2 * SECTORS, BOX_SIZE))
    w = np.zeros(WORK_SIZE)
    for pose in range(start, stop):
        for part in range(TREADS + 1):
            first, last = (part, part + 1) if part < TREADS else (TREADS, PATCHES)
            all_flags, low, rounding, left = ON_MAP + KNOWN + CLOSED, math.inf, 0.0, limit
            for k in range(first, last):
                all_flags &= prepare_patch(field, patches[pose, k], w, heap, tolerance, limit)
            w[BEST] = math.inf
            if all_flags & KNOWN != 0:
                for k in range(first, last):
                    if last > first + 1:  # w holds what belongs to the last face prepared
                        prepare_patch(field, patches[pose, k], w, heap, tolerance, limit)
                    one, closed, done = search_patch(field, patches[pose, k], w, heap, max(left, 2))
                    low, rounding, left = min(low, one), max(rounding, w[ROUNDING]), left - done
                    if not closed:
                        all_flags &= ON_MAP + KNOWN
                bracket[pose, part, 0], bracket[pose, part, 1] = low - rounding, w[BEST] + rounding
                if not bracket[pose, part, 1] - bracket[pose, part, 0] <= tolerance:
                    all_flags &= ON_MAP + KNOWN
            else:
                bracket[pose, part, 0] = bracket[pose, part, 1] = math.nan
            flags[pose, part], boxes[pose, part] = all_flags, limit - left
