"""Lower bounds of the gap along the rims of `LANES` wheels on bilinear terrain.

The lower half of a rim crosses one column of cells after another. Columns are counted along the grid axis p along which the
rim covers more cells. So in a column it crosses at most one line of the other axis t, and has at most two pieces. The gap over
a piece is given in `layout.PieceRows`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..model.ground import META_DX, META_DY
from ..model.linkage import P_RADIUS
from .cells import corners
from .layout import CELL, COLUMN, COLUMNS, LANES, LOWEST, POSE, RIM, RIM_PIECES, WHEEL, in_use

Array = NDArray[np.float64]

NONE = -1e300  # lower bound if there is no bound
ROOT_2 = math.sqrt(2.0)  # maximum of |u| (3 − 2 u²): what e adds to the second derivative


@fma_njit
def set_rims(lanes: Array, rover: Array, meta: Array, i: int) -> None:
    """Describe the rims at RIM.offset of wheel i in grid coordinates.

    Along p, the rim's lower half reaches from low_p to high_p, growing with φ. A part of the lower half may turn back
    beyond these: `upper_side` checks it.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        meta: the map header.
        i: index of the wheel.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, RIM.offset
    Writes: RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.far_t, RIM.over_h, RIM.over_q,
            RIM.ac, RIM.bd, RIM.e, RIM.swap, RIM.sign, RIM.low_p, RIM.high_p, RIM.first, RIM.more
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(in_use(lanes)):
        k = i * LANES + l
        vx, vy, az, uz, s = (
            lanes[WHEEL.vx + k],
            lanes[WHEEL.vy + k],
            lanes[WHEEL.az + k],
            lanes[WHEEL.uz + k],
            lanes[RIM.offset + l],
        )
        x, y = (
            (lanes[POSE.x + l] + lanes[WHEEL.ox + k] + s * uz * vx) * over_x,
            (lanes[POSE.y + l] + lanes[WHEEL.oy + k] + s * uz * vy) * over_y,
        )
        along_x, side_x, along_y, side_y = (
            radius * vy * over_x,
            radius * az * vx * over_x,
            -radius * vx * over_y,
            radius * az * vy * over_y,
        )
        swap = abs(along_y) > abs(along_x)
        a, b, p = (along_y if swap else along_x), (side_y if swap else side_x), (y if swap else x)
        c, d, t = (along_x if swap else along_y), (side_x if swap else side_y), (x if swap else y)
        sign = -1.0 if a < 0.0 else 1.0
        a, c = a * sign, c * sign
        h2, q2 = a * a + b * b, c * c + d * d
        far = math.sqrt(h2)
        high, low = (a if b < 0.0 else far), (-a if b > 0.0 else -far)
        first = np.floor(p + low)
        lanes[RIM.p0 + l], lanes[RIM.t0 + l], lanes[RIM.a + l], lanes[RIM.b + l], lanes[RIM.c + l], lanes[RIM.d + l] = (
            p,
            t,
            a,
            b,
            c,
            d,
        )
        lanes[RIM.rho + l], lanes[RIM.zr + l] = radius * uz, lanes[POSE.q + l] + lanes[WHEEL.oz + k] + s * az
        lanes[RIM.h2 + l], lanes[RIM.q2 + l], lanes[RIM.far_t + l], lanes[RIM.over_h + l], lanes[RIM.over_q + l] = (
            h2,
            q2,
            math.sqrt(q2),
            1.0 / h2,
            1.0 / (q2 + 1e-30),
        )
        lanes[RIM.ac + l], lanes[RIM.bd + l], lanes[RIM.e + l] = a * c, b * d, a * d + b * c
        lanes[RIM.swap + l], lanes[RIM.sign + l], lanes[RIM.low_p + l], lanes[RIM.high_p + l] = (
            (1.0 if swap else 0.0),
            sign,
            low,
            high,
        )
        lanes[RIM.first + l], lanes[RIM.more + l] = first, np.floor(p + high) - first


@inlined
def crossing(a: float, b: float, over: float, square: float, line: float) -> tuple[float, float]:
    """Return the point of a rim where a sin φ + b cos φ = line.

    Of the two points, it is the one where the left side grows with φ.

    Args:
        a: coefficient of sin φ.
        b: coefficient of cos φ.
        over: 1 / square.
        square: a² + b².
        line: value; limited to ± sqrt(square).

    Returns:
        sin φ and cos φ.
    """
    root = math.sqrt(max(square - line * line, 0.0))
    return (a * line - b * root) * over, (b * line + a * root) * over


