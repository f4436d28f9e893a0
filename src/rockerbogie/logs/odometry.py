"""Odometry: a log of joint sensors, integrated to poses on SE(3). What stands behind it is in docs/odometry.md."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..motion.body_twist import Motion, SensorNoise, body_twist
from ..motion.jacobian import SimpleStance, contact_rows
from ..rotations import body_transform, euler_angles
from ..rover.frames import contact_frames, wheel_frames
from ..rover.model import Rover
from ..settling.settle import settle
from ..terrain.heightfield import Terrain

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: How far a wheel's way over the ground departs from the plane through all six, where no map tells it: rad.
UNKNOWN_SLOPE = 0.15
#: And from the map's slope where there is a map.
MAPPED_SLOPE = 0.1
#: Share of the speed at which wheels slip along and across their way, and a floor under it, m/s.
ROLL_SHARE, SIDE_SHARE, LEAST_SLIP = 0.1, 0.1, 1e-4
#: Rounds from contact angles to velocities and back; and at most from the track to the ground under it and back, which
#: end when the track moves no further than `SETTLED`, m.
ROUNDS, MAP_ROUNDS, SETTLED = 4, 10, 1e-4
#: Below this a hub's velocity has no direction worth having, m/s; and the sine of the steepest way one is thought to go.
STANDING, STEEPEST = 1e-4, 0.8


@dataclass(frozen=True)
class SlopeSlip:
    """Soil on which slip grows with the slope.

    A wheel that lays down d m/s of rim on a slope whose sines are u ahead and c to the left (uphill positive) makes
    d − along·u·‖d‖ ahead and slides across·c·‖d‖ to its right.
    """

    along: float
    across: float

    def slip(self, rolled: Array, ahead: Array, left: Array) -> Array:
        """Slip to expect (..., 6, 3): roll, side, no lift, m/s; of rim speeds and sines of slope (..., 6)."""
        pull = np.stack([self.along * ahead, self.across * left, np.zeros_like(ahead)], axis=-1)
        return -pull * np.abs(rolled)[..., None]


def odometry(
    rover: Rover,
    log: xr.Dataset,
    terrain: Terrain | None = None,
    *,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    soil: SlopeSlip | None = None,
) -> xr.Dataset:
    """Where wheels, steering, rocker and bogies say the rover went, in three dimensions.

    Args:
        log: over `time` (s), as from `drive`, `simulate` or `read_log`: `wheel_angle` or `wheel_rate` (time, wheel), and
            what there is of `steering` (time, wheel), `rocker` (time), `bogie` (time, side), `roll`, `pitch`, `yaw`
            (time), `gyro` (time, axis; body frame, rad/s). `yaw` counts beside roll and pitch only; a `gyro` where one of
            the three is missing. Positions are not read.
        terrain: the ground, where there is a map: height, how the body rises and (if not in the log) roll and pitch are
            then those of the rover settled along its track. Without one it rises along the plane of its wheels, on the
            whole. Contact angles follow from that and from the joints' rates.
        start: x, y, z of the body's reference point at first, m; with a map, z is the map's, and nan off it.
        soil: the slip to expect of a slope; needs roll and pitch in the log.

    Returns:
        Dataset over `time`: `x y z roll pitch yaw`; `distance` along the way; and, over the interval that ends there,
        `twist` (time, component), `contact_angle`, `roll_slip`, `side_slip` (time, wheel).

    Raises:
        RockerbogieError: a log without wheel sensors, of fewer than two rows, with gaps, or whose shapes do not fit.
    """
    s = _Sensors.of(rover, log)
    if soil is not None and s.lean is None:
        raise RockerbogieError("slip on a slope needs the slope: the log has no roll and pitch")
    plane = _plane_stance(rover, s)
    soil_slip = np.zeros((*s.steering.shape, 3)) if soil is None else _soil_slip(rover, s, plane, soil)
    stance, motion = _reckon(rover, s, plane, soil_slip, None, UNKNOWN_SLOPE)
    T = _integrate(s, motion.twist, start)
    for _ in range(MAP_ROUNDS if terrain is not None else 0):
        assert terrain is not None
        before = T[:, :2, 3].copy()
        leant, z = _on_map(rover, s, T, terrain)
        plane = replace(plane, roll=_middle(leant.lean[:, 0]), pitch=_middle(leant.lean[:, 1]))  # type: ignore[index]
        stance, motion = _reckon(rover, leant, plane, soil_slip, _climb(s, T, z, plane, motion), MAPPED_SLOPE)
        T = _integrate(leant, motion.twist, (*start[:2], z[0]))
        T[:, 2, 3] = z
        if np.hypot(*(T[:, :2, 3] - before).T).max() < SETTLED:
            break
    return _dataset(rover, s, T, motion, stance.contact_angle)


def flat_odometry(
    rover: Rover, log: xr.Dataset, *, start: tuple[float, float, float] = (0.0, 0.0, 0.0), heading: bool = True
) -> xr.Dataset:
    """The usual 2-D odometry, to compare with: wheels and steering on level ground, the suspension at rest.

    Args:
        log, start: as for `odometry`; of the attitude only `yaw` is read.
        heading: take the log's yaw where it has one; else the heading too is the wheels' own.
    """
    level = log.drop_vars([v for v in ("rocker", "bogie", "roll", "pitch", "gyro", "yaw") if v in log])
    still = ("time", np.zeros(log.sizes["time"]))
    level = level.assign(rocker=still, roll=still, pitch=still, bogie=(("time", "side"), np.zeros((log.sizes["time"], 2))))
    if heading and "yaw" in log:
        level = level.assign(yaw=log["yaw"])
    track = odometry(rover, level, start=start)
    track["z"].values[:] = start[2]  # hubs that are not quite level would climb
    return track


@dataclass(frozen=True, eq=False)
class _Sensors:
    """A log between its rows: n intervals of n + 1 times."""

    time: Array  # (n + 1,)
    wheel_rates: Array  # (n, 6)
    steering: Array  # (n, 6) halfway, as are rocker and bogie
    rocker: Array  # (n,) 0 where not logged
    bogie: Array  # (n, 2)
    lean: Array | None  # (n + 1, 2) roll, pitch
    yaw: Array | None  # (n + 1,)
    readings: dict[str, Array]  # what `body_twist` is given

    @classmethod
    def of(cls, rover: Rover, log: xr.Dataset) -> _Sensors:
        if "time" not in log.coords or log.sizes["time"] < 2:
            raise RockerbogieError("the log has no time, or fewer than two rows: there is nothing to integrate")
        time = np.asarray(log["time"], dtype=float)
        dt = np.diff(time)
        if not (dt > 0).all():
            k = int(np.argmin(dt))
            raise RockerbogieError(f"time does not grow from row {k + 1} ({time[k]:g} s) to {time[k + 1]:g} s: sort the log")
        n = len(dt)

        def column(name: str, *width: int) -> Array | None:
            if name not in log:
                return None
            values = np.asarray(log[name], dtype=float)
            if values.shape != (n + 1, *width):
                raise RockerbogieError(f"{name} in the log has shape {values.shape}; give {(n + 1, *width)}")
            if not np.isfinite(values).all():
                row = int(np.argmin(np.isfinite(values).reshape(n + 1, -1).all(axis=1)))
                raise RockerbogieError(f"{name} in the log is not finite in row {row + 1}: fill the gaps, or drop those rows")
            return values

        def rate(values: Array) -> Array:
            return np.diff(values, axis=0) / dt.reshape(-1, *[1] * (values.ndim - 1))

        angle, speed = column("wheel_angle", 6), column("wheel_rate", 6)
        if angle is None and speed is None:
            raise RockerbogieError("the log has neither wheel_angle nor wheel_rate: there is no odometry without the wheels")
        spin = rate(angle) if angle is not None else _middle(speed)  # type: ignore[arg-type]
        readings = {"wheel_rates": spin}
        steering, rocker, bogie = column("steering", 6), column("rocker"), column("bogie", 2)
        for name, values in (("steering_rates", steering), ("rocker_rate", rocker), ("bogie_rates", bogie)):
            if values is not None:
                readings[name] = rate(values)
        roll, pitch, yaw, gyro = column("roll"), column("pitch"), column("yaw"), column("gyro", 3)
        lean = None if roll is None or pitch is None else np.stack([roll, pitch], axis=-1)
        if lean is not None and yaw is not None:
            R = body_transform(0, 0, 0, lean[:, 0], lean[:, 1], yaw)[:, :3, :3]
            readings["gyro"] = _rotation_vector(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / dt[:, None]
        else:
            if gyro is not None:
                readings["gyro"] = _middle(gyro)
            if lean is not None:
                readings["inclinometer_rates"] = rate(lean)
        return cls(
            time,
            spin,
            np.zeros((n, 6)) if steering is None else np.where(rover.steers, _middle(steering), 0.0),
            np.zeros(n) if rocker is None else _middle(rocker),
            np.zeros((n, 2)) if bogie is None else _middle(bogie),
            lean,
            yaw,
            readings,
        )

    def noise(self, rover: Rover, slope: float) -> SensorNoise:
        """What to trust at the speed of each interval, when contact angles are known to `slope` rad."""
        speed = np.median(np.abs(rover.wheel_radius * self.wheel_rates), axis=1, keepdims=True)
        return SensorNoise(
            roll_slip=ROLL_SHARE * speed + LEAST_SLIP, side_slip=SIDE_SHARE * speed + LEAST_SLIP, lift=slope * speed + LEAST_SLIP
        )  # fmt: skip


def _plane_stance(rover: Rover, s: _Sensors) -> SimpleStance:
    """Contact angles as if all six wheels stood on one plane: the one nearest to their hubs."""
    axle = wheel_frames(rover, s.rocker, s.bogie, s.steering)
    hub = axle[..., :3, 3]
    design = np.concatenate([hub[..., :2], np.ones((*hub.shape[:-1], 1))], axis=-1)
    slope = np.einsum("...ij,...j->...i", np.linalg.pinv(design), hub[..., 2])
    normal = np.stack([-slope[:, 0], -slope[:, 1], np.ones(len(slope))], axis=-1)
    normal = np.repeat((normal / np.linalg.norm(normal, axis=1, keepdims=True))[:, None, :], 6, axis=1)
    delta = np.arctan2((normal * axle[..., :3, 0]).sum(axis=-1), (normal * axle[..., :3, 2]).sum(axis=-1))
    lean = np.zeros((len(slope), 2)) if s.lean is None else _middle(s.lean)
    return SimpleStance(s.rocker, s.bogie, delta, s.steering, lean[:, 0], lean[:, 1], normal)


def _soil_slip(rover: Rover, s: _Sensors, plane: SimpleStance, soil: SlopeSlip) -> Array:
    """Slip to expect (n, 6, 3) on the plane the rover stands on."""
    axle = wheel_frames(rover, plane.rocker, plane.bogie, plane.steering)
    contact = contact_frames(rover, axle, plane.contact_angle)
    up = body_transform(0, 0, 0, plane.roll, plane.pitch, 0.0)[:, None, 2, :3]
    ahead, left = ((up * contact[..., :3, k]).sum(axis=-1) for k in (0, 1))
    return soil.slip(rover.wheel_radius * s.wheel_rates, ahead, left)


def _reckon(
    rover: Rover, s: _Sensors, plane: SimpleStance, soil_slip: Array, climb: Array | None, slope: float
) -> tuple[SimpleStance, Motion]:
    """Motion and contact angles together: each hub goes along its own tread's tangent, and off the plane of all six at the
    rate that leaves the body's `climb` (n,) m/s; where no map tells that, their mean off it is nought."""
    assert plane.normal is not None
    stance, expected = plane, soil_slip.copy()
    for _ in range(ROUNDS):
        motion = body_twist(rover, stance, **s.readings, expected_slip=expected, noise=s.noise(rover, slope))
        rows = contact_rows(rover, stance)
        m = np.concatenate([motion.twist, motion.rocker_rate[:, None], motion.bogie_rates], axis=1)
        contact = np.einsum("nijk,nk->nij", rows[..., :9], m)
        along = contact[..., 0] + rover.wheel_radius * contact[..., 4]  # the hub's velocity
        off = contact[..., 2]
        sine = np.divide(off, along, out=np.zeros_like(along), where=np.abs(along) > STANDING)
        stance = replace(stance, contact_angle=plane.contact_angle - np.arcsin(np.clip(sine, -STEEPEST, STEEPEST)))
        rise = -off.mean(axis=1) if climb is None else climb - (plane.normal[:, 0] * motion.twist[:, :3]).sum(axis=1)
        expected[..., 2] = off + rise[:, None]  # how the wheels rise against each other is for the joints to say
    return stance, motion


