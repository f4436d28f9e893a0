"""Block of terrain for the renderer: its surface, and the sides of the block cut out."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..terrain.heightfield import Terrain
from .render import Mesh
from .scene.terrain_mesh import CUT, SOIL, block_base

CELLS = 260  # along the longer side


def ground_mesh(
    terrain: Terrain, bounds: tuple[float, float, float, float], base: float | None = None, cells: int = CELLS
) -> Mesh:
    """Return the terrain within bounds as triangles, on a block that reaches down to `base`.

    Cells without data are left out.

    Args:
        terrain: the terrain.
        bounds: xmin, ymin, xmax, ymax, m.
        base: height of the block's lower face, m; default: `block_base`.
        cells: along the longer side.

    Returns:
        The triangles, without missing data.
    """
    x, y, z = sample_ground(terrain, bounds, cells)
    px, py = np.meshgrid(x, y)
    points = np.stack([px, py, z], axis=-1)
    normal = _normals(points)
    corners, normals = _cells(points), _cells(normal)
    known = np.isfinite(corners).all(axis=(1, 2))
    top = Mesh.smooth(corners[known], normals[known], SOIL, ruled=True)
    floor = base if base is not None else block_base(z)
    edges = [points[0], points[-1], points[:, 0], points[:, -1]]
    walls = [_wall(edge, floor) for edge in edges]
    return Mesh.join([top, *walls])


def sample_ground(terrain: Terrain, bounds: tuple[float, float, float, float], cells: int = CELLS) -> tuple[Array, Array, Array]:
    """Return x (cols,), y (rows,) and heights (rows, cols) within bounds, m; NaN: missing.

    Args:
        terrain: the terrain.
        bounds: xmin, ymin, xmax, ymax, m.
        cells: along the longer side.

    Returns:
        x, y and heights, m.
    """
    xmin, ymin, xmax, ymax = bounds
    step = max(xmax - xmin, ymax - ymin) / cells
    x = np.linspace(xmin, xmax, max(2, round((xmax - xmin) / step) + 1))
    y = np.linspace(ymin, ymax, max(2, round((ymax - ymin) / step) + 1))
    return x, y, terrain.height(*np.meshgrid(x, y))


def _normals(points: Array) -> Array:
    """Return unit normals (n, 3) of a surface at its points."""
    along_y, along_x = np.gradient(points, axis=(0, 1))
    normal = np.cross(along_x, along_y)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal


def _cells(grid: Array) -> Array:
    """Return the triangles (n, 3, 3) of a grid of points (rows, cols, 3)."""
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def _wall(edge: Array, floor: float) -> Mesh:
    """Return the mesh of a vertical wall from an edge of the terrain down to the floor."""
    below = edge.copy()
    below[:, 2] = floor
    strip = np.stack([edge[:-1], edge[1:], below[1:], below[:-1]], axis=1)
    strip = strip[np.isfinite(strip).all(axis=(1, 2))]
    return Mesh.flat(np.concatenate([strip[:, [0, 1, 2]], strip[:, [0, 2, 3]]]), CUT)
