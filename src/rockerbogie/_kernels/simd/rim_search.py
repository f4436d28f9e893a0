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

from ..jit.decorators import fused, inlined
from ..model.ground import META_DX, META_DY, META_NX, META_NY
from ..model.linkage import P_HALF, P_RADIUS
from ..search.bilinear_cell import HAIR, TIE
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


@fused
def set_home(S: Array, meta: Array) -> None:
    """HOME_X, HOME_Y: the cell under the body, where ground is sure to be at hand."""
    over_x, over_y, last_x, last_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY], meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for l in range(LANES):
        i, j = np.floor(S[X + l] * over_x), np.floor(S[Y + l] * over_y)
        S[HOME_X + l], S[HOME_Y + l] = min(max(i, 0.0), last_x), min(max(j, 0.0), last_y)


@fused
def no_gap(S: Array) -> None:
    """Nothing is found yet."""
    for l in range(LANES):
        S[LEAST + l] = S[DOUBT + l] = math.inf
        S[L_SINE + l], S[L_COSINE + l], S[L_PLACE + l], S[L_GX + l], S[L_GY + l] = 0.0, 1.0, 0.0, 0.0, 0.0
        S[L_COL + l], S[L_ROW + l] = S[HOME_X + l], S[HOME_Y + l]


@fused
def set_rims(S: Array, rover: Array, meta: Array, i: int) -> None:
    """The rims at RIM of wheel i."""
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(LANES):
        k = i * LANES + l
        vx, vy, az, uz, s = S[VX + k], S[VY + k], S[AZ + k], S[UZ + k], S[RIM + l]
        x, y = (S[X + l] + S[OX + k] + s * uz * vx) * over_x, (S[Y + l] + S[OY + k] + s * uz * vy) * over_y
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
        S[P0 + l], S[T0 + l], S[A + l], S[B + l], S[C + l], S[D + l] = p, t, a, b, c, d
        S[RHO + l], S[ZR + l] = radius * uz, S[Q + l] + S[OZ + k] + s * az
        S[H2 + l], S[Q2 + l], S[FAR_T + l], S[OVER_H + l], S[OVER_Q + l] = h2, q2, math.sqrt(q2), 1.0 / h2, 1.0 / (q2 + 1e-30)
        S[AC + l], S[BD + l], S[E + l] = a * c, b * d, a * d + b * c
        S[SWAP + l], S[SIGN + l], S[LOW_P + l], S[HIGH_P + l] = (1.0 if swap else 0.0), sign, low, high
        S[FIRST + l], S[MORE + l] = first, np.floor(p + high) - first


@fused
def corners(S: Array, grid: Array, meta: Array) -> None:
    """Heights at the corners of the cells CI, CJ, which are put on the map; where one is nan, at home."""
    last_x, last_y = meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for l in range(LANES):
        i, j, home_x, home_y = S[CI + l], S[CJ + l], S[HOME_X + l], S[HOME_Y + l]
        i, j = (i if i == i else home_x), (j if j == j else home_y)
        i, j = (i if i > 0.0 else 0.0), (j if j > 0.0 else 0.0)
        S[CI + l], S[CJ + l] = (i if i < last_x else last_x), (j if j < last_y else last_y)
    take_corners(S, CI, CJ, grid, H00, LANES)


@inlined
def _crossing(a: float, b: float, over: float, square: float, line: float) -> tuple[float, float]:
    """(sin φ, cos φ) with a sin φ + b cos φ = line, where that grows; square = a² + b², over its inverse."""
    root = math.sqrt(max(square - line * line, 0.0))
    return (a * line - b * root) * over, (b * line + a * root) * over


