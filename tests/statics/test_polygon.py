"""Convex polygons of the search for tip margins against the hull of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from rockerbogie._kernels.jit.vectors import LANES
from rockerbogie._kernels.statics.polygon import ROOM, extend, nearest_edge


@pytest.mark.parametrize("seed", range(20))
def test_a_polygon_grown_by_points_is_their_convex_hull(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lane = seed % LANES
    corner = np.full((LANES, ROOM, 3), np.nan)
    square = 1e-9 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    corner[lane, :4] = np.column_stack([square, np.zeros(4)])
    azimuth = np.concatenate([np.arange(4) * np.pi / 2, rng.uniform(0, 2 * np.pi, 30)])
    points = rng.uniform(0.2, 1.0, (34, 1)) * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    count = 4
    for n, (x, y) in enumerate(points):
        count = extend(corner, lane, count, x, y, n % 2 == 0)
    hull = ConvexHull(points)
    got = corner[lane, :count]
    assert {tuple(p) for p in got[:, :2]} == {tuple(p) for p in points[hull.vertices]}
    even = {tuple(p) for p in points[::2]}
    assert all((tuple(p[:2]) in even) == (p[2] == 1.0) for p in got)
    distance, x, y, sure = nearest_edge(corner, lane, count)
    nearest = -hull.equations[:, 2].max()
    assert distance == pytest.approx(nearest, rel=1e-12)
    assert np.array([x, y]) == pytest.approx(hull.equations[hull.equations[:, 2].argmax(), :2], abs=1e-9)
    assert not sure  # the foot is inside an edge
    assert np.isnan(np.delete(corner, lane, axis=0)).all()
