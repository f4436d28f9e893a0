"""Drives in MuJoCo: rigid-body dynamics with gravity and friction, to check `drive`.

The kinematic model gives the start pose and the wheel rates to command. Everything else is MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import is_number
from ..errors import PathError, RockerbogieError, expect
from ..files.version import __version__
from ..motion.drive import ackermann, drive
from ..motion.path import Path
from ..rover.model import LOAD_ROVER, Rover
from ..settling.pose import Pose
from ..settling.settle import settle
from ..settling.status import Status
from ..terrain.heightfield import Terrain
from .drivers import Driver, command_driver, path_driver
from .height_field import Region
from .measurement import measured_run, predicted_slip, warn_of_slip
from .mjcf import build_spec
from .motors import torque_limits
from .rigid_body import Rig

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: The rover starts this far above its settled pose, m, and stands for this time before it drives, s.
START_LIFT, STAND = 2e-5, 0.5
#: Time between commands to the motors, s.
CONTROL_PERIOD = 0.02
#: Largest number of control periods of a simulation.
MOST_TICKS = 5_000_000
LOAD_TERRAIN = "make one with rockerbogie.Terrain.from_array, from_raster or rockerbogie.surfaces"
MAKE_PATH = "make one with rockerbogie.Path.straight, arc, waypoints or from_arrays"


def simulate(
    rover: Rover,
    terrain: Terrain,
    path: Path,
    speed: float = 0.02,
    *,
    interval: float = 0.1,
    friction: float = 0.8,
    torque: ArrayLike | None = None,
    load_sharing: bool = True,
    commands: xr.Dataset | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Drive a rover along a path in MuJoCo.

    Each wheel is commanded to the rate that `drive` finds at the rover's position, and steered by the path's curvature. Both are
    corrected by the rover's position and heading. On side slopes the body moves aside over wheels that hold their track, and
    wheels that do not steer slide through turns: compare at the simulation's own x, y and yaw (`compare`).

    Args:
        rover: the rover.
        terrain: the map. The wheels must stay on terrain with data.
        path: the path. The rover must settle at its start.
        speed: horizontal speed along the path, m/s, above 0.
        interval: time between records, s; rounded to a multiple of `CONTROL_PERIOD`.
        friction: coefficient of sliding friction between wheels and terrain.
        torque: torque limit of the hub motors, a number or (6,), N·m. Default: the rover's `wheel_torque`; where
            that is not known, 0.4 m g r (`motors.TORQUE_SHARE`).
        load_sharing: trim the wheel rates, by 10 % at most, so that the six torques become more equal. Without it, wheels whose
            rates do not agree exactly work against each other up to the friction limit. Recorded commands are never trimmed.
        commands: play these instead, open loop, from the path's start until they end: a Dataset with `wheel_rate`, rad/s, and
            `steering`, rad, over (time, wheel), as `drive` and `simulate` return them; linear in between.
        progress: called with (records done, records in all) at every record.

    Returns:
        Dataset over `time` as from `drive` (docs/design.md), but measured. `distance` is the body's horizontal distance,
        `contact_point` and `contact_angle` those of MuJoCo's largest contact force on each wheel (NaN without contact), `gap` and
        `clearance` those of the measured pose over the terrain itself, the rates MuJoCo's own. In addition `vx` … `wz`, the
        body's twist in its own frame, and the rest of `measurement.EXTRA`. The run ends early if the rover tips over or leaves
        the map.
        Attributes: `short_of_end` is the distance of the last position from the path's end, m; `wheel_rate_error`,
        `wheel_rate_error_share`, `torque_limited` and `torque_limit` describe the motors (`measurement.tracking`). With
        `commands`, `warnings` states if they cannot be driven without slip; a UserWarning does so too.

    Raises:
        PathError: the rover does not settle at the path's start; the path leaves terrain with data; a speed that is not above 0.
        RoverError: a differential that MuJoCo cannot represent (see `to_mjcf`).
        TerrainError: terrain with too many nodes.
        RockerbogieError: an argument of a wrong type or value; a simulation that became unstable.
    """
    _check_scene(rover, terrain, path)
    settings = {"interval": interval, "friction": friction, "torque": torque, "progress": progress}
    _check_settings(rover, interval, friction, torque)
    if commands is not None:
        import xarray as xr

        expect(commands, xr.Dataset, "commands", "give a Dataset with wheel_rate and steering, as drive returns it")
        driver, duration, travel = command_driver(rover, commands)
        start = _settled_start(rover, terrain, path)
        what = f"{duration:g} s of commands from the start of: {path.description}"
        run = _simulate(start, path, driver, duration, travel, what, **settings)  # type: ignore[arg-type]
        run = run.assign(predicted_slip(rover, run))
        return run.assign_attrs(warnings="\n".join(warn_of_slip(rover, run)))
    if not (is_number(speed) and speed > 0):
        raise PathError(f"speed is {speed!r:.60} m/s; give one above 0 (to drive backwards, give a path whose yaw points back)")
    return simulate_plan(rover, terrain, path, drive(rover, terrain, path, speed), load_sharing=load_sharing, **settings)  # type: ignore[arg-type]


