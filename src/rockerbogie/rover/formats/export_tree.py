"""A rover as a tree of links and joints, for the writers of URDF, SDF and logs."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyval

from ...arrays import Array
from ...errors import expect
from ..frames import ON_BOGIE, WHEEL_SIDE
from ..model import LOAD_ROVER, Link, Rover
from .tree import Joint, Part, Shape, Tree, connected, from_rpy, place

SIDES = ("left", "right")
#: A steering knuckle takes this share of its wheel's mass and inertia: simulators cannot move a link without mass.
KNUCKLE_SHARE = 0.1
#: A wheel of width 0 is written as a cylinder this many radii wide; `DISC` in the shape's name marks it for the reader.
DISC_WIDTH = 0.2
DISC = "disc"


def right_limits(rover: Rover) -> Array:
    """Return the right rocker's limits (2,) that the left one's imply, rad.

    They are infinite where the left one's are.

    Args:
        rover: the rover.

    Returns:
        (2,) rad.
    """
    ends = [
        float(polyval(v, rover.differential)) if np.isfinite(v) else float(np.sign(v) * np.sign(rover.differential[1]) * np.inf)
        for v in rover.rocker_limits
    ]
    return np.sort(ends)


def differential_inertia(rover: Rover) -> float:
    """Return the inertia that resists an error of the differential, at joint angles 0.

    That is 1 / (J M⁻¹ Jᵀ), with the mass matrix M of all joints and of the free body, and J the derivative of right − p(left).

    Args:
        rover: the rover.

    Returns:
        kg m².
    """
    tree = tree_of(rover)
    rest, joints = tree.rest(), list(tree.joints.values())
    above = {joint.child: joint for joint in joints}
    M = np.zeros((6 + len(joints), 6 + len(joints)))
    for part in tree.parts.values():
        com = rest[part.name][:3, 3] + part.com
        turn, move = np.zeros((3, len(M))), np.zeros((3, len(M)))
        move[:, :3], turn[:, 3:6] = np.eye(3), np.eye(3)
        move[:, 3:6] = np.cross(np.eye(3), com).T
        link = part.name
        while link in above:
            joint = above[link]
            at = 6 + joints.index(joint)
            turn[:, at] = joint.axis
            move[:, at] = np.cross(turn[:, at], com - rest[link][:3, 3])
            link = joint.parent
        M += part.mass * move.T @ move + turn.T @ part.inertia @ turn
    J = np.zeros(len(M))
    for k, joint in enumerate(joints):
        J[6 + k] = {"rocker_left": -rover.differential[1], "rocker_right": 1.0}.get(joint.child, 0.0)
    return float(1.0 / (J @ np.linalg.solve(M, J)))


def tree_of(rover: Rover) -> Tree:
    """Return the rover as a tree of links and joints.

    Every link's frame is parallel to the body's at rest, with its origin at its joint.

    Args:
        rover: the rover.

    Returns:
        A tree rooted at `base_link`.

    Raises:
        RoverError: not a rover.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    parts: dict[str, Part] = {}
    joints: dict[str, Joint] = {}

    def add(name: str, link: Link, origin: Array, share: float = 1.0) -> Part:
        parts[name] = Part(name, link.mass * share, link.com - origin, link.inertia * share)
        return parts[name]

    def join(
        parent: str,
        child: str,
        at: Array,
        axis: tuple[int, int, int],
        limits: Array,
        mimic: tuple[str, tuple[float, ...]] | None = None,
    ) -> None:
        low, high = (float(v) for v in limits)
        joints[f"{child}_joint"] = Joint(
            f"{child}_joint", "hinge", parent, child, place(at), np.array(axis, float), (low, high), mimic
        )

    free = np.array([-np.inf, np.inf])
    low, high = rover.body_box
    body = add("base_link", rover.body, np.zeros(3))
    body.shapes.append(Shape("box", tuple(high - low), place((low + high) / 2), "body"))
    for s, side in enumerate(SIDES):
        rocker, bogie = f"rocker_{side}", f"bogie_{side}"
        add(rocker, rover.rockers[s], rover.rocker_pivot[s])
        add(bogie, rover.bogies[s], rover.bogie_pivot[s])
        mimic = ("rocker_left_joint", (0.0, float(rover.differential[1]))) if s else None
        join("base_link", rocker, rover.rocker_pivot[s], (0, 1, 0), right_limits(rover) if s else rover.rocker_limits, mimic)
        join(rocker, bogie, rover.bogie_pivot[s] - rover.rocker_pivot[s], (0, 1, 0), rover.bogie_limits)
    for i, name in enumerate(rover.wheel_names):
        s = WHEEL_SIDE[i]
        parent, origin = (
            (f"bogie_{SIDES[s]}", rover.bogie_pivot[s]) if ON_BOGIE[i] else (f"rocker_{SIDES[s]}", rover.rocker_pivot[s])
        )
        share = 1.0
        if rover.steers[i]:
            axis = rover.hubs[i] + (*rover.steering_offset[i], 0.0)
            add(f"steer_{name}", rover.wheels[i], axis, KNUCKLE_SHARE)
            join(parent, f"steer_{name}", axis - origin, (0, 0, 1), free)
            parent, origin, share = f"steer_{name}", axis, 1 - KNUCKLE_SHARE
        wheel = add(f"wheel_{name}", rover.wheels[i], rover.hubs[i], share)
        join(parent, f"wheel_{name}", rover.hubs[i] - origin, (0, 1, 0), free)
        radius, width = float(rover.wheel_radius[i]), float(rover.wheel_width[i])
        label, breadth = ("tread", width) if width else (DISC, DISC_WIDTH * radius)
        wheel.shapes.append(Shape("cylinder", (radius, breadth), place(turn=from_rpy(np.pi / 2, 0, 0)), f"{label}_{name}"))
    linear = not rover.differential[2:].any()
    tree = Tree(rover.name, parts, joints, None if linear else rover.differential.copy())
    return connected(tree, rover.name)[0]
