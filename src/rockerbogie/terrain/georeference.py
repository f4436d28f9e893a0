"""Units, axes and scale of a raster's coordinate reference system (CRS), from its PROJ JSON."""

from __future__ import annotations

import json
import math
import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import TerrainError

Array = NDArray[np.float64]

MAX_SCALE_ERROR = 0.01  # a projection that stretches more than this is refused
SCALE_NOTE = 0.002  # a projection that stretches more than this causes a warning
FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937  # m
STEP = 100.0  # m: over which the scale of a projection is measured

#: Unit names (lower case, plural removed) and their length, m.
LENGTHS = {
    "": 1.0,
    "m": 1.0,
    "metre": 1.0,
    "meter": 1.0,
    "unknown": 1.0,
    "unitless": 1.0,
    "unspecified": 1.0,
    "none": 1.0,
    "km": 1e3,
    "kilometre": 1e3,
    "kilometer": 1e3,
    "dm": 0.1,
    "decimetre": 0.1,
    "decimeter": 0.1,
    "cm": 0.01,
    "centimetre": 0.01,
    "centimeter": 0.01,
    "mm": 1e-3,
    "millimetre": 1e-3,
    "millimeter": 1e-3,
    "ft": FOOT,
    "foot": FOOT,
    "feet": FOOT,
    "international foot": FOOT,
    "international feet": FOOT,
    "us survey foot": SURVEY_FOOT,
    "us survey feet": SURVEY_FOOT,
    "survey foot": SURVEY_FOOT,
    "survey feet": SURVEY_FOOT,
    "us foot": SURVEY_FOOT,
    "us feet": SURVEY_FOOT,
    "foot us": SURVEY_FOOT,
    "us ft": SURVEY_FOOT,
    "ft us": SURVEY_FOOT,
    "ftus": SURVEY_FOOT,
    "yd": 3 * FOOT,
    "yard": 3 * FOOT,
}


class Georeference(NamedTuple):
    """Metric form of a file's coordinate reference system."""

    crs: str | None  # of coordinates in metres; heights in metres
    unit: float  # m: length of the file's unit of x and y
    unit_name: str
    height_unit: float | None  # m: length of the CRS's unit of height; None: it has none
    horizontal: dict[str, Any] | None  # PROJ JSON of the horizontal CRS


def unit_length(name: str) -> float | None:
    """Return the length of a unit by its name.

    Args:
        name: as files spell it: "m", "[m]", "Metres (EGM96)", "KILOMETER", "US survey foot", …; "" counts as metres.

    Returns:
        m; None for a name that is not a known length.
    """
    plain = re.sub(r"\(.*?\)|\b(above|over|relative to|wrt)\b.*", "", name.lower())
    plain = " ".join(re.sub(r"[^a-z0-9]+", " ", plain).split())
    if not plain and name.strip():
        return None
    return LENGTHS.get(plain, LENGTHS.get(plain.removesuffix("s")))


