"""What a person may say over an imported file, as words: `rockers=a,b` and, as in a rover's own TOML, `wheels.radius_m=0.075`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...errors import RoverError
from .toml_read import arguments, read_values


def parse_joints(words: Sequence[str]) -> dict[str, Sequence[str]]:
    """`["wheels=a,b", "rockers=c,d"]` as names of joints by role."""
    roles: dict[str, Sequence[str]] = {}
    for word in words:
        role, equals, names = word.partition("=")
        if not equals:
            raise RoverError(f"{word!r} names no joints: write it as in rockers=left_rocker_joint,right_rocker_joint")
        roles[role.strip()] = [name.strip() for name in names.split(",") if name.strip()]
    return roles


def parse_numbers(words: Sequence[str]) -> dict[str, Any]:
    """`["wheels.radius_m=0.075", "stops.bogie_deg=[-30, 30]"]` as arguments of `Rover.from_pivots`."""
    values = read_values("\n".join(words), "overruling")
    if wrong := [path for path in values if path.startswith("dh.")]:
        raise RoverError(
            f"{wrong[0]} cannot be overruled alone: give linkage.rocker_pivot_m, linkage.bogie_pivot_m or linkage.hubs_m"
        )
    return arguments(values, "overruling")
