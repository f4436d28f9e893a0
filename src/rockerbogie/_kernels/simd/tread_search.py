"""Where the treads of `LANES` wheels come nearest to bilinear ground inside their width.

There the lower side T of a tread is convex, and straight along the axle; so it is nearest over an edge of a cell, where the
ground has its ridges, or inside a cell that is hollow along the axle (`bilinear_cell` says the same of one wheel). T lies nowhere
below a parabola that touches it at the same height on both sides, since over u² it is convex too. That bounds the gap over every
edge and every cell; they are looked at in the order of their bounds, until none is below the least gap found.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined, njit
from ..model.ground import META_DX, META_DY, META_NX, META_NY, META_STEEP
from ..model.linkage import P_HALF, P_RADIUS
from ..model.tolerances import GAP_TIE
from .linkage import AZ, LANES, OX, OY, OZ, PLACE, SINE, UZ, VX, VY, Q, X, Y, rows
from .lowest_bound import LOW, PIECE, fill_up, lowest, next_lowest
from .rim_search import (
    CI,
    CJ,
    DOUBT,
    H00,
    H01,
    H10,
    H11,
    HOME_X,
    HOME_Y,
    L_COL,
    L_COSINE,
    L_PLACE,
    L_ROW,
    L_SINE,
    LEAST,
    NONE,
    RIM_ROWS,
    corners,
)

Array = NDArray[np.float64]

SIDE = 48  # nodes under one wheel along x or y, at most
ROOM = SIDE * SIDE
TINY = 1e-14  # m: an edge right along the axle has no place where it is least; either end will do

# A wheel: its hub's height, cos τ, tan τ, 1 / cos τ and the axle's z; u and v from its hub at the map's first node, how they
# change from node to node along x and y, and the inverse of u's change and of v's; from where to where the tread is along v; the
# parabola that touches T where the contact was, P_0 + P_UU u² + v tan τ, and the inverses of how its slope changes along edges in
# x and y; the same of that which touches T at its lowest; the first and last node under it along x and y; a cell's area; its half
# width, or less than none where no contact is sought; what `clear_above` knows and says; whether there is room for its nodes,
# their greatest rises along x and y, and what was said of all the ground.
(
    ZH, COS, TAN, OVER, AXLE_Z, U0, V0, U_X, U_Y, V_X, V_Y, OVER_X, OVER_Y, ASIDE_X, ASIDE_Y, V_LOW, V_HIGH,
    P_0, P_UU, P_X, P_Y, B_0, B_UU, B_X, B_Y, COL_0, ROW_0, COL_1, ROW_1, DET, HALF, MAX_SLOPE_SQUARED, CLEAR, FITS,
    RISE_X, RISE_Y, CLEAR_ALL, _nodes,
) = rows(RIM_ROWS, (LANES,) * 37)  # fmt: skip
# The nodes under a wheel, row by row: their heights, and the bounds of the edges to the right and above, or of the cell between.
HEIGHTS, NODE_BOUNDS, EDGE_ROWS = rows(_nodes, (ROOM * LANES,) * 2)


@fma_njit
def set_treads(lanes: Array, rover: Array, meta: Array, i: int) -> None:
    """The tread of wheel i."""
    i = min(max(i, 0), 5)
    radius, half = rover[P_RADIUS + i], rover[P_HALF + i]
    dx, dy, last_x, last_y = meta[META_DX], meta[META_DY], meta[META_NX] - 1.0, meta[META_NY] - 1.0
    for l in range(LANES):
        k = i * LANES + l
        vx, vy, az, uz = lanes[VX + k], lanes[VY + k], lanes[AZ + k], lanes[UZ + k]
        x, y = lanes[X + l] + lanes[OX + k], lanes[Y + l] + lanes[OY + k]
        over = 1.0 / uz
        sine = min(max(lanes[SINE + k], -0.999), 0.999)
        cosine = math.sqrt(1.0 - sine * sine)
        lanes[ZH + l], lanes[COS + l], lanes[TAN + l], lanes[OVER + l], lanes[AXLE_Z + l] = (
            lanes[Q + l] + lanes[OZ + k],
            uz,
            az * over,
            over,
            az,
        )
        lanes[U0 + l], lanes[V0 + l] = y * vx - x * vy, -x * vx - y * vy
        lanes[U_X + l], lanes[U_Y + l], lanes[V_X + l], lanes[V_Y + l] = vy * dx, -vx * dy, vx * dx, vy * dy
        lanes[OVER_X + l], lanes[OVER_Y + l] = 1.0 / (vy * dx + TINY), 1.0 / (TINY - vx * dy)
        lanes[ASIDE_X + l], lanes[ASIDE_Y + l] = 1.0 / (vx * dx + TINY), 1.0 / (vy * dy + TINY)
        lanes[V_LOW + l], lanes[V_HIGH + l] = (
            min(radius * az, 0.0) - half * uz - GAP_TIE,
            max(radius * az, 0.0) + half * uz + GAP_TIE,
        )
        lanes[DET + l], lanes[HALF + l], lanes[MAX_SLOPE_SQUARED + l] = dx * dy, half, meta[META_STEEP] * meta[META_STEEP]
        touching, bottom = 0.5 * over / (radius * cosine), 0.5 * over / radius
        lanes[P_0 + l], lanes[P_UU + l] = (
            lanes[Q + l] + lanes[OZ + k] - touching * radius * radius * (1.0 + cosine * cosine),
            touching,
        )
        lanes[B_0 + l], lanes[B_UU + l] = lanes[Q + l] + lanes[OZ + k] - radius * over, bottom
        lanes[P_X + l], lanes[P_Y + l] = 0.5 / (touching * vy * vy * dx * dx + TINY), 0.5 / (touching * vx * vx * dy * dy + TINY)
        lanes[B_X + l], lanes[B_Y + l] = 0.5 / (bottom * vy * vy * dx * dx + TINY), 0.5 / (bottom * vx * vx * dy * dy + TINY)
        far_x = half * abs(uz * vx) + radius * math.sqrt(vy * vy + az * az * vx * vx)
        far_y = half * abs(uz * vy) + radius * math.sqrt(vx * vx + az * az * vy * vy)
        lanes[COL_0 + l], lanes[COL_1 + l] = max(np.floor((x - far_x) / dx), 0.0), min(np.floor((x + far_x) / dx) + 1.0, last_x)
        lanes[ROW_0 + l], lanes[ROW_1 + l] = max(np.floor((y - far_y) / dy), 0.0), min(np.floor((y + far_y) / dy) + 1.0, last_y)


@njit
def nodes_under(lanes: Array) -> tuple[int, int]:
    """How many nodes along x and y there are under the widest of the wheels; FITS is 0 where they are too many."""
    columns = lines = 0
    for l in range(LANES):
        nx, ny = lanes[COL_1 + l] - lanes[COL_0 + l] + 1.0, lanes[ROW_1 + l] - lanes[ROW_0 + l] + 1.0
        lanes[FITS + l] = 1.0 if nx <= SIDE and ny <= SIDE else 0.0
        if lanes[FITS + l] > 0.0:
            columns, lines = max(columns, int(nx)), max(lines, int(ny))
    return columns, lines


@fma_njit
def take_heights(lanes: Array, grid: Array, columns: int, lines: int) -> None:
    """Fill HEIGHTS, row by row; a lane that has fewer nodes along x or y has its last ones again."""
    columns, lines = min(max(columns, 0), SIDE), min(max(lines, 0), SIDE)
    for m in range(lines):
        for n in range(columns):
            at = HEIGHTS + min(m * columns + n, ROOM - 1) * LANES
            for l in range(LANES):
                column, row = (
                    max(min(lanes[COL_0 + l] + n, lanes[COL_1 + l]), 0.0),
                    max(min(lanes[ROW_0 + l] + m, lanes[ROW_1 + l]), 0.0),
                )
                home_x, home_y = lanes[HOME_X + l], lanes[HOME_Y + l]
                lanes[CI + l], lanes[CJ + l] = (column if column == column else home_x), (row if row == row else home_y)
            for l in range(LANES):
                lanes[H00 + l] = grid[np.uint64(lanes[CJ + l]), np.uint64(lanes[CI + l])]
            for l in range(LANES):
                lanes[at + l] = lanes[H00 + l]


@inlined
def _edge(
    radius: float, half: float, zh: float, cos: float, tan: float, over: float, az: float,
    h: float, to: float, u: float, v: float, du: float, dv: float, over_du: float,
) -> tuple[float, float, float, float, bool]:  # fmt: skip
    """The least of T - h on the edge from (u, v) along (du, dv), of heights h and `to`: gap, sin φ, cos φ, s, and whether that
    is inside the tread."""
    rise = to - h
    m = (rise - dv * tan) * cos * over_du  # u / q where T runs along the edge as the ground does
    t = min(max((radius * m / math.sqrt(1.0 + m * m) - u) * over_du, 0.0), 1.0)
    at_u, at_v = u + t * du, v + t * dv
    square = radius * radius - at_u * at_u
    q = math.sqrt(max(square, 0.0))
    s = (at_v - q * az) * over
    gap = zh + at_v * tan - q * over - h - t * rise
    return gap, at_u / radius, q / radius, s, (square > 0.0) & (abs(s) <= half)


@inlined
def _keep_lower_inside(
    lanes: Array, l: int, gap: float, sine: float, cosine: float, s: float, col: float, row: float, there: bool
) -> None:
    """Hold a place inside the tread, if it is there and the lowest yet."""
    least, was_sine, was_cosine, was_s, was_col, was_row = (
        lanes[LEAST + l], lanes[L_SINE + l], lanes[L_COSINE + l], lanes[L_PLACE + l], lanes[L_COL + l], lanes[L_ROW + l],
    )  # fmt: skip
    less = there & (gap < least)
    lanes[LEAST + l], lanes[L_PLACE + l] = (gap if less else least), (s if less else was_s)
    lanes[L_SINE + l], lanes[L_COSINE + l] = (sine if less else was_sine), (cosine if less else was_cosine)
    lanes[L_COL + l], lanes[L_ROW + l] = (col if less else was_col), (row if less else was_row)


@inlined
def _under(radius: float, low: float, high: float, u: float, v: float, over_u: float, over_v: float) -> tuple[float, float]:
    """From where to where along an edge, 0 to 1, it lies under the tread; the other way round where it does not."""
    a, b, c, d = (-radius - u) * over_u, (radius - u) * over_u, (low - v) * over_v, (high - v) * over_v
    return max(max(min(a, b), min(c, d)), 0.0), min(min(max(a, b), max(c, d)), 1.0)


@inlined
def _room(first: float, last: float, start: float, slope: float, curvature: float, back: float) -> float:
    """The least of start + slope t + bend t² from t = first to last; back is 1 / (2 bend)."""
    t = min(max(-slope * back, first), last)
    return start + t * (slope + t * curvature) if first <= last else math.inf


@fma_njit
def bound_edges(lanes: Array, rover: Array, i: int, columns: int, lines: int) -> None:
    """Fill NODE_BOUNDS: no gap of wheel i over the two edges is lower."""
    radius = rover[P_RADIUS + min(max(i, 0), 5)] + GAP_TIE
    columns, lines = min(max(columns, 0), SIDE), min(max(lines, 0), SIDE)
    for m in range(lines):
        for n in range(columns):
            at = HEIGHTS + min(m * columns + n, ROOM - 1) * LANES
            right, above, out = at + LANES, HEIGHTS + min((m + 1) * columns + n, ROOM - 1) * LANES, at + (NODE_BOUNDS - HEIGHTS)
            for l in range(LANES):
                h, h_right, h_above = lanes[at + l], lanes[right + l], lanes[above + l]
                col, row, du, dv, eu, ev = (
                    lanes[COL_0 + l] + n, lanes[ROW_0 + l] + m, lanes[U_X + l], lanes[V_X + l], lanes[U_Y + l], lanes[V_Y + l],
                )  # fmt: skip
                u, v = lanes[U0 + l] + col * du + row * eu, lanes[V0 + l] + col * dv + row * ev
                tan, p, b, square = lanes[TAN + l], lanes[P_UU + l], lanes[B_UU + l], u * u
                level, to_right, to_above = tan * v - h, tan * dv - (h_right - h), tan * ev - (h_above - h)
                first, last = _under(radius, lanes[V_LOW + l], lanes[V_HIGH + l], u, v, lanes[OVER_X + l], lanes[ASIDE_X + l])
                of_right = max(
                    _room(
                        first, last, lanes[P_0 + l] + p * square + level, 2.0 * p * u * du + to_right, p * du * du, lanes[P_X + l]
                    ),
                    _room(
                        first, last, lanes[B_0 + l] + b * square + level, 2.0 * b * u * du + to_right, b * du * du, lanes[B_X + l]
                    ),
                )
                first, last = _under(radius, lanes[V_LOW + l], lanes[V_HIGH + l], u, v, lanes[OVER_Y + l], lanes[ASIDE_Y + l])
                of_above = max(
                    _room(
                        first, last, lanes[P_0 + l] + p * square + level, 2.0 * p * u * eu + to_above, p * eu * eu, lanes[P_Y + l]
                    ),
                    _room(
                        first, last, lanes[B_0 + l] + b * square + level, 2.0 * b * u * eu + to_above, b * eu * eu, lanes[B_Y + l]
                    ),
                )
                known = h == h
                of_right = (
                    of_right if known & (h_right == h_right) & (col < lanes[COL_1 + l]) & (row <= lanes[ROW_1 + l]) else math.inf
                )
                of_above = (
                    of_above if known & (h_above == h_above) & (col <= lanes[COL_1 + l]) & (row < lanes[ROW_1 + l]) else math.inf
                )
                lanes[out + l] = min(of_right, of_above)


@fma_njit
def take_heights_of_edges(lanes: Array, columns: int) -> None:
    """Heights of the nodes PIECE, and to the right of them and above."""
    columns = min(max(columns, 0), SIDE)
    for l in range(LANES):
        piece = min(max(int(lanes[PIECE + l]), 0), ROOM - 1)
        lanes[H00 + l], lanes[H01 + l] = lanes[HEIGHTS + piece * LANES + l], lanes[HEIGHTS + min(piece + 1, ROOM - 1) * LANES + l]
        lanes[H10 + l] = lanes[HEIGHTS + min(piece + columns, ROOM - 1) * LANES + l]


@fma_njit
def edges_of_nodes(lanes: Array, rover: Array, i: int) -> None:
    """The least gap of wheel i over the edges to the right of the nodes CI, CJ and above, where LOW bounds it."""
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    for l in range(LANES):
        col, row, du, dv, eu, ev = lanes[CI + l], lanes[CJ + l], lanes[U_X + l], lanes[V_X + l], lanes[U_Y + l], lanes[V_Y + l]
        u, v, h, sought = (
            lanes[U0 + l] + col * du + row * eu,
            lanes[V0 + l] + col * dv + row * ev,
            lanes[H00 + l],
            lanes[LOW + l] < math.inf,
        )
        half, zh, cos, tan, over, az = (
            lanes[HALF + l],
            lanes[ZH + l],
            lanes[COS + l],
            lanes[TAN + l],
            lanes[OVER + l],
            lanes[AXLE_Z + l],
        )
        end_col, end_row, over_x, over_y = lanes[COL_1 + l], lanes[ROW_1 + l], lanes[OVER_X + l], lanes[OVER_Y + l]
        gap, sine, cosine, s, inside = _edge(radius, half, zh, cos, tan, over, az, h, lanes[H01 + l], u, v, du, dv, over_x)
        _keep_lower_inside(lanes, l, gap, sine, cosine, s, col, row, sought & inside & (col < end_col) & (row <= end_row))
        gap, sine, cosine, s, inside = _edge(radius, half, zh, cos, tan, over, az, h, lanes[H10 + l], u, v, eu, ev, over_y)
        _keep_lower_inside(lanes, l, gap, sine, cosine, s, col, row, sought & inside & (col <= end_col) & (row < end_row))


@fma_njit
def edges_of_cells(lanes: Array, rover: Array, i: int) -> None:
    """The least gap of wheel i over the four edges of the cells CI, CJ, whose corners are known."""
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    for l in range(LANES):
        col, row, du, dv, eu, ev = lanes[CI + l], lanes[CJ + l], lanes[U_X + l], lanes[V_X + l], lanes[U_Y + l], lanes[V_Y + l]
        u, v = lanes[U0 + l] + col * du + row * eu, lanes[V0 + l] + col * dv + row * ev
        half, zh, cos, tan, over, az = (
            lanes[HALF + l],
            lanes[ZH + l],
            lanes[COS + l],
            lanes[TAN + l],
            lanes[OVER + l],
            lanes[AXLE_Z + l],
        )
        over_x, over_y = lanes[OVER_X + l], lanes[OVER_Y + l]
        gap, sine, cosine, s, inside = _edge(
            radius, half, zh, cos, tan, over, az, lanes[H00 + l], lanes[H01 + l], u, v, du, dv, over_x
        )
        _keep_lower_inside(lanes, l, gap, sine, cosine, s, col, row, inside)
        gap, sine, cosine, s, inside = _edge(
            radius, half, zh, cos, tan, over, az, lanes[H00 + l], lanes[H10 + l], u, v, eu, ev, over_y
        )
        _keep_lower_inside(lanes, l, gap, sine, cosine, s, col, row, inside)
        gap, sine, cosine, s, inside = _edge(
            radius, half, zh, cos, tan, over, az, lanes[H10 + l], lanes[H11 + l], u + eu, v + ev, du, dv, over_x
        )
        _keep_lower_inside(lanes, l, gap, sine, cosine, s, col, row, inside)
        gap, sine, cosine, s, inside = _edge(
            radius, half, zh, cos, tan, over, az, lanes[H01 + l], lanes[H11 + l], u + du, v + dv, eu, ev, over_y
        )
        _keep_lower_inside(lanes, l, gap, sine, cosine, s, col, row, inside)


@fma_njit
def bound_cells(lanes: Array, rover: Array, i: int, columns: int, lines: int) -> None:
    """Fill NODE_BOUNDS: no gap inside a cell is lower; inf where none is least there.

    For that the ground has to be hollow along the axle, its slope h_v has to be tan τ somewhere in the cell, and across the axle
    the tread has to bend more than the ground does there: r² / (q³ cos τ) > twist / |2 v_x v_y|, where q is least, at the
    greatest u.
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    columns, lines = min(max(columns, 0), SIDE), min(max(lines, 0), SIDE)
    for m in range(lines):
        for n in range(columns):
            at = HEIGHTS + min(m * columns + n, ROOM - 1) * LANES
            right, above, out = at + LANES, HEIGHTS + min((m + 1) * columns + n, ROOM - 1) * LANES, at + (NODE_BOUNDS - HEIGHTS)
            beyond = min(above + LANES, HEIGHTS + (ROOM - 1) * LANES)
            for l in range(LANES):
                a, b, d, e = lanes[at + l], lanes[right + l], lanes[above + l], lanes[beyond + l]
                col, row, du, dv, eu, ev = (
                    lanes[COL_0 + l] + n, lanes[ROW_0 + l] + m, lanes[U_X + l], lanes[V_X + l], lanes[U_Y + l], lanes[V_Y + l],
                )  # fmt: skip
                tan, p, det = lanes[TAN + l], lanes[P_UU + l], lanes[DET + l]
                u, v = lanes[U0 + l] + col * du + row * eu, lanes[V0 + l] + col * dv + row * ev
                # the plane that touches the parabola over the cell's middle
                middle = u + 0.5 * (du + eu)
                by_u = 2.0 * p * middle
                z, zx, zy = lanes[P_0 + l] - p * middle * middle + by_u * u + tan * v, by_u * du + tan * dv, by_u * eu + tan * ev
                bound = min(min(z - a, z + zx - b), min(z + zy - d, z + zx + zy - e))
                twist = a - b - d + e
                # h_v at the low corner, times det, and how much it changes along x and y
                hv, hvx, hvy = (d - a) * du - (b - a) * eu - tan * det, twist * du, -twist * eu
                falls, rises = hv + min(hvx, 0.0) + min(hvy, 0.0) < 0.0, hv + max(hvx, 0.0) + max(hvy, 0.0) > 0.0
                far = min(abs(middle) + 0.5 * (abs(du) + abs(eu)), 0.9999999 * radius)
                square = radius * radius - far * far
                bends = 2.0 * radius * radius * abs(du * eu) >= abs(twist) * lanes[COS + l] * square * math.sqrt(square)
                there = (col < lanes[COL_1 + l]) & (row < lanes[ROW_1 + l]) & (twist * du * eu > 0.0) & falls & rises & bends
                lanes[out + l] = bound if there else math.inf


