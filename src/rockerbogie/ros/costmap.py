"""Cost map on heights that change: only cells that a change can reach are settled again."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.model.ground import META_MAX_CURVATURE, META_STEEP
from .._kernels.search.tread import SMOOTH
from .._kernels.simd.layout import SIDE
from ..arrays import Array, floats
from ..errors import RockerbogieError, expect
from ..gravity import GRAVITY, check_gravity
from ..maps.cells import Cells, Span, Tile, cells_over
from ..maps.ground import SPARE, hold_ground, reach
from ..maps.layers import chosen_layers, dataset
from ..maps.limits import Limits
from ..maps.run import Memory, in_threads
from ..maps.tile import Job
from ..maps.traversability import heading_angles, limits_given, map_attributes
from ..maps.windows import TerrainWindows
from ..rover.model import LOAD_ROVER, Rover
from ..settling.settle import Mode, check_mode
from ..terrain.heightfield import Terrain
from ..terrain.window import Interpolation

if TYPE_CHECKING:
    import xarray as xr

#: Cost of a cell that no heading passes, as Nav2 reads it, and of a cell without data.
LETHAL, UNKNOWN = 100, -1
#: Side of the blocks, in cells, by which cells are settled again.
BLOCK = 8
#: Largest distance of a part's nodes from those of the map, in steps.
OFF_NODE = 0.01


class CostMapChange(NamedTuple):
    """Cells that an update settled again."""

    cells: int  # their number
    rows: Span  # of the map: first, one past the last; (0, 0) if there are none
    cols: Span
    everything: bool  # the nodes are others, or a bound of the whole map has changed


class CostMap:
    """Traversability on heights that arrive in parts, equal to `traversability` bit for bit.

    `replace` takes a whole map, `update` a part of it. Cells beyond the rover's reach of every changed node are kept. `maps`
    equals `traversability(rover, terrain, headings, resolution, limits)` with this object's `terrain`. A map with other nodes
    (moved, or of another resolution) is settled as a whole, because rounding depends on the position of its first node.

    With linear interpolation (the default here) a change of heights acts within the rover's reach. With cubic interpolation it
    acts up to 28 nodes further, until it is below rounding.

    Attributes:
        rover: the mechanism.
        terrain: the heights as settled on; `None` before the first heights, or if all of them are missing.
        headings: (n,) rad.
        limits: of a passable pose.
    """

    def __init__(
        self,
        rover: Rover,
        *,
        headings: int | ArrayLike = 16,
        resolution: float | None = None,
        limits: Limits | str | None = None,
        layers: Iterable[str] = ("passable",),
        mode: Mode = "contact",
        gravity: float = GRAVITY["earth"],
        interpolation: Interpolation = "linear",
        tell: Callable[[int], None] = lambda cells: None,
    ) -> None:
        """Prepare an empty map.

        Args:
            rover: the rover.
            headings: as `traversability`.
            resolution: side of a cell, m; `None`: that of the heights.
            limits: as `traversability`.
            layers: names of the layers to keep, beside `passable`.
            mode: as `settle`.
            gravity: m/s².
            interpolation: of the heights.
            tell: called with the number of cells settled since its last call. An exception that it raises ends the work; the
                cells that are left are settled with the next heights.

        Raises:
            RockerbogieError: a wrong argument, as `traversability` raises it.
        """
        expect(rover, Rover, "rover", LOAD_ROVER)
        check_mode(mode)
        if interpolation not in ("cubic", "linear"):
            raise RockerbogieError(f"interpolation {interpolation!r} is not known; give 'cubic' or 'linear'")
        self.rover, self.mode, self.interpolation, self.resolution = rover, mode, interpolation, resolution
        self.headings, self.limits, self.gravity = heading_angles(headings), limits_given(limits), check_gravity(gravity)
        names = [layers] if isinstance(layers, str) else list(layers)
        self.layers = chosen_layers(["passable", *names], self.limits.forces)
        self._tell = tell
        self.terrain: Terrain | None = None
        self._grid: _Grid | None = None
        self._job: Job | None = None
        self._memory = Memory({})
        self._stale = np.empty((0, 0), dtype=bool)  # cells that are to be settled; kept if an interrupt stops the work

    def replace(
        self, heights: ArrayLike, origin: tuple[float, float] = (0.0, 0.0), spacing: float | tuple[float, float] = 0.1
    ) -> CostMapChange:
        """Take a whole map of heights; cells are kept if its nodes are the same.

        Args:
            heights: (rows, cols) m, y grows with the row; NaN is missing data.
            origin: x, y of heights[0, 0], m.
            spacing: dx, or (dx, dy), m.

        Returns:
            The cells that were settled.

        Raises:
            TerrainError: not a map of heights.
        """
        dx, dy = np.broadcast_to(np.asarray(spacing, dtype=float), (2,)).tolist()
        return self._renew(_Grid(_heights(heights).copy(), (float(origin[0]), float(origin[1])), (dx, dy)))

    def update(self, heights: ArrayLike, origin: tuple[float, float]) -> CostMapChange:
        """Take the heights of a part of the map.

        Args:
            heights: (rows, cols) m, on the nodes of the map; NaN is missing data.
            origin: x, y of heights[0, 0], m.

        Returns:
            The cells that were settled.

        Raises:
            RockerbogieError: no map yet; a part that is not within the map, or lies between its nodes.
        """
        return self._renew(self._known().patched(_heights(heights), origin))

    @property
    def origin(self) -> tuple[float, float]:
        """x, y of the centre of the first cell, m."""
        return self._known().origin

    @property
    def spacing(self) -> tuple[float, float]:
        """Sides of a cell, m."""
        return self._known().spacing if self.resolution is None else (float(self.resolution), float(self.resolution))

    @property
    def maps(self) -> xr.Dataset:
        """Layers of the map, the Dataset that `traversability` returns."""
        terrain, job = self._settled()
        cells = job.cells
        x, y = cells.x((0, cells.size[0])), cells.y((0, cells.size[1]))
        return dataset(self._memory.arrays, self.headings, x, y, map_attributes(job, hold_ground(terrain)))

    def layer(self, name: str) -> NDArray[Any]:
        """Return a layer of the map.

        Args:
            name: one of `layers`.

        Returns:
            (rows, cols), or (headings, rows, cols) for a layer per heading.

        Raises:
            RockerbogieError: no such layer, or no heights yet.
        """
        self._settled()
        if name not in self.layers:
            raise RockerbogieError(f"the cost map has no layer {name!r}: give layers=[{name!r}] when it is made")
        return self._memory.arrays[name]

    def occupancy(self) -> NDArray[np.int8]:
        """Return the cost of each cell as nav_msgs/OccupancyGrid has it.

        Returns:
            (rows, cols): 0 if every heading passes, 100 if no heading does, else 1 to 99 by the share that does not; -1 without
            data.

        Raises:
            RockerbogieError: no heights yet.
        """
        if self.terrain is None:
            grid = self._known()
            steps = [self.spacing[axis] / grid.spacing[axis] for axis in (1, 0)]
            shape = [math.floor((n - 1) / step + 1e-6) + 1 for n, step in zip(grid.z.shape, steps, strict=True)]
            return np.full(shape, UNKNOWN, dtype=np.int8)
        share = self.layer("passable").astype(float)
        cost = np.rint(LETHAL * (1.0 - share))
        cost = np.where((share > 0.0) & (share < 1.0), np.clip(cost, 1, LETHAL - 1), cost)
        return np.where(np.isnan(share), UNKNOWN, cost).astype(np.int8)

    def _known(self) -> _Grid:
        """Return the heights, or raise if there are none yet."""
        if self._grid is None:
            raise RockerbogieError("the cost map has no heights yet: call replace(heights, origin, spacing)")
        return self._grid

    def _settled(self) -> tuple[Terrain, Job]:
        """Return terrain and job, or raise if nothing was settled yet."""
        self._known()
        if self.terrain is None or self._job is None:
            raise RockerbogieError("every height of the cost map is missing: it has no layers")
        return self.terrain, self._job

    def _renew(self, grid: _Grid) -> CostMapChange:
        """Take new heights, and settle the cells that they can change."""
        old = self.terrain if self._grid is not None and grid.same_nodes(self._grid) else None
        if not np.isfinite(grid.z).any():
            self._grid, self.terrain, self._job = grid, None, None
            return CostMapChange(0, (0, 0), (0, 0), True)
        new = Terrain.from_array(grid.z, grid.spacing, grid.origin, self.interpolation, name="cost map")
        ground = hold_ground(new)
        cells = cells_over(ground.whole, self.resolution, None)
        job = Job(self.rover, cells, self.headings, self.limits, self.mode, self.layers, self.gravity)
        margin = reach(self.rover)
        everything = old is None or _differs_everywhere(old, new, self.rover)
        if old is None or everything:
            self._memory, self._stale = Memory.blank(job, cells.all), np.ones(cells.size[::-1], dtype=bool)
        else:
            self._stale |= _reached(_changed_nodes(old, new), new, cells, margin)
        self._grid, self.terrain, self._job = grid, new, job
        tiles = list(_rectangles(self._stale))
        in_threads(job, TerrainWindows(ground, cells, margin), [tiles], self._memory, self._tell)
        self._stale[:] = False
        rows, cols = (
            (min((tile[axis][0] for tile in tiles), default=0), max((tile[axis][1] for tile in tiles), default=0))
            for axis in (0, 1)
        )
        return CostMapChange(sum(tile.size for tile in tiles), rows, cols, everything)


class _Grid(NamedTuple):
    """Heights on the nodes of the map."""

    z: Array  # (rows, cols) m
    origin: tuple[float, float]  # x, y of z[0, 0], m
    spacing: tuple[float, float]  # m

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of the nodes, m."""
        (x0, y0), (dx, dy), (rows, cols) = self.origin, self.spacing, self.z.shape
        return x0, y0, x0 + (cols - 1) * dx, y0 + (rows - 1) * dy

    def same_nodes(self, other: _Grid) -> bool:
        """Return True if two grids have the same nodes."""
        return self.z.shape == other.z.shape and (self.origin, self.spacing) == (other.origin, other.spacing)

    def patched(self, z: Array, origin: tuple[float, float]) -> _Grid:
        """Return the grid with the heights of a part of it, or raise."""
        at = [(float(p) - o) / d for p, o, d in zip(origin, self.origin, self.spacing, strict=True)]
        where = f"the part at ({origin[0]:g}, {origin[1]:g}) m with {z.shape[0]} x {z.shape[1]} nodes"
        if not np.isfinite(at).all() or max(abs(a - round(a)) for a in at) > OFF_NODE:
            raise RockerbogieError(
                f"{where} lies between the nodes of the map, which are {self.spacing} m apart from {self.origin} m on: "
                "resample it, or give the whole map to replace()"
            )
        col, row = (round(a) for a in at)
        if row < 0 or col < 0 or row + z.shape[0] > self.z.shape[0] or col + z.shape[1] > self.z.shape[1]:
            raise RockerbogieError(
                f"{where} is not within the map, which spans ({', '.join(f'{v:g}' for v in self.bounds)}) m: "
                "give the whole map to replace()"
            )
        heights = self.z.copy()
        heights[row : row + z.shape[0], col : col + z.shape[1]] = z
        return self._replace(z=heights)


