"""Treads of wheels: the round shape about a wheel's axle among the shapes of its links."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .export_tree import DISC
from .import_roles import Hinge
from .tree import Shape, Tree

#: A cylinder this close to the axle's direction lies along it (cosine); a mesh is round if its extents agree this well.
ALONG, ROUND = 0.9, 0.1
#: A shape that is only seen counts before the colliding one if it is larger by this factor: the other is a hub motor.
LARGER = 1.2


@dataclass(frozen=True)
class Tread:
    """Tread of a wheel.

    `radius` and `width` are in the file's unit, `centre` (3,) in the root's frame.

    `shape` is "cylinder", "mesh", ...; `across` marks a cylinder that lies across the axle; `other` is the radius of the
    colliding shape that was passed over for a larger visible one, 0 if there is none.
    """

    radius: float
    width: float
    centre: Array
    shape: str
    collides: bool
    across: bool = False
    other: float = 0.0


def find_tread(tree: Tree, rest: dict[str, Array], links: Iterable[str], wheel: Hinge) -> Tread | None:
    """Return the tread of a wheel.

    It is the largest round shape that collides, or a clearly larger one that is only seen.

    Args:
        tree: the tree.
        rest: T_root_link of every link.
        links: the links that turn with the wheel.
        wheel: its hinge.

    Returns:
        None if no shape of a known size is round about the axle.
    """
    treads = [t for link in links for shape in tree.parts[link].shapes if (t := _tread(shape, rest[link], wheel)) is not None]
    aligned = [t for t in treads if not t.across] or treads
    colliding = max((t for t in aligned if t.collides), key=lambda t: t.radius, default=None)
    seen = max((t for t in aligned if not t.collides), key=lambda t: t.radius, default=None)
    if colliding is None or seen is None:
        return colliding or seen
    if seen.radius > LARGER * colliding.radius:
        return Tread(seen.radius, seen.width, seen.centre, seen.shape, False, seen.across, colliding.radius)
    return colliding


def _tread(shape: Shape, T: Array, wheel: Hinge) -> Tread | None:
    """Return one shape as a tread, None if it is not round about the axle."""
    pose = T @ shape.T
    centre = pose[:3, 3]
    if shape.kind == "mesh":
        return _mesh_tread(shape, pose, wheel)
    if shape.kind not in ("cylinder", "sphere", "ellipsoid", "capsule") or shape.size[0] <= 0:
        return None
    across = shape.kind in ("cylinder", "capsule") and bool(abs(pose[:3, 2] @ wheel.axis) <= ALONG)
    wide = shape.kind == "cylinder" and DISC not in shape.name.split("_")
    return Tread(shape.size[0], shape.size[1] if wide else 0.0, centre, shape.kind, shape.collides, across)


def _mesh_tread(shape: Shape, pose: Array, wheel: Hinge) -> Tread | None:
    """Return a mesh as a tread, None if it is not round.

    The radius is the largest distance from the axle, the width the extent along it.
    """
    if shape.mesh is None:
        return None
    points = shape.mesh.points @ pose[:3, :3].T + pose[:3, 3] - wheel.point
    along = points @ wheel.axis
    radial = points - np.outer(along, wheel.axis)
    first = np.cross(wheel.axis, np.eye(3)[int(np.abs(wheel.axis).argmin())])
    first /= np.linalg.norm(first)
    ends = np.array([[v.min(), v.max()] for v in (radial @ first, radial @ np.cross(wheel.axis, first))])
    radius = float(np.linalg.norm(radial, axis=1).max())
    if radius <= 0 or np.abs(np.abs(ends) - radius).max() > ROUND * radius:
        return None
    middle = float(along.min() + along.max()) / 2
    return Tread(radius, float(np.ptp(along)), wheel.point + middle * wheel.axis, "mesh", shape.collides)
