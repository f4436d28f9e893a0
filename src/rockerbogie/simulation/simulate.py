"""A drive in MuJoCo: six driven wheels on the same ground, under gravity, with friction. The second opinion on `drive`.

Of the kinematic model it takes where to let the rover down and how fast to ask each wheel to turn; what comes of it is MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..errors import PathError, RockerbogieError, expect
from ..motion.body_twist import body_twist
from ..motion.drive import ackermann, drive, summary
from ..motion.jacobian import SimpleStance
from ..motion.path import Path
from ..motion.slip import slip_ratio
from ..rotations import euler_angles, wrap_angle
from ..rover.frames import check_steering, wheel_frames
from ..rover.model import LOAD_ROVER, Rover
from ..settling.dataset import VARIABLES, run_dataset
from ..settling.pose import Pose
from ..settling.settle import settle
from ..settling.status import Status
from ..terrain.heightfield import Terrain
from .mjcf import Region, build_spec
from .rigid_body import Record, Rig

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: What drives: from the time, s, and the rig, wheel rates (6,), rad/s, and steering (6,), rad.
Driver = Callable[[float, Rig], tuple[Array, Array]]

#: The rover is let down from this far above its settled pose, m, and stands so long before it drives, s.
LET_DOWN, STAND = 2e-5, 0.5
#: The motors get new commands this often, s.
CONTROL_PERIOD = 0.02
#: Path feedback, for a wheelbase L: speed for distance behind, 1/s; curvature for heading off, 1/L, and for distance aside, 1/L².
ALONG_GAIN, YAW_GAIN, ACROSS_GAIN = 1.0, 4.0, 2.0
#: The most it asks for: this times the speed, and a curvature of this over L.
MOST_HASTE, MOST_BEND = 2.0, 2.0
#: A wheel that bears nothing counts as lifted when its tread is further than this from the ground, m: less is a hop.
LIFTED_GAP = 1e-3

#: What a simulated run holds besides a run's own variables: dims, units, long name.
EXTRA = {
    "vx": ((), "m/s", "velocity of the body's reference point, forward"),
    "vy": ((), "m/s", "velocity of the body's reference point, to the left"),
    "vz": ((), "m/s", "velocity of the body's reference point, along the body's upright"),
    "wx": ((), "rad/s", "angular velocity of the body about its x"),
    "wy": ((), "rad/s", "angular velocity of the body about its y"),
    "wz": ((), "rad/s", "angular velocity of the body about its z"),
    "wheel_angle": (("wheel",), "rad", "angle the wheel has turned against its link, forward positive"),
    "roll_slip": (("wheel",), "m/s", "slip of the tread along the wheel's way, further than rolled positive"),
    "side_slip": (("wheel",), "m/s", "slip of the tread across the wheel's way, to its left"),
    "slip_ratio": (("wheel",), "1", "rim's speed less the hub's along the wheel's way, as a share of the greater"),
    "contact_force": (("wheel",), "N", "force of the ground on the wheel, along the contact normals"),
    "wheel_rate_command": (("wheel",), "rad/s", "turning rate asked of the wheel's motor"),
    "steering_command": (("wheel",), "rad", "steering angle asked of the wheel's motor"),
}


def simulate(
    rover: Rover,
    terrain: Terrain,
    path: Path,
    speed: float = 0.02,
    *,
    interval: float = 0.1,
    friction: float = 0.8,
    commands: xr.Dataset | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Drive a rover along a path in MuJoCo.

    Each wheel is asked for the rate that `drive` finds at that place, and steered by the path's curvature, both corrected by
    where the rover is. On side slopes the body sways over wheels that hold their track, and wheels that do not steer skid through
    turns: compare at the simulation's own places (`compare`).

    Args:
        path: where to go. The rover must be able to stand at its start, and its wheels must stay on known ground.
        speed: along the path, seen from above, m/s, above 0.
        interval: between records, s; made a whole number of `CONTROL_PERIOD`.
        friction: coefficient of sliding friction between wheels and ground.
        commands: follow these instead, open loop, from the path's start until they end: a Dataset with `wheel_rate`, rad/s, and
            `steering`, rad, over (time, wheel), as `drive` and `simulate` give them; linear in between.
        progress: called with (records done, records in all) at every record.

    Returns:
        Dataset over `time` as from `drive` (docs/design.md), but measured: `distance` is what the body travelled over the map,
        `contact_point` and `contact_angle` are those of MuJoCo's greatest contact force on each wheel (nan in the air), `gap` and
        `clearance` those of the measured pose over the terrain itself, the rates MuJoCo's own. Besides: `vx` … `wz`, the body's
        twist in its own frame, and the rest of `EXTRA`. It ends early if the rover tips over or strays off the ground;
        `attrs["short_of_end"]` is how far from the path's end it stands then, m: on too little friction it does not get there.

    Raises:
        PathError: the rover cannot stand at the path's start, or the path leaves known ground; a speed that is not above 0.
        RoverError: the differential is beyond MuJoCo (see `to_mjcf`).
        TerrainError: more ground than a simulation holds.
        RockerbogieError: commands without wheel rates or steering; a simulation that became unstable.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(path, Path, "path", "make one with rockerbogie.Path.straight, arc, waypoints or from_arrays")
    if not (np.isfinite(speed) and speed > 0):
        raise PathError(f"speed is {speed} m/s; give one above 0 (to go backwards, give a path that faces back)")
    if not (np.isfinite(interval) and interval > 0):
        raise RockerbogieError(f"interval is {interval} s; give one above 0")
    if not (np.isfinite(friction) and friction >= 0):
        raise RockerbogieError(f"friction is {friction}; give a coefficient of 0 or more")
    _check_ground(rover, terrain, path)
    commanded = None if commands is None else commands.attrs.get("rover", rover.name)
    if commanded not in (None, rover.name):
        raise RockerbogieError(f"the commands are for rover {commanded!r}, not {rover.name!r}: its wheels are others")
    if commands is None:
        driver, duration, stray = _follower(rover, terrain, path, speed), path.length / speed, 0.0
    else:
        driver, duration, stray = _player(rover, commands)
    region = _surroundings(rover, terrain, path, stray)
    rig = Rig(rover, build_spec(rover, terrain, region=region, friction=friction).compile())
    rig.place(_start(rover, terrain, path), LET_DOWN)
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
    attrs = {
        "terrain": terrain.name,
        "path": path.description if commands is None else f"{duration:g} s of commands from the start of: {path.description}",
        "source": f"rockerbogie {__version__} simulate, MuJoCo {_mujoco_version()}",
        "rates": "measured in the simulation; contact_angle_rate by central differences",
        "friction": float(friction),
    }
    run = _measured(rover, terrain, records, attrs)
    if commands is None:
        end = path.sample(path.length)
        run.attrs |= {"speed": float(speed), "short_of_end": float(np.hypot(run["x"][-1] - end.x, run["y"][-1] - end.y))}
    return run if commands is None else run.assign(_predicted(rover, run))


def _mujoco_version() -> str:
    import mujoco

    return str(mujoco.__version__)


def _predicted(rover: Rover, run: xr.Dataset) -> dict[str, tuple[tuple[str, ...], Array, dict[str, str]]]:
    """The slip that the Jacobians expect of the commands where the rover stands: what six wheels cannot agree upon."""
    pose = SimpleStance(*(run[name].to_numpy() for name in ("rocker", "bogie", "contact_angle", "steering")))
    slip = body_twist(rover, pose, wheel_rates=run["wheel_rate_command"]).residual
    names = {"roll_slip": "along", "side_slip": "across"}
    return {
        f"{name}_predicted": (
            ("time", "wheel"),
            slip[..., k],
            {"units": "m/s", "long_name": f"slip {way} to expect of the commands"},
        )
        for k, (name, way) in enumerate(names.items())
    }


def _start(rover: Rover, terrain: Terrain, path: Path) -> Pose:
    at = path.sample(0.0)
    pose = settle(rover, terrain, at.x, at.y, at.yaw, steering=ackermann(rover, at.curvature, at.course - at.yaw))
    if not np.isfinite(pose.q).all():
        raise PathError(
            f"the rover does not settle at the path's start ({at.x:.10g}, {at.y:.10g}) m, {Status(int(pose.status)).name}: "
            "start elsewhere"
        )
    return pose


def _check_ground(rover: Rover, terrain: Terrain, path: Path) -> None:
    """The path's own places, wheels level: their fore and aft ends must all lie on known ground."""
    distance = np.linspace(0.0, path.length, 2 + int(path.length / min(terrain.spacing)))
    at = path.sample(distance)
    ends = np.concatenate([rover.hubs[:, :2] + np.outer(rover.wheel_radius, (side, 0)) for side in (-1, 1)])
    c, s = np.cos(at.yaw)[:, None], np.sin(at.yaw)[:, None]
    x, y = at.x[:, None] + c * ends[:, 0] - s * ends[:, 1], at.y[:, None] + s * ends[:, 0] + c * ends[:, 1]
    lost = np.isnan(terrain.height(x, y)).any(axis=1)
    if lost.any():
        k = int(np.argmax(lost))
        raise PathError(
            f"{distance[k]:.2f} m along the path, at ({at.x[k]:.10g}, {at.y[k]:.10g}) m, a wheel has no known ground under it: "
            f"keep within ({', '.join(f'{b:.10g}' for b in terrain.bounds)}) (xmin, ymin, xmax, ymax) and off its holes"
        )


