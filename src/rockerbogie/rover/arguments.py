"""Arguments of a rover in any of the shapes that are accepted, as full arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, floats
from ..errors import RoverError


def numbers(name: str, value: ArrayLike) -> Array:
    """Return a value as an array of floats, not shared with it.

    Args:
        name: the argument's name, for messages.
        value: numbers.

    Returns:
        (...) float64.

    Raises:
        RoverError: not numbers, or rows of different length.
    """
    try:
        return np.array(floats(value))
    except (TypeError, ValueError, OverflowError):
        raise RoverError(f"{name} must be numbers, not {value!r}") from None


def array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a value as an array of one shape.

    Args:
        name: the argument's name, for messages.
        value: numbers.
        shape: the shape it must have.

    Returns:
        The array, of that shape.

    Raises:
        RoverError: another shape.
    """
    points = numbers(name, value)
    if points.shape != shape:
        raise RoverError(f"{name} has shape {points.shape}; give {shape}")
    return points


def sides(name: str, value: ArrayLike) -> Array:
    """Return a point of each side (2, 3), m; a single one is mirrored to the right.

    Args:
        name: the argument's name, for messages.
        value: (3,) left, or (2, 3) left and right.

    Returns:
        (2, 3) left and right.

    Raises:
        RoverError: another shape, or the left point on the right.
    """
    points = numbers(name, value)
    if points.shape not in ((3,), (2, 3)):
        raise RoverError(f"{name} has shape {points.shape}; give (3,) for the left side or (2, 3) for both")
    both = np.stack([points, points * (1, -1, 1)]) if points.ndim == 1 else points
    if both[0, 1] < both[1, 1]:
        raise RoverError(f"{name} has its left pivot at y = {both[0, 1]:g} m, right of its right one: give the left side, y > 0")
    return both


def hubs(value: ArrayLike) -> Array:
    """Return hubs (6, 3) in wheel order, m; left ones alone are mirrored.

    Args:
        value: (3, 3) left, or (6, 3).

    Returns:
        (6, 3).

    Raises:
        RoverError: another shape.
    """
    points = numbers("hubs", value)
    if points.shape == (3, 3):
        return np.stack([points, points * (1, -1, 1)], axis=1).reshape(6, 3)
    if points.shape == (6, 3):
        return points
    raise RoverError(f"hubs has shape {points.shape}; give (3, 3) for the left side or (6, 3) in wheel order")


def per_wheel(name: str, value: ArrayLike) -> Array:
    """Return one value for each wheel (6,).

    Args:
        name: the argument's name, for messages.
        value: a number, (3,) per axle or (6,).

    Returns:
        (6,).

    Raises:
        RoverError: another shape.
    """
    points = numbers(name, value)
    if points.shape == (3,):
        return np.repeat(points, 2)
    if points.shape in ((), (6,)):
        return np.broadcast_to(points, (6,)).copy()
    raise RoverError(f"{name} has shape {points.shape}; give a number, (3,) per axle or (6,) per wheel")


def flags(name: str, value: ArrayLike) -> NDArray[np.bool_]:
    """Return True or False for each wheel (6,).

    Args:
        name: the argument's name, for messages.
        value: True or False, 1 or 0; one, (3,) per axle or (6,).

    Returns:
        (6,).

    Raises:
        RoverError: another shape, or other values.
    """
    given = np.asarray(value)
    mask = per_wheel(name, given.astype(float) if given.dtype == bool else value)
    if not np.isin(mask, (0.0, 1.0)).all():
        raise RoverError(f"{name} must be true or false for each wheel, not {value!r}")
    return np.asarray(mask == 1.0, dtype=np.bool_)


def offsets(value: ArrayLike) -> Array:
    """Return steering axis minus hub (6, 2), m; y is mirrored to the right.

    Args:
        value: (2,), (3, 2) left, or (6, 2).

    Returns:
        (6, 2).

    Raises:
        RoverError: another shape.
    """
    points = numbers("steering_offset", value)
    if points.shape == (2,):
        points = np.tile(points, (3, 1))
    if points.shape == (3, 2):
        return np.stack([points, points * (1, -1)], axis=1).reshape(6, 2)
    if points.shape == (6, 2):
        return points
    raise RoverError(f"steering_offset has shape {points.shape}; give (2,), (3, 2) for the left side or (6, 2)")


def wheel_names(hubs: Array) -> tuple[str, ...]:
    """Return names of the wheels by their positions: side L or R, then F, M or R.

    Args:
        hubs: (6, 3) in wheel order, m.

    Returns:
        Six names.
    """
    outer = "F" if hubs[0, 0] > hubs[4, 0] else "R"
    other = "R" if outer == "F" else "F"
    return tuple(side + axle for axle in (outer, "M", other) for side in "LR")
