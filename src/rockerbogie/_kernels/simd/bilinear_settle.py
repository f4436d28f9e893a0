"""Wheels on bilinear ground, `LANES` poses at once.

Contacts are sought over whole treads, then followed in their cells while Newton moves the pose, and sought again when it has
settled: if no tread is deeper in the ground elsewhere, that is the pose, and it is proved.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined, njit
from ..model.ground import META_DX, META_DY, META_NX, META_NY, Ground
from ..model.linkage import P_HALF, P_HUB, P_PIVOT, P_RADIUS
from ..model.tolerances import GAP_TIE
from ..solve.newton import NEARLY, TOLERANCE, WIDEST
from .linkage import (
    ACTIVE,
    ALL,
    AZ,
    COSINE,
    GAP,
    GX,
    GY,
    LANES,
    OX,
    OY,
    OZ,
    PLACE,
    SINE,
    TX,
    TY,
    TZ,
    UZ,
    VX,
    VY,
    Q,
    X,
    Y,
    gap_jacobian,
    place_body,
    place_wheels,
    rows,
    solve_step,
    take_step,
)
from .rim_search import (
    CI,
    CJ,
    DOUBT,
    H00,
    H01,
    H10,
    H11,
    L_COL,
    L_COSINE,
    L_GX,
    L_GY,
    L_PLACE,
    L_ROW,
    L_SINE,
    LEAST,
    RIM,
    corners,
    follow_rims,
    no_gap,
    search_rims,
    set_home,
)
from .tread_search import EDGE_ROWS, SIDE, follow_insides, nodes_under, search_insides, set_treads, take_heights
from .upper_side import clear_above, clear_here

Array = NDArray[np.float64]

# A wheel: the cell of its contact; 1 where the search could not tell.
COL, ROW, ASTRAY, _lane = rows(EDGE_ROWS, (ALL,) * 3)
# A pose: the greatest of its gaps, and what has become of it.
DEEPEST, FATE, _spot = rows(_lane, (LANES,) * 2)
# A place that is sounded, from the map's first node; of the tread there and of the ground the height.
SPOT_X, SPOT_Y, SPOT_Z, SPOT_H, ROUGH_ROWS = rows(_spot, (LANES,) * 4)
SEARCHING, SETTLED, FAILED = 0.0, 1.0, 2.0

FOLLOWED = 4  # steps on contacts that are followed


@inlined
def start(lanes: Array, grid: Array, meta: Array, rover: Array) -> None:
    """Level over the ground, then a step on treads that are sounded at a few points only."""
    height = rover[P_RADIUS] - rover[P_HUB + 2] - rover[P_PIVOT + 2]
    for l in range(LANES):
        lanes[ACTIVE + l], lanes[Q + l] = 1.0, 0.0
        lanes[Q + LANES + l] = lanes[Q + 2 * LANES + l] = lanes[Q + 3 * LANES + l] = lanes[Q + 4 * LANES + l] = lanes[
            Q + 5 * LANES + l
        ] = 0.0
        lanes[SPOT_X + l], lanes[SPOT_Y + l] = lanes[X + l], lanes[Y + l]
    set_home(lanes, meta)
    ground_under(lanes, grid, meta)
    for l in range(LANES):
        h = lanes[SPOT_H + l]
        lanes[Q + l] = (h if h == h else 0.0) + height  # a hole under the body alone is no matter
    place_body(lanes, rover)
    place_wheels(lanes, rover)
    for i in range(6):
        half = rover[P_HALF + i]
        no_gap(lanes)
        for n in range(1 if half == 0.0 else SOUNDINGS):
            s = half * SIDES[n]
            sound(lanes, rover, i, SINES[n], COSINES[n], s)
            ground_under(lanes, grid, meta)
            for l in range(LANES):
                gap = lanes[SPOT_Z + l] - lanes[SPOT_H + l]
                if gap < lanes[LEAST + l]:
                    lanes[LEAST + l], lanes[L_SINE + l], lanes[L_COSINE + l], lanes[L_PLACE + l] = gap, SINES[n], COSINES[n], s
        store_contact(lanes, meta, rover, i, 2.0 * half + 1.0, 0.0)
    gap_jacobian(lanes, rover)
    solve_step(lanes)
    take_step(lanes)


# Points of a tread that are sounded first: under the hub, and around it.
_AHEAD = (0.0, 0.5, -0.5, 0.85, -0.85)
SINES = tuple(sine for sine in _AHEAD for _ in range(3))
COSINES = tuple(math.sqrt(1.0 - sine * sine) for sine in SINES)
SIDES = (0.0, -1.0, 1.0) * 5
SOUNDINGS = len(SINES)


@fma_njit
def sound(lanes: Array, rover: Array, i: int, sine: float, cosine: float, s: float) -> None:
    """A point of each tread of wheel i: its place SPOT_X, SPOT_Y and its height SPOT_Z."""
    i = min(max(i, 0), 5)
    u, q = rover[P_RADIUS + i] * sine, rover[P_RADIUS + i] * cosine
    for l in range(LANES):
        k = i * LANES + l
        vx, vy, az, uz = lanes[VX + k], lanes[VY + k], lanes[AZ + k], lanes[UZ + k]
        along = s * uz + q * az
        lanes[SPOT_X + l], lanes[SPOT_Y + l] = (
            lanes[X + l] + lanes[OX + k] + u * vy + along * vx,
            lanes[Y + l] + lanes[OY + k] + along * vy - u * vx,
        )
        lanes[SPOT_Z + l] = lanes[Q + l] + lanes[OZ + k] + s * az - q * uz


@fma_njit
def ground_under(lanes: Array, grid: Array, meta: Array) -> None:
    """The ground's height SPOT_H at SPOT_X, SPOT_Y."""
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(LANES):
        lanes[CI + l], lanes[CJ + l] = np.floor(lanes[SPOT_X + l] * over_x), np.floor(lanes[SPOT_Y + l] * over_y)
    corners(lanes, grid, meta)
    for l in range(LANES):
        u, v = lanes[SPOT_X + l] * over_x - lanes[CI + l], lanes[SPOT_Y + l] * over_y - lanes[CJ + l]
        low, high = lanes[H00 + l] + u * (lanes[H01 + l] - lanes[H00 + l]), lanes[H10 + l] + u * (lanes[H11 + l] - lanes[H10 + l])
        lanes[SPOT_H + l] = low + v * (high - low)


