"""Odometry: a log of joint sensors, integrated to poses on SE(3) (docs/odometry.md)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, expect
from ..motion.body_twist import Motion, RatePrior, SensorNoise, body_twist
from ..motion.jacobian import SimpleStance, contact_rows
from ..rotations import body_transform, euler_angles
from ..rover.frames import contact_frames, wheel_frames
from ..rover.model import Rover
from ..settling.settle import settle
from ..terrain.heightfield import Terrain
from .channels import LogReport, LogWarning, arrange_log
from .resolution import COUNTS, LONGEST, joint_window, resolution_of, smooth, window_of
from .sensor_checks import check_heading, check_tilt, check_wheels

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Angle between a wheel's path and the plane through all six without a map, rad.
UNKNOWN_SLOPE = 0.15
#: The same with a map.
MAPPED_SLOPE = 0.1
#: Slip along and across a wheel's path as a share of the speed, and the least slip, m/s.
ROLL_SHARE, SIDE_SHARE, LEAST_SLIP = 0.1, 0.1, 1e-4
#: Iterations between contact angles and velocities; most iterations between track and map, which end if the track moves
#: by less than `SETTLED`, m.
ROUNDS, MAP_ROUNDS, SETTLED = 4, 10, 1e-4
#: Least speed of a hub whose direction is used, m/s; sine of the steepest path of a hub.
STANDING, STEEPEST = 1e-4, 0.8
#: Expected size of rates that are not measured, of a joint and of roll and pitch, times speed over wheelbase: rad.
PRIOR_JOINT, PRIOR_TILT = 0.1, 0.03
#: A wheel's slip beyond this many standard deviations loses weight.
OUTLIER = 3.0
#: Slip of one wheel is alike over this length, m, and at most for this time, s: what covariances add up by.
SLIP_LENGTH, SLIP_TIME = 0.5, 10.0
#: Error of a measured attitude (roll, pitch, yaw), rad, and slip that all wheels share, as a share of the way.
ATTITUDE_SIGMA, COMMON_SLIP = (0.01, 0.01, 0.02), 0.005


TWIST, POSE = ("vx", "vy", "vz", "wx", "wy", "wz"), ("x", "y", "z", "about_x", "about_y", "about_z")


@dataclass(frozen=True)
class SlopeSlip:
    """Soil whose slip is proportional to the slope.

    A wheel that lays down d m/s of rim on a slope whose sines are u ahead and c to the left (uphill positive) makes
    d − along·u·‖d‖ ahead and slides across·c·‖d‖ to its right.
    """

    along: float
    across: float

    def slip(self, rolled: Array, ahead: Array, left: Array) -> Array:
        """Return the slip to expect on a slope.

        Args:
            rolled: (..., 6) rim speeds, m/s.
            ahead, left: (..., 6) sines of the slope, uphill positive.

        Returns:
            (..., 6, 3) roll slip, side slip and lift (0), m/s."""
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

    Wheel angles are smoothed over 30 counts of their encoders (`resolution_of` finds the count), so that the result does
    not depend on the rate of the log.

    Args:
        rover: the rover that made the log.
        terrain: the map, or `None`. With a map, height, climb and (if not in the log) roll and pitch are those of the rover
            settled along its track. Without one, the body rises along the plane of its wheels on average. Contact angles
            follow from that and from the joints' rates.
        log: over `time`, as from `drive`, `simulate` or `read_log`: `wheel_angle` or `wheel_rate` (time, wheel), and what
            there is of `steering` (time, wheel), `rocker` (time), `bogie` (time, side), `roll`, `pitch`, `yaw` (time),
            `gyro` (time, axis; body frame). Units and labels are read, see `arrange_log`; default SI. Positions are not
            used. A `gyro` is used if one of roll, pitch and yaw is missing; NaN in it is no reading. `odometry(rover, log)`
            works too; `odometry(rover, log, terrain)` is deprecated.
        start: x, y, z of the body's reference point at first, m; with a map, z is the map's, and NaN off it.
        soil: slip to expect of a slope; needs roll and pitch in the log.

    Returns:
        Dataset over `time`: `x y z roll pitch yaw` (m, rad); `distance` (horizontal) and `distance_3d`, m;
            over the interval that ends there,
        `twist` (time, component), `contact_angle`, `roll_slip`, `side_slip` (time, wheel); `twist_covariance` (body frame)
        and `pose_covariance` (position and rotation about fixed axes), both 6 x 6. A `LogWarning` is issued if sensors are
        missing or disagree; `attrs["warnings"]` lists them.

    Raises:
        RockerbogieError: a log without wheel sensors, of fewer than two rows, with missing values, or whose shapes do not fit.
    """
    ground, data = _ordered(terrain, log)
    report = LogReport()
    s = _Sensors.of(rover, data, report)
    if soil is not None and s.lean is None:
        raise RockerbogieError("slip on a slope needs the slope: the log has no roll and pitch")
    plane = _plane_state(rover, s)
    soil_slip = np.zeros((*s.steering.shape, 3)) if soil is None else _soil_slip(rover, s, plane, soil)
    state, motion = _solve_motion(rover, s, plane, soil_slip, None, UNKNOWN_SLOPE)
    level = (float(np.ravel(plane.roll)[0]), float(np.ravel(plane.pitch)[0]))
    T = _integrate(s, motion.twist, start, level)
    used = s
    for _ in range(MAP_ROUNDS if ground is not None else 0):
        assert ground is not None
        before = T[:, :2, 3].copy()
        used, z = _on_map(rover, s, T, ground)
        plane = replace(plane, roll=_middle(used.lean[:, 0]), pitch=_middle(used.lean[:, 1]))  # type: ignore[index]
        state, motion = _solve_motion(rover, used, plane, soil_slip, _climb(s, T, z, plane, motion), MAPPED_SLOPE)
        T = _integrate(used, motion.twist, (*start[:2], z[0]), level)
        T[:, 2, 3] = z
        if np.hypot(*(T[:, :2, 3] - before).T).max() < SETTLED:
            break
    track = _dataset(rover, used, T, motion, state.contact_angle)
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
    track["z"].values[:] = start[2]  # hubs of unequal height would climb
    return track