@inlined
def _over_cell(S: Array, l: int, p: float, t: float) -> tuple[float, float, float, float, float, float, float]:
    """A cell's slopes along p and t at the rim's middle, its twist, f0, gs, gc, and its place p from the middle."""
    a, h01, h10, e, swap = S[H00 + l], S[H01 + l], S[H10 + l], S[H11 + l], S[SWAP + l] > 0.0
    b, d = (h10 if swap else h01), (h01 if swap else h10)
    twist = a - b - d + e
    mp, mt = S[P0 + l] - p, S[T0 + l] - t
    slope_p, slope_t = b - a + twist * mt, d - a + twist * mp
    gs = slope_p * S[A + l] + slope_t * S[C + l]
    gc = slope_p * S[B + l] + slope_t * S[D + l] + S[RHO + l]
    return slope_p, slope_t, twist, S[ZR + l] - a - (b - a) * mp - slope_t * mt, gs, gc, mp


@inlined
def _bound(S: Array, at_s: int, at_c: int, to_s: int, to_c: int, cell: int, out: int) -> None:
    """A bound of the gap over a piece, exact where it has its least at an end."""
    for l in range(LANES):
        _, _, twist, f0, gs, gc, _ = _over_cell(S, l, S[CP + l], S[cell + l])
        # rounding may take an end a little beyond the axle's height
        sl, cl, sr, cr = S[at_s + l], max(S[at_c + l], 0.0), S[to_s + l], max(S[to_c + l], 0.0)
        ac, bd, e = S[AC + l], S[BD + l], S[E + l]
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
        S[out + l] = low if (firm > 0.0) & (inner == inner) & (ends == ends) else NONE


@fused
def bound_pieces(S: Array, grid: Array, meta: Array, columns: int) -> None:
    """Fill BOUNDS and CELLS of the first `columns` columns."""
    columns = min(max(columns, 0), COLUMNS)
    lanes = min(LANES, columns * LANES)  # LANES; a compiler that knows writes short loops out instead of fusing them
    for l in range(LANES):
        s, c = _crossing(S[A + l], S[B + l], S[OVER_H + l], S[H2 + l], S[LOW_P + l])
        S[S_IN + l], S[C_IN + l], S[T_IN + l] = s, c, S[T0 + l] + S[C + l] * s + S[D + l] * c
    for m in range(columns):
        for l in range(LANES):
            c, d, first, t_in = S[C + l], S[D + l], S[FIRST + l], S[T_IN + l]
            line = min(first + (m + 1.0) - S[P0 + l], S[HIGH_P + l])
            s_out, c_out = _crossing(S[A + l], S[B + l], S[OVER_H + l], S[H2 + l], line)
            t_out = S[T0 + l] + c * s_out + d * c_out
            from_cell, to_cell = np.floor(t_in), np.floor(t_out)
            up = 1.0 if to_cell > from_cell else -1.0
            s, c_mid = _crossing(up * c, up * d, S[OVER_Q + l], S[Q2 + l], up * (max(from_cell, to_cell) - S[T0 + l]))
            same = from_cell == to_cell
            S[S_MID + l], S[C_MID + l] = (s_out if same else s), (c_out if same else c_mid)
            S[S_OUT + l], S[C_OUT + l], S[T_OUT + l] = s_out, c_out, t_out
            # a leaning rim may turn back beyond the two cells, on a stretched grid it may cross more of them
            rise, fall = c * S[C_IN + l] - d * S[S_IN + l], c * c_out - d * s_out
            turn = np.floor(S[T0 + l] + math.copysign(S[FAR_T + l], rise))
            beyond = (rise * fall < 0.0) & ((turn > max(from_cell, to_cell)) | (turn < min(from_cell, to_cell)))
            doubt = S[DOUBT + l]
            S[BEYOND + l], S[CELL_TURN + l] = (1.0 if beyond else 0.0), turn
            further = max(turn - max(from_cell, to_cell), min(from_cell, to_cell) - turn)
            S[DOUBT + l] = NONE if (abs(from_cell - to_cell) > 1.0) | (beyond & (further > 1.0)) else doubt
            column = first + min(1.0 * m, S[MORE + l])
            swap = S[SWAP + l] > 0.0
            S[CELL_IN + l], S[CELL_OUT + l], S[CP + l] = from_cell, to_cell, column
            S[CI + l], S[CJ + l] = (from_cell if swap else column), (column if swap else from_cell)
        corners(S, grid, meta)
        _bound(S, S_IN, C_IN, S_MID, C_MID, CELL_IN, BOUND_IN)
        for l in range(LANES):
            swap, p, t = S[SWAP + l] > 0.0, S[CP + l], S[CELL_OUT + l]
            S[CI + l], S[CJ + l] = (t if swap else p), (p if swap else t)
        corners(S, grid, meta)
        _bound(S, S_MID, C_MID, S_OUT, C_OUT, CELL_OUT, BOUND_OUT)
        turning = 0
        for l in range(lanes):
            turning += 1 if S[BEYOND + l] > 0.0 else 0
        if turning > 0:
            # what lies beyond is not looked at: it is no lower than all of the column's part would be over that cell
            for l in range(LANES):
                swap, p, t = S[SWAP + l] > 0.0, S[CP + l], S[CELL_TURN + l]
                S[CI + l], S[CJ + l] = (t if swap else p), (p if swap else t)
            corners(S, grid, meta)
            _bound(S, S_IN, C_IN, S_OUT, C_OUT, CELL_TURN, LOW_BEYOND)
            for l in range(LANES):
                doubt, low = S[DOUBT + l], S[LOW_BEYOND + l]
                S[DOUBT + l] = min(doubt, low) if S[BEYOND + l] > 0.0 else doubt
        for l in range(LANES):
            k = 2 * m * LANES + l
            none, cell_in, cell_out, bound_in, bound_out = (
                1.0 * m > S[MORE + l], S[CELL_IN + l], S[CELL_OUT + l], S[BOUND_IN + l], S[BOUND_OUT + l],
            )  # fmt: skip
            bound_in, bound_out = (math.inf if none else bound_in), (math.inf if none | (cell_in == cell_out) else bound_out)
            S[BOUNDS + k], S[BOUNDS + LANES + k], S[CELLS + k], S[CELLS + LANES + k] = bound_in, bound_out, cell_in, cell_out
            S[S_IN + l], S[C_IN + l], S[T_IN + l] = S[S_OUT + l], S[C_OUT + l], S[T_OUT + l]