def _on_map(rover: Rover, s: _Sensors, T: Array, terrain: Terrain) -> tuple[_Sensors, Array]:
    """The rover let down along its track (n + 1): its height; its roll and pitch too, where the log has none."""
    x, y, yaw = T[:, 0, 3], T[:, 1, 3], np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0]))
    pose = settle(rover, terrain, x, y, yaw, steering=np.concatenate([s.steering[:1], s.steering]))
    known = np.isfinite(pose.q).all(axis=1)
    if s.lean is None and not known.all():
        k = int(np.argmin(known))
        raise RockerbogieError(
            f"after {s.time[k] - s.time[0]:g} s the rover cannot stand on the map at ({x[k]:.4g}, {y[k]:.4g}) m, "
            "and the log has no roll and pitch to go on with: load more ground, or leave the map out"
        )
    if s.lean is not None:
        return s, pose.z
    lean = np.stack([pose.roll, pose.pitch], axis=-1)
    rates = np.diff(lean, axis=0) / np.diff(s.time)[:, None]
    return replace(s, lean=lean, readings=s.readings | {"inclinometer_rates": rates}), pose.z


def _climb(s: _Sensors, T: Array, z: Array, plane: SimpleStance, motion: Motion) -> Array:
    """How fast (n,) the body leaves the plane of its wheels, when it rises as the map does; 0 where the map does not tell."""
    assert plane.normal is not None
    R = _middle(T[:, :3, :3])
    v = np.einsum("nij,nj->ni", R, motion.twist[:, :3])
    v[:, 2] = np.diff(z) / np.diff(s.time)
    return np.asarray(np.nan_to_num(np.einsum("nij,nj,ni->n", R, plane.normal[:, 0], v)))


