"""Where the rims of `LANES` wheels come nearest to bilinear ground.

A rim's lower half runs over the map from one column of cells to the next; columns are counted along that axis of the grid
that the wheel rolls along more, so that in a column it crosses one line of the other axis at most, and has two pieces. In a
cell the gap along it is

    f = f0 - gs sin φ - gc cos φ - twist (AC sin² φ + E sin φ cos φ + BD cos² φ).

Over u = sin φ it is hollow where gc - √2 |twist E| exceeds 2 twist (AC - BD) cos³ φ: then it lies nowhere below its tangents,
and where those at a piece's two ends meet it is bounded. Pieces are taken up in the order of their bounds, and each one's least
gap is found by Newton, until no bound is below the least gap found.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..model.ground import META_DX, META_DY, META_NX, META_NY
from ..model.linkage import P_HALF, P_RADIUS
from ..model.tolerances import CELL_MARGIN, GAP_TIE
from .linkage import AZ, LANES, OX, OY, OZ, PLACE, UZ, VX, VY, Q, X, Y, rows, take_corners
from .lowest_bound import BOUND_ROWS, LOW, PIECE, fill_up, lowest, next_lowest

Array = NDArray[np.float64]

COLUMNS = 48  # under one rim, at most
NONE, FOLLOWED = -1e300, -2e300  # a bound where there is none; less, where the cell is given and a place beside it will do
ROOT_2 = math.sqrt(2.0)  # the greatest of |u| (3 - 2 u²), which is what E adds to the bend at most

# One rim of each lane: its place on the axle; its middle, in cells along the two axes (p, t), and how it runs:
# p = P0 + A sin φ + B cos φ, t = T0 + C sin φ + D cos φ, z = ZR - RHO cos φ; products of these; 1 where p is y, and the sign
# that makes A positive; how far p goes; its first column and number of columns less one.
(
    RIM, P0, T0, A, B, C, D, RHO, ZR, H2, Q2, FAR_T, OVER_H, OVER_Q, AC, BD, E, SWAP, SIGN, LOW_P, HIGH_P, FIRST, MORE, _walk
) = rows(BOUND_ROWS, (LANES,) * 23)  # fmt: skip
# A column: where the rim comes in, crosses a line (or goes out) and goes out, as sin φ, cos φ, and t; the two cells
# and their bounds; the cell it turns back in, if there is another, and its bound.
(
    S_IN,
    C_IN,
    T_IN,
    S_MID,
    C_MID,
    S_OUT,
    C_OUT,
    T_OUT,
    CELL_IN,
    CELL_OUT,
    BOUND_IN,
    BOUND_OUT,
    CELL_TURN,
    BEYOND,
    LOW_BEYOND,
    _cell,
) = rows(_walk, (LANES,) * 15)
# A cell: its place along p and t, along x and y, its corners.
CP, CT, CI, CJ, H00, H01, H10, H11, _piece = rows(_cell, (LANES,) * 8)
# A piece over its cell: its ends, which of them are on lines of the other axis; the gap's parts and the ground's slopes; and
# where it is least, or that this lies before or beyond an end.
(
    SL, CL, SR, CR, LATE, EARLY, F0, GS, GC, TWIST, SLOPE_P, SLOPE_T, NF, NS, NC, BEFORE, AFTER, _best
) = rows(_piece, (LANES,) * 17)  # fmt: skip
# The least gap found, where, in which cell (x, y) and with what slope of the contact; what could not be looked at is no lower
# than DOUBT. The cell under the body.
LEAST, L_SINE, L_COSINE, L_PLACE, L_COL, L_ROW, L_GX, L_GY, DOUBT, HOME_X, HOME_Y, _pieces = rows(_best, (LANES,) * 11)
# The pieces of a rim: their bounds and cells.
BOUNDS, CELLS, RIM_ROWS = rows(_pieces, (2 * COLUMNS * LANES,) * 2)


@fma_njit
def set_home(lanes: Array, meta: Array) -> None:
    """HOME_X, HOME_Y: the cell under the body, where ground is sure to be at hand."""
    over_x, over_y, last_x, last_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY], meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for l in range(LANES):
        i, j = np.floor(lanes[X + l] * over_x), np.floor(lanes[Y + l] * over_y)
        lanes[HOME_X + l], lanes[HOME_Y + l] = min(max(i, 0.0), last_x), min(max(j, 0.0), last_y)


@fma_njit
def no_gap(lanes: Array) -> None:
    """Nothing is found yet."""
    for l in range(LANES):
        lanes[LEAST + l] = lanes[DOUBT + l] = math.inf
        lanes[L_SINE + l], lanes[L_COSINE + l], lanes[L_PLACE + l], lanes[L_GX + l], lanes[L_GY + l] = 0.0, 1.0, 0.0, 0.0, 0.0
        lanes[L_COL + l], lanes[L_ROW + l] = lanes[HOME_X + l], lanes[HOME_Y + l]


@fma_njit
def set_rims(lanes: Array, rover: Array, meta: Array, i: int) -> None:
    """The rims at RIM of wheel i."""
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(LANES):
        k = i * LANES + l
        vx, vy, az, uz, s = lanes[VX + k], lanes[VY + k], lanes[AZ + k], lanes[UZ + k], lanes[RIM + l]
        x, y = (lanes[X + l] + lanes[OX + k] + s * uz * vx) * over_x, (lanes[Y + l] + lanes[OY + k] + s * uz * vy) * over_y
        along_x, side_x, along_y, side_y = (
            radius * vy * over_x, radius * az * vx * over_x, -radius * vx * over_y, radius * az * vy * over_y,
        )  # fmt: skip
        swap = abs(along_y) > abs(along_x)
        a, b, p = (along_y if swap else along_x), (side_y if swap else side_x), (y if swap else x)
        c, d, t = (along_x if swap else along_y), (side_x if swap else side_y), (x if swap else y)
        sign = -1.0 if a < 0.0 else 1.0
        a, c = a * sign, c * sign
        h2, q2 = a * a + b * b, c * c + d * d
        far = math.sqrt(h2)
        # p grows with φ from LOW_P to HIGH_P; what is left of the lower half beyond is `height_of_rest`'s
        high, low = (a if b < 0.0 else far), (-a if b > 0.0 else -far)
        first = np.floor(p + low)
        lanes[P0 + l], lanes[T0 + l], lanes[A + l], lanes[B + l], lanes[C + l], lanes[D + l] = p, t, a, b, c, d
        lanes[RHO + l], lanes[ZR + l] = radius * uz, lanes[Q + l] + lanes[OZ + k] + s * az
        lanes[H2 + l], lanes[Q2 + l], lanes[FAR_T + l], lanes[OVER_H + l], lanes[OVER_Q + l] = (
            h2,
            q2,
            math.sqrt(q2),
            1.0 / h2,
            1.0 / (q2 + 1e-30),
        )
        lanes[AC + l], lanes[BD + l], lanes[E + l] = a * c, b * d, a * d + b * c
        lanes[SWAP + l], lanes[SIGN + l], lanes[LOW_P + l], lanes[HIGH_P + l] = (1.0 if swap else 0.0), sign, low, high
        lanes[FIRST + l], lanes[MORE + l] = first, np.floor(p + high) - first


@fma_njit
def corners(lanes: Array, grid: Array, meta: Array) -> None:
    """Heights at the corners of the cells CI, CJ, which are put on the map; where one is nan, at home."""
    last_x, last_y = meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for l in range(LANES):
        i, j, home_x, home_y = lanes[CI + l], lanes[CJ + l], lanes[HOME_X + l], lanes[HOME_Y + l]
        i, j = (i if i == i else home_x), (j if j == j else home_y)
        i, j = (i if i > 0.0 else 0.0), (j if j > 0.0 else 0.0)
        lanes[CI + l], lanes[CJ + l] = (i if i < last_x else last_x), (j if j < last_y else last_y)
    take_corners(lanes, CI, CJ, grid, H00, LANES)


@inlined
def _crossing(a: float, b: float, over: float, square: float, line: float) -> tuple[float, float]:
    """(sin φ, cos φ) with a sin φ + b cos φ = line, where that grows; square = a² + b², over its inverse."""
    root = math.sqrt(max(square - line * line, 0.0))
    return (a * line - b * root) * over, (b * line + a * root) * over


@inlined
def _over_cell(lanes: Array, l: int, p: float, t: float) -> tuple[float, float, float, float, float, float, float]:
    """A cell's slopes along p and t at the rim's middle, its twist, f0, gs, gc, and its place p from the middle."""
    a, h01, h10, e, swap = lanes[H00 + l], lanes[H01 + l], lanes[H10 + l], lanes[H11 + l], lanes[SWAP + l] > 0.0
    b, d = (h10 if swap else h01), (h01 if swap else h10)
    twist = a - b - d + e
    mp, mt = lanes[P0 + l] - p, lanes[T0 + l] - t
    slope_p, slope_t = b - a + twist * mt, d - a + twist * mp
    gs = slope_p * lanes[A + l] + slope_t * lanes[C + l]
    gc = slope_p * lanes[B + l] + slope_t * lanes[D + l] + lanes[RHO + l]
    return slope_p, slope_t, twist, lanes[ZR + l] - a - (b - a) * mp - slope_t * mt, gs, gc, mp


@inlined
def _bound(lanes: Array, at_s: int, at_c: int, to_s: int, to_c: int, cell: int, out: int) -> None:
    """A bound of the gap over a piece, exact where it has its least at an end."""
    for l in range(LANES):
        _, _, twist, f0, gs, gc, _ = _over_cell(lanes, l, lanes[CP + l], lanes[cell + l])
        # rounding may take an end a little beyond the axle's height
        sl, cl, sr, cr = lanes[at_s + l], max(lanes[at_c + l], 0.0), lanes[to_s + l], max(lanes[to_c + l], 0.0)
        ac, bd, e = lanes[AC + l], lanes[BD + l], lanes[E + l]
        fl = f0 - gs * sl - gc * cl - twist * (ac * sl * sl + e * sl * cl + bd * cl * cl)
        fr = f0 - gs * sr - gc * cr - twist * (ac * sr * sr + e * sr * cr + bd * cr * cr)
        by_l = gc * sl - gs * cl - twist * (2.0 * (ac - bd) * sl * cl + e * (cl * cl - sl * sl))
        by_r = gc * sr - gs * cr - twist * (2.0 * (ac - bd) * sr * cr + e * (cr * cr - sr * sr))
        wide = sr - sl
        most = 1.0 if sl * sr < 0.0 else max(cl, cr)
        firm, bent = gc - ROOT_2 * abs(twist * e), 2.0 * twist * (ac - bd)
        least = min(cl, cr)
        arched = gc + ROOT_2 * abs(twist * e) < bent * least * least * least
        # not hollow: so much of a parabola through both ends taken off makes it so, and lowers it between them
        off = 0.0 if firm > bent * most * most * most else max(0.5 * (bent - firm), 0.0) * wide
        by_l, by_r = by_l - off * cl, by_r + off * cr
        inner = fl + by_l * ((fr - fl) * cr - by_r * wide) / (by_l * cr - by_r * cl)
        ends = min(fl, fr)
        low = max(min(inner, ends), NONE) if (by_l < 0.0) & (by_r > 0.0) & (not arched) else ends
        lanes[out + l] = low if (firm > 0.0) & (inner == inner) & (ends == ends) else NONE


@fma_njit
def bound_pieces(lanes: Array, grid: Array, meta: Array, columns: int) -> None:
    """Fill BOUNDS and CELLS of the first `columns` columns."""
    columns = min(max(columns, 0), COLUMNS)
    lane_count = min(LANES, columns * LANES)  # LANES; a compiler that knows writes short loops out instead of fusing them
    for l in range(LANES):
        s, c = _crossing(lanes[A + l], lanes[B + l], lanes[OVER_H + l], lanes[H2 + l], lanes[LOW_P + l])
        lanes[S_IN + l], lanes[C_IN + l], lanes[T_IN + l] = s, c, lanes[T0 + l] + lanes[C + l] * s + lanes[D + l] * c
    for m in range(columns):
        for l in range(LANES):
            c, d, first, t_in = lanes[C + l], lanes[D + l], lanes[FIRST + l], lanes[T_IN + l]
            line = min(first + (m + 1.0) - lanes[P0 + l], lanes[HIGH_P + l])
            s_out, c_out = _crossing(lanes[A + l], lanes[B + l], lanes[OVER_H + l], lanes[H2 + l], line)
            t_out = lanes[T0 + l] + c * s_out + d * c_out
            from_cell, to_cell = np.floor(t_in), np.floor(t_out)
            up = 1.0 if to_cell > from_cell else -1.0
            s, c_mid = _crossing(up * c, up * d, lanes[OVER_Q + l], lanes[Q2 + l], up * (max(from_cell, to_cell) - lanes[T0 + l]))
            same = from_cell == to_cell
            lanes[S_MID + l], lanes[C_MID + l] = (s_out if same else s), (c_out if same else c_mid)
            lanes[S_OUT + l], lanes[C_OUT + l], lanes[T_OUT + l] = s_out, c_out, t_out
            # a leaning rim may turn back beyond the two cells, on a stretched grid it may cross more of them
            rise, fall = c * lanes[C_IN + l] - d * lanes[S_IN + l], c * c_out - d * s_out
            turn = np.floor(lanes[T0 + l] + math.copysign(lanes[FAR_T + l], rise))
            beyond = (rise * fall < 0.0) & ((turn > max(from_cell, to_cell)) | (turn < min(from_cell, to_cell)))
            doubt = lanes[DOUBT + l]
            lanes[BEYOND + l], lanes[CELL_TURN + l] = (1.0 if beyond else 0.0), turn
            further = max(turn - max(from_cell, to_cell), min(from_cell, to_cell) - turn)
            lanes[DOUBT + l] = NONE if (abs(from_cell - to_cell) > 1.0) | (beyond & (further > 1.0)) else doubt
            column = first + min(1.0 * m, lanes[MORE + l])
            swap = lanes[SWAP + l] > 0.0
            lanes[CELL_IN + l], lanes[CELL_OUT + l], lanes[CP + l] = from_cell, to_cell, column
            lanes[CI + l], lanes[CJ + l] = (from_cell if swap else column), (column if swap else from_cell)
        corners(lanes, grid, meta)
        _bound(lanes, S_IN, C_IN, S_MID, C_MID, CELL_IN, BOUND_IN)
        for l in range(LANES):
            swap, p, t = lanes[SWAP + l] > 0.0, lanes[CP + l], lanes[CELL_OUT + l]
            lanes[CI + l], lanes[CJ + l] = (t if swap else p), (p if swap else t)
        corners(lanes, grid, meta)
        _bound(lanes, S_MID, C_MID, S_OUT, C_OUT, CELL_OUT, BOUND_OUT)
        turning = 0
        for l in range(lane_count):
            turning += 1 if lanes[BEYOND + l] > 0.0 else 0
        if turning > 0:
            # what lies beyond is not looked at: it is no lower than all of the column's part would be over that cell
            for l in range(LANES):
                swap, p, t = lanes[SWAP + l] > 0.0, lanes[CP + l], lanes[CELL_TURN + l]
                lanes[CI + l], lanes[CJ + l] = (t if swap else p), (p if swap else t)
            corners(lanes, grid, meta)
            _bound(lanes, S_IN, C_IN, S_OUT, C_OUT, CELL_TURN, LOW_BEYOND)
            for l in range(LANES):
                doubt, low = lanes[DOUBT + l], lanes[LOW_BEYOND + l]
                lanes[DOUBT + l] = min(doubt, low) if lanes[BEYOND + l] > 0.0 else doubt
        for l in range(LANES):
            k = 2 * m * LANES + l
            none, cell_in, cell_out, bound_in, bound_out = (
                1.0 * m > lanes[MORE + l], lanes[CELL_IN + l], lanes[CELL_OUT + l], lanes[BOUND_IN + l], lanes[BOUND_OUT + l],
            )  # fmt: skip
            bound_in, bound_out = (math.inf if none else bound_in), (math.inf if none | (cell_in == cell_out) else bound_out)
            lanes[BOUNDS + k], lanes[BOUNDS + LANES + k], lanes[CELLS + k], lanes[CELLS + LANES + k] = (
                bound_in,
                bound_out,
                cell_in,
                cell_out,
            )
            lanes[S_IN + l], lanes[C_IN + l], lanes[T_IN + l] = lanes[S_OUT + l], lanes[C_OUT + l], lanes[T_OUT + l]


@fma_njit
def take_up(lanes: Array, lane_count: int) -> int:
    """Of the lanes whose LOW is below LEAST the cells of their pieces, LOW inf for others; how many they are. `lane_count`:
    LANES."""
    lane_count = min(max(lane_count, 0), LANES)
    count = 0
    for l in range(lane_count):
        low = lanes[LOW + l]
        matters = low < lanes[LEAST + l] - GAP_TIE
        lanes[LOW + l] = low if matters else math.inf
        lanes[CP + l] = lanes[FIRST + l] + np.floor(0.5 * lanes[PIECE + l])
        count += 1 if matters else 0
    for l in range(LANES):
        lanes[CT + l] = lanes[CELLS + np.uint64(lanes[PIECE + l]) * np.uint64(LANES) + np.uint64(l)]
    for l in range(lane_count):
        swap, p, t = lanes[SWAP + l] > 0.0, lanes[CP + l], lanes[CT + l]
        lanes[CI + l], lanes[CJ + l] = (t if swap else p), (p if swap else t)
    return count


@fma_njit
def pieces_over_cells(lanes: Array) -> None:
    """The ends of the pieces over the cells CP, CT, whose corners are known, and where between them to begin."""
    for l in range(LANES):
        a, b, c, d = lanes[A + l], lanes[B + l], lanes[C + l], lanes[D + l]
        over_h, over_q, h2, q2, low_p, high_p = (
            lanes[OVER_H + l],
            lanes[OVER_Q + l],
            lanes[H2 + l],
            lanes[Q2 + l],
            lanes[LOW_P + l],
            lanes[HIGH_P + l],
        )
        # from the later of two lines to come in by, to the earlier of two to go out by
        sl, cl = _crossing(a, b, over_h, h2, max(min(lanes[CP + l] - lanes[P0 + l], high_p), low_p))
        sr, cr = _crossing(a, b, over_h, h2, max(min(lanes[CP + l] + 1.0 - lanes[P0 + l], high_p), low_p))
        tl, tr, near, far = c * sl + d * cl, c * sr + d * cr, lanes[CT + l] - lanes[T0 + l], lanes[CT + l] + 1.0 - lanes[T0 + l]
        up = 1.0 if tr > tl else -1.0
        into, out = (near if up > 0.0 else far), (far if up > 0.0 else near)
        late, early = up * tl < up * into, up * tr > up * out
        s, k = _crossing(up * c, up * d, over_q, q2, up * into)
        lanes[SL + l], lanes[CL + l] = (s if late else sl), (k if late else cl)
        s, k = _crossing(up * c, up * d, over_q, q2, up * out)
        lanes[SR + l], lanes[CR + l] = (s if early else sr), (k if early else cr)
        lanes[LATE + l], lanes[EARLY + l] = (1.0 if late else 0.0), (1.0 if early else 0.0)
    for l in range(LANES):
        slope_p, slope_t, twist, f0, gs, gc, _ = _over_cell(lanes, l, lanes[CP + l], lanes[CT + l])
        sl, cl, sr, cr, ac, bd, e = (
            lanes[SL + l],
            lanes[CL + l],
            lanes[SR + l],
            lanes[CR + l],
            lanes[AC + l],
            lanes[BD + l],
            lanes[E + l],
        )
        lanes[SLOPE_P + l], lanes[SLOPE_T + l], lanes[TWIST + l], lanes[F0 + l], lanes[GS + l], lanes[GC + l] = (
            slope_p,
            slope_t,
            twist,
            f0,
            gs,
            gc,
        )
        # where it would be with the twist's slopes of the piece's middle
        s, k = 0.5 * (sl + sr), 0.5 * (cl + cr)
        p, q = gs + twist * (2.0 * ac * s + e * k), gc + twist * (e * s + 2.0 * bd * k)
        size = 1.0 / math.sqrt(p * p + q * q)
        s, k = p * size, max(q * size, 0.0)
        before, beyond = s * cl < k * sl, sr * k < cr * s
        lanes[NS + l], lanes[NC + l] = (sl if before else (sr if beyond else s)), (cl if before else (cr if beyond else k))


@fma_njit
def approach(lanes: Array) -> None:
    """One step of Newton towards the least gap of every piece, held within it."""
    for l in range(LANES):
        s, k, gs, gc, twist, e = lanes[NS + l], lanes[NC + l], lanes[GS + l], lanes[GC + l], lanes[TWIST + l], lanes[E + l]
        sl, cl, sr, cr, bent = lanes[SL + l], lanes[CL + l], lanes[SR + l], lanes[CR + l], 2.0 * (lanes[AC + l] - lanes[BD + l])
        g = gc * s - gs * k - twist * (bent * s * k + e * (k * k - s * s))
        h = gs * s + gc * k - twist * (bent * (k * k - s * s) - 4.0 * e * s * k)
        step = min(max(-g * k / (h * k + g * s), -0.3), 0.3)  # what h is over u
        square = 1.0 + step * step
        size = 1.5 - 0.5 * square
        size *= 1.5 - 0.5 * square * size * size
        s, k = (s + k * step) * size, (k - s * step) * size
        size = 1.5 - 0.5 * (s * s + k * k)  # what that has left
        s, k = s * size, k * size
        before, beyond = s * cl < k * sl, sr * k < cr * s
        lanes[NS + l], lanes[NC + l] = (sl if before else (sr if beyond else s)), (cl if before else (cr if beyond else k))
        lanes[BEFORE + l], lanes[AFTER + l] = (1.0 if before else 0.0), (1.0 if beyond else 0.0)


@fma_njit
def keep_lower_gap(lanes: Array, meta: Array) -> None:
    """What `approach` has come to, where LOW bounds it and it is less than LEAST; DOUBT where it may not be the least there."""
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(LANES):
        s, k, gs, gc, f0, twist = lanes[NS + l], lanes[NC + l], lanes[GS + l], lanes[GC + l], lanes[F0 + l], lanes[TWIST + l]
        sl, cl, sr, cr, ac, bd, e = (
            lanes[SL + l],
            lanes[CL + l],
            lanes[SR + l],
            lanes[CR + l],
            lanes[AC + l],
            lanes[BD + l],
            lanes[E + l],
        )
        before, beyond, bent = lanes[BEFORE + l] > 0.0, lanes[AFTER + l] > 0.0, 2.0 * (ac - bd)
        g = gc * s - gs * k - twist * (bent * s * k + e * (k * k - s * s))
        h = gs * s + gc * k - twist * (bent * (k * k - s * s) - 4.0 * e * s * k)
        f = f0 - gs * s - gc * k - twist * (ac * s * s + e * s * k + bd * k * k)
        step = -g / h
        inside = (not before) & (not beyond) & (abs(step) < 1e-4)
        f += 0.5 * g * step if inside else 0.0
        most = 1.0 if sl * sr < 0.0 else max(cl, cr)
        hollow = gc - ROOT_2 * abs(twist * e) > bent * twist * most * most * most
        least = min(cl, cr)
        arched = gc + ROOT_2 * abs(twist * e) < bent * twist * least * least * least
        sure = hollow & (inside | (before & (g >= 0.0)) | (beyond & (g <= 0.0)))
        # else an end may be lower, and be all there is, or not
        fl = f0 - gs * sl - gc * cl - twist * (ac * sl * sl + e * sl * cl + bd * cl * cl)
        fr = f0 - gs * sr - gc * cr - twist * (ac * sr * sr + e * sr * cr + bd * cr * cr)
        at_l, at_r = (not sure) & (fl <= fr) & (fl < f), (not sure) & (fr < fl) & (fr < f)
        before, beyond = (before | at_l) & (not at_r), (beyond | at_r) & (not at_l)
        s, k = (sl if at_l else (sr if at_r else s)), (cl if at_l else (cr if at_r else k))
        f = fl if at_l else (fr if at_r else f)
        low, doubt = lanes[LOW + l], lanes[DOUBT + l]
        # a rim that turns back out of the cell and in again is not over it all the way
        t = lanes[T0 + l] + lanes[C + l] * s + lanes[D + l] * k - lanes[CT + l]
        real = (low < FOLLOWED) | ((t > -CELL_MARGIN) & (t < 1.0 + CELL_MARGIN))
        lanes[DOUBT + l] = doubt if real & (sure | arched | (f <= low + GAP_TIE)) else min(doubt, low)
        lanes[NF + l] = f if real & (low < math.inf) else math.inf
        lanes[NS + l], lanes[NC + l], lanes[BEFORE + l], lanes[AFTER + l] = (
            s,
            k,
            (1.0 if before else 0.0),
            (1.0 if beyond else 0.0),
        )
    for l in range(LANES):
        f, s, k, twist, late, early = (
            lanes[NF + l],
            lanes[NS + l],
            lanes[NC + l],
            lanes[TWIST + l],
            lanes[LATE + l] > 0.0,
            lanes[EARLY + l] > 0.0,
        )
        before, beyond, a, b, c, d = (
            lanes[BEFORE + l] > 0.0,
            lanes[AFTER + l] > 0.0,
            lanes[A + l],
            lanes[B + l],
            lanes[C + l],
            lanes[D + l],
        )
        # the contact's slope: the ground's, and on a ridge the one between its two sides' that is square to the rim
        along_p, along_t, rise = a * k - b * s, c * k - d * s, lanes[RHO + l] * s
        gp, gt = lanes[SLOPE_P + l] + twist * (c * s + d * k), lanes[SLOPE_T + l] + twist * (a * s + b * k)
        on_t, on_p = (before & late) | (beyond & early), (before & (not late)) | (beyond & (not early))
        cut = (rise - (gp * along_p if on_t else gt * along_t)) / (along_t if on_t else along_p)
        gp, gt = (cut if on_p else gp), (cut if on_t else gt)
        swap = lanes[SWAP + l] > 0.0
        less = (f != math.inf) & (not (f >= lanes[LEAST + l]))  # nan stays
        was_f, was_s, was_k, was_place, was_x, was_y = (
            lanes[LEAST + l], lanes[L_SINE + l], lanes[L_COSINE + l], lanes[L_PLACE + l], lanes[L_GX + l], lanes[L_GY + l],
        )  # fmt: skip
        gx, gy = (gt if swap else gp) * over_x, (gp if swap else gt) * over_y
        s, place = s * lanes[SIGN + l], lanes[RIM + l]
        col, row, was_col, was_row = lanes[CI + l], lanes[CJ + l], lanes[L_COL + l], lanes[L_ROW + l]
        lanes[LEAST + l], lanes[L_SINE + l], lanes[L_COSINE + l] = (
            (f if less else was_f),
            (s if less else was_s),
            (k if less else was_k),
        )
        lanes[L_PLACE + l], lanes[L_GX + l], lanes[L_GY + l] = (
            (place if less else was_place),
            (gx if less else was_x),
            (gy if less else was_y),
        )
        lanes[L_COL + l], lanes[L_ROW + l] = (col if less else was_col), (row if less else was_row)


@inlined
def nearest(lanes: Array, meta: Array) -> None:
    """The least gap of the rims over the cells CP, CT, where LOW bounds it; held where it is less than LEAST."""
    pieces_over_cells(lanes)
    for _ in range(3):
        approach(lanes)
    keep_lower_gap(lanes, meta)


@inlined
def search_rims(lanes: Array, grid: Array, meta: Array, rover: Array, i: int) -> None:
    """The least gap of the rims at RIM of wheel i, all along their lower halves as far as p goes."""
    set_rims(lanes, rover, meta, i)
    columns = 0
    for l in range(LANES):
        if lanes[MORE + l] < COLUMNS:
            columns = max(columns, int(lanes[MORE + l]) + 1)
        else:
            lanes[DOUBT + l] = NONE
    bound_pieces(lanes, grid, meta, columns)
    fill_up(lanes, BOUNDS, 2 * columns)
    lowest(lanes, BOUNDS, 2 * columns)
    while take_up(lanes, min(LANES, columns * LANES)) > 0:
        corners(lanes, grid, meta)
        nearest(lanes, meta)
        next_lowest(lanes, BOUNDS, 2 * columns)


@inlined
def follow_rims(lanes: Array, grid: Array, meta: Array, rover: Array, i: int) -> None:
    """The least gap of the rims at RIM of wheel i over the cells CI, CJ, for those that touch with it."""
    set_rims(lanes, rover, meta, i)
    half = rover[P_HALF + i]
    for l in range(LANES):
        swap = lanes[SWAP + l] > 0.0
        lanes[CP + l], lanes[CT + l] = (lanes[CJ + l] if swap else lanes[CI + l]), (lanes[CI + l] if swap else lanes[CJ + l])
        lanes[LOW + l] = 2.0 * FOLLOWED if abs(lanes[PLACE + i * LANES + l]) >= half else math.inf
    corners(lanes, grid, meta)
    nearest(lanes, meta)
