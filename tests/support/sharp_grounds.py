"""Terrain as sharp as its grid allows, rovers and positions on it, drawn from seeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import rockerbogie as rb
from support.helpers import random_rover

Array = NDArray[np.float64]

FAMILIES = ("coefficients", "nodes", "chequered", "ripples", "ridges", "steps", "plateaus", "noise")
PRESETS = ("curiosity", "elhami-dashti", "osr", "perseverance", "rocky7", "sawppy")
FINEST, COARSEST = 1 / 40, 4.0  # cell size in wheel diameters
MOST_NODES = 320  # along one axis


def spline_nodes(c: Array) -> Array:
    """Return node heights (rows, cols) of the spline with coefficients c (rows + 2, cols + 2).

    The interpolating spline through these heights has about these coefficients, except near the edge of the map.
    """
    along = (c[:-2] + 4.0 * c[1:-1] + c[2:]) / 6.0
    return np.asarray((along[:, :-2] + 4.0 * along[:, 1:-1] + along[:, 2:]) / 6.0)


def coefficients(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return heights (rows, cols) whose spline has random coefficients.

    They are Gaussian, of two values, sparse, or Cauchy distributed.
    """
    shape = (rows + 2, cols + 2)
    which = rng.integers(4)
    if which == 0:
        c = rng.normal(size=shape) / 2
    elif which == 1:
        c = rng.choice([-1.0, 1.0], shape)
    elif which == 2:
        c = rng.choice([-1.0, 1.0], shape) * (rng.random(shape) < rng.uniform(0.02, 0.3))
    else:
        c = rng.standard_cauchy(shape).clip(-3, 3) / 3
    return spline_nodes(np.asarray(c))


