"""Settling of `LANES` poses at once on bilinear terrain.

Contacts are searched over whole treads, then tracked in their cells while Newton's method moves the pose, and searched again
when it has converged. If no tread has a lower gap elsewhere, the pose is verified.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined, njit
from ..model.ground import META_DX, META_DY, Ground
from ..model.linkage import P_HALF, P_HUB, P_PIVOT, P_RADIUS
from ..model.tolerances import CONVERGED_GAP, MAX_ANGLE, SEARCH_GAP
from .bilinear_contacts import sample_tread, store_contact, terrain_at_spots
from .cells import no_gap, set_home
from .layout import BILINEAR, CELL, CONTACT, LANES, LOWEST, POSE, RIM, SIDE, SPOT, in_use
from .linkage import gap_jacobian, place_body, place_wheels, solve_step, take_step
from .rim_search import search_rims, track_rims
from .tread_nodes import nodes_under, set_treads, take_heights
from .tread_search import search_insides, track_insides
from .upper_side import clear_above, clear_here
from .wheel_lanes import gather_wheels, parts_of, return_contacts

Array = NDArray[np.float64]

# States of a lane; BEYOND: at its pose, a tread reaches beyond the map's edge
SEARCHING, SETTLED, FAILED, BEYOND = 0.0, 1.0, 2.0, 3.0

TRACKING_STEPS = 4  # Newton steps on tracked contacts, at most, before the next search

# Points of a tread at which the gap is evaluated for the first step.
_AHEAD = (0.0, 0.5, -0.5, 0.85, -0.85)
SINES = tuple(sine for sine in _AHEAD for _ in range(3))
COSINES = tuple(math.sqrt(1.0 - sine * sine) for sine in SINES)
SIDES = (0.0, -1.0, 1.0) * 5
SAMPLES = len(SINES)


@njit
def sample_wheel(lanes: Array, grid: Array, meta: Array, rover: Array, i: int) -> None:
    """Compute the lowest gap of wheel i at a few points of its tread.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights, m.
        meta: the map header.
        rover: the packed rover.
        i: index of the wheel.

    Reads:  POSE.x, POSE.y, POSE.q, POSE.active, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz,
            CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap, CELL.col, CELL.row, CELL.h00,
            CELL.h01, CELL.h10, CELL.h11, LOWEST (all), HOME (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected, SPOT (all)
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST (all), BILINEAR.col, BILINEAR.row,
            BILINEAR.rejected, SPOT (all)
    """
    half = rover[P_HALF + i]
    no_gap(lanes)
    for n in range(1 if half == 0.0 else SAMPLES):
        s = half * SIDES[n]
        sample_tread(lanes, rover, i, SINES[n], COSINES[n], s)
        terrain_at_spots(lanes, grid, meta)
        for l in range(in_use(lanes)):
            gap = lanes[SPOT.z + l] - lanes[SPOT.h + l]
            if gap < lanes[LOWEST.gap + l]:
                lanes[LOWEST.gap + l], lanes[LOWEST.sine + l], lanes[LOWEST.cosine + l], lanes[LOWEST.offset + l] = (
                    gap,
                    SINES[n],
                    COSINES[n],
                    s,
                )
    store_contact(lanes, rover, i, 2.0 * half + 1.0, 0.0)


@inlined
def start(lanes: Array, wheels: Array, grid: Array, meta: Array, rover: Array, few: int) -> None:
    """Set the poses to horizontal over the terrain, and take one Newton step.

    For that step, treads are sampled at a few points.

    Args:
        lanes: the lane array (`layout`).
        wheels: lane array of the wheels of few poses (`wheel_lanes`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        rover: the packed rover.
        few: number of poses if their wheels are searched in parts, else 0.

    Reads:  POSE.x, POSE.y, POSE.cy, POSE.sy, POSE.q, POSE.step, POSE.active, POSE.axes, POSE.right, POSE.rate, WHEEL (all),
            CONTACT (all), CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST (all), HOME (all),
            BILINEAR.col, BILINEAR.row, BILINEAR.rejected, SPOT (all)
    Writes: POSE.q, POSE.step, POSE.active, POSE.worst, POSE.axes, POSE.right, POSE.rate, WHEEL.lc, WHEEL.ls, WHEEL.bx,
            WHEEL.bz, WHEEL.br, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT (all),
            CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST (all), HOME (all), BILINEAR.col,
            BILINEAR.row, BILINEAR.rejected, SPOT (all)
    """
    height = rover[P_RADIUS] - rover[P_HUB + 2] - rover[P_PIVOT + 2]
    for l in range(in_use(lanes)):
        lanes[POSE.active + l], lanes[POSE.q + l] = 1.0, 0.0
        lanes[POSE.q + LANES + l] = lanes[POSE.q + 2 * LANES + l] = lanes[POSE.q + 3 * LANES + l] = lanes[
            POSE.q + 4 * LANES + l
        ] = lanes[POSE.q + 5 * LANES + l] = 0.0
        lanes[SPOT.x + l], lanes[SPOT.y + l] = lanes[POSE.x + l], lanes[POSE.y + l]
    set_home(lanes, meta)
    terrain_at_spots(lanes, grid, meta)
    for l in range(in_use(lanes)):
        h = lanes[SPOT.h + l]
        lanes[POSE.q + l] = (h if h == h else 0.0) + height  # missing data under the body alone does not matter
    place_body(lanes, rover)
    place_wheels(lanes, rover)
    for part in range(parts_of(few)):
        gather_wheels(lanes, wheels, few, part)
        sample_wheel(wheels, grid, meta, rover, 0)
        return_contacts(lanes, wheels, few, part, True)
    for i in range(0 if few > 0 else 6):
        sample_wheel(lanes, grid, meta, rover, i)
    gap_jacobian(lanes, rover)
    solve_step(lanes)
    take_step(lanes)


@njit
def search_wheel(lanes: Array, grid: Array, meta: Array, rover: Array, i: int, all_round: bool) -> None:
    """Search the contact of wheel i over the lower side of its tread.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights, m.
        meta: the map header.
        rover: the packed rover.
        i: index of the wheel.
        all_round: also check that the upper side clears the terrain.

    Reads:  POSE.x, POSE.y, POSE.q, POSE.active, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz,
            CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap, BOUND (all), RIM (all), COLUMN
            (all), CELL (all), PIECE (all), LOWEST (all), HOME (all), RIM_PIECES (all), TREAD (all), LOW_LINE (all), NODES
            (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, BOUND (all), RIM (all), COLUMN (all), CELL (all), PIECE (all), LOWEST (all), RIM_PIECES (all), TREAD
            (all), LOW_LINE (all), NODES (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    """
    half = rover[P_HALF + i]
    no_gap(lanes)
    for side in range(1 if half == 0.0 else 2):
        for l in range(in_use(lanes)):
            lanes[RIM.offset + l] = half if side == 0 else -half
        search_rims(lanes, grid, meta, rover, i)
    unclear = 0.0
    if half > 0.0 or all_round:
        set_treads(lanes, rover, meta, i)
        unclear = clear_above(lanes) if all_round else 0.0
    if half > 0.0 or unclear > 0.0:
        columns, lines = nodes_under(lanes)
        take_heights(lanes, grid, meta, columns, lines)
        if half > 0.0:
            search_insides(lanes, grid, meta, rover, i, columns, lines)
        if unclear > 0.0:
            clear_here(lanes, meta, columns, lines)
    store_contact(lanes, rover, i, half, 0.0)


@njit
def search(lanes: Array, wheels: Array, grid: Array, meta: Array, rover: Array, all_round: bool, few: int) -> None:
    """Search the contacts of all wheels over the lower sides of their treads.

    Args:
        lanes: the lane array (`layout`).
        wheels: lane array of the wheels of few poses (`wheel_lanes`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        rover: the packed rover.
        all_round: also check that the upper sides clear the terrain.
        few: number of poses if their wheels are searched in parts, else 0.

    Reads:  POSE.x, POSE.y, POSE.q, POSE.active, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz,
            CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap, BOUND (all), RIM (all), COLUMN
            (all), CELL (all), PIECE (all), LOWEST (all), HOME (all), RIM_PIECES (all), TREAD (all), LOW_LINE (all), NODES
            (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, BOUND (all), RIM (all), COLUMN (all), CELL (all), PIECE (all), LOWEST (all), RIM_PIECES (all), TREAD
            (all), LOW_LINE (all), NODES (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    """
    for part in range(parts_of(few)):
        gather_wheels(lanes, wheels, few, part)
        search_wheel(wheels, grid, meta, rover, 0, all_round)
        return_contacts(lanes, wheels, few, part, False)
    for i in range(0 if few > 0 else 6):
        search_wheel(lanes, grid, meta, rover, i, all_round)


@njit
def track_wheel(lanes: Array, grid: Array, meta: Array, rover: Array, i: int) -> None:
    """Find the contact of wheel i of the active lanes in the cell that it was in.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights, m.
        meta: the map header.
        rover: the packed rover.
        i: index of the wheel.

    Reads:  POSE.x, POSE.y, POSE.q, POSE.active, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz,
            CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap, BOUND.low, RIM.offset, RIM.p0,
            RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.over_h, RIM.over_q, RIM.ac, RIM.bd, RIM.e,
            RIM.swap, RIM.sign, RIM.low_p, RIM.high_p, CELL (all), PIECE (all), LOWEST (all), HOME (all), TREAD.zh, TREAD.cos,
            TREAD.tan, TREAD.over, TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x,
            TREAD.over_y, TREAD.aside_x, TREAD.aside_y, TREAD.p_x, TREAD.p_y, TREAD.b_x, TREAD.b_y, TREAD.det, TREAD.half,
            LOW_LINE (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, BOUND.low, RIM (all), CELL (all), PIECE (all), LOWEST (all), TREAD.zh, TREAD.cos, TREAD.tan,
            TREAD.over, TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x, TREAD.over_y,
            TREAD.aside_x, TREAD.aside_y, TREAD.v_low, TREAD.v_high, TREAD.p_0, TREAD.p_uu, TREAD.p_x, TREAD.p_y, TREAD.b_0,
            TREAD.b_uu, TREAD.b_x, TREAD.b_y, TREAD.col_0, TREAD.row_0, TREAD.col_1, TREAD.row_1, TREAD.det, TREAD.half,
            TREAD.max_slope_squared, LOW_LINE (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    """
    half = rover[P_HALF + i]
    no_gap(lanes)
    for l in range(in_use(lanes)):
        k = i * LANES + l
        lanes[RIM.offset + l], lanes[CELL.col + l], lanes[CELL.row + l] = (
            math.copysign(half, lanes[CONTACT.offset + k]),
            lanes[BILINEAR.col + k],
            lanes[BILINEAR.row + k],
        )
    track_rims(lanes, grid, meta, rover, i)
    if half > 0.0:
        set_treads(lanes, rover, meta, i)
        track_insides(lanes, rover, meta, i)
    store_contact(lanes, rover, i, half, 1.0)


@inlined
def track(lanes: Array, wheels: Array, grid: Array, meta: Array, rover: Array, few: int) -> None:
    """Find the contacts of the active lanes' wheels in the cells that they were in.

    Args:
        lanes: the lane array (`layout`).
        wheels: lane array of the wheels of few poses (`wheel_lanes`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        rover: the packed rover.
        few: number of poses if their wheels are searched in parts, else 0.

    Reads:  POSE.x, POSE.y, POSE.q, POSE.active, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz,
            CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap, BOUND.low, RIM.offset, RIM.p0,
            RIM.t0, RIM.a, RIM.b, RIM.c, RIM.d, RIM.rho, RIM.zr, RIM.h2, RIM.q2, RIM.over_h, RIM.over_q, RIM.ac, RIM.bd, RIM.e,
            RIM.swap, RIM.sign, RIM.low_p, RIM.high_p, CELL (all), PIECE (all), LOWEST (all), HOME (all), TREAD.zh, TREAD.cos,
            TREAD.tan, TREAD.over, TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x,
            TREAD.over_y, TREAD.aside_x, TREAD.aside_y, TREAD.p_x, TREAD.p_y, TREAD.b_x, TREAD.b_y, TREAD.det, TREAD.half,
            LOW_LINE (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, BOUND.low, RIM (all), CELL (all), PIECE (all), LOWEST (all), TREAD.zh, TREAD.cos, TREAD.tan,
            TREAD.over, TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x, TREAD.v_y, TREAD.over_x, TREAD.over_y,
            TREAD.aside_x, TREAD.aside_y, TREAD.v_low, TREAD.v_high, TREAD.p_0, TREAD.p_uu, TREAD.p_x, TREAD.p_y, TREAD.b_0,
            TREAD.b_uu, TREAD.b_x, TREAD.b_y, TREAD.col_0, TREAD.row_0, TREAD.col_1, TREAD.row_1, TREAD.det, TREAD.half,
            TREAD.max_slope_squared, LOW_LINE (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    """
    for part in range(parts_of(few)):
        gather_wheels(lanes, wheels, few, part)
        track_wheel(wheels, grid, meta, rover, 0)
        return_contacts(lanes, wheels, few, part, False)
    for i in range(0 if few > 0 else 6):
        track_wheel(lanes, grid, meta, rover, i)


@fma_njit
def largest_gaps(lanes: Array) -> None:
    """Compute each lane's largest |gap|; NaN if one is NaN or infinite.

    Args:
        lanes: the lane array (`layout`).

    Reads:  CONTACT.gap, BILINEAR.deepest
    Writes: BILINEAR.deepest
    """
    for l in range(in_use(lanes)):
        lanes[BILINEAR.deepest + l] = 0.0
    for i in range(6):
        for l in range(in_use(lanes)):
            gap, deep = abs(lanes[CONTACT.gap + i * LANES + l]), lanes[BILINEAR.deepest + l]
            lanes[BILINEAR.deepest + l] = max(deep, gap) + 0.0 * (deep + gap)  # max alone would lose a NaN


@njit
def classify_lanes(lanes: Array, verified: bool) -> bool:
    """Update the state of each lane after a search.

    A lane is SETTLED if its gaps are within CONVERGED_GAP and a search has verified them, FAILED if a gap is not finite, a
    search could not decide, or an angle is beyond MAX_ANGLE; else it stays active.

    Args:
        lanes: the lane array (`layout`).
        verified: True if the search was over whole treads at this pose.

    Returns:
        True if a lane is active.

    Reads:  POSE.q, CONTACT.gap, BILINEAR.rejected, BILINEAR.deepest, BILINEAR.fate
    Writes: POSE.active, BILINEAR.deepest, BILINEAR.fate
    """
    largest_gaps(lanes)
    live = False
    for l in range(in_use(lanes)):
        if lanes[BILINEAR.fate + l] == SEARCHING:
            done, lost = verified and lanes[BILINEAR.deepest + l] < CONVERGED_GAP, not lanes[BILINEAR.deepest + l] < math.inf
            if done:
                for i in range(6):
                    lost |= lanes[BILINEAR.rejected + i * LANES + l] != 0.0
                for n in range(1, 6):
                    lost |= abs(lanes[POSE.q + n * LANES + l]) > MAX_ANGLE
            lanes[BILINEAR.fate + l] = FAILED if lost else (SETTLED if done else SEARCHING)
        lanes[POSE.active + l] = 1.0 if lanes[BILINEAR.fate + l] == SEARCHING else 0.0
        live |= lanes[BILINEAR.fate + l] == SEARCHING
    return live


@njit
def too_fine(meta: Array, rover: Array) -> bool:
    """Return True if more nodes may lie under a wheel with width than a lane has room for.

    Args:
        meta: the map header.
        rover: the packed rover.

    Returns:
        True if lanes cannot be used.
    """
    for i in range(6):
        r, half = rover[P_RADIUS + i], rover[P_HALF + i]
        if half > 0.0 and 2.0 * math.hypot(r, half) > (SIDE - 2.0) * min(meta[META_DX], meta[META_DY]):
            return True
    return False


@inlined
def settle(lanes: Array, wheels: Array, ground: Ground, rover: Array, count: int, few: int, rounds: int) -> None:
    """Settle the first `count` lanes from their present poses; BILINEAR.fate holds the result.

    Args:
        lanes: the lane array (`layout`).
        wheels: lane array of the wheels of few poses (`wheel_lanes`).
        ground: the packed terrain.
        rover: the packed rover.
        count: number of lanes in use, from the first.
        few: number of poses if their wheels are searched in parts, else 0.
        rounds: number of rounds of tracking and searching, at most.

    Reads:  POSE.x, POSE.y, POSE.cy, POSE.sy, POSE.q, POSE.step, POSE.active, POSE.axes, POSE.right, POSE.rate, WHEEL (all),
            CONTACT (all), BOUND (all), RIM (all), COLUMN (all), CELL (all), PIECE (all), LOWEST (all), HOME (all), RIM_PIECES
            (all), TREAD (all), LOW_LINE (all), NODES (all), BILINEAR (all)
    Writes: POSE.q, POSE.step, POSE.active, POSE.worst, POSE.axes, POSE.right, POSE.rate, WHEEL.lc, WHEEL.ls, WHEEL.bx,
            WHEEL.bz, WHEEL.br, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT (all), BOUND
            (all), RIM (all), COLUMN (all), CELL (all), PIECE (all), LOWEST (all), HOME (all), RIM_PIECES (all), TREAD (all),
            LOW_LINE (all), NODES (all), BILINEAR (all)
    """
    grid, _, meta = ground
    for l in range(in_use(lanes)):
        lanes[BILINEAR.fate + l] = SEARCHING if l < count else FAILED
    set_home(lanes, meta)
    place_body(lanes, rover)
    place_wheels(lanes, rover)
    search(lanes, wheels, grid, meta, rover, False, few)
    for n in range(rounds):
        if not classify_lanes(lanes, n > 0):
            return
        for _ in range(TRACKING_STEPS):
            largest_gaps(lanes)
            gap_jacobian(lanes, rover)
            solve_step(lanes)
            take_step(lanes)
            place_body(lanes, rover)
            place_wheels(lanes, rover)
            live = 0.0
            for l in range(in_use(lanes)):
                lanes[POSE.active + l] = 0.0 if lanes[BILINEAR.deepest + l] < SEARCH_GAP else lanes[POSE.active + l]
            for l in range(in_use(lanes)):
                live += lanes[POSE.active + l]
            if live == 0.0:
                break
            track(lanes, wheels, grid, meta, rover, few)
        search(lanes, wheels, grid, meta, rover, True, few)
    classify_lanes(lanes, True)
