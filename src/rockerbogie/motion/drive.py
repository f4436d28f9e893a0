"""Along a path, quasi-static: the rover settled at every station, and how fast everything moves there."""

from __future__ import annotations

import csv
import itertools
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._version import __version__
from ..errors import PathError, RockerbogieError, expect
from ..rover.model import LOAD_ROVER, Rover
from ..settling.dataset import VARIABLES, run_dataset
from ..settling.pose import Pose
from ..settling.settle import settle
from ..settling.status import Status
from ..terrain.heightfield import Terrain
from .jacobian import contact_rows
from .path import Path, PathSample

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Most stations of one drive: 2 km a centimetre apart, 2 GB while the rates are worked out.
MOST_STATIONS = 200_000


def drive(
    rover: Rover,
    terrain: Terrain,
    path: Path,
    speed: float = 0.02,
    *,
    step: float = 0.01,
    steering: ArrayLike | None = None,
) -> xr.Dataset:
    """Drive a rover along a path, slowly enough that it always rests on its wheels (the paper's section III).

    Rates are exact derivatives, not differences: the settled pose keeps six treads on the ground, and how it does so
    follows linearly from the rates of x, y and yaw (`drive_rates`). The steering's own rate is left out: on lines and
    arcs it holds still, but for the joints between them, where the wheels turn on the spot. `contact_angle_rate` alone
    is a central difference of the stations.

    Args:
        path: within the terrain's map; stations off it are nan and their `status` says so.
        speed: along the path as the map shows it, without its ups and downs, m/s, above 0.
        step: between stations, m; made a little less where the path's length is not a whole number of them.
        steering: (6,) or (n, 6) for the n stations, rad; default `ackermann` for the path's curvature.

    Returns:
        Dataset over `time` (docs/design.md); `attrs["status_summary"]` says in words how many stations settled.

    Raises:
        PathError: at no station all wheels stand on the map; a step or speed that is not above 0; too many stations.
        RockerbogieError: steering that does not fit.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(path, Path, "path", "make one with rockerbogie.Path.straight, arc, waypoints or from_arrays")
    if not (np.isfinite(speed) and speed > 0):
        raise PathError(f"speed is {speed} m/s; give one above 0 (to go backwards, give a path that faces back)")
    if not (np.isfinite(step) and step > 0):
        raise PathError(f"step is {step} m; give one above 0")
    count = int(np.ceil(path.length / step - 1e-9))
    if count >= MOST_STATIONS:
        raise PathError(f"{path.length:g} m in steps of {step:g} m is more than {MOST_STATIONS:,} stations: give a longer step")
    distance = np.linspace(0.0, path.length, count + 1)
    at = path.sample(distance)
    turn = ackermann(rover, at.curvature, at.course - at.yaw) if steering is None else np.asarray(steering, dtype=float)
    if turn.shape not in ((6,), (len(distance), 6)):
        raise RockerbogieError(f"steering has shape {turn.shape}; give (6,) or ({len(distance)}, 6), one row a station")
    pose = settle(rover, terrain, at.x, at.y, at.yaw, steering=turn)
    if (pose.status == Status.OFF_MAP).all():
        xmin, ymin, xmax, ymax = terrain.bounds
        raise PathError(
            f"the path ({path.description}) lies wholly off the map, which spans "
            f"({xmin:.10g}, {ymin:.10g}) to ({xmax:.10g}, {ymax:.10g}) m: move the path or load that ground"
        )
    time = distance / speed
    values = {name: getattr(pose, name) for name in VARIABLES} | drive_rates(pose, at, speed)
    values["contact_angle_rate"] = np.gradient(pose.contact_angle, time, axis=0)
    attrs = {
        "path": path.description,
        "speed": float(speed),
        "source": f"rockerbogie {__version__} drive",
        "rates": "exact derivatives with the steering held; contact_angle_rate by central differences",
        "status_summary": summary(pose.status, distance),
    }
    return run_dataset(rover, terrain, time, distance, values, attrs)


def ackermann(rover: Rover, curvature: ArrayLike, crab: ArrayLike = 0.0) -> Array:
    """Steering (..., 6) that points each steerable wheel along its own way, rad: planar, the joints at rest.

    Seen from above, a body that goes in direction `crab` and turns by `curvature` a metre moves each wheel's steering
    axis square to the line from the centre of the turn. Wheels are turned a quarter at most, and roll backwards beyond.

    Args:
        curvature: (...) of the path at the reference point, 1/m, left positive.
        crab: (...) direction of travel to the body's x, rad.
    """
    kappa, beta = (np.asarray(a, dtype=float)[..., None] for a in (curvature, crab))
    axis = rover.hubs[:, :2] + rover.steering_offset
    along, across = np.cos(beta) - kappa * axis[:, 1], np.sin(beta) + kappa * axis[:, 0]
    angle = np.arctan2(across, along)
    angle = angle - np.pi * np.round(angle / np.pi)
    return np.where(rover.steers, angle, 0.0)


def drive_rates(pose: Pose, at: PathSample, speed: float) -> dict[str, Array]:
    """Rates (n,) or (n, 2), (n, 6) of a pose that goes along its path at `speed` m/s, by their names in a run.

    Six wheels neither leave the ground nor sink (the rows `lift` of `contact_rows`): six linear equations for the
    rates of z, roll, pitch, rocker and bogies, given those of x, y and yaw. The wheels' rates are those without roll slip.
    """
    n = pose.status.size
    known = np.isfinite(pose.q).all(axis=-1)
    rows = contact_rows(pose.rover, pose)
    x_rate, y_rate, yaw_rate = speed * np.cos(at.course), speed * np.sin(at.course), speed * at.curvature
    sr, cr, sp, cp = np.sin(pose.roll), np.cos(pose.roll), np.sin(pose.pitch), np.cos(pose.pitch)
    twist = np.zeros((n, 6, 6))  # of the body in its own frame, from the rates of x, y, z, roll, pitch, yaw
    twist[:, :3, :3] = np.swapaxes(pose.T_world_body[:, :3, :3], 1, 2)
    twist[:, 3, 3] = 1.0
    twist[:, 4, 4], twist[:, 5, 4] = cr, -sr
    twist[:, 3, 5], twist[:, 4, 5], twist[:, 5, 5] = -sp, sr * cp, cr * cp
    by_rate = np.concatenate([rows[..., :6] @ twist[:, None], rows[..., 6:9]], axis=-1)  # (n, 6 wheels, 5 rows, 9)
    given = np.stack([x_rate, y_rate, yaw_rate], axis=-1)
    solve_for = [2, 3, 4, 6, 7, 8]
    found = np.full((n, 6), np.nan)
    lift = by_rate[known, :, 2]
    A, b = lift[..., solve_for], -lift[..., [0, 1, 5]] @ given[known, :, None]
    sound = np.linalg.det(A) != 0  # else the linkage could move while the body stands: its rate is nan
    found[np.flatnonzero(known)[sound]] = np.linalg.solve(A[sound], b[sound])[..., 0]
    rates = np.empty((n, 9))
    rates[:, [0, 1, 5]], rates[:, solve_for] = given, found
    rolled, slid = (
        np.einsum("nij,nj->ni", by_rate[:, :, row], rates) for row in (0, 1)
    )  # m/s along each wheel's way, and across
    names = ("x", "y", "z", "roll", "pitch", "yaw", "rocker")
    return {f"{name}_rate": rates[:, k] for k, name in enumerate(names)} | {
        "bogie_rate": rates[:, 7:],
        "wheel_rate": rolled / pose.rover.wheel_radius,
        "side_slip": slid,
    }


def summary(status: NDArray[np.uint8], distance: Array) -> str:
    """How a drive went, in a sentence: how many stations settled, and what became of the others, and where first."""
    parts = [f"{int((status == Status.CONVERGED).sum())} of {status.size} stations settled"]
    for code in Status:
        hit = status == code
        if code != Status.CONVERGED and hit.any():
            parts.append(f"{int(hit.sum())} {code.name} (first at {distance[np.argmax(hit)]:.2f} m)")
    return ", ".join(parts)


def to_csv(run: xr.Dataset, file: str | FilePath) -> None:
    """Write a run as CSV: a row a station, a column a number, headed `name [unit]`, `name_wheel [unit]` and so on.

    Raises:
        RockerbogieError: the file cannot be written.
    """
    header, columns = [], []
    for name in ("time", "distance", *run.data_vars):
        variable = run[name]
        extra = [d for d in variable.dims if d != "time"]
        for labels in itertools.product(*(run[d].values for d in extra)):
            header.append(f"{'_'.join((str(name), *map(str, labels)))} [{variable.attrs['units']}]")
            columns.append(variable.sel(dict(zip(extra, labels, strict=True))).values)
    try:
        with open(file, "w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(header)
            writer.writerows([f"{value:.10g}" for value in row] for row in zip(*columns, strict=True))
    except OSError as error:
        raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None
