"""Routes in GeoPackages, and paths from any vector file."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import PathError
from ..files.outputs import SOURCE, check_outputs
from ..files.vectors import layers_of, read_features, require_vectors, write_features
from ..rover.rotations import wrap_angle

#: Layers: a line to each goal, a line for each straight stretch, the poses as points.
ROUTE, LEGS, POSES = "route", "legs", "poses"
#: Columns of the poses that are read back as they are.
POSE_COLUMNS = ("x", "y", "yaw", "distance", "cost", "tilt", "clearance", "time", "goal")


class RouteFields(Protocol):
    """The fields of a route that its GeoPackage holds."""

    @property
    def x(self) -> Array: ...
    @property
    def y(self) -> Array: ...
    @property
    def yaw(self) -> Array: ...
    @property
    def distance(self) -> Array: ...
    @property
    def cost(self) -> Array: ...
    @property
    def tilt(self) -> Array: ...
    @property
    def clearance(self) -> Array: ...
    @property
    def time(self) -> Array: ...
    @property
    def goal(self) -> NDArray[np.int64]: ...
    @property
    def crs(self) -> str | None: ...
    @property
    def rover(self) -> str: ...


def write_route_package(route: RouteFields, file: str | Path, *, force: bool = False) -> None:
    """Write a route as a GeoPackage with the layers `route`, `legs` and `poses`.

    Args:
        route: from `plan`.
        file: ends in .gpkg.
        force: replace a file that this package did not write.

    Raises:
        RockerbogieError: pyogrio not installed, an unknown CRS, a file that cannot be written.
    """
    check_outputs([file], force=force)
    require_vectors()
    import shapely

    last = np.append(np.flatnonzero(np.diff(route.goal)), len(route.x) - 1)  # the last pose on the way to each goal
    spans = {ROUTE: list(pairwise([0, *(int(k) for k in last)])), LEGS: _stretches(route)}
    layers: dict[str, tuple[Any, dict[str, Any]]] = {}
    for name, parts in spans.items():
        moving = [(a, b) for a, b in parts if route.distance[b] > route.distance[a]]
        if moving:
            lines = [shapely.LineString(_distinct(route.x[a : b + 1], route.y[a : b + 1])) for a, b in moving]
            layers[name] = lines, _attributes(route, moving)
    layers[POSES] = shapely.points(route.x, route.y), {name: np.asarray(getattr(route, name)) for name in POSE_COLUMNS}
    write_features(file, layers, route.crs, SOURCE)


def read_line(file: str | Path) -> tuple[Array, Array | None]:
    """Read positions, and yaw if there is one, from a vector file.

    Args:
        file: a GeoPackage that this package wrote, or any file with lines or points.

    Returns:
        Positions (n, 2), m, and yaw (n,), rad, or None for waypoints.

    Raises:
        RockerbogieError: a file that cannot be read.
        PathError: areas in place of lines and points, or longitude and latitude.
    """
    require_vectors()
    import shapely

    layers = layers_of(file)
    features = read_features(file, POSES if POSES in layers else None)
    if features.crs == "EPSG:4326":
        raise PathError(f"{features.name} is in longitude and latitude: save it in the CRS of the terrain, as GeoPackage")
    kinds = {shape.geom_type for shape in features.geometry}
    if not kinds <= {"Point", "LineString", "MultiPoint", "MultiLineString"}:
        raise PathError(f"{features.name} holds {', '.join(sorted(kinds))}: a path is made of lines or points")
    points = shapely.get_coordinates(features.geometry)
    yaw = features.fields.get("yaw") if kinds == {"Point"} else None
    return (_distinct(*points.T), None) if yaw is None else (points, yaw.astype(float))


def _stretches(route: RouteFields) -> list[tuple[int, int]]:
    """Return first and last pose of each stretch in one direction, at one yaw, to one goal."""
    course = np.arctan2(np.diff(route.y), np.diff(route.x))
    spans: list[tuple[int, int]] = []
    for k in np.flatnonzero(np.diff(route.distance) > 0):
        same = bool(spans) and spans[-1][1] == k and route.goal[k + 1] == route.goal[k] and route.yaw[k + 1] == route.yaw[k]
        if same and abs(wrap_angle(course[k] - course[k - 1])) < 1e-6:
            spans[-1] = (spans[-1][0], int(k) + 1)
        else:
            spans.append((int(k), int(k) + 1))
    return spans


def _attributes(route: RouteFields, spans: list[tuple[int, int]]) -> dict[str, Any]:
    """Return the columns that describe parts of a route."""
    first, last = (np.array(ends) for ends in zip(*spans, strict=True))
    parts = [slice(a, b + 1) for a, b in spans]
    return {
        "number": np.arange(1, len(spans) + 1),
        "goal": route.goal[last],
        "length_m": route.distance[last] - route.distance[first],
        "time_s": route.time[last] - route.time[first],
        "turn_deg": np.degrees([float(np.abs(np.diff(route.yaw[part])).sum()) for part in parts]),
        "yaw_deg": np.degrees(route.yaw[last]) % 360,
        "tilt_max_deg": np.degrees([float(np.fmax.reduce(route.tilt[part])) for part in parts]),
        "clearance_min_m": np.array([float(np.fmin.reduce(route.clearance[part])) for part in parts]),
        "cost_m": route.cost[last] - route.cost[first],
        "rover": np.array([route.rover] * len(spans)),
    }


def _distinct(x: Array, y: Array) -> Array:
    """Return points (n, 2) without those that repeat the one before."""
    points = np.stack([x, y], axis=1)
    kept = np.concatenate([[True], (np.diff(points, axis=0) != 0).any(axis=1)])
    distinct: Array = points[kept]
    return distinct
