"""Terrain under the cells of a map, window by window."""

from __future__ import annotations

from dataclasses import dataclass

from ..terrain.heightfield import Terrain
from .cells import Cells, Tile
from .ground import Ground, Span, nodes_under


@dataclass(frozen=True, eq=False)
class TerrainWindows:
    """Terrain for tiles of cells: each window holds all nodes that the rover can reach."""

    ground: Ground  # in memory or in a file
    cells: Cells
    margin: float  # reach of the rover from its reference point, m

    def spans(self, tiles: list[Tile]) -> tuple[Span, Span]:
        """Return the nodes that poses on some tiles may read.

        Args:
            tiles: the tiles.

        Returns:
            Rows and columns, each first and one past the last.
        """
        whole = self.ground.whole
        x = self.cells.x((min(t.cols[0] for t in tiles), max(t.cols[1] for t in tiles)))
        y = self.cells.y((min(t.rows[0] for t in tiles), max(t.rows[1] for t in tiles)))
        return (
            nodes_under(y[0], y[-1], whole.origin[1], whole.spacing[1], whole.shape[0], self.margin),
            nodes_under(x[0], x[-1], whole.origin[0], whole.spacing[0], whole.shape[1], self.margin),
        )

    def terrain(self, tiles: list[Tile]) -> Terrain:
        """Return the terrain for poses on some tiles.

        Args:
            tiles: the tiles.

        Returns:
            A window, or the whole terrain if it is in memory.
        """
        return self.ground.window(*self.spans(tiles))

    def cost(self, tiles: list[Tile]) -> int:
        """Return the number of nodes for which the window of some tiles takes memory.

        Args:
            tiles: the tiles.

        Returns:
            Number of nodes.
        """
        return self.ground.cost(*self.spans(tiles))

    def sent(self, tiles: list[Tile]) -> TerrainWindows:
        """Return the part of the terrain that another process needs for some tiles.

        Args:
            tiles: the tiles.

        Returns:
            Windows over that part.
        """
        return TerrainWindows(self.ground.sent(*self.spans(tiles)), self.cells, self.margin)
