"""Climb over a profile as a run on terrain, with one record for each station."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...settling.dataset import run_dataset
from ...settling.status import Status
from ...statics.climb import Climb
from ...terrain.heightfield import Terrain

if TYPE_CHECKING:
    import xarray as xr

#: Number of cells along the profile; a vertical face is drawn within one of them.
CELLS = 1500
#: Speed of the replay, m/s: a climb is quasi-static and has none.
SPEED = 0.1


def climb_run(climb: Climb) -> xr.Dataset:
    """Return a climb as a run, up to the station at which it ends.

    Args:
        climb: from `rockerbogie.climb`.

    Returns:
        Dataset as of `drive`, with required friction and torque, on the profile extruded to both sides.
    """
    last = climb.station + 1 if climb.limit else climb.distance.size
    rover, n = climb.rover, last
    reach = float(np.abs(rover.hubs[:, 1]).max() + rover.wheel_width.max() + rover.wheel_radius.max())
    room = rover.wheelbase
    low = min(float(climb.contact_point[:last, :, 0].min()), float(climb.profile.x.min())) - room
    high = max(float(climb.contact_point[:last, :, 0].max()), float(climb.profile.x.max())) + room
    x = np.linspace(low, high, CELLS + 1)
    z = np.tile(np.interp(x, climb.profile.x, climb.profile.z), (5, 1))
    terrain = Terrain.from_array(
        z, ((high - low) / CELLS, reach / 1.5), (low, -reach / 0.75), interpolation="linear", name=climb.profile.name
    )
    back = climb.direction == "backward"  # the rover then faces against x
    side = -rover.hubs[:, 1] if back else rover.hubs[:, 1]
    contact = np.insert(climb.contact_point[:last], 1, np.broadcast_to(side, (n, 6)), axis=2)
    yaw = np.full(n, np.pi if back else 0.0)
    values = {
        "x": climb.x[:last], "y": np.zeros(n), "z": climb.z[:last], "roll": np.zeros(n), "pitch": climb.pitch[:last], "yaw": yaw,
        "rocker": np.zeros(n), "bogie": np.repeat(climb.bogie[:last, None], 2, axis=1), "steering": np.zeros((n, 6)),
        "contact_point": contact, "gap": np.zeros((n, 6)),
        "wheel_rate": np.broadcast_to((-SPEED if back else SPEED) / rover.wheel_radius, (n, 6)),
        "status": np.full(n, int(Status.CONVERGED), dtype=np.uint8),
        "required_friction": np.where(np.isfinite(climb.required_friction[:last]), climb.required_friction[:last], np.nan),
        "max_torque": np.where(np.isfinite(climb.required_torque[:last]), climb.required_torque[:last], np.nan),
    }  # fmt: skip
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(climb.distance[:last])))])
    attrs = {"source": "rockerbogie climb", "speed": SPEED, "verdict": climb.verdict}
    return run_dataset(rover, terrain, travel / SPEED, travel, values, attrs)