def nodes(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return level heights (rows, cols) with single nodes raised or lowered."""
    share = 10 ** rng.uniform(-2.0, -0.7)
    sign = rng.choice([(1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)])
    return np.asarray((rng.random((rows, cols)) < share) * rng.choice(sign, (rows, cols)) * rng.uniform(0.2, 1.0, (rows, cols)))


def chequered(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return heights (rows, cols) that alternate from node to node, some with noise.

    They alternate along both axes or one.
    """
    j, i = np.mgrid[:rows, :cols]
    z = [(i + j) % 2, i % 2, j % 2, (i // 2 + j // 2) % 2][rng.integers(4)].astype(float)
    return np.asarray(z + rng.choice([0.0, 1e-9, 0.01, 0.3]) * rng.random((rows, cols)))


def ripples(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return heights (rows, cols) of one or two sine waves with 2.1 to 8 cells per wavelength."""
    j, i = np.mgrid[:rows, :cols].astype(float)
    angles = [0.0, np.pi / 2] if rng.random() < 0.5 else rng.uniform(0, np.pi, rng.integers(1, 3))
    z = np.zeros((rows, cols))
    for angle in angles:
        k = 2 * np.pi / np.exp(rng.uniform(np.log(2.1), np.log(8.0)))
        z += np.sin(k * (i * np.cos(angle) + j * np.sin(angle)) + rng.uniform(0, 2 * np.pi))
    return z / len(angles)


def ridges(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return heights (rows, cols) of parallel ridges or ditches about one cell wide."""
    across = _across(rng, rows, cols)
    period, width = rng.uniform(3.0, 15.0), rng.uniform(0.4, 2.0)
    away = abs((across + rng.uniform(0, period)) % period - period / 2)
    shape = np.exp(-((away / width) ** 2)) if rng.random() < 0.5 else np.maximum(1.0 - away / width, 0.0)
    return np.asarray(rng.choice([-1.0, 1.0]) * shape)


def steps(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return heights (rows, cols) of stairs or walls at any angle."""
    across = _across(rng, rows, cols)
    period = rng.uniform(2.0, 20.0)
    if rng.random() < 0.5:
        return np.floor(across / period + rng.random())
    return np.floor(across / period + rng.random()) % 2


def plateaus(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return heights (rows, cols) of level pieces with sharp edges of any outline."""
    smooth = gaussian_filter(rng.normal(size=(rows, cols)), np.exp(rng.uniform(np.log(0.7), np.log(6.0))))
    return np.round(rng.uniform(1.0, 4.0) * smooth / max(smooth.std(), 1e-300)) / 2


def noise(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return heights (rows, cols) of white noise; `draw_terrain` scales it to 1e-10 to 1e-6 m."""
    return rng.normal(size=(rows, cols))


def _across(rng: np.random.Generator, rows: int, cols: int) -> Array:
    """Return the distance (rows, cols), in nodes, from a line.

    Its angle is random, in 1 case of 4 along the grid.
    """
    j, i = np.mgrid[:rows, :cols].astype(float)
    angle = rng.choice([0.0, np.pi / 2]) if rng.random() < 0.25 else rng.uniform(0, np.pi)
    return np.asarray(i * np.cos(angle) + j * np.sin(angle))


@dataclass
class Case:
    """One terrain, one rover and positions (n,) on it; `seed` and `family` reproduce it."""

    seed: int
    family: str
    rover: rb.Rover
    terrain: rb.Terrain
    x: Array
    y: Array
    yaw: Array
    steering: Array  # (n, 6)

    def settle(self, mode: str = "contact", terrain: rb.Terrain | None = None) -> rb.Pose:
        """Settle at every position, on this terrain or on another one of the same extent."""
        return rb.settle(self.rover, terrain or self.terrain, self.x, self.y, self.yaw, steering=self.steering, mode=mode)


def draw_rover(rng: np.random.Generator) -> rb.Rover:
    """Return a preset or a random rover with any size, wheel width and joint limits."""
    if rng.random() < 0.6:
        return rb.load_rover(str(rng.choice(PRESETS)))
    rover = random_rover(rng)
    limits = [((-np.inf, np.inf), (-np.inf, np.inf)), ((-0.05, 0.3), (-0.15, 0.1)), ((-0.6, 0.6), (-0.8, 0.8))][rng.integers(3)]
    scale = 10 ** rng.uniform(-2.0, 0.0)
    width = rover.wheel_width if rng.random() < 0.7 else np.repeat(rng.uniform(0, 1.0, 3), 2) * rover.wheel_radius * scale
    return rover.replace(rocker_limits=np.array(limits[0]), bogie_limits=np.array(limits[1]), wheel_width=np.asarray(width))


def draw_terrain(
    family: str,
    rng: np.random.Generator,
    rover: rb.Rover,
    interpolation: rb.terrain.Interpolation,
    missing: bool = False,
) -> rb.Terrain:
    """Return terrain of a family for a rover.

    Cells are 1/40 to 4 wheel diameters wide, amplitudes up to 1.5 wheel radii or more. In 1 case of 4, cells are stretched by
    up to 10; in 1 case of 4, heights are offset by thousands of metres. With `missing`, some nodes are NaN.
    """
    radius = float(rover.wheel_radius.max())
    size = reach(rover)
    cell = 2 * radius * np.exp(rng.uniform(np.log(FINEST), np.log(COARSEST)))
    stretch = np.exp(rng.uniform(-1, 1) * np.log(10.0) / 2) if rng.random() < 0.25 else 1.0
    dx, dy = (max(d, 2 * radius * FINEST, 3.2 * size / MOST_NODES) for d in (cell * stretch, cell / stretch))
    cols, rows = (int(np.ceil(2 * (1.05 * size + max(2.0 * d, 0.4 * size)) / d)) + 3 for d in (dx, dy))
    z = globals()[family](rng, rows, cols)
    if family == "noise":
        z *= 10 ** rng.uniform(-10, -6)
    else:
        z *= radius * np.exp(rng.uniform(np.log(0.01), np.log(1.5)))
    if rng.random() < 0.3:
        j, i = np.mgrid[:rows, :cols]
        z += rng.normal(0, 0.15) * i * dx + rng.normal(0, 0.15) * j * dy
    if rng.random() < 0.25:
        z += rng.choice([-1.0, 1.0]) * rng.uniform(1e3, 9e3)
    if missing:
        for _ in range(rng.integers(1, 5)):
            row, col = rng.integers(0, rows), rng.integers(0, cols)
            tall, wide = rng.integers(1, 3 + rows // 10), rng.integers(1, 3 + cols // 10)
            z[row : row + tall, col : col + wide] = np.nan
    return rb.Terrain.from_array(z, (dx, dy), (-dx * (cols - 1) / 2, -dy * (rows - 1) / 2), interpolation, name=family)


def reach(rover: rb.Rover) -> float:
    """Return a radius about the body's origin that contains all treads and the box, m."""
    wheels = np.hypot(*abs(rover.hubs[:, :2]).T) + rover.wheel_radius + rover.wheel_width
    box = np.hypot(*abs(rover.body_box[:, :2]).max(axis=0))
    return float(max(wheels.max(), box))


def draw_places(rng: np.random.Generator, rover: rb.Rover, terrain: rb.Terrain, count: int) -> tuple[Array, Array, Array, Array]:
    """Return x, y, yaw (count,) and steering (count, 6), rover on the map.

    In 15 % of the batches the rovers head along the axes; in 10 % they are on nodes.
    """
    west, south, east, north = terrain.bounds
    size = reach(rover)
    x = rng.uniform(west + size, east - size, count)
    y = rng.uniform(south + size, north - size, count)
    yaw = rng.uniform(-np.pi, np.pi, count)
    kind = rng.random()
    if kind < 0.15:
        yaw = np.pi / 2 * rng.integers(-2, 3, count)
    elif kind < 0.25:
        x, y = (d * np.round((a - o) / d) + o for a, o, d in zip((x, y), terrain.origin, terrain.spacing, strict=True))
    steering = np.zeros((count, 6))
    if rng.random() < 0.3:
        steering[:, rover.steers] = rng.uniform(-0.8, 0.8, (count, int(rover.steers.sum())))
    return x, y, yaw, steering


def draw_case(seed: int, family: str, interpolation: rb.terrain.Interpolation, count: int, missing: bool = False) -> Case:
    """Return the case of a seed: the same one for the same arguments."""
    rng = np.random.default_rng([seed, FAMILIES.index(family), interpolation == "cubic", missing])
    rover = draw_rover(rng)
    terrain = draw_terrain(family, rng, rover, interpolation, missing)
    return Case(seed, family, rover, terrain, *draw_places(rng, rover, terrain, count))
