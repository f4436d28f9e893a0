"""Checks of a rover's sizes: files in a wrong unit fail them."""

from __future__ import annotations

import numpy as np

from ...errors import RoverError
from ..model import Rover

#: A rover's wheelbase lies between these, m.
SMALLEST, LARGEST = 0.02, 20.0
#: A rover's parts are within this many wheelbases of its wheels.
FURTHEST = 10.0


def check_wheelbase(length: float, what: str) -> None:
    """Check that a wheelbase has a rover's size.

    Args:
        length: m.
        what: the file's name, for messages.

    Raises:
        RoverError: it has not; the file may be in another unit.
    """
    if not SMALLEST <= length <= LARGEST:
        hint = "is the file in millimetres?" if length > LARGEST else "is the file in another unit?"
        raise RoverError(
            f"{what}: its wheelbase would be {length:.4g} m, and must lie between {SMALLEST} and {LARGEST:g} m: {hint}"
        )


def check_size(rover: Rover, what: str) -> None:
    """Check a rover's proportions.

    Numbers in another unit and misplaced ones are out of proportion.

    Args:
        rover: the rover.
        what: the file's name, for messages.

    Raises:
        RoverError: the first part that is out of proportion.
    """
    check_wheelbase(rover.wheelbase, what)
    reach = FURTHEST * rover.wheelbase
    middle = rover.hubs.mean(axis=0)
    parts = {
        "rocker pivot": rover.rocker_pivot,
        "bogie pivot": rover.bogie_pivot,
        "hub": rover.hubs,
        "corner of the body's box": rover.body_box,
        "centre of mass": np.array([link.com for link in rover.links]),
    }
    for label, points in parts.items():
        far = float(np.linalg.norm(points - middle, axis=1).max())
        if far > reach:
            raise RoverError(
                f"{what}: a {label} would be {far:.4g} m from the wheels, on a rover {rover.wheelbase:.4g} m long: metres?"
            )
    for link in rover.links:
        moment = float(np.linalg.eigvalsh(link.inertia)[2])
        if moment > link.mass * reach**2:
            raise RoverError(
                f"{what}: a part of {link.mass:.4g} kg would have a moment of inertia of {moment:.4g} kg m2, "
                f"on a rover {rover.wheelbase:.4g} m long: is it in kg m2?"
            )
    for label, size in (
        ("radius", rover.wheel_radius),
        ("width", rover.wheel_width),
        ("steering offset", np.abs(rover.steering_offset)),
    ):
        if size.max() > rover.wheelbase:
            raise RoverError(
                f"{what}: a wheel's {label} would be {size.max():.4g} m, on a rover {rover.wheelbase:.4g} m long: metres?"
            )
