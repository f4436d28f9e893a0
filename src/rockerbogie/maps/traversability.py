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

from .._kernels.jit.uncompiled import compile_first
from ..arrays import floats
from ..errors import RockerbogieError, expect
from ..files.version import __version__
from ..gravity import GRAVITY, check_gravity
from ..rover.model import LOAD_ROVER, Rover
from ..settling.settle import Mode
from ..terrain.heightfield import Terrain
from ..terrain.raster import locate
from ..terrain.window import Interpolation
from .cells import TILE, Tile, cells_over
from .ground import Ground, hold_ground, open_ground, reach
from .layers import chosen_layers, dataset, kind_of
from .limits import Limits
from .run import Memory, Progress, in_threads, on_cluster
from .store import made_from, open_store, read
from .tile import Job
from .windows import TerrainWindows

if TYPE_CHECKING:
    import xarray as xr

#: Bytes of layers that are held in memory; a larger map stays in its store and is read at use.
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
    gravity: float = GRAVITY["earth"],
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
        rover: the rover.
        terrain: terrain in memory; or a raster's path, which is read in windows and never whole.
        headings: their number, evenly spaced from +x counter-clockwise; or the angles, (n,) rad.
        resolution: side of a cell, m, counted from the terrain's first node. None: the nodes are the cells.
        limits: a `Limits`, or the name of one. None: Curiosity's flight limits.
        bounds: (xmin, ymin, xmax, ymax) m: only cells whose centres lie within.
        mode: as `settle`.
        gravity: m/s² (`GRAVITY`); scales `max_torque` and its limit only.
        layers: names of the layers to make; None: the usual ones, and those of the forces that have limits. Clearance takes half
            of the time, and is computed only for its layers or limit; so are the forces (`required_friction`, `tip_margin`,
            `max_torque`).
        band: of the raster, as `Terrain.from_raster`.
        cell: of the raster, as `Terrain.from_raster`.
        interpolation: of the raster, as `Terrain.from_raster`.
        store: folder for finished parts, created if missing. The same call continues a map that was stopped. Needed for maps
            of more than 1 GB, which stay in it.
        workers: number of processes on this machine, by Dask. None: threads of this process, or one process per core for
            large maps.
        scheduler: address of an existing Dask cluster ("tcp://..."), whose workers see the same files.
        chunk: cells a side of the part that a worker makes at once, a multiple of 128. It affects memory and time only.
        progress: called with (cells done, all cells).

    Returns:
        Dataset over (heading, y, x), SI and rad, in memory or lazy; see docs/maps.md for its layers.

    Raises:
        RockerbogieError: a wrong argument; a store of another map; a full disk (the same call then continues); zarr or dask
            missing.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    if mode not in ("contact", "equilibrium"):
        raise RockerbogieError(f"mode {mode!r} is not known; give 'contact' or 'equilibrium'")
    angles, allowed, field = heading_angles(headings), limits_given(limits), check_gravity(gravity)
    names = chosen_layers(layers, allowed.forces)
    if not (isinstance(chunk, (int, np.integer)) and chunk > 0 and chunk % TILE == 0):
        raise RockerbogieError(f"chunk is {chunk!r}: give a multiple of {TILE} cells")
    if workers is not None and not (isinstance(workers, int | np.integer) and not isinstance(workers, bool) and workers >= 1):
        raise RockerbogieError(f"workers is {workers!r}: give the number of processes, 1 or more")
    ground = _ground(terrain, band, interpolation, cell)
    cells = cells_over(ground.whole, resolution, bounds)
    job = Job(rover, cells, angles, allowed, mode, names, field)
    windows = TerrainWindows(ground, cells, reach(rover))
    size = sum(math.prod(job.shape(name, cells.all)) * np.dtype(kind_of(name, allowed)).itemsize for name in names)
    if store is None and size > IN_MEMORY:
        raise RockerbogieError(
            f"the map would be {size / 1e9:.3g} GB: give store='a folder' for it, or fewer layers or headings, "
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
    return dataset(data, angles, cells.x((0, cells.size[0])), cells.y((0, cells.size[1])), map_attributes(job, ground))


def _in_store(
    job: Job, windows: TerrainWindows, place: Path, chunk: int, tell: Callable[[int], None], workers: int | None,
    scheduler: str | None, *, dispersed: bool, lazily: bool,
) -> dict[str, Any]:  # fmt: skip
    """Make the missing tiles of a store, and return its layers."""
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
            "finished tiles are kept, and the same call continues from there"
        ) from None