@inlined
def rim_over_cell(lanes: Array, l: int, p: float, t: float) -> tuple[float, float, float, float, float, float, float]:
    """Return the coefficients of a rim's gap over a cell whose corner heights are known.

    Args:
        lanes: the lane array (`layout`).
        l: lane.
        p: cell along p.
        t: cell along t.

    Returns:
        Slopes along p and t at the rim's middle, twist, f0, gs, gc (`PieceRows`), and the middle's p from the cell.

    Reads:  RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.swap, CELL.h00, CELL.h01, CELL.h10, CELL.h11
    Writes: none
    """
    a, h01, h10, e, swap = (
        lanes[CELL.h00 + l],
        lanes[CELL.h01 + l],
        lanes[CELL.h10 + l],
        lanes[CELL.h11 + l],
        lanes[RIM.swap + l] > 0.0,
    )
    b, d = (h10 if swap else h01), (h01 if swap else h10)
    twist = a - b - d + e
    mp, mt = lanes[RIM.p0 + l] - p, lanes[RIM.t0 + l] - t
    slope_p, slope_t = b - a + twist * mt, d - a + twist * mp
    gs = slope_p * lanes[RIM.a + l] + slope_t * lanes[RIM.c + l]
    gc = slope_p * lanes[RIM.b + l] + slope_t * lanes[RIM.d + l] + lanes[RIM.rho + l]
    return slope_p, slope_t, twist, lanes[RIM.zr + l] - a - (b - a) * mp - slope_t * mt, gs, gc, mp


class PieceGap(NamedTuple):
    """Coefficients of the gap over a piece of a rim (`layout.PieceRows`)."""

    f0: float
    gs: float
    gc: float
    twist: float
    ac: float
    bd: float
    e: float


@inlined
def gap_at(piece: PieceGap, s: float, k: float) -> float:
    """Return the gap at a point of a piece, m.

    Args:
        piece: its coefficients.
        s, k: sin φ, cos φ.
    """
    f0, gs, gc, twist, ac, bd, e = piece
    return f0 - gs * s - gc * k - twist * (ac * s * s + e * s * k + bd * k * k)


@inlined
def gap_slope(piece: PieceGap, s: float, k: float) -> float:
    """Return the derivative of the gap by φ at a point of a piece, m.

    Args:
        piece: its coefficients.
        s, k: sin φ, cos φ.
    """
    _, gs, gc, twist, ac, bd, e = piece
    return gc * s - gs * k - twist * (2.0 * (ac - bd) * s * k + e * (k * k - s * s))


@inlined
def gap_curvature(piece: PieceGap, s: float, k: float) -> float:
    """Return the second derivative of the gap by φ at a point of a piece, m.

    Args:
        piece: its coefficients.
        s, k: sin φ, cos φ.
    """
    _, gs, gc, twist, ac, bd, e = piece
    return gs * s + gc * k - twist * (2.0 * (ac - bd) * (k * k - s * s) - 4.0 * e * s * k)


@inlined
def _bound(lanes: Array, at_s: int, at_c: int, to_s: int, to_c: int, cell: int, out: int) -> None:
    """Compute a lower bound of the gap over one piece.

    The bound is exact if the lowest gap is at an end. Over u = sin φ the gap is convex where gc − √2 |twist e| > 2 twist
    (ac − bd) cos³ φ (`rim_over_cell`). Then its tangents at both ends bound it. Elsewhere a parabola that is 0 at both ends is
    subtracted: the rest is convex.

    Args:
        lanes: the lane array (`layout`).
        at_s: row of sin φ of the first end.
        at_c: row of cos φ of the first end.
        to_s: row of sin φ of the second end.
        to_c: row of cos φ of the second end.
        cell: row of the cell's t.
        out: row of the bound; NONE where there is no bound.

    Reads:  at_c, at_s, cell, to_c, to_s, RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.ac, RIM.bd, RIM.e,
            RIM.swap, CELL.p, CELL.h00, CELL.h01, CELL.h10, CELL.h11
    Writes: out
    """
    for l in range(in_use(lanes)):
        _, _, twist, f0, gs, gc, _ = rim_over_cell(lanes, l, lanes[CELL.p + l], lanes[cell + l])
        # rounding may move an end above the height of the axle
        sl, cl, sr, cr = lanes[at_s + l], max(lanes[at_c + l], 0.0), lanes[to_s + l], max(lanes[to_c + l], 0.0)
        ac, bd, e = lanes[RIM.ac + l], lanes[RIM.bd + l], lanes[RIM.e + l]
        piece = PieceGap(f0, gs, gc, twist, ac, bd, e)
        fl, fr, by_l, by_r = gap_at(piece, sl, cl), gap_at(piece, sr, cr), gap_slope(piece, sl, cl), gap_slope(piece, sr, cr)
        wide = sr - sl
        most = 1.0 if sl * sr < 0.0 else max(cl, cr)
        firm, curl = gc - ROOT_2 * abs(twist * e), 2.0 * twist * (ac - bd)
        least = min(cl, cr)
        concave = gc + ROOT_2 * abs(twist * e) < curl * least * least * least
        # if it is not convex, a parabola through both ends is subtracted
        off = 0.0 if firm > curl * most * most * most else max(0.5 * (curl - firm), 0.0) * wide
        by_l, by_r = by_l - off * cl, by_r + off * cr
        inner = fl + by_l * ((fr - fl) * cr - by_r * wide) / (by_l * cr - by_r * cl)
        ends = min(fl, fr)
        low = max(min(inner, ends), NONE) if (by_l < 0.0) & (by_r > 0.0) & (not concave) else ends
        lanes[out + l] = low if (firm > 0.0) & (inner == inner) & (ends == ends) else NONE


