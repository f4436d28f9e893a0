"""Reduced maps for pictures, and counts of a map's cells."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..terrain.heightfield import Terrain
from ..terrain.raster import open_raster
from .geotiff import FIRST
from .grid import pieces

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

MOST = 1200  # cells along the longer side


class Tally(NamedTuple):
    """Counts of a map's cells."""

    cells: int
    known: int  # cells with terrain data at some heading
    every: int  # known cells that are passable at every heading
    some: int  # known cells that are passable at some headings, not all
    exceeded: dict[str, int]  # limit → number of known cells that exceed it at some heading


def tally(maps: xr.Dataset) -> Tally:
    """Count the cells of a map, piece by piece.

    Args:
        maps: with the layers `passable` and `worst_exceeded`.

    Returns:
        The counts.
    """
    flags = maps["worst_exceeded"].attrs
    bits = dict(zip(str(flags["flag_meanings"]).split(), np.ravel(flags["flag_masks"]).tolist(), strict=True))
    known = every = some = 0
    beyond = dict.fromkeys(bits, 0)
    for rows, cols in pieces(maps):
        piece = maps[["passable", "worst_exceeded"]].isel(y=rows, x=cols).load()
        share, mask = piece["passable"].values, piece["worst_exceeded"].values
        there = np.isfinite(share)
        known += int(there.sum())
        every += int((share == 1).sum())
        some += int(((share > 0) & (share < 1)).sum())
        for name, bit in bits.items():
            beyond[name] += int((there & ((mask & bit) > 0)).sum())
    return Tally(maps.sizes["y"] * maps.sizes["x"], known, every, some, beyond)


def overview(
    maps: xr.Dataset, ground: Terrain | str | Path | None = None, most: int = MOST, *, band: int = 1, cell: float | None = None
) -> xr.Dataset:
    """Return every k-th cell of a map's summaries, in memory.

    Args:
        maps: the map.
        ground: terrain, or its raster file (read in strips), for heights at the cells; None: no heights.
        most: greatest number of cells along a side of the result.
        band: of the raster file.
        cell: of the raster file, as `Terrain.from_raster`.

    Returns:
        The reduced map, with the heights as `ground`, m.

    Raises:
        RockerbogieError: a map without `passable`, which gives the colours.
    """
    if FIRST not in maps:
        raise RockerbogieError(f"the map has no layer {FIRST!r}, which gives the colours of a picture: leave the picture out")
    k = -(-max(maps.sizes["y"], maps.sizes["x"]) // most)
    flat = maps.drop_vars([name for name, v in maps.data_vars.items() if set(v.dims) != {"y", "x"}])
    small = flat.isel(y=slice(k // 2, None, k), x=slice(k // 2, None, k)).load()
    if ground is not None:
        x, y = small["x"].values, small["y"].values
        heights = ground.height(*np.meshgrid(x, y)) if isinstance(ground, Terrain) else _nearest(ground, band, cell, x, y)
        small["ground"] = (("y", "x"), heights, {"units": "m"})
    return small


def _nearest(file: str | Path, band: int, cell: float | None, x: Array, y: Array) -> Array:
    """Return the heights (y, x) of the raster nodes nearest to a grid's points; NaN beyond it."""
    raster = open_raster(file, band, cell).screened(quiet=True)
    rows, cols = (
        np.rint((at - first) / step).astype(int)
        for at, first, step in zip((y, x), raster.origin[::-1], raster.spacing[::-1], strict=True)
    )
    out = np.full((len(y), len(x)), np.nan)
    good: NDArray[Any] = (cols >= 0) & (cols < raster.shape[1])
    if not good.any():
        return out
    first, last = int(cols[good].min()), int(cols[good].max()) + 1
    for n, row in enumerate(rows):
        if 0 <= row < raster.shape[0]:
            out[n, good] = raster.read((int(row), int(row) + 1), (first, last))[0, cols[good] - first]
    return out
