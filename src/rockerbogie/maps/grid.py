"""Grid of a map: cell size, CRS, transform, order of layers, and pieces for memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import RockerbogieError
from .layers import LAYERS

if TYPE_CHECKING:
    import xarray as xr

#: Rows and columns of the pieces in which a map is read and written, cells.
PIECE = (1024, 2048)


def ordered(maps: xr.Dataset) -> xr.Dataset:
    """Return a map with its layers in the order of `LAYERS`.

    Args:
        maps: the map; other variables come last, by name.

    Returns:
        The same data.
    """
    place = {name: k for k, name in enumerate(LAYERS)}
    names = sorted(maps.data_vars, key=lambda name: (place.get(str(name), len(place)), str(name)))
    return maps.drop_vars(names).assign({name: maps[name] for name in names})


def pieces(maps: xr.Dataset) -> Iterator[tuple[slice, slice]]:
    """Cut a map into pieces that fit in memory, from the north.

    Args:
        maps: the map.

    Yields:
        Slices of rows and columns.
    """
    rows, cols = maps.sizes["y"], maps.sizes["x"]
    for row in range(rows, 0, -PIECE[0]):
        for col in range(0, cols, PIECE[1]):
            yield slice(max(row - PIECE[0], 0), row), slice(col, min(col + PIECE[1], cols))


def cell_size(maps: xr.Dataset) -> tuple[float, float]:
    """Return the sides of a map's cells, from its coordinates.

    The attribute `resolution` is used where it agrees with them, or where there is one cell; a resampled map may differ.

    Args:
        maps: the map.

    Returns:
        dx and dy, m.

    Raises:
        RockerbogieError: coordinates that are not evenly spaced or do not grow, or one cell without `resolution`.
    """
    given = maps.attrs.get("resolution")
    stated = None if given is None else np.broadcast_to(np.asarray(given, dtype=float), (2,))
    sides = []
    for k, axis in enumerate(("x", "y")):
        at = np.asarray(maps[axis].values, dtype=float)
        if len(at) > 1:
            side = (at[-1] - at[0]) / (len(at) - 1)
            rounding = 4 * float(np.spacing(np.abs(at).max()))
            if not side > 0 or np.abs(np.diff(at) - side).max() > 1e-3 * side + rounding:
                raise RockerbogieError(
                    f"the map's {axis} is not evenly spaced and growing: sort it (sortby({axis!r})) or resample it to even steps"
                )
            kept = stated is not None and abs(side - stated[k]) <= 1e-6 * side + rounding
            sides.append(float(stated[k]) if kept and stated is not None else float(side))
        elif stated is not None:
            sides.append(float(stated[k]))
        else:
            raise RockerbogieError(
                f"the map has one cell along {axis} and no attribute 'resolution': set that to the side of a cell, m"
            )
    return sides[0], sides[1]


def crs_of(maps: xr.Dataset) -> str | None:
    """Return the CRS of a map.

    Args:
        maps: the map.

    Returns:
        The attribute `crs`, or else that of the grid mapping, which resampling keeps; None if there is none.
    """
    if maps.attrs.get("crs"):
        return str(maps.attrs["crs"])
    mapping = maps.coords["spatial_ref"].attrs if "spatial_ref" in maps.coords else {}
    return mapping.get("crs_wkt") or mapping.get("spatial_ref") or None


def transform(maps: xr.Dataset) -> Any:
    """Return the affine transform of a map's raster, north up.

    Args:
        maps: the map.

    Returns:
        rasterio's Affine from pixels to m; the centre of a cell is the centre of its pixel.
    """
    from rasterio import Affine

    dx, dy = cell_size(maps)
    return Affine(dx, 0.0, float(maps["x"][0]) - dx / 2, 0.0, -dy, float(maps["y"][-1]) + dy / 2)
