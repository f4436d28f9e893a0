"""Path, start and goal in the scene of one visitor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..motion.path import Path
from ..terrain.heightfield import Terrain

if TYPE_CHECKING:
    import viser

LINE, POINTS = (213, 94, 0), (30, 30, 30)
MARKS = {"start": (0, 114, 178), "goal": (204, 121, 167)}
#: Pieces of the line that shows a path.
PIECES = 400


class PathView:
    """Path of one visitor.

    Args:
        scene: the visitor's scene.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self.scene = scene
        self._nodes: dict[str, Any] = {}

    def show(
        self, path: Path | None, points: Sequence[tuple[float, float]], terrain: Terrain, offset: Array, size: float
    ) -> None:
        """Show a path and the points it goes through.

        Args:
            path: the path, or None.
            points: clicked positions, m.
            terrain: the terrain.
            offset: (3,) origin of the scene in the world, m.
            size: of the rover, m.
        """
        self.clear()
        lift = 0.03 * size
        if path is not None:
            at = path.sample(np.linspace(0.0, path.length, PIECES + 1))
            vertices, faces = ribbon(terrain, at.x, at.y, at.course, 0.02 * size, lift)
            self._nodes["line"] = self.scene.add_mesh_simple(
                "/path/line", (vertices - offset).astype(np.float32), faces, color=LINE, side="double", cast_shadow=False
            )
        if points:
            x, y = np.transpose(points)
            dots = on_terrain(terrain, x, y, lift) - offset
            self._nodes["dots"] = self.scene.add_point_cloud(
                "/path/dots", dots.astype(np.float32), POINTS, point_size=0.09 * size, point_shape="circle"
            )

    def mark(self, name: str, x: float, y: float, terrain: Terrain, offset: Array, size: float) -> None:
        """Mark start or goal.

        Args:
            name: start or goal.
            x: m.
            y: m.
            terrain: the terrain.
            offset: (3,) origin of the scene in the world, m.
            size: of the rover, m.
        """
        place = on_terrain(terrain, np.array([x]), np.array([y]), 0.1 * size)[0] - offset
        self._nodes[name] = self.scene.add_icosphere(f"/path/{name}", 0.12 * size, MARKS[name], position=place)
        self.scene.add_label(f"/path/{name}/label", name, position=(0.0, 0.0, 0.3 * size))  # removed with its mark

    def clear(self) -> None:
        """Remove path and marks."""
        for node in self._nodes.values():
            node.remove()
        self._nodes = {}


def ribbon(terrain: Terrain, x: Array, y: Array, course: Array, half: float, lift: float) -> tuple[Array, Array]:
    """Return a flat ribbon along a path.

    A browser without a graphics card draws it faster than thick lines.

    Args:
        terrain: the terrain.
        x: (n,) m.
        y: (n,) m.
        course: (n,) direction of travel, rad.
        half: half of its width, m.
        lift: height above the terrain, m.

    Returns:
        Vertices (2n, 3) m and faces (k, 3); pieces over missing data are left out.
    """
    across = half * np.stack([-np.sin(course), np.cos(course)])
    height = terrain.height(x, y) + lift
    sides = [np.stack([x + sign * across[0], y + sign * across[1], height], axis=-1) for sign in (1.0, -1.0)]
    vertices = np.stack(sides, axis=1).reshape(-1, 3)
    k = 2 * np.flatnonzero(np.isfinite(height[:-1]) & np.isfinite(height[1:]))
    faces = np.concatenate([np.stack([k, k + 1, k + 3], axis=1), np.stack([k, k + 3, k + 2], axis=1)])
    return np.nan_to_num(vertices), faces.astype(np.uint32)


def on_terrain(terrain: Terrain, x: Array, y: Array, lift: float) -> Array:
    """Return points above the terrain.

    Args:
        terrain: the terrain.
        x: (n,) m.
        y: (n,) m.
        lift: m.

    Returns:
        (n, 3) m.
    """
    return np.stack([x, y, terrain.height(x, y) + lift], axis=-1)
