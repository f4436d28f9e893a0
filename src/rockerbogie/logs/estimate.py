"""Estimate of the odometry filter at one time."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array
from ..rover.model import Rover
from ..rover.rotations import euler_angles
from .steps import DOUBT
from .tip import tip_margin


@dataclass(frozen=True, eq=False)
class Estimate:
    """Pose and motion of the body at a time."""

    rover: Rover
    time: float  # s
    T: Array  # (4, 4) T_world_body
    pose_covariance: Array  # (6, 6) of position and rotation about fixed axes, m² and rad²
    twist: Array  # (6,) in the body frame over the interval that ends at `time`, m/s and rad/s; NaN at the first row
    twist_covariance: Array  # (6, 6)
    roll_slip: Array  # (6,) slip of each wheel along its path, m/s
    side_slip: Array  # (6,) slip across it, m/s
    contact_angle: Array  # (6,) rad
    steering: Array  # (6,) rad
    rocker: float  # rad
    bogie: Array  # (2,) rad
    distance: float  # horizontal length of the path, m
    distance_3d: float  # its length in three dimensions, m
    slip_share: float  # RMS slip of the wheels against each other, as a share of their rim speed, over a quarter wheelbase

    @property
    def position(self) -> Array:
        """(3,) x, y, z of the body's reference point, m."""
        return self.T[:3, 3]

    @property
    def attitude(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw, rad; yaw in [-π, π]."""
        roll, pitch, yaw = euler_angles(self.T[:3, :3])
        return float(roll), float(pitch), float(yaw)

    @property
    def doubted(self) -> bool:
        """True if the wheels contradict each other: the rover may be stuck (`slip_share` above 0.2).

        The displacement meanwhile becomes part of the pose covariance: from 0.2 to 0.3, its share rises from none to all.
        """
        return self.slip_share > DOUBT

    @property
    def tip_margin(self) -> float:
        """Least turn of gravity that tips the rover over, rad; NaN for a rover without mass."""
        return tip_margin(self.rover, self.T, self.rocker, self.bogie, self.steering, self.contact_angle)
