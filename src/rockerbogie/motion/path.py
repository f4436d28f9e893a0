"""Where a rover is asked to go: x, y and yaw over the distance travelled."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import PathError
from ..rotations import wrap_angle

Array = NDArray[np.float64]

#: Corners sharper than this are a turn back on the spot, which no rounding can drive.
SHARPEST_CORNER = np.deg2rad(175.0)


class PathSample(NamedTuple):
    """Places on a path: all (...), metres and radians, yaw and course continuous along the path."""

    x: Array
    y: Array
    yaw: Array
    course: Array  # direction of travel; yaw itself unless the path was given with a yaw of its own
    curvature: Array  # d yaw / d distance, 1/m, left turn positive


@dataclass(frozen=True, eq=False)
class Path:
    """A way over the ground, in n pieces on each of which course and yaw change at a constant rate: lines and arcs.

    Make one with `Path.straight`, `Path.arc`, `Path.waypoints` or `Path.from_arrays`. Not-a-number never gets in.
    """

    distance: Array  # (n + 1,) of the pieces' ends, from 0, m
    x: Array  # (n + 1,) m
    y: Array  # (n + 1,) m
    yaw: Array  # (n + 1,) rad, continuous
    course: Array  # (n,) direction of travel at each piece's start, rad
    bend: Array  # (n,) its rate, 1/m
    description: str

    @classmethod
    def straight(cls, start: tuple[float, float], yaw: float, length: float) -> Path:
        """A straight line of `length` m from `start` (x, y), facing `yaw` rad.

        Raises:
            PathError: not finite, or a length that is not above 0.
        """
        said = f"straight, {length:g} m from ({start[0]:.9g}, {start[1]:.9g}) m towards {np.rad2deg(yaw):g} deg"
        return _from_arcs(start, yaw, [(length, 0.0)], said)

    @classmethod
    def arc(cls, start: tuple[float, float], yaw: float, radius: float, angle: float) -> Path:
        """A circular arc from `start` (x, y), facing `yaw` rad there, of `radius` m through `angle` rad, left positive.

        Raises:
            PathError: not finite, a radius that is not above 0, or no angle.
        """
        if not radius > 0:
            raise PathError(f"radius is {radius} m; give one above 0 (the sign of the angle says left or right)")
        side = "left" if angle > 0 else "right"
        said = f"arc, {abs(np.rad2deg(angle)):g} deg {side} at {radius:g} m radius from ({start[0]:.9g}, {start[1]:.9g}) m"
        return _from_arcs(start, yaw, [(abs(angle) * radius, np.sign(angle) / radius)], said)

    @classmethod
    def waypoints(cls, points: ArrayLike, radius: float = 1.0) -> Path:
        """Straight lines through points, each corner rounded by an arc, so that the rover faces where it goes.

        Args:
            points: (n, 2) x and y, m. The path starts at the first and ends at the last, and cuts the corners between.
            radius: of the arcs, m.

        Raises:
            PathError: fewer than two points, not finite, two in one place, a turn on the spot, or no room for an arc.
        """
        p = _numbers(points)
        if p.ndim != 2 or p.shape[1:] != (2,) or len(p) < 2:
            raise PathError(f"waypoints have shape {p.shape}; give at least two points (x, y)")
        if not 0 < radius < np.inf:
            raise PathError(f"radius is {radius} m; give a finite turning radius above 0")
        leg, way = _legs(p[:, 0], p[:, 1])
        turn = wrap_angle(np.diff(way))
        for k in np.flatnonzero(np.abs(turn) > SHARPEST_CORNER):
            raise PathError(f"the path turns back on itself at waypoint {k + 2}: drive it as two paths, or put a point beside it")
        cut = np.concatenate([[0.0], radius * np.tan(np.abs(turn) / 2), [0.0]])  # off the legs at each point
        room = leg - cut[:-1] - cut[1:]
        tight = int(np.argmin(room / leg))
        if room[tight] < -1e-9 * leg[tight]:
            fits = radius * leg[tight] / (cut[tight] + cut[tight + 1])
            raise PathError(
                f"no room to turn at {radius:g} m radius between waypoints {tight + 1} and {tight + 2}, {leg[tight]:g} m apart: "
                f"give a radius of at most {fits:.3g} m or move them apart"
            )
        pieces = [(float(room[0]), 0.0)]
        for angle, straight in zip(turn, room[1:], strict=True):
            pieces += [(abs(angle) * radius, np.sign(angle) / radius), (float(straight), 0.0)]
        ends = f"({p[0, 0]:.9g}, {p[0, 1]:.9g}) to ({p[-1, 0]:.9g}, {p[-1, 1]:.9g}) m"
        said = f"{len(p)} waypoints from {ends}, corners of {radius:g} m radius"
        return _from_arcs((p[0, 0], p[0, 1]), float(way[0]), [s for s in pieces if s[0] > 1e-12], said)

    @classmethod
    def from_arrays(cls, x: ArrayLike, y: ArrayLike, yaw: ArrayLike) -> Path:
        """A path through poses, as a log has them: straight from place to place, yaw changing evenly between.

        Args:
            x, y: (n,) places, m.
            yaw: (n,) where the rover faces, rad; whole turns are taken out. It need not be the way it goes.

        Raises:
            PathError: fewer than two poses, shapes that differ, not finite, or two poses in one place.
        """
        px, py, facing = (_numbers(a) for a in (x, y, yaw))
        if not (px.ndim == 1 and len(px) >= 2 and px.shape == py.shape == facing.shape):
            raise PathError(f"x, y and yaw have shapes {px.shape}, {py.shape}, {facing.shape}; give three (n,) with n at least 2")
        leg, way = _legs(px, py)
        if not np.isfinite(facing).all():
            raise PathError("yaw holds a value that is not finite; drop those poses")
        said = f"{len(px)} poses from ({px[0]:.9g}, {py[0]:.9g}) to ({px[-1]:.9g}, {py[-1]:.9g}) m"
        distance = np.concatenate([[0.0], np.cumsum(leg)])
        return cls(distance, px, py, np.unwrap(facing), np.unwrap(way), np.zeros(len(leg)), said)

    @property
    def length(self) -> float:
        """Distance from start to end along the path, m."""
        return float(self.distance[-1])

    def sample(self, distance: ArrayLike) -> PathSample:
        """Place, yaw, course and curvature (...) at `distance` (...) along the path, m.

        Raises:
            PathError: a distance that is nan, below 0 or beyond the path's length.
        """
        s = np.asarray(distance, dtype=float)
        if not ((s >= 0) & (s <= self.length)).all():
            raise PathError(
                f"the path runs from 0 to {self.length:g} m; distances asked for run from {s.min():g} to {s.max():g} m"
            )
        k = np.clip(np.searchsorted(self.distance, s, side="right") - 1, 0, len(self.bend) - 1)
        along = s - self.distance[k]
        turned = self.bend[k] * along
        chord = along * np.sinc(turned / (2 * np.pi))  # sin(turned / 2) / (turned / 2), whole for a straight line
        towards = self.course[k] + turned / 2
        curvature = (np.diff(self.yaw) / np.diff(self.distance))[k]
        return PathSample(
            self.x[k] + chord * np.cos(towards),
            self.y[k] + chord * np.sin(towards),
            self.yaw[k] + curvature * along,
            self.course[k] + turned,
            curvature,
        )


def _numbers(values: ArrayLike) -> Array:
    """A copy as an array of floats."""
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise PathError(f"a path is made of numbers, in equal rows; got {values!r:.60}") from None


def _legs(x: Array, y: Array) -> tuple[Array, Array]:
    """Length and direction (n - 1,) of the straight lines between places (n,)."""
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        bad = int(np.argmin(np.isfinite(x) & np.isfinite(y)))
        raise PathError(f"point {bad + 1} of the path is ({x[bad]:g}, {y[bad]:g}): give finite numbers, in metres")
    leg = np.hypot(np.diff(x), np.diff(y))
    if (leg == 0).any():
        k = int(np.argmin(leg))
        raise PathError(f"points {k + 1} and {k + 2} of the path are both at ({x[k]:g}, {y[k]:g}) m: leave one out")
    return leg, np.arctan2(np.diff(y), np.diff(x))


def _from_arcs(start: tuple[float, float], yaw: float, arcs: list[tuple[float, float]], description: str) -> Path:
    """A path of arcs (length, curvature) end to end, faced where it goes."""
    length, bend = np.array(arcs, dtype=float).T
    if not (np.isfinite([*start, yaw]).all() and np.isfinite(length).all()):
        raise PathError(f"path ({description}) is not finite: give finite numbers, metres and radians")
    if not (length > 0).all():
        raise PathError(f"path ({description}) has no length: give one above 0")
    facing = yaw + np.concatenate([[0.0], np.cumsum(length * bend)])
    x, y = [float(start[0])], [float(start[1])]
    for (before, after), piece, curve in zip(pairwise(facing), length, bend, strict=True):
        chord = piece * np.sinc(piece * curve / (2 * np.pi))
        x.append(x[-1] + chord * np.cos((before + after) / 2))
        y.append(y[-1] + chord * np.sin((before + after) / 2))
    return Path(np.concatenate([[0.0], np.cumsum(length)]), np.array(x), np.array(y), facing, facing[:-1], bend, description)