@dataclass(frozen=True, eq=False)
class _Sensors:
    """Readings of a log over its n intervals between n + 1 times."""

    time: Array  # (n + 1,)
    wheel_rates: Array  # (n, 6)
    steering: Array  # (n, 6) midway, as are rocker and bogie
    rocker: Array  # (n,) 0 if not logged
    bogie: Array  # (n, 2)
    lean: Array | None  # (n + 1, 2) roll, pitch
    yaw: Array | None  # (n + 1,)
    readings: dict[str, Array]  # arguments of `body_twist`
    joint_error: float  # of the suspension's rates by its resolution, rad/s

    @classmethod
    def of(cls, rover: Rover, log: xr.Dataset, report: LogReport) -> _Sensors:
        """Return the readings of a log; raise if they cannot be integrated."""
        if "time" not in log.variables or log.sizes[log["time"].dims[0]] < 2:
            raise RockerbogieError("the log has no time, or fewer than two rows: there is nothing to integrate")
        counts = log.attrs.get("counts_per_turn")
        checked = "read" in log.attrs
        log = arrange_log(rover, log)
        time = np.asarray(log["time"], dtype=float)
        dt = np.diff(time)
        if not (dt > 0).all():
            k = int(np.argmin(dt))
            raise RockerbogieError(f"time does not grow from row {k + 1} ({time[k]:g} s) to {time[k + 1]:g} s: sort the log")

        def column(name: str) -> Array | None:
            if name not in log:
                return None
            values = np.asarray(log[name], dtype=float)
            if not np.isfinite(values).all() and name != "gyro":
                row = int(np.argmin(np.isfinite(values).reshape(len(time), -1).all(axis=1)))
                raise RockerbogieError(f"{name} in the log is not finite in row {row + 1}: fill the gaps, or drop those rows")
            return values

        angle, speed = column("wheel_angle"), column("wheel_rate")
        if angle is None and speed is None:
            raise RockerbogieError("the log has neither wheel_angle nor wheel_rate: there is no odometry without the wheels")
        steering, rocker, bogie = column("steering"), column("rocker"), column("bogie")
        if steering is None and rover.steers.any() and not checked:
            report.warn("the log has no steering: the wheels are taken to be held straight")
        window, joint_error = _window(time, angle, (rocker, bogie), counts, rover, report)

        def rate(values: Array) -> Array:
            return np.diff(smooth(time, values, window), axis=0) / dt.reshape(-1, *[1] * (values.ndim - 1))

        spin = rate(angle) if angle is not None else _middle(speed)  # type: ignore[arg-type]
        readings = {"wheel_rates": spin}
        for name, values in (("steering_rates", steering), ("rocker_rate", rocker), ("bogie_rates", bogie)):
            if values is not None:
                readings[name] = rate(values)
        roll, pitch, yaw, gyro = column("roll"), column("pitch"), column("yaw"), column("gyro")
        lean = None if roll is None or pitch is None else np.stack([roll, pitch], axis=-1)
        if lean is not None and yaw is not None:
            R = body_transform(0, 0, 0, lean[:, 0], lean[:, 1], yaw)[:, :3, :3]
            turn = _rotation_vector(np.swapaxes(R[:-1], 1, 2) @ R[1:])
            if window > 1:
                turn = np.diff(smooth(time, np.concatenate([np.zeros((1, 3)), np.cumsum(turn, axis=0)]), window), axis=0)
            readings["gyro"] = turn / dt[:, None]
        else:
            if gyro is not None:
                readings["gyro"] = _middle(gyro)
            elif yaw is not None and lean is None:  # a compass: of the angular velocity, the part about z
                readings["gyro"] = np.stack([np.full(len(dt), np.nan)] * 2 + [rate(np.unwrap(yaw))], axis=-1)
            if lean is not None:
                readings["inclinometer_rates"] = rate(lean)
        s = cls(
            time,
            spin,
            np.zeros((len(dt), 6)) if steering is None else np.where(rover.steers, _middle(steering), 0.0),
            np.zeros(len(dt)) if rocker is None else _middle(rocker),
            np.zeros((len(dt), 2)) if bogie is None else _middle(bogie),
            lean,
            yaw,
            readings,
            joint_error,
        )
        if not checked:
            _compare(rover, s, report)
        return s

    def speed(self, rover: Rover) -> Array:
        """Return the median speed of the wheels' rims (n, 1), m/s."""
        return np.median(np.abs(rover.wheel_radius * self.wheel_rates), axis=1, keepdims=True)

    def noise(self, rover: Rover, slope: float) -> SensorNoise:
        """Return standard deviations for contact angles known to `slope` rad."""
        speed = self.speed(rover)
        found = SensorNoise(
            roll_slip=ROLL_SHARE * speed + LEAST_SLIP, side_slip=SIDE_SHARE * speed + LEAST_SLIP, lift=slope * speed + LEAST_SLIP
        )  # fmt: skip
        return replace(found, joint_rate=float(np.hypot(1e-3, self.joint_error))) if self.joint_error else found

    def prior(self, rover: Rover) -> RatePrior:
        """Return the expected size of rates that are not measured, at each interval's speed."""
        speed = self.speed(rover)[:, 0]
        return RatePrior(joint=PRIOR_JOINT * speed / rover.wheelbase + 1e-4, tilt=PRIOR_TILT * speed / rover.wheelbase + 1e-4)