@fma_njit
def _arc_beyond(lanes: Array) -> None:
    """Compute the arc of the rim over the third cell of a column, and take that cell.

    Beyond the grid line between, t grows from the arc's start to its turn, and falls from there to its end.

    Args:
        lanes: the lane array (`layout`).

    Reads:  RIM.t0, RIM.c, RIM.d, RIM.q2, RIM.over_q, RIM.swap, COLUMN.s_in, COLUMN.c_in, COLUMN.s_out, COLUMN.c_out,
            COLUMN.cell_in, COLUMN.cell_out, COLUMN.cell_turn, CELL.p
    Writes: COLUMN.s_into, COLUMN.c_into, COLUMN.s_back, COLUMN.c_back, CELL.col, CELL.row
    """
    for l in range(in_use(lanes)):
        turn, low, high = (
            lanes[COLUMN.cell_turn + l],
            min(lanes[COLUMN.cell_in + l], lanes[COLUMN.cell_out + l]),
            max(lanes[COLUMN.cell_in + l], lanes[COLUMN.cell_out + l]),
        )
        s_in, c_in, s_out, c_out = (
            lanes[COLUMN.s_in + l],
            lanes[COLUMN.c_in + l],
            lanes[COLUMN.s_out + l],
            lanes[COLUMN.c_out + l],
        )
        up = 1.0 if turn > high else -1.0
        line = up * ((high + 1.0 if turn > high else low) - lanes[RIM.t0 + l])
        a, b, over = up * lanes[RIM.c + l], up * lanes[RIM.d + l], lanes[RIM.over_q + l]
        root = math.sqrt(max(lanes[RIM.q2 + l] - line * line, 0.0))
        s, k = (a * line - b * root) * over, (b * line + a * root) * over
        before = (k < 0.0) | (s < s_in)
        lanes[COLUMN.s_into + l], lanes[COLUMN.c_into + l] = (s_in if before else s), (c_in if before else k)
        s, k = (a * line + b * root) * over, (b * line - a * root) * over
        after = (k < 0.0) | (s > s_out)
        lanes[COLUMN.s_back + l], lanes[COLUMN.c_back + l] = (s_out if after else s), (c_out if after else k)
        swap, p = lanes[RIM.swap + l] > 0.0, lanes[CELL.p + l]
        lanes[CELL.col + l], lanes[CELL.row + l] = (turn if swap else p), (p if swap else turn)


