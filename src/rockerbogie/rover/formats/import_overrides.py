"""Overrides of an import, given as words.

Roles as `rockers=a,b`; numbers by the keys of a rover file, as `wheels.radius_m=0.075`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...errors import RoverError
from .toml_read import arguments, read_values


def parse_joints(words: Sequence[str]) -> dict[str, Sequence[str]]:
    """Return names of joints by role.

    Args:
        words: such as ["wheels=a,b", "rockers=c,d"].

    Returns:
        Names of joints by role.

    Raises:
        RoverError: a word without "=".
    """
    roles: dict[str, Sequence[str]] = {}
    for word in words:
        role, equals, names = word.partition("=")
        if not equals:
            raise RoverError(f"{word!r} names no joints: write it as in rockers=left_rocker_joint,right_rocker_joint")
        roles[role.strip()] = [name.strip() for name in names.split(",") if name.strip()]
    return roles


def parse_numbers(words: Sequence[str]) -> dict[str, Any]:
    """Return arguments of `Rover.from_pivots`.

    Args:
        words: such as ["wheels.radius_m=0.075", "stops.bogie_deg=[-30, 30]"].

    Returns:
        Arguments by name, in metres and radians.

    Raises:
        RoverError: an unknown key, or a value of the wrong kind.
    """
    values = read_values("\n".join(words), "overrides")
    if wrong := [path for path in values if path.startswith("dh.")]:
        raise RoverError(
            f"{wrong[0]} cannot be overridden alone: give linkage.rocker_pivot_m, linkage.bogie_pivot_m or linkage.hubs_m"
        )
    return arguments(values, "overrides")
