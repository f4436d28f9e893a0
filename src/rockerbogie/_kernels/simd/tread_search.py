"""Lowest gap of the treads of `LANES` wheels inside their width, on bilinear terrain.

Edges, then cells, are searched in the order of their lower bounds, until no bound is below the lowest gap found.
A minimum inside a cell needs terrain that is convex downwards along the axle (`search.bilinear_cell` has the same for one wheel).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..model.linkage import P_HALF, P_RADIUS
from ..model.tolerances import GAP_TIE
from .cells import corners
from .layout import BOUND, CELL, CONTACT, LANES, LOW_LINE, LOWEST, NODES, ROOM, SIDE, TREAD, in_use
from .lowest_bound import lowest, next_lowest, pad_bounds
from .rim_bounds import NONE
from .tread_edges import bound_edges, edges_of_cells, edges_of_nodes, keep_lower_inside, take_heights_of_edges
from .tread_nodes import TINY

Array = NDArray[np.float64]


@fma_njit
def bound_cells(lanes: Array, rover: Array, i: int, columns: int, lines: int) -> None:
    """Compute lower bounds of wheel i's gap inside every cell.

    A bound is infinite where the gap has no minimum. A minimum needs terrain that is convex downwards along the axle, whose
    slope h_v equals tan τ somewhere in the cell. Across the axle, the tread must curve more than the terrain: r² / (q³ cos
    τ) > twist / |2 v_x v_y|, with the smallest q, at the largest |u|.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.
        columns: number of nodes along x under the widest of the wheels.
        lines: number of nodes along y under the widest of the wheels.

    Reads:  TREAD.cos, TREAD.tan, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.p_0, TREAD.p_uu,
            TREAD.col_0, TREAD.row_0, TREAD.col_1, TREAD.row_1, TREAD.det, NODES.height
    Writes: NODES.bound
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    columns, lines = min(max(columns, 0), SIDE), min(max(lines, 0), SIDE)
    for m in range(lines):
        for n in range(columns):
            at = NODES.height + min(m * columns + n, ROOM - 1) * LANES
            right, above = at + LANES, NODES.height + min((m + 1) * columns + n, ROOM - 1) * LANES
            out = NODES.bound + min(m * columns + n, ROOM - 1) * LANES
            beyond = min(above + LANES, NODES.height + (ROOM - 1) * LANES)
            for l in range(in_use(lanes)):
                a, b, d, e = lanes[at + l], lanes[right + l], lanes[above + l], lanes[beyond + l]
                col, row, du, dv, eu, ev = (
                    lanes[TREAD.col_0 + l] + n,
                    lanes[TREAD.row_0 + l] + m,
                    lanes[TREAD.u_x + l],
                    lanes[TREAD.v_x + l],
                    lanes[TREAD.u_y + l],
                    lanes[TREAD.v_y + l],
                )
                tan, p, det = lanes[TREAD.tan + l], lanes[TREAD.p_uu + l], lanes[TREAD.det + l]
                u, v = lanes[TREAD.u0 + l] + col * du + row * eu, lanes[TREAD.v0 + l] + col * dv + row * ev
                # the plane that touches P over the middle of the cell
                middle = u + 0.5 * (du + eu)
                by_u = 2.0 * p * middle
                z, zx, zy = (
                    lanes[TREAD.p_0 + l] - p * middle * middle + by_u * u + tan * v,
                    by_u * du + tan * dv,
                    by_u * eu + tan * ev,
                )
                bound = min(min(z - a, z + zx - b), min(z + zy - d, z + zx + zy - e))
                twist = a - b - d + e
                # h_v at the low corner, times det, and its changes along x and y
                hv, hvx, hvy = (d - a) * du - (b - a) * eu - tan * det, twist * du, -twist * eu
                falls, rises = hv + min(hvx, 0.0) + min(hvy, 0.0) < 0.0, hv + max(hvx, 0.0) + max(hvy, 0.0) > 0.0
                far = min(abs(middle) + 0.5 * (abs(du) + abs(eu)), 0.9999999 * radius)
                square = radius * radius - far * far
                curves = 2.0 * radius * radius * abs(du * eu) >= abs(twist) * lanes[TREAD.cos + l] * square * math.sqrt(square)
                there = (
                    (col < lanes[TREAD.col_1 + l])
                    & (row < lanes[TREAD.row_1 + l])
                    & (twist * du * eu > 0.0)
                    & falls
                    & rises
                    & curves
                )
                lanes[out + l] = bound if there else math.inf