@fma_njit
def store_contact(lanes: Array, meta: Array, rover: Array, i: int, width: float, least: float) -> None:
    """Keep what was found of wheel i in lanes whose ACTIVE is at least so much. Nearer to the tread's middle than `width` the
    contact's slope is the tread's, else the ground's."""
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    half = rover[P_HALF + i]
    reach = radius + half
    end_x, end_y = (meta[META_NX] - 1.0) * meta[META_DX], (meta[META_NY] - 1.0) * meta[META_DY]
    for l in range(LANES):
        k = i * LANES + l
        sine, cosine, place, gap, kept = (
            lanes[L_SINE + l],
            lanes[L_COSINE + l],
            lanes[L_PLACE + l],
            lanes[LEAST + l],
            lanes[ACTIVE + l] < least,
        )
        was_sine, was_cosine, was_place, was_gap, was_gx, was_gy, was_col, was_row, was_astray = (
            lanes[SINE + k], lanes[COSINE + k], lanes[PLACE + k], lanes[GAP + k], lanes[GX + k], lanes[GY + k], lanes[COL +
            k], lanes[ROW + k], lanes[ASTRAY + k],
        )  # fmt: skip
        col, row, gx, gy = lanes[L_COL + l], lanes[L_ROW + l], lanes[L_GX + l], lanes[L_GY + l]
        vx, vy, az, uz = lanes[VX + k], lanes[VY + k], lanes[AZ + k], lanes[UZ + k]
        steep, lean, inside = sine / (cosine * uz), az / uz, abs(place) < width
        gx, gy = (steep * vy + lean * vx if inside else gx), (lean * vy - steep * vx if inside else gy)
        x, y = lanes[X + l] + lanes[OX + k], lanes[Y + l] + lanes[OY + k]
        good = (x > reach) & (x < end_x - reach) & (y > reach) & (y < end_y - reach)
        astray = 0.0 if good & (lanes[DOUBT + l] >= gap - GAP_TIE) & (abs(gap) < math.inf) else 1.0
        sine, cosine, place = (was_sine if kept else sine), (was_cosine if kept else cosine), (was_place if kept else place)
        lanes[SINE + k], lanes[COSINE + k], lanes[PLACE + k], lanes[GAP + k] = sine, cosine, place, (was_gap if kept else gap)
        lanes[GX + k], lanes[GY + k] = (was_gx if kept else gx), (was_gy if kept else gy)
        lanes[COL + k], lanes[ROW + k], lanes[ASTRAY + k] = (
            (was_col if kept else col), (was_row if kept else row), (was_astray if kept else astray),
        )  # fmt: skip
        u, q = radius * sine, radius * cosine
        along = place * uz + q * az
        lanes[TX + k], lanes[TY + k], lanes[TZ + k] = u * vy + along * vx, along * vy - u * vx, place * az - q * uz


