"""Named obstacles: profiles in the plane of travel, extruded across it; m and rad.

A `Profile` is a polyline with x that never decreases: vertical faces are allowed, overhangs are not. The terrain continues
level before its first and after its last vertex. The rover comes from −x; obstacles begin at x = 0, z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import floats, is_number
from ..errors import TerrainError

Array = NDArray[np.float64]

__all__ = ["Profile", "ditch", "profile", "ramp", "stairs", "step"]

#: Largest number of vertices of a profile.
MOST_VERTICES = 5000


@dataclass(frozen=True, eq=False)
class Profile:
    """Terrain in the plane of travel, the same for both sides of the rover.

    Attributes:
        x, z: (n,) vertices, m; x never decreases. Equal values of x make a vertical face.
        name: short name for messages and pictures.
    """

    x: Array
    z: Array
    name: str = "profile"

    def __post_init__(self) -> None:
        x, z = (_vertices(axis, getattr(self, axis)) for axis in "xz")
        if x.shape != z.shape or x.size < 2:
            raise TerrainError(f"a profile has {x.size} values of x and {z.size} of z: give the same number, at least 2")
        if x.size > MOST_VERTICES:
            raise TerrainError(f"a profile has {x.size} vertices, more than {MOST_VERTICES}: thin it out")
        back = np.flatnonzero(np.diff(x) < 0)
        if back.size:
            k = int(back[0])
            raise TerrainError(f"x of a profile must not decrease: x[{k}] = {x[k]:.10g} m, x[{k + 1}] = {x[k + 1]:.10g} m")
        face = np.diff(x) == 0
        fold = np.flatnonzero(face[1:] & face[:-1] & (np.diff(z)[1:] * np.diff(z)[:-1] < 0))
        if fold.size:
            raise TerrainError(
                f"the profile goes up and down at x = {x[fold[0] + 1]:.10g} m: give the wall or slot there some width"
            )
        for axis, values in (("x", x), ("z", z)):
            values = values.copy()
            values.flags.writeable = False
            object.__setattr__(self, axis, values)

    def __repr__(self) -> str:
        return f"<Profile {self.name}: {self.x.size} vertices, {np.ptp(self.x):.4g} m long, {np.ptp(self.z):.4g} m high>"


def _vertices(axis: str, values: ArrayLike) -> Array:
    """Return one coordinate of the vertices (n,), m."""
    try:
        array = floats(values)
    except (TypeError, ValueError, OverflowError):
        raise TerrainError(f"{axis} of a profile must be numbers, not {values!r:.60}") from None
    if array.ndim != 1 or not np.isfinite(array).all():
        raise TerrainError(f"{axis} of a profile has shape {array.shape}: give a list of finite numbers, m")
    return array


def profile(x: ArrayLike, z: ArrayLike, name: str = "profile") -> Profile:
    """Return a profile from its vertices.

    Args:
        x: (n,) m, never decreasing.
        z: (n,) heights, m.
        name: short name for messages and pictures.

    Returns:
        The profile.

    Raises:
        TerrainError: values that are not finite, fewer than 2 or of different number; x that decreases; a wall or slot
            without width.
    """
    return Profile(x, z, name)  # type: ignore[arg-type]


def step(height: float) -> Profile:
    """Return a step up with a vertical face.

    Args:
        height: m, above 0.

    Returns:
        The profile.

    Raises:
        TerrainError: a height that is not above 0.
    """
    height = _above("height", height)
    return Profile([0.0, 0.0], [0.0, height], f"a step of {height:.4g} m")  # type: ignore[arg-type]


def ditch(width: float, depth: float) -> Profile:
    """Return a ditch with vertical walls and a level floor.

    Args:
        width: m, above 0.
        depth: m, above 0.

    Returns:
        The profile.

    Raises:
        TerrainError: a size that is not above 0.
    """
    width, depth = _above("width", width), _above("depth", depth)
    return Profile([0.0, 0.0, width, width], [0.0, -depth, -depth, 0.0], f"a ditch of {width:.4g} m")  # type: ignore[arg-type]


def ramp(angle: float, height: float) -> Profile:
    """Return a ramp up to a level top.

    Args:
        angle: slope, rad, above 0 and below π/2.
        height: m, above 0.

    Returns:
        The profile.

    Raises:
        TerrainError: an angle or height out of range.
    """
    angle, height = _above("angle", angle), _above("height", height)
    if not angle < np.pi / 2:
        raise TerrainError(f"angle of a ramp is {angle:g}: give radians below pi/2; a vertical face is a step")
    return Profile([0.0, height / np.tan(angle)], [0.0, height], f"a ramp of {np.degrees(angle):.4g} deg")  # type: ignore[arg-type]


def stairs(rise: float, run: float, count: int = 5) -> Profile:
    """Return stairs up to a level top.

    Args:
        rise: height of each step, m, above 0.
        run: depth of each tread, m, above 0.
        count: number of steps, at least 1.

    Returns:
        The profile.

    Raises:
        TerrainError: a size that is not above 0, or a count below 1.
    """
    rise, run = _above("rise", rise), _above("run", run)
    if not (isinstance(count, int | np.integer) and not isinstance(count, bool) and count >= 1):
        raise TerrainError(f"count of stairs is {count!r}: give a whole number, at least 1")
    k = np.arange(count)
    x, z = np.stack([k * run, k * run], axis=1).ravel(), np.stack([k * rise, (k + 1) * rise], axis=1).ravel()
    return Profile(x, z, f"{count} stairs of {rise:.4g} by {run:.4g} m")


def _above(name: str, value: float) -> float:
    """Return a size as a float above 0."""
    if not (is_number(value) and value > 0.0):
        raise TerrainError(f"{name} of an obstacle is {value!r:.40}: give a finite number above 0")
    return float(value)
