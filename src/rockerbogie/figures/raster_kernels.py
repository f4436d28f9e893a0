"""Kernels of pictures: the nearest triangle of each pixel, and its illumination."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.decorators import njit, owning_njit

Array = NDArray[np.float64]
Index = NDArray[np.int32]

AMBIENT, FILL, SUN = 0.42, 0.16, 0.52  # light from the sky, from behind the viewer, from the sun


@njit
def rasterise(tri: Array, index: Index, near: Array) -> None:
    """Rasterise triangles (n, 3, 3) of u, v, nearness: the nearest one in each pixel.

    Args:
        tri: (n, 3, 3) corners: u, v (px), nearness.
        index: (height, width) written: the nearest triangle, −1 if none.
        near: (height, width) written: its nearness.
    """
    height, width = index.shape
    for t in range(tri.shape[0]):
        u0, v0, n0 = tri[t, 0]
        u1, v1, n1 = tri[t, 1]
        u2, v2, n2 = tri[t, 2]
        area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
        if area == 0.0:
            continue
        top, bottom = math.ceil(min(v0, v1, v2) - 0.5), math.floor(max(v0, v1, v2) - 0.5)  # rows whose centre line it may cover
        first, last = math.ceil(min(u0, u1, u2) - 0.5), math.floor(max(u0, u1, u2) - 0.5)
        for row in range(max(0, top), min(height - 1, bottom) + 1):
            v = row + 0.5
            for col in range(max(0, first), min(width - 1, last) + 1):
                u = col + 0.5
                b1 = ((u - u0) * (v2 - v0) - (u2 - u0) * (v - v0)) / area
                b2 = ((u1 - u0) * (v - v0) - (u - u0) * (v1 - v0)) / area
                if b1 < 0.0 or b2 < 0.0 or b1 + b2 > 1.0:
                    continue
                n = n0 + b1 * (n1 - n0) + b2 * (n2 - n0)
                if n > near[row, col]:
                    near[row, col] = n
                    index[row, col] = t


@owning_njit
def shade(
    index: Index, tri: Array, corners: Array, normals: Array, colours: Array, ruled: NDArray[np.bool_], eye: Array,
    to_sun: Array, shadow: Array, sun_axes: Array, sun_eye: Array, sun_scale: float, sun_shift: Array,
    bias: float, grid: float, line: float, finer: int, image: Array,
) -> None:  # fmt: skip
    """Colour the pixels of a picture by sky, fill light and sun with soft shadows.

    Args:
        index: (height, width) triangle of each pixel, −1 for none, from `rasterise`.
        tri: (n, 3, 3) corners on the picture: u, v (px), nearness.
        corners: (n, 3, 3) corners in the world, m.
        normals: (n, 3, 3) unit normals at the corners.
        colours: (n, 3) red, green, blue, 0 to 1.
        ruled: (n,) True for triangles with grid lines.
        eye: (3,) position of the camera, m.
        to_sun: (3,) unit vector.
        shadow: (sun height, sun width) nearness to the sun of the nearest surface.
        sun_axes: (3, 3) axes of the sun's view.
        sun_eye: (3,) its origin, m.
        sun_scale: its pixels per metre.
        sun_shift: (2,) its pixel of the origin.
        bias: m; a point is lifted by it before it is compared with the shadow.
        grid: distance of the grid lines, m; 0: no lines.
        line: half width of a grid line, m.
        finer: index has finer × finer samples per pixel.
        image: (height / finer, width / finer, 4) red, green, blue, alpha; written, must be 0 before.
    """
    height, width = index.shape
    sun_height, sun_width = shadow.shape
    p, n, q = np.empty(3), np.empty(3), np.empty(3)
    for row in range(height):
        for col in range(width):
            t = index[row, col]
            if t < 0:
                continue
            u0, v0, n0 = tri[t, 0]
            u1, v1, n1 = tri[t, 1]
            u2, v2, n2 = tri[t, 2]
            area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
            u, v = col + 0.5, row + 0.5
            b1 = ((u - u0) * (v2 - v0) - (u2 - u0) * (v - v0)) / area
            b2 = ((u1 - u0) * (v - v0) - (u - u0) * (v1 - v0)) / area
            w0, w1, w2 = (1.0 - b1 - b2) * n0, b1 * n1, b2 * n2  # perspective: weights over depth
            total = w0 + w1 + w2
            nn, seen, away = 0.0, 0.0, 0.0
            for k in range(3):
                p[k] = (w0 * corners[t, 0, k] + w1 * corners[t, 1, k] + w2 * corners[t, 2, k]) / total
                n[k] = w0 * normals[t, 0, k] + w1 * normals[t, 1, k] + w2 * normals[t, 2, k]
                nn += n[k] * n[k]
                seen += n[k] * (eye[k] - p[k])
                away += (eye[k] - p[k]) ** 2
            flip = (1.0 if seen > 0.0 else -1.0) / max(np.sqrt(nn), 1e-12)
            lambert = 0.0
            for k in range(3):
                n[k] *= flip
                lambert += n[k] * to_sun[k]
            if lambert > 0.0:
                for i in range(3):  # the point, lifted off its own surface, in the sun's view
                    q[i] = 0.0
                    for k in range(3):
                        q[i] += sun_axes[i, k] * (p[k] + 2.0 * bias * n[k] - sun_eye[k])
                su, sv = int(q[0] * sun_scale + sun_shift[0]), int(q[1] * sun_scale + sun_shift[1])
                dark = 0
                for r in range(max(0, sv - 2), min(sun_height, sv + 3)):
                    for c in range(max(0, su - 2), min(sun_width, su + 3)):
                        dark += shadow[r, c] > bias - q[2]
                lambert *= 1.0 - dark / 25.0
            level = AMBIENT * (0.8 + 0.2 * n[2]) + FILL * abs(seen) / np.sqrt(nn * away) + SUN * max(0.0, lambert)
            if ruled[t] and grid > 0.0:
                off = min(abs(p[0] - grid * np.round(p[0] / grid)), abs(p[1] - grid * np.round(p[1] / grid)))
                level *= 1.0 - 0.28 * min(1.0, max(0.0, 2.0 - off / line))
            share = 1.0 / (finer * finer)
            for k in range(3):
                image[row // finer, col // finer, k] += share * min(1.0, colours[t, k] * level)
            image[row // finer, col // finer, 3] += share