def _heights(values: ArrayLike) -> Array:
    """Return heights as (rows, cols) floats, or raise."""
    try:
        z = floats(values)
    except (TypeError, ValueError) as error:
        raise RockerbogieError(f"heights are not numbers: {error}") from None
    if z.ndim != 2 or not z.size:
        raise RockerbogieError(f"heights of shape {z.shape} are not a map: give (rows, cols), y growing with the row")
    return z


def _differs_everywhere(old: Terrain, new: Terrain, rover: Rover) -> bool:
    """Return True if a bound of the whole map changes the result of every pose.

    Both bounds are infinite where data is missing, and then poses that fail are solved again. The curvature bound acts on discs
    that are smaller than its radius of curvature, the bound of slopes on discs over more nodes than a SIMD lane holds. Otherwise
    a lane compares the slopes under its own wheel, with the same result.
    """
    cubic = new.interpolation == "cubic"
    bounds = [float(terrain.meta[META_MAX_CURVATURE if cubic else META_STEEP]) for terrain in (old, new)]
    if bounds[0] == bounds[1]:
        return False
    radii = rover.wheel_radius[rover.wheel_width == 0]
    discs = radii * min(bounds) < SMOOTH if cubic else 2.0 * radii > (SIDE - 2.0) * min(new.spacing)
    return bool(math.isinf(bounds[0]) or math.isinf(bounds[1]) or discs.any())


