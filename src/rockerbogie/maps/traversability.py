"""Traversability maps: poses at every cell and heading of a terrain, and their summaries."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._version import __version__
from ..errors import RockerbogieError, expect
from ..rover.model import LOAD_ROVER, Rover
from ..settling.settle import Mode
from ..terrain.heightfield import Terrain
from ..terrain.raster import locate
from ..terrain.window import Interpolation
from .cells import TILE, Tile, cells_over
from .ground import Ground, hold_ground, open_ground, reach
from .layers import LAYERS, chosen_layers, dataset
from .limits import Limits
from .run import Memory, Progress, in_threads, on_cluster
from .store import made_from, open_store, read
from .tile import Job
from .windows import TerrainWindows

if TYPE_CHECKING:
    import xarray as xr

#: Bytes of layers that are held in memory; a larger map stays in its store and is read when looked at.
IN_MEMORY = 1 << 30


def traversability(
    rover: Rover,
    terrain: Terrain | str | Path,
    headings: int | ArrayLike = 16,
    resolution: float | None = None,
    limits: Limits | str | None = None,
    *,
    bounds: tuple[float, float, float, float] | None = None,
    mode: Mode = "contact",
    layers: Iterable[str] | None = None,
    band: int = 1,
    cell: float | None = None,
    interpolation: Interpolation = "cubic",
    store: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    chunk: int = 2 * TILE,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Settle the rover at every cell and heading of a terrain, bit-identical to `settle`.

    Args:
        terrain: ground in memory; or a raster's path, which is read in windows and never whole.
        headings: how many, evenly from +x on, counter-clockwise; or which, (n,) rad.
        resolution: side of a cell, m; cells lie on the terrain's first node and every so much from it. None: on its nodes.
        limits: what a pose may have at most, a `Limits` or the name of one; None: Curiosity's flight limits.
        bounds: (xmin, ymin, xmax, ymax) m: only cells whose centres lie within.
        mode: as `settle`.
        layers: names of the layers to keep; None: all. A map's clearance, half its work, is looked at only if asked for.
        band, cell, interpolation: of the raster, as `Terrain.from_raster`.
        store: a folder to keep finished parts in, made if it is not there. The same call goes on where an earlier one was
            stopped. Needed for maps of more than 1 GB, which stay in it.
        workers: processes on this machine, by Dask. None: threads of this process, or a process a core for large maps.
        scheduler: address of an existing Dask cluster ("tcp://..."), whose workers see the same files.
        chunk: cells a side of what a worker makes at once, a multiple of 128. It changes nothing but memory and time.
        progress: called with (cells done, cells in all).

    Returns:
        Dataset over (heading, y, x), SI and radians, in memory or lazy; see docs/maps.md for its layers.

    Raises:
        RockerbogieError: a wrong argument; a store of another map; a disk that is full (a rerun goes on); zarr or dask
            missing.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    if mode not in ("contact", "equilibrium"):
        raise RockerbogieError(f"mode {mode!r} is not known; give 'contact' or 'equilibrium'")
    angles, allowed, names = _headings(headings), _limits(limits), chosen_layers(layers)
    if not (isinstance(chunk, (int, np.integer)) and chunk > 0 and chunk % TILE == 0):
        raise RockerbogieError(f"chunk is {chunk!r}: give a multiple of {TILE} cells")
    if workers is not None and not (isinstance(workers, (int, np.integer)) and workers >= 1):
        raise RockerbogieError(f"workers is {workers!r}: give how many processes, 1 or more")
    ground = _ground(terrain, band, interpolation, cell)
    cells = cells_over(ground.whole, resolution, bounds)
    job = Job(rover, cells, angles, allowed, mode, names)
    windows = TerrainWindows(ground, cells, reach(rover))
    size = sum(math.prod(job.shape(name, cells.all)) * np.dtype(LAYERS[name].kind).itemsize for name in names)
    if store is None and size > IN_MEMORY:
        raise RockerbogieError(
            f"the map would be {size / 1e9:.3g} GB: give store='a folder' to make it in, or ask for fewer layers or headings, "
            "a coarser resolution or smaller bounds"
        )
    dispersed = workers is not None or scheduler is not None or size > IN_MEMORY
    tell = _Count(math.prod(cells.size), progress)
    if store is None and not dispersed:
        tell(0)
        _compile(job, windows, next(cells.tiles()))
        memory = Memory.blank(job, cells.all)
        in_threads(job, windows, list(cells.chunks(chunk)), memory, tell)
        data = memory.arrays
    elif store is None:
        with tempfile.TemporaryDirectory(prefix="rockerbogie-") as folder:
            data = _in_store(job, windows, Path(folder) / "map", chunk, tell, workers, scheduler, dispersed=True, lazily=False)
    else:
        place = Path(store).absolute()
        data = _in_store(job, windows, place, chunk, tell, workers, scheduler, dispersed=dispersed, lazily=size > IN_MEMORY)
    return dataset(data, angles, cells.x((0, cells.size[0])), cells.y((0, cells.size[1])), _about(job, ground))


def _in_store(
    job: Job, windows: TerrainWindows, place: Path, chunk: int, tell: Callable[[int], None], workers: int | None,
    scheduler: str | None, *, dispersed: bool, lazily: bool,
) -> dict[str, Any]:  # fmt: skip
    """Make what is missing in a store, and give its layers."""
    store = open_store(place, job, made_from(job, windows.ground))
    chunks = [[tile for tile in tiles if not store.is_done(tile)] for tiles in job.cells.chunks(chunk)]
    chunks = [tiles for tiles in chunks if tiles]
    tell(math.prod(job.cells.size) - sum(tile.size for tiles in chunks for tile in tiles))
    try:
        if chunks:
            _compile(job, windows, chunks[0][0])
        if chunks and dispersed:
            on_cluster(job, windows, chunks, place, workers, scheduler, tell)
        elif chunks:
            in_threads(job, windows, chunks, store, tell)
        if missing := [tile for tile in job.cells.tiles() if not store.is_done(tile)]:
            raise RuntimeError(f"{len(missing)} tiles were not made, {missing[0]} first")
        if chunks:
            store.tidy()
        return read(store, lazily)
    except OSError as error:
        raise RockerbogieError(
            f"cannot make the map in {str(place)!r}: {error.strerror or error}; "
            "what is finished is kept, and the same call goes on from there"
        ) from None


def _compile(job: Job, windows: TerrainWindows, tile: Tile) -> None:
    """Settle once in this thread: kernels compile once, and an interrupt can stop that."""
    corner = Tile((tile.rows[0], tile.rows[0] + 1), (tile.cols[0], tile.cols[0] + 1))
    replace(job, headings=job.headings[:1]).settle(windows.terrain([corner]), corner, lambda name, region, values: None)


class _Count:
    """Adds up the cells done, and passes them on."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self.done, self.total, self.progress = 0, total, progress

    def __call__(self, cells: int) -> None:
        self.done += cells
        if self.progress is not None:
            self.progress(self.done, self.total)


