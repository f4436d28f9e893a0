"""Planned routes: their poses, the `Path` for `drive`, and their files."""

from __future__ import annotations

import csv
import json
import warnings
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import PathError, RockerbogieError
from ..files.outputs import SOURCE, check_outputs
from ..files.tables import read_columns
from ..files.vectors import is_vector
from .path import Path

#: Share of a leg over which a turn on the spot is spread in a `Path`, which turns only while it moves.
TURN_ROOM = 0.1
COLUMNS = {
    "x": "m", "y": "m", "yaw": "rad", "distance": "m", "cost": "m", "tilt": "rad", "clearance": "m", "time": "s", "goal": "1",
}  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Route:
    """Least-cost route over a map: n poses, SI and radians.

    Poses of a turn on the spot share their position. `str(route)` is a summary in one line.
    """

    x: Array  # (n,) m, cell centres
    y: Array  # (n,) m
    yaw: Array  # (n,) from +x counter-clockwise, rad, continuous
    distance: Array  # (n,) horizontal distance from the start, m
    cost: Array  # (n,) from the start, equivalent m of flat terrain
    tilt: Array  # (n,) from the map, rad
    crs: str | None
    rover: str
    clearance: Array  # (n,) of the body from the map, m; NaN if the map has none
    time: Array  # (n,) since the start, s, at the speed and turn rate of the plan
    goal: NDArray[np.int64]  # (n,) number of the goal that the pose leads to, from 1

    def __str__(self) -> str:
        turned = np.degrees(np.abs(np.diff(self.yaw)).sum())
        ends = [f"({self.x[k]:.10g}, {self.y[k]:.10g})" for k in (0, -1)]
        return (
            f"{self.distance[-1]:.1f} m from {ends[0]} to {ends[1]} m, turning {turned:.0f} deg in all, "
            f"tilted {np.degrees(np.nanmax(self.tilt)):.1f} deg at most; cost {self.cost[-1]:.1f} m of flat terrain"
        )

    def __repr__(self) -> str:
        return f"<Route of {len(self.x)} poses: {self}>"

    @property
    def heading(self) -> Array:
        """(n,) old name of `yaw`, rad. Deprecated."""
        warnings.warn("Route.heading is deprecated: use Route.yaw", DeprecationWarning, stacklevel=2)
        return self.yaw

    @property
    def path(self) -> Path:
        """The route as a `Path` for `drive`: straight from cell to cell, with the route's yaw.

        A turn on the spot is spread over a twentieth of the leg before it and of the leg after it.

        Raises:
            PathError: the route only turns on the spot.
        """
        return path_of(self.x, self.y, self.yaw)

    def to_csv(self, file: str | FilePath, *, force: bool = False) -> None:
        """Write a CSV file that `rockerbogie drive --path` reads, one row per pose.

        Args:
            file: the CSV file to write.
            force: replace a file that this package did not write.

        Raises:
            RockerbogieError: the file cannot be written.
        """
        check_outputs([file], force=force)
        columns = [np.asarray(getattr(self, name), dtype=float) for name in COLUMNS]
        try:
            with open(file, "w", newline="", encoding="utf-8") as stream:
                writer = csv.writer(stream)
                writer.writerow([f"{name} [{unit}]" for name, unit in COLUMNS.items()])
                writer.writerows([f"{value:.12g}" for value in row] for row in zip(*columns, strict=True))
        except OSError as error:
            raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None

    def to_geojson(self, file: str | FilePath, *, force: bool = False) -> None:
        """Write a GeoJSON line with its length, cost and largest tilt.

        Coordinates and CRS are those of the map. The GeoJSON standard allows longitude and latitude of the Earth only, which a
        warning says. QGIS and GDAL read the CRS where it has a name of an authority; `to_geopackage` keeps every CRS.

        Args:
            file: the .geojson file to write.
            force: replace a file that this package did not write.

        Raises:
            RockerbogieError: the file cannot be written.
        """
        check_outputs([file], force=force)
        if self.crs != "EPSG:4326":
            warnings.warn(
                "GeoJSON is longitude and latitude on WGS84 by its standard, and this route is in "
                f"{self.crs or 'local metres'}: "
                + ("only GDAL and QGIS read that CRS; " if _urn(self.crs) else "no reader will know that; ")
                + "a GeoPackage (.gpkg) keeps it",
                stacklevel=2,
            )
        places = [[float(x), float(y)] for x, y in zip(self.x, self.y, strict=True)]
        line = [places[0]] + [b for a, b in pairwise(places) if a != b]
        properties = {
            "source": SOURCE,
            "rover": self.rover,
            "length_m": round(float(self.distance[-1]), 3),
            "cost_m": round(float(self.cost[-1]), 3),
            "time_s": round(float(self.time[-1]), 1),
            "worst_tilt_deg": round(float(np.degrees(np.nanmax(self.tilt))), 3),
        }
        layer: dict[str, object] = {"type": "FeatureCollection", "name": "route"}
        if name := _urn(self.crs):
            layer["crs"] = {"type": "name", "properties": {"name": name}}
        geometry = {"type": "LineString", "coordinates": line}
        layer["features"] = [{"type": "Feature", "properties": properties, "geometry": geometry}]
        try:
            FilePath(file).write_text(json.dumps(layer) + "\n", encoding="utf-8")
        except OSError as error:
            raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None

    def to_geopackage(self, file: str | FilePath, *, force: bool = False) -> None:
        """Write a GeoPackage in the CRS of the map, which `rockerbogie drive --path` reads too.

        Layers: `route`, a line to each goal; `legs`, a line for each straight stretch; both with length, time, turn, yaw,
        greatest tilt, least clearance and cost. `poses`, points with all numbers of the CSV file.

        Args:
            file: ends in .gpkg.
            force: replace a file that this package did not write.

        Raises:
            RockerbogieError: pyogrio not installed, an unknown CRS, a file that cannot be written.
        """
        from .route_package import write_route_package

        write_route_package(self, file, force=force)


