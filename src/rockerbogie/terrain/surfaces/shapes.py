"""Ground of simple shape, and smooth random ground whose steepness and curvature are known."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...errors import TerrainError
from ..heightfield import Terrain
from ..window import Interpolation
from ._grid import centred, finite, positive, span

Array = NDArray[np.float64]


def paper(
    *,
    run_in: float = 1.0,
    length: float = 2.0,
    hill_amplitude: float = 0.15,
    ramp_slope: float = math.atan(0.3),
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
        ramp_slope: of both ramps, rad.
        ramp_height: of the level top, m.
        corner: half length of the rounding of the ramps' corners, m; 0 is sharp.
        seam: width of the strip along y = 0 over which one side goes over to the other, m; the wheels of the paper's
            rover run at y = ±0.27 and, as it rolls, keep 0.1 m clear of the default strip.
        run_out: flat ground beyond, m.
        behind: flat ground behind x = 0, m.
        width: of the map, m.

    Raises:
        TerrainError: a size that cannot be.
    """
    finite(run_in=run_in, hill_amplitude=hill_amplitude, run_out=run_out, behind=behind)
    positive(length=length, ramp_slope=ramp_slope, ramp_height=ramp_height, seam=seam, width=width)
    if not ramp_slope < math.pi / 2:
        raise TerrainError(f"ramp_slope is {ramp_slope} rad; a height field needs less than a quarter turn")
    rise = math.tan(ramp_slope)
    run = ramp_height / rise
    if not 2 * (run + corner) <= length:
        raise TerrainError(
            f"two ramps of {run:g} m and their corners do not fit into {length:g} m: lower ramp_height or lengthen it"
        )
    x, y = span((-behind, run_in + length + run_out), (-width / 2, width / 2), spacing)
    s = x - run_in
    hill = hill_amplitude * (1 - np.cos(2 * np.pi * np.clip(s / length, 0, 1)))
    ramps = rise * (_hinge(s, corner) - _hinge(s - run, corner) - _hinge(s - length + run, corner) + _hinge(s - length, corner))
    left = _smoothstep(y[:, None] / seam + 0.5)
    return Terrain.from_array(left * hill + (1 - left) * ramps, spacing, (x[0], y[0]), interpolation, name="paper")


def plane(
    slope: float = 0.0,
    aspect: float = 0.0,
    *,
    size: float | tuple[float, float] = 10.0,
    spacing: float = 0.1,
    interpolation: Interpolation = "cubic",
) -> Terrain:
    """A plane through (0, 0, 0) that falls by `slope` rad towards `aspect` rad, counted from x to y."""
    if not abs(slope) < math.pi / 2:
        raise TerrainError(f"slope is {slope} rad; a height field needs less than a quarter turn ({math.pi / 2:.4f})")
    s, x, y = _along(size, spacing, aspect)
    return Terrain.from_array(-math.tan(slope) * s, spacing, (x[0], y[0]), interpolation, name="plane")


def ramp(
    slope: float = math.atan(0.3),
    height: float = 0.2,
    *,
    start: float = 1.0,
    direction: float = 0.0,
    corner: float = 0.04,
    size: float | tuple[float, float] = 10.0,
    spacing: float = 0.02,
    interpolation: Interpolation = "cubic",
) -> Terrain:
    """Level ground, a ramp up by `slope` rad from s = `start` m, and level ground `height` m above the first.

    A negative slope and height lead down. `corner` is the half length of the rounding of both corners, m.
    """
    finite(start=start)
    if not (0 < abs(slope) < math.pi / 2 and slope * height > 0):
        raise TerrainError(f"a ramp of {slope} rad cannot reach {height} m: give both above 0, or both below, and no upright one")
    s, x, y = _along(size, spacing, direction)
    rise = math.tan(slope)
    z = rise * (_hinge(s - start, corner) - _hinge(s - start - height / rise, corner))
    return Terrain.from_array(z, spacing, (x[0], y[0]), interpolation, name="ramp")


def step(
    height: float = 0.1,
    *,
    start: float = 1.0,
    direction: float = 0.0,
    size: float | tuple[float, float] = (6.0, 4.0),
    spacing: float = 0.01,
    interpolation: Interpolation = "linear",
) -> Terrain:
    """A step up by `height` m (down where negative) at s = `start` m.

    A height field has no upright face: this one leans over one `spacing`, from s = start to start + spacing, and is
    straight where `direction` runs along the grid and `start` falls on a node. Elsewhere cells cut its edges off.
    """
    finite(height=height, start=start)
    s, x, y = _along(size, spacing, direction)
    return Terrain.from_array(height * np.clip((s - start) / spacing, 0, 1), spacing, (x[0], y[0]), interpolation, name="step")