@fused
def take_up(S: Array, lanes: int) -> int:
    """Of the lanes whose LOW is below LEAST the cells of their pieces, LOW inf for others; how many they are. `lanes`: LANES."""
    lanes = min(max(lanes, 0), LANES)
    count = 0
    for l in range(lanes):
        low = S[LOW + l]
        matters = low < S[LEAST + l] - TIE
        S[LOW + l] = low if matters else math.inf
        S[CP + l] = S[FIRST + l] + np.floor(0.5 * S[PIECE + l])
        count += 1 if matters else 0
    for l in range(LANES):
        S[CT + l] = S[CELLS + np.uint64(S[PIECE + l]) * np.uint64(LANES) + np.uint64(l)]
    for l in range(lanes):
        swap, p, t = S[SWAP + l] > 0.0, S[CP + l], S[CT + l]
        S[CI + l], S[CJ + l] = (t if swap else p), (p if swap else t)
    return count


@fused
def pieces_over_cells(S: Array) -> None:
    """The ends of the pieces over the cells CP, CT, whose corners are known, and where between them to begin."""
    for l in range(LANES):
        a, b, c, d = S[A + l], S[B + l], S[C + l], S[D + l]
        over_h, over_q, h2, q2, low_p, high_p = S[OVER_H + l], S[OVER_Q + l], S[H2 + l], S[Q2 + l], S[LOW_P + l], S[HIGH_P + l]
        # from the later of two lines to come in by, to the earlier of two to go out by
        sl, cl = _crossing(a, b, over_h, h2, max(min(S[CP + l] - S[P0 + l], high_p), low_p))
        sr, cr = _crossing(a, b, over_h, h2, max(min(S[CP + l] + 1.0 - S[P0 + l], high_p), low_p))
        tl, tr, near, far = c * sl + d * cl, c * sr + d * cr, S[CT + l] - S[T0 + l], S[CT + l] + 1.0 - S[T0 + l]
        up = 1.0 if tr > tl else -1.0
        into, out = (near if up > 0.0 else far), (far if up > 0.0 else near)
        late, early = up * tl < up * into, up * tr > up * out
        s, k = _crossing(up * c, up * d, over_q, q2, up * into)
        S[SL + l], S[CL + l] = (s if late else sl), (k if late else cl)
        s, k = _crossing(up * c, up * d, over_q, q2, up * out)
        S[SR + l], S[CR + l] = (s if early else sr), (k if early else cr)
        S[LATE + l], S[EARLY + l] = (1.0 if late else 0.0), (1.0 if early else 0.0)
    for l in range(LANES):
        slope_p, slope_t, twist, f0, gs, gc, _ = _over_cell(S, l, S[CP + l], S[CT + l])
        sl, cl, sr, cr, ac, bd, e = S[SL + l], S[CL + l], S[SR + l], S[CR + l], S[AC + l], S[BD + l], S[E + l]
        S[SLOPE_P + l], S[SLOPE_T + l], S[TWIST + l], S[F0 + l], S[GS + l], S[GC + l] = slope_p, slope_t, twist, f0, gs, gc
        # where it would be with the twist's slopes of the piece's middle
        s, k = 0.5 * (sl + sr), 0.5 * (cl + cr)
        p, q = gs + twist * (2.0 * ac * s + e * k), gc + twist * (e * s + 2.0 * bd * k)
        size = 1.0 / math.sqrt(p * p + q * q)
        s, k = p * size, max(q * size, 0.0)
        before, beyond = s * cl < k * sl, sr * k < cr * s
        S[NS + l], S[NC + l] = (sl if before else (sr if beyond else s)), (cl if before else (cr if beyond else k))


