"""Checks of a raster file's grid and bands, and the unit of its heights."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

from ..errors import TerrainError
from .georeference import Georeference, unit_length

#: Colour interpretations of bands that are pictures.
COLOURS = frozenset({"red", "green", "blue", "alpha", "palette", "hue", "saturation", "lightness", "cyan", "magenta", "yellow"})


def is_placed(T: list[float]) -> bool:
    """Return True if an affine transform was set.

    Some drivers leave uninitialised, denormal numbers.

    Args:
        T: (6,) coefficients a, b, c, d, e, f.

    Returns:
        True if it is finite, invertible, and not the identity.
    """
    noise = any(v != 0 and abs(v) < sys.float_info.min for v in T)
    return not noise and all(map(math.isfinite, T)) and T != [1, 0, 0, 0, 1, 0] and T[0] * T[4] - T[1] * T[3] != 0


def with_cell(cell: float, T: list[float], shape: tuple[int, int], frame: Georeference, name: str) -> list[float]:
    """Return the transform for cells of a given side, with the south-west corner at (0, 0).

    Args:
        cell: side of a cell, m.
        T: (6,) the file's own transform.
        shape: rows, cols.
        frame: the file's georeference.
        name: of the file, for errors.

    Returns:
        (6,) coefficients a, b, c, d, e, f.

    Raises:
        TerrainError: a side that is not a positive number, or a file with a georeference of its own.
    """
    try:
        side = float(cell)
    except (TypeError, ValueError):
        side = math.nan
    if not (math.isfinite(side) and side > 0):
        raise TerrainError(f"cell is {cell!r}: give the side of a cell, a finite number of metres above 0")
    if frame.crs is not None and is_placed(T):
        raise TerrainError(f"{name} has a CRS and cells of {math.hypot(T[0], T[3]):.6g} by its own georeference: leave cell out")
    return [side, 0.0, 0.0, 0.0, -side, side * shape[0]]


def check_band(file: Any, name: str, band: int) -> None:
    """Check that a band holds numbers that can be heights.

    Args:
        file: an open rasterio file.
        name: of the file, for errors.
        band: number of the band, from 1.

    Raises:
        TerrainError: no such band, a file of several rasters, numbers of another type, or a picture.
    """
    if file.count == 0 and file.subdatasets:
        listed = ", ".join(repr(s) for s in file.subdatasets[:6]) + (", …" if len(file.subdatasets) > 6 else "")
        raise TerrainError(f"{name} holds several rasters: give one of them as the file, {listed}")
    if not isinstance(band, int | np.integer) or not 1 <= band <= file.count:
        raise TerrainError(f"{name} has {file.count} band(s), counted from 1; band {band!r} is not one of them")
    if np.dtype(file.dtypes[band - 1]).kind not in "iuf":
        raise TerrainError(f"band {band} of {name} holds {file.dtypes[band - 1]}, not heights: choose another band")
    if file.tags(band, ns="IMAGE_STRUCTURE").get("NBITS") == "1":
        raise TerrainError(f"band {band} of {name} holds single bits, a mask and not heights: choose another band")
    colour = file.colorinterp[band - 1].name.lower()
    if colour in COLOURS:
        raise TerrainError(
            f"band {band} of {name} is the {colour} of a picture, not heights: give the terrain model itself, or another band"
        )


def height_unit(file: Any, name: str, band: int, frame: Georeference) -> float:
    """Return the length of the unit of a band's heights.

    The unit is that of the band, of the PDS label, or of the CRS, in this order.

    Args:
        file: an open rasterio file.
        name: of the file, for errors.
        band: number of the band, from 1.
        frame: the file's georeference.

    Returns:
        m.

    Raises:
        TerrainError: a unit that is not a known length.
    """
    unit = file.units[band - 1] or ""
    if not unit and "json:PDS" in file.tag_namespaces():
        unit = _label_unit(file)
    length = unit_length(unit)
    if length is None and frame.height_unit is not None:
        return frame.height_unit
    if length is None:
        raise TerrainError(
            f"band {band} of {name} holds values in {unit!r}, which is not a known length: choose another band, or state the "
            f"unit with rio edit-info --bidx {band} --units metre {name}"
        )
    return frame.height_unit if not unit.strip() and frame.height_unit is not None else length


def _label_unit(file: Any) -> str:
    """Return UNIT of the IMAGE object in a PDS3 label; "" if there is none."""
    import json

    key, value = next(iter(file.tags(ns="json:PDS").items()), ("", ""))
    for mark in ":=":  # rasterio splits the text at the first of these, as if it were a name and a value
        try:
            return str(json.loads(key + mark + value)["IMAGE"]["UNIT"]).strip("\"' ")
        except (ValueError, KeyError, TypeError):
            continue
    return ""