@fma_njit
def low_lines(lanes: Array, rover: Array, i: int) -> float:
    """Compute the lines over cells on which wheel i's gap is lowest along its axle.

    The cell is (CELL.col, CELL.row), whose corner heights are known. Along the axle, tread minus terrain is lowest where
    h_v = tan τ, on a line v = w0 + w1 u, if the terrain is convex downwards. Along that line its derivative is f = u / (q cos τ)
    + k1 + k2 u. The line is not open if f is not negative at its left end and not positive at its right end: no minimum
    is between.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.

    Returns:
        Number of open lines.

    Reads:  BOUND.low, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, TREAD.tan, TREAD.over, TREAD.u0, TREAD.u_x,
            TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.det, LOW_LINE.open
    Writes: LOW_LINE (all)
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    end = 0.9999999 * radius
    for l in range(in_use(lanes)):
        tan, over = lanes[TREAD.tan + l], lanes[TREAD.over + l]
        slope_x, slope_y, twist, u, (xu, xv, yu, yv) = _in_tread_coordinates(lanes, l)
        hu, hv, huu, huv, hvv = (
            slope_x * xu + slope_y * yu,
            slope_x * xv + slope_y * yv,
            2.0 * twist * xu * yu,
            twist * (xu * yv + xv * yu),
            2.0 * twist * xv * yv,
        )
        convex = (hvv < -1e-9) & (lanes[BOUND.low + l] < math.inf)
        over_hvv = 1.0 / min(hvv, -1e-9)
        w0, w1 = (tan - hv) * over_hvv, -huv * over_hvv  # the line is v' = w0 + w1 u'
        k2 = -(huu + huv * w1)
        k1 = w1 * tan - hu - hv * w1 - (huv + hvv * w1) * w0 - k2 * u
        # the line is over the cell from `left` to `right`
        ax, bx, ay, by = xv * w0, xu + xv * w1 + TINY, yv * w0, yu + yv * w1 + TINY
        over_bx, over_by = 1.0 / bx, 1.0 / by
        x0, x1, y0, y1 = -ax * over_bx, (1.0 - ax) * over_bx, -ay * over_by, (1.0 - ay) * over_by
        left = max(max(min(x0, x1), min(y0, y1)) + u, -end)
        right = min(min(max(x0, x1), max(y0, y1)) + u, end)
        convex &= left < right
        left, right = min(left, end), max(right, -end)
        m0, m1 = left / math.sqrt(radius * radius - left * left), right / math.sqrt(radius * radius - right * right)
        f0, f1 = m0 * over + k1 + k2 * left, m1 * over + k1 + k2 * right
        lanes[LOW_LINE.w0 + l], lanes[LOW_LINE.w1 + l], lanes[LOW_LINE.k1 + l], lanes[LOW_LINE.k2 + l] = w0, w1, k1, k2
        lanes[LOW_LINE.left + l], lanes[LOW_LINE.right + l] = left, right
        lanes[LOW_LINE.m_left + l], lanes[LOW_LINE.m_right + l] = m0, m1
        lanes[LOW_LINE.open + l] = 1.0 if convex & (not ((f1 <= 0.0) & (f0 >= 0.0))) else 0.0
    count = 0.0
    for l in range(in_use(lanes)):
        count += lanes[LOW_LINE.open + l]
    return count


@inlined
def _in_tread_coordinates(lanes: Array, l: int) -> tuple[float, float, float, float, tuple[float, float, float, float]]:
    """Return a cell's slopes, and its axes in the coordinates of the tread.

    (u', v') from the cell's low corner is at x = xu u' + xv v', y = yu u' + yv v'.

    Args:
        lanes: the lane array (`layout`).
        l: lane.

    Returns:
        Slopes along x and y at the low corner and twist, m per cell; u of the corner; xu, xv, yu, yv.

    Reads:  CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, TREAD.u0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y,
            TREAD.det
    Writes: none
    """
    du, dv, eu, ev, over_det = (
        lanes[TREAD.u_x + l],
        lanes[TREAD.v_x + l],
        lanes[TREAD.u_y + l],
        lanes[TREAD.v_y + l],
        1.0 / lanes[TREAD.det + l],
    )  # of a step along x, along y
    slope_x, slope_y = lanes[CELL.h01 + l] - lanes[CELL.h00 + l], lanes[CELL.h10 + l] - lanes[CELL.h00 + l]
    twist = lanes[CELL.h11 + l] - lanes[CELL.h01 + l] - slope_y
    u = lanes[TREAD.u0 + l] + lanes[CELL.col + l] * du + lanes[CELL.row + l] * eu
    return slope_x, slope_y, twist, u, (ev * over_det, -eu * over_det, -dv * over_det, du * over_det)


@fma_njit
def lowest_on_lines(lanes: Array, rover: Array, i: int) -> None:
    """Find wheel i's lowest gap on the open lines, and keep it if lower.

    As a function of m = u / q, f of `low_lines` is convex for m > 0 and concave for m < 0. So Newton's method finds where f
    rises through 0 from an end of the line: from the right end if f > 0 there, else from the left end. Lanes with two such
    points or without convergence reduce LOWEST.doubt to their bound.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.

    Reads:  BOUND.low, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST.gap, LOWEST.sine, LOWEST.cosine,
            LOWEST.offset, LOWEST.col, LOWEST.row, LOWEST.doubt, TREAD.zh, TREAD.tan, TREAD.over, TREAD.az, TREAD.u0,
            TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.det, TREAD.half, LOW_LINE (all)
    Writes: LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row, LOWEST.doubt
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    for l in range(in_use(lanes)):
        col, row, tan, over = lanes[CELL.col + l], lanes[CELL.row + l], lanes[TREAD.tan + l], lanes[TREAD.over + l]
        slope_x, slope_y, twist, u, (xu, xv, yu, yv) = _in_tread_coordinates(lanes, l)
        v = lanes[TREAD.v0 + l] + col * lanes[TREAD.v_x + l] + row * lanes[TREAD.v_y + l]
        w0, w1, k1, k2 = (
            lanes[LOW_LINE.w0 + l],
            lanes[LOW_LINE.w1 + l],
            lanes[LOW_LINE.k1 + l],
            lanes[LOW_LINE.k2 + l],
        )
        left, right, m0, m1 = (
            lanes[LOW_LINE.left + l],
            lanes[LOW_LINE.right + l],
            lanes[LOW_LINE.m_left + l],
            lanes[LOW_LINE.m_right + l],
        )
        opened, low, doubt = lanes[LOW_LINE.open + l] > 0.0, lanes[BOUND.low + l], lanes[LOWEST.doubt + l]
        f0, f1 = m0 * over + k1 + k2 * left, m1 * over + k1 + k2 * right
        twice = (f0 < 0.0) & (f1 > 0.0) & (k2 * radius < -over)  # f may rise through 0 twice
        rightly = f1 > 0.0
        m = m1 if rightly else m0
        limit = (-math.inf if f0 < 0.0 else max(m0, 0.0)) if rightly else min(m1, 0.0)
        gone = False  # a step beyond the limit, or to where f falls: f does not rise through 0
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
        s = (v + at_v - q * lanes[TREAD.az + l]) * over
        a = lanes[CELL.h00 + l]
        gap = lanes[TREAD.zh + l] + (v + at_v) * tan - q * over - (a + slope_x * x + slope_y * y + twist * x * y)
        found = (abs(off) < 1e-6) & (steep > 0.0)
        lanes[LOWEST.doubt + l] = min(doubt, low) if opened & (twice | (not (found | gone))) else doubt
        there = opened & found & (not gone) & (at >= left) & (at <= right) & (abs(s) <= lanes[TREAD.half + l])
        keep_lower_inside(lanes, l, gap, m * w, w, s, col, row, there)


