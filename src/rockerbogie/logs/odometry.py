"""Odometry: a log of joint sensors, integrated to poses on SE(3) (docs/odometry.md)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..arrays import is_number
from ..errors import RockerbogieError, expect
from ..rover.model import Rover
from ..settling.settle import settle
from ..terrain.heightfield import Terrain
from .channels import LogReport, LogWarning, arrange_log
from .intervals import middle
from .readings import Readings
from .steps import MAPPED_SLOPE, UNKNOWN_SLOPE, IntervalMotion, interval_motion, weights_of
from .track import integrate, track_dataset

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Greatest number of iterations between track and map, which end when the track moves by less than `SETTLED`, m.
MAP_ROUNDS, SETTLED = 10, 1e-4


@dataclass(frozen=True)
class SlopeSlip:
    """Soil whose slip is proportional to the slope.

    A wheel has the rim speed d on a slope with the sines u ahead and c to the left (uphill positive). Then it advances by
    d − along·u·‖d‖ m/s and slides across·c·‖d‖ m/s to its right.

    Warning: the coefficients belong to one place. (0.57, 0.47), which fit 20° of Perseverance's sol 1590, give a slip of 0.16
    for the last 3 m of the first 60 % of sol 1294, on 17°. Measured were 0.49 to 0.74, on average 0.64: 4 times as much. Use
    `fit_soil` for the soil under the wheels, and `forecast_slip` for its changes.
    """

    along: float
    across: float

    def __post_init__(self) -> None:
        """Check the coefficients; raise if one is not a finite number."""
        if not (is_number(self.along) and is_number(self.across)):
            raise RockerbogieError(f"SlopeSlip({self.along!r:.60}, {self.across!r:.60}): give two numbers, along and across")

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
        `twist_covariance` (body frame) and `pose_covariance` (position and rotation about fixed axes), both 6 x 6.
        `slip_share`: RMS slip of the wheels against each other, as a share of their rim speed; above 0.2, the displacement is
        doubted and part of the covariance. A `LogWarning` is issued if sensors are missing or disagree; `attrs["warnings"]`
        lists them.

    Raises:
        RockerbogieError: a log without wheel sensors, of fewer than two rows, with missing values, or whose shapes do not fit.
    """
    ground, data = _ordered(terrain, log)
    report = LogReport()
    s = Readings.of(rover, data, report)
    if soil is not None and s.lean is None:
        raise RockerbogieError("soil= needs the slope, and the log has no roll and pitch: leave it out")
    slopes = (0.0, 0.0) if soil is None else (soil.along, soil.across)
    motion = interval_motion(rover, weights_of(rover, UNKNOWN_SLOPE, s.joint_error, slopes), s.packed())
    path, used = integrate(rover, s, motion, start), s
    weights = weights_of(rover, MAPPED_SLOPE, s.joint_error, slopes)
    for _ in range(MAP_ROUNDS if ground is not None else 0):
        assert ground is not None
        before = path.T[:, :2, 3]
        used, z = _on_map(rover, s, path.T, ground)
        motion = interval_motion(rover, weights, used.packed(), _climb(s, path.T, z, motion))
        path = integrate(rover, used, motion, start, z)
        if np.hypot(*(path.T[:, :2, 3] - before).T).max() < SETTLED:
            break
    track = track_dataset(rover, used, path, motion)
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


def _climb(s: Readings, T: Array, z: Array, motion: IntervalMotion) -> Array:
    """Return the speed (n,) of the body off the plane of its wheels by the map; 0 without map."""
    R = middle(T[:, :3, :3])
    v = np.einsum("nij,nj->ni", R, motion.motion[:, :3])
    v[:, 2] = np.diff(z) / np.diff(s.time)
    return np.asarray(np.nan_to_num(np.einsum("nij,nj,ni->n", R, motion.normal, v)))