def _window(
    time: Array, angle: Array | None, joints: tuple[Array | None, ...], counts: float | None, rover: Rover, report: LogReport
) -> tuple[int, float]:
    """Return the rows to smooth over, and the error left in the joints' rates, rad/s."""
    window = 1
    if angle is not None:
        grid = 2 * np.pi / float(counts) if counts else float(np.median([resolution_of(column) for column in angle.T]))
        if grid > 0:
            window = window_of(time, angle, grid)
            span = window * float(np.median(np.diff(time)))
            if window > 1 and span > 0.9 * LONGEST:
                report.warn(
                    f"the wheels' encoders give {2 * np.pi / grid:.0f} counts a turn, fewer than {COUNTS:.0f} in {LONGEST:g} s: "
                    "expect an error of 1 % of the way, more where the speed changes"
                )
    grid = max((resolution_of(c) for j in joints if j is not None for c in j.reshape(len(time), -1).T), default=0.0)
    if grid > 0:
        window = max(window, joint_window(time, grid))
        return window, grid / np.sqrt(6) / (window * float(np.median(np.diff(time))))
    return window, 0.0


def _compare(rover: Rover, s: _Sensors, report: LogReport) -> None:
    """Warn if wheels, steering and heading disagree, in logs that `read_log` has not compared."""
    check = check_wheels(rover, s.time, s.wheel_rates, s.steering)
    for text in check.warnings:
        report.warn(text)
    if s.yaw is not None:
        fault = check_heading(s.time, check.yaw, np.unwrap(s.yaw))
        if fault:
            report.warn(f"the log's yaw contradicts the wheels: {fault}")
    if s.lean is not None:
        fault = check_tilt(s.lean[:, 0], s.lean[:, 1])
        if fault:
            report.warn(f"the log's roll and pitch cannot be a rover's: {fault}")