@njit
def search(lanes: Array, grid: Array, meta: Array, rover: Array, all_round: bool) -> None:
    """The contacts of all wheels, over the lower sides of their treads; and, `all_round`, whether the rest clears the ground."""
    for i in range(6):
        half = rover[P_HALF + i]
        no_gap(lanes)
        for side in range(1 if half == 0.0 else 2):
            for l in range(LANES):
                lanes[RIM + l] = half if side == 0 else -half
            search_rims(lanes, grid, meta, rover, i)
        unclear = 0.0
        if half > 0.0 or all_round:
            set_treads(lanes, rover, meta, i)
            unclear = clear_above(lanes) if all_round else 0.0
        if half > 0.0 or unclear > 0.0:
            columns, lines = nodes_under(lanes)
            take_heights(lanes, grid, columns, lines)
            if half > 0.0:
                search_insides(lanes, grid, meta, rover, i, columns, lines)
            if unclear > 0.0:
                clear_here(lanes, meta, columns, lines)
        store_contact(lanes, meta, rover, i, half, 0.0)


@inlined
def follow(lanes: Array, grid: Array, meta: Array, rover: Array) -> None:
    """The contacts of the live lanes' wheels in the cells they were in."""
    for i in range(6):
        half = rover[P_HALF + i]
        no_gap(lanes)
        for l in range(LANES):
            k = i * LANES + l
            lanes[RIM + l], lanes[CI + l], lanes[CJ + l] = math.copysign(half, lanes[PLACE + k]), lanes[COL + k], lanes[ROW + k]
        follow_rims(lanes, grid, meta, rover, i)
        if half > 0.0:
            set_treads(lanes, rover, meta, i)
            follow_insides(lanes, rover, meta, i)
        store_contact(lanes, meta, rover, i, half, 1.0)


@fma_njit
def deepest(lanes: Array) -> None:
    """Fill DEEPEST; nan where a gap is, or infinite."""
    for l in range(LANES):
        lanes[DEEPEST + l] = 0.0
    for i in range(6):
        for l in range(LANES):
            gap, deep = abs(lanes[GAP + i * LANES + l]), lanes[DEEPEST + l]
            lanes[DEEPEST + l] = max(deep, gap) + 0.0 * (deep + gap)  # max alone would lose a nan


@njit
def classify_lanes(lanes: Array, proved: bool) -> bool:
    """What a search says of the lanes that are sought: they are SETTLED if it has `proved` it, FAILED, or ACTIVE. Whether
    any is."""
    deepest(lanes)
    live = False
    for l in range(LANES):
        if lanes[FATE + l] == SEARCHING:
            done, lost = proved and lanes[DEEPEST + l] < TOLERANCE, not lanes[DEEPEST + l] < math.inf
            if done:
                for i in range(6):
                    lost |= lanes[ASTRAY + i * LANES + l] != 0.0
                for n in range(1, 6):
                    lost |= abs(lanes[Q + n * LANES + l]) > WIDEST
            lanes[FATE + l] = FAILED if lost else (SETTLED if done else SEARCHING)
        lanes[ACTIVE + l] = 1.0 if lanes[FATE + l] == SEARCHING else 0.0
        live |= lanes[FATE + l] == SEARCHING
    return live


@njit
def too_fine(meta: Array, rover: Array) -> bool:
    """Whether more cells lie under a wide wheel than there is room for, as it may stand: then lanes are no help."""
    for i in range(6):
        r, half = rover[P_RADIUS + i], rover[P_HALF + i]
        if half > 0.0 and 2.0 * math.hypot(r, half) > (SIDE - 2.0) * min(meta[META_DX], meta[META_DY]):
            return True
    return False


@inlined
def settle(lanes: Array, ground: Ground, rover: Array, count: int, rounds: int) -> None:
    """Settle the first `count` lanes from where they are, in so many rounds. FATE says what has become of them."""
    grid, _, meta = ground
    for l in range(LANES):
        lanes[FATE + l] = SEARCHING if l < count else FAILED
    set_home(lanes, meta)
    place_body(lanes, rover)
    place_wheels(lanes, rover)
    search(lanes, grid, meta, rover, False)
    for n in range(rounds):
        if not classify_lanes(lanes, n > 0):
            return
        for _ in range(FOLLOWED):
            deepest(lanes)
            gap_jacobian(lanes, rover)
            solve_step(lanes)
            take_step(lanes)
            place_body(lanes, rover)
            place_wheels(lanes, rover)
            live = 0.0
            for l in range(LANES):
                lanes[ACTIVE + l] = 0.0 if lanes[DEEPEST + l] < NEARLY else lanes[ACTIVE + l]
            for l in range(LANES):
                live += lanes[ACTIVE + l]
            if live == 0.0:
                break
            follow(lanes, grid, meta, rover)
        search(lanes, grid, meta, rover, True)
    classify_lanes(lanes, True)
