"""Gap of the treads of `LANES` wheels over the edges of cells of bilinear terrain.

Inside its width, the lower side of a tread is convex, and straight along the axle. So the lowest gap is over an edge of a cell,
where the terrain has ridges, or inside a cell (`tread_search`). The tread is nowhere below a parabola that touches it at the same
height on both sides, because it is convex over u² as well. That bounds the gap over every edge and every cell.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..model.linkage import P_RADIUS
from ..model.tolerances import GAP_TIE
from .layout import BOUND, CELL, LANES, LOWEST, NODES, ROOM, SIDE, TREAD, in_use

Array = NDArray[np.float64]


class GridEdge(NamedTuple):
    """Edge of a cell along x or y, in the tread's coordinates."""

    du: float  # end minus start, m
    dv: float
    over_du: float  # 1 / du, kept finite
    over_dv: float  # 1 / dv, kept finite
    p_back: float  # 1 / (2 × curvature coefficient of P along the edge)
    b_back: float  # the same of B


@inlined
def _along_x(lanes: Array, l: int) -> GridEdge:
    """Return the edges along x.

    Args:
        lanes: the lane array (`layout`).
        l: lane.

    Reads:  TREAD.u_x, TREAD.v_x, TREAD.over_x, TREAD.aside_x, TREAD.p_x, TREAD.b_x
    Writes: none
    """
    return GridEdge(
        lanes[TREAD.u_x + l],
        lanes[TREAD.v_x + l],
        lanes[TREAD.over_x + l],
        lanes[TREAD.aside_x + l],
        lanes[TREAD.p_x + l],
        lanes[TREAD.b_x + l],
    )


@inlined
def _along_y(lanes: Array, l: int) -> GridEdge:
    """Return the edges along y.

    Args:
        lanes: the lane array (`layout`).
        l: lane.

    Reads:  TREAD.u_y, TREAD.v_y, TREAD.over_y, TREAD.aside_y, TREAD.p_y, TREAD.b_y
    Writes: none
    """
    return GridEdge(
        lanes[TREAD.u_y + l],
        lanes[TREAD.v_y + l],
        lanes[TREAD.over_y + l],
        lanes[TREAD.aside_y + l],
        lanes[TREAD.p_y + l],
        lanes[TREAD.b_y + l],
    )


@inlined
def _keep_lower_edge(
    lanes: Array, l: int, radius: float, h: float, to: float, start: tuple[float, float], edge: GridEdge,
    col: float, row: float, counts: bool,
) -> None:  # fmt: skip
    """Find the lowest gap over one edge of a cell, and keep it if it is lower.

    Args:
        lanes: the lane array (`layout`).
        l: lane.
        radius: radius of the wheel, m.
        h: height at the start of the edge, m.
        to: height at its end, m.
        start: u and v of its start, m.
        edge: the edge.
        col, row: its cell.
        counts: True if the edge exists.

    Reads:  LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row, TREAD.zh, TREAD.cos, TREAD.tan,
            TREAD.over, TREAD.az, TREAD.half
    Writes: LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row
    """
    u, v = start
    half, zh, cos, tan, over, az = (
        lanes[TREAD.half + l],
        lanes[TREAD.zh + l],
        lanes[TREAD.cos + l],
        lanes[TREAD.tan + l],
        lanes[TREAD.over + l],
        lanes[TREAD.az + l],
    )
    rise = to - h
    m = (rise - edge.dv * tan) * cos * edge.over_du  # u / q where T is parallel to the edge
    t = min(max((radius * m / math.sqrt(1.0 + m * m) - u) * edge.over_du, 0.0), 1.0)
    at_u, at_v = u + t * edge.du, v + t * edge.dv
    square = radius * radius - at_u * at_u
    q = math.sqrt(max(square, 0.0))
    s = (at_v - q * az) * over
    gap = zh + at_v * tan - q * over - h - t * rise
    inside = (square > 0.0) & (abs(s) <= half)
    keep_lower_inside(lanes, l, gap, at_u / radius, q / radius, s, col, row, counts & inside)


@inlined
def keep_lower_inside(
    lanes: Array, l: int, gap: float, sine: float, cosine: float, s: float, col: float, row: float, there: bool
) -> None:
    """Keep a point inside the tread if its gap is lower than the lowest so far.

    Args:
        lanes: the lane array (`layout`).
        l: lane.
        gap: its gap, m.
        sine: sin φ.
        cosine: cos φ.
        s: position along the axle, m.
        col: its cell along x.
        row: its cell along y.
        there: True if the point counts.

    Reads:  LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row
    Writes: LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row
    """
    least, was_sine, was_cosine, was_s, was_col, was_row = (
        lanes[LOWEST.gap + l],
        lanes[LOWEST.sine + l],
        lanes[LOWEST.cosine + l],
        lanes[LOWEST.offset + l],
        lanes[LOWEST.col + l],
        lanes[LOWEST.row + l],
    )
    less = there & (gap < least)
    lanes[LOWEST.gap + l], lanes[LOWEST.offset + l] = (gap if less else least), (s if less else was_s)
    lanes[LOWEST.sine + l], lanes[LOWEST.cosine + l] = (sine if less else was_sine), (cosine if less else was_cosine)
    lanes[LOWEST.col + l], lanes[LOWEST.row + l] = (col if less else was_col), (row if less else was_row)


