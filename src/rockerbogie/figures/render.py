"""Small software renderer: triangles, a camera, one sun with shadows; it needs no display.

Matplotlib's 3-D axes sort whole polygons and cannot draw a wheel in a depression. Here each pixel shows the nearest
surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import raster_kernels

Array = NDArray[np.float64]

FINER = 2  # samples per pixel and side, averaged against jagged edges
SHADOW_BIAS = 0.004  # relative to the scene's size: with less, surfaces shade themselves; with more, shadows are displaced


@dataclass(frozen=True)
class Mesh:
    """Triangles: corners (n, 3, 3), m; normals at the corners; colours (n, 3) from 0 to 1.

    `ruled` (n,) is True for triangles on which grid lines are drawn.
    """

    corners: Array
    normals: Array
    colours: Array
    ruled: NDArray[np.bool_]

    @classmethod
    def flat(cls, corners: ArrayLike, colour: ArrayLike) -> Mesh:
        """Return triangles with one normal each.

        Args:
            corners: (n, 3, 3), m.
            colour: (3,) or (n, 3), 0 to 1.

        Returns:
            The triangles.
        """
        c = np.asarray(corners, dtype=float)
        normal = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        return cls.smooth(c, np.repeat(normal[:, None], 3, axis=1), colour)

    @classmethod
    def smooth(cls, corners: Array, normals: Array, colour: ArrayLike, *, ruled: bool = False) -> Mesh:
        """Return triangles with a normal at each corner.

        Args:
            corners: (n, 3, 3), m.
            normals: (n, 3, 3) at the corners.
            colour: (3,) or (n, 3), 0 to 1.
            ruled: draw the grid of the terrain on them.

        Returns:
            The triangles.
        """
        colours = np.broadcast_to(np.asarray(colour, dtype=float), (len(corners), 3))
        return cls(corners, normals, np.array(colours), np.full(len(corners), ruled))

    @classmethod
    def join(cls, meshes: Sequence[Mesh]) -> Mesh:
        """Return one mesh of several.

        Args:
            meshes: the parts.

        Returns:
            All triangles.
        """
        parts = [[getattr(m, name) for m in meshes] for name in ("corners", "normals", "colours", "ruled")]
        return cls(*(np.concatenate(p) for p in parts))


@dataclass(frozen=True)
class Camera:
    """Camera at `eye`; `axes` rows: right, down, forward; pixels = scale · plane + shift."""

    eye: Array
    axes: Array
    scale: float
    shift: Array
    perspective: bool
    size: tuple[int, int]  # width, height, px

    @classmethod
    def framing(
        cls,
        points: ArrayLike,
        azimuth: float,
        elevation: float,
        size: tuple[int, int],
        *,
        margin: tuple[float, float, float, float] = (0.03, 0.03, 0.03, 0.03),
        perspective: bool = True,
    ) -> Camera:
        """Return a camera at an azimuth and elevation that sees all points.

        `margin` is the share of the picture kept free: left, right, top, bottom.

        Args:
            points: (..., 3) that must be in the picture, m.
            azimuth: of the camera from the points, rad, from +x counter-clockwise.
            elevation: of the camera, rad.
            size: width and height, px.
            margin: share of the picture kept free: left, right, top, bottom.
            perspective: False for a parallel projection.

        Returns:
            The camera.
        """
        p = np.asarray(points, dtype=float).reshape(-1, 3)
        columns = np.ascontiguousarray(p.T)  # NumPy reduces long rows ten times as fast as long columns
        centre = (columns.max(axis=1) + columns.min(axis=1)) / 2
        back = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        axes = np.stack([right, np.cross(-back, right), -back])
        radius = float(np.sqrt(((columns - centre[:, None]) ** 2).sum(axis=0).max()))
        loose = cls(centre + 5.5 * radius * back, axes, 1.0, np.zeros(2), perspective, size)
        plane = np.ascontiguousarray(loose.project(p)[:, :2].T)
        low, high = plane.min(axis=1), plane.max(axis=1)
        room = np.array([size[0] * (1 - margin[0] - margin[1]), size[1] * (1 - margin[2] - margin[3])])
        scale = float((room / np.maximum(high - low, 1e-12)).min())
        middle = np.array([size[0] * (1 + margin[0] - margin[1]), size[1] * (1 + margin[2] - margin[3])]) / 2
        return cls(loose.eye, axes, scale, middle - scale * (low + high) / 2, perspective, size)

    def project(self, points: ArrayLike) -> Array:
        """Project points onto the picture.

        Args:
            points: (..., 3), m.

        Returns:
            (..., 3): pixels right, pixels down, nearness. Nearness is linear over the picture.
        """
        given = np.asarray(points, dtype=float)
        away = given.reshape(-1, 3) - self.eye
        p: Array = np.einsum("nj,ij->ni", away, self.axes)  # no BLAS: its threads cost more than they gain
        if self.perspective:
            p[:, 2] = 1 / p[:, 2]
            p[:, :2] *= p[:, 2:]
        else:
            p[:, 2] *= -1
        p[:, :2] = p[:, :2] * self.scale + self.shift
        return p.reshape(given.shape)

    def enlarged(self, factor: int) -> Camera:
        """Return the same view with more pixels.

        Args:
            factor: of the number of pixels per side.

        Returns:
            The camera.
        """
        size = (self.size[0] * factor, self.size[1] * factor)
        return Camera(self.eye, self.axes, self.scale * factor, self.shift * factor, self.perspective, size)


def render(mesh: Mesh, camera: Camera, *, sun: tuple[float, float], grid: float = 0.0) -> Array:
    """Render a picture, transparent where there is no surface.

    Args:
        mesh: the scene.
        camera: the view.
        sun: azimuth and elevation of the light, rad.
        grid: spacing of the lines drawn on the terrain, m; 0: none.

    Returns:
        (height, width, 4) red, green, blue, alpha, 0 to 1.
    """
    fine = camera.enlarged(FINER)
    seen = fine.project(mesh.corners)
    index, _ = _visible(seen, fine)
    light = Camera.framing(mesh.corners, *sun, (camera.size[0], camera.size[0]), perspective=False)
    _, shadow = _visible(light.project(mesh.corners), light)
    extent = float(np.ptp(np.ascontiguousarray(mesh.corners.reshape(-1, 3).T), axis=1).max())
    pixel = float(np.linalg.norm(mesh.corners[0, 0] - camera.eye)) / camera.scale  # m, approximate
    image = np.zeros((camera.size[1], camera.size[0], 4))
    raster_kernels.shade(
        index, seen, mesh.corners, mesh.normals, np.ascontiguousarray(mesh.colours), mesh.ruled, fine.eye,
        -light.axes[2], shadow, light.axes, light.eye, light.scale, light.shift,
        SHADOW_BIAS * extent, grid, 0.5 * pixel, FINER, image,
    )  # fmt: skip
    alpha = image[..., 3:]
    image[..., :3] = np.where(alpha > 0, image[..., :3] / np.maximum(alpha, 1e-12), 1.0)
    return image


def hidden_by(mesh: Mesh, camera: Camera, points: ArrayLike) -> Array:
    """Return the depth by which surfaces hide points.

    Args:
        mesh: the scene.
        camera: a perspective camera.
        points: (n, 3), m.

    Returns:
        (n,) m; 0 for visible points, NaN outside the picture.
    """
    _, near = _visible(camera.project(mesh.corners), camera)
    place = camera.project(points)
    out = np.full(len(place), np.nan)
    for i, (u, v, n) in enumerate(place):
        if 0 <= u < camera.size[0] and 0 <= v < camera.size[1]:
            seen = near[int(v), int(u)]
            out[i] = max(0.0, 1 / n - 1 / seen) if seen > 0 else 0.0
    return out


def _visible(triangles: Array, camera: Camera) -> tuple[NDArray[np.int32], Array]:
    """Return the index of the projected triangle in each pixel (-1: none) and its nearness."""
    index = np.full((camera.size[1], camera.size[0]), -1, dtype=np.int32)
    near = np.full(index.shape, -np.inf)
    raster_kernels.rasterise(triangles, index, near)
    return index, near