def _surroundings(rover: Rover, terrain: Terrain, path: Path, stray: float) -> Region:
    """The ground the rover may come to: twice its own reach around the path, and `stray` m more, as far as there is any."""
    reach = stray + 2 * float((np.hypot(rover.hubs[:, 0], rover.hubs[:, 1]) + rover.wheel_radius + rover.wheel_width / 2).max())
    at = path.sample(np.linspace(0.0, path.length, 2 + int(path.length / rover.wheelbase * 10)))
    xmin, ymin, xmax, ymax = terrain.bounds
    low, high = (float(a.min()) - reach for a in (at.x, at.y)), (float(a.max()) + reach for a in (at.x, at.y))
    return max(next(low), xmin), max(next(low), ymin), min(next(high), xmax), min(next(high), ymax)


def _lost(rig: Rig, region: Region) -> bool:
    """Whether the rover lies on its side, or a hub is beyond the ground laid out."""
    xmin, ymin, xmax, ymax = region
    x, y, _ = rig.hubs.T
    return rig.upright <= 0 or not bool(((x >= xmin) & (x <= xmax) & (y >= ymin) & (y <= ymax)).all())


def _follower(rover: Rover, terrain: Terrain, path: Path, speed: float) -> Driver:
    """Follows the path: as fast as `drive` says each wheel turns there, with a pull back to where the rover should be by now.

    Wheels that do not steer roll true only about a centre beside them. Where they stand off the body's reference point, the body
    of a turning rover faces a little inward of its course, and is let do so.
    """
    plan = drive(rover, terrain, path, speed)
    planned = np.nan_to_num(plan["wheel_rate"].to_numpy(), nan=speed / float(rover.wheel_radius.mean()))
    planned_at = plan["distance"].to_numpy()
    size = rover.wheelbase
    fixed = 0.0 if rover.steers.all() else float(rover.hubs[~rover.steers, 0].mean())

    def follow(time: float, rig: Rig) -> tuple[Array, Array]:
        x, y, yaw = rig.heading
        due = min(speed * time, path.length)
        at = path.sample(due)
        c, s = np.cos(at.course), np.sin(at.course)
        ahead, across = c * (x - at.x) + s * (y - at.y), c * (y - at.y) - s * (x - at.x)
        inward = np.arctan(at.curvature * fixed)
        off = wrap_angle(yaw - at.yaw - inward)
        v = np.clip(speed - ALONG_GAIN * ahead, 0.0, MOST_HASTE * speed)
        bend = -np.clip(YAW_GAIN * off / size + ACROSS_GAIN * across / size**2, -MOST_BEND / size, MOST_BEND / size)
        angle = ackermann(rover, at.curvature + bend, at.course - at.yaw - inward)
        rate = np.array([np.interp(due + ahead, planned_at, column) for column in planned.T])
        swing = np.sin(angle) * rover.hubs[:, 0] - np.cos(angle) * rover.hubs[:, 1]  # of each hub along its way, per radian
        return v * (rate / speed + bend * swing / rover.wheel_radius), angle

    return follow


