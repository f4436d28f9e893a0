"""Links and joints common to URDF, SDF and MJCF.

They form a graph as the file declares it, which is rooted at any of its links.

A rover becomes a tree to be written in any of them (`export_tree.tree_of`); the trees of a file become a rover again
(`import_build.build_rover`).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from ...arrays import Array
from ...errors import RoverError
from .meshes import Mesh


@dataclass
class Shape:
    """A collision or visual shape: a primitive or a mesh, at `T` (T_link_shape).

    `kind` and `size` (m): "box" (3 edges), "cylinder" and "capsule" (radius, length along z), "sphere" (radius), "ellipsoid"
    (3 radii), "mesh" (empty; its `mesh` is None if the file was not read).
    """

    kind: str
    size: tuple[float, ...]
    T: Array
    name: str = ""
    collides: bool = True
    mesh: Mesh | None = None

    @property
    def unread(self) -> bool:
        """Return True if the shape's size is not available (a mesh that was not read)."""
        return self.kind == "mesh" and self.mesh is None

    def extent(self, direction: Array, T: Array) -> tuple[float, float]:
        """Return the lowest and highest coordinate of the shape along a direction.

        Args:
            direction: (3,) unit vector in the outer frame.
            T: (4, 4) T_outer_link.

        Returns:
            (low, high), m; (inf, -inf) for a mesh that was not read.
        """
        pose = T @ self.T
        d = pose[:3, :3].T @ direction
        middle = float(direction @ pose[:3, 3])
        size = np.array(self.size)
        if self.kind == "mesh":
            if self.mesh is None:
                return np.inf, -np.inf
            along = self.mesh.points @ d
            return middle + float(along.min()), middle + float(along.max())
        if self.kind == "box":
            half = float(np.abs(d) @ size) / 2
        elif self.kind == "cylinder":
            half = float(size[0] * np.sqrt(max(0.0, 1 - d[2] ** 2)) + size[1] / 2 * abs(d[2]))
        elif self.kind == "capsule":
            half = float(size[0] + size[1] / 2 * abs(d[2]))
        else:
            half = float(np.linalg.norm(size * d)) if self.kind == "ellipsoid" else float(size[0])
        return middle - half, middle + half

    def mass_properties(self, density: float) -> tuple[float, Array, Array]:
        """Return mass (kg), centre (3,) (m) and inertia (3, 3) about it (kg m²) in the link's frame.

        Args:
            density: kg/m³.

        Returns:
            Zeros for a mesh that was not read.
        """
        centre, volume, moments = np.zeros(3), 0.0, np.zeros((3, 3))
        if self.mesh is not None:
            centre, volume, moments = self.mesh.centre, self.mesh.volume, self.mesh.inertia
        elif self.kind in ("box", "ellipsoid", "sphere"):
            edges = np.array(self.size if self.kind != "sphere" else self.size * 3) * (1.0 if self.kind == "box" else 2.0)
            volume = float(np.prod(edges)) * (1.0 if self.kind == "box" else np.pi / 6)
            moments = np.diag(edges @ edges - edges**2) * volume / (12 if self.kind == "box" else 20)
        elif self.kind in ("cylinder", "capsule"):
            r, length = self.size
            tube, ball = np.pi * r**2 * length, 4 / 3 * np.pi * r**3 if self.kind == "capsule" else 0.0
            volume = tube + ball
            across = tube * (3 * r**2 + length**2) / 12 + ball * (0.4 * r**2 + 0.375 * r * length + length**2 / 4)
            moments = np.diag([across, across, tube * r**2 / 2 + 0.4 * ball * r**2])
        R = self.T[:3, :3]
        return density * volume, R @ centre + self.T[:3, 3], density * R @ moments @ R.T


@dataclass
class Part:
    """Link of a robot file: its mass properties along its own axes, and its shapes.

    The mass is 0 if the file gives none.
    """

    name: str
    mass: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    shapes: list[Shape] = field(default_factory=list)


