"""Names, units and long names of what is put into an xarray.Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .status import Status

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from ..rover.model import Rover
    from ..terrain.heightfield import Terrain

Array = NDArray[np.float64]

#: Variable: (its own dims behind the batch's, units, long name).
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "x": ((), "m", "x of the body's reference point"),
    "y": ((), "m", "y of the body's reference point"),
    "z": ((), "m", "height of the body's reference point"),
    "roll": ((), "rad", "roll of the body, left side up positive"),
    "pitch": ((), "rad", "pitch of the body, nose down positive"),
    "yaw": ((), "rad", "heading of the body from +x, counter-clockwise"),
    "rocker": ((), "rad", "left rocker angle, nose down positive"),
    "bogie": (("side",), "rad", "bogie angle to its rocker, nose down positive"),
    "steering": (("wheel",), "rad", "steering angle, left turn positive"),
    "contact_angle": (("wheel",), "rad", "contact angle on the rim, ahead of the axle negative"),
    "contact_point": (("wheel", "axis"), "m", "touching point of the tread"),
    "gap": (("wheel",), "m", "least height of the tread above the ground"),
    "clearance": ((), "m", "least height of the body above the ground"),
    "status": ((), "1", "status code, see rockerbogie.Status"),
}

#: Variables whose rate a run holds beside them, as `<name>_rate`.
RATED = ("x", "y", "z", "roll", "pitch", "yaw", "rocker", "bogie", "contact_angle")
RUN_VARIABLES = (
    VARIABLES
    | {
        f"{name}_rate": (dims, f"{units}/s", f"rate of {text}")
        for name, (dims, units, text) in VARIABLES.items()
        if name in RATED
    }
    | {
        "wheel_rate": (("wheel",), "rad/s", "turning rate of the wheel against its link, forward positive"),
        "side_slip": (("wheel",), "m/s", "slip of the tread across the wheel's way, to its left"),
    }
)


#: Where a run's Dataset keeps its (rover, terrain) while it is in memory; files do not hold it.
SCENE = "rockerbogie_scene"


def run_dataset(
    rover: Rover, terrain: Terrain, time: Array, distance: Array, values: Mapping[str, NDArray[np.generic]], attrs: dict[str, Any]
) -> xr.Dataset:
    """The Dataset of a run: `values` (time, ...) by their names in `RUN_VARIABLES`, over time (n,) s and distance (n,) m."""
    import xarray as xr

    data: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]] = {
        name: (("time", *dims), values[name], {"units": units, "long_name": text})
        for name, (dims, units, text) in RUN_VARIABLES.items()
        if name in values
    }
    data["status"][2].update(flag_values=np.array(list(Status), dtype=np.uint8), flag_meanings=" ".join(s.name for s in Status))
    coords = {
        "time": ("time", time, {"units": "s", "long_name": "time since the start"}),
        "distance": ("time", distance, {"units": "m", "long_name": "distance along the path"}),
        "wheel": list(rover.wheel_names),
        "side": ["left", "right"],
        "axis": ["x", "y", "z"],
    }
    run = xr.Dataset(data, coords, {"rover": rover.name, "terrain": terrain.name, **attrs})
    run.encoding[SCENE] = (rover, terrain)
    return run


class PoseFields(Protocol):
    """The fields of a pose that a Dataset describes; its variables are read by their names in `VARIABLES`."""

    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def rover(self) -> Rover: ...
    @property
    def terrain(self) -> Terrain: ...


def pose_dataset(pose: PoseFields) -> xr.Dataset:
    """The Dataset of `Pose.to_xarray`."""
    import xarray as xr

    n = len(pose.shape)
    batch = ("pose",) if n == 1 else tuple(f"pose_{k}" for k in range(n))
    data = {
        name: ((*batch, *dims), getattr(pose, name), {"units": units, "long_name": text})
        for name, (dims, units, text) in VARIABLES.items()
    }
    coords = {"wheel": list(pose.rover.wheel_names), "side": ["left", "right"], "axis": ["x", "y", "z"]}
    return xr.Dataset(data, coords, {"rover": pose.rover.name, "terrain": pose.terrain.name})