def simulate_plan(
    rover: Rover,
    terrain: Terrain,
    path: Path,
    plan: xr.Dataset,
    *,
    interval: float = 0.1,
    friction: float = 0.8,
    torque: ArrayLike | None = None,
    load_sharing: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Drive a rover along a path in MuJoCo, with the wheel rates of a run that is already known.

    Args:
        plan: run of `drive` for this rover, terrain and path.
        rover, terrain, path, interval, friction, torque, load_sharing, progress: as for `simulate`.

    Returns:
        Dataset, as `simulate`.

    Raises:
        PathError, RoverError, TerrainError, RockerbogieError: as for `simulate`.
    """
    _check_scene(rover, terrain, path)
    _check_settings(rover, interval, friction, torque)
    first = plan.isel(time=0)
    q = np.array([first[name] for name in ("z", "roll", "pitch", "rocker")] + list(first["bogie"].to_numpy()))
    x, y, yaw = (np.asarray(float(first[name])) for name in ("x", "y", "yaw"))
    start = Pose(rover, terrain, x, y, yaw, first["steering"].to_numpy(), q, first["status"].to_numpy())
    speed = float(plan.attrs["speed"])
    driver = path_driver(rover, path, plan, load_sharing)
    run = _simulate(
        start, path, driver, path.length / speed, 0.0, path.description,
        interval=interval, friction=friction, torque=torque, progress=progress,
    )  # fmt: skip
    end = path.sample(path.length)
    short = float(np.hypot(run["x"][-1] - end.x, run["y"][-1] - end.y))
    return run.assign_attrs(speed=speed, short_of_end=short, load_sharing=int(load_sharing))


def _simulate(
    start: Pose,
    path: Path,
    driver: Driver,
    duration: float,
    travel: float,
    what: str,
    *,
    interval: float,
    friction: float,
    torque: ArrayLike | None,
    progress: Callable[[int, int], None] | None,
) -> xr.Dataset:
    """Run the simulation.

    Args:
        start: one settled pose, with the rover and the terrain.
        path: the path.
        driver: gives the commands.
        duration: time to drive, s.
        travel: largest distance that the driver can move the rover from the path, m.
        what: description of the path.
        interval, friction, torque, progress: as for `simulate`.

    Returns:
        The measured run.
    """
    rover, terrain = start.rover, start.terrain
    if not duration / CONTROL_PERIOD <= MOST_TICKS:
        raise RockerbogieError(
            f"the drive takes {duration:.3g} s, longer than {MOST_TICKS * CONTROL_PERIOD:,.0f} s: give a higher speed or "
            "shorter commands"
        )
    if not np.isfinite(start.q).all():
        raise PathError(
            f"the rover does not settle at the path's start ({float(start.x):.10g}, {float(start.y):.10g}) m, "
            f"{Status(int(start.status)).name}: start elsewhere"
        )
    region = _surroundings(rover, terrain, path, travel)
    rig = Rig(rover, build_spec(rover, terrain, region=region, friction=friction, torque=torque).compile())
    rig.place(start, START_LIFT)
    rig.command(np.zeros(6), driver(0.0, rig)[1])
    rig.step(STAND)
    ticks = max(round(interval / CONTROL_PERIOD), 1)
    count = max(int(duration / (ticks * CONTROL_PERIOD) + 1e-9), 1)
    records = [rig.record()]
    for k in range(1, count + 1):
        for _ in range(ticks):
            rig.command(*driver(rig.data.time - STAND, rig))
            rig.step(CONTROL_PERIOD)
        records.append(rig.record())
        if progress is not None:
            progress(k, count)
        if _lost(rig, region):
            break
    attrs: dict[str, object] = {
        "terrain": terrain.name,
        "path": what,
        "source": f"rockerbogie {__version__} simulate, MuJoCo {_mujoco_version()}",
        "rates": "measured in the simulation; contact_angle_rate by central differences",
        "friction": float(friction),
    }
    return measured_run(rover, terrain, records, rig.torque_limit, attrs)


def _mujoco_version() -> str:
    """Return MuJoCo's version."""
    import mujoco

    return str(mujoco.__version__)


def _check_scene(rover: Rover, terrain: Terrain, path: Path) -> None:
    """Check rover, terrain and path, and that the path lies on terrain with data.

    Args:
        rover, terrain, path: as for `simulate`.

    Raises:
        RockerbogieError: an argument of a wrong type.
        PathError: a wheel leaves the map or terrain with data.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(terrain, Terrain, "terrain", LOAD_TERRAIN)
    expect(path, Path, "path", MAKE_PATH)
    _check_terrain(rover, terrain, path)


def _check_settings(rover: Rover, interval: float, friction: float, torque: ArrayLike | None) -> None:
    """Check the numbers of a simulation.

    Args:
        rover, interval, friction, torque: as for `simulate`.

    Raises:
        RockerbogieError: a number that is out of its range.
    """
    if not (is_number(interval) and interval > 0):
        raise RockerbogieError(f"interval is {interval!r:.60} s; give one above 0")
    if not (is_number(friction) and friction >= 0):
        raise RockerbogieError(f"friction is {friction!r:.60}; give a coefficient of 0 or more")
    torque_limits(rover, torque)


def _settled_start(rover: Rover, terrain: Terrain, path: Path) -> Pose:
    """Return the settled pose at the path's start; NaN if there is none.

    Args:
        rover, terrain, path: as for `simulate`.

    Returns:
        One pose.
    """
    at = path.sample(0.0)
    return settle(rover, terrain, at.x, at.y, at.yaw, steering=ackermann(rover, at.curvature, at.course - at.yaw))


def _check_terrain(rover: Rover, terrain: Terrain, path: Path) -> None:
    """Check that all wheels lie on terrain with data along the path.

    The front and rear ends of the wheels are checked, at joint angles 0.

    Args:
        rover, terrain, path: as for `simulate`.

    Raises:
        PathError: a wheel leaves the map or terrain with data.
    """
    distance = np.linspace(0.0, path.length, 2 + int(path.length / min(terrain.spacing)))
    at = path.sample(distance)
    ends = np.concatenate([rover.hubs[:, :2] + np.outer(rover.wheel_radius, (side, 0)) for side in (-1, 1)])
    c, s = np.cos(at.yaw)[:, None], np.sin(at.yaw)[:, None]
    x, y = at.x[:, None] + c * ends[:, 0] - s * ends[:, 1], at.y[:, None] + s * ends[:, 0] + c * ends[:, 1]
    lost = np.isnan(terrain.height(x, y)).any(axis=1)
    if lost.any():
        k = int(np.argmax(lost))
        raise PathError(
            f"{distance[k]:.2f} m along the path, at ({at.x[k]:.10g}, {at.y[k]:.10g}) m, a wheel is over missing data or off "
            f"the map: keep within ({', '.join(f'{b:.10g}' for b in terrain.bounds)}) (xmin, ymin, xmax, ymax)"
        )


def _surroundings(rover: Rover, terrain: Terrain, path: Path, travel: float) -> Region:
    """Return the part of the map that the rover may reach.

    It extends twice the rover's size, plus `travel`, around the path.

    Args:
        rover, terrain, path: as for `simulate`.
        travel: m.

    Returns:
        (xmin, ymin, xmax, ymax), m, within the map.
    """
    reach = travel + 2 * float((np.hypot(rover.hubs[:, 0], rover.hubs[:, 1]) + rover.wheel_radius + rover.wheel_width / 2).max())
    at = path.sample(np.linspace(0.0, path.length, 2 + int(path.length / rover.wheelbase * 10)))
    xmin, ymin, xmax, ymax = terrain.bounds
    low, high = (float(a.min()) - reach for a in (at.x, at.y)), (float(a.max()) + reach for a in (at.x, at.y))
    return max(next(low), xmin), max(next(low), ymin), min(next(high), xmax), min(next(high), ymax)


def _lost(rig: Rig, region: Region) -> bool:
    """Return True if the rover lies on its side, or a hub is outside the simulated terrain.

    Args:
        rig: the simulated rover.
        region: (xmin, ymin, xmax, ymax), m.

    Returns:
        True if the simulation must end.
    """
    xmin, ymin, xmax, ymax = region
    x, y, _ = rig.hubs.T
    return rig.upright <= 0 or not bool(((x >= xmin) & (x <= xmax) & (y >= ymin) & (y <= ymax)).all())
