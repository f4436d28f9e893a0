"""Decision of which poses keep the body's box above a limit of clearance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._kernels.batch.contacts import clearance_batch
from .._kernels.jit.parallel import parallel_for
from .._kernels.model.ground import META_Z
from ..arrays import Array
from ..rover.model import Rover
from ..settling.pose import Pose
from ..terrain.heightfield import Terrain

#: Distance by which a bound must exceed the limit, far above rounding, m.
SAFE = 1e-6
#: Most nodes under the body per heading for which planes cost less than the search that they replace.
NODES_PER_HEADING = 30


@dataclass(frozen=True, eq=False)
class UpperPlanes:
    """Planes over the cells of a map that the terrain under the body does not exceed.

    Attributes:
        x, y: slopes of the planes along x and y, (rows, cols).
        height: of the planes at the cells, m, (rows, cols); NaN where data is missing or the map ends.
    """

    x: Array
    y: Array
    height: Array

    @classmethod
    @np.errstate(invalid="ignore")  # missing data is infinite or NaN
    def of(cls, rover: Rover, terrain: Terrain, x: Array, y: Array, headings: int) -> UpperPlanes | None:
        """Return the planes for a grid of cells.

        Args:
            rover: its body box gives the terrain to cover.
            terrain: a window that holds it.
            x: (cols,) of the cells, m.
            y: (rows,) of the cells, m.
            headings: number of headings at each cell.

        Returns:
            The planes; `None` if the body covers too many nodes.
        """
        reach = float(np.linalg.norm(np.abs(rover.body_box).max(axis=0)))
        m, n = (int(reach / step + 0.5) + 1 for step in terrain.spacing)
        if (2 * m + 1) * (2 * n + 1) > NODES_PER_HEADING * headings:
            return None
        (x0, y0), (dx, dy) = terrain.origin, terrain.spacing
        col, row = np.rint((x - x0) / dx).astype(np.int64), np.rint((y - y0) / dy).astype(np.int64)
        nodes = np.pad(terrain.upper_bound, ((n, n), (m, m)), constant_values=np.nan)
        row, col = (np.clip(at, 0, size - 1) for at, size in zip((row, col), terrain.upper_bound.shape, strict=True))
        px = py = np.zeros((len(y), len(x)))
        for j in range(-n, n + 1):
            line = nodes[row + n + j]
            for i in range(-m, m + 1):
                z = line[:, col + m + i]
                px, py = px + i * z, py + j * z
        count = (2 * m + 1) * (2 * n + 1)
        px, py = px * (3.0 / (count * m * (m + 1) * dx)), py * (3.0 / (count * n * (n + 1) * dy))
        height = np.full(px.shape, -np.inf)
        east, north = x0 + dx * col - x, (y0 + dy * row - y)[:, None]  # from the cell to its nearest node
        for j in range(-n, n + 1):
            line = nodes[row + n + j]
            for i in range(-m, m + 1):
                np.maximum(height, line[:, col + m + i] - px * (east + i * dx) - py * (north + j * dy), out=height)
        return cls(px, py, height + terrain.meta[META_Z])

    @np.errstate(invalid="ignore")
    def clear(self, pose: Pose, yaw: Array, at: tuple[slice, slice], limit: float) -> NDArray[np.bool_]:
        """Return the poses whose clearance is surely above a limit.

        The least height of the box above a plane is that of its lowest point along the plane's normal.

        Args:
            pose: (headings, rows, cols) at the cells `at`.
            yaw: (headings,) rad.
            at: rows and columns of the cells.
            limit: of the clearance, m.

        Returns:
            (headings, rows, cols); False where the bound does not decide.
        """
        low, high = pose.rover.body_box
        (bx, by, bz), (hx, hy, hz) = 0.5 * (high + low), 0.5 * (high - low)
        c, s = np.cos(yaw)[:, None, None], np.sin(yaw)[:, None, None]
        u, v = c * self.x[at] + s * self.y[at], c * self.y[at] - s * self.x[at]
        sr, cr, sp, cp = np.sin(pose.roll), np.cos(pose.roll), np.sin(pose.pitch), np.cos(pose.pitch)
        down = cp - u * sp
        ex, ey, ez = -u * cp - sp, down * sr - v * cr, down * cr + v * sr
        lowest = ex * bx + ey * by + ez * bz - np.abs(ex) * hx - np.abs(ey) * hy - np.abs(ez) * hz
        return np.asarray(pose.z + lowest - self.height[at] > limit + SAFE)


def clearance_at(pose: Pose, where: NDArray[np.bool_]) -> Array:
    """Return the clearance of some poses, as `Pose.clearance` has it.

    Args:
        pose: (...) settled poses.
        where: (...) those that are wanted.

    Returns:
        (n,) m, in the order of the poses; NaN where the body reaches missing data or the edge of the map.
    """
    x, y, yaw = (np.ascontiguousarray(np.broadcast_to(values, pose.shape)[where]) for values in (pose.x, pose.y, pose.yaw))
    out = np.empty(len(x))
    parallel_for(clearance_batch, len(x), pose.terrain.packed, pose.rover.packed, x, y, yaw, pose.q[where], out)
    return out