@inlined
def _under(radius: float, low: float, high: float, u: float, v: float, over_u: float, over_v: float) -> tuple[float, float]:
    """Return the part of an edge under the tread.

    Args:
        radius: half the extent along u, m.
        low: lowest v, m.
        high: highest v, m.
        u, v: start of the edge, m.
        over_u: 1 / (change of u along the edge).
        over_v: 1 / (change of v along the edge).

    Returns:
        First and last parameter, within 0 to 1; first > last if there is none.
    """
    a, b, c, d = (-radius - u) * over_u, (radius - u) * over_u, (low - v) * over_v, (high - v) * over_v
    return max(max(min(a, b), min(c, d)), 0.0), min(min(max(a, b), max(c, d)), 1.0)


@inlined
def _room(first: float, last: float, start: float, slope: float, curvature: float, back: float) -> float:
    """Return the minimum of start + slope t + curvature t² over t from first to last.

    Args:
        first: first t.
        last: last t.
        start: value at t = 0.
        slope: coefficient of t.
        curvature: coefficient of t².
        back: 1 / (2 curvature), kept finite.

    Returns:
        The minimum; infinite if first > last.
    """
    t = min(max(-slope * back, first), last)
    return start + t * (slope + t * curvature) if first <= last else math.inf


@inlined
def _bound_edge(lanes: Array, l: int, radius: float, u: float, v: float, h: float, to: float, edge: GridEdge) -> float:
    """Return a lower bound of the gap over an edge: the greater of those by P and by B.

    Args:
        lanes: the lane array (`layout`).
        l: lane.
        radius: half the extent of the tread along u, m.
        u, v: start of the edge, m.
        h: height there, m.
        to: height at the end of the edge, m.
        edge: the edge.

    Reads:  TREAD.tan, TREAD.v_low, TREAD.v_high, TREAD.p_0, TREAD.p_uu, TREAD.b_0, TREAD.b_uu
    Writes: none
    """
    tan, p, b, square = lanes[TREAD.tan + l], lanes[TREAD.p_uu + l], lanes[TREAD.b_uu + l], u * u
    level, rise = tan * v - h, tan * edge.dv - (to - h)
    first, last = _under(radius, lanes[TREAD.v_low + l], lanes[TREAD.v_high + l], u, v, edge.over_du, edge.over_dv)
    by_p = _room(
        first, last, lanes[TREAD.p_0 + l] + p * square + level, 2.0 * p * u * edge.du + rise, p * edge.du * edge.du, edge.p_back
    )
    by_b = _room(
        first, last, lanes[TREAD.b_0 + l] + b * square + level, 2.0 * b * u * edge.du + rise, b * edge.du * edge.du, edge.b_back
    )
    return max(by_p, by_b)


@fma_njit
def bound_edges(lanes: Array, rover: Array, i: int, columns: int, lines: int) -> None:
    """Compute lower bounds of wheel i's gap over the edges of the grid.

    A bound is for the edges to the right of and above a node; infinite where there are none.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.
        columns: number of nodes along x under the widest of the wheels.
        lines: number of nodes along y under the widest of the wheels.

    Reads:  TREAD.tan, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x, TREAD.over_y,
            TREAD.aside_x, TREAD.aside_y, TREAD.v_low, TREAD.v_high, TREAD.p_0, TREAD.p_uu, TREAD.p_x, TREAD.p_y, TREAD.b_0,
            TREAD.b_uu, TREAD.b_x, TREAD.b_y, TREAD.col_0, TREAD.row_0, TREAD.col_1, TREAD.row_1, NODES.height
    Writes: NODES.bound
    """
    radius = rover[P_RADIUS + min(max(i, 0), 5)] + GAP_TIE
    columns, lines = min(max(columns, 0), SIDE), min(max(lines, 0), SIDE)
    for m in range(lines):
        for n in range(columns):
            at = NODES.height + min(m * columns + n, ROOM - 1) * LANES
            right, above = at + LANES, NODES.height + min((m + 1) * columns + n, ROOM - 1) * LANES
            out = NODES.bound + min(m * columns + n, ROOM - 1) * LANES
            for l in range(in_use(lanes)):
                h, h_right, h_above = lanes[at + l], lanes[right + l], lanes[above + l]
                along_x, along_y = _along_x(lanes, l), _along_y(lanes, l)
                col, row = lanes[TREAD.col_0 + l] + n, lanes[TREAD.row_0 + l] + m
                u = lanes[TREAD.u0 + l] + col * along_x.du + row * along_y.du
                v = lanes[TREAD.v0 + l] + col * along_x.dv + row * along_y.dv
                of_right = _bound_edge(lanes, l, radius, u, v, h, h_right, along_x)
                of_above = _bound_edge(lanes, l, radius, u, v, h, h_above, along_y)
                known = h == h
                has_right = known & (h_right == h_right) & (col < lanes[TREAD.col_1 + l]) & (row <= lanes[TREAD.row_1 + l])
                has_above = known & (h_above == h_above) & (col <= lanes[TREAD.col_1 + l]) & (row < lanes[TREAD.row_1 + l])
                of_right, of_above = (of_right if has_right else math.inf), (of_above if has_above else math.inf)
                lanes[out + l] = min(of_right, of_above)