@fma_njit
def bound_pieces(lanes: Array, grid: Array, meta: Array, columns: int) -> None:
    """Compute lower bounds of all pieces of the rims, column by column.

    A tilted rim may turn back beyond the two cells of a column. The bound over that third cell goes into LOWEST.doubt. If the
    rim reaches more cells, LOWEST.doubt is NONE.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        columns: number of columns under the widest of the rims.

    Reads:  RIM.p0, RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.far_t, RIM.over_h, RIM.over_q,
            RIM.ac, RIM.bd, RIM.e, RIM.swap, RIM.low_p, RIM.high_p, RIM.first, RIM.more, COLUMN (all), CELL.p, CELL.col,
            CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST.doubt, HOME (all)
    Writes: COLUMN (all), CELL.p, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST.doubt, RIM_PIECES (all)
    """
    columns = min(max(columns, 0), COLUMNS)
    for l in range(in_use(lanes)):
        s, c = crossing(lanes[RIM.a + l], lanes[RIM.b + l], lanes[RIM.over_h + l], lanes[RIM.h2 + l], lanes[RIM.low_p + l])
        lanes[COLUMN.s_in + l], lanes[COLUMN.c_in + l], lanes[COLUMN.t_in + l] = (
            s,
            c,
            lanes[RIM.t0 + l] + lanes[RIM.c + l] * s + lanes[RIM.d + l] * c,
        )
    for m in range(columns):
        for l in range(in_use(lanes)):
            c, d, first, t_in = lanes[RIM.c + l], lanes[RIM.d + l], lanes[RIM.first + l], lanes[COLUMN.t_in + l]
            line = min(first + (m + 1.0) - lanes[RIM.p0 + l], lanes[RIM.high_p + l])
            s_out, c_out = crossing(lanes[RIM.a + l], lanes[RIM.b + l], lanes[RIM.over_h + l], lanes[RIM.h2 + l], line)
            t_out = lanes[RIM.t0 + l] + c * s_out + d * c_out
            from_cell, to_cell = np.floor(t_in), np.floor(t_out)
            up = 1.0 if to_cell > from_cell else -1.0
            s, c_mid = crossing(
                up * c, up * d, lanes[RIM.over_q + l], lanes[RIM.q2 + l], up * (max(from_cell, to_cell) - lanes[RIM.t0 + l])
            )
            same = from_cell == to_cell
            lanes[COLUMN.s_mid + l], lanes[COLUMN.c_mid + l] = (s_out if same else s), (c_out if same else c_mid)
            lanes[COLUMN.s_out + l], lanes[COLUMN.c_out + l], lanes[COLUMN.t_out + l] = s_out, c_out, t_out
            # a tilted rim may turn back beyond the two cells; on a stretched grid it may cross more of them
            rise, fall = c * lanes[COLUMN.c_in + l] - d * lanes[COLUMN.s_in + l], c * c_out - d * s_out
            turn = np.floor(lanes[RIM.t0 + l] + math.copysign(lanes[RIM.far_t + l], rise))
            beyond = (rise * fall < 0.0) & ((turn > max(from_cell, to_cell)) | (turn < min(from_cell, to_cell)))
            doubt = lanes[LOWEST.doubt + l]
            lanes[COLUMN.beyond + l], lanes[COLUMN.cell_turn + l] = (1.0 if beyond else 0.0), turn
            further = max(turn - max(from_cell, to_cell), min(from_cell, to_cell) - turn)
            lanes[LOWEST.doubt + l] = NONE if (abs(from_cell - to_cell) > 1.0) | (beyond & (further > 1.0)) else doubt
            column = first + min(1.0 * m, lanes[RIM.more + l])
            swap = lanes[RIM.swap + l] > 0.0
            lanes[COLUMN.cell_in + l], lanes[COLUMN.cell_out + l], lanes[CELL.p + l] = from_cell, to_cell, column
            lanes[CELL.col + l], lanes[CELL.row + l] = (from_cell if swap else column), (column if swap else from_cell)
        corners(lanes, grid, meta)
        _bound(lanes, COLUMN.s_in, COLUMN.c_in, COLUMN.s_mid, COLUMN.c_mid, COLUMN.cell_in, COLUMN.bound_in)
        for l in range(in_use(lanes)):
            swap, p, t = lanes[RIM.swap + l] > 0.0, lanes[CELL.p + l], lanes[COLUMN.cell_out + l]
            lanes[CELL.col + l], lanes[CELL.row + l] = (t if swap else p), (p if swap else t)
        corners(lanes, grid, meta)
        _bound(lanes, COLUMN.s_mid, COLUMN.c_mid, COLUMN.s_out, COLUMN.c_out, COLUMN.cell_out, COLUMN.bound_out)
        turning = 0
        for l in range(in_use(lanes)):
            turning += 1 if lanes[COLUMN.beyond + l] > 0.0 else 0
        if turning > 0:
            # the third cell is not searched
            _arc_beyond(lanes)
            corners(lanes, grid, meta)
            _bound(lanes, COLUMN.s_into, COLUMN.c_into, COLUMN.s_back, COLUMN.c_back, COLUMN.cell_turn, COLUMN.low_beyond)
            for l in range(in_use(lanes)):
                doubt, low = lanes[LOWEST.doubt + l], lanes[COLUMN.low_beyond + l]
                lanes[LOWEST.doubt + l] = min(doubt, low) if lanes[COLUMN.beyond + l] > 0.0 else doubt
        for l in range(in_use(lanes)):
            k = 2 * m * LANES + l
            none, cell_in, cell_out, bound_in, bound_out = (
                1.0 * m > lanes[RIM.more + l],
                lanes[COLUMN.cell_in + l],
                lanes[COLUMN.cell_out + l],
                lanes[COLUMN.bound_in + l],
                lanes[COLUMN.bound_out + l],
            )
            bound_in, bound_out = (math.inf if none else bound_in), (math.inf if none | (cell_in == cell_out) else bound_out)
            (
                lanes[RIM_PIECES.bound + k],
                lanes[RIM_PIECES.bound + LANES + k],
                lanes[RIM_PIECES.cell + k],
                lanes[RIM_PIECES.cell + LANES + k],
            ) = (
                bound_in,
                bound_out,
                cell_in,
                cell_out,
            )
            lanes[COLUMN.s_in + l], lanes[COLUMN.c_in + l], lanes[COLUMN.t_in + l] = (
                lanes[COLUMN.s_out + l],
                lanes[COLUMN.c_out + l],
                lanes[COLUMN.t_out + l],
            )
