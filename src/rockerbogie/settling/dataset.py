"""Names, units and descriptions of the variables in an xarray.Dataset of poses or of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from .status import Status

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from ..rover.model import Rover
    from ..terrain.heightfield import Terrain

#: Variable -> (dims after the batch's, units, long name).
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "x": ((), "m", "x of the body's reference point"),
    "y": ((), "m", "y of the body's reference point"),
    "z": ((), "m", "height of the body's reference point"),
    "roll": ((), "rad", "roll of the body, left side up positive"),
    "pitch": ((), "rad", "pitch of the body, nose down positive"),
    "yaw": ((), "rad", "yaw of the body from +x, counter-clockwise"),
    "rocker": ((), "rad", "left rocker angle, nose down positive"),
    "bogie": (("side",), "rad", "bogie angle to its rocker, nose down positive"),
    "steering": (("wheel",), "rad", "steering angle, left turn positive"),
    "contact_angle": (("wheel",), "rad", "contact angle on the rim, ahead of the axle negative"),
    "contact_point": (("wheel", "axis"), "m", "contact point of the tread"),
    "gap": (("wheel",), "m", "least height of the tread above the terrain"),
    "clearance": ((), "m", "least height of the body above the terrain"),
    "status": ((), "1", "status code, see rockerbogie.Status"),
}

#: Further variables of poses in equilibrium mode.
EQUILIBRIUM_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "support": (("wheel",), "N", "frictionless contact force of the wheel"),
    "belly_support": ((), "N", "frictionless contact force on the body"),
    "wheel_lifted": (("wheel",), "1", "1 if the wheel is off the ground"),
    "joint_stop": (("joint",), "1", "-1 or 1 if the joint is at its low or high limit"),
}

#: Variables of a drive with its loads: of the forces that need the least friction.
LOAD_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "required_friction": ((), "1", "least friction coefficient that holds the rover"),
    "normal_force": (("wheel",), "N", "contact force along the contact normal"),
    "traction": (("wheel",), "N", "contact force along the heading of the wheel, forward positive"),
    "side_force": (("wheel",), "N", "contact force across the heading of the wheel, left positive"),
    "axle_torque": (("wheel",), "N m", "motor torque, forward positive"),
    "max_torque": ((), "N m", "largest motor torque of the six wheels"),
    "tip_margin": ((), "rad", "least angle by which gravity must turn until the rover tips over"),
    "load_status": ((), "1", "status code of the balance, see rockerbogie.LoadStatus"),
}

#: Variables whose rate a run holds as `<name>_rate`.
RATED = ("x", "y", "z", "roll", "pitch", "yaw", "rocker", "bogie", "contact_angle")
#: Variables of a run; one in equilibrium mode also holds `EQUILIBRIUM_VARIABLES`.
RUN_VARIABLES = (
    VARIABLES
    | {
        f"{name}_rate": (dims, f"{units}/s", f"rate of {text}")
        for name, (dims, units, text) in VARIABLES.items()
        if name in RATED
    }
    | {
        "wheel_rate": (("wheel",), "rad/s", "rate of the wheel relative to its link, forward positive"),
        "side_slip": (("wheel",), "m/s", "slip of the tread across the rolling direction, to the left"),
    }
)
#: Twist of the body, in its own axes, as simulated and predicted runs hold it.
TWIST_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "vx": ((), "m/s", "velocity of the body's reference point, forward"),
    "vy": ((), "m/s", "velocity of the body's reference point, to the left"),
    "vz": ((), "m/s", "velocity of the body's reference point, along the body's z"),
    "wx": ((), "rad/s", "angular velocity of the body about its x"),
    "wy": ((), "rad/s", "angular velocity of the body about its y"),
    "wz": ((), "rad/s", "angular velocity of the body about its z"),
}
#: Coordinates of the dims; those of `wheel` are the rover's wheel names.
AXES = {"side": ["left", "right"], "axis": ["x", "y", "z"], "joint": ["rocker", "bogie_left", "bogie_right"]}
DISTANCE = "horizontal distance along the path"

#: Key of a run's `encoding` that holds its (rover, terrain) in memory; files do not hold it.
SCENE = "rockerbogie_scene"


def run_dataset(
    rover: Rover, terrain: Terrain, time: Array, distance: Array, values: Mapping[str, NDArray[np.generic]], attrs: dict[str, Any]
) -> xr.Dataset:
    """Return the Dataset of a run.

    Args:
        rover, terrain: kept in `encoding` under `SCENE`; their names go into `attrs`.
        time: (n,) s.
        distance: (n,) horizontal distance, m.
        values: arrays (n, ...) by their names in `RUN_VARIABLES`, `EQUILIBRIUM_VARIABLES` and `LOAD_VARIABLES`; other names are
            left out.
        attrs: further attributes.

    Returns:
        Dataset over `time`, with coordinates `distance`, `wheel`, `side`, `axis` and, in equilibrium mode, `joint`.
    """
    import xarray as xr

    known = RUN_VARIABLES | EQUILIBRIUM_VARIABLES | LOAD_VARIABLES
    data: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]] = {
        name: (("time", *dims), _plain(values[name]), {"units": units, "long_name": text})
        for name, (dims, units, text) in known.items()
        if name in values
    }
    data["status"][2].update(flag_values=np.array(list(Status), dtype=np.uint8), flag_meanings=" ".join(s.name for s in Status))
    coords = {
        "time": ("time", time, {"units": "s", "long_name": "time since the start"}),
        "distance": ("time", distance, {"units": "m", "long_name": DISTANCE}),
        "wheel": list(rover.wheel_names),
        "side": AXES["side"],
        "axis": AXES["axis"],
    }
    if "joint_stop" in data:
        coords["joint"] = AXES["joint"]
    run = xr.Dataset(data, coords, {"rover": rover.name, "terrain": terrain.name, **attrs})
    run.encoding[SCENE] = (rover, terrain)
    return run


class PoseFields(Protocol):
    """Fields of a pose that `pose_dataset` reads beside the variables of `VARIABLES`."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape."""

    @property
    def rover(self) -> Rover:
        """The mechanism."""

    @property
    def terrain(self) -> Terrain:
        """The height field."""

    @property
    def report(self) -> Array | None:
        """Forces and flags in equilibrium mode, else None."""


def pose_dataset(pose: PoseFields) -> xr.Dataset:
    """Return the Dataset of `Pose.to_xarray`.

    Args:
        pose: (...) poses.

    Returns:
        Dataset with the batch axes as dims.
    """
    import xarray as xr

    n = len(pose.shape)
    batch = ("pose",) if n == 1 else tuple(f"pose_{k}" for k in range(n))
    held = VARIABLES if pose.report is None else VARIABLES | EQUILIBRIUM_VARIABLES
    data = {
        name: ((*batch, *dims), _plain(getattr(pose, name)), {"units": units, "long_name": text})
        for name, (dims, units, text) in held.items()
    }
    axes = ("side", "axis") if pose.report is None else ("side", "axis", "joint")
    coords = {"wheel": list(pose.rover.wheel_names)} | {name: AXES[name] for name in axes}
    return xr.Dataset(data, coords, {"rover": pose.rover.name, "terrain": pose.terrain.name})


def _plain(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return booleans as uint8, which netCDF files can hold; other arrays as they are."""
    return values.astype(np.uint8) if values.dtype == np.bool_ else values
