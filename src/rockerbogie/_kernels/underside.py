"""How high the body's box stands over the ground.

The box's lower side is convex, so over bilinear ground it comes nearest over a ground node, or along one of its edges:
nodes are looked at one by one, edges (and corners) at stations no more than half a cell apart. Over cubic ground the
same places are taken.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .ground import META_DX, META_DY, META_NX, META_NY, on_map, surface
from .jit import njit

Array = NDArray[np.float64]

# A place where the box is near the ground: gap, offset from the body's origin in the world, and (gx, gy) with
# (-gx, -gy, 1) normal to the contact.
N_GAP, N_X, N_Y, N_Z, N_GX, N_GY = range(6)
NEAR_SIZE = 6
NEAR_ROOM = 12
APART = 0.1  # places closer than this share of the box's length are one


@njit
def _take(near: Array, count: int, apart: float, gap: float, x: float, y: float, z: float, gx: float, gy: float) -> int:
    """Keep the lowest places, one for each neighbourhood."""
    spot = -1
    for k in range(count):
        if abs(near[k, N_X] - x) + abs(near[k, N_Y] - y) < apart:
            if near[k, N_GAP] <= gap:
                return count
            spot = k
            break
    if spot < 0:
        if count < near.shape[0]:
            spot = count
            count += 1
        else:
            spot = 0
            for k in range(1, count):
                if near[k, N_GAP] > near[spot, N_GAP]:
                    spot = k
            if near[spot, N_GAP] <= gap:
                return count
    near[spot, N_GAP], near[spot, N_X], near[spot, N_Y], near[spot, N_Z] = gap, x, y, z
    near[spot, N_GX], near[spot, N_GY] = gx, gy
    return count


@njit
def box_over_ground(
    grid: Array, meta: Array, box: Array, axes: Array, x: float, y: float, z: float, margin: float, near: Array
) -> int:
    """Fill `near` (NEAR_ROOM, NEAR_SIZE) with places lower than the lowest plus `margin`; returns how many, or -1 where
    the map ends or the ground is unknown below the box. `axes` are the body's directions, (x, y, z) its origin."""
    low = np.empty(3)  # the box's lower corner in each of its own directions
    high = np.empty(3)
    size = 0.0
    for k in range(3):
        low[k] = box[k] if axes[k, 2] > 0.0 else box[3 + k]
        high[k] = box[3 + k] if axes[k, 2] > 0.0 else box[k]
        size = max(size, box[3 + k] - box[k])
    apart = APART * size
    dx, dy = meta[META_DX], meta[META_DY]
    count = 0
    lowest = math.inf
    x_min = y_min = math.inf
    x_max = y_max = -math.inf
    for corner in range(8):
        a = box[0] if corner & 1 else box[3]
        b = box[1] if corner & 2 else box[4]
        c = box[2] if corner & 4 else box[5]
        ox = axes[0, 0] * a + axes[1, 0] * b + axes[2, 0] * c
        oy = axes[0, 1] * a + axes[1, 1] * b + axes[2, 1] * c
        x_min, x_max, y_min, y_max = min(x_min, ox), max(x_max, ox), min(y_min, oy), max(y_max, oy)
    if not (on_map(meta, x + x_min, y + y_min) and on_map(meta, x + x_max, y + y_max)):
        return -1
    # ground nodes below each lower face
    i0, i1 = int(math.ceil((x + x_min) / dx)), min(int(math.floor((x + x_max) / dx)), int(meta[META_NX]) - 1)
    j0, j1 = int(math.ceil((y + y_min) / dy)), min(int(math.floor((y + y_max) / dy)), int(meta[META_NY]) - 1)
    for face in range(3):
        nz = axes[face, 2]
        if abs(nz) < 1e-6:
            continue
        a, b = (face + 1) % 3, (face + 2) % 3
        gx, gy = -axes[face, 0] / nz, -axes[face, 1] / nz
        for j in range(j0, j1 + 1):
            oy = j * dy - y
            for i in range(i0, i1 + 1):
                ox = i * dx - x
                oz = (low[face] - axes[face, 0] * ox - axes[face, 1] * oy) / nz
                pa = axes[a, 0] * ox + axes[a, 1] * oy + axes[a, 2] * oz
                pb = axes[b, 0] * ox + axes[b, 1] * oy + axes[b, 2] * oz
                if box[a] <= pa <= box[3 + a] and box[b] <= pb <= box[3 + b]:
                    gap = z + oz - surface(grid, meta, x + ox, y + oy)[0]
                    if math.isnan(gap):
                        return -1
                    if gap < lowest + margin:
                        lowest = min(lowest, gap)
                        count = _take(near, count, apart, gap, ox, oy, oz, gx, gy)
    # the lower side's edges, station by station
    for face in range(3):  # the edge's direction
        a, b = (face + 1) % 3, (face + 2) % 3
        for end in range(3):
            pa = low[a] if end != 1 else high[a]
            pb = low[b] if end != 2 else high[b]
            sx = axes[a, 0] * pa + axes[b, 0] * pb + axes[face, 0] * box[face]
            sy = axes[a, 1] * pa + axes[b, 1] * pb + axes[face, 1] * box[face]
            sz = axes[a, 2] * pa + axes[b, 2] * pb + axes[face, 2] * box[face]
            length = box[3 + face] - box[face]
            ex, ey, ez = axes[face, 0], axes[face, 1], axes[face, 2]
            stations = int(math.ceil(length * max(abs(ex) / dx, abs(ey) / dy))) + 1
            for k in range(2 * stations + 1):
                t = length * k / (2.0 * stations)
                ox, oy, oz = sx + t * ex, sy + t * ey, sz + t * ez
                h, gx, gy, _, _, _ = surface(grid, meta, x + ox, y + oy)
                gap = z + oz - h
                if math.isnan(gap):
                    return -1
                if gap < lowest + margin:
                    lowest = min(lowest, gap)
                    count = _take(near, count, apart, gap, ox, oy, oz, gx, gy)
    return count


@njit
def least_clearance(near: Array, count: int) -> float:
    """The lowest of the places found."""
    low = math.inf
    for k in range(count):
        low = min(low, near[k, N_GAP])
    return low