def _changed_nodes(old: Terrain, new: Terrain) -> NDArray[np.bool_]:
    """Return the nodes (rows, cols) at which an array that kernels read has other bits."""
    changed = _bits(old.upper_bound) != _bits(new.upper_bound)
    if new.interpolation == "linear":
        changed |= _bits(old.bridged) != _bits(new.bridged)
    other = _bits(old.grid) != _bits(new.grid)
    ring = new.grid.shape[0] - new.upper_bound.shape[0]  # 2 for spline coefficients: those around a node act on it
    rows, cols = changed.shape
    for i in range(ring + 1):
        for j in range(ring + 1):
            changed |= other[i : i + rows, j : j + cols]
    return np.asarray(changed)


def _bits(values: Array) -> NDArray[np.uint64]:
    """Return the bits of an array, in which NaN is equal to itself."""
    return np.ascontiguousarray(values).view(np.uint64)


def _reached(nodes: NDArray[np.bool_], terrain: Terrain, cells: Cells, margin: float) -> NDArray[np.bool_]:
    """Return the cells (rows, cols) from which a rover reaches a node that is set."""
    total = np.zeros((nodes.shape[0] + 1, nodes.shape[1] + 1), dtype=np.int64)
    total[1:, 1:] = nodes.cumsum(axis=0).cumsum(axis=1)
    spans = []
    for axis, at in ((1, cells.y((0, cells.size[1]))), (0, cells.x((0, cells.size[0])))):
        first, step, count = terrain.origin[axis], terrain.spacing[axis], nodes.shape[1 - axis]
        low = np.floor((at - margin - first) / step).astype(np.int64) - SPARE
        high = np.ceil((at + margin - first) / step).astype(np.int64) + SPARE + 1
        spans.append((np.clip(low, 0, count), np.clip(high, 0, count)))
    (r0, r1), (c0, c1) = spans
    return np.asarray(total[r1[:, None], c1] - total[r0[:, None], c1] - total[r1[:, None], c0] + total[r0[:, None], c0] > 0)


def _rectangles(wanted: NDArray[np.bool_]) -> Iterator[Tile]:
    """Yield rectangles that cover the cells that are set, in blocks of `BLOCK` cells a side."""
    rows, cols = wanted.shape
    padded = np.zeros((-(-rows // BLOCK) * BLOCK, -(-cols // BLOCK) * BLOCK), dtype=bool)
    padded[:rows, :cols] = wanted
    blocks = np.asarray(padded.reshape(padded.shape[0] // BLOCK, BLOCK, -1, BLOCK).any(axis=(1, 3)))
    open_runs: dict[tuple[int, int], int] = {}  # columns of blocks -> their first row
    for row in range(len(blocks) + 1):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], blocks[row], [0]]))) if row < len(blocks) else np.empty(0, int)
        runs = {(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)}
        for run in [run for run in open_runs if run not in runs]:
            yield Tile((open_runs.pop(run) * BLOCK, min(row * BLOCK, rows)), (run[0] * BLOCK, min(run[1] * BLOCK, cols)))
        for run in runs - open_runs.keys():
            open_runs[run] = row
