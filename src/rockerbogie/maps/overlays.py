"""Keep-out areas and costs given by the user, on the cells of a map."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, require
from ..files.vectors import Features, is_vector, read_features
from .grid import cell_size, crs_of, transform

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
#: A layer: a vector or raster file, or values on the map's own cells.
Layer = "str | Path | xr.DataArray | NDArray[Any]"
#: Column of a vector file that holds its costs.
COST = "cost"


def keep_out_cells(maps: xr.Dataset, layer: Any, margin: float) -> NDArray[np.bool_]:
    """Return the cells that a keep-out layer forbids.

    Args:
        maps: the map.
        layer: a vector file, all of whose features are forbidden; a raster file or an array (y, x), forbidden where it is
            neither 0 nor missing.
        margin: distance to keep from it, m.

    Returns:
        (y, x), True where a feature is in contact with the cell, or comes closer to its centre than the margin.

    Raises:
        RockerbogieError: a layer that cannot be read or placed on the map, a margin below 0.
    """
    from scipy.ndimage import distance_transform_edt

    if not (math.isfinite(margin) and margin >= 0):
        raise RockerbogieError(f"the keep-out margin is {margin!r}; give a distance of at least 0 m")
    if isinstance(layer, str | Path) and is_vector(layer):
        features = read_features(layer)
        forbidden = _burn(maps, features, np.ones(len(features.geometry))) > 0
    else:
        values = _values(maps, layer, "keep-out", greatest=True)
        forbidden = np.isfinite(values) & (values != 0)
    if margin > 0 and forbidden.any():
        dx, dy = cell_size(maps)
        reach = margin + 0.5 * math.hypot(dx, dy)  # from the centre of a forbidden cell, which is forbidden as a whole
        forbidden |= np.asarray(distance_transform_edt(~forbidden, sampling=(dy, dx))) <= reach
    return forbidden


def cost_cells(maps: xr.Dataset, layer: Any) -> Array:
    """Return the extra cost of each cell, per metre.

    Args:
        maps: the map.
        layer: a vector file with a column `cost`; a raster file or an array (y, x) of costs. Missing values cost nothing more.

    Returns:
        (y, x); of overlapping features the greatest counts.

    Raises:
        RockerbogieError: a layer that cannot be read or placed on the map, a cost below 0.
    """
    if isinstance(layer, str | Path) and is_vector(layer):
        features = read_features(layer)
        if COST not in features.fields:
            raise RockerbogieError(
                f"{features.name} has no column {COST!r}, the extra cost per metre; it has {', '.join(features.fields) or 'none'}"
            )
        try:
            costs = np.nan_to_num(features.fields[COST].astype(float))
        except (TypeError, ValueError):
            raise RockerbogieError(f"{features.name}: column {COST!r} holds values that are not numbers") from None
        values = _burn(maps, features, costs)
    else:
        values = np.nan_to_num(_values(maps, layer, "cost", greatest=False), nan=0.0, posinf=np.inf)
    if not np.isfinite(values).all() or (values < 0).any():
        raise RockerbogieError("the cost layer holds infinite costs or costs below 0: give 0 or more (keep_out= forbids cells)")
    return values


def _burn(maps: xr.Dataset, features: Features, values: Array) -> Array:
    """Return the greatest value of the features on each cell (y, x); 0 without any."""
    features = _placed(maps, features)
    if not len(values):
        return np.zeros((maps.sizes["y"], maps.sizes["x"]))
    from rasterio.features import rasterize

    order = np.argsort(values, kind="stable")  # later ones are drawn over earlier ones
    shapes = [(features.geometry[k], float(values[k])) for k in order]
    out = np.zeros((maps.sizes["y"], maps.sizes["x"]))
    rasterize(shapes, out=out, transform=transform(maps), all_touched=True)
    if not out.any() and values.any():
        warnings.warn(f"{features.name} has no feature on the map", stacklevel=4)
    return out[::-1]


def _placed(maps: xr.Dataset, features: Features) -> Features:
    """Return features in the map's CRS.

    Raises:
        RockerbogieError: the map has no CRS and the features have one, or one cannot be transformed into the other.
    """
    theirs, ours = features.crs, crs_of(maps)
    if theirs is None or not len(features.geometry):
        return features
    if ours is None:
        raise RockerbogieError(
            f"{features.name} is in {theirs:.40}, and the map has no CRS: give the layer in the map's own metres, without a CRS"
        )
    import shapely
    from rasterio.crs import CRS
    from rasterio.errors import RasterioError
    from rasterio.warp import transform as move

    try:
        source, target = CRS.from_user_input(theirs), CRS.from_user_input(ours)
        if source == target:
            return features

        def moved(points: Array) -> Array:
            x, y = move(source, target, points[:, 0], points[:, 1])
            return np.stack([x, y], axis=1)

        shapes = shapely.transform(features.geometry, moved)
        if not np.isfinite(shapely.bounds(shapes)).all():
            raise RockerbogieError(
                f"{features.name} has points that the map's CRS does not reach: cut it to the map's surroundings"
            )
    except (RasterioError, ValueError, OSError) as error:
        if isinstance(error, RockerbogieError):
            raise
        raise RockerbogieError(f"{features.name} cannot be transformed into the map's CRS: {error}") from None
    return Features(features.name, np.asarray(shapes), features.fields, ours)


def _values(maps: xr.Dataset, layer: Any, what: str, *, greatest: bool) -> Array:
    """Return values (y, x) of an array, or of a raster file warped to the map; NaN: none."""
    shape = (maps.sizes["y"], maps.sizes["x"])
    if not isinstance(layer, str | Path):
        try:
            if hasattr(layer, "dims"):
                layer = layer.transpose("y", "x").reindex_like(maps[["x", "y"]], method="nearest", tolerance=1e-6)
            values = np.asarray(getattr(layer, "values", layer), dtype=float)
        except (TypeError, ValueError) as error:
            raise RockerbogieError(f"the {what} layer is not an array of numbers over y and x: {error}") from None
        if values.shape != shape:
            raise RockerbogieError(f"the {what} layer has shape {values.shape}; the map has {shape} cells (y, x)")
        return values
    require(f"a {what} layer from a file", "geo", "rasterio")
    import rasterio
    from rasterio.crs import CRS
    from rasterio.warp import Resampling, reproject

    ours = crs_of(maps)
    try:
        with warnings.catch_warnings(), rasterio.open(layer) as raster:
            warnings.simplefilter("ignore")
            data = raster.read(1, masked=True).astype(float).filled(np.nan)
            if raster.crs is not None and ours is None:
                raise RockerbogieError(f"{str(layer)!r} has a CRS and the map has none: give it in the map's own metres")
            source = raster.crs or CRS.from_user_input(ours or 'LOCAL_CS["local",UNIT["metre",1]]')
            target = CRS.from_user_input(ours) if ours else source
            out = np.full(shape, np.nan)
            reproject(
                data, out, src_transform=raster.transform, src_crs=source, dst_transform=transform(maps), dst_crs=target,
                src_nodata=np.nan, dst_nodata=np.nan, resampling=Resampling.max if greatest else Resampling.average,
            )  # fmt: skip
    except rasterio.errors.RasterioError as error:
        raise RockerbogieError(
            f"the {what} layer {str(layer)!r} is neither a vector nor a raster that GDAL can read: {error}"
        ) from None
    if not np.isfinite(out).any():
        warnings.warn(f"{Path(layer).name} has no value on the map", stacklevel=3)
    return out[::-1]