def ditch(
    depth: float = 0.1,
    width: float = 0.3,
    *,
    start: float = 1.0,
    direction: float = 0.0,
    size: float | tuple[float, float] = (6.0, 4.0),
    spacing: float = 0.01,
    interpolation: Interpolation = "linear",
) -> Terrain:
    """A ditch `depth` m deep and `width` m wide at its top, from s = `start` m; its walls lean inward over one `spacing`."""
    finite(depth=depth, start=start, width=width)
    if width < 2 * spacing:
        raise TerrainError(f"a ditch {width} m wide has no room for two walls of one cell: refine the spacing of {spacing} m")
    s, x, y = _along(size, spacing, direction)
    z = -depth * (np.clip((s - start) / spacing, 0, 1) - np.clip((s - start - width) / spacing + 1, 0, 1))
    return Terrain.from_array(z, spacing, (x[0], y[0]), interpolation, name="ditch")


def sine(
    amplitude: float = 0.1,
    wavelength: float = 2.0,
    *,
    direction: float = 0.0,
    size: float | tuple[float, float] = 10.0,
    spacing: float = 0.02,
    interpolation: Interpolation = "cubic",
) -> Terrain:
    """Waves `amplitude` sin(2π s / `wavelength`), m: level at s = 0 and rising."""
    finite(amplitude=amplitude)
    positive(wavelength=wavelength)
    s, x, y = _along(size, spacing, direction)
    return Terrain.from_array(amplitude * np.sin(2 * np.pi * s / wavelength), spacing, (x[0], y[0]), interpolation, name="sine")


def rough(
    seed: int = 0,
    *,
    max_slope: float = math.radians(25),
    min_radius: float = 0.2,
    size: float | tuple[float, float] = 6.0,
    spacing: float = 0.02,
    interpolation: Interpolation = "cubic",
) -> Terrain:
    """Smooth random ground, nowhere steeper than `max_slope` rad nor curved more than a circle of `min_radius` m.

    A sum of plane waves over two octaves of wavelength, in all directions. It is scaled until its nodes come within
    1 % of one of the two limits (between them it may be that much steeper); its wavelengths bring it near the other.
    The curvature meant is the larger principal value of z's second derivative, which no upright section exceeds.

    Raises:
        TerrainError: a limit that cannot be, or nodes too coarse to hold the waves (under 12 to the shortest).
    """
    positive(min_radius=min_radius, max_slope=max_slope)
    if not max_slope < math.pi / 2:
        raise TerrainError(f"max_slope is {max_slope} rad; a height field needs less than a quarter turn")
    steepest = math.tan(max_slope)
    shortest = 2 * np.pi * steepest * min_radius * WAVE_FACTOR
    if spacing > shortest / 12:
        raise TerrainError(
            f"spacing {spacing:g} m is too coarse for waves of {shortest:.3g} m: give at most {shortest / 12:.3g} m"
        )
    x, y = centred(size, spacing)
    rng = np.random.default_rng(seed)
    wave = 2 * np.pi / shortest * 4 ** -rng.random(WAVES)  # wavenumbers, rad/m
    heading = 2 * np.pi * rng.random(WAVES)
    kx, ky = wave * np.cos(heading), wave * np.sin(heading)
    over_x = np.exp(1j * (np.outer(kx, x)))
    over_y = np.exp(1j * (np.outer(y, ky) + 2 * np.pi * rng.random(WAVES)))

    def field(weight: NDArray[np.complexfloating]) -> Array:
        return np.asarray(((over_y * (weight / wave)) @ over_x).real)  # amplitude as the wavelength: one steepness for all

    z, zx, zy = field(np.ones(WAVES) + 0j), field(1j * kx), field(1j * ky)
    xx, xy, yy = field(-kx * kx + 0j), field(-kx * ky + 0j), field(-ky * ky + 0j)
    bend = np.abs(xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    scale = 0.99 * min(steepest / float(np.hypot(zx, zy).max()), 1 / (min_radius * float(bend.max())))
    return Terrain.from_array(scale * z, spacing, (x[0], y[0]), interpolation, name=f"rough {seed}")


#: Waves in `rough`, and its shortest wavelength over that of the one sine wave that meets both limits.
WAVES = 60
WAVE_FACTOR = 0.54


def _hinge(s: Array, corner: float) -> Array:
    """0 below s = 0 and s above, the kink rounded within ±corner into two cubics; twice continuously differentiable."""
    if not 0 <= corner < math.inf:
        raise TerrainError(f"corner is {corner} m; give 0 (sharp) or more")
    if corner == 0:
        return np.maximum(s, 0)
    inside = np.maximum(corner - np.abs(s), 0) ** 3 / (6 * corner**2)
    return np.maximum(s, 0) + inside


def _smoothstep(t: Array) -> Array:
    """0 below 0 to 1 above 1, twice continuously differentiable."""
    t = np.clip(t, 0, 1)
    return t**3 * (10 - 15 * t + 6 * t**2)


def _along(size: float | tuple[float, float], spacing: float, direction: float) -> tuple[Array, Array, Array]:
    """s (rows, cols) along the direction at the nodes, and the nodes (cols,) and (rows,)."""
    finite(direction=direction)
    x, y = centred(size, spacing)
    return x * math.cos(direction) + y[:, None] * math.sin(direction), x, y