def _player(rover: Rover, commands: xr.Dataset) -> tuple[Driver, float, float]:
    """Plays recorded commands; how long they last, s, and how far they can take the rover, m."""
    missing = {"wheel_rate", "steering", "time"} - set(map(str, commands.variables))
    if missing:
        raise RockerbogieError(f"commands hold no {', '.join(sorted(missing))}; give wheel_rate and steering over (time, wheel)")
    time = commands["time"].to_numpy() - float(commands["time"][0])
    if any(set(commands[name].dims) != {"time", "wheel"} for name in ("wheel_rate", "steering")):
        raise RockerbogieError(f"commands have dims {tuple(commands.sizes)}; give wheel_rate and steering over (time, wheel)")
    rate, angle = (commands[name].transpose("time", "wheel").to_numpy() for name in ("wheel_rate", "steering"))
    if rate.shape[1] != 6 or not (np.isfinite(rate).all() and np.isfinite(angle).all()):
        raise RockerbogieError(f"commands have shape {rate.shape}; give six finite wheel rates and six finite angles a time")
    if len(time) < 2 or not (np.diff(time) > 0).all():
        raise RockerbogieError(f"commands hold {len(time)} times; give two or more, each later than the last, in seconds")
    check_steering(rover, angle)

    def play(now: float, rig: Rig) -> tuple[Array, Array]:
        rates, angles = (np.array([np.interp(now, time, column) for column in table.T]) for table in (rate, angle))
        return rates, angles

    travel = float(np.trapezoid(np.abs(rate * rover.wheel_radius).max(axis=1), time))
    return play, float(time[-1]), travel


