"""Quasi-static drives: poses at stations along a path, with the rates of all variables."""

from __future__ import annotations

import itertools
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, floats, is_number
from ..errors import PathError, RockerbogieError, expect
from ..files.tables import write_columns
from ..files.version import __version__
from ..gravity import GRAVITY
from ..rover.model import LOAD_ROVER, Rover
from ..rover.rotations import wrap_angle
from ..settling.dataset import EQUILIBRIUM_VARIABLES, VARIABLES, run_dataset
from ..settling.engines import Mode
from ..settling.pose import Pose
from ..settling.settle import check_mode, settle
from ..settling.status import Status
from ..statics.stability import load_values
from ..terrain.heightfield import Terrain
from .jacobian import contact_rows, reading, solve_each
from .path import Path, PathSample

if TYPE_CHECKING:
    import xarray as xr

#: Largest number of stations of one drive: 2 km at 1 cm, for which the rates take 2 GB.
MOST_STATIONS = 200_000
#: Indices of z, roll, pitch, rocker and bogies among the rates of x, y, z, roll, pitch, yaw, rocker, bogies.
SOLVED = (2, 3, 4, 6, 7, 8)
EXACT = "exact derivatives with the steering held; contact_angle_rate by central differences"


def drive(
    rover: Rover,
    terrain: Terrain,
    path: Path,
    speed: float = 0.02,
    *,
    step: float = 0.01,
    steering: ArrayLike | None = None,
    mode: Mode = "contact",
    near: ArrayLike | None = None,
    loads: bool = False,
    gravity: float = GRAVITY["earth"],
) -> xr.Dataset:
    """Drive a rover along a path quasi-statically: one pose and its rates per station.

    This is the paper's section III.

    Rates are exact derivatives of the settled pose with respect to x, y and yaw (`drive_rates`). The rate of the steering itself
    is left out: it is 0 on lines and arcs, and at the joints between them the wheels turn on the spot. `contact_angle_rate`
    alone is a central difference of the stations.

    In equilibrium mode a pose is determined by the wheels in contact and the joints at their limits. Where these are six
    conditions, rates are exact; elsewhere (body on the terrain, say) they are central differences of the stations. The wheel rate
    of a wheel off the ground is that of its tread point with the least gap.

    Args:
        rover: the mechanism.
        terrain: the height field.
        path: within the map; stations off it are NaN with status OFF_MAP.
        speed: horizontal speed along the path, m/s, above 0.
        step: horizontal distance between stations, m; reduced a little if the path's length is not a multiple of it. (The time
            between records of `simulate` is its argument `interval`, s.)
        steering: (6,) or (n, 6) for the n stations, rad; default: `ackermann` for the path's curvature.
        mode: "contact" or "equilibrium", as for `settle`.
        near: (6,) steering angles before the start, rad. Each wheel then stays within a quarter turn of its angle at the station
            before, and may turn beyond ±90 deg. Default: each angle within ±90 deg, with jumps of half a turn.
        loads: True adds wheel loads, required friction, motor torques and tip margins (`wheel_loads`, `stability`), which take
            some milliseconds a station.
        gravity: m/s²; scales forces.

    Returns:
        Dataset over `time` (docs/design.md), with `distance` the horizontal distance along the path; in equilibrium mode also
        `support`, `belly_support`, `wheel_lifted` and `joint_stop`. `attrs["status_summary"]` counts the stations by status.

    Raises:
        PathError: all stations off the map; a step or speed that is not above 0; too many stations.
        RockerbogieError: steering that does not fit; unknown mode.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(path, Path, "path", "make one with rockerbogie.Path.straight, arc, waypoints or from_arrays")
    check_mode(mode)
    if not (is_number(speed) and speed > 0):
        raise PathError(f"speed is {speed!r:.60} m/s; give one above 0 (to drive backwards, give a path whose yaw points back)")
    if not (is_number(step) and step > 0):
        raise PathError(f"step is {step!r:.60} m; give one above 0")
    if near is not None and steering is not None:
        raise RockerbogieError("steering and near are both given: give steering for fixed angles, or near to choose them")
    count = int(np.ceil(path.length / step - 1e-9))
    if count >= MOST_STATIONS:
        raise PathError(f"{path.length:g} m in steps of {step:g} m is more than {MOST_STATIONS:,} stations: give a longer step")
    distance = np.linspace(0.0, path.length, count + 1)
    at = path.sample(distance)
    if steering is None:
        turn = ackermann(rover, at.curvature, at.course - at.yaw)
        turn = turn if near is None else _continuous(rover, turn, reading("near", near, 6))
    else:
        try:
            turn = floats(steering)
        except (TypeError, ValueError, OverflowError):
            raise RockerbogieError(f"steering is {steering!r:.60}; give angles in rad, (6,) or one row a station") from None
    if turn.shape not in ((6,), (len(distance), 6)):
        raise RockerbogieError(f"steering has shape {turn.shape}; give (6,) or ({len(distance)}, 6), one row a station")
    pose = settle(rover, terrain, at.x, at.y, at.yaw, steering=turn, mode=mode, gravity=gravity)
    if (pose.status == Status.OFF_MAP).all():
        xmin, ymin, xmax, ymax = terrain.bounds
        raise PathError(
            f"the path ({path.description}) lies wholly off the map, which spans "
            f"({xmin:.10g}, {ymin:.10g}) to ({xmax:.10g}, {ymax:.10g}) m: move the path or load that terrain"
        )
    time = distance / speed
    differences = np.gradient(pose.q, time, axis=0) if mode == "equilibrium" else None
    names = VARIABLES if mode == "contact" else VARIABLES | EQUILIBRIUM_VARIABLES
    values = {name: getattr(pose, name) for name in names} | drive_rates(pose, at, speed, differences)
    values["contact_angle_rate"] = np.gradient(pose.contact_angle, time, axis=0)
    attrs = {
        "path": path.description,
        "speed": float(speed),
        "mode": mode,
        "source": f"rockerbogie {__version__} drive",
        "rates": EXACT if mode == "contact" else EXACT + "; all rates so where wheels and joint limits do not determine the pose",
        "status_summary": summary(pose.status, distance),
    }
    if loads:
        values |= load_values(pose)
        attrs["gravity"] = pose.gravity
    return run_dataset(rover, terrain, time, distance, values, attrs)


def ackermann(rover: Rover, curvature: ArrayLike, crab: ArrayLike = 0.0) -> Array:
    """Return the planar steering that points each steerable wheel along its own path.

    Seen from above, the body travels in direction `crab` and turns by `curvature` per metre. Each wheel's steering axis then
    moves perpendicular to its line to the turning centre. Angles lie within ±π/2; beyond, wheels roll backwards.

    Args:
        rover: the mechanism.
        curvature: (...) of the path at the reference point, 1/m, left positive.
        crab: (...) direction of travel relative to the body's x axis, rad.

    Returns:
        (..., 6) rad; 0 for wheels that do not steer.
    """
    kappa, beta = (np.asarray(a, dtype=float)[..., None] for a in (curvature, crab))
    axis = rover.hubs[:, :2] + rover.steering_offset
    along, across = np.cos(beta) - kappa * axis[:, 1], np.sin(beta) + kappa * axis[:, 0]
    angle = np.arctan2(across, along)
    angle = angle - np.pi * np.round(angle / np.pi)
    return np.where(rover.steers, angle, 0.0)


def _continuous(rover: Rover, steering: Array, near: Array) -> Array:
    """Return steering (n, 6) shifted by half turns so that it stays continuous from `near` (6,)."""
    first = near + wrap_angle(2 * (steering[:1] - near)) / 2
    return np.where(rover.steers, np.unwrap(np.concatenate([first, steering[1:]]), axis=0, period=np.pi), 0.0)


def drive_rates(pose: Pose, at: PathSample, speed: float, differences: Array | None = None) -> dict[str, Array]:
    """Compute the rates of a pose that moves along its path.

    The wheels in contact neither leave nor enter the terrain (rows `lift` of `contact_rows`), and joints at a limit do not move.
    In contact mode these are six linear equations for the rates of z, roll, pitch, rocker and bogies, given those of x, y and
    yaw. Wheel rates are those without roll slip.

    Args:
        pose: (n,) poses.
        at: (n,) their stations.
        speed: horizontal speed along the path, m/s.
        differences: (n, 6) rates of z, roll, pitch, rocker and bogies to use where the equations are singular or not six.

    Returns:
        Variable of a run -> (n,), (n, 2) or (n, 6) per second. NaN if the pose is NaN, or if neither equations nor differences
        give its rates.
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
    held = by_rate[known, :, 2] if pose.report is None else _active_constraints(pose, by_rate[:, :, 2])[known]
    found = np.full((n, 6), np.nan)
    solved = solve_each(held[..., SOLVED], (-held[..., [0, 1, 5]] @ given[known, :, None])[..., 0])
    found[known] = solved if differences is None else np.where(np.isnan(solved), differences[known], solved)
    rates = np.empty((n, 9))
    rates[:, [0, 1, 5]], rates[:, SOLVED] = given, found
    rolled, slid = (np.einsum("nij,nj->ni", by_rate[:, :, row], rates) for row in (0, 1))  # m/s along and across each wheel
    names = ("x", "y", "z", "roll", "pitch", "yaw", "rocker")
    return {f"{name}_rate": rates[:, k] for k, name in enumerate(names)} | {
        "bogie_rate": rates[:, 7:],
        "wheel_rate": rolled / pose.rover.wheel_radius,
        "side_slip": slid,
    }


