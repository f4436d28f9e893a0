"""Checks of a rover's parameters on construction.

Each error states the value, the limit and the remedy.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Protocol

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from ..arrays import Array
from ..errors import RoverError
from .differential import MOST_COEFFICIENTS, check_ratio


class LinkFields(Protocol):
    """The fields of a link that the checks read."""

    @property
    def mass(self) -> float: ...
    @property
    def com(self) -> Array: ...
    @property
    def inertia(self) -> Array: ...


class RoverFields(Protocol):
    """The fields of a rover that the checks read."""

    @property
    def name(self) -> str: ...
    @property
    def wheel_names(self) -> tuple[str, ...]: ...
    @property
    def rocker_pivot(self) -> Array: ...
    @property
    def bogie_pivot(self) -> Array: ...
    @property
    def hubs(self) -> Array: ...
    @property
    def wheel_radius(self) -> Array: ...
    @property
    def wheel_width(self) -> Array: ...
    @property
    def wheel_torque(self) -> Array: ...
    @property
    def rocker_limits(self) -> Array: ...
    @property
    def bogie_limits(self) -> Array: ...
    @property
    def differential(self) -> Array: ...
    @property
    def body_box(self) -> Array: ...
    @property
    def links(self) -> Sequence[LinkFields]: ...
    @property
    def mass(self) -> float: ...


def check_rover(rover: RoverFields) -> None:
    """Validate a rover's parameters.

    Args:
        rover: the fields to check.

    Raises:
        RoverError: the first impossible value.
    """
    check = _Check(rover.name)
    _check_lengths(rover, check)
    for label in ("rocker_limits", "bogie_limits"):
        low, high = getattr(rover, label)
        check(low <= 0 <= high and low < high, f"{label} ({low:g}, {high:g}) must hold the rest angle 0 between them")
        check(np.isinf(low) or low > -np.pi, f"{label} {low:g} rad is beyond a half turn: are these degrees?")
        check(np.isinf(high) or high < np.pi, f"{label} {high:g} rad is beyond a half turn: are these degrees?")
    _check_wheels(rover, check)
    _check_differential(rover, check)
    _check_links(rover, check)


def possible_inertia(inertia: Array) -> bool:
    """Return True if a rigid body can have this inertia.

    It must be symmetric, with no moment negative or above the sum of the other two.

    Args:
        inertia: (3, 3), kg m².

    Returns:
        True if it is possible, up to rounding.
    """
    moments = np.linalg.eigvalsh(inertia)
    slack = 1e-9 * float(np.abs(inertia).max())
    even = bool(np.abs(inertia - inertia.T).max() <= slack)
    return even and bool(moments[0] >= -slack and moments[2] <= moments[0] + moments[1] + 1e3 * slack)


class _Check:
    """Check that raises with the rover's name before the sentence."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(self, good: bool, sentence: str) -> None:
        if not good:
            raise RoverError(f"rover {self.name!r}: {sentence}")


def _check_lengths(rover: RoverFields, check: _Check) -> None:
    """Check names, lengths and sides."""
    check(len(rover.wheel_names) == 6 and len(set(rover.wheel_names)) == 6, "wheel_names needs six different names")
    for label in ("rocker_pivot", "bogie_pivot", "hubs", "wheel_radius", "wheel_width", "steering_offset", "body_box"):
        check(bool(np.isfinite(getattr(rover, label)).all()), f"{label} holds a value that is not finite")
    check(bool((rover.wheel_radius > 0).all()), f"wheel_radius is {rover.wheel_radius.min():g} m; give one above 0")
    check(bool((rover.wheel_width >= 0).all()), f"wheel_width is {rover.wheel_width.min():g} m; give 0 or more")
    check(bool((rover.wheel_torque > 0).all()), f"wheel_torque is {rover.wheel_torque.min():g} N m; give limits above 0")
    left, right = rover.hubs[::2, 1], rover.hubs[1::2, 1]
    check(bool((left > right).all()), "a left hub is not to the left (greater y) of its right one: y points left")
    arm = np.hypot(*(rover.bogie_pivot - rover.rocker_pivot)[:, [0, 2]].T)
    check(bool((arm > 1e-6).all()), "bogie pivot and rocker pivot coincide in the side view: the linkage has no rocker")
    check(bool((rover.body_box[0] < rover.body_box[1]).all()), "body_box: its first corner must be below its second")