#: Old name of `Route`.
Plan = Route


def read_route(file: str | FilePath, radius: float = 1.0) -> Path:
    """Read a `Path` from a file of waypoints or poses: CSV, or a vector file such as GeoPackage.

    Columns are `x [m]` and `y [m]`, and `yaw [rad]` (or `[deg]`) for poses. Without yaw the rows are waypoints. With yaw,
    rows at one position are a turn on the spot. Of a vector file the layer `poses` is read, if it has one with a column `yaw`;
    otherwise the vertices of its lines, or its points, are waypoints. Their coordinates are those of the terrain.

    Args:
        file: .csv, or a vector file that GDAL reads.
        radius: of the arcs at waypoints, m.

    Returns:
        The path.

    Raises:
        RockerbogieError: no such file, not CSV, no x or y.
        PathError: rows that make no path.
    """
    name = FilePath(file).name
    if not FilePath(file).exists():
        raise RockerbogieError(f"no path at {str(file)!r}")
    if is_vector(file):
        from .route_package import read_line

        line, yaw = read_line(file)
        return Path.waypoints(line, radius) if yaw is None else path_of(line[:, 0], line[:, 1], yaw)
    columns = read_columns(FilePath(file))
    missing = [axis for axis in ("x", "y") if axis not in columns]
    if missing:
        raise PathError(f"{name} has no column {missing[0]!r}; it has {', '.join(columns)}: name two x [m] and y [m]")
    if "yaw" not in columns:
        return Path.waypoints(np.stack([columns["x"], columns["y"]], axis=-1), radius)
    return path_of(columns["x"], columns["y"], columns["yaw"])


def path_of(x: Array, y: Array, yaw: Array) -> Path:
    """Make a path through poses.

    A turn on the spot is spread over a small part of the legs before and after it.

    Args:
        x, y: (n,) m.
        yaw: (n,) rad.

    Returns:
        The path.

    Raises:
        PathError: all poses at one position, or not finite.
    """
    moved = np.flatnonzero(np.hypot(np.diff(x), np.diff(y)) > 0)
    if not moved.size:
        raise PathError(f"the {len(x)} poses are all at one position: there is no path to drive")
    first = np.concatenate([[0], moved + 1])  # first and last pose at each position
    last = np.concatenate([moved, [len(x) - 1]])
    place = np.stack([x[first], y[first]], axis=-1)
    leg = np.diff(place, axis=0)
    points: list[Array] = []
    facing: list[float] = []
    for k, (i, j) in enumerate(zip(first, last, strict=True)):
        before = -TURN_ROOM / 2 if k > 0 else 0.0  # in legs: back along the leg before, on along the leg after
        after = TURN_ROOM / 2 if k < len(leg) else 0.0
        if k == 0:
            after = TURN_ROOM
        elif k == len(leg):
            before = -TURN_ROOM
        share = np.linspace(before, after, j - i + 1) if j > i else np.zeros(1)
        at = np.union1d(share, [0.0])
        for s, angle in zip(at, np.interp(at, share, yaw[i : j + 1]), strict=True):
            way = leg[k - 1] if s < 0 else leg[min(k, len(leg) - 1)]
            points.append(place[k] + s * way)
            facing.append(float(angle))
    line = np.array(points)
    return Path.from_arrays(line[:, 0], line[:, 1], facing)


def _urn(crs: str | None) -> str | None:
    """Return the URN of a CRS such as EPSG:32633 for a GeoJSON file; None if it has none."""
    authority, _, code = (crs or "").partition(":")
    return f"urn:ogc:def:crs:{authority}::{code}" if code.isdigit() else None
