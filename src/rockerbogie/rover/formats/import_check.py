"""Checks of an imported rover.

They concern its pose on a plane, hub heights, wheel sizes, left against right, and mass.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import Array
from ..frames import wheel_frames
from ..model import Rover
from ..rotations import body_transform
from .import_roles import Roles
from .tree import Tree

#: Differences between left and right above this share of the wheelbase are reported.
SIDES = 1e-3
#: On a plane, tilt and joint angles above these are reported as doubtful, deg.
TILT, JOINT = 2.0, 5.0
#: Radii and masses that differ by more than these shares are reported.
UNEQUAL, MASS = 0.02, 1e-6


def pose_on_plane(rover: Rover) -> Array | None:
    """Return the pose of a rover whose six wheels touch the plane z = 0, near its rest.

    Args:
        rover: the rover.

    Returns:
        (6,) z (m), roll, pitch, rocker, left and right bogie (rad); None if there is no such pose near by.
    """
    from scipy.optimize import root

    half = rover.wheel_width / 2

    def gaps(u: Array) -> Array:
        body = body_transform(0.0, 0.0, u[0], u[1], u[2], 0.0)
        axle = body @ wheel_frames(rover, u[3], u[4:])
        across = axle[:, 2, 1]
        return np.asarray(axle[:, 2, 3] - rover.wheel_radius * np.sqrt(np.maximum(1 - across**2, 0)) - half * np.abs(across))

    start = np.zeros(6)
    start[0] = float((rover.wheel_radius - rover.hubs[:, 2]).mean())
    with np.errstate(all="ignore"):
        answer = root(gaps, start, options={"xtol": 1e-12})
    u = np.asarray(answer.x, dtype=float)
    close = bool(np.isfinite(u).all()) and float(np.abs(gaps(u)).max()) < 1e-6 * rover.wheelbase
    return u if close and float(np.abs(u[1:]).max()) < np.pi / 2 else None


def check_import(rover: Rover, tree: Tree, roles: Roles, override: dict[str, Any]) -> None:
    """Add to the report the rover's pose on a plane and everything about it that looks wrong.

    Args:
        rover: the imported rover.
        tree: the tree it was read from.
        roles: the roles; get the lines.
        override: the caller's numbers.
    """
    _check_plane(rover, roles)
    _check_sizes(rover, roles)
    _check_sides(rover, roles)
    if not {"mass", "body", "rockers", "bogies", "wheels"} & override.keys():
        total = sum(part.mass for part in tree.parts.values())
        guessed = any(line.startswith("mass") for line in roles.guessed)
        if total and not guessed and abs(rover.mass - total) > MASS * total:
            roles.warnings.append(f"the rover's mass is {rover.mass:.6g} kg, the sum of the file's links {total:.6g} kg")


def _check_plane(rover: Rover, roles: Roles) -> None:
    """Report the pose on a plane; warn if it is far from rest or beyond a joint limit."""
    pose = pose_on_plane(rover)
    if pose is None:
        roles.warnings.append("on a plane: no pose near its rest puts all six wheels down; check hubs and wheel sizes")
        return
    names = ("roll", "pitch", "rocker", "left bogie", "right bogie")
    angles = dict(zip(names, np.degrees(pose[1:]), strict=True))
    text = (
        ", ".join(f"{name} {angle + 0.0:.3g} deg" for name, angle in angles.items() if abs(angle) > 5e-4) or "level, joints at 0"
    )
    roles.found.append(f"on a plane all six wheels are down: {text}")
    if max(abs(angles["roll"]), abs(angles["pitch"])) > TILT or max(abs(angles[n]) for n in names[2:]) > JOINT:
        roles.warnings.append(f"on a plane the rover is far from its rest ({text}): check hub heights and wheel sizes")
    limits = [rover.rocker_limits, rover.bogie_limits, rover.bogie_limits]
    beyond = [name for name, angle, (a, b) in zip(names[2:], pose[3:], limits, strict=True) if not a - 1e-9 <= angle <= b + 1e-9]
    if beyond:
        roles.warnings.append(f"on a plane {', '.join(beyond)} would be beyond the joint limits")


def _check_sizes(rover: Rover, roles: Roles) -> None:
    """Warn of wheels of unequal size, and of wheel bottoms at unequal heights."""
    radius = rover.wheel_radius
    if np.ptp(radius) > UNEQUAL * radius.max():
        sizes = ", ".join(f"{name} {r:.4g}" for name, r in zip(rover.wheel_names, radius, strict=True))
        roles.warnings.append(f"wheel radii differ: {sizes} m")
    bottoms = rover.hubs[:, 2] - radius
    if np.ptp(bottoms) > 0.5 * radius.max():
        heights = ", ".join(f"{name} {z:.4g}" for name, z in zip(rover.wheel_names, rover.hubs[:, 2], strict=True))
        roles.warnings.append(f"at rest the wheels' lowest points differ by {np.ptp(bottoms):.4g} m; hubs at z = {heights} m")


def _check_sides(rover: Rover, roles: Roles) -> None:
    """Warn of differences between the left side and the right one's mirror image."""
    mirror = np.array([1.0, -1.0, 1.0])
    least = SIDES * rover.wheelbase
    differences = []
    names = [f"hub {a}/{b}" for a, b in zip(rover.wheel_names[::2], rover.wheel_names[1::2], strict=True)]
    for labels, points in ((["rocker pivot"], rover.rocker_pivot), (["bogie pivot"], rover.bogie_pivot), (names, rover.hubs)):
        centre = (points[::2, 1] + points[1::2, 1]) / 2
        for label, left, right, y in zip(labels, points[::2], points[1::2], centre, strict=True):
            d = left - right * mirror
            d[1] = 2 * (y - _centre(rover))
            if (size := float(np.abs(d).max())) > least:
                differences.append(f"{label} by {size:.4g} m in {'xyz'[int(np.abs(d).argmax())]}")
    for label, sizes in (("wheel radius", rover.wheel_radius), ("wheel width", rover.wheel_width)):
        if (most := float(np.abs(sizes[::2] - sizes[1::2]).max())) > least:
            differences.append(f"{label} by {most:.4g} m")
    for label, masses in (
        ("rocker", [k.mass for k in rover.rockers]),
        ("bogie", [k.mass for k in rover.bogies]),
        ("wheels", [sum(k.mass for k in rover.wheels[s::2]) for s in (0, 1)]),
    ):
        if abs(masses[0] - masses[1]) > SIDES * max(masses):
            differences.append(f"{label} mass {masses[0]:.4g} against {masses[1]:.4g} kg")
    if differences:
        roles.warnings.append(f"left and right differ: {'; '.join(differences)}")


def _centre(rover: Rover) -> float:
    """Return the y of the rover's middle plane, m: the mean over all hubs and pivots."""
    return float(np.concatenate([rover.rocker_pivot, rover.bogie_pivot, rover.hubs])[:, 1].mean())