@fma_njit
def take_heights_of_edges(lanes: Array, columns: int) -> None:
    """Copy the heights of the nodes BOUND.piece and of their neighbours to the right and above.

    Args:
        lanes: the lane array (`layout`).
        columns: number of nodes along x under the widest of the wheels.

    Reads:  BOUND.piece, NODES.height
    Writes: CELL.h00, CELL.h01, CELL.h10
    """
    columns = min(max(columns, 0), SIDE)
    for l in range(in_use(lanes)):
        piece = min(max(int(lanes[BOUND.piece + l]), 0), ROOM - 1)
        lanes[CELL.h00 + l], lanes[CELL.h01 + l] = (
            lanes[NODES.height + piece * LANES + l],
            lanes[NODES.height + min(piece + 1, ROOM - 1) * LANES + l],
        )
        lanes[CELL.h10 + l] = lanes[NODES.height + min(piece + columns, ROOM - 1) * LANES + l]


@fma_njit
def edges_of_nodes(lanes: Array, rover: Array, i: int) -> None:
    """Find wheel i's lowest gap over two edges, and keep it if lower.

    The edges are to the right of and above the node (CELL.col, CELL.row).

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.

    Reads:  BOUND.low, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset,
            LOWEST.col, LOWEST.row, TREAD.zh, TREAD.cos, TREAD.tan, TREAD.over, TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x,
            TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x, TREAD.over_y, TREAD.aside_x, TREAD.aside_y, TREAD.p_x, TREAD.p_y,
            TREAD.b_x, TREAD.b_y, TREAD.col_1, TREAD.row_1, TREAD.half
    Writes: LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    for l in range(in_use(lanes)):
        col, row, sought = lanes[CELL.col + l], lanes[CELL.row + l], lanes[BOUND.low + l] < math.inf
        end_col, end_row, h = lanes[TREAD.col_1 + l], lanes[TREAD.row_1 + l], lanes[CELL.h00 + l]
        along_x, along_y = _along_x(lanes, l), _along_y(lanes, l)
        u = lanes[TREAD.u0 + l] + col * along_x.du + row * along_y.du
        v = lanes[TREAD.v0 + l] + col * along_x.dv + row * along_y.dv
        has_right, has_above = sought & (col < end_col) & (row <= end_row), sought & (col <= end_col) & (row < end_row)
        _keep_lower_edge(lanes, l, radius, h, lanes[CELL.h01 + l], (u, v), along_x, col, row, has_right)
        _keep_lower_edge(lanes, l, radius, h, lanes[CELL.h10 + l], (u, v), along_y, col, row, has_above)


@fma_njit
def edges_of_cells(lanes: Array, rover: Array, i: int) -> None:
    """Find wheel i's lowest gap over the four edges of a cell, and keep it if lower.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.

    Reads:  CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset,
            LOWEST.col, LOWEST.row, TREAD.zh, TREAD.cos, TREAD.tan, TREAD.over, TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x,
            TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x, TREAD.over_y, TREAD.aside_x, TREAD.aside_y, TREAD.p_x, TREAD.p_y,
            TREAD.b_x, TREAD.b_y, TREAD.half
    Writes: LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    for l in range(in_use(lanes)):
        col, row, along_x, along_y = lanes[CELL.col + l], lanes[CELL.row + l], _along_x(lanes, l), _along_y(lanes, l)
        u = lanes[TREAD.u0 + l] + col * along_x.du + row * along_y.du
        v = lanes[TREAD.v0 + l] + col * along_x.dv + row * along_y.dv
        a, b, d, e = lanes[CELL.h00 + l], lanes[CELL.h01 + l], lanes[CELL.h10 + l], lanes[CELL.h11 + l]
        _keep_lower_edge(lanes, l, radius, a, b, (u, v), along_x, col, row, True)
        _keep_lower_edge(lanes, l, radius, a, d, (u, v), along_y, col, row, True)
        _keep_lower_edge(lanes, l, radius, d, e, (u + along_y.du, v + along_y.dv), along_x, col, row, True)
        _keep_lower_edge(lanes, l, radius, b, e, (u + along_x.du, v + along_x.dv), along_y, col, row, True)
