"""What URDF, SDF and MJCF have in common: links with mass and shapes, joined into a tree.

A rover becomes a tree to be written in any of them, and a tree read from any of them becomes a rover again (`find`, `build`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import RoverError, expect
from ..frames import ON_BOGIE, WHEEL_SIDE
from ..model import LOAD_ROVER, Link, Rover

Array = NDArray[np.float64]

SIDES = ("left", "right")
#: A steering knuckle takes this share of its wheel's mass and inertia: simulators cannot move a link that has none.
KNUCKLE_SHARE = 0.1
#: A wheel of width 0 collides as a cylinder this many radii wide; `DISC` in the shape's name tells the reader so.
DISC_WIDTH = 0.2
DISC = "disc"


@dataclass
class Shape:
    """A primitive: box (size 3), cylinder (radius, length, along z), sphere (radius), ellipsoid (3) or mesh; T_link_shape."""

    kind: str
    size: tuple[float, ...]
    T: Array
    name: str = ""
    collides: bool = True


@dataclass
class Part:
    """A link of the tree, its mass properties along its own frame's axes; mass 0 where none are given."""

    name: str
    mass: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    shapes: list[Shape] = field(default_factory=list)


@dataclass
class Joint:
    """A joint at rest: T_parent_child, the axis (3,) in the child's frame, limits (rad), and whom it follows."""

    name: str
    kind: Literal["fixed", "hinge", "other"]
    parent: str
    child: str
    T: Array
    axis: Array | None = None
    limits: tuple[float, float] | None = None
    mimic: tuple[str, float, float] | None = None  # joint, multiplier, offset

    @property
    def locked(self) -> bool:
        """True where both limits are one angle."""
        return self.limits is not None and self.limits[0] == self.limits[1] and abs(self.limits[0]) < np.inf


@dataclass
class Tree:
    """Links and joints by name, and what the reader has to say about them. `order` runs from the root outwards."""

    name: str
    parts: dict[str, Part]
    joints: dict[str, Joint]
    differential: Array | None = None  # the polynomial, where the file carries one
    notes: list[str] = field(default_factory=list)
    root: str = ""
    inbound: dict[str, Joint] = field(default_factory=dict)  # by child
    order: list[str] = field(default_factory=list)

    def arrange(self, what: str) -> Tree:
        """Find the root and the order, and check that it is a tree.

        Raises:
            RoverError: a joint to a link that is not there, a link with two parents, a ring.
        """
        for joint in self.joints.values():
            for end in (joint.parent, joint.child):
                if end not in self.parts:
                    raise RoverError(f"{what}: joint {joint.name!r} joins link {end!r}, which the file does not hold")
            if joint.child in self.inbound:
                raise RoverError(
                    f"{what}: link {joint.child!r} hangs on two joints, {self.inbound[joint.child].name!r} and {joint.name!r}"
                )
            self.inbound[joint.child] = joint
        roots = [name for name in self.parts if name not in self.inbound]
        if not roots:
            raise RoverError(f"{what}: its links form a ring: no link is the root")
        children: dict[str, list[str]] = {name: [] for name in self.parts}
        for joint in self.joints.values():
            children[joint.parent].append(joint.child)
        trees = {}
        for root in roots:
            trees[root] = [root]
            for name in trees[root]:
                trees[root] += children[name]
        self.root = max(roots, key=lambda root: len(trees[root]))
        self.order = trees[self.root]
        held = set(self.order)
        if loose := [name for name in self.parts if name not in held]:
            self.notes.append(
                f"left out {len(loose)} links that hang on nothing ({', '.join(loose[:4])}{', ...' * (len(loose) > 4)})"
            )
            for name in loose:
                del self.parts[name]
            self.joints = {name: joint for name, joint in self.joints.items() if joint.child in self.parts}
        return self

    def rest(self) -> dict[str, Array]:
        """T_root_link (4, 4) of every link with all joints at 0, locked ones where they are locked, followers at their offset."""
        T = {self.root: np.eye(4)}
        for name in self.order[1:]:
            joint = self.inbound[name]
            T[name] = T[joint.parent] @ joint.T
            angle = joint.limits[0] if joint.locked and joint.limits else joint.mimic[2] if joint.mimic else 0.0
            if angle and joint.kind == "hinge" and joint.axis is not None:
                T[name] = T[name] @ place(turn=about(joint.axis, angle))
        return T


def place(at: ArrayLike = (0.0, 0.0, 0.0), turn: Array | None = None) -> Array:
    """A transform (4, 4) from a place (3,) and a rotation (3, 3)."""
    T = np.eye(4)
    T[:3, 3] = at
    if turn is not None:
        T[:3, :3] = turn
    return T


def about(axis: Array, angle: float) -> Array:
    """The rotation (3, 3) by `angle` (rad) about a unit axis."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


def from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll), as URDF and SDF mean it."""
    x, y, z = np.eye(3)
    return about(z, yaw) @ about(y, pitch) @ about(x, roll)


def tree_of(rover: Rover) -> Tree:
    """The rover as a tree: every link's frame lies along the body's at rest, at the joint that carries it."""
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
        mimic: tuple[str, float, float] | None = None,
    ) -> None:
        low, high = (float(v) for v in limits)
        joints[f"{child}_joint"] = Joint(
            f"{child}_joint", "hinge", parent, child, place(at), np.array(axis, float), (low, high), mimic
        )

    free = np.array([-np.inf, np.inf])
    low, high = rover.body_box
    body = add("base_link", rover.body, np.zeros(3))
    body.shapes.append(Shape("box", tuple(high - low), place((low + high) / 2), "body"))
    right_limits = np.sort(rover.right_rocker(rover.rocker_limits)) if np.isfinite(rover.rocker_limits).all() else free
    for s, side in enumerate(SIDES):
        rocker, bogie = f"rocker_{side}", f"bogie_{side}"
        add(rocker, rover.rockers[s], rover.rocker_pivot[s])
        add(bogie, rover.bogies[s], rover.bogie_pivot[s])
        follow = ("rocker_left_joint", float(rover.differential[1]), 0.0) if s else None
        join("base_link", rocker, rover.rocker_pivot[s], (0, 1, 0), right_limits if s else rover.rocker_limits, follow)
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
    return tree.arrange(rover.name)
