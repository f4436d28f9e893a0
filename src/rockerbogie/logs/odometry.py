"""Odometry: a log of joint sensors, integrated to poses on SE(3) (docs/odometry.md)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, expect
from ..motion.body_twist import Motion, body_twist
from ..motion.jacobian import SimpleStance, contact_rows
from ..rotations import body_transform
from ..rover.frames import contact_frames, wheel_frames
from ..rover.model import Rover
from ..settling.settle import settle
from ..terrain.heightfield import Terrain
from .channels import LogReport, LogWarning, arrange_log
from .intervals import middle, upright_angles
from .readings import Readings
from .track import integrate, track_dataset

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Standard deviation of the angle between a wheel's path and the plane through all six, without a map, rad.
UNKNOWN_SLOPE = 0.15
#: The same with a map.
MAPPED_SLOPE = 0.1
#: Iterations between contact angles and velocities; greatest number of iterations between track and map, which end when the
#: track moves by less than `SETTLED`, m.
ROUNDS, MAP_ROUNDS, SETTLED = 4, 10, 1e-4
#: Least speed of a hub whose direction is used, m/s; sine of the steepest path of a hub.
STANDING, STEEPEST = 1e-4, 0.8
#: A wheel's slip beyond this many standard deviations loses weight.
OUTLIER = 3.0


@dataclass(frozen=True)
class SlopeSlip:
    """Soil whose slip is proportional to the slope.

    A wheel has the rim speed d on a slope with the sines u ahead and c to the left (uphill positive). Then it advances by
    d − along·u·‖d‖ m/s and slides across·c·‖d‖ m/s to its right.
    """

    along: float
    across: float

    def slip(self, rolled: Array, ahead: Array, left: Array) -> Array:
        """Return the expected slip on a slope.

        Args:
            rolled: (..., 6) rim speeds, m/s.
            ahead: (..., 6) sine of the slope along the wheel, uphill positive.
            left: (..., 6) sine of the slope to its left, uphill positive.

        Returns:
            (..., 6, 3) roll slip, side slip and lift (0), m/s.
        """
        pull = np.stack([self.along * ahead, self.across * left, np.zeros_like(ahead)], axis=-1)
        return -pull * np.abs(rolled)[..., None]


def odometry(
    rover: Rover,
    terrain: Terrain | xr.Dataset | None = None,
    log: xr.Dataset | Terrain | None = None,
    *,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    soil: SlopeSlip | None = None,
) -> xr.Dataset:
    """Integrate a log of wheels, steering, rocker and bogies to poses in three dimensions.

    Wheel angles are smoothed over 30 counts of their encoders (`resolution_of` finds the count), so that the result does not
    depend on the rate of the log.

    Args:
        rover: the rover that made the log.
        terrain: the map, or `None`. With a map, height, climb and (if not in the log) roll and pitch are those of the rover
            settled along its track. Without one, the body rises along the mean plane of its wheels. Contact angles are computed
            from that and from the joints' rates.
        log: over `time`, as from `drive`, `simulate` or `read_log`: `wheel_angle` or `wheel_rate` (time, wheel), and, if
            available, `steering` (time, wheel), `rocker` (time), `bogie` (time, side), `roll`, `pitch`, `yaw` (time), `gyro`
            (time, axis; body frame). Units and labels are read, see `arrange_log`; default SI. Positions are not used. A
            `gyro` is used if one of roll, pitch and yaw is missing; NaN in it means no reading. `odometry(rover, log)` works
            too; `odometry(rover, log, terrain)` is deprecated.
        start: first x, y, z of the body's reference point, m; with a map, z is the map's, and NaN off it.
        soil: expected slip on slopes; needs roll and pitch in the log.

    Returns:
        Dataset over `time`: `x y z roll pitch yaw` (m, rad); `distance` (horizontal) and `distance_3d`, m. For the interval
        that ends at each time: `twist` (time, component), `contact_angle`, `roll_slip`, `side_slip` (time, wheel);
        `twist_covariance` (body frame) and `pose_covariance` (position and rotation about fixed axes), both 6 x 6. A
        `LogWarning` is issued if sensors are missing or disagree; `attrs["warnings"]` lists them.

    Raises:
        RockerbogieError: a log without wheel sensors, of fewer than two rows, with missing values, or whose shapes do not fit.
    """
    ground, data = _ordered(terrain, log)
    report = LogReport()
    s = Readings.of(rover, data, report)
    if soil is not None and s.lean is None:
        raise RockerbogieError("soil= needs the slope, and the log has no roll and pitch: leave it out")
    plane = _plane_state(rover, s)
    soil_slip = np.zeros((*s.steering.shape, 3)) if soil is None else _soil_slip(rover, s, plane, soil)
    state, motion = _solve_motion(rover, s, plane, soil_slip, None, UNKNOWN_SLOPE)
    level = (float(np.ravel(plane.roll)[0]), float(np.ravel(plane.pitch)[0]))
    T = integrate(s, motion.twist, start, level)
    used = s
    for _ in range(MAP_ROUNDS if ground is not None else 0):
        assert ground is not None
        before = T[:, :2, 3].copy()
        used, z = _on_map(rover, s, T, ground)
        plane = replace(plane, roll=middle(used.lean[:, 0]), pitch=middle(used.lean[:, 1]))  # type: ignore[index]
        state, motion = _solve_motion(rover, used, plane, soil_slip, _climb(s, T, z, plane, motion), MAPPED_SLOPE)
        T = integrate(used, motion.twist, (*start[:2], z[0]), level)
        T[:, 2, 3] = z
        if np.hypot(*(T[:, :2, 3] - before).T).max() < SETTLED:
            break
    track = track_dataset(rover, used, T, motion, state.contact_angle)
    track.attrs["warnings"] = "\n".join(report.warnings)
    report.emit()
    return track


def _ordered(terrain: object, log: object) -> tuple[Terrain | None, xr.Dataset]:
    """Return map and log, which older calls give in the other order."""
    import xarray as xr

    if isinstance(terrain, xr.Dataset):
        if log is not None:
            warnings.warn(
                "odometry(rover, log, terrain) is deprecated: call odometry(rover, terrain, log)",
                DeprecationWarning,
                stacklevel=3,
            )
        terrain, log = log, terrain
    if not isinstance(log, xr.Dataset):
        raise RockerbogieError(f"log is {log!r:.60}, not a Dataset: read one with rockerbogie.read_log")
    if terrain is not None:
        expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_raster, or give None")
    return terrain, log  # type: ignore[return-value]


def flat_odometry(
    rover: Rover, log: xr.Dataset, *, start: tuple[float, float, float] = (0.0, 0.0, 0.0), heading: bool = True
) -> xr.Dataset:
    """Integrate a log by the usual 2-D odometry, on a horizontal plane, to compare with.

    Args:
        rover: the rover that made the log.
        log: as for `odometry`; of the attitude only `yaw` is read.
        start: as for `odometry`.
        heading: use the log's yaw if it has one; else the wheels give the heading.

    Returns:
        As `odometry`, at a constant height.

    Raises:
        RockerbogieError: as `odometry`.
    """
    log = arrange_log(rover, log)
    level = log.drop_vars([v for v in ("rocker", "bogie", "roll", "pitch", "gyro", "yaw") if v in log])
    still = ("time", np.zeros(log.sizes["time"]))
    level = level.assign(rocker=still, roll=still, pitch=still, bogie=(("time", "side"), np.zeros((log.sizes["time"], 2))))
    if heading and "yaw" in log:
        level = level.assign(yaw=log["yaw"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # `odometry` issues the same
        track = odometry(rover, None, level, start=start)
    track["z"].values[:] = start[2]  # hubs of unequal height would make it climb
    return track


def _plane_state(rover: Rover, s: Readings) -> SimpleStance:
    """Return contact angles on the plane nearest to the six hubs."""
    axle = wheel_frames(rover, s.rocker, s.bogie, s.steering)
    hub = axle[..., :3, 3]
    design = np.concatenate([hub[..., :2], np.ones((*hub.shape[:-1], 1))], axis=-1)
    slope = np.einsum("...ij,...j->...i", np.linalg.pinv(design), hub[..., 2])
    normal = np.stack([-slope[:, 0], -slope[:, 1], np.ones(len(slope))], axis=-1)
    normal = np.repeat((normal / np.linalg.norm(normal, axis=1, keepdims=True))[:, None, :], 6, axis=1)
    delta = np.arctan2((normal * axle[..., :3, 0]).sum(axis=-1), (normal * axle[..., :3, 2]).sum(axis=-1))
    lean = upright_angles(normal[:, 0]) if s.lean is None else middle(s.lean)
    return SimpleStance(s.rocker, s.bogie, delta, s.steering, lean[:, 0], lean[:, 1], normal)


def _soil_slip(rover: Rover, s: Readings, plane: SimpleStance, soil: SlopeSlip) -> Array:
    """Return the expected slip (n, 6, 3) on the plane of the wheels."""
    axle = wheel_frames(rover, plane.rocker, plane.bogie, plane.steering)
    contact = contact_frames(rover, axle, plane.contact_angle)
    up = body_transform(0, 0, 0, plane.roll, plane.pitch, 0.0)[:, None, 2, :3]
    ahead, left = ((up * contact[..., :3, k]).sum(axis=-1) for k in (0, 1))
    return soil.slip(rover.wheel_radius * s.wheel_rates, ahead, left)


def _solve_motion(
    rover: Rover, s: Readings, plane: SimpleStance, soil_slip: Array, climb: Array | None, slope: float
) -> tuple[SimpleStance, Motion]:
    """Solve for motion and contact angles together.

    Each hub moves along its own tread's tangent, and off the plane of all six wheels at the rate that leaves the body's
    `climb` (n,) m/s. Without a map, the mean rate off the plane is 0. A wheel whose slip exceeds `OUTLIER` standard
    deviations (it spins or stalls) loses weight.
    """
    assert plane.normal is not None
    state, expected = plane, soil_slip.copy()
    noise, prior = s.noise(rover, slope), s.prior(rover)
    sigma = noise.roll_slip
    for _ in range(ROUNDS):
        motion = body_twist(rover, state, **s.measured, expected_slip=expected, noise=noise, prior=prior)
        rows = contact_rows(rover, state)
        m = np.concatenate([motion.twist, motion.rocker_rate[:, None], motion.bogie_rates], axis=1)
        contact = np.einsum("nijk,nk->nij", rows[..., :9], m)
        along = contact[..., 0] + rover.wheel_radius * contact[..., 4]  # the hub's velocity
        off = contact[..., 2]
        sine = np.divide(off, along, out=np.zeros_like(along), where=np.abs(along) > STANDING)
        state = replace(state, contact_angle=plane.contact_angle - np.arcsin(np.clip(sine, -STEEPEST, STEEPEST)))
        rise = -off.mean(axis=1) if climb is None else climb - (plane.normal[:, 0] * motion.twist[:, :3]).sum(axis=1)
        slipped = (motion.residual[..., 0] - expected[..., 0]) / (OUTLIER * np.asarray(sigma))
        noise = replace(noise, roll_slip=sigma * np.maximum(1.0, np.nan_to_num(slipped) ** 2))
        expected[..., 2] = off + rise[:, None]  # joints and gyro determine the rise of the wheels relative to each other
    return state, motion


def _on_map(rover: Rover, s: Readings, T: Array, terrain: Terrain) -> tuple[Readings, Array]:
    """Settle the rover along its track: return readings with its attitude, and heights (n + 1,)."""
    x, y, yaw = T[:, 0, 3], T[:, 1, 3], np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0]))
    pose = settle(rover, terrain, x, y, yaw, steering=np.concatenate([s.steering[:1], s.steering]))
    known = np.isfinite(pose.q).all(axis=1)
    if s.lean is None and not known.all():
        k = int(np.argmin(known))
        raise RockerbogieError(
            f"after {s.time[k] - s.time[0]:g} s the rover does not settle on the map at ({x[k]:.4g}, {y[k]:.4g}) m, "
            "and the log has no roll and pitch: load more terrain, or leave the map out"
        )
    if s.lean is not None:
        return s, pose.z
    lean = np.stack([pose.roll, pose.pitch], axis=-1)
    rates = np.diff(lean, axis=0) / np.diff(s.time)[:, None]
    return replace(s, lean=lean, measured=s.measured | {"inclinometer_rates": rates}), pose.z


def _climb(s: Readings, T: Array, z: Array, plane: SimpleStance, motion: Motion) -> Array:
    """Return the speed (n,) of the body off the plane of its wheels by the map; 0 without map."""
    assert plane.normal is not None
    R = middle(T[:, :3, :3])
    v = np.einsum("nij,nj->ni", R, motion.twist[:, :3])
    v[:, 2] = np.diff(z) / np.diff(s.time)
    return np.asarray(np.nan_to_num(np.einsum("nij,nj,ni->n", R, plane.normal[:, 0], v)))