def georeference(crs: Any, name: str) -> Georeference:
    """Read units and axes of a CRS.

    Args:
        crs: a rasterio CRS, or None.
        name: of the file, for errors.

    Returns:
        The metric form. A CRS in feet or kilometres gets the same projection in metres; a vertical CRS that does not
        count in metres is dropped, as heights are converted. A geographic CRS keeps its angles: see `refuse_angles`.

    Raises:
        TerrainError: a CRS without a horizontal part, with axes to the west or south, or with depths instead of heights.
    """
    from rasterio.crs import CRS
    from rasterio.errors import CRSError

    if not crs:
        return Georeference(None, 1.0, "metre", None, None)
    try:
        parts = _components(crs.to_dict(projjson=True))
        horizontal, vertical = parts[0], (parts[1] if len(parts) > 1 else None)
        axes = horizontal["coordinate_system"]["axis"]
        kind = horizontal["type"]
    except (CRSError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise TerrainError(f"the coordinate reference system of {name} cannot be read: {error}") from None
    if kind == "VerticalCRS" or len(axes) < 2 or any("geocentric" in str(axis.get("direction")) for axis in axes):
        raise TerrainError(f"{name} has no horizontal coordinate reference system ({kind}): assign one with gdal_edit.py -a_srs")
    height_unit = None
    for axis in [*axes[2:], *(vertical["coordinate_system"]["axis"] if vertical else [])]:
        height_unit = _unit(axis)[1]
        if axis.get("direction") == "down":
            raise TerrainError(f"{name} holds depths, counted downwards ({axis.get('name')}): convert them to heights first")
    directions = [str(axis.get("direction")) for axis in axes[:2]]
    if "Geographic" in kind or _unit(axes[0])[2]:
        return Georeference(crs.to_string(), 1.0, "degree", height_unit, horizontal)
    if not set(directions) <= {"east", "north", "unspecified"} and directions not in (["north"] * 2, ["south"] * 2):
        raise TerrainError(
            f"the axes of {name} point {directions[0]} and {directions[1]}, not east and north: reproject it first, with "
            + warp(name, horizontal, None)
        )
    unit_name, unit, _ = _unit(axes[0])
    if unit == 1.0 and height_unit in (None, 1.0):
        return Georeference(crs.to_string(), 1.0, unit_name, height_unit, horizontal)
    plain = {key: value for key, value in horizontal.items() if unit == 1.0 or key not in ("id", "ids")}
    if unit != 1.0:
        system = horizontal["coordinate_system"]
        plain["coordinate_system"] = system | {"axis": [axis | {"unit": "metre"} for axis in axes]}
        plain["name"] = f"{horizontal.get('name', 'unknown')} in metres"
    return Georeference(CRS.from_user_input(json.dumps(plain)).to_string(), unit, unit_name, height_unit, plain)


def refuse_angles(georeference: Georeference, name: str, x: float, y: float, cell: tuple[float, float]) -> None:
    """Raise an error for a CRS that counts in angles.

    Args:
        georeference: of the file.
        name: of the file.
        x: centre of the map, in the file's unit.
        y: the same.
        cell: sides of a cell, in the file's unit.

    Raises:
        TerrainError: it is geographic. The message gives a command with a local projection on the file's own body.
    """
    if georeference.unit_name == "degree":
        metres = math.radians(1) * ellipsoid(georeference.horizontal or {})[0]
        raise TerrainError(
            f"{name} counts in degrees ({_short(georeference)}): reproject it to metres first, with "
            + warp(name, georeference.horizontal, (x, y), (cell[0] * metres * math.cos(math.radians(y)), cell[1] * metres))
        )


def check_scale(
    georeference: Georeference, name: str, x: tuple[float, float], y: tuple[float, float], cell: tuple[float, float]
) -> str | None:
    """Compare lengths on the map with lengths on the body.

    Args:
        georeference: of the file.
        name: of the file, for errors.
        x: west and east edge of the part that is read, m.
        y: south and north edge, m.
        cell: sides of a cell, m.

    Returns:
        A sentence for a warning if lengths differ by more than `SCALE_NOTE`; None if not, or for a CRS without a body.

    Raises:
        TerrainError: they differ by more than `MAX_SCALE_ERROR`. The message gives a command that corrects the file.
    """
    if georeference.horizontal is None or "base_crs" not in georeference.horizontal:
        return None
    px, py = (v.ravel() for v in np.meshgrid(np.linspace(x[0], x[1], 5), np.linspace(y[0], y[1], 5)))
    factors, centre = scale_factors(georeference, px, py)
    low, high = float(np.nanmin(factors)), float(np.nanmax(factors))
    if not (np.isfinite(factors).all() and np.isfinite(centre).all()):
        raise TerrainError(f"{name} lies at ({np.mean(x):.10g}, {np.mean(y):.10g}), outside its projection: check its CRS")
    worst = max(abs(low - 1), abs(high - 1))
    if worst > MAX_SCALE_ERROR:
        raise TerrainError(
            f"a metre on the ground is {low:.4g} to {high:.4g} m in the projection of {name}, so slopes would be wrong: "
            f"reproject it first, with " + warp(name, georeference.horizontal, centre, (min(cell) / high, min(cell) / low))
        )
    if worst > SCALE_NOTE:
        wrong = math.degrees(worst * math.sin(math.radians(15)) * math.cos(math.radians(15)))
        return (
            f"a metre on the ground is {low:.4g} to {high:.4g} m in the projection of {name}: a slope of 15° is off by up to "
            f"{wrong:.2g}°"
        )
    return None


def scale_factors(georeference: Georeference, x: Array, y: Array) -> tuple[Array, tuple[float, float]]:
    """Compute the local scale of a projection by PROJ's inverse, over `STEP` metres.

    Args:
        georeference: a projected CRS in metres.
        x: (n,) m.
        y: (n,) m.

    Returns:
        Map metres per true metre (n, 2), the least and the greatest over all directions; NaN where PROJ has no inverse. And
        longitude and latitude of the mean point, degrees.
    """
    from rasterio.crs import CRS
    from rasterio.warp import transform

    assert georeference.horizontal is not None
    base = georeference.horizontal["base_crs"]
    major, minor = ellipsoid(base)
    degree = _unit(base["coordinate_system"]["axis"][0])[1]

    def positions(at_x: Array, at_y: Array) -> tuple[Array, Array]:
        """Return points (n, 3) on the ellipsoid, m, and (n, 2) longitude and latitude, rad."""
        try:
            lon, lat = (np.asarray(v) * degree for v in transform(georeference.crs, inverse, at_x, at_y)[:2])
        except Exception:  # rasterio lets GDAL's own errors through, which have no public base class
            lon = lat = np.full(len(at_x), np.nan)
        square = 1 - (minor / major) ** 2
        normal = major / np.sqrt(1 - square * np.sin(lat) ** 2)
        ring = normal * np.cos(lat)
        return np.stack([ring * np.cos(lon), ring * np.sin(lon), normal * (1 - square) * np.sin(lat)], axis=-1), np.stack(
            [lon, lat], axis=-1
        )

    inverse = CRS.from_user_input(json.dumps(base))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        along_x, along_y = (
            (positions(x + dx, y + dy)[0] - positions(x - dx, y - dy)[0]) / (2 * STEP) for dx, dy in ((STEP, 0.0), (0.0, STEP))
        )
        tangents = np.stack([along_x, along_y], axis=-1)
        lengths = np.full((len(x), 2), np.nan)
        good = np.isfinite(tangents).all(axis=(1, 2))
        lengths[good] = np.linalg.svd(tangents[good], compute_uv=False)
        centre = np.degrees(positions(np.array([x.mean()]), np.array([y.mean()]))[1][0])
        return np.sort(1 / lengths, axis=-1), (float(centre[0]), float(centre[1]))


def ellipsoid(geographic: dict[str, Any]) -> tuple[float, float]:
    """Return the semi-axes of a geographic CRS's body.

    Args:
        geographic: its PROJ JSON.

    Returns:
        Equatorial and polar semi-axis, m.

    Raises:
        KeyError: the JSON has no ellipsoid.
    """
    body = (geographic.get("datum") or geographic["datum_ensemble"])["ellipsoid"]

    def number(key: str) -> float:
        value = body[key]
        return float(value["value"] * _unit(value)[1] if isinstance(value, dict) else value)

    if "radius" in body:
        return number("radius"), number("radius")
    major = number("semi_major_axis")
    return major, number("semi_minor_axis") if "semi_minor_axis" in body else major * (1 - 1 / number("inverse_flattening"))


def warp(
    name: str, horizontal: dict[str, Any] | None, centre: tuple[float, float] | None, cell: tuple[float, float] | None = None
) -> str:
    """Return the `gdalwarp` command that corrects a file: north up, in a local projection.

    Args:
        name: of the file.
        horizontal: PROJ JSON of its horizontal CRS, or None.
        centre: longitude and latitude of the map's centre, degrees; None: keep the projection, or leave it to the user.
        cell: least and greatest true side of a cell, m. Cells must not become larger, as gdalwarp's cubic kernel then ripples.

    Returns:
        A command line that writes new.tif in 32-bit floats, with NaN where data is missing.
    """
    target = ""
    if horizontal is not None and centre is not None:
        try:
            major, minor = ellipsoid(horizontal.get("base_crs", horizontal))
        except (KeyError, TypeError):
            major = minor = 0.0
        body = f"+R={major:.10g}" if major == minor else f"+a={major:.10g} +b={minor:.13g}"
        if major > 0:
            lon, lat = centre
            target = f"-t_srs '+proj=stere +lat_0={lat:.6g} +lon_0={lon:.6g} {body}' "
            if cell is not None:
                side = max(min(cell), 0.5 * max(cell))
                target += f"-tr {side:.4g} {side:.4g} "
    elif horizontal is not None:
        target = "-t_srs EPSG:CODE "
    return f"gdalwarp -r cubic -et 0 -ot Float32 -dstnodata nan {target}{name} new.tif"


def _components(crs: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the parts of a CRS without datum shifts: horizontal, then vertical if any."""
    if crs.get("type") == "BoundCRS":
        return _components(crs["source_crs"])
    if crs.get("type") == "CompoundCRS":
        return [part for component in crs["components"] for part in _components(component)]
    return [crs]


def _unit(holder: dict[str, Any]) -> tuple[str, float, bool]:
    """Return name, size (m or rad) and True for an angle, of a unit in PROJ JSON."""
    unit = holder.get("unit", "metre")
    if isinstance(unit, dict):
        return str(unit.get("name")), float(unit["conversion_factor"]), unit.get("type") == "AngularUnit"
    return (unit, math.radians(1), True) if unit == "degree" else (unit, 1.0, False)


def _short(georeference: Georeference) -> str:
    """Return a CRS as a short text for a message."""
    text = georeference.crs or ""
    return text if len(text) < 40 else str((georeference.horizontal or {}).get("name", "geographic"))
