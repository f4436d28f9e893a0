"""Predicted slip on planes, by slope and heading, from the balance of the whole rover."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arrays import Array
from ...rover.model import Rover
from ...terrain.heightfield import Terrain
from ...terrain.soil.laws import Grousers, WheelLaw
from ..path import Path
from .predict import predict

#: Cells of the terrain per reach of the rover.
CELLS = 4
#: Commanded distance, m. Only the motion at its start counts.
DISTANCE = 0.01


class PlaneSlip(NamedTuple):
    """Motion on planes, each array (soils, slopes, headings)."""

    slip: Array  # 1 - speed along the heading / rim speed; above 1 where the rover slides back; NaN without a motion
    drift: Array  # rad, angle on the plane from the heading to the direction of travel, to the left
    end: NDArray[np.uint8]  # `DriveEnd`: reason for which there is no motion


def plane_slip(
    rover: Rover, soils: Sequence[str | WheelLaw], slopes: Array, headings: Array, gravity: float,
    grousers: Grousers | float | None = None, torque: ArrayLike | None = None,
) -> PlaneSlip:  # fmt: skip
    """Predict the slip of a rover that drives straight on planes.

    The motion is quasi-static: pose and commands determine it. So slip is that at the start of a drive, at the exact heading.

    Args:
        rover: the rover, with masses.
        soils: (k,) names or laws.
        slopes: (n,) angles of the steepest ascent, rad, from 0 to below π/2.
        headings: (m,) angles on the plane from uphill, rad, positive to the left.
        gravity: m/s².
        grousers, torque: as for `predict`.

    Returns:
        Slip, drift and reasons, (k, n, m) each.

    Raises:
        RockerbogieError: as `predict`.
    """
    terrain, centres = planes(rover, slopes)
    sine, cosine = np.sin(headings), np.cos(headings)
    starts = np.zeros((len(slopes), len(headings), 1, 3))
    starts[..., 0, 1] = centres[:, None]
    starts[..., 0, 2] = np.arctan2(sine, cosine * np.cos(slopes)[:, None])
    path = Path.straight((0.0, 0.0), 0.0, DISTANCE)
    run = predict(
        rover, terrain, starts, path, soil=list(soils), grousers=grousers, torque=torque, gravity=gravity, step=DISTANCE,
        details=False,
    )  # fmt: skip
    first = run.isel(time=0)
    up = np.stack([np.cos(slopes), np.zeros_like(slopes), np.sin(slopes)], axis=-1)[:, None]
    left = np.array([0.0, 1.0, 0.0])
    velocity = np.stack([first[f"{axis}_rate"].to_numpy() for axis in "xyz"], axis=-1)
    uphill = (velocity * up[:, None]).sum(axis=-1)
    across = (velocity * left).sum(axis=-1)
    ahead = cosine[:, None] * uphill + sine[:, None] * across
    aside = cosine[:, None] * across - sine[:, None] * uphill
    rim = (first["wheel_rate"].to_numpy() * rover.wheel_radius).mean(axis=-1)
    slip = 1.0 - ahead / np.where(rim > 0.0, rim, np.nan)
    parts = (slip, np.arctan2(aside, ahead), run["end"].to_numpy())
    return PlaneSlip(*(np.moveaxis(part, -1, 0) for part in parts))


def planes(rover: Rover, slopes: Array) -> tuple[Terrain, Array]:
    """Return a terrain of parallel strips, one plane each, which rise along x.

    Args:
        rover: the rover; each strip is wide enough for it at any yaw.
        slopes: (n,) angles, rad.

    Returns:
        The terrain, and y of the middle of each strip (n,), m; x = 0 is in its middle.
    """
    reach = float(np.hypot(rover.hubs[:, 0], rover.hubs[:, 1]).max() + rover.wheel_radius.max() + rover.wheel_width.max())
    spacing = 2.0 * reach / CELLS
    half, per = CELLS, 2 * CELLS + 1
    x = spacing * np.arange(-half, half + 1)
    heights = np.repeat(np.tan(slopes), per)[:, None] * x
    terrain = Terrain.from_array(heights, spacing, origin=(float(x[0]), 0.0), interpolation="linear", name="planes")
    return terrain, np.asarray(spacing * (per * np.arange(len(slopes)) + half))