def _integrate(s: _Sensors, twist: Array, start: tuple[float, ...]) -> Array:
    """T_world_body (n + 1, 4, 4): each interval a screw; attitude from the log as far as it has it."""
    n = len(twist)
    dt = np.diff(s.time)
    roll, pitch = s.lean[0] if s.lean is not None else (0.0, 0.0)
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
    """Halfway between rows."""
    return 0.5 * (values[1:] + values[:-1])


def _rotation_vector(R: Array) -> Array:
    """(n, 3) of small turns (n, 3, 3), rad."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def _rotation(vector: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _screw(phi: Array, rho: Array) -> Array:
    """Where the origin gets to, in the first frame, at constant twist (rho, phi) for one unit of time: V(phi) rho."""
    angle = np.linalg.norm(phi, axis=1, keepdims=True)
    small = angle < 1e-6
    a = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1 - np.cos(a)) / a**2)
    second = np.where(small, 1 / 6, (a - np.sin(a)) / a**3)
    once = np.cross(phi, rho)
    return np.asarray(rho + first * once + second * np.cross(phi, once))


def _dataset(rover: Rover, s: _Sensors, T: Array, motion: Motion, contact_angle: Array) -> xr.Dataset:
    import xarray as xr

    def late(values: Array) -> Array:
        """Over intervals, as read at their ends; at the start there is none."""
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
    }
    step = np.linalg.norm(np.diff(p, axis=0), axis=1)
    coords = {
        "time": ("time", s.time, {"units": "s", "long_name": "time"}),
        "distance": ("time", np.concatenate([[0.0], np.cumsum(step)]), {"units": "m", "long_name": "distance along the way"}),
        "wheel": list(rover.wheel_names),
        "component": ["vx", "vy", "vz", "wx", "wy", "wz"],
    }
    data = {name: (dims, array, {"units": units, "long_name": text}) for name, (dims, array, units, text) in values.items()}
    return xr.Dataset(data, coords, {"rover": rover.name, "source": "rockerbogie odometry"})
