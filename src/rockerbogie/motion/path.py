"""Paths: x, y and yaw as functions of the horizontal distance along the path."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, floats
from ..errors import PathError
from ..rover.rotations import wrap_angle

#: A corner sharper than this is a reversal, which no arc can round.
SHARPEST_CORNER = np.deg2rad(175.0)


class PathSample(NamedTuple):
    """Stations on a path: all (...), metres and radians; yaw and course are continuous."""

    x: Array
    y: Array
    yaw: Array
    course: Array  # direction of travel; equal to yaw unless the path was made from poses
    curvature: Array  # d yaw / d distance, 1/m, left turn positive


@dataclass(frozen=True, eq=False, repr=False)
class Path:
    """Path of n lines and arcs, on each of which course and yaw change at a constant rate.

    All values are finite. Make one with `Path.straight`, `Path.arc`, `Path.waypoints` or `Path.from_arrays`.
    """

    distance: Array  # (n + 1,) horizontal distance of the pieces' ends, from 0, m
    x: Array  # (n + 1,) m
    y: Array  # (n + 1,) m
    yaw: Array  # (n + 1,) rad, continuous
    course: Array  # (n,) direction of travel at each piece's start, rad
    course_rate: Array  # (n,) rate of course on each piece, 1/m
    description: str

    def __repr__(self) -> str:
        return f"<Path of {self.length:.6g} m: {self.description}>"

    @classmethod
    def straight(cls, start: tuple[float, float], yaw: float, length: float) -> Path:
        """Make a straight line.

        Args:
            start: x and y, m.
            yaw: direction of travel and yaw of the body, rad.
            length: m, above 0.

        Returns:
            The path.

        Raises:
            PathError: not finite, or a length that is not above 0.
        """
        said = f"straight, {length:g} m from ({start[0]:.9g}, {start[1]:.9g}) m towards {np.rad2deg(yaw):g} deg"
        return _from_arcs(start, yaw, [(length, 0.0)], said)

    @classmethod
    def arc(cls, start: tuple[float, float], yaw: float, radius: float, angle: float) -> Path:
        """Make a circular arc.

        Args:
            start: x and y, m.
            yaw: direction of travel and yaw of the body at the start, rad.
            radius: m, above 0.
            angle: change of yaw, left positive, rad.

        Returns:
            The path.

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
        """Make straight lines through points, with each corner rounded by an arc.

        Yaw is the direction of travel.

        Args:
            points: (n, 2) x and y, m. The path starts at the first, ends at the last, and cuts the corners at the others.
            radius: of the arcs, m.

        Returns:
            The path.

        Raises:
            PathError: fewer than two points, not finite, two equal points in a row, a reversal, or no room for an arc.
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
        """Make a path through poses, straight from one to the next, with yaw interpolated linearly.

        Args:
            x, y: (n,) m.
            yaw: (n,) rad; whole turns are removed. It may differ from the direction of travel.

        Returns:
            The path.

        Raises:
            PathError: fewer than two poses, shapes that differ, not finite, or two poses in a row at one position.
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
    def bend(self) -> Array:
        """(n,) old name of `course_rate`, 1/m. Deprecated."""
        warnings.warn("Path.bend is deprecated: use Path.course_rate", DeprecationWarning, stacklevel=2)
        return self.course_rate

    @property
    def length(self) -> float:
        """Horizontal distance from start to end along the path, m."""
        return float(self.distance[-1])

    def sample(self, distance: ArrayLike) -> PathSample:
        """Compute position, yaw, course and curvature at distances along the path.

        Args:
            distance: (...) m, from 0 to `length`.

        Returns:
            PathSample of the same shape.

        Raises:
            PathError: a distance that is nan, below 0 or beyond the path's length.
        """
        s = np.asarray(distance, dtype=float)
        if not ((s >= 0) & (s <= self.length)).all():
            raise PathError(
                f"the path runs from 0 to {self.length:g} m; distances asked for run from {s.min():g} to {s.max():g} m"
            )
        k = np.clip(np.searchsorted(self.distance, s, side="right") - 1, 0, len(self.course_rate) - 1)
        along = s - self.distance[k]
        turned = self.course_rate[k] * along
        chord = along * np.sinc(turned / (2 * np.pi))  # sin(turned / 2) / (turned / 2), 1 for a straight line
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
    """Return a copy as an array of floats, or raise."""
    try:
        return np.array(floats(values))
    except (TypeError, ValueError, OverflowError):
        raise PathError(f"a path is made of numbers, in equal rows; got {values!r:.60}") from None


def _legs(x: Array, y: Array) -> tuple[Array, Array]:
    """Return length and direction (n - 1,) of the straight lines between points (n,), or raise."""
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        bad = int(np.argmin(np.isfinite(x) & np.isfinite(y)))
        raise PathError(f"point {bad + 1} of the path is ({x[bad]:g}, {y[bad]:g}): give finite numbers, in metres")
    leg = np.hypot(np.diff(x), np.diff(y))
    if (leg == 0).any():
        k = int(np.argmin(leg))
        raise PathError(f"points {k + 1} and {k + 2} of the path are both at ({x[k]:g}, {y[k]:g}) m: leave one out")
    return leg, np.arctan2(np.diff(y), np.diff(x))


def _from_arcs(start: tuple[float, float], yaw: float, arcs: list[tuple[float, float]], description: str) -> Path:
    """Return a path of arcs (length, curvature) end to end; yaw is the direction of travel."""
    length, curvature = np.array(arcs, dtype=float).T
    if not (np.isfinite([*start, yaw]).all() and np.isfinite(length).all()):
        raise PathError(f"path ({description}) is not finite: give finite numbers, metres and radians")
    if not (length > 0).all():
        raise PathError(f"path ({description}) has no length: give one above 0")
    facing = yaw + np.concatenate([[0.0], np.cumsum(length * curvature)])
    x, y = [float(start[0])], [float(start[1])]
    for (before, after), piece, curve in zip(pairwise(facing), length, curvature, strict=True):
        chord = piece * np.sinc(piece * curve / (2 * np.pi))
        x.append(x[-1] + chord * np.cos((before + after) / 2))
        y.append(y[-1] + chord * np.sin((before + after) / 2))
    return Path(np.concatenate([[0.0], np.cumsum(length)]), np.array(x), np.array(y), facing, facing[:-1], curvature, description)
