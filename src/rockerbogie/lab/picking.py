"""Points of a terrain under the pointer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np

from ..arrays import Array
from ..terrain.heightfield import Terrain

#: Stations along a ray in the first pass and in each refinement.
STATIONS = 1500
REFINED = 40
_EXTREMES: WeakKeyDictionary[Terrain, tuple[float, float]] = WeakKeyDictionary()


def ray_hit(terrain: Terrain, origin: Sequence[float], direction: Sequence[float], lift: float = 0.0) -> Array | None:
    """Return the first point where a ray meets the terrain.

    The ray is sampled at 1,500 stations within the map and the first crossing is refined twice, to 1e-6 of its length.

    Args:
        terrain: the terrain.
        origin: (3,) of the ray, m.
        direction: (3,), of any length.
        lift: height that is added to the terrain, m.

    Returns:
        (3,) m, on the lifted terrain; None if the ray misses it.
    """
    start, along = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    length = float(np.linalg.norm(along))
    if not (np.isfinite(start).all() and math.isfinite(length)) or length == 0.0:
        return None
    along = along / length
    span = _within(terrain, start, along, lift)
    if span is None:
        return None
    low, high = span
    for count in (STATIONS, REFINED, REFINED):
        t = np.linspace(low, high, count)
        points = start + t[:, None] * along
        over = points[:, 2] - terrain.height(points[:, 0], points[:, 1]) - lift
        with np.errstate(invalid="ignore"):
            crossing = np.flatnonzero((over[:-1] >= 0.0) & (over[1:] <= 0.0))
        if crossing.size == 0:
            return None
        low, high = float(t[crossing[0]]), float(t[crossing[0] + 1])
    point = start + 0.5 * (low + high) * along
    return np.array([point[0], point[1], float(terrain.height(point[0], point[1])) + lift])


def _extremes(terrain: Terrain) -> tuple[float, float]:
    """Return the lowest and the highest height, m, computed once per terrain."""
    known = _EXTREMES.get(terrain)
    if known is None:
        known = _EXTREMES[terrain] = (float(np.nanmin(terrain.z)), float(np.nanmax(terrain.z)))
    return known


def _within(terrain: Terrain, start: Array, along: Array, lift: float) -> tuple[float, float] | None:
    """Return the range of lengths within the box of the map, m; None outside it."""
    xmin, ymin, xmax, ymax = terrain.bounds
    lowest, highest = (height + lift for height in _extremes(terrain))
    room = 0.01 * (highest - lowest) + 1e-3
    box = ((xmin, xmax), (ymin, ymax), (lowest - room, highest + room))
    low, high = 0.0, math.inf
    for at, way, (least, most) in zip(start, along, box, strict=True):
        if abs(way) < 1e-12:
            if not least <= at <= most:
                return None
            continue
        near, far = sorted(((least - at) / way, (most - at) / way))
        low, high = max(low, near), min(high, far)
    return (low, high) if low < high < math.inf else None
