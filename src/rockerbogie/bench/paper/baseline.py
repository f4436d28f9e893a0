"""Baseline: the paper's settling method, six equations (13) given to a general solver.

`settle` solves the same problem exactly and about a thousand times faster. This module is its reference for speed and for
the paper's approximations.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import RockerbogieError
from ...rover.frames import ON_BOGIE, WHEEL_SIDE, wheel_frames
from ...rover.model import Rover
from ...rover.rotations import body_transform
from ...settling.pose import Pose
from ...settling.status import Status
from ...terrain.heightfield import Terrain

Array = NDArray[np.float64]
Contact = Literal["hub", "point", "rim"]

RIM_POINTS = 23  # number of points on the lower half of a rim
MOST_PASSES = 50  # of the fixed-point iteration for a contact angle
SMALL = 1e-6  # rad: last change of a contact angle; it changes the contact's height by 1e-13 m, as the rim is tangent there
TOLERANCE = 1e-6  # m: greatest residual of a solution


def fsolve_settle(
    rover: Rover, terrain: Terrain, x: ArrayLike, y: ArrayLike, yaw: ArrayLike = 0.0, *,
    contact: Contact = "point", points: int = RIM_POINTS,
) -> Pose:  # fmt: skip
    """Settle thin-disc wheels with scipy's `fsolve` on eqs (13), one pose at a time.

    The start is the body with all angles 0 at the mean height of the terrain below the hubs. Wheel width, steering and
    joint limits are ignored.

    Args:
        rover: the rover.
        terrain: the terrain.
        x: (...) m; x, y and yaw broadcast.
        y: (...) m.
        yaw: (...) rad.
        contact: "point": each wheel has one contact, at the angle of eqs (14)-(16), as in the paper. "rim": the gap is the
            minimum over `points` of the lower half of the rim, for terrain with more than one contact per wheel. "hub": the
            contact lies one radius below the hub; fastest, and correct on horizontal terrain only.
        points: number of rim points. Minima between two of them are missed: 23 points are accurate to about 0.3 mm, 2881 to
            1e-6 m.

    Returns:
        Pose (...) whose status is CONVERGED, OFF_MAP, NO_DATA or NOT_CONVERGED. Poses that are not CONVERGED are NaN.

    Raises:
        RockerbogieError: an unknown `contact`, or fewer than 2 points.
    """
    from scipy.optimize import fsolve

    if contact not in ("hub", "point", "rim"):
        raise RockerbogieError(f"contact {contact!r} is not known; give 'hub', 'point' or 'rim'")
    if points < 2:
        raise RockerbogieError(f"points is {points}; give at least 2, the ends of the lower half of the rim")
    px, py, heading = (np.array(a) for a in np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, yaw))))
    q = np.full((*px.shape, 6), np.nan)
    status = np.full(px.shape, Status.NOT_CONVERGED, dtype=np.uint8)
    for at in np.ndindex(px.shape):
        place = (float(px[at]), float(py[at]), float(heading[at]))

        def residual(u: Array, place: tuple[float, float, float] = place) -> Array:
            """Return (6,) terrain height minus contact height, m: eqs (13)."""
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
    """Return the contact angles of eqs (14)-(16): δ = −atan Γ − pitch − suspension angle.

    The paper's signs are corrected: pitch is nose-down positive, and δ of eq. (5) is negative ahead of the axle.

    Args:
        rover: the rover.
        pose: (...) poses of the rover.
        slope: (..., 6) Γ, rise over run of the terrain at each contact along the body's yaw.

    Returns:
        (..., 6) δ, rad. Approximate if the rover rolls: see docs/contact_angles.md.
    """
    return -np.arctan(slope) - pose.pitch[..., None] - _suspension_angle(rover, pose.rocker, pose.bogie)


def _suspension_angle(rover: Rover, rocker: ArrayLike, bogie: ArrayLike) -> Array:
    """Return the angle (..., 6) of the link that carries each wheel, rad, nose-down positive."""
    arm = np.stack([np.asarray(rocker, dtype=float), rover.right_rocker(rocker)], axis=-1)[..., WHEEL_SIDE]
    return arm + np.where(ON_BOGIE, np.asarray(bogie, dtype=float)[..., WHEEL_SIDE], 0.0)


def _axles(rover: Rover, x: float, y: float, yaw: float, u: Array) -> tuple[Array, Array, Array]:
    """Return hub, x axis and z axis of every axle in the world, from eqs (2)-(4) and (10).

    Args:
        rover: the rover.
        x: m.
        y: m.
        yaw: rad.
        u: (6,) z, roll, pitch, rocker, left bogie, right bogie, m and rad.

    Returns:
        Three arrays (6, 3): hubs in m, unit vectors forward, unit vectors up.
    """
    T = body_transform(x, y, u[0], u[1], u[2], yaw) @ wheel_frames(rover, u[3], u[4:])
    return T[:, :3, 3], T[:, :3, 0], T[:, :3, 2]


def _contact_points(rover: Rover, terrain: Terrain, x: float, y: float, yaw: float, u: Array) -> Array:
    """Return the contacts (6, 3), m, of eqs (5) and (11) at the angles of eqs (14)-(16).

    The slope is taken at the contact itself, by fixed-point iteration. Arguments as for `_axles`.
    """
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
    """Return points (6, points, 3), m, on the lower halves of the rims. Arguments: `_axles`."""
    hub, forward, up = _axles(rover, x, y, yaw, u)
    angle = np.linspace(-np.pi / 2, np.pi / 2, points)[:, None]
    radial = np.sin(angle) * forward[:, None] + np.cos(angle) * up[:, None]
    return hub[:, None] - rover.wheel_radius[:, None, None] * radial


def _why(rover: Rover, terrain: Terrain, place: tuple[float, float, float], u: Array) -> Status:
    """Return the status of a pose that `fsolve` did not solve, from its last iterate u (6,)."""
    at = np.where(np.isfinite(u), u, 0.0)
    px, py = _rim_points(rover, *place, at, RIM_POINTS)[..., :2].reshape(-1, 2).T
    xmin, ymin, xmax, ymax = terrain.bounds
    if not ((px >= xmin) & (px <= xmax) & (py >= ymin) & (py <= ymax)).all():
        return Status.OFF_MAP
    return Status.NO_DATA if np.isnan(terrain.height(px, py)).any() else Status.NOT_CONVERGED