@dataclass
class Joint:
    """A joint between two links.

    At joint angle q, T_parent_child = `T` · (rotation by q about `axis` through `anchor`, both in the child's frame).
    `limits` are (low, high) of q, rad. `mimic` is (leader, coefficients): q = Σ cₖ (leader's q)ᵏ.
    """

    name: str
    kind: Literal["fixed", "hinge", "other"]
    parent: str
    child: str
    T: Array
    axis: Array | None = None
    limits: tuple[float, float] | None = None
    mimic: tuple[str, tuple[float, ...]] | None = None
    anchor: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def locked(self) -> bool:
        """Return True if both limits are one finite angle."""
        return self.limits is not None and self.limits[0] == self.limits[1] and abs(self.limits[0]) < np.inf

    def reversed(self) -> Joint:
        """Return the same joint with parent and child exchanged.

        Its angle keeps its sense and its limits.

        Returns:
            A new joint.
        """
        axis = None if self.axis is None else -(self.T[:3, :3] @ self.axis)
        anchor = self.T[:3, :3] @ self.anchor + self.T[:3, 3]
        return replace(self, parent=self.child, child=self.parent, T=inverse(self.T), axis=axis, anchor=anchor)


@dataclass
class Tree:
    """Connected links and joints by name, rooted at `root`; `order` runs from the root outwards.

    `notes` are repairs made by the reader; `dropped` maps a property that a rover does not have to the names that have it.
    """

    name: str
    parts: dict[str, Part]
    joints: dict[str, Joint]
    differential: Array | None = None  # the polynomial, if the file holds one of ours
    notes: list[str] = field(default_factory=list)
    dropped: dict[str, list[str]] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)  # mesh files that could not be read, with the reason
    root: str = ""
    inbound: dict[str, Joint] = field(default_factory=dict)  # by child, as seen from the root
    order: list[str] = field(default_factory=list)

    def drop(self, kind: str, name: str) -> None:
        """Record that a joint or link has a property that a rover does not have.

        Args:
            kind: the property, for the report.
            name: the joint or link that has it.
        """
        self.dropped.setdefault(kind, []).append(name)

    def rooted(self, root: str) -> Tree:
        """Return the same tree seen from another link: joints that point towards it are reversed.

        Args:
            root: name of a link.

        Returns:
            A tree that shares parts and joints with this one.
        """
        around: dict[str, list[Joint]] = {name: [] for name in self.parts}
        for joint in self.joints.values():
            around[joint.parent].append(joint)
            around[joint.child].append(joint)
        inbound: dict[str, Joint] = {}
        order, queue, seen = [], deque([root]), {root}
        while queue:
            name = queue.popleft()
            order.append(name)
            for joint in around[name]:
                outward = joint if joint.parent == name else joint.reversed()
                if outward.child not in seen:
                    seen.add(outward.child)
                    inbound[outward.child] = outward
                    queue.append(outward.child)
        return replace(self, root=root, inbound=inbound, order=order)

    def rest_angles(self) -> dict[str, float]:
        """Return each joint's angle at rest, rad.

        It is 0; a locked joint's is its limit, a follower's what its leader gives it.

        Returns:
            Angles by joint, rad.
        """
        angles: dict[str, float] = {}
        for name in self.joints:
            chain = [name]
            while chain[-1] not in angles:
                joint = self.joints[chain[-1]]
                leader = joint.mimic[0] if joint.mimic and not joint.locked else ""
                if leader not in self.joints or leader in chain:
                    offset = joint.mimic[1][0] if joint.mimic else 0.0
                    angles[joint.name] = joint.limits[0] if joint.locked and joint.limits else offset
                else:
                    chain.append(leader)
            for follower in reversed(chain[:-1]):
                mimic = self.joints[follower].mimic
                assert mimic is not None
                angles[follower] = float(polyval(angles[mimic[0]], mimic[1]))
        return angles

    def rest(self) -> dict[str, Array]:
        """Return T_root_link (4, 4) of every link with all joints at rest.

        Returns:
            Transforms (4, 4) by link.
        """
        angles = self.rest_angles()
        T = {self.root: np.eye(4)}
        for name in self.order[1:]:
            joint = self.inbound[name]
            T[name] = T[joint.parent] @ joint.T
            angle = angles[joint.name]
            if angle and joint.kind == "hinge" and joint.axis is not None:
                turn = about(joint.axis, angle)
                T[name] = T[name] @ place(joint.anchor - turn @ joint.anchor, turn)
        return T


