"""Wheels on bilinear ground, `LANES` poses at once.

Contacts are sought over whole treads, then followed in their cells while Newton moves the pose, and sought again when it has
settled: if no tread is deeper in the ground elsewhere, that is the pose, and it is proved.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fused, inlined, njit
from ..model.ground import META_DX, META_DY, META_NX, META_NY, Ground
from ..model.linkage import P_HALF, P_HUB, P_PIVOT, P_RADIUS
from ..search.bilinear_cell import TIE
from ..solve.newton import NEARLY, TOLERANCE, WIDEST
from .linkage import (
    ALL,
    AZ,
    COSINE,
    GAP,
    GX,
    GY,
    LANES,
    LIVE,
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
    place_body,
    place_wheels,
    rows,
    slopes,
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
SOUGHT, SETTLED, LOST = 0.0, 1.0, 2.0

FOLLOWED = 4  # steps on contacts that are followed


@inlined
def start(S: Array, grid: Array, meta: Array, rover: Array) -> None:
    """Level over the ground, then a step on treads that are sounded at a few points only."""
    height = rover[P_RADIUS] - rover[P_HUB + 2] - rover[P_PIVOT + 2]
    for l in range(LANES):
        S[LIVE + l], S[Q + l] = 1.0, 0.0
        S[Q + LANES + l] = S[Q + 2 * LANES + l] = S[Q + 3 * LANES + l] = S[Q + 4 * LANES + l] = S[Q + 5 * LANES + l] = 0.0
        S[SPOT_X + l], S[SPOT_Y + l] = S[X + l], S[Y + l]
    set_home(S, meta)
    ground_under(S, grid, meta)
    for l in range(LANES):
        h = S[SPOT_H + l]
        S[Q + l] = (h if h == h else 0.0) + height  # a hole under the body alone is no matter
    place_body(S, rover)
    place_wheels(S, rover)
    for i in range(6):
        half = rover[P_HALF + i]
        no_gap(S)
        for n in range(1 if half == 0.0 else SOUNDINGS):
            s = half * SIDES[n]
            sound(S, rover, i, SINES[n], COSINES[n], s)
            ground_under(S, grid, meta)
            for l in range(LANES):
                gap = S[SPOT_Z + l] - S[SPOT_H + l]
                if gap < S[LEAST + l]:
                    S[LEAST + l], S[L_SINE + l], S[L_COSINE + l], S[L_PLACE + l] = gap, SINES[n], COSINES[n], s
        hold(S, meta, rover, i, 2.0 * half + 1.0, 0.0)
    slopes(S, rover)
    solve_step(S)
    take_step(S)


# Points of a tread that are sounded first: under the hub, and around it.
_AHEAD = (0.0, 0.5, -0.5, 0.85, -0.85)
SINES = tuple(sine for sine in _AHEAD for _ in range(3))
COSINES = tuple(math.sqrt(1.0 - sine * sine) for sine in SINES)
SIDES = (0.0, -1.0, 1.0) * 5
SOUNDINGS = len(SINES)


@fused
def sound(S: Array, rover: Array, i: int, sine: float, cosine: float, s: float) -> None:
    """A point of each tread of wheel i: its place SPOT_X, SPOT_Y and its height SPOT_Z."""
    i = min(max(i, 0), 5)
    u, q = rover[P_RADIUS + i] * sine, rover[P_RADIUS + i] * cosine
    for l in range(LANES):
        k = i * LANES + l
        vx, vy, az, uz = S[VX + k], S[VY + k], S[AZ + k], S[UZ + k]
        along = s * uz + q * az
        S[SPOT_X + l], S[SPOT_Y + l] = S[X + l] + S[OX + k] + u * vy + along * vx, S[Y + l] + S[OY + k] + along * vy - u * vx
        S[SPOT_Z + l] = S[Q + l] + S[OZ + k] + s * az - q * uz


@fused
def ground_under(S: Array, grid: Array, meta: Array) -> None:
    """The ground's height SPOT_H at SPOT_X, SPOT_Y."""
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(LANES):
        S[CI + l], S[CJ + l] = np.floor(S[SPOT_X + l] * over_x), np.floor(S[SPOT_Y + l] * over_y)
    corners(S, grid, meta)
    for l in range(LANES):
        u, v = S[SPOT_X + l] * over_x - S[CI + l], S[SPOT_Y + l] * over_y - S[CJ + l]
        low, high = S[H00 + l] + u * (S[H01 + l] - S[H00 + l]), S[H10 + l] + u * (S[H11 + l] - S[H10 + l])
        S[SPOT_H + l] = low + v * (high - low)


