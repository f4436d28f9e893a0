"""Triangle meshes as plain arrays, and the solids that machines are drawn with.

Vertices are shared by faces only where the surface is smooth: `vertex_normals` then gives round tubes and sharp edges.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from ...arrays import Array

Index = NDArray[np.int32]
#: Red, green, blue, 0 to 1.
Colour = tuple[float, float, float]


class Solid(NamedTuple):
    """Closed surface: vertices (n, 3), m, and faces (m, 3), counter-clockwise seen from outside."""

    vertices: Array
    faces: Index


class Part(NamedTuple):
    """Part of a machine: triangles of one colour in the frame of the link that it moves with."""

    name: str
    link: str
    vertices: Array  # (n, 3) m, in the link's frame
    faces: Index  # (m, 3), counter-clockwise seen from outside
    colour: Colour


def colour_of(code: str) -> Colour:
    """Return red, green and blue of a colour code.

    Args:
        code: "#rrggbb".

    Returns:
        Three numbers from 0 to 1.
    """
    return int(code[1:3], 16) / 255, int(code[3:5], 16) / 255, int(code[5:7], 16) / 255


def join(solids: Iterable[Solid]) -> Solid:
    """Return the triangles of several solids as one.

    Args:
        solids: at least one.

    Returns:
        All triangles.
    """
    parts = list(solids)
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, first, strict=False)]
    return Solid(np.concatenate([part.vertices for part in parts]), np.concatenate(faces).astype(np.int32))


def vertex_normals(vertices: ArrayLike, faces: ArrayLike) -> Array:
    """Return unit normals at the vertices: means over their faces, weighted by angle.

    Args:
        vertices: (n, 3) m.
        faces: (m, 3) indices.

    Returns:
        (n, 3); 0 for a vertex without a face.
    """
    v, f = np.asarray(vertices, dtype=float), np.asarray(faces)
    corner = v[f]
    side = np.roll(corner, -1, axis=1) - corner  # from each corner to the next
    side /= np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-300)
    normal = np.cross(side[:, 0], side[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    angle = np.arccos(np.clip(-np.einsum("mki,mki->mk", side, np.roll(side, 1, axis=1)), -1.0, 1.0))
    weighted = (angle[..., None] * normal[:, None]).reshape(-1, 3)
    out = np.stack([np.bincount(f.ravel(), weighted[:, k], len(v)) for k in range(3)], axis=1)
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300))


def convex(points: ArrayLike) -> Solid:
    """Return the convex hull of points, with flat faces.

    Args:
        points: (n, 3) not all in one plane, m.

    Returns:
        The triangles; no two share a vertex.
    """
    p = np.asarray(points, dtype=float)
    hull = ConvexHull(p)
    corner = p[hull.simplices]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    inward = np.einsum("ni,ni->n", normal, hull.equations[:, :3]) < 0
    corner[inward] = corner[inward][:, ::-1]
    return Solid(corner.reshape(-1, 3), np.arange(3 * len(corner), dtype=np.int32).reshape(-1, 3))


def box(low: ArrayLike, high: ArrayLike, chamfer: float = 0.0) -> Solid:
    """Return a box with its edges cut off.

    Args:
        low, high: (3,) lowest and highest corner, m.
        chamfer: width cut from each edge, m; at most 0.45 of the shortest side is used.

    Returns:
        The triangles.
    """
    ends = np.stack([np.asarray(low, dtype=float), np.asarray(high, dtype=float)])
    cut = min(chamfer, 0.45 * float(np.ptp(ends, axis=0).min()))
    corner = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    inward = np.array([[1 - 2 * i, 1 - 2 * j, 1 - 2 * k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=float)
    if cut <= 0:
        return convex(corner)
    return convex(np.concatenate([corner + cut * inward * (1 - np.eye(3)[axis]) for axis in range(3)]))


def lathe(profile: Sequence[tuple[float, float]], sides: int) -> Solid:
    """Return a solid of revolution about the y axis.

    Args:
        profile: (radius, y) of the points of its outline, m. From −y to +y it is the outside; it starts and ends on the axis,
            or returns to its start for a ring.
        sides: number of faces around.

    Returns:
        The triangles: smooth around, sharp between the segments of the profile.
    """
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    spoke = np.stack([np.sin(angle), np.zeros(sides), np.cos(angle)], axis=1)
    k = np.arange(sides)
    after = (k + 1) % sides
    strips = []
    for (r0, y0), (r1, y1) in pairwise(profile):
        points = np.concatenate([r0 * spoke + (0, y0, 0), r1 * spoke + (0, y1, 0)])
        faces = []
        if r0 > 0:
            faces.append(np.stack([k, after, k + sides], axis=1))
        if r1 > 0:
            faces.append(np.stack([after, after + sides, k + sides], axis=1))
        strips.append(Solid(points, np.concatenate(faces).astype(np.int32)))
    return join(strips)


def tube(start: ArrayLike, end: ArrayLike, radius: float, end_radius: float | None = None, sides: int = 16) -> Solid:
    """Return a tube, closed at its ends.

    Args:
        start, end: (3,) centres of its ends, m.
        radius: at the start, m.
        end_radius: at the end, m; default: the same.
        sides: number of faces around.

    Returns:
        The triangles.
    """
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = max(float(np.linalg.norm(b - a)), 1e-9)
    last = radius if end_radius is None else end_radius
    solid = lathe([(0.0, 0.0), (radius, 0.0), (last, length), (0.0, length)], sides)
    return Solid(solid.vertices @ aim((b - a) / length).T + a, solid.faces)


def aim(direction: ArrayLike) -> Array:
    """Return rotations that turn the y axis towards given directions.

    Args:
        direction: (..., 3), not 0.

    Returns:
        (..., 3, 3); the x axis is horizontal, or along x for a vertical direction.
    """
    y = np.asarray(direction, dtype=float)
    y = y / np.linalg.norm(y, axis=-1, keepdims=True)
    upright = np.abs(y[..., 2:]) > 0.999
    x = np.where(upright, (1.0, 0.0, 0.0), np.stack([y[..., 1], -y[..., 0], np.zeros_like(y[..., 0])], axis=-1))
    x = x - np.sum(x * y, axis=-1, keepdims=True) * y
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=-1)
