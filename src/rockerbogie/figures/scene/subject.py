"""Subjects of a page: what is shown of a pose, a run or a map, as arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...errors import RockerbogieError, expect
from ...rover.model import LOAD_ROVER, Rover
from ...rover.rotations import body_transform
from ...settling.dataset import SCENE
from ...settling.pose import Pose
from ...settling.status import Status
from ...terrain.heightfield import Terrain
from .rover_mesh import link_transforms
from .terrain_mesh import Bounds

if TYPE_CHECKING:
    import xarray as xr

#: Greatest number of records of a run on a page; of a longer run every k-th record is taken.
RECORDS = 2000
TERRAIN_ARGUMENT = "give the Terrain that the rover was on"
#: Gap above which a simulated wheel counts as off the ground, m.
LIFTED = 5e-4


class Records(NamedTuple):
    """Records of a run, or poses, in order."""

    rover: Rover
    terrain: Terrain
    time: Array  # (n,) s; the number of the pose if there is no time
    at: Array  # (n,) position on the axis of the plots: distance, m; or time; or the number of the pose
    unit: str  # of `at`
    frames: Array  # (n, links, 4, 4) T_world_link; NaN without a pose
    place: Array  # (n, 3) of the body's reference point, m
    contact: Array  # (n, 6, 3) contact points, m
    lifted: NDArray[np.bool_]  # (n, 6)
    status: NDArray[np.uint8]  # (n,)
    data: xr.Dataset  # the records, along their first dimension
    every: int  # one record in so many is taken


def scene_of(data: xr.Dataset, rover: Rover | None = None, terrain: Terrain | None = None) -> tuple[Rover, Terrain]:
    """Return the rover and the terrain of a run.

    Args:
        data: a run.
        rover: default: the rover that the run was made with, while that is in memory.
        terrain: default: the terrain that the run was made with, while that is in memory.

    Returns:
        Those given, or those of the run.

    Raises:
        RockerbogieError: the run was read from a file, and one of them is not given.
    """
    kept = getattr(data, "encoding", {}).get(SCENE, (None, None))
    rover, terrain = (kept[0] if rover is None else rover), (kept[1] if terrain is None else terrain)
    if rover is None or terrain is None:
        missing = "rover" if rover is None else "terrain"
        raise RockerbogieError(f"the run was read from a file, which does not hold its {missing}: give {missing}=")
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(terrain, Terrain, "terrain", TERRAIN_ARGUMENT)
    return rover, terrain


def records_of(subject: Pose | xr.Dataset, rover: Rover | None = None, terrain: Terrain | None = None) -> Records:
    """Return the records of poses or of a run.

    Args:
        subject: one pose or a batch, or a run, or one record of it.
        rover: of a run that was read from a file.
        terrain: of a run that was read from a file.

    Returns:
        At most `RECORDS` records.

    Raises:
        RockerbogieError: no record, variables that are missing, or a run without rover or terrain.
    """
    if isinstance(subject, Pose):
        rover, terrain, data = subject.rover, subject.terrain, subject.to_xarray()
        batch = [str(d) for d in data["z"].dims]
        if len(batch) > 1:
            data = data.stack(pose=batch).transpose("pose", ...)
    else:
        rover, terrain = scene_of(subject, rover, terrain)
        data = subject
    needed = ("x", "y", "z", "roll", "pitch", "yaw", "rocker", "bogie", "status")
    missing = [name for name in needed if name not in data]
    if missing:
        raise RockerbogieError(f"the Dataset has no {', '.join(missing)}: give a run of drive or simulate, a pose or a map")
    if data["z"].ndim > 1:
        dims = ", ".join(str(d) for d in data["z"].dims)
        raise RockerbogieError(f"the run has the dimensions {dims}: select one run, as in run.isel({data['z'].dims[0]}=0)")
    if not data["z"].ndim:
        data = data.expand_dims("pose")
    dim = str(data["z"].dims[0])
    if not data.sizes[dim]:
        raise RockerbogieError("there is no record to show")
    full, every = data, -(-data.sizes[dim] // RECORDS)
    turn = _wheel_turn(rover, full)
    keep = np.unique(np.append(np.arange(0, data.sizes[dim], every), data.sizes[dim] - 1))
    data = data.isel({dim: keep})
    value = {name: np.asarray(data[name].values, dtype=float) for name in needed}
    body = body_transform(*(value[name] for name in ("x", "y", "z", "roll", "pitch", "yaw")))
    steering = data["steering"].values if "steering" in data else None
    frames = link_transforms(rover, body, value["rocker"], value["bogie"], steering, turn[keep])
    n = len(keep)
    number = np.arange(1.0, n + 1)
    time = data["time"].values.astype(float) if "time" in data.coords else number
    at, unit = (time, "s") if "time" in data.coords else (number, "")
    distance = data["distance"].values.astype(float).ravel() if "distance" in data.coords else np.zeros(n)
    if (np.diff(distance) >= 0).all() and distance[-1] > distance[0]:
        at, unit = distance, "m"
    contact = data["contact_point"].values.astype(float) if "contact_point" in data else np.full((n, 6, 3), np.nan)
    lifted = data["gap"].values > LIFTED if "gap" in data else np.zeros((n, 6), dtype=bool)
    place = np.stack([value[name] for name in "xyz"], axis=-1)
    return Records(rover, terrain, time, at, unit, frames, place, contact, lifted, data["status"].values, data, every)


def _wheel_turn(rover: Rover, data: xr.Dataset) -> Array:
    """Return the angles (n, 6) by which the wheels have turned, rad.

    They are the integrated rates or, without rates, distance over radius.
    """
    n = data["z"].shape[0]
    if "wheel_rate" in data and "time" in data.coords:
        rate = np.nan_to_num(data["wheel_rate"].values.astype(float))
        step = np.diff(data["time"].values.astype(float))[:, None]
        return np.concatenate([np.zeros((1, 6)), np.cumsum(0.5 * step * (rate[1:] + rate[:-1]), axis=0)])
    if "distance" in data.coords:
        return np.asarray(data["distance"].values.astype(float).reshape(-1, 1) / rover.wheel_radius)
    return np.zeros((n, 6))


def surroundings(records: Records) -> Bounds:
    """Return the part of the terrain to draw around records.

    Args:
        records: the records.

    Returns:
        xmin, ymin, xmax, ymax, m: their extent with some room, within the terrain.
    """
    known = np.isfinite(records.place).all(axis=1)
    at = (records.place if known.any() else np.nan_to_num(records.place, nan=0.0))[known | ~known.any(), :2]
    if not known.any():
        at = np.stack([records.data["x"].values, records.data["y"].values], axis=-1).reshape(-1, 2)
    size = float(np.ptp(at, axis=0).max())
    room = 1.6 * records.rover.wheelbase + 3 * float(records.rover.wheel_radius.max()) + 0.12 * size
    low, high = np.array(records.terrain.bounds[:2]), np.array(records.terrain.bounds[2:])
    a, b = np.maximum(at.min(axis=0) - room, low), np.minimum(at.max(axis=0) + room, high)
    return (float(a[0]), float(a[1]), float(b[0]), float(b[1])) if (a < b).all() else records.terrain.bounds


def plots_of(records: Records) -> list[dict[str, Any]]:
    """Return the plots of records over their axis.

    Args:
        records: the records.

    Returns:
        Plots with title, units, digits, least height of the axis, and lines with name, colours on light and dark, values (n,),
        limits and dashes. Angles are in degrees.
    """
    data, rover = records.data, records.rover
    deg = np.degrees
    tilt = np.arccos(np.clip(np.cos(data["roll"].values) * np.cos(data["pitch"].values), -1, 1))
    limits = {name: [float(v) for v in deg(ends) if np.isfinite(v)] for name, ends in
              (("rocker", rover.rocker_limits), ("bogie", rover.bogie_limits))}  # fmt: skip
    bogie = deg(data["bogie"].values)
    found = [
        _plot("Attitude", "°", 2, 2.0, [
            _line("roll", "#009E73", "#2fd0a4", deg(data["roll"].values)),
            _line("pitch", "#b0558a", "#e59ac6", deg(data["pitch"].values)),
            _line("tilt", "#222222", "#e8eaec", deg(tilt), dash=[5, 3]),
        ]),
        _plot("Joints", "°", 2, 2.0, [
            _line("rocker", "#666666", "#b5bcc2", deg(data["rocker"].values), limits["rocker"], [5, 3]),
            _line("bogie left", "#0072B2", "#56b4e9", bogie[:, 0], limits["bogie"]),
            _line("bogie right", "#D55E00", "#ff9547", bogie[:, 1]),
        ]),
    ]  # fmt: skip
    if "clearance" in data:
        found.append(
            _plot("Clearance of the body", "m", 3, 0.02, [_line("", "#222222", "#e8eaec", data["clearance"].values, [0.0])])
        )
    if "steering" in data and np.nanmax(np.abs(data["steering"].values), initial=0.0) > 1e-9:
        colours = (("#0072B2", "#56b4e9"), ("#D55E00", "#ff9547"))
        dashes: tuple[list[int], ...] = ([], [2, 2], [6, 3])
        found.append(_plot("Steering", "°", 1, 2.0, [
            _line(name, *colours[i % 2], deg(data["steering"].values[:, i]), dash=dashes[i // 2])
            for i, name in enumerate(rover.wheel_names) if rover.steers[i]
        ]))  # fmt: skip
    if "required_friction" in data:
        found.append(_plot("Required friction", "", 2, 0.1, [_line("", "#222222", "#e8eaec", data["required_friction"].values)]))
    if "tip_margin" in data:
        found.append(_plot("Tip margin", "°", 1, 2.0, [_line("", "#222222", "#e8eaec", deg(data["tip_margin"].values), [0.0])]))
    if "max_torque" in data:
        found.append(_plot("Largest motor torque", "N·m", 2, 0.1, [_line("", "#222222", "#e8eaec", data["max_torque"].values)]))
    return found


def _plot(title: str, units: str, digits: int, least: float, lines: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a diagram of the page as data for JSON."""
    return {"title": title, "units": units, "digits": digits, "least": least, "lines": lines}


def _line(
    name: str, light: str, dark: str, values: NDArray[Any], limits: list[float] | None = None, dash: list[int] | None = None
) -> dict[str, Any]:
    """Return a line of a diagram as data for JSON."""
    return {"name": name, "colour": [light, dark], "values": values, "limits": limits or [], "dash": dash or []}


def good(status: int) -> bool:
    """Return True for a status with a usable pose.

    Args:
        status: a code of `Status`.

    Returns:
        True if converged, or in balance with a wheel off the ground.
    """
    return status in (Status.CONVERGED, Status.WHEEL_LIFTED)