@fused
def approach(S: Array) -> None:
    """One step of Newton towards the least gap of every piece, held within it."""
    for l in range(LANES):
        s, k, gs, gc, twist, e = S[NS + l], S[NC + l], S[GS + l], S[GC + l], S[TWIST + l], S[E + l]
        sl, cl, sr, cr, bent = S[SL + l], S[CL + l], S[SR + l], S[CR + l], 2.0 * (S[AC + l] - S[BD + l])
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
        S[NS + l], S[NC + l] = (sl if before else (sr if beyond else s)), (cl if before else (cr if beyond else k))
        S[BEFORE + l], S[AFTER + l] = (1.0 if before else 0.0), (1.0 if beyond else 0.0)


@fused
def hold_nearest(S: Array, meta: Array) -> None:
    """What `approach` has come to, where LOW bounds it and it is less than LEAST; DOUBT where it may not be the least there."""
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(LANES):
        s, k, gs, gc, f0, twist = S[NS + l], S[NC + l], S[GS + l], S[GC + l], S[F0 + l], S[TWIST + l]
        sl, cl, sr, cr, ac, bd, e = S[SL + l], S[CL + l], S[SR + l], S[CR + l], S[AC + l], S[BD + l], S[E + l]
        before, beyond, bent = S[BEFORE + l] > 0.0, S[AFTER + l] > 0.0, 2.0 * (ac - bd)
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
        low, doubt = S[LOW + l], S[DOUBT + l]
        # a rim that turns back out of the cell and in again is not over it all the way
        t = S[T0 + l] + S[C + l] * s + S[D + l] * k - S[CT + l]
        real = (low < FOLLOWED) | ((t > -HAIR) & (t < 1.0 + HAIR))
        S[DOUBT + l] = doubt if real & (sure | arched | (f <= low + TIE)) else min(doubt, low)
        S[NF + l] = f if real & (low < math.inf) else math.inf
        S[NS + l], S[NC + l], S[BEFORE + l], S[AFTER + l] = s, k, (1.0 if before else 0.0), (1.0 if beyond else 0.0)
    for l in range(LANES):
        f, s, k, twist, late, early = S[NF + l], S[NS + l], S[NC + l], S[TWIST + l], S[LATE + l] > 0.0, S[EARLY + l] > 0.0
        before, beyond, a, b, c, d = S[BEFORE + l] > 0.0, S[AFTER + l] > 0.0, S[A + l], S[B + l], S[C + l], S[D + l]
        # the contact's slope: the ground's, and on a ridge the one between its two sides' that is square to the rim
        along_p, along_t, rise = a * k - b * s, c * k - d * s, S[RHO + l] * s
        gp, gt = S[SLOPE_P + l] + twist * (c * s + d * k), S[SLOPE_T + l] + twist * (a * s + b * k)
        on_t, on_p = (before & late) | (beyond & early), (before & (not late)) | (beyond & (not early))
        cut = (rise - (gp * along_p if on_t else gt * along_t)) / (along_t if on_t else along_p)
        gp, gt = (cut if on_p else gp), (cut if on_t else gt)
        swap = S[SWAP + l] > 0.0
        less = (f != math.inf) & (not (f >= S[LEAST + l]))  # nan stays
        was_f, was_s, was_k, was_place, was_x, was_y = (
            S[LEAST + l], S[L_SINE + l], S[L_COSINE + l], S[L_PLACE + l], S[L_GX + l], S[L_GY + l],
        )  # fmt: skip
        gx, gy = (gt if swap else gp) * over_x, (gp if swap else gt) * over_y
        s, place = s * S[SIGN + l], S[RIM + l]
        col, row, was_col, was_row = S[CI + l], S[CJ + l], S[L_COL + l], S[L_ROW + l]
        S[LEAST + l], S[L_SINE + l], S[L_COSINE + l] = (f if less else was_f), (s if less else was_s), (k if less else was_k)
        S[L_PLACE + l], S[L_GX + l], S[L_GY + l] = (
            (place if less else was_place),
            (gx if less else was_x),
            (gy if less else was_y),
        )
        S[L_COL + l], S[L_ROW + l] = (col if less else was_col), (row if less else was_row)