def _measured(rover: Rover, terrain: Terrain, records: list[Record], attrs: dict[str, object]) -> xr.Dataset:
    """The run's Dataset from what was recorded."""
    got = {name: np.array([getattr(record, name) for record in records]) for name in Record.__dataclass_fields__}
    time = got["time"] - got["time"][0]
    xyz, R = got["place"][:, :3], _rotation(got["place"][:, 3:])
    roll, pitch, turned = euler_angles(R)
    yaw = np.unwrap(turned)
    q = np.stack([xyz[:, 2], roll, pitch, got["hinge"][:, 0], *got["hinge"][:, 2:].T], axis=-1)
    pose = Pose(rover, terrain, xyz[:, 0], xyz[:, 1], yaw, got["steering"], q, np.zeros(len(time), dtype=np.uint8))
    axle = pose.T_world_body[:, None] @ wheel_frames(rover, pose.rocker, pose.bogie, pose.steering)
    spoke = got["contact_point"] - axle[..., :3, 3]
    angle = np.arctan2(-(spoke * axle[..., :3, 0]).sum(axis=-1), -(spoke * axle[..., :3, 2]).sum(axis=-1))
    status = _status(pose, axle[..., :3, 3], got["contact_force"], got["body_force"], R[:, 2, 2])
    values = {name: getattr(pose, name) for name in VARIABLES}
    values |= {"contact_angle": angle, "contact_point": got["contact_point"], "status": status}
    linear, w = got["velocity"][:, :3], got["velocity"][:, 3:]
    swing = np.sin(roll) * w[:, 1] + np.cos(roll) * w[:, 2]
    values |= {f"{name}_rate": linear[:, k] for k, name in enumerate("xyz")}
    values |= {
        "roll_rate": w[:, 0] + np.tan(pitch) * swing,
        "pitch_rate": np.cos(roll) * w[:, 1] - np.sin(roll) * w[:, 2],
        "yaw_rate": swing / np.cos(pitch),
        "rocker_rate": got["hinge_rate"][:, 0],
        "bogie_rate": got["hinge_rate"][:, 2:],
        "contact_angle_rate": np.gradient(angle, time, axis=0),
        "wheel_rate": got["wheel_rate"],
    }
    distance = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))])
    attrs["status_summary"] = summary(status, distance)
    run = run_dataset(rover, terrain, time, distance, values, attrs)
    twist = np.concatenate([np.einsum("nji,nj->ni", R, linear), w], axis=-1)
    more = {name: got[name] for name in ("wheel_angle", "contact_force", "wheel_rate_command", "steering_command")}
    more |= dict(zip(EXTRA, twist.T, strict=False)) | _slip(rover, axle, got)
    return run.assign(
        {name: (("time", *dims), more[name], {"units": u, "long_name": text}) for name, (dims, u, text) in EXTRA.items()}
    )


def _slip(rover: Rover, axle: Array, got: dict[str, Array]) -> dict[str, Array]:
    """How each tread moves over the ground, of MuJoCo's own velocities and contacts; nan in the air."""
    y, normal = axle[..., :3, 1], got["contact_normal"]
    forward = np.cross(y, normal)
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    hub, spin = got["wheel_motion"][..., :3], got["wheel_motion"][..., 3:]
    tread = hub + np.cross(spin, got["contact_point"] - axle[..., :3, 3])
    travel, rim = (hub * forward).sum(axis=-1), rover.wheel_radius * (spin * y).sum(axis=-1)
    side = (tread * np.cross(normal, forward)).sum(axis=-1)
    in_air = got["contact_force"] <= 0
    slip = {"roll_slip": travel - rim, "side_slip": side, "slip_ratio": slip_ratio(rim, travel)}
    return {name: np.where(in_air, np.nan, values) for name, values in slip.items()}


def _status(pose: Pose, hubs: Array, wheel_force: Array, body_force: Array, upright: Array) -> NDArray[np.uint8]:
    """What can be seen of a moving rover: graver things last, so that they stand."""
    status = np.full(len(upright), Status.CONVERGED, dtype=np.uint8)
    limits = ((pose.rocker[:, None], pose.rover.rocker_limits), (pose.bogie, pose.rover.bogie_limits))
    for angle, (low, high) in limits:
        status[((angle <= low) | (angle >= high)).any(axis=-1)] = Status.JOINT_STOP
    status[((wheel_force <= 0) & (pose.gap > LIFTED_GAP)).any(axis=-1)] = Status.WHEEL_LIFTED
    status[body_force > 0] = Status.BELLY_CONTACT
    status[np.isnan(pose.gap).any(axis=-1)] = Status.NO_DATA
    low, high = np.reshape(pose.terrain.bounds, (2, 2))
    status[((hubs[..., :2] < low) | (hubs[..., :2] > high)).any(axis=(1, 2))] = Status.OFF_MAP
    status[upright <= 0] = Status.TIPPED
    return status


def _rotation(quaternion: Array) -> Array:
    """(..., 3, 3) from w, x, y, z (..., 4)."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