def _ground(terrain: Terrain | str | Path, band: int, interpolation: Interpolation, cell: float | None) -> Ground:
    if isinstance(terrain, Terrain):
        return hold_ground(terrain)
    if not isinstance(terrain, (str, Path)):
        raise RockerbogieError(f"terrain is {terrain!r:.60}: give a Terrain, or the path of a raster")
    if interpolation not in ("cubic", "linear"):
        raise RockerbogieError(f"interpolation {interpolation!r} is not known; give 'cubic' or 'linear'")
    return open_ground(locate(terrain), band, interpolation, cell)


def _headings(headings: int | ArrayLike) -> NDArray[np.float64]:
    """(n,) rad."""
    try:
        given = np.asarray(headings)
        if given.ndim == 0 and given == int(given) and given >= 1:
            return 2 * np.pi * np.arange(int(given)) / int(given)
        angles = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        angles = np.array(np.nan)
    if angles.ndim != 1 or not angles.size or not np.isfinite(angles).all():
        raise RockerbogieError(f"headings is {headings!r:.60}: give how many, 1 or more, or a list of angles in rad")
    return angles


def _limits(limits: Limits | str | None) -> Limits:
    if isinstance(limits, Limits):
        return limits
    if limits is not None and not isinstance(limits, str):
        raise RockerbogieError(f"limits is {limits!r:.60}: give a rockerbogie.Limits, the name of one, or None for Curiosity's")
    return Limits.named(limits or "curiosity")


def _about(job: Job, ground: Ground) -> dict[str, Any]:
    """Return the attributes of a map."""
    dx, dy = job.cells.step
    about = {
        "title": f"Where {job.rover.name} can go",
        "Conventions": "CF-1.11",
        "rover": job.rover.name,
        "terrain": ground.whole.name,
        "interpolation": ground.whole.interpolation,
        "mode": job.mode,
        "limits": job.limits.to_json(),
        "resolution": dx if dx == dy else [dx, dy],
        "rockerbogie_version": __version__,
    }
    return about | ({"crs": ground.whole.crs} if ground.whole.crs else {})
