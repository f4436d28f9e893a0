"""Names, units and long names of what is put into an xarray.Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from .pose import Pose

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


def pose_dataset(pose: Pose) -> xr.Dataset:
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