def _compile(job: Job, windows: TerrainWindows, tile: Tile) -> None:
    """Settle once in this thread: kernels compile once, and an interrupt can stop it."""
    corner = Tile((tile.rows[0], tile.rows[0] + 1), (tile.cols[0], tile.cols[0] + 1))
    with compile_first():
        replace(job, headings=job.headings[:1]).settle(windows.terrain([corner]), corner, lambda name, region, values: None)


class _Count:
    """Sum of the cells done, passed to the progress callback."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self.done, self.total, self.progress = 0, total, progress

    def __call__(self, cells: int) -> None:
        self.done += cells
        if self.progress is not None:
            self.progress(self.done, self.total)


def _ground(terrain: Terrain | str | Path, band: int, interpolation: Interpolation, cell: float | None) -> Ground:
    """Return the terrain of a map from the argument; raise if it is of another type."""
    if isinstance(terrain, Terrain):
        return hold_ground(terrain)
    if not isinstance(terrain, (str, Path)):
        raise RockerbogieError(f"terrain is {terrain!r:.60}: give a Terrain, or the path of a raster")
    if interpolation not in ("cubic", "linear"):
        raise RockerbogieError(f"interpolation {interpolation!r} is not known; give 'cubic' or 'linear'")
    return open_ground(locate(terrain), band, interpolation, cell)


def heading_angles(headings: int | ArrayLike) -> NDArray[np.float64]:
    """Return the headings of an argument.

    Args:
        headings: their number, evenly spaced from +x counter-clockwise; or the angles, (n,) rad.

    Returns:
        (n,) rad.

    Raises:
        RockerbogieError: neither.
    """
    try:
        given = floats(headings)
        if given.ndim == 0 and given == int(given) and given >= 1:
            return 2 * np.pi * np.arange(int(given)) / int(given)
        angles = np.array(given)
    except (TypeError, ValueError, OverflowError):
        angles = np.array(np.nan)
    if angles.ndim != 1 or not angles.size or not np.isfinite(angles).all():
        raise RockerbogieError(f"headings is {headings!r:.60}: give their number, 1 or more, or a list of angles in rad")
    return angles


def limits_given(limits: Limits | str | None) -> Limits:
    """Return the limits of an argument.

    Args:
        limits: a `Limits`, or the name of one; None: Curiosity's flight limits.

    Returns:
        The limits.

    Raises:
        RockerbogieError: neither.
    """
    if isinstance(limits, Limits):
        return limits
    if limits is not None and not isinstance(limits, str):
        raise RockerbogieError(f"limits is {limits!r:.60}: give a rockerbogie.Limits, the name of one, or None for Curiosity's")
    return Limits.named(limits or "curiosity")


def map_attributes(job: Job, ground: Ground) -> dict[str, Any]:
    """Return the attributes of a map.

    Args:
        job: the work for its cells.
        ground: its terrain.

    Returns:
        Attributes of its Dataset.
    """
    dx, dy = job.cells.step
    about = {
        "title": f"Traversability for {job.rover.name}",
        "Conventions": "CF-1.11",
        "rover": job.rover.name,
        "terrain": ground.whole.name,
        "interpolation": ground.whole.interpolation,
        "mode": job.mode,
        "limits": job.limits.to_json(),
        "gravity": job.gravity,
        "resolution": dx if dx == dy else [dx, dy],
        "rockerbogie_version": __version__,
    }
    return about | ({"crs": ground.whole.crs} if ground.whole.crs else {})
