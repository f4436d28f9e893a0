"""Vector files that GDAL reads and writes: GeoPackage, GeoJSON, Shapefile and others."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, require

#: Endings of files that are read as vectors.
ENDINGS = (".gpkg", ".geojson", ".json", ".shp", ".fgb", ".kml", ".gml", ".gpx", ".dxf", ".sqlite", ".geojsonl")


@dataclass(frozen=True, eq=False)
class Features:
    """One layer of a vector file."""

    name: str  # of file and layer, for messages
    geometry: NDArray[Any]  # (n,) shapely geometries, none of them empty
    fields: dict[str, NDArray[Any]]  # (n,) each
    crs: str | None


def is_vector(file: str | Path) -> bool:
    """Return True if a file's ending is one of a vector format.

    Args:
        file: its name.

    Returns:
        True for .gpkg, .geojson, .shp and the like.
    """
    return Path(file).suffix.lower() in ENDINGS


def layers_of(file: str | Path) -> list[str]:
    """Return the names of the layers of a vector file.

    Args:
        file: any vector file that GDAL reads.

    Returns:
        The names.

    Raises:
        RockerbogieError: as `read_features`.
    """
    pyogrio, _ = _libraries()
    _check_there(file)
    try:
        return [str(name) for name, _ in pyogrio.list_layers(file)]
    except pyogrio.errors.DataSourceError as error:
        raise RockerbogieError(f"{str(file)!r} is not a vector file that GDAL can read: {_short(error)}") from None


def read_features(file: str | Path, layer: str | None = None) -> Features:
    """Read the features of one layer.

    Args:
        file: any vector file that GDAL reads.
        layer: its name; None for the first one.

    Returns:
        Features without those that have no geometry.

    Raises:
        RockerbogieError: pyogrio not installed, no such file or layer, not a vector file, GeoJSON whose coordinates cannot be
            longitude and latitude although it names no other CRS.
    """
    pyogrio, shapely = _libraries()
    _check_there(file)
    name = Path(file).name
    if layer is not None and layer not in (known := layers_of(file)):
        raise RockerbogieError(f"{name} has no layer {layer!r}; it has {', '.join(known)}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # several layers and no name: the first one is read
            meta, _, geometry, columns = pyogrio.raw.read(file, layer=layer, force_2d=True)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, ValueError) as error:
        raise RockerbogieError(f"{str(file)!r} is not a vector file that GDAL can read: {_short(error)}") from None
    if geometry is None:
        raise RockerbogieError(f"{name} has no geometry")
    shapes = shapely.from_wkb(geometry)
    there = np.array([shape is not None and not shape.is_empty for shape in shapes], dtype=bool)
    fields = {str(key): values[there] for key, values in zip(meta["fields"], columns, strict=True)}
    crs = meta["crs"]
    _check_geojson(name, shapes[there], crs)
    return Features(name, shapes[there], fields, crs)


def write_features(
    file: str | Path, layers: Mapping[str, tuple[Sequence[Any], Mapping[str, Any]]], crs: str | None, description: str
) -> None:
    """Write a GeoPackage.

    Args:
        file: ends in .gpkg; a file that is there is replaced.
        layers: name → (n,) shapely geometries and (n,) columns.
        crs: of the coordinates, as GDAL reads it; None for none.
        description: of every layer.

    Raises:
        RockerbogieError: pyogrio not installed, an unknown CRS, a file that cannot be written.
    """
    pyogrio, shapely = _libraries()
    path = Path(file)
    try:
        path.unlink(missing_ok=True)
        for name, (geometry, columns) in layers.items():
            arrays = [np.asarray(values) for values in columns.values()]
            arrays = [values.astype(object) if values.dtype.kind in "US" else values for values in arrays]
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", message=".*crs.*")  # local coordinates have none
                pyogrio.raw.write(
                    path, shapely.to_wkb(np.asarray(geometry, dtype=object)), arrays, list(columns), layer=name, driver="GPKG",
                    geometry_type=geometry[0].geom_type, crs=crs, append=path.exists(),
                    layer_options={"DESCRIPTION": description},
                )  # fmt: skip
    except (OSError, pyogrio.errors.DataSourceError, pyogrio.errors.CRSError) as error:
        raise RockerbogieError(f"cannot write {str(file)!r}: {_short(error)}") from None


def require_vectors() -> None:
    """Raise if the libraries for vector files are not installed."""
    require("a vector file", "geo", "pyogrio", "shapely")


def _libraries() -> tuple[Any, Any]:
    """Return the modules pyogrio and shapely; raise if one is not installed."""
    require_vectors()
    import pyogrio
    import pyogrio.raw
    import shapely

    return pyogrio, shapely


def _check_there(file: str | Path) -> None:
    """Raise if a file does not exist. Names of GDAL's virtual file systems are not checked."""
    if not Path(file).exists() and not str(file).startswith("/vsi"):
        raise RockerbogieError(f"no file {str(file)!r}")


def _check_geojson(name: str, shapes: NDArray[Any], crs: str | None) -> None:
    """Raise if coordinates that are declared as WGS84 cannot be longitude and latitude."""
    if crs != "EPSG:4326" or not len(shapes):
        return
    reach = max(max(abs(v) for v in shape.bounds[::2]) / 180 for shape in shapes)
    reach = max(reach, *(max(abs(v) for v in shape.bounds[1::2]) / 90 for shape in shapes))
    if reach > 2:
        raise RockerbogieError(
            f"{name} is longitude and latitude on WGS84, by its CRS or because it names none, but its coordinates are not: "
            "save it as GeoPackage (.gpkg) with the CRS of the map"
        )


def _short(error: Exception) -> str:
    """Return an error's message on one line."""
    return " ".join(str(error).split())