def _active_constraints(pose: Pose, lift: Array) -> Array:
    """Return the six constraints (n, 6, 9) of equilibrium poses; NaN if there are not six.

    Constraints are the wheels in contact and the joints at limits.
    `lift` (n, 6, 9) is the lift of each wheel by the rates of x, y, z, roll, pitch, yaw, rocker and bogies.
    """
    n = len(lift)
    joints = np.broadcast_to(np.eye(9)[6:], (n, 3, 9))
    active = np.concatenate([~pose.wheel_lifted, pose.joint_stop != 0], axis=1)
    six = np.asarray(active.sum(axis=1) == 6) & ~(pose.belly_support > 0)
    order = np.argsort(~active, axis=1, kind="stable")[:, :6, None]
    rows = np.take_along_axis(np.concatenate([lift, joints], axis=1), order, axis=1)
    return np.where(six[:, None, None], rows, np.nan)


def summary(status: NDArray[np.uint8], distance: Array) -> str:
    """Count the stations of a drive by status, in one sentence.

    Args:
        status: (n,) of the stations.
        distance: (n,) of the stations, m.

    Returns:
        The sentence.
    """
    parts = [f"{int((status == Status.CONVERGED).sum())} of {status.size} stations settled"]
    for code in Status:
        hit = status == code
        if code != Status.CONVERGED and hit.any():
            parts.append(f"{int(hit.sum())} {code.name} (first at {distance[np.argmax(hit)]:.2f} m)")
    return ", ".join(parts)


def to_csv(run: xr.Dataset, file: str | FilePath) -> None:
    """Write a run as CSV, one row per station.

    Columns are named `name [unit]`, `name_wheel [unit]` and so on. Numbers have all their digits: `read_log` and
    `read_columns` give back the same values.

    Args:
        run: Dataset over `time`, each variable with `units`.
        file: the file, overwritten.

    Raises:
        RockerbogieError: the file cannot be written.
    """
    columns = {}
    for name in ("time", "distance", *run.data_vars):
        if name not in run or run[name].dims[:1] != ("time",):
            continue
        variable = run[name]
        extra = [d for d in variable.dims if d != "time"]
        for labels in itertools.product(*(run[d].values for d in extra)):
            header = f"{'_'.join((str(name), *map(str, labels)))} [{variable.attrs.get('units', '')}]"
            columns[header] = variable.sel(dict(zip(extra, labels, strict=True))).values
    write_columns(file, columns)