def _plane_state(rover: Rover, s: _Sensors) -> SimpleStance:
    """Return contact angles on the plane nearest to the six hubs."""
    axle = wheel_frames(rover, s.rocker, s.bogie, s.steering)
    hub = axle[..., :3, 3]
    design = np.concatenate([hub[..., :2], np.ones((*hub.shape[:-1], 1))], axis=-1)
    slope = np.einsum("...ij,...j->...i", np.linalg.pinv(design), hub[..., 2])
    normal = np.stack([-slope[:, 0], -slope[:, 1], np.ones(len(slope))], axis=-1)
    normal = np.repeat((normal / np.linalg.norm(normal, axis=1, keepdims=True))[:, None, :], 6, axis=1)
    delta = np.arctan2((normal * axle[..., :3, 0]).sum(axis=-1), (normal * axle[..., :3, 2]).sum(axis=-1))
    lean = _level(normal[:, 0]) if s.lean is None else _middle(s.lean)
    return SimpleStance(s.rocker, s.bogie, delta, s.steering, lean[:, 0], lean[:, 1], normal)


def _soil_slip(rover: Rover, s: _Sensors, plane: SimpleStance, soil: SlopeSlip) -> Array:
    """Return the slip to expect (n, 6, 3) on the plane of the wheels."""
    axle = wheel_frames(rover, plane.rocker, plane.bogie, plane.steering)
    contact = contact_frames(rover, axle, plane.contact_angle)
    up = body_transform(0, 0, 0, plane.roll, plane.pitch, 0.0)[:, None, 2, :3]
    ahead, left = ((up * contact[..., :3, k]).sum(axis=-1) for k in (0, 1))
    return soil.slip(rover.wheel_radius * s.wheel_rates, ahead, left)