def connected(tree: Tree, what: str, *, loops: bool = False) -> list[Tree]:
    """Split links and joints into connected trees, the largest first.

    A joint that closes a loop is dropped with a note, "other" joints before hinges, later ones before earlier ones.

    Args:
        tree: all links and joints of a model.
        what: the file's name, for messages.
        loops: True if the format allows loops.

    Returns:
        One tree for each connected set of links, rooted at the link that is no joint's child (the first of several).

    Raises:
        RoverError: no link, a joint to a link that is not there, or a loop in a format without loops.
    """
    if not tree.parts:
        raise RoverError(f"{what}: it holds no link")
    for joint in tree.joints.values():
        for end in (joint.parent, joint.child):
            if end not in tree.parts:
                raise RoverError(f"{what}: joint {joint.name!r} joins link {end!r}, which the file does not hold")
    leader = {name: name for name in tree.parts}

    def top(name: str) -> str:
        while leader[name] != name:
            leader[name] = leader[leader[name]]
            name = leader[name]
        return name

    kept: dict[str, Joint] = {}
    parents: dict[str, list[str]] = {}
    for joint in sorted(tree.joints.values(), key=lambda j: j.kind == "other"):
        ends = top(joint.parent), top(joint.child)
        if ends[0] == ends[1]:
            if not loops:
                raise RoverError(f"{what}: its links form a ring, closed by joint {joint.name!r}: remove one of its joints")
            tree.notes.append(f"joint {joint.name!r} closes a loop; left open: the rover's differential stands for such bars")
            continue
        leader[ends[1]] = ends[0]
        kept[joint.name] = joint
        parents.setdefault(joint.child, []).append(joint.name)
    several = [f"{child!r} ({', '.join(names)})" for child, names in parents.items() if len(names) > 1]
    if several and not loops:
        tree.notes.append(f"a link is the child of more than one joint, read as joined to all of them: {', '.join(several)}")
    groups: dict[str, list[str]] = {}
    for name in tree.parts:
        groups.setdefault(top(name), []).append(name)
    trees = []
    for names in sorted(groups.values(), key=len, reverse=True):
        inside = set(names)
        root = next((name for name in names if name not in parents), names[0])
        part = replace(
            tree,
            parts={name: tree.parts[name] for name in names},
            joints={name: kept[name] for name in tree.joints if name in kept and kept[name].parent in inside},
        )
        trees.append(part.rooted(root))
    return trees


def inverse(T: Array) -> Array:
    """Return the inverse of a rigid transform (4, 4).

    Args:
        T: (4, 4) rigid transform.

    Returns:
        (4, 4).
    """
    R = T[:3, :3].T
    return place(-(R @ T[:3, 3]), R)


def place(at: ArrayLike = (0.0, 0.0, 0.0), turn: Array | None = None) -> Array:
    """Return a transform (4, 4) from a position (3,) and a rotation (3, 3).

    Args:
        at: (3,) position.
        turn: (3, 3) rotation; None: identity.

    Returns:
        (4, 4).
    """
    T = np.eye(4)
    T[:3, 3] = at
    if turn is not None:
        T[:3, :3] = turn
    return T


def about(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) by `angle` (rad) about a unit axis (3,).

    Args:
        axis: (3,) unit vector.
        angle: rad.

    Returns:
        (3, 3).
    """
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


def from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return Rz(yaw) Ry(pitch) Rx(roll) (3, 3), the convention of URDF and SDF; angles in rad.

    Args:
        roll, pitch, yaw: rad.

    Returns:
        (3, 3).
    """
    x, y, z = np.eye(3)
    return about(z, yaw) @ about(y, pitch) @ about(x, roll)
