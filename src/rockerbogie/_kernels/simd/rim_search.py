"""Lowest gap along the rims of `LANES` wheels on bilinear terrain.

Pieces (`rim_bounds`) are refined by Newton's method in the order of their lower bounds, until no bound is below the lowest gap
found.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..model.ground import META_DX, META_DY
from ..model.linkage import P_HALF
from ..model.tolerances import CELL_MARGIN, GAP_TIE
from .cells import corners
from .layout import BOUND, CELL, COLUMNS, CONTACT, LANES, LOWEST, PIECE, RIM, RIM_PIECES, in_use
from .lowest_bound import lowest, next_lowest, pad_bounds
from .rim_bounds import NONE, ROOT_2, PieceGap, bound_pieces, crossing, gap_at, gap_curvature, gap_slope, rim_over_cell, set_rims

Array = NDArray[np.float64]

TRACKED = -2e300  # BOUND.low below this: the cell is given, and a point beside it counts too


@fma_njit
def take_lowest_pieces(lanes: Array) -> int:
    """Select the lanes whose lowest bound is below the lowest gap found.

    The cells of their pieces are written. BOUND.low becomes infinite in the other lanes.

    Args:
        lanes: the lane array (`layout`).

    Returns:
        Number of lanes selected.

    Reads:  BOUND (all), RIM.swap, RIM.first, CELL.p, CELL.t, LOWEST.gap, RIM_PIECES.cell
    Writes: BOUND.low, CELL.p, CELL.t, CELL.col, CELL.row
    """
    count = 0
    for l in range(in_use(lanes)):
        low = lanes[BOUND.low + l]
        matters = low < lanes[LOWEST.gap + l] - GAP_TIE
        lanes[BOUND.low + l] = low if matters else math.inf
        lanes[CELL.p + l] = lanes[RIM.first + l] + np.floor(0.5 * lanes[BOUND.piece + l])
        count += 1 if matters else 0
    for l in range(in_use(lanes)):
        lanes[CELL.t + l] = lanes[RIM_PIECES.cell + np.uint64(lanes[BOUND.piece + l]) * np.uint64(LANES) + np.uint64(l)]
    for l in range(in_use(lanes)):
        swap, p, t = lanes[RIM.swap + l] > 0.0, lanes[CELL.p + l], lanes[CELL.t + l]
        lanes[CELL.col + l], lanes[CELL.row + l] = (t if swap else p), (p if swap else t)
    return count


@fma_njit
def pieces_over_cells(lanes: Array) -> None:
    """Compute ends, gap coefficients and a start for the pieces over the cells.

    The corner heights must be known. The start is the stationary point with the twist's slope at the middle of the piece,
    limited to the piece.

    Args:
        lanes: the lane array (`layout`).

    Reads:  RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.over_h, RIM.over_q, RIM.ac, RIM.bd,
            RIM.e, RIM.swap, RIM.low_p, RIM.high_p, CELL.p, CELL.t, CELL.h00, CELL.h01, CELL.h10, CELL.h11, PIECE.sl,
            PIECE.cl, PIECE.sr, PIECE.cr
    Writes: PIECE.sl, PIECE.cl, PIECE.sr, PIECE.cr, PIECE.late, PIECE.early, PIECE.f0, PIECE.gs, PIECE.gc, PIECE.twist,
            PIECE.slope_p, PIECE.slope_t, PIECE.sine, PIECE.cosine
    """
    for l in range(in_use(lanes)):
        a, b, c, d = lanes[RIM.a + l], lanes[RIM.b + l], lanes[RIM.c + l], lanes[RIM.d + l]
        over_h, over_q, h2, q2, low_p, high_p = (
            lanes[RIM.over_h + l],
            lanes[RIM.over_q + l],
            lanes[RIM.h2 + l],
            lanes[RIM.q2 + l],
            lanes[RIM.low_p + l],
            lanes[RIM.high_p + l],
        )
        # from the later of the two lines through which it may enter, to the earlier of the two through which it may leave
        sl, cl = crossing(a, b, over_h, h2, max(min(lanes[CELL.p + l] - lanes[RIM.p0 + l], high_p), low_p))
        sr, cr = crossing(a, b, over_h, h2, max(min(lanes[CELL.p + l] + 1.0 - lanes[RIM.p0 + l], high_p), low_p))
        tl, tr, near, far = (
            c * sl + d * cl,
            c * sr + d * cr,
            lanes[CELL.t + l] - lanes[RIM.t0 + l],
            lanes[CELL.t + l] + 1.0 - lanes[RIM.t0 + l],
        )
        up = 1.0 if tr > tl else -1.0
        into, out = (near if up > 0.0 else far), (far if up > 0.0 else near)
        late, early = up * tl < up * into, up * tr > up * out
        s, k = crossing(up * c, up * d, over_q, q2, up * into)
        lanes[PIECE.sl + l], lanes[PIECE.cl + l] = (s if late else sl), (k if late else cl)
        s, k = crossing(up * c, up * d, over_q, q2, up * out)
        lanes[PIECE.sr + l], lanes[PIECE.cr + l] = (s if early else sr), (k if early else cr)
        lanes[PIECE.late + l], lanes[PIECE.early + l] = (1.0 if late else 0.0), (1.0 if early else 0.0)
    for l in range(in_use(lanes)):
        slope_p, slope_t, twist, f0, gs, gc, _ = rim_over_cell(lanes, l, lanes[CELL.p + l], lanes[CELL.t + l])
        sl, cl, sr, cr = lanes[PIECE.sl + l], lanes[PIECE.cl + l], lanes[PIECE.sr + l], lanes[PIECE.cr + l]
        ac, bd, e = lanes[RIM.ac + l], lanes[RIM.bd + l], lanes[RIM.e + l]
        lanes[PIECE.slope_p + l], lanes[PIECE.slope_t + l], lanes[PIECE.twist + l] = slope_p, slope_t, twist
        lanes[PIECE.f0 + l], lanes[PIECE.gs + l], lanes[PIECE.gc + l] = f0, gs, gc
        # stationary point with the twist's slope at the middle of the piece
        s, k = 0.5 * (sl + sr), 0.5 * (cl + cr)
        p, q = gs + twist * (2.0 * ac * s + e * k), gc + twist * (e * s + 2.0 * bd * k)
        size = 1.0 / math.sqrt(p * p + q * q)
        s, k = p * size, max(q * size, 0.0)
        _move_onto_piece(lanes, l, s, k)


@inlined
def _move_onto_piece(lanes: Array, l: int, s: float, k: float) -> tuple[bool, bool]:
    """Store a point as the refined point of a piece, or the nearer end if it is beyond it.

    Args:
        lanes: the lane array (`layout`).
        l: lane.
        s, k: sin φ and cos φ of the point.

    Returns:
        True if it is before the left end; True if it is beyond the right end.

    Reads:  PIECE.sl, PIECE.cl, PIECE.sr, PIECE.cr
    Writes: PIECE.sine, PIECE.cosine
    """
    sl, cl, sr, cr = lanes[PIECE.sl + l], lanes[PIECE.cl + l], lanes[PIECE.sr + l], lanes[PIECE.cr + l]
    before, beyond = s * cl < k * sl, sr * k < cr * s
    lanes[PIECE.sine + l] = sl if before else (sr if beyond else s)
    lanes[PIECE.cosine + l] = cl if before else (cr if beyond else k)
    return before, beyond


@inlined
def _gap_of_piece(lanes: Array, l: int) -> PieceGap:
    """Return the coefficients of the gap over a piece.

    Args:
        lanes: the lane array (`layout`).
        l: lane.

    Reads:  RIM.ac, RIM.bd, RIM.e, PIECE.f0, PIECE.gs, PIECE.gc, PIECE.twist
    Writes: none
    """
    return PieceGap(
        lanes[PIECE.f0 + l],
        lanes[PIECE.gs + l],
        lanes[PIECE.gc + l],
        lanes[PIECE.twist + l],
        lanes[RIM.ac + l],
        lanes[RIM.bd + l],
        lanes[RIM.e + l],
    )


@fma_njit
def newton_on_pieces(lanes: Array) -> None:
    """Move the point on every piece by one Newton step towards the lowest gap.

    The point stays on the piece.

    Args:
        lanes: the lane array (`layout`).

    Reads:  RIM.ac, RIM.bd, RIM.e, PIECE.sl, PIECE.cl, PIECE.sr, PIECE.cr, PIECE.f0, PIECE.gs, PIECE.gc, PIECE.twist,
            PIECE.sine, PIECE.cosine
    Writes: PIECE.sine, PIECE.cosine, PIECE.before, PIECE.after
    """
    for l in range(in_use(lanes)):
        s, k, piece = lanes[PIECE.sine + l], lanes[PIECE.cosine + l], _gap_of_piece(lanes, l)
        g, h = gap_slope(piece, s, k), gap_curvature(piece, s, k)
        step = min(max(-g * k / (h * k + g * s), -0.3), 0.3)  # Newton's step in sin φ, times cos φ
        square = 1.0 + step * step
        size = 1.5 - 0.5 * square
        size *= 1.5 - 0.5 * square * size * size
        s, k = (s + k * step) * size, (k - s * step) * size
        size = 1.5 - 0.5 * (s * s + k * k)  # correct the rest
        s, k = s * size, k * size
        before, beyond = _move_onto_piece(lanes, l, s, k)
        lanes[PIECE.before + l], lanes[PIECE.after + l] = (1.0 if before else 0.0), (1.0 if beyond else 0.0)


@fma_njit
def keep_lower_gap(lanes: Array, meta: Array) -> None:
    """Keep each lane's refined rim piece if its gap is lower than the lowest so far.

    The refined point counts if its Newton step has converged or the gap is convex over the piece. Otherwise an end of the
    piece may be lower: the lower end is taken and, unless the gap is concave, LOWEST.doubt is reduced to the piece's lower
    bound. A point outside its cell, where a rim turns back out of the cell, does not count. On a grid line, where the
    terrain has a ridge, the slope is the one perpendicular to the rim, between the slopes of both sides.

    Args:
        lanes: the lane array (`layout`).
        meta: the map header.

    Reads:  BOUND.low, RIM.offset, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.ac, RIM.bd, RIM.e, RIM.swap, RIM.sign,
            CELL.t, CELL.col, CELL.row, PIECE (all), LOWEST (all)
    Writes: PIECE.gap, PIECE.sine, PIECE.cosine, PIECE.before, PIECE.after, LOWEST (all)
    """
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(in_use(lanes)):
        s, k, piece = lanes[PIECE.sine + l], lanes[PIECE.cosine + l], _gap_of_piece(lanes, l)
        sl, cl, sr, cr = lanes[PIECE.sl + l], lanes[PIECE.cl + l], lanes[PIECE.sr + l], lanes[PIECE.cr + l]
        before, beyond, curl = lanes[PIECE.before + l] > 0.0, lanes[PIECE.after + l] > 0.0, 2.0 * (piece.ac - piece.bd)
        g, h, f = gap_slope(piece, s, k), gap_curvature(piece, s, k), gap_at(piece, s, k)
        step = -g / h
        inside = (not before) & (not beyond) & (abs(step) < 1e-4)
        f += 0.5 * g * step if inside else 0.0
        most = 1.0 if sl * sr < 0.0 else max(cl, cr)
        by_e = ROOT_2 * abs(piece.twist * piece.e)
        convex = piece.gc - by_e > curl * piece.twist * most * most * most
        least = min(cl, cr)
        concave = piece.gc + by_e < curl * piece.twist * least * least * least
        sure = convex & (inside | (before & (g >= 0.0)) | (beyond & (g <= 0.0)))
        # otherwise an end may be lower
        fl, fr = gap_at(piece, sl, cl), gap_at(piece, sr, cr)
        at_l, at_r = (not sure) & (fl <= fr) & (fl < f), (not sure) & (fr < fl) & (fr < f)
        before, beyond = (before | at_l) & (not at_r), (beyond | at_r) & (not at_l)
        s, k = (sl if at_l else (sr if at_r else s)), (cl if at_l else (cr if at_r else k))
        f = fl if at_l else (fr if at_r else f)
        low, doubt = lanes[BOUND.low + l], lanes[LOWEST.doubt + l]
        # the point may be outside the cell, if the rim turns back out of it
        t = lanes[RIM.t0 + l] + lanes[RIM.c + l] * s + lanes[RIM.d + l] * k - lanes[CELL.t + l]
        real = (low < TRACKED) | ((t > -CELL_MARGIN) & (t < 1.0 + CELL_MARGIN))
        lanes[LOWEST.doubt + l] = doubt if real & (sure | concave | (f <= low + GAP_TIE)) else min(doubt, low)
        lanes[PIECE.gap + l] = f if real & (low < math.inf) else math.inf
        lanes[PIECE.sine + l], lanes[PIECE.cosine + l], lanes[PIECE.before + l], lanes[PIECE.after + l] = (
            s,
            k,
            (1.0 if before else 0.0),
            (1.0 if beyond else 0.0),
        )
    for l in range(in_use(lanes)):
        f, s, k, twist, late, early = (
            lanes[PIECE.gap + l],
            lanes[PIECE.sine + l],
            lanes[PIECE.cosine + l],
            lanes[PIECE.twist + l],
            lanes[PIECE.late + l] > 0.0,
            lanes[PIECE.early + l] > 0.0,
        )
        before, beyond, a, b, c, d = (
            lanes[PIECE.before + l] > 0.0,
            lanes[PIECE.after + l] > 0.0,
            lanes[RIM.a + l],
            lanes[RIM.b + l],
            lanes[RIM.c + l],
            lanes[RIM.d + l],
        )
        # slope of the contact: the terrain's; on a grid line, the one perpendicular to the rim
        along_p, along_t, rise = a * k - b * s, c * k - d * s, lanes[RIM.rho + l] * s
        gp, gt = lanes[PIECE.slope_p + l] + twist * (c * s + d * k), lanes[PIECE.slope_t + l] + twist * (a * s + b * k)
        on_t, on_p = (before & late) | (beyond & early), (before & (not late)) | (beyond & (not early))
        cut = (rise - (gp * along_p if on_t else gt * along_t)) / (along_t if on_t else along_p)
        gp, gt = (cut if on_p else gp), (cut if on_t else gt)
        swap = lanes[RIM.swap + l] > 0.0
        less = (f != math.inf) & (not (f >= lanes[LOWEST.gap + l]))  # a NaN is kept
        was_f, was_s, was_k, was_offset, was_x, was_y = (
            lanes[LOWEST.gap + l],
            lanes[LOWEST.sine + l],
            lanes[LOWEST.cosine + l],
            lanes[LOWEST.offset + l],
            lanes[LOWEST.gx + l],
            lanes[LOWEST.gy + l],
        )
        gx, gy = (gt if swap else gp) * over_x, (gp if swap else gt) * over_y
        s, offset = s * lanes[RIM.sign + l], lanes[RIM.offset + l]
        col, row, was_col, was_row = lanes[CELL.col + l], lanes[CELL.row + l], lanes[LOWEST.col + l], lanes[LOWEST.row + l]
        lanes[LOWEST.gap + l], lanes[LOWEST.sine + l], lanes[LOWEST.cosine + l] = (
            (f if less else was_f),
            (s if less else was_s),
            (k if less else was_k),
        )
        lanes[LOWEST.offset + l], lanes[LOWEST.gx + l], lanes[LOWEST.gy + l] = (
            (offset if less else was_offset),
            (gx if less else was_x),
            (gy if less else was_y),
        )
        lanes[LOWEST.col + l], lanes[LOWEST.row + l] = (col if less else was_col), (row if less else was_row)


@inlined
def refine_pieces(lanes: Array, meta: Array) -> None:
    """Refine the lowest gap of each lane's piece, and keep it if it is the lowest so far.

    The piece is the one over the cell (CELL.p, CELL.t). Three Newton steps are taken.

    Args:
        lanes: the lane array (`layout`).
        meta: the map header.

    Reads:  BOUND.low, RIM.offset, RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.over_h,
            RIM.over_q, RIM.ac, RIM.bd, RIM.e, RIM.swap, RIM.sign, RIM.low_p, RIM.high_p, CELL (all), PIECE (all), LOWEST
            (all)
    Writes: PIECE (all), LOWEST (all)
    """
    pieces_over_cells(lanes)
    for _ in range(3):
        newton_on_pieces(lanes)
    keep_lower_gap(lanes, meta)


@inlined
def search_rims(lanes: Array, grid: Array, meta: Array, rover: Array, i: int) -> None:
    """Search the lowest gap of the rims at RIM.offset of wheel i, along their lower halves.

    Rims over more than COLUMNS columns are not searched: LOWEST.doubt is NONE.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        rover: the packed rover.
        i: index of the wheel.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, BOUND (all), RIM
            (all), COLUMN (all), CELL (all), PIECE (all), LOWEST (all), HOME (all), RIM_PIECES (all)
    Writes: BOUND (all), RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.far_t, RIM.over_h,
            RIM.over_q, RIM.ac, RIM.bd, RIM.e, RIM.swap, RIM.sign, RIM.low_p, RIM.high_p, RIM.first, RIM.more, COLUMN (all),
            CELL (all), PIECE (all), LOWEST (all), RIM_PIECES (all)
    """
    set_rims(lanes, rover, meta, i)
    columns = 0
    for l in range(in_use(lanes)):
        if lanes[RIM.more + l] < COLUMNS:
            columns = max(columns, int(lanes[RIM.more + l]) + 1)
        else:
            lanes[LOWEST.doubt + l] = NONE
    bound_pieces(lanes, grid, meta, columns)
    pad_bounds(lanes, RIM_PIECES.bound, 2 * columns)
    lowest(lanes, RIM_PIECES.bound, 2 * columns)
    while take_lowest_pieces(lanes) > 0:
        corners(lanes, grid, meta)
        refine_pieces(lanes, meta)
        next_lowest(lanes, RIM_PIECES.bound, 2 * columns)


@inlined
def track_rims(lanes: Array, grid: Array, meta: Array, rover: Array, i: int) -> None:
    """Find the lowest gap of the rims of wheel i over given cells, for contacts on a rim.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        rover: the packed rover.
        i: index of the wheel.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT.offset,
            BOUND.low, RIM.offset, RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.over_h,
            RIM.over_q, RIM.ac, RIM.bd, RIM.e, RIM.swap, RIM.sign, RIM.low_p, RIM.high_p, CELL (all), PIECE (all), LOWEST
            (all), HOME (all)
    Writes: BOUND.low, RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.far_t, RIM.over_h,
            RIM.over_q, RIM.ac, RIM.bd, RIM.e, RIM.swap, RIM.sign, RIM.low_p, RIM.high_p, RIM.first, RIM.more, CELL (all),
            PIECE (all), LOWEST (all)
    """
    set_rims(lanes, rover, meta, i)
    half = rover[P_HALF + i]
    for l in range(in_use(lanes)):
        swap = lanes[RIM.swap + l] > 0.0
        lanes[CELL.p + l], lanes[CELL.t + l] = (
            (lanes[CELL.row + l] if swap else lanes[CELL.col + l]),
            (lanes[CELL.col + l] if swap else lanes[CELL.row + l]),
        )
        lanes[BOUND.low + l] = 2.0 * TRACKED if abs(lanes[CONTACT.offset + i * LANES + l]) >= half else math.inf
    corners(lanes, grid, meta)
    refine_pieces(lanes, meta)
