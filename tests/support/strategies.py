"""Random rovers and difficult terrain, as hypothesis strategies and from seeds."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import rockerbogie as rb

Array = NDArray[np.float64]

GROUNDS = (
    "flat", "plane", "white", "smooth", "fractal", "rocks", "step", "ditch", "wall", "plateaus", "spikes", "chequered", "rounded",
)  # fmt: skip
BATCH_SHAPES = ((), (1,), (3, 1, 2, 1))


def heights(kind: str, rng: np.random.Generator, rows: int, cols: int, size: float) -> Array:
    """Return heights (rows, cols) of a kind, m.

    Steps, walls and ditches are up to 3 `size` high or deep.

    `size` is the wheel's radius, m.
    """
    z = np.zeros((rows, cols))
    j, i = np.mgrid[:rows, :cols].astype(float)
    angle = rng.choice([0.0, np.pi / 2, rng.uniform(0, 2 * np.pi)])
    across = abs((i - cols / 2) * np.cos(angle) + (j - rows / 2) * np.sin(angle))
    tall = rng.uniform(0.1, 3.0)
    if kind == "plane":
        z = rng.normal(0, 0.05, 2) @ [i.ravel(), j.ravel()]
    elif kind == "white":
        z = rng.normal(size=(rows, cols)) * 10 ** rng.uniform(-3, 0)
    elif kind == "smooth":
        z = gaussian_filter(rng.normal(size=(rows, cols)), rng.uniform(0.5, 5))
        z *= rng.uniform(0.05, 1) / z.std()
    elif kind == "fractal":
        z = sum(0.3 * s * gaussian_filter(rng.normal(size=(rows, cols)), s) for s in (1, 2, 4, 8))
    elif kind == "rocks":
        for _ in range(rng.integers(5, 60)):
            row, col, reach = rng.uniform(0, rows), rng.uniform(0, cols), rng.uniform(0.5, 8)
            dome = np.sqrt(np.maximum(reach**2 - (j - row) ** 2 - (i - col) ** 2, 0))
            z = np.maximum(z, dome * rng.uniform(0.02, 0.3))
    elif kind == "step":
        z = tall * ((i - cols / 2) * np.cos(angle) + (j - rows / 2) * np.sin(angle) > rng.uniform(-5, 5))
    elif kind == "ditch":
        z = -tall * (across < rng.uniform(0.5, 5))
    elif kind == "wall":
        z = tall * (across < rng.uniform(0.3, 2))
    elif kind == "plateaus":
        z = np.round(20 * gaussian_filter(rng.normal(size=(rows, cols)), 4)) * rng.uniform(0.05, 0.5)
    elif kind == "spikes":
        z = (rng.random((rows, cols)) < 0.05) * rng.uniform(0.1, 2)
    elif kind == "chequered":
        z = (i + j) % 2 * rng.uniform(0.01, 1) * (1 + 0.01 * rng.random((rows, cols)))
    elif kind == "rounded":
        z = np.round(2 * rng.normal(size=(rows, cols))) * rng.uniform(0.01, 0.2)
    return size * np.reshape(z, (rows, cols)).astype(float)


def terrain_around(
    kind: str, rng: np.random.Generator, radius: float, cells: float, reach: float, interpolation: str, missing: bool = False
) -> rb.Terrain:
    """Return terrain of a kind to `reach` m from (0, 0), about `cells` cells per wheel radius.

    Cells are not square. With `missing`, one rectangle of nodes is NaN.
    """
    dx, dy = radius / cells * rng.uniform(0.6, 1.6, 2)
    cols, rows = (int(2 * reach / d) + 6 for d in (dx, dy))
    z = heights(kind, rng, rows, cols, radius)
    if missing:
        row, col = rng.integers(0, rows), rng.integers(0, cols)
        z[row : row + rows // 8 + 1, col : col + cols // 8 + 1] = np.nan
    return rb.Terrain.from_array(z, (dx, dy), (-dx * (cols - 1) / 2, -dy * (rows - 1) / 2), interpolation, name=kind)


@st.composite
def rovers(draw: st.DrawFn) -> rb.Rover:
    """Draw a rover with any size, tracks, wheels, joint limits, and bogie ahead or behind."""
    part = st.floats(0.0, 1.0)

    def between(low: float, high: float) -> float:
        return low + (high - low) * draw(part)

    size = 10 ** between(-1.0, 0.5)
    forward = draw(st.sampled_from([1.0, -1.0]))
    drop = -between(0.25, 0.9)
    hubs = [
        (x * forward, between(0.45, 0.8), drop + between(-0.02, 0.02))
        for x in (-between(0.7, 1.0), between(-0.1, 0.1), between(0.7, 1.0))
    ]
    bogie_x = (hubs[1][0] + hubs[2][0]) / 2 + between(-0.1, 0.1)
    return rb.Rover.from_pivots(
        name="drawn",
        wheel_radius=size * between(0.12, 0.25),
        wheel_width=size * draw(st.sampled_from([0.0, 0.05, 0.3])),
        rocker_pivot=np.multiply((between(-0.2, 0.2), between(0.2, 0.8), between(0.0, 0.3)), size),
        bogie_pivot=np.multiply((bogie_x, between(0.2, 0.8), between(-0.2, 0.1)), size),
        hubs=np.multiply(hubs, size),
        steering_offset=(size * between(-0.05, 0.05), size * between(-0.05, 0.05)),
        rocker_limits=draw(st.sampled_from([(-np.inf, np.inf), (-0.05, 0.3), (-0.6, 0.6)])),
        bogie_limits=draw(st.sampled_from([(-np.inf, np.inf), (-0.15, 0.1), (-0.8, 0.8)])),
    )


@st.composite
def terrains(draw: st.DrawFn, rover: rb.Rover, *, missing: bool = False) -> rb.Terrain:
    """Draw terrain for a rover: bilinear or cubic, 0.4 to 6 cells per wheel radius."""
    return terrain_around(
        draw(st.sampled_from(GROUNDS)),
        np.random.default_rng(draw(st.integers(0, 2**32 - 1))),
        float(rover.wheel_radius.max()),
        draw(st.sampled_from([0.4, 1.0, 2.5, 6.0])),
        2.0 * float(np.abs(rover.hubs).max()) + 2.0 * float(rover.wheel_radius.max()),
        draw(st.sampled_from(["linear", "cubic"])),
        missing=missing and draw(st.booleans()),
    )
