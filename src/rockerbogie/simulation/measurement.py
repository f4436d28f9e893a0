"""Dataset of a simulated run: pose, rates, contacts, slip and motor tracking."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..motion.body_twist import body_twist
from ..motion.drive import summary
from ..motion.jacobian import SimpleStance
from ..motion.slip import slip_ratio
from ..rover.frames import wheel_frames
from ..rover.model import Rover
from ..rover.rotations import euler_angles
from ..settling.dataset import TWIST_VARIABLES, VARIABLES, run_dataset
from ..settling.pose import Pose
from ..settling.status import Status
from ..terrain.heightfield import Terrain
from .rigid_body import Record

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: A wheel without contact force counts as lifted if its gap exceeds this, m. Below it, it is a hop.
LIFTED_GAP = 1e-3
#: Rate errors are means over this time, and start after it, s: the wheels first have to accelerate.
TRACKING_TIME = 1.0
#: Commands that need a larger side slip, as a share of the wheels' speed, cannot be driven as they are.
NEEDED_SLIP = 0.02
#: Wheels share an axle line if their hubs are this close in x, as a share of the wheelbase.
ONE_LINE = 0.05
#: A motor whose torque exceeds this share of its limit is at the limit.
AT_LIMIT = 0.999

#: Variables of a simulated run besides those of `drive`: dims, units, long name.
EXTRA = {
    **TWIST_VARIABLES,
    "wheel_angle": (("wheel",), "rad", "angle of the wheel against its link, forward positive"),
    "wheel_torque": (("wheel",), "N m", "torque of the hub motor, forward positive"),
    "roll_slip": (("wheel",), "m/s", "slip of the tread along the wheel's heading, positive if it moves further than it rolls"),
    "side_slip": (("wheel",), "m/s", "slip of the tread across the wheel's heading, to its left"),
    "slip_ratio": (("wheel",), "1", "rim speed minus hub speed along the wheel's heading, divided by the larger"),
    "contact_force": (("wheel",), "N", "force of the terrain on the wheel, along the contact normals"),
    "wheel_rate_command": (("wheel",), "rad/s", "commanded rate of the hub motor"),
    "steering_command": (("wheel",), "rad", "commanded angle of the steering motor"),
}


def measured_run(
    rover: Rover, terrain: Terrain, records: list[Record], torque_limit: Array, attrs: dict[str, object]
) -> xr.Dataset:
    """Return the Dataset of a simulated run.

    Args:
        rover: the rover.
        terrain: the map, for gaps and clearance.
        records: at least two.
        torque_limit: (6,) of the hub motors, N·m.
        attrs: attributes to add to those of the run and of `tracking`.

    Returns:
        Dataset over `time` with the variables of `drive` and `EXTRA`.
    """
    got = {name: np.array([getattr(record, name) for record in records]) for name in Record.__dataclass_fields__}
    time = got["time"] - got["time"][0]
    xyz, R = got["body_pose"][:, :3], _rotations(got["body_pose"][:, 3:])
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
    linear, w = got["body_velocity"][:, :3], got["body_velocity"][:, 3:]
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
    attrs = attrs | {"status_summary": summary(status, distance)} | tracking(time, got, torque_limit)
    run = run_dataset(rover, terrain, time, distance, values, attrs)
    twist = np.concatenate([np.einsum("nji,nj->ni", R, linear), w], axis=-1)
    measured = ("wheel_angle", "wheel_torque", "contact_force", "wheel_rate_command", "steering_command")
    more = {name: got[name] for name in measured}
    more |= dict(zip(EXTRA, twist.T, strict=False)) | _slip(rover, axle, got)
    return run.assign(
        {name: (("time", *dims), more[name], {"units": u, "long_name": text}) for name, (dims, u, text) in EXTRA.items()}
    )


def tracking(time: Array, got: dict[str, Array], torque_limit: Array) -> dict[str, float]:
    """Return how well the wheels kept their commanded rates.

    Args:
        time: (n,) s.
        got: `wheel_angle`, `wheel_angle_command`, `wheel_rate_command` and `wheel_torque` (n, 6).
        torque_limit: (6,) N·m.

    Returns:
        `torque_limit`, N·m, the largest; `torque_limited`, the share of records with a motor at its limit; `wheel_rate_error`,
        rad/s, the largest error of a wheel's rate in a mean over `TRACKING_TIME`; `wheel_rate_error_share`, the same divided by
        the largest commanded rate. The errors are NaN for runs shorter than 2 `TRACKING_TIME`, the share for parked wheels.
    """
    lag = got["wheel_angle_command"] - got["wheel_angle"]
    size = max(round(TRACKING_TIME / (time[1] - time[0])), 1)
    first = int(np.searchsorted(time, TRACKING_TIME - 1e-9))
    spans = lag[first:][size:] - lag[first:-size] if len(time) > first + size else np.zeros((0, 6))
    error = float(np.abs(spans).max() / (size * (time[1] - time[0]))) if spans.size else float("nan")
    fastest = float(np.abs(got["wheel_rate_command"]).max())
    at_limit = (np.abs(got["wheel_torque"]) >= AT_LIMIT * torque_limit).any(axis=1)
    return {
        "torque_limit": float(torque_limit.max()),
        "torque_limited": float(at_limit.mean()),
        "wheel_rate_error": error,
        "wheel_rate_error_share": error / fastest if fastest > 0 else float("nan"),
    }


def predicted_slip(rover: Rover, run: xr.Dataset) -> dict[str, tuple[tuple[str, ...], Array, dict[str, str]]]:
    """Return the slip that the Jacobians predict from the commands.

    Args:
        rover: the rover.
        run: simulated run.

    Returns:
        Variables `roll_slip_predicted` and `side_slip_predicted` (time, wheel), m/s, for `Dataset.assign`.
    """
    pose = SimpleStance(*(run[name].to_numpy() for name in ("rocker", "bogie", "contact_angle", "steering")))
    slip = body_twist(rover, pose, wheel_rates=run["wheel_rate_command"]).residual
    names = {"roll_slip": "along", "side_slip": "across"}
    return {
        f"{name}_predicted": (
            ("time", "wheel"),
            slip[..., k],
            {"units": "m/s", "long_name": f"slip {way} the wheel's heading, predicted from the commands"},
        )
        for k, (name, way) in enumerate(names.items())
    }


def warn_of_slip(rover: Rover, run: xr.Dataset) -> list[str]:
    """Warn if the commands of a run need side slip: no motion lets all wheels roll.

    Args:
        rover: the rover.
        run: simulated run with `side_slip_predicted`.

    Returns:
        The warning, or no warning.
    """
    side = run["side_slip_predicted"].to_numpy()
    rim = np.sqrt(np.mean((rover.wheel_radius * run["wheel_rate_command"].to_numpy()) ** 2))
    needed = float(np.sqrt(np.nanmean(side**2)))
    if not needed > NEEDED_SLIP * rim:
        return []
    fixed = np.unique(np.round(rover.hubs[~rover.steers, 0], 3))
    if len(fixed) and np.ptp(fixed) > ONE_LINE * rover.wheelbase:
        lines = ", ".join(f"{x:g}" for x in fixed)
        why = f"Its wheels that do not steer lie on several axle lines (x = {lines} m), so that no turn is free of slip"
    else:
        why = "The axles do not meet in one centre of turn: `wheel_commands` for the twist of `arc` gives angles that do"
    text = (
        f"these commands cannot be driven without slip: the wheels of {rover.name!r} slip sideways by about {1e3 * needed:.3g} "
        f"mm/s ({100 * needed / rim:.2g} % of their speed, RMS); expect it to turn less than commanded. {why}"
    )
    warnings.warn(text, stacklevel=3)
    return [text]


def _slip(rover: Rover, axle: Array, got: dict[str, Array]) -> dict[str, Array]:
    """Return the slip of each tread from MuJoCo's velocities and contacts.

    Args:
        rover: gives the wheel radii.
        axle: (n, 6, 4, 4) wheel frames in the world.
        got: records by their names.

    Returns:
        `roll_slip`, `side_slip`, m/s, and `slip_ratio` (n, 6); NaN without contact.
    """
    y, normal = axle[..., :3, 1], got["contact_normal"]
    forward = np.cross(y, normal)
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    hub, spin = got["wheel_motion"][..., :3], got["wheel_motion"][..., 3:]
    tread = hub + np.cross(spin, got["contact_point"] - axle[..., :3, 3])
    travel, rim = (hub * forward).sum(axis=-1), rover.wheel_radius * (spin * y).sum(axis=-1)
    side = (tread * np.cross(normal, forward)).sum(axis=-1)
    free = got["contact_force"] <= 0
    slip = {"roll_slip": travel - rim, "side_slip": side, "slip_ratio": slip_ratio(rim, travel)}
    return {name: np.where(free, np.nan, values) for name, values in slip.items()}


def _status(pose: Pose, hubs: Array, wheel_force: Array, body_force: Array, upright: Array) -> NDArray[np.uint8]:
    """Return the status of each record; if several apply, the most serious one.

    Args:
        pose: (n,) measured poses.
        hubs: (n, 6, 3) world, m.
        wheel_force: (n, 6) contact forces on the wheels, N.
        body_force: (n,) contact forces on the body's box, N.
        upright: (n,) cosine of the angle between the body's z and the vertical.

    Returns:
        (n,) `Status` codes.
    """
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


def _rotations(quaternion: Array) -> Array:
    """Return the rotation matrices of unit quaternions.

    Args:
        quaternion: (n, 4) w, x, y, z.

    Returns:
        (n, 3, 3).
    """
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternion[:, [1, 2, 3, 0]]).as_matrix())
