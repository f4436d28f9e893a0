"""Terrain of a map: in memory, or in a file that is read by windows."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from .._kernels.model.ground import META_MAX_CURVATURE, META_STEEP, META_Z
from ..errors import TerrainError
from ..rover.model import Rover
from ..terrain import spline
from ..terrain.heightfield import Terrain, build_window, crop
from ..terrain.raster import Raster, open_raster
from ..terrain.window import Datum, Interpolation, MapExtent, check_grid, greatest_rises, nodes_needed, slope

Span = tuple[int, int]  # first, one past the last

BAND = 1 << 22  # nodes of a file read at once in the first pass: 32 MB of heights
BLOCK = 4 * spline.TILE  # nodes a side in one step of the curvature of its spline
SPARE = 4  # extra nodes around the reach of the rover


class Ground(Protocol):
    """Terrain of a map, in memory or in a file."""

    @property
    def whole(self) -> MapExtent:
        """Extent of the terrain."""

    def window(self, rows: Span, cols: Span) -> Terrain:
        """Return terrain for poses that read only some nodes.

        Args:
            rows: first row of nodes, one past the last.
            cols: first column, one past the last.

        Returns:
            Terrain with at least these nodes, bit-identical to the whole there.
        """

    def cost(self, rows: Span, cols: Span) -> int:
        """Return the number of nodes for which a window takes memory.

        Args:
            rows: first row of nodes, one past the last.
            cols: first column, one past the last.

        Returns:
            Number of nodes.
        """

    def sent(self, rows: Span, cols: Span) -> Ground:
        """Return the part of the terrain that another process needs to make a window.

        Args:
            rows: first row of nodes, one past the last.
            cols: first column, one past the last.

        Returns:
            The part.
        """

    def digest(self) -> str:
        """Return the digest of the heights.

        Returns:
            SHA-256, hexadecimal.
        """


@dataclass(frozen=True)
class InMemory:
    """Terrain in memory."""

    terrain: Terrain  # or a window of it, in another process
    whole: MapExtent

    def window(self, rows: Span, cols: Span) -> Terrain:
        """Return the whole terrain, which takes no more memory.

        Args:
            rows: not used.
            cols: not used.

        Returns:
            The terrain.
        """
        return self.terrain

    def cost(self, rows: Span, cols: Span) -> int:
        """Return 0, as the terrain is in memory already.

        Args:
            rows: not used.
            cols: not used.

        Returns:
            0.
        """
        return 0

    def sent(self, rows: Span, cols: Span) -> Ground:
        """Cut a window out of the terrain.

        Args:
            rows: first row of nodes, one past the last.
            cols: first column, one past the last.

        Returns:
            The window, with the extent of the whole.
        """
        return InMemory(crop(self.terrain, rows, cols), self.whole)

    def digest(self) -> str:
        """Return the digest of the heights.

        Returns:
            SHA-256 of the float64 array, hexadecimal.
        """
        return hashlib.sha256(np.ascontiguousarray(self.terrain.z).data).hexdigest()


@dataclass(frozen=True)
class InFile:
    """Terrain in a raster file, which is read by windows only."""

    raster: Raster
    whole: MapExtent
    heights: str  # the digest

    def window(self, rows: Span, cols: Span) -> Terrain:
        """Read a window of the file.

        Args:
            rows: first row of nodes, one past the last.
            cols: first column, one past the last.

        Returns:
            Terrain of these nodes, bit-identical to the same part of the whole file's.
        """
        needed = [
            nodes_needed(*span, count, self.whole.interpolation)
            for span, count in zip((rows, cols), self.whole.shape, strict=True)
        ]
        return build_window(self.raster.read(*needed), (needed[0][0], needed[1][0]), rows, cols, self.whole)

    def cost(self, rows: Span, cols: Span) -> int:
        """Return the number of nodes of a window.

        Args:
            rows: first row of nodes, one past the last.
            cols: first column, one past the last.

        Returns:
            Number of nodes.
        """
        return (rows[1] - rows[0]) * (cols[1] - cols[0])

    def sent(self, rows: Span, cols: Span) -> Ground:
        """Return the object itself: other processes read the file.

        Args:
            rows: not used.
            cols: not used.

        Returns:
            Itself.
        """
        return self

    def digest(self) -> str:
        """Return the digest of the heights.

        Returns:
            SHA-256, hexadecimal, equal to that of the same terrain in memory.
        """
        return self.heights


def hold_ground(terrain: Terrain) -> InMemory:
    """Return a terrain in memory as the terrain of a map.

    Args:
        terrain: a whole terrain.

    Returns:
        The terrain with its extent.
    """
    level, curvature, steep = (float(terrain.meta[at]) for at in (META_Z, META_MAX_CURVATURE, META_STEEP))
    rows, cols = terrain.z.shape
    outline = ((rows, cols), terrain.spacing, terrain.origin, terrain.interpolation, terrain.crs, terrain.name)
    return InMemory(terrain, MapExtent(*outline, level, curvature, steep))


def open_ground(path: str | Path, band: int, interpolation: Interpolation, cell: float | None = None) -> InFile:
    """Open the terrain in a file: one pass for reference height, digest, curvature and slope.

    Args:
        path: a raster file, or a name that GDAL takes.
        band: number of the band with the heights, from 1.
        interpolation: "cubic" or "linear".
        cell: side of a cell, m, for a file without georeference.

    Returns:
        The terrain, with no heights in memory.

    Raises:
        TerrainError: not a raster of heights (`raster.open_raster`); a grid that `terrain.check_grid` refuses; heights beyond
            `terrain.MAX_HEIGHT`, or none at all.
    """
    raster = open_raster(path, band, cell)
    rows, cols = raster.shape
    if min(rows, cols) < (least := 4 if interpolation == "cubic" else 2):
        raise TerrainError(f"{raster.name} has {rows} x {cols} nodes; {interpolation} terrain needs at least {least} each way")
    outline = (raster.shape, raster.spacing, raster.origin)
    check_grid(raster.name, *outline)
    raster = raster.screened()
    datum, missing = Datum(raster.name, *outline), False
    digest, rises, before = hashlib.sha256(), (0.0, 0.0), None
    step = max(BAND // cols, 1)
    for row in range(0, rows, step):
        z = raster.read((row, min(row + step, rows)), (0, cols))
        digest.update(z.data)
        datum.add(row, z)
        rises = greatest_rises(z if before is None else np.concatenate([before, z]), rises)
        before = z[-1:]
        missing |= not np.isfinite(z).all()
    level = datum.height()
    curvature = _curvature(raster, level) if interpolation == "cubic" and not missing else math.inf
    steep = slope(rises, raster.spacing) if interpolation == "linear" else math.inf
    whole = MapExtent(*outline, interpolation, raster.crs, Path(raster.name).stem, level, curvature, steep)
    return InFile(raster, whole, digest.hexdigest())


def _curvature(raster: Raster, level: float) -> float:
    """Return the greatest curvature of the spline of a file without missing data, 1/m."""
    greatest = [0.0, 0.0, 0.0]
    spans = [[(n, min(n + BLOCK, count)) for n in range(0, count, BLOCK)] for count in raster.shape]
    for rows in spans[0]:
        for cols in spans[1]:
            needed = [spline.nodes_needed(*span, count) for span, count in zip((rows, cols), raster.shape, strict=True)]
            z = raster.read(*needed) - level
            c = spline.coefficients(z, (needed[0][0], needed[1][0]), raster.shape, rows, cols)
            greatest = [max(pair) for pair in zip(greatest, spline.greatest_differences(c), strict=True)]
    return spline.greatest_curvature((greatest[0], greatest[1], greatest[2]), raster.spacing)


def reach(rover: Rover) -> float:
    """Return an upper bound of the rover's horizontal reach, for all joint angles.

    Args:
        rover: the rover.

    Returns:
        Distance from the reference point, m.
    """
    farthest = float(np.linalg.norm(np.abs(rover.body_box).max(axis=0)))
    for i in range(6):
        side = i % 2
        pivot, bogie, hub = rover.rocker_pivot[side], rover.bogie_pivot[side], rover.hubs[i]
        links = [pivot, hub - pivot] if i < 2 else [pivot, bogie - pivot, hub - bogie]
        arm = sum(float(np.linalg.norm(link)) for link in links) + 2.0 * float(np.linalg.norm(rover.steering_offset[i]))
        farthest = max(farthest, arm + math.hypot(rover.wheel_radius[i], 0.5 * rover.wheel_width[i]))
    return farthest


def nodes_under(low: float, high: float, first: float, step: float, count: int, margin: float) -> Span:
    """Return the nodes of an axis that poses may read.

    Args:
        low: lowest coordinate of the poses, m.
        high: highest coordinate, m.
        first: coordinate of node 0, m.
        step: spacing of the nodes, m.
        count: number of nodes.
        margin: reach of the rover, m.

    Returns:
        First node, one past the last; at least 2 nodes.
    """
    start = math.floor((low - margin - first) / step) - SPARE
    stop = math.ceil((high + margin - first) / step) + SPARE + 1
    return min(max(start, 0), count - 2), max(min(stop, count), 2)