@inlined
def nearest(S: Array, meta: Array) -> None:
    """The least gap of the rims over the cells CP, CT, where LOW bounds it; held where it is less than LEAST."""
    pieces_over_cells(S)
    for _ in range(3):
        approach(S)
    hold_nearest(S, meta)


@inlined
def search_rims(S: Array, grid: Array, meta: Array, rover: Array, i: int) -> None:
    """The least gap of the rims at RIM of wheel i, all along their lower halves as far as p goes."""
    set_rims(S, rover, meta, i)
    columns = 0
    for l in range(LANES):
        if S[MORE + l] < COLUMNS:
            columns = max(columns, int(S[MORE + l]) + 1)
        else:
            S[DOUBT + l] = NONE
    bound_pieces(S, grid, meta, columns)
    fill_up(S, BOUNDS, 2 * columns)
    lowest(S, BOUNDS, 2 * columns)
    while take_up(S, min(LANES, columns * LANES)) > 0:
        corners(S, grid, meta)
        nearest(S, meta)
        next_lowest(S, BOUNDS, 2 * columns)


@inlined
def follow_rims(S: Array, grid: Array, meta: Array, rover: Array, i: int) -> None:
    """The least gap of the rims at RIM of wheel i over the cells CI, CJ, for those that touch with it."""
    set_rims(S, rover, meta, i)
    half = rover[P_HALF + i]
    for l in range(LANES):
        swap = S[SWAP + l] > 0.0
        S[CP + l], S[CT + l] = (S[CJ + l] if swap else S[CI + l]), (S[CI + l] if swap else S[CJ + l])
        S[LOW + l] = 2.0 * FOLLOWED if abs(S[PLACE + i * LANES + l]) >= half else math.inf
    corners(S, grid, meta)
    nearest(S, meta)