def _solve_motion(
    rover: Rover, s: _Sensors, plane: SimpleStance, soil_slip: Array, climb: Array | None, slope: float
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
        motion = body_twist(rover, state, **s.readings, expected_slip=expected, noise=noise, prior=prior)
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
        expected[..., 2] = off + rise[:, None]  # joints and gyro determine how the wheels rise against each other
    return state, motion


def _on_map(rover: Rover, s: _Sensors, T: Array, terrain: Terrain) -> tuple[_Sensors, Array]:
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
    return replace(s, lean=lean, readings=s.readings | {"inclinometer_rates": rates}), pose.z


def _climb(s: _Sensors, T: Array, z: Array, plane: SimpleStance, motion: Motion) -> Array:
    """Return the speed (n,) of the body off the plane of its wheels by the map; 0 without map."""
    assert plane.normal is not None
    R = _middle(T[:, :3, :3])
    v = np.einsum("nij,nj->ni", R, motion.twist[:, :3])
    v[:, 2] = np.diff(z) / np.diff(s.time)
    return np.asarray(np.nan_to_num(np.einsum("nij,nj,ni->n", R, plane.normal[:, 0], v)))


def _level(normal: Array) -> Array:
    """Return the roll and pitch (n, 2) at which normals (n, 3) in the body are vertical."""
    return np.stack([np.arctan2(normal[:, 1], normal[:, 2]), -np.arcsin(np.clip(normal[:, 0], -1, 1))], axis=-1)


def _integrate(s: _Sensors, twist: Array, start: tuple[float, ...], level: tuple[float, float]) -> Array:
    """Return T_world_body (n + 1, 4, 4): a screw per interval, attitude of the log if known."""
    n = len(twist)
    dt = np.diff(s.time)
    roll, pitch = s.lean[0] if s.lean is not None else level
    T = np.tile(np.eye(4), (n + 1, 1, 1))
    T[0] = body_transform(start[0], start[1], start[2], roll, pitch, 0.0 if s.yaw is None else s.yaw[0])
    turn = _rotation(twist[:, 3:] * dt[:, None])
    if s.lean is not None and s.yaw is not None:
        T[:, :3, :3] = body_transform(0, 0, 0, s.lean[:, 0], s.lean[:, 1], s.yaw)[:, :3, :3]
    else:
        for k in range(n):
            R = T[k, :3, :3] @ turn[k]
            if s.lean is not None:
                R = body_transform(0, 0, 0, s.lean[k + 1, 0], s.lean[k + 1, 1], np.arctan2(R[1, 0], R[0, 0]))[:3, :3]
            T[k + 1, :3, :3] = R
    phi = _rotation_vector(np.swapaxes(T[:-1, :3, :3], 1, 2) @ T[1:, :3, :3])
    moved = _screw(phi, twist[:, :3] * dt[:, None])
    T[1:, :3, 3] = T[0, :3, 3] + np.cumsum(np.einsum("nij,nj->ni", T[:-1, :3, :3], moved), axis=0)
    return T


def _middle(values: Array) -> Array:
    """Return values midway between rows."""
    return 0.5 * (values[1:] + values[:-1])


def _rotation_vector(R: Array) -> Array:
    """Return rotation vectors (n, 3), rad, of rotations (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def _rotation(vector: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _screw(phi: Array, rho: Array) -> Array:
    """Return V(phi) rho: the displacement by a constant twist (rho, phi) in unit time."""
    angle = np.linalg.norm(phi, axis=1, keepdims=True)
    small = angle < 1e-6
    a = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1 - np.cos(a)) / a**2)
    second = np.where(small, 1 / 6, (a - np.sin(a)) / a**3)
    once = np.cross(phi, rho)
    return np.asarray(rho + first * once + second * np.cross(phi, once))


def _pose_covariance(rover: Rover, s: _Sensors, T: Array, motion: Motion) -> Array:
    """Return the covariance (n + 1, 6, 6) of position and of rotation, to first order.

    Errors of the twist are alike over `SLIP_LENGTH`; a measured attitude has a constant error `ATTITUDE_SIGMA`; all wheels
    share a slip of `COMMON_SLIP`.
    """
    n, dt = len(motion.twist), np.diff(s.time)
    speed = np.linalg.norm(motion.twist[:, :3], axis=1)
    alike = np.clip(SLIP_LENGTH / np.maximum(speed, 1e-9), dt, np.maximum(dt, SLIP_TIME))
    turn = np.zeros((n, 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = T[:-1, :3, :3]
    Q = (
        turn
        @ np.clip(np.nan_to_num(motion.covariance, posinf=1.0), -1.0, 1.0)
        @ np.swapaxes(turn, 1, 2)
        * (dt * alike)[:, None, None]
    )
    measured = np.array([s.lean is not None, s.lean is not None, s.yaw is not None])
    fixed = np.concatenate([np.ones(3), ~measured])
    Q *= fixed[:, None] * fixed
    P = np.zeros((n + 1, 6, 6))
    P[0, 3:, 3:] = np.diag(np.where(measured, np.square(ATTITUDE_SIGMA), 0.0))
    step = np.diff(T[:, :3, 3], axis=0)
    F = np.tile(np.eye(6), (n, 1, 1))
    F[:, 0, 4], F[:, 0, 5], F[:, 1, 5] = step[:, 2], -step[:, 1], step[:, 0]  # -[step]x
    F[:, 1, 3], F[:, 2, 3], F[:, 2, 4] = -step[:, 2], step[:, 1], -step[:, 0]
    for k in range(n):
        P[k + 1] = F[k] @ P[k] @ F[k].T + Q[k]
    way = T[:, :3, 3] - T[0, :3, 3]
    P[:, :3, :3] += COMMON_SLIP**2 * way[:, :, None] * way[:, None, :]
    return P


def _path_length(T: Array, axes: int = 3) -> Array:
    """Return the length (n + 1,) of the path so far, m: arcs between poses; `axes` 2 for the horizontal length."""
    chord = np.linalg.norm(np.diff(T[:, :axes, 3], axis=0), axis=1)
    half = 0.5 * np.linalg.norm(_rotation_vector(np.swapaxes(T[:-1, :3, :3], 1, 2) @ T[1:, :3, :3]), axis=1)
    arc = chord / np.sinc(np.minimum(half, 0.5 * np.pi) / np.pi)
    return np.concatenate([[0.0], np.cumsum(arc)])


def _dataset(rover: Rover, s: _Sensors, T: Array, motion: Motion, contact_angle: Array) -> xr.Dataset:
    import xarray as xr

    def late(values: Array) -> Array:
        """Return values of intervals at their ends; NaN at the start."""
        return np.concatenate([np.full((1, *values.shape[1:]), np.nan), values])

    p = T[:, :3, 3]
    roll, pitch, yaw = euler_angles(T[:, :3, :3])
    values: dict[str, tuple[tuple[str, ...], Any, str, str]] = {
        "x": (("time",), p[:, 0], "m", "x of the body's reference point"),
        "y": (("time",), p[:, 1], "m", "y of the body's reference point"),
        "z": (("time",), p[:, 2], "m", "height of the body's reference point"),
        "roll": (("time",), roll, "rad", "roll of the body, left side up positive"),
        "pitch": (("time",), pitch, "rad", "pitch of the body, nose down positive"),
        "yaw": (("time",), np.unwrap(yaw), "rad", "heading of the body from +x"),
        "twist": (("time", "component"), late(motion.twist), "m/s, rad/s", "velocity of the body in its own frame"),
        "contact_angle": (("time", "wheel"), late(contact_angle), "rad", "contact angle on the rim"),
        "roll_slip": (("time", "wheel"), late(motion.residual[..., 0]), "m/s", "slip along the wheel's way"),
        "side_slip": (("time", "wheel"), late(motion.residual[..., 1]), "m/s", "slip across the wheel's way, to its left"),
        "twist_covariance": (
            ("time", "component", "component_column"), late(motion.covariance), "(m/s, rad/s)²", "covariance of twist",
        ),
        "pose_covariance": (
            ("time", "pose_component", "pose_component_column"), _pose_covariance(rover, s, T, motion), "(m, rad)²",
            "covariance of position and of rotation about fixed axes",
        ),
    }  # fmt: skip
    coords = {
        "time": ("time", s.time, {"units": "s", "long_name": "time"}),
        "distance": ("time", _path_length(T, 2), {"units": "m", "long_name": "horizontal distance along the path"}),
        "distance_3d": ("time", _path_length(T), {"units": "m", "long_name": "length of the path in three dimensions"}),
        "wheel": list(rover.wheel_names),
        "component": list(TWIST),
        "component_column": list(TWIST),
        "pose_component": list(POSE),
        "pose_component_column": list(POSE),
    }
    data = {name: (dims, array, {"units": units, "long_name": text}) for name, (dims, array, units, text) in values.items()}
    return xr.Dataset(data, coords, {"rover": rover.name, "source": "rockerbogie odometry"})
