"""Sizes of a rover as dials: pivots, wheels, mass, limits, or the paper's K1 to K11."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..errors import RoverError
from ..rover.model import Link, Rover

#: Angle from which a joint limit of the page means no limit, degrees.
NO_LIMIT = 90.0


class Dial(NamedTuple):
    """One number of a rover that a visitor changes."""

    key: str
    label: str
    low: float
    high: float
    step: float
    value: float  # as shown, rounded
    exact: float  # of the rover


def pivot_dials(rover: Rover) -> list[Dial]:
    """Return the dials of a rover given by its pivots and hubs.

    Args:
        rover: the rover.

    Returns:
        Dials in m, kg and degrees. Lengths are those of the left side.
    """
    size = rover.wheelbase
    front, middle, rear = _order(rover)
    radius, width, track = float(rover.wheel_radius[0]), float(rover.wheel_width[0]), float(np.ptp(rover.hubs[:, 1]))
    dials = [
        _length("wheel_radius", "wheel radius", radius, size, 0.3 * radius, 1.8 * radius),
        _length("wheel_width", "wheel width", width, size, 0.0, max(2.0 * radius, width)),
        _length("track", "track width", track, size, 0.5 * track, 1.5 * track),
    ]
    for name, label, point in (
        ("rocker_pivot", "rocker pivot", rover.rocker_pivot[0]),
        ("bogie_pivot", "bogie pivot", rover.bogie_pivot[0]),
        ("front", "front hub", rover.hubs[front]),
        ("middle", "middle hub", rover.hubs[middle]),
        ("rear", "rear hub", rover.hubs[rear]),
    ):
        for axis, letter in ((0, "x"), (2, "z")):
            value = float(point[axis])
            dials.append(_length(f"{name}_{letter}", f"{label} {letter}", value, size, value - 0.3 * size, value + 0.3 * size))
    mass = rover.mass
    dials.append(_dial("mass", "mass [kg]", mass, _tenth(mass / 200), 0.2 * mass, 3 * mass))
    for key, label, limits in (
        ("rocker_limit", "rocker ± [°]", rover.rocker_limits),
        ("bogie_limit", "bogie ± [°]", rover.bogie_limits),
    ):
        widest = _limit(limits)
        dials.append(Dial(key, label, 1.0, NO_LIMIT, 0.5, round(widest, 1), widest))
    return dials


def dh_dials(rover: Rover) -> list[Dial]:
    """Return the dials of the paper's constants.

    Args:
        rover: the rover.

    Returns:
        K1 to K11, m; K9 in degrees.

    Raises:
        RoverError: the rover is not of Table I's form.
    """
    dials = []
    for key, value in rover.to_dh().items():
        if key == "K9":
            angle = math.degrees(value)
            dials.append(_dial(key, "K9 [°]", angle, 0.1, angle - 40, angle + 40))
        else:
            room = 0.3 * rover.wheelbase
            low = max(value - room, 0.3 * value) if key in ("K3", "K6", "K7", "K10", "K11") else value - room
            dials.append(_length(key, key, value, rover.wheelbase, low, value + room))
    return dials


def has_dh(rover: Rover) -> bool:
    """Return True if a rover has the paper's constants.

    Args:
        rover: the rover.

    Returns:
        True if `dh_dials` applies.
    """
    try:
        rover.to_dh()
    except RoverError:
        return False
    return True


def changed(base: Rover, values: dict[str, float]) -> tuple[Rover, list[str]]:
    """Return a rover with other sizes.

    A dial at its shown value leaves the base's own value as it is. Differences to the base's own values are added to both sides,
    so that a rover whose sides differ keeps that difference.

    Args:
        base: rover from which the dials were made.
        values: key of a dial -> value; keys of `pivot_dials` or of `dh_dials`.

    Returns:
        The rover and notes on its masses.

    Raises:
        RoverError: an impossible rover.
    """
    own = {dial.key: dial for dial in (dh_dials(base) if "K1" in values else pivot_dials(base))}
    moved = {key: value for key, value in values.items() if abs(value - own[key].value) > 1e-9}
    if not moved:
        return base, []
    values = {key: dial.exact for key, dial in own.items()} | moved
    delta = {key: value - own[key].exact for key, value in moved.items()}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        rover = _with_constants(base, values) if "K1" in values else _with_pivots(base, values, delta)
    return rover, [str(one.message) for one in caught]


def _with_constants(base: Rover, values: dict[str, float]) -> Rover:
    """Return a rover with other constants of Table I."""
    constants = {key: math.radians(value) if key == "K9" else value for key, value in values.items() if key.startswith("K")}
    shape = Rover.from_dh(**constants)
    return base.replace(
        rocker_pivot=shape.rocker_pivot, bogie_pivot=shape.bogie_pivot, hubs=shape.hubs, wheel_radius=shape.wheel_radius
    )


def _with_pivots(base: Rover, values: dict[str, float], delta: dict[str, float]) -> Rover:
    """Return a rover with other pivots, hubs, wheels, mass or joint limits."""
    rocker, bogie, hubs = (np.array(a) for a in (base.rocker_pivot, base.bogie_pivot, base.hubs))
    wide = values["track"] / float(np.ptp(base.hubs[:, 1])) if "track" in delta else 1.0
    for points in (rocker, bogie, hubs):
        points[:, 1] *= wide
    for axis, letter in ((0, "x"), (2, "z")):
        rocker[:, axis] += delta.get(f"rocker_pivot_{letter}", 0.0)
        bogie[:, axis] += delta.get(f"bogie_pivot_{letter}", 0.0)
        for name, left in zip(("front", "middle", "rear"), _order(base), strict=True):
            hubs[[left, left + 1], axis] += delta.get(f"{name}_{letter}", 0.0)
    changes: dict[str, Any] = {
        "rocker_pivot": rocker, "bogie_pivot": bogie, "hubs": hubs,
        "wheel_radius": base.wheel_radius + delta.get("wheel_radius", 0.0),
        "wheel_width": np.maximum(base.wheel_width + delta.get("wheel_width", 0.0), 0.0),
    }  # fmt: skip
    limits: dict[str, Any] = {}
    for key in ("rocker_limit", "bogie_limit"):
        if key in delta:
            bound = math.inf if values[key] >= NO_LIMIT else math.radians(values[key])
            limits[f"{key}s"] = np.array([-bound, bound])
    rover = base.replace(
        **{key: value for key, value in changes.items() if not np.array_equal(value, getattr(base, key))}, **limits
    )
    return _scaled(rover, values["mass"] / base.mass) if "mass" in delta else rover


def _scaled(rover: Rover, factor: float) -> Rover:
    """Return a rover whose masses and inertias are multiplied by a factor."""

    def link(one: Link) -> Link:
        return replace(one, mass=one.mass * factor, inertia=one.inertia * factor)

    return rover.replace(
        masses="keep",
        body=link(rover.body),
        rockers=tuple(map(link, rover.rockers)),
        bogies=tuple(map(link, rover.bogies)),
        wheels=tuple(map(link, rover.wheels)),
    )


def _order(rover: Rover) -> tuple[int, int, int]:
    """Return the indices of the left wheels from front to rear."""
    front, middle, rear = sorted((0, 2, 4), key=lambda i: -float(rover.hubs[i, 0]))
    return front, middle, rear


def _limit(limits: np.ndarray) -> float:
    """Return the wider of two joint limits, degrees; `NO_LIMIT` without one."""
    widest = float(np.abs(limits).max())
    return NO_LIMIT if not math.isfinite(widest) else min(round(math.degrees(widest), 6), NO_LIMIT)


def _length(key: str, label: str, value: float, size: float, low: float, high: float) -> Dial:
    """Return the dial of a length, m."""
    return _dial(key, label, value, _tenth(size / 500), low, high)


def _dial(key: str, label: str, exact: float, step: float, low: float, high: float) -> Dial:
    """Return a dial whose numbers are rounded to its step, a power of 10."""
    digits = -round(math.log10(step))
    least, most, shown = (round(float(value), digits) for value in (low, high, exact))
    return Dial(key, label, least, most, step, shown, float(exact))


def _tenth(value: float) -> float:
    """Return the power of 10 that is at most a value."""
    return float(10.0 ** math.floor(math.log10(value)))
