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
            line = on_terrain(terrain, at.x, at.y, lift) - offset
            line = line[np.isfinite(line).all(axis=-1)]
            if len(line) > 1:
                pieces = np.stack([line[:-1], line[1:]], axis=1).astype(np.float32)
                self._nodes["line"] = self.scene.add_line_segments("/path/line", pieces, LINE, thickness=4.0)
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
        self._nodes[f"{name}_label"] = self.scene.add_label(f"/path/{name}/label", name, position=(0.0, 0.0, 0.3 * size))

    def clear(self) -> None:
        """Remove path and marks."""
        for node in self._nodes.values():
            node.remove()
        self._nodes = {}


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