@inlined
def lowest_inside_cells(lanes: Array, rover: Array, i: int) -> None:
    """Find wheel i's lowest gap inside a cell, and keep it if lower.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.

    Reads:  BOUND.low, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST.gap, LOWEST.sine, LOWEST.cosine,
            LOWEST.offset, LOWEST.col, LOWEST.row, LOWEST.doubt, TREAD.zh, TREAD.tan, TREAD.over, TREAD.az, TREAD.u0,
            TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.det, TREAD.half, LOW_LINE (all)
    Writes: LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row, LOWEST.doubt, LOW_LINE (all)
    """
    if low_lines(lanes, rover, i) > 0.0:
        lowest_on_lines(lanes, rover, i)


@fma_njit
def take_lowest_nodes(lanes: Array, columns: int) -> float:
    """Select the lanes whose lowest bound is below the lowest gap found.

    The nodes of their pieces are written. BOUND.low becomes infinite in the other lanes.

    Args:
        lanes: the lane array (`layout`).
        columns: number of nodes along x under the widest of the wheels.

    Returns:
        Number of lanes selected.

    Reads:  BOUND (all), LOWEST.gap, TREAD.col_0, TREAD.row_0
    Writes: BOUND.low, CELL.col, CELL.row
    """
    over = 1.0 / max(columns, 1)
    for l in range(in_use(lanes)):
        low = lanes[BOUND.low + l]
        lanes[BOUND.low + l] = low if low < lanes[LOWEST.gap + l] - GAP_TIE else math.inf
        row = np.floor((lanes[BOUND.piece + l] + 0.5) * over)
        lanes[CELL.col + l], lanes[CELL.row + l] = (
            lanes[TREAD.col_0 + l] + lanes[BOUND.piece + l] - row * columns,
            lanes[TREAD.row_0 + l] + row,
        )
    lane_count = 0.0
    for l in range(in_use(lanes)):
        lane_count += 1.0 if lanes[BOUND.low + l] < math.inf else 0.0
    return lane_count