@fused
def hold(S: Array, meta: Array, rover: Array, i: int, width: float, least: float) -> None:
    """Keep what was found of wheel i in lanes whose LIVE is at least so much. Nearer to the tread's middle than `width` the
    contact's slope is the tread's, else the ground's."""
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    half = rover[P_HALF + i]
    reach = radius + half
    end_x, end_y = (meta[META_NX] - 1.0) * meta[META_DX], (meta[META_NY] - 1.0) * meta[META_DY]
    for l in range(LANES):
        k = i * LANES + l
        sine, cosine, place, gap, kept = S[L_SINE + l], S[L_COSINE + l], S[L_PLACE + l], S[LEAST + l], S[LIVE + l] < least
        was_sine, was_cosine, was_place, was_gap, was_gx, was_gy, was_col, was_row, was_astray = (
            S[SINE + k], S[COSINE + k], S[PLACE + k], S[GAP + k], S[GX + k], S[GY + k], S[COL + k], S[ROW + k], S[ASTRAY + k],
        )  # fmt: skip
        col, row, gx, gy = S[L_COL + l], S[L_ROW + l], S[L_GX + l], S[L_GY + l]
        vx, vy, az, uz = S[VX + k], S[VY + k], S[AZ + k], S[UZ + k]
        steep, lean, inside = sine / (cosine * uz), az / uz, abs(place) < width
        gx, gy = (steep * vy + lean * vx if inside else gx), (lean * vy - steep * vx if inside else gy)
        x, y = S[X + l] + S[OX + k], S[Y + l] + S[OY + k]
        good = (x > reach) & (x < end_x - reach) & (y > reach) & (y < end_y - reach)
        astray = 0.0 if good & (S[DOUBT + l] >= gap - TIE) & (abs(gap) < math.inf) else 1.0
        sine, cosine, place = (was_sine if kept else sine), (was_cosine if kept else cosine), (was_place if kept else place)
        S[SINE + k], S[COSINE + k], S[PLACE + k], S[GAP + k] = sine, cosine, place, (was_gap if kept else gap)
        S[GX + k], S[GY + k] = (was_gx if kept else gx), (was_gy if kept else gy)
        S[COL + k], S[ROW + k], S[ASTRAY + k] = (
            (was_col if kept else col), (was_row if kept else row), (was_astray if kept else astray),
        )  # fmt: skip
        u, q = radius * sine, radius * cosine
        along = place * uz + q * az
        S[TX + k], S[TY + k], S[TZ + k] = u * vy + along * vx, along * vy - u * vx, place * az - q * uz


@njit
def search(S: Array, grid: Array, meta: Array, rover: Array, all_round: bool) -> None:
    """The contacts of all wheels, over the lower sides of their treads; and, `all_round`, whether the rest clears the ground."""
    for i in range(6):
        half = rover[P_HALF + i]
        no_gap(S)
        for side in range(1 if half == 0.0 else 2):
            for l in range(LANES):
                S[RIM + l] = half if side == 0 else -half
            search_rims(S, grid, meta, rover, i)
        unclear = 0.0
        if half > 0.0 or all_round:
            set_treads(S, rover, meta, i)
            unclear = clear_above(S) if all_round else 0.0
        if half > 0.0 or unclear > 0.0:
            columns, lines = nodes_under(S)
            take_heights(S, grid, columns, lines)
            if half > 0.0:
                search_insides(S, grid, meta, rover, i, columns, lines)
            if unclear > 0.0:
                clear_here(S, meta, columns, lines)
        hold(S, meta, rover, i, half, 0.0)


@inlined
def follow(S: Array, grid: Array, meta: Array, rover: Array) -> None:
    """The contacts of the live lanes' wheels in the cells they were in."""
    for i in range(6):
        half = rover[P_HALF + i]
        no_gap(S)
        for l in range(LANES):
            k = i * LANES + l
            S[RIM + l], S[CI + l], S[CJ + l] = math.copysign(half, S[PLACE + k]), S[COL + k], S[ROW + k]
        follow_rims(S, grid, meta, rover, i)
        if half > 0.0:
            set_treads(S, rover, meta, i)
            follow_insides(S, rover, meta, i)
        hold(S, meta, rover, i, half, 1.0)


@fused
def deepest(S: Array) -> None:
    """Fill DEEPEST; nan where a gap is, or infinite."""
    for l in range(LANES):
        S[DEEPEST + l] = 0.0
    for i in range(6):
        for l in range(LANES):
            gap, deep = abs(S[GAP + i * LANES + l]), S[DEEPEST + l]
            S[DEEPEST + l] = max(deep, gap) + 0.0 * (deep + gap)  # max alone would lose a nan


@njit
def judge(S: Array, proved: bool) -> bool:
    """What a search says of the lanes that are sought: they are SETTLED if it has `proved` it, LOST, or LIVE. Whether any is."""
    deepest(S)
    live = False
    for l in range(LANES):
        if S[FATE + l] == SOUGHT:
            done, lost = proved and S[DEEPEST + l] < TOLERANCE, not S[DEEPEST + l] < math.inf
            if done:
                for i in range(6):
                    lost |= S[ASTRAY + i * LANES + l] != 0.0
                for n in range(1, 6):
                    lost |= abs(S[Q + n * LANES + l]) > WIDEST
            S[FATE + l] = LOST if lost else (SETTLED if done else SOUGHT)
        S[LIVE + l] = 1.0 if S[FATE + l] == SOUGHT else 0.0
        live |= S[FATE + l] == SOUGHT
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
def settle(S: Array, ground: Ground, rover: Array, count: int, rounds: int) -> None:
    """Settle the first `count` lanes from where they are, in so many rounds. FATE says what has become of them."""
    grid, _, meta = ground
    for l in range(LANES):
        S[FATE + l] = SOUGHT if l < count else LOST
    set_home(S, meta)
    place_body(S, rover)
    place_wheels(S, rover)
    search(S, grid, meta, rover, False)
    for n in range(rounds):
        if not judge(S, n > 0):
            return
        for _ in range(FOLLOWED):
            deepest(S)
            slopes(S, rover)
            solve_step(S)
            take_step(S)
            place_body(S, rover)
            place_wheels(S, rover)
            live = 0.0
            for l in range(LANES):
                S[LIVE + l] = 0.0 if S[DEEPEST + l] < NEARLY else S[LIVE + l]
            for l in range(LANES):
                live += S[LIVE + l]
            if live == 0.0:
                break
            follow(S, grid, meta, rover)
        search(S, grid, meta, rover, True)
    judge(S, True)
