"""A planned way: its poses, the `Path` that `drive` takes, and files of it."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from ..errors import PathError, RockerbogieError
from ..outputs import SOURCE, check_outputs
from ..tables import read_columns
from .path import Path

Array = NDArray[np.float64]

#: Share of a leg over which a turn on the spot is spread in a `Path`, which only turns while it moves.
TURN_ROOM = 0.1
COLUMNS = {"x": "m", "y": "m", "yaw": "rad", "distance": "m", "cost": "m", "tilt": "rad"}


@dataclass(frozen=True, eq=False)
class Route:
    """The least-cost way over a map: n poses, SI and radians. Turning on the spot, poses share their place.

    `str(plan)` says in a line what it is.
    """

    x: Array  # (n,) m, centres of cells
    y: Array  # (n,) m
    heading: Array  # (n,) from +x counter-clockwise, rad, whole turns taken out
    distance: Array  # (n,) driven from the start, m
    cost: Array  # (n,) so far, m of level ground
    tilt: Array  # (n,) as the map has it, rad
    crs: str | None
    rover: str

    def __str__(self) -> str:
        turned = np.degrees(np.abs(np.diff(self.heading)).sum())
        ends = [f"({self.x[k]:.10g}, {self.y[k]:.10g})" for k in (0, -1)]
        return (
            f"{self.distance[-1]:.1f} m from {ends[0]} to {ends[1]} m, turning {turned:.0f} deg in all, "
            f"tilted {np.degrees(np.nanmax(self.tilt)):.1f} deg at most; cost {self.cost[-1]:.1f} m of level ground"
        )

    @property
    def path(self) -> Path:
        """The way as `drive` takes it: straight from cell to cell, faced as on the map.

        A turn on the spot is spread over a twentieth of the leg before it and of the one after.

        Raises:
            PathError: the plan only turns and goes nowhere.
        """
        return path_of(self.x, self.y, self.heading)

    def to_csv(self, file: str | FilePath, *, force: bool = False) -> None:
        """Write a row a pose: `x [m]`, `y [m]`, `yaw [rad]`, ...; `rockerbogie drive --path` reads it.

        Args:
            file: the table to write.
            force: replace a file that this package did not write.

        Raises:
            RockerbogieError: the file cannot be written.
        """
        check_outputs([file], force=force)
        columns = (self.x, self.y, self.heading, self.distance, self.cost, self.tilt)
        try:
            with open(file, "w", newline="", encoding="utf-8") as stream:
                writer = csv.writer(stream)
                writer.writerow([f"{name} [{unit}]" for name, unit in COLUMNS.items()])
                writer.writerows([f"{value:.12g}" for value in row] for row in zip(*columns, strict=True))
        except OSError as error:
            raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None

    def to_geojson(self, file: str | FilePath, *, force: bool = False) -> None:
        """Write a line with its length, cost and greatest tilt, in the map's own coordinates and CRS, for QGIS.

        GeoJSON's standard knows the Earth's longitude and latitude only; like GDAL, QGIS reads a CRS that is named.

        Args:
            file: the .geojson file to write.
            force: replace a file that this package did not write.

        Raises:
            RockerbogieError: the file cannot be written.
        """
        check_outputs([file], force=force)
        places = [[float(x), float(y)] for x, y in zip(self.x, self.y, strict=True)]
        line = [places[0]] + [b for a, b in pairwise(places) if a != b]
        properties = {
            "source": SOURCE,
            "rover": self.rover,
            "length_m": round(float(self.distance[-1]), 3),
            "cost_m": round(float(self.cost[-1]), 3),
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


#: Old name of `Route`.
Plan = Route


def read_route(file: str | FilePath, radius: float = 1.0) -> Path:
    """A `Path` from a CSV file: columns `x [m]` and `y [m]`, and `yaw [rad]` (or `[deg]`) where poses are meant.

    Without yaw the places are waypoints with corners of `radius` m. Rows in one place are a turn on the spot.

    Raises:
        RockerbogieError: no such file, not CSV, no x or y.
        PathError: places that make no path.
    """
    name = FilePath(file).name
    if not FilePath(file).exists():
        raise RockerbogieError(f"no path at {str(file)!r}")
    columns = read_columns(FilePath(file))
    missing = [axis for axis in ("x", "y") if axis not in columns]
    if missing:
        raise PathError(f"{name} has no column {missing[0]!r}; it has {', '.join(columns)}: name two x [m] and y [m]")
    if "yaw" not in columns:
        return Path.waypoints(np.stack([columns["x"], columns["y"]], axis=-1), radius)
    return path_of(columns["x"], columns["y"], columns["yaw"])


def path_of(x: Array, y: Array, heading: Array) -> Path:
    """A path through poses (n,), some of them turns on the spot: spread over a little of the legs on either side.

    Raises:
        PathError: the poses never leave their place, or are no numbers.
    """
    moved = np.flatnonzero(np.hypot(np.diff(x), np.diff(y)) > 0)
    if not moved.size:
        raise PathError(f"the {len(x)} poses all stand at one place, and turn at most: there is nothing to drive along")
    first = np.concatenate([[0], moved + 1])  # the poses at each place, from first to last
    last = np.concatenate([moved, [len(x) - 1]])
    place = np.stack([x[first], y[first]], axis=-1)
    leg = np.diff(place, axis=0)
    points: list[Array] = []
    facing: list[float] = []
    for k, (i, j) in enumerate(zip(first, last, strict=True)):
        before = -TURN_ROOM / 2 if k > 0 else 0.0  # in legs: back along the one that led here, on along the next
        after = TURN_ROOM / 2 if k < len(leg) else 0.0
        if k == 0:
            after = TURN_ROOM
        elif k == len(leg):
            before = -TURN_ROOM
        share = np.linspace(before, after, j - i + 1) if j > i else np.zeros(1)
        at = np.union1d(share, [0.0])
        for s, yaw in zip(at, np.interp(at, share, heading[i : j + 1]), strict=True):
            way = leg[k - 1] if s < 0 else leg[min(k, len(leg) - 1)]
            points.append(place[k] + s * way)
            facing.append(float(yaw))
    line = np.array(points)
    return Path.from_arrays(line[:, 0], line[:, 1], facing)


def _urn(crs: str | None) -> str | None:
    """A CRS such as EPSG:32633 as a GeoJSON file names it; none for one that has no such name."""
    authority, _, code = (crs or "").partition(":")
    return f"urn:ogc:def:crs:{authority}::{code}" if code.isdigit() else None
