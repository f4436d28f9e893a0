"""Contacts and clearance of the body's box: its lower faces, and their edges and corners.

The box's lower side is convex and made of plane faces. Over bilinear terrain its minimum gap is over a grid node, or on
one of its edges, piece by piece between grid lines (`box_edge`). Over cubic terrain a face may also have a minimum inside a
cell (`box_face`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.ground import META_CUBIC, META_DX, META_DY, META_NX, META_NY, META_STEEP, Ground, on_map, surface
from ..model.tolerances import CLEARANCE_TIE
from .box_edge import Edge, search_edge
from .box_face import Face, Rectangle, search_face
from .box_points import Sought, keep_lower_point
from .cubic_derivatives import greatest_slope
from .cubic_patch import BOUNDS_SIZE
from .tread import BLANK, FOUND, OFF

Array = NDArray[np.float64]

CELLS = 64  # most cells of cubic terrain under the box whose slope is bounded first
APART = 0.1  # points closer than this share of the box's length are one


@owning_njit
def box_over_ground(
    ground: Ground, box: Array, axes: Array, x: float, y: float, z: float, margin: float, near: Array
) -> tuple[int, int]:
    """List the lowest point of the body's box, and others up to `margin` higher.

    Args:
        ground: terrain.
        box: (6,) low and high corner in the body's frame, m.
        axes: (3, 3) the body's directions in the world, one a row.
        x, y, z: m, the body's origin from the map's first node and the datum.
        margin: m; 0 for the lowest point alone, within CLEARANCE_TIE.
        near: (n, NEAR_SIZE) filled with the points.

    Returns:
        FOUND, OFF (the map ends under the box; nothing is listed) or BLANK (missing data under it; points over known cells are
        listed), and the number of points listed.
    """
    grid, _, meta = ground
    extent = _extent(box, axes)
    if not (on_map(meta, x + extent.west, y + extent.south) and on_map(meta, x + extent.east, y + extent.north)):
        return OFF, 0
    patch = np.empty(BOUNDS_SIZE)
    low = np.empty(3)  # the box's lower corner in each of its own directions
    high = np.empty(3)
    size = 0.0
    for k in range(3):
        low[k] = box[k] if axes[k, 2] > 0.0 else box[3 + k]
        high[k] = box[3 + k] if axes[k, 2] > 0.0 else box[k]
        size = max(size, box[3 + k] - box[k])
    down = 0  # axis of the lowest face
    for k in range(1, 3):
        if abs(axes[k, 2]) > abs(axes[down, 2]):
            down = k
    cap, cap_x, cap_y, cap_z = _lowest_of_five(grid, meta, box, axes, low, down, x, y, z)
    # ties are listed; for the lowest point alone, a point lower by less than CLEARANCE_TIE is not sought
    sought = Sought(cap, margin + CLEARANCE_TIE if margin > 0.0 else -CLEARANCE_TIE, APART * size)
    code, count = FOUND, 0
    last_i, last_j = int(meta[META_NX]) - 2, int(meta[META_NY]) - 2
    i0, i1 = _cell(x + extent.west, meta[META_DX], last_i), _cell(x + extent.east, meta[META_DX], last_i)
    j0, j1 = _cell(y + extent.south, meta[META_DY], last_j), _cell(y + extent.north, meta[META_DY], last_j)
    # Down the lateral faces the gap falls if they are steeper than the terrain: it is then least on the lowest face.
    upright, steep = axes[down, 2] * axes[down, 2], meta[META_STEEP]
    if meta[META_CUBIC] != 0.0 and margin == 0.0 and (i1 - i0) * (j1 - j0) <= CELLS:
        steep = greatest_slope(grid, meta, i0, i1, j0, j1)
    lowest_face_only = margin == 0.0 and upright > steep * steep * (1.0 - upright)
    for along in range(3):  # the edges' direction; three of them are on the lower side
        a, b = (along + 1) % 3, (along + 2) % 3
        if lowest_face_only and along == down:
            continue
        for end in range(3):
            if lowest_face_only and end > 0 and down == (a if end == 1 else b):
                continue
            pa = low[a] if end != 1 else high[a]
            pb = low[b] if end != 2 else high[b]
            edge = Edge(
                x, y, z,
                axes[a, 0] * pa + axes[b, 0] * pb + axes[along, 0] * box[along],
                axes[a, 1] * pa + axes[b, 1] * pb + axes[along, 1] * box[along],
                axes[a, 2] * pa + axes[b, 2] * pb + axes[along, 2] * box[along],
                axes[along, 0], axes[along, 1], axes[along, 2], box[3 + along] - box[along],
            )  # fmt: skip
            kept = search_edge(ground, patch, edge, sought, near, count)
            if kept < 0:
                code, kept = BLANK, -1 - kept
            count = kept
    for across in range(3):
        if abs(axes[across, 2]) >= 1e-6 and not (lowest_face_only and across != down):
            face = _lower_face(box, axes, low, across, x, y, z)
            known, count = search_face(ground, patch, face, (i0, i1, j0, j1), extent, sought, near, count)
            if not known:
                code = BLANK
    if count == 0 and cap < math.inf:
        gx, gy = -axes[down, 0] / axes[down, 2], -axes[down, 1] / axes[down, 2]
        count = keep_lower_point(near, 0, sought.apart, cap, cap_x, cap_y, cap_z, gx, gy)
    return code, count


@njit
def _extent(box: Array, axes: Array) -> Rectangle:
    """Return the bounding rectangle of the box, as offsets from the body's origin.

    Args:
        box: (6,) low and high corner in the body's frame, m.
        axes: (3, 3) the body's directions in the world, one a row.
    """
    west = south = math.inf
    east = north = -math.inf
    for corner in range(8):
        a = box[0] if corner & 1 else box[3]
        b = box[1] if corner & 2 else box[4]
        c = box[2] if corner & 4 else box[5]
        ox = axes[0, 0] * a + axes[1, 0] * b + axes[2, 0] * c
        oy = axes[0, 1] * a + axes[1, 1] * b + axes[2, 1] * c
        west, east, south, north = min(west, ox), max(east, ox), min(south, oy), max(north, oy)
    return Rectangle(west, east, south, north)


@njit
def _lowest_of_five(
    grid: Array, meta: Array, box: Array, axes: Array, low: Array, down: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Return the least gap of the lowest face at its corners and centre.

    It is an upper bound of the clearance.

    Args:
        grid, meta: terrain.
        box: (6,) low and high corner in the body's frame, m.
        axes: (3, 3) the body's directions in the world, one a row.
        low: (3,) the box's lower corner in each of its own directions, m.
        down: axis of the lowest face.
        x, y, z: m, the body's origin.

    Returns:
        Gap, m, and the point, m from the body's origin; an infinite gap if all five lie over missing data.
    """
    a, b = (down + 1) % 3, (down + 2) % 3
    cap, cap_x, cap_y, cap_z = math.inf, 0.0, 0.0, 0.0
    for point in range(5):
        pa = 0.5 * (box[a] + box[3 + a]) if point == 4 else (box[a] if point & 1 else box[3 + a])
        pb = 0.5 * (box[b] + box[3 + b]) if point == 4 else (box[b] if point & 2 else box[3 + b])
        ox = axes[a, 0] * pa + axes[b, 0] * pb + axes[down, 0] * low[down]
        oy = axes[a, 1] * pa + axes[b, 1] * pb + axes[down, 1] * low[down]
        oz = axes[a, 2] * pa + axes[b, 2] * pb + axes[down, 2] * low[down]
        gap = z + oz - surface(grid, meta, x + ox, y + oy)[0]
        if gap < cap:
            cap, cap_x, cap_y, cap_z = gap, ox, oy, oz
    return cap, cap_x, cap_y, cap_z


