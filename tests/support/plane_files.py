"""Raster files of a tilted plane, and the attitude of a rover on it in closed form."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import rockerbogie as rb

GX, GY, Z0 = 0.10, -0.05, 100.0  # z = Z0 + GX (x - xc) + GY (y - yc), metres
YAW = math.radians(30)
UTM, CENTRE = "EPSG:32633", (500_020.0, 4_000_020.0)
TOLERANCE = math.radians(0.01)
SHAPE = (40, 44)


def attitude(gx: float = GX, gy: float = GY, yaw: float = YAW) -> tuple[float, float]:
    """Return pitch and roll of a body on the plane z = gx x + gy y, rad, from R = Rz Ry Rx."""
    pitch = -math.atan(gx * math.cos(yaw) + gy * math.sin(yaw))
    normal = np.array([-gx, -gy, 1.0]) / math.sqrt(gx * gx + gy * gy + 1)
    forward = np.array([math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch)])
    left = np.cross(normal, forward)
    return pitch, math.atan2(left[2], normal[2])


def grid(
    step_x: float, step_y: float, centre: tuple[float, float] = CENTRE, shape: tuple[int, int] = SHAPE, turn: float = 0.0
) -> Any:
    """Return a file's affine transform; turn is counter-clockwise, rad."""
    from rasterio.transform import Affine

    c, s = math.cos(turn), math.sin(turn)
    if abs(turn) == math.pi / 2:
        c = 0.0
    a, b, d, e = c * step_x, -s * step_y, s * step_x, c * step_y
    rows, cols = shape
    return Affine(a, b, centre[0] - (a * cols + b * rows) / 2, d, e, centre[1] - (d * cols + e * rows) / 2)


def plane(transform: Any, centre: tuple[float, float] = CENTRE, shape: tuple[int, int] = SHAPE, unit: float = 1.0) -> np.ndarray:
    """Return heights (rows, cols) m of the plane; unit is the length of x and y's unit, m."""
    row, col = np.mgrid[: shape[0], : shape[1]]
    x, y = transform * (col + 0.5, row + 0.5)
    return np.asarray(Z0 + unit * (GX * (x - centre[0]) + GY * (y - centre[1])))


def write(path: Path, z: np.ndarray, transform: Any, crs: Any = UTM, driver: str = "GTiff", **more: Any) -> Path:
    """Write bands as a raster, with scales, offsets, units and colours."""
    import rasterio

    bands = z if z.ndim == 3 else z[None]
    after = {key: more.pop(key) for key in ("scales", "offsets", "units", "colorinterp") if key in more}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(
            path, "w", driver=driver, height=bands.shape[1], width=bands.shape[2], count=len(bands), dtype=bands.dtype, crs=crs,
            transform=transform, **more,
        ) as file:  # fmt: skip
            file.write(bands)
            for key, value in after.items():
                setattr(file, key, value)
    return path


def read(path: str | Path, **options: Any) -> rb.Terrain | rb.TerrainError:
    """Return the terrain of a file, or the error that refuses it; warnings are suppressed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return rb.Terrain.from_raster(path, **options)
        except rb.TerrainError as error:
            return error


def assert_plane(terrain: rb.Terrain, at: Callable[[rb.Terrain], tuple[float, float]] | None = None, says: str = "") -> None:
    """Assert that Curiosity has the plane's pitch and roll within 0.01 degrees."""
    xmin, ymin, xmax, ymax = terrain.bounds
    x, y = at(terrain) if at else ((xmin + xmax) / 2, (ymin + ymax) / 2)
    pose = rb.settle(rb.load_rover("curiosity"), terrain, x, y, YAW)
    pitch, roll = attitude()
    assert pose.status == rb.Status.CONVERGED, says
    assert abs(float(pose.pitch) - pitch) < TOLERANCE, f"{says}: pitch {math.degrees(float(pose.pitch))}°"
    assert abs(float(pose.roll) - roll) < TOLERANCE, f"{says}: roll {math.degrees(float(pose.roll))}°"