@inlined
def search_insides(lanes: Array, grid: Array, meta: Array, rover: Array, i: int, columns: int, lines: int) -> None:
    """Search wheel i's lowest gap inside its tread; NODES must be filled and its rims searched.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        rover: the packed rover.
        i: index of the wheel.
        columns: number of nodes along x under the widest of the wheels.
        lines: number of nodes along y under the widest of the wheels.

    Reads:  BOUND (all), CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST.gap, LOWEST.sine, LOWEST.cosine,
            LOWEST.offset, LOWEST.col, LOWEST.row, LOWEST.doubt, HOME (all), TREAD.zh, TREAD.cos, TREAD.tan, TREAD.over,
            TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x, TREAD.over_y, TREAD.aside_x,
            TREAD.aside_y, TREAD.v_low, TREAD.v_high, TREAD.p_0, TREAD.p_uu, TREAD.p_x, TREAD.p_y, TREAD.b_0, TREAD.b_uu,
            TREAD.b_x, TREAD.b_y, TREAD.col_0, TREAD.row_0, TREAD.col_1, TREAD.row_1, TREAD.det, TREAD.half, TREAD.fits,
            LOW_LINE (all), NODES (all)
    Writes: BOUND (all), CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST.gap, LOWEST.sine, LOWEST.cosine,
            LOWEST.offset, LOWEST.col, LOWEST.row, LOWEST.doubt, LOW_LINE (all), NODES.bound
    """
    for l in range(in_use(lanes)):
        lanes[LOWEST.doubt + l] = lanes[LOWEST.doubt + l] if lanes[TREAD.fits + l] > 0.0 else NONE
    pad_bounds(lanes, NODES.bound, columns * lines)
    bound_edges(lanes, rover, i, columns, lines)
    lowest(lanes, NODES.bound, columns * lines)
    while take_lowest_nodes(lanes, columns) > 0.0:
        take_heights_of_edges(lanes, columns)
        edges_of_nodes(lanes, rover, i)
        next_lowest(lanes, NODES.bound, columns * lines)
    bound_cells(lanes, rover, i, columns, lines)
    lowest(lanes, NODES.bound, columns * lines)
    while take_lowest_nodes(lanes, columns) > 0.0:
        corners(lanes, grid, meta)
        lowest_inside_cells(lanes, rover, i)
        next_lowest(lanes, NODES.bound, columns * lines)


@inlined
def track_insides(lanes: Array, rover: Array, meta: Array, i: int) -> None:
    """Find wheel i's lowest gap over given cells, for contacts inside the tread.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        meta: the map header.
        i: index of the wheel.

    Reads:  CONTACT.offset, BOUND.low, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST.gap, LOWEST.sine,
            LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row, LOWEST.doubt, TREAD.zh, TREAD.cos, TREAD.tan, TREAD.over,
            TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x, TREAD.over_y, TREAD.aside_x,
            TREAD.aside_y, TREAD.p_x, TREAD.p_y, TREAD.b_x, TREAD.b_y, TREAD.det, TREAD.half, LOW_LINE (all)
    Writes: BOUND.low, LOWEST.gap, LOWEST.sine, LOWEST.cosine, LOWEST.offset, LOWEST.col, LOWEST.row, LOWEST.doubt, TREAD.half,
            LOW_LINE (all)
    """
    half = rover[P_HALF + i]
    for l in range(in_use(lanes)):
        inside = abs(lanes[CONTACT.offset + i * LANES + l]) < half
        lanes[TREAD.half + l], lanes[BOUND.low + l] = (half, NONE) if inside else (-1.0, math.inf)
    edges_of_cells(lanes, rover, i)
    lowest_inside_cells(lanes, rover, i)