@njit
def _lower_face(box: Array, axes: Array, low: Array, across: int, x: float, y: float, z: float) -> Face:
    """Return the lower one of two opposite faces of the box.

    Args:
        box: (6,) low and high corner in the body's frame, m.
        axes: (3, 3) the body's directions in the world, one a row.
        low: (3,) the box's lower corner in each of its own directions, m.
        across: the body's axis normal to the faces; it must not be horizontal.
        x, y, z: m, the body's origin.
    """
    nz = axes[across, 2]
    a, b = (across + 1) % 3, (across + 2) % 3
    c0, gx, gy = low[across] / nz, -axes[across, 0] / nz, -axes[across, 1] / nz
    long_a, long_b = 0.5 * (box[3 + a] - box[a]), 0.5 * (box[3 + b] - box[b])
    mid_a, mid_b = box[a] + long_a, box[b] + long_b
    return Face(
        x, y, z, c0, gx, gy,
        axes[a, 2] * c0, axes[a, 0] + axes[a, 2] * gx, axes[a, 1] + axes[a, 2] * gy,
        axes[b, 2] * c0, axes[b, 0] + axes[b, 2] * gx, axes[b, 1] + axes[b, 2] * gy,
        box[a], box[3 + a], box[b], box[3 + b],
        axes[across, 0] * low[across] + axes[a, 0] * mid_a + axes[b, 0] * mid_b,
        axes[across, 1] * low[across] + axes[a, 1] * mid_a + axes[b, 1] * mid_b,
        abs(axes[a, 0]) * long_a + abs(axes[b, 0]) * long_b,
        abs(axes[a, 1]) * long_a + abs(axes[b, 1]) * long_b,
    )  # fmt: skip


@njit
def _cell(position: float, spacing: float, last: int) -> int:
    """Return the index of the cell that holds a position along one axis of the map.

    Args:
        position: m from the map's first node.
        spacing: m, node spacing.
        last: index of the axis's last cell.
    """
    return min(int(math.floor(position / spacing)), last)
