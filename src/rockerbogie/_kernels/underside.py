"""How high the body's box stands over the ground: over its lowest face, its corners and its edges."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .ground import META_DX, META_DY, on_map, surface
from .jit import njit
from .linkage import body_axes

Array = NDArray[np.float64]

#: The box's underside is looked at on every ground node below it and on stations no further apart than this share of a cell.
STATION = 0.5


@njit
def clearance(
    grid: Array, meta: Array, box: Array, x: float, y: float, z: float, roll: float, pitch: float, yaw: float
) -> tuple[float, float, float, float]:
    """Least of (box z - ground z) and the box point (offset from the body's origin, in the world) where it is.

    The lower faces are the bottom and, when tilted, the sides; a station grid on each, no coarser than half a cell,
    finds the least place. nan where the body hangs over the map's rim or unknown ground.
    """
    axes = np.empty((3, 3))
    body_axes(roll, pitch, math.cos(yaw), math.sin(yaw), axes)
    step = STATION * min(meta[META_DX], meta[META_DY])
    best = math.inf
    bx = by = bz = math.nan
    for face in range(3):  # 0: bottom, 1: the lower of the x sides, 2: the lower of the y sides
        if face == 0:
            a, b, fixed = 0, 1, 2
            level = box[2] if axes[2, 2] > 0.0 else box[5]
        elif face == 1:
            a, b, fixed = 1, 2, 0
            level = box[0] if axes[0, 2] > 0.0 else box[3]
        else:
            a, b, fixed = 0, 2, 1
            level = box[1] if axes[1, 2] > 0.0 else box[4]
        la, lb = box[3 + a] - box[a], box[3 + b] - box[b]
        na, nb = int(math.ceil(la / step)), int(math.ceil(lb / step))
        if face > 0:
            nb = 1 if abs(axes[fixed, 2]) < 0.02 else nb  # an upright side: its lower edge belongs to the bottom
        for i in range(na + 1):
            for j in range(nb + 1):
                pa, pb = box[a] + la * i / na, box[b] + lb * j / nb
                ox = axes[a, 0] * pa + axes[b, 0] * pb + axes[fixed, 0] * level
                oy = axes[a, 1] * pa + axes[b, 1] * pb + axes[fixed, 1] * level
                if not on_map(meta, x + ox, y + oy):
                    return math.nan, bx, by, bz
                oz = axes[a, 2] * pa + axes[b, 2] * pb + axes[fixed, 2] * level
                gap = z + oz - surface(grid, meta, x + ox, y + oy)[0]
                if math.isnan(gap):
                    return math.nan, bx, by, bz
                if gap < best:
                    best, bx, by, bz = gap, ox, oy, oz
    return best, bx, by, bz
