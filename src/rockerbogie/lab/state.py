"""Rover, terrain, pose and options of one visitor, without graphics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array
from ..gravity import GRAVITY
from ..maps.limits import PRESETS, Limits
from ..rover.model import Rover
from ..rover.rotations import wrap_angle
from ..settling.engines import Mode
from ..settling.pose import Pose
from ..settling.settle import settle
from ..terrain.heightfield import Terrain

#: Share of the remaining distance that the rover covers in one frame of a glide.
GLIDE = 0.4
#: A glide ends when the rover is this close to its target, m and rad.
ARRIVED = (5e-4, 2e-4)


@dataclass
class LabState:
    """Scene of one visitor: rover, terrain, position, settled pose and options."""

    rover: Rover
    terrain: Terrain
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    mode: Mode = "contact"
    gravity: float = GRAVITY["earth"]
    limits: Limits = PRESETS["none"]
    target: tuple[float, float, float] | None = None
    pose: Pose = field(init=False)

    def __post_init__(self) -> None:
        self.move(self.x, self.y, self.yaw)

    @property
    def size(self) -> float:
        """Horizontal radius of the rover about its reference point, m."""
        return float(np.hypot(self.rover.hubs[:, 0], self.rover.hubs[:, 1]).max() + self.rover.wheel_radius.max())

    def settle(self) -> Pose:
        """Settle the rover at the current position.

        Returns:
            The pose; NaN if it cannot be computed.
        """
        self.pose = settle(self.rover, self.terrain, self.x, self.y, self.yaw, mode=self.mode, gravity=self.gravity)
        return self.pose

    def move(self, x: float, y: float, yaw: float) -> Pose:
        """Put the rover at a position within the map and settle it.

        Args:
            x: m; clipped to the map.
            y: m; clipped to the map.
            yaw: rad; wrapped to ±π.

        Returns:
            The pose.
        """
        self.x, self.y, self.yaw = self.inside(x, y, yaw)
        return self.settle()

    def inside(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Return a position clipped to the map.

        Args:
            x: m.
            y: m.
            yaw: rad.

        Returns:
            x, y (m) and yaw wrapped to ±π. A number that is not finite is replaced by the current one.
        """
        xmin, ymin, xmax, ymax = self.terrain.bounds
        x, y, yaw = (new if math.isfinite(new) else old for new, old in ((x, self.x), (y, self.y), (yaw, self.yaw)))
        yaw = yaw if abs(yaw) <= math.pi else float(wrap_angle(yaw))  # an angle in range stays as it is, to the last bit
        return min(max(x, xmin), xmax), min(max(y, ymin), ymax), yaw

    def glide(self) -> bool:
        """Move the rover one frame towards `target` and settle it.

        Returns:
            True if the rover has moved. The last frame of a glide reaches the target exactly and sets it to None.
        """
        if self.target is None:
            return False
        x, y, yaw = self.inside(*self.target)
        dx, dy, turn = x - self.x, y - self.y, float(wrap_angle(yaw - self.yaw))
        if math.hypot(dx, dy) < ARRIVED[0] * max(1.0, self.size) and abs(turn) < ARRIVED[1]:
            self.target = None
            self.move(x, y, yaw)
        else:
            self.move(self.x + GLIDE * dx, self.y + GLIDE * dy, self.yaw + GLIDE * turn)
        return True

    def step(self, forward: float, turn: float) -> tuple[float, float, float]:
        """Return the position one step ahead of the target, or of the rover without one.

        Args:
            forward: m along the heading.
            turn: rad, left positive.

        Returns:
            x, y (m) and yaw (rad), within the map.
        """
        x, y, yaw = self.target or (self.x, self.y, self.yaw)
        return self.inside(x + forward * math.cos(yaw), y + forward * math.sin(yaw), yaw + turn)

    def use_rover(self, rover: Rover) -> Pose:
        """Replace the rover and settle it at the same position.

        Args:
            rover: the new rover.

        Returns:
            The pose.
        """
        self.rover = rover
        return self.settle()

    def use_terrain(self, terrain: Terrain) -> Pose:
        """Replace the terrain and put the rover at a position with data, the centre if possible.

        Args:
            terrain: the new terrain.

        Returns:
            The pose.
        """
        self.terrain, self.target = terrain, None
        return self.move(*start_position(terrain), self.yaw)


def start_position(terrain: Terrain) -> tuple[float, float]:
    """Return the node with data that is closest to the centre of the map.

    Args:
        terrain: the terrain.

    Returns:
        x and y, m; the centre itself if its height is finite.
    """
    xmin, ymin, xmax, ymax = terrain.bounds
    x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
    if np.isfinite(terrain.height(x, y)):
        return x, y
    rows, cols = np.nonzero(np.isfinite(terrain.z))
    if rows.size == 0:
        return x, y
    px, py = terrain.x[cols], terrain.y[rows]
    order = np.argsort(np.hypot(px - x, py - y))
    px, py = px[order], py[order]
    best = int(np.argmax(np.isfinite(terrain.height(px, py))))  # cubic terrain is NaN some cells around missing data too
    return float(px[best]), float(py[best])


def standing(rover: Rover, terrain: Terrain, x: float, y: float) -> Array:
    """Return z, roll, pitch, rocker and bogies with which a rover without a pose is drawn.

    Args:
        rover: the rover.
        terrain: the terrain.
        x: m.
        y: m.

    Returns:
        (6,) level body and joints at 0, with the lowest wheel at the height of the terrain; m and rad.
    """
    ground = float(terrain.height(x, y))
    if not math.isfinite(ground):
        ground = float(np.nanmean(terrain.z)) if np.isfinite(terrain.z).any() else 0.0
    return np.array([ground - float((rover.hubs[:, 2] - rover.wheel_radius).min()), 0.0, 0.0, 0.0, 0.0, 0.0])