def _check_wheels(rover: RoverFields, check: _Check) -> None:
    """Check that no two wheels overlap, at rest or with a bogie at a joint limit."""
    for i, j in combinations((4, 2, 0, 5, 3, 1), 2):
        apart, need = _gap(rover, rover.hubs, i, j)
        names = f"{rover.wheel_names[i]} and {rover.wheel_names[j]}"
        check(apart >= need, f"wheels {names} overlap: hubs {apart:.4g} m apart, radii sum {need:.4g} m")
    for limit in rover.bogie_limits[np.isfinite(rover.bogie_limits)]:
        hubs = rover.hubs.copy()
        for i in range(2, 6):
            x, _, z = rover.hubs[i] - rover.bogie_pivot[i % 2]
            turned = (x * np.cos(limit) + z * np.sin(limit), 0.0, z * np.cos(limit) - x * np.sin(limit))
            hubs[i] = rover.bogie_pivot[i % 2] + turned + (0.0, rover.hubs[i, 1] - rover.bogie_pivot[i % 2, 1], 0.0)
        for i in range(2, 6):
            apart, need = _gap(rover, hubs, i, i % 2)
            names = f"{rover.wheel_names[i]} and {rover.wheel_names[i % 2]}"
            degrees = f"{np.degrees(limit):.4g} deg"
            check(apart >= need, f"a bogie cannot reach its limit at {degrees}: wheels {names} meet before; narrow bogie_limits")


def _gap(rover: RoverFields, hubs: Array, i: int, j: int) -> tuple[float, float]:
    """Return the distance of two hubs in the side view, and the least one allowed, m.

    The latter is 0 if the wheels pass side by side.
    """
    beside = abs(hubs[i, 1] - hubs[j, 1]) > (rover.wheel_width[i] + rover.wheel_width[j]) / 2
    apart = float(np.hypot(*(hubs[i] - hubs[j])[[0, 2]]))
    return apart, 0.0 if beside else float(rover.wheel_radius[i] + rover.wheel_radius[j])


def _check_differential(rover: RoverFields, check: _Check) -> None:
    """Check that the right rocker turns against the left one over the whole reach."""
    c = rover.differential
    good = c.ndim == 1 and 2 <= len(c) <= MOST_COEFFICIENTS and bool(np.isfinite(c).all())
    check(good, f"differential needs 2 to {MOST_COEFFICIENTS} finite coefficients")
    check(c[0] == 0 and c[1] < 0, "differential must turn the right rocker against the left one: c[0] = 0 and c[1] < 0")
    check_ratio(float(c[1]), f"rover {rover.name!r}")
    low, high = np.where(np.isfinite(rover.rocker_limits), rover.rocker_limits, 0.0)
    reach = np.linspace(low, high, 201)
    turns = polyval(reach, polyder(c)) < 0
    stuck = float(np.degrees(np.abs(reach[~turns]).min(initial=np.inf)))
    remedy = "narrow rocker_limits"
    check(bool(turns.all()), f"differential stops turning the right rocker at {stuck:.3g} deg of the left one: {remedy}")


def _check_links(rover: RoverFields, check: _Check) -> None:
    """Check the number of links, and their masses, centres and inertias."""
    for label, count in (("rockers", 2), ("bogies", 2), ("wheels", 6)):
        check(len(getattr(rover, label)) == count, f"{label} needs {count} links, got {len(getattr(rover, label))}")
    for link in rover.links:
        check(bool(np.isfinite(link.mass) and link.mass >= 0), f"a link's mass is {link.mass:g} kg; give 0 or more")
        for label, shape in (("com", (3,)), ("inertia", (3, 3))):
            value = np.asarray(getattr(link, label))
            check(value.shape == shape, f"a link's {label} has shape {value.shape}; give {shape}")
            check(bool(np.isfinite(value).all()), f"a link's {label} holds a value that is not finite")
        why = "symmetric, not negative, no moment above the other two's sum"
        check(possible_inertia(link.inertia), f"a link's inertia is one that no body can have: {why}")
    check(rover.mass > 0, "the rover has no mass; give mass= in kg")
