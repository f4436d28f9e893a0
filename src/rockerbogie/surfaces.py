"""Named ground: the paper's, simple shapes for tests and lessons, and made-up Mars. Every size is a keyword, in metres.

Every surface is a `Terrain`. Unless it says otherwise a map is `size` metres across (one number, or x and y) with
(0, 0) in its middle; `spacing` is its node distance and `interpolation` what `Terrain.from_array` takes. What is drawn
at random is drawn from `seed` alone: the same arguments give the same ground.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .errors import TerrainError
from .terrain import Interpolation, Terrain

Array = NDArray[np.float64]


def paper(
    *,
    run_in: float = 1.0,
    length: float = 2.0,
    hill_amplitude: float = 0.15,
    ramp_slope: float = 0.3,
    ramp_height: float = 0.2,
    corner: float = 1 / 75,
    seam: float = 0.2,
    run_out: float = 2.0,
    behind: float = 1.0,
    width: float = 2.0,
    spacing: float = 1 / 150,
    interpolation: Interpolation = "cubic",
) -> Terrain:
    """The two tracks of the paper's section III: a harmonic hill on the left (y > 0), two ramps on the right.

    The paper prints the ramps' slope, 16.7 deg (tan 0.3), and no other size: all the rest here is chosen. From x = 0,
    where the rover's reference point starts, a flat run-in; then, over the same length, hill_amplitude (1 - cos) on
    the left, and on the right a ramp up, a level top and a ramp down; then flat again.

    The ramps' corners are rounded over `corner` on either side (the curvature is a hat of that half width), which a
    cubic surface holds exactly when corners fall on nodes and `corner` is a whole number of cells, as they do by
    default; a sharp corner (0) would ripple on it. A wheel of 0.1 m radius touches the two faces of the hollow corner
    14.7 mm from it, beyond the default rounding, so that its contact still jumps from the flat to the ramp.

    Args:
        run_in: x where hill and ramps begin, m.
        length: of the hill, and of the ramps with the level top between them, m.
        hill_amplitude: half the hill's height, m.
        ramp_slope: rise over run of both ramps.
        ramp_height: of the level top, m.
        corner: half length of the rounding of the ramps' corners, m; 0 is sharp.
        seam: width of the strip along y = 0 over which one side goes over to the other, m; the wheels of the paper's
            rover run at y = ±0.27 and, as it rolls, keep more than 0.07 m clear of the default strip.
        run_out: flat ground beyond, m.
        behind: flat ground behind x = 0, m.
        width: of the map, m.

    Raises:
        TerrainError: a size that cannot be.
    """
    _positive(length=length, ramp_slope=ramp_slope, ramp_height=ramp_height, seam=seam, width=width, spacing=spacing)
    run = ramp_height / ramp_slope
    if 2 * (run + corner) > length:
        raise TerrainError(
            f"two ramps of {run:g} m and their corners do not fit into {length:g} m: lower ramp_height or lengthen it"
        )
    x, y = _nodes((-behind, run_in + length + run_out), (-width / 2, width / 2), spacing)
    s = x - run_in
    hill = hill_amplitude * (1 - np.cos(2 * np.pi * np.clip(s / length, 0, 1)))
    ramps = ramp_slope * (
        _hinge(s, corner) - _hinge(s - run, corner) - _hinge(s - length + run, corner) + _hinge(s - length, corner)
    )
    left = _smoothstep(y[:, None] / seam + 0.5)
    return Terrain.from_array(left * hill + (1 - left) * ramps, spacing, (x[0], y[0]), interpolation, name="paper")


def _hinge(s: Array, corner: float) -> Array:
    """0 below s = 0 and s above, the kink rounded within ±corner into two cubics; twice continuously differentiable."""
    if corner == 0:
        return np.maximum(s, 0)
    inside = np.maximum(corner - np.abs(s), 0) ** 3 / (6 * corner**2)
    return np.maximum(s, 0) + inside


def _smoothstep(t: Array) -> Array:
    """0 below 0 to 1 above 1, twice continuously differentiable."""
    t = np.clip(t, 0, 1)
    return t**3 * (10 - 15 * t + 6 * t**2)


def _positive(**sizes: float) -> None:
    for name, size in sizes.items():
        if not (np.isfinite(size) and size > 0):
            raise TerrainError(f"{name} is {size}; give a finite number above 0")


def _nodes(x: tuple[float, float], y: tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Nodes (cols,) and (rows,) from the first end of each span to its other, or the last whole cell before it."""
    cols, rows = (int(np.floor((high - low) / spacing + 1e-6)) + 1 for low, high in (x, y))
    if min(cols, rows) < 4:
        raise TerrainError(f"a map of {cols} x {rows} nodes is too small: enlarge it or give a finer spacing than {spacing:g} m")
    if cols * rows > MOST_NODES:
        raise TerrainError(
            f"a map of {cols} x {rows} nodes is more than {MOST_NODES:g}: shrink it or give a coarser spacing than {spacing:g} m"
        )
    return x[0] + spacing * np.arange(cols), y[0] + spacing * np.arange(rows)


#: Largest made-up map, nodes: 1.6 GB with its spline coefficients.
MOST_NODES = 100_000_000
