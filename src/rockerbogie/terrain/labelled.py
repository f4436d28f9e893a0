"""Heights and grid from a labelled array (xarray.DataArray), by its own coordinates."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import floats
from ..errors import TerrainError
from .georeference import unit_length

Array = NDArray[np.float64]

X_NAMES = frozenset({"x", "lon", "longitude", "easting", "east", "col", "cols", "column", "projection_x_coordinate"})
Y_NAMES = frozenset({"y", "lat", "latitude", "northing", "north", "row", "rows", "line", "projection_y_coordinate"})
ANGLES = frozenset({"degrees_east", "degrees_north", "degree", "degrees", "deg", "rad", "radian", "radians"})
UNEVEN = 1e-3  # cells: a coordinate further than this from an even grid is refused


class Labelled(NamedTuple):
    """A labelled array as a grid: y grows with the row and x with the column."""

    z: Any  # (rows, cols) m
    spacing: tuple[float, float] | None  # dx, dy, m; None: it has no coordinates
    origin: tuple[float, float] | None  # x, y of z[0, 0], m
    crs: str | None


def is_labelled(z: Any) -> bool:
    """Return True for an xarray DataArray, without importing xarray.

    Args:
        z: any object.

    Returns:
        True if it has the attributes of a DataArray that `read_labelled` uses.
    """
    return all(hasattr(z, name) for name in ("dims", "coords", "attrs", "transpose", "values"))


def read_labelled(z: Any) -> Labelled:
    """Return heights and grid of a DataArray with dimensions y and x in any order.

    Args:
        z: (y, x) or (x, y), and axes of length 1. Its attributes `units` and `_FillValue` are applied.

    Returns:
        The grid, with y growing with the row, in metres; its spacing, origin and CRS are None if the DataArray has no
        coordinates.

    Raises:
        TerrainError: other dimensions; coordinates that are not evenly spaced, or in degrees; units that are not lengths.
    """
    z = z.squeeze()
    if z.ndim != 2:
        raise TerrainError(f"the DataArray has dimensions {tuple(map(str, z.dims))}; select one band, so that y and x are left")
    rows, cols = z.dims
    if str(rows).lower() in X_NAMES or str(cols).lower() in Y_NAMES:
        z = z.transpose()
        rows, cols = cols, rows
    known = str(rows).lower() in Y_NAMES and str(cols).lower() in X_NAMES
    values = np.ma.masked_array(z.values)
    if (fill := z.attrs.get("_FillValue")) is not None:
        values = np.ma.masked_where(np.asarray(values.data) == fill, values)
    height = unit_length(str(z.attrs.get("units", "")))
    if height is None:
        raise TerrainError(
            f"the DataArray holds values in {z.attrs['units']!r}, which is not a known length: convert it to metres"
        )
    try:
        heights = floats(values) * height
    except (TypeError, ValueError, OverflowError) as error:
        raise TerrainError(f"the DataArray does not hold heights: {error}") from None
    axes = [z.coords[name] if name in z.coords else None for name in (cols, rows)]  # noqa: SIM401  (get() makes up indices)
    if axes[0] is None and axes[1] is None:
        return Labelled(heights, None, None, None)
    if axes[0] is None or axes[1] is None or not known:
        raise TerrainError(
            f"the DataArray's dimensions {rows!r} and {cols!r} do not show which is x and which is y, or one has no coordinates: "
            "rename them to 'y' and 'x' with coordinates in metres, or pass its .values"
        )
    spacing, origin = [], []
    for k, (axis, number) in enumerate(zip((1, 0), axes, strict=True)):
        step, first, backward = _spacing(number)
        spacing.append(step)
        origin.append(first)
        if backward:
            heights = np.flip(heights, axis)
        if heights.shape[1 - k] < 2:
            raise TerrainError("the DataArray has fewer than 2 nodes along a side")
    return Labelled(heights, (spacing[0], spacing[1]), (origin[0], origin[1]), _crs(z))


def _spacing(coordinate: Any) -> tuple[float, float, bool]:
    """Return step and lowest value of a coordinate, m, and True if it falls along its axis.

    The step is above 0. Raises a TerrainError for degrees, an unknown unit or uneven spacing.
    """
    name, unit = str(coordinate.name), str(coordinate.attrs.get("units", ""))
    length = unit_length(unit)
    if unit.lower() in ANGLES or name.lower() in ("lon", "lat", "longitude", "latitude"):
        raise TerrainError(f"coordinate {name!r} of the DataArray counts in degrees: reproject it to metres first")
    if length is None:
        raise TerrainError(f"coordinate {name!r} of the DataArray has unit {unit!r}, which is not a known length")
    try:
        at = floats(coordinate.values) * length
        step = float(at[-1] - at[0]) / (len(at) - 1)
        uneven = float(np.abs(at - (at[0] + step * np.arange(len(at)))).max())
    except (TypeError, ValueError, IndexError, ZeroDivisionError):
        step = uneven = np.nan
    if not (step != 0 and uneven <= UNEVEN * abs(step)):
        raise TerrainError(f"coordinate {name!r} of the DataArray is not evenly spaced: interpolate it onto an even grid first")
    return abs(step), float(min(at[0], at[-1])), step < 0


def _crs(z: Any) -> str | None:
    """Return the CRS that rioxarray and CF keep beside a DataArray, if it counts in metres."""
    for name, coordinate in z.coords.items():
        text = coordinate.attrs.get("crs_wkt") or coordinate.attrs.get("spatial_ref")
        if text and name not in z.dims:
            return _metric(str(text))
    return None


def _metric(text: str) -> str | None:
    """Return a CRS as rasterio writes it; refuse one that does not count in metres."""
    try:
        from rasterio.crs import CRS
        from rasterio.errors import RasterioError
    except ImportError:
        return text
    from .georeference import georeference, refuse_angles

    try:
        crs = CRS.from_user_input(text)
    except RasterioError:
        raise TerrainError(f"the DataArray's CRS cannot be read: {text[:60]!r}") from None
    frame = georeference(crs, "the DataArray")
    refuse_angles(frame, "the DataArray", 0.0, 0.0, (1.0, 1.0))
    if frame.unit != 1.0:
        raise TerrainError(f"the DataArray's CRS counts in {frame.unit_name}: reproject it to metres first")
    return frame.crs