@fma_njit
def insides(lanes: Array, rover: Array, meta: Array, i: int) -> None:
    """The least gap of wheel i inside the cells CI, CJ, whose corners are known, where LOW bounds it.

    Along the axle T - h is least where h_v = tan τ, on a line v = v0 + v1 u; on that line it falls and rises by
    f = u / (q cos τ) + k1 + k2 u. Over m = u / q that is hollow for m > 0 and arched for m < 0, so Newton finds where it
    comes to rise through 0 from the line's far ends: from the right one if it rises there, else from the left one.
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    end = 0.9999999 * radius
    for l in range(LANES):
        col, row, tan, over = lanes[CI + l], lanes[CJ + l], lanes[TAN + l], lanes[OVER + l]
        du, dv, eu, ev, over_det = (
            lanes[U_X + l],
            lanes[V_X + l],
            lanes[U_Y + l],
            lanes[V_Y + l],
            1.0 / lanes[DET + l],
        )  # of a step along x, along y
        a, slope_x, slope_y = lanes[H00 + l], lanes[H01 + l] - lanes[H00 + l], lanes[H10 + l] - lanes[H00 + l]
        twist = lanes[H11 + l] - lanes[H01 + l] - slope_y
        # from the cell's low corner (u', v') is at x = xu u' + xv v', y = yu u' + yv v'
        xu, xv, yu, yv = ev * over_det, -eu * over_det, -dv * over_det, du * over_det
        u, v = lanes[U0 + l] + col * du + row * eu, lanes[V0 + l] + col * dv + row * ev
        hu, hv, huu, huv, hvv = (
            slope_x * xu + slope_y * yu, slope_x * xv + slope_y * yv,
            2.0 * twist * xu * yu, twist * (xu * yv + xv * yu), 2.0 * twist * xv * yv,
        )  # fmt: skip
        low, doubt = lanes[LOW + l], lanes[DOUBT + l]
        hollow = (hvv < -1e-9) & (low < math.inf)
        over_hvv = 1.0 / min(hvv, -1e-9)
        w0, w1 = (tan - hv) * over_hvv, -huv * over_hvv  # the line is v' = w0 + w1 u'
        k2 = -(huu + huv * w1)
        k1 = w1 * tan - hu - hv * w1 - (huv + hvv * w1) * w0 - k2 * u
        # it is over the cell from `left` to `right`
        ax, bx, ay, by = xv * w0, xu + xv * w1 + TINY, yv * w0, yu + yv * w1 + TINY
        over_bx, over_by = 1.0 / bx, 1.0 / by
        x0, x1, y0, y1 = -ax * over_bx, (1.0 - ax) * over_bx, -ay * over_by, (1.0 - ay) * over_by
        left = max(max(min(x0, x1), min(y0, y1)) + u, -end)
        right = min(min(max(x0, x1), max(y0, y1)) + u, end)
        hollow &= left < right
        left, right = min(left, end), max(right, -end)
        m0, m1 = left / math.sqrt(radius * radius - left * left), right / math.sqrt(radius * radius - right * right)
        f0, f1 = m0 * over + k1 + k2 * left, m1 * over + k1 + k2 * right
        twice = (f0 < 0.0) & (f1 > 0.0) & (k2 * radius < -over)  # it may come to rise twice
        rightly = f1 > 0.0
        m = m1 if rightly else m0
        limit = (-math.inf if f0 < 0.0 else max(m0, 0.0)) if rightly else min(m1, 0.0)
        gone = False  # beyond that, or to where it falls: it does not come to rise
        for _ in range(6):
            w = 1.0 / math.sqrt(1.0 + m * m)
            off, steep = m * over + k1 + k2 * radius * m * w, over + k2 * radius * w * w * w
            to = m - off / steep
            gone |= (steep <= 0.0) | ((to < limit) if rightly else (to > limit))
            m = m if gone else to
        w = 1.0 / math.sqrt(1.0 + m * m)
        off, steep = m * over + k1 + k2 * radius * m * w, over + k2 * radius * w * w * w
        at, q = radius * m * w, radius * w
        at_v = w0 + w1 * (at - u)
        x, y = xu * (at - u) + xv * at_v, yu * (at - u) + yv * at_v
        s = (v + at_v - q * lanes[AXLE_Z + l]) * over
        gap = lanes[ZH + l] + (v + at_v) * tan - q * over - (a + slope_x * x + slope_y * y + twist * x * y)
        found = (abs(off) < 1e-6) & (steep > 0.0)
        none = gone | ((f1 <= 0.0) & (f0 >= 0.0))
        lanes[DOUBT + l] = min(doubt, low) if hollow & (twice | (not (found | none))) else doubt
        there = hollow & found & (not none) & (at >= left) & (at <= right) & (abs(s) <= lanes[HALF + l])
        _keep_lower_inside(lanes, l, gap, m * w, w, s, col, row, there)


@fma_njit
def take_up_nodes(lanes: Array, columns: int) -> float:
    """CI, CJ of the lanes whose LOW is below LEAST, LOW inf for others; how many they are."""
    over = 1.0 / columns
    for l in range(LANES):
        low = lanes[LOW + l]
        lanes[LOW + l] = low if low < lanes[LEAST + l] - GAP_TIE else math.inf
        row = np.floor((lanes[PIECE + l] + 0.5) * over)
        lanes[CI + l], lanes[CJ + l] = lanes[COL_0 + l] + lanes[PIECE + l] - row * columns, lanes[ROW_0 + l] + row
    lane_count = 0.0
    for l in range(LANES):
        lane_count += 1.0 if lanes[LOW + l] < math.inf else 0.0
    return lane_count


@inlined
def search_insides(lanes: Array, grid: Array, meta: Array, rover: Array, i: int, columns: int, lines: int) -> None:
    """The least gap of wheel i inside its tread, where HEIGHTS are known and `search_rims` has been."""
    for l in range(LANES):
        lanes[DOUBT + l] = lanes[DOUBT + l] if lanes[FITS + l] > 0.0 else NONE
    fill_up(lanes, NODE_BOUNDS, columns * lines)
    bound_edges(lanes, rover, i, columns, lines)
    lowest(lanes, NODE_BOUNDS, columns * lines)
    while take_up_nodes(lanes, columns) > 0.0:
        take_heights_of_edges(lanes, columns)
        edges_of_nodes(lanes, rover, i)
        next_lowest(lanes, NODE_BOUNDS, columns * lines)
    bound_cells(lanes, rover, i, columns, lines)
    lowest(lanes, NODE_BOUNDS, columns * lines)
    while take_up_nodes(lanes, columns) > 0.0:
        corners(lanes, grid, meta)
        insides(lanes, rover, meta, i)
        next_lowest(lanes, NODE_BOUNDS, columns * lines)


@inlined
def follow_insides(lanes: Array, rover: Array, meta: Array, i: int) -> None:
    """The least gap of wheel i over the cells CI, CJ, whose corners are known, for those that do not touch with a rim."""
    half = rover[P_HALF + i]
    for l in range(LANES):
        inside = abs(lanes[PLACE + i * LANES + l]) < half
        lanes[HALF + l], lanes[LOW + l] = (half, NONE) if inside else (-1.0, math.inf)
    edges_of_cells(lanes, rover, i)
    insides(lanes, rover, meta, i)
