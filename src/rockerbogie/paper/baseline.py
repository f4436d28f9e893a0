"""The paper's own way to settle, kept runnable as the named baseline: six equations (13) given to a general solver.

`settle` answers the same question exactly and some thousand times faster; this is what it is measured against.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import RockerbogieError
from ..rotations import body_transform
from ..rover.frames import ON_BOGIE, WHEEL_SIDE, wheel_frames
from ..rover.model import Rover
from ..settling.pose import Pose
from ..settling.status import Status
from ..terrain.heightfield import Terrain

Array = NDArray[np.float64]
Contact = Literal["hub", "point", "rim"]

RIM_POINTS = 23  # on the lower half of a rim
MOST_PASSES = 50  # at a contact angle, which its own place on the ground defines
SMALL = 1e-6  # rad, when such a pass has come to rest: the rim lies along the ground there, so 1e-13 m of height hang on it
TOLERANCE = 1e-6  # m, of an answer


def fsolve_settle(
    rover: Rover, terrain: Terrain, x: ArrayLike, y: ArrayLike, yaw: ArrayLike = 0.0, *,
    contact: Contact = "point", points: int = RIM_POINTS,
) -> Pose:  # fmt: skip
    """Settle thin-disc wheels by scipy's fsolve on eqs (13), one pose at a time, from level over the mean ground.

    Args:
        x, y, yaw: (...) as for `settle`. The wheels are not steered, their width and the joints' stops not known here.
        contact: "point", the paper's: each wheel touches at the contact angle of eqs (14)-(16). "rim": the least gap
            over so many points of the rim's lower half, as ground with more than one contact needs. "hub": a radius
            straight below the hub, the quickest there is, and right on level ground alone.
        points: of a rim. The gap between two is missed: 23 are good to some 0.3 mm, 2881 to a micrometre.

    Returns:
        Pose whose status is CONVERGED, OFF_MAP, NO_DATA or NOT_CONVERGED; all but the first are nan.
    """
    from scipy.optimize import fsolve

    if contact not in ("hub", "point", "rim"):
        raise RockerbogieError(f"contact {contact!r} is not known; give 'hub', 'point' or 'rim'")
    if points < 2:
        raise RockerbogieError(f"points is {points}; a rim wants 2 at least, its ends")
    px, py, heading = (np.array(a) for a in np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, yaw))))
    q = np.full((*px.shape, 6), np.nan)
    status = np.full(px.shape, Status.NOT_CONVERGED, dtype=np.uint8)
    for at in np.ndindex(px.shape):
        place = (float(px[at]), float(py[at]), float(heading[at]))

        def residual(u: Array, place: tuple[float, float, float] = place) -> Array:
            """Eqs (13): height of the ground less that of each contact, m."""
            if contact == "hub":
                point = _axles(rover, *place, u)[0] - rover.wheel_radius[:, None] * (0.0, 0.0, 1.0)
            else:
                point = _rim_points(rover, *place, u, points) if contact == "rim" else _contact_points(rover, terrain, *place, u)
            over = terrain.height(point[..., 0], point[..., 1]) - point[..., 2]
            return np.asarray(over.max(axis=-1) if contact == "rim" else over)

        start = np.zeros(6)
        under = terrain.height(*_axles(rover, *place, start)[0][:, :2].T)
        start[0] = (under - rover.hubs[:, 2] + rover.wheel_radius).mean()
        found = start
        if np.isfinite(start[0]):
            found, report, ended, _ = fsolve(residual, start, full_output=True, xtol=1e-12)
            if ended == 1 and np.abs(report["fvec"]).max() < TOLERANCE:
                q[at], status[at] = found, Status.CONVERGED
                continue
        status[at] = _why(rover, terrain, place, found)
    return Pose(rover, terrain, px, py, heading, np.broadcast_to(np.zeros(6), (*px.shape, 6)), q, status)


def paper_contact_angles(rover: Rover, pose: Pose, slope: ArrayLike) -> Array:
    """Contact angles (..., 6) of eqs (14)-(16), mended: δ = −atan Γ − pitch − the wheel's own suspension angle, rad.

    Args:
        slope: (..., 6) Γ, the ground's rise over run at each contact along its wheel's heading.
    """
    return -np.arctan(slope) - pose.pitch[..., None] - _suspension_angle(rover, pose.rocker, pose.bogie)


def _suspension_angle(rover: Rover, rocker: ArrayLike, bogie: ArrayLike) -> Array:
    """(..., 6) angle of the link that carries each wheel, nose down positive, rad."""
    arm = np.stack([np.asarray(rocker, dtype=float), rover.right_rocker(rocker)], axis=-1)[..., WHEEL_SIDE]
    return arm + np.where(ON_BOGIE, np.asarray(bogie, dtype=float)[..., WHEEL_SIDE], 0.0)


def _axles(rover: Rover, x: float, y: float, yaw: float, u: Array) -> tuple[Array, Array, Array]:
    """Hub, x axis and z axis (6, 3) of every axle in the world (eqs 2-4, 10) at u = z, roll, pitch, rocker, bogies."""
    T = body_transform(x, y, u[0], u[1], u[2], yaw) @ wheel_frames(rover, u[3], u[4:])
    return T[:, :3, 3], T[:, :3, 0], T[:, :3, 2]


def _contact_points(rover: Rover, terrain: Terrain, x: float, y: float, yaw: float, u: Array) -> Array:
    """(6, 3) contacts (eqs 5, 11) at the angles of eqs (14)-(16), each with the slope where it touches itself."""
    hub, forward, up = _axles(rover, x, y, yaw, u)
    level = u[2] + _suspension_angle(rover, u[3], u[4:])
    r = rover.wheel_radius[:, None]
    point, delta = hub, np.full(6, np.nan)
    for _ in range(MOST_PASSES):
        slope = terrain.gradient(point[:, 0], point[:, 1]) @ (np.cos(yaw), np.sin(yaw))
        before, delta = delta, -np.arctan(slope) - level
        point = hub - r * (np.sin(delta)[:, None] * forward + np.cos(delta)[:, None] * up)
        if not np.abs(delta - before).max() > SMALL and np.isfinite(before).all():
            break
    return point


def _rim_points(rover: Rover, x: float, y: float, yaw: float, u: Array, points: int) -> Array:
    """(6, points, 3) points of the rims' lower halves."""
    hub, forward, up = _axles(rover, x, y, yaw, u)
    angle = np.linspace(-np.pi / 2, np.pi / 2, points)[:, None]
    radial = np.sin(angle) * forward[:, None] + np.cos(angle) * up[:, None]
    return hub[:, None] - rover.wheel_radius[:, None, None] * radial


def _why(rover: Rover, terrain: Terrain, place: tuple[float, float, float], u: Array) -> Status:
    """What stopped the solver at u."""
    at = np.where(np.isfinite(u), u, 0.0)
    px, py = _rim_points(rover, *place, at, RIM_POINTS)[..., :2].reshape(-1, 2).T
    xmin, ymin, xmax, ymax = terrain.bounds
    if not ((px >= xmin) & (px <= xmax) & (py >= ymin) & (py <= ymax)).all():
        return Status.OFF_MAP
    return Status.NO_DATA if np.isnan(terrain.height(px, py)).any() else Status.NOT_CONVERGED
