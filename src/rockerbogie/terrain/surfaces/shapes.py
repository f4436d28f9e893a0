"""Terrain of simple shape, and smooth random terrain with limited slope and curvature."""

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
    """Make the tracks of the paper's section III: a harmonic hill (y > 0), two ramps (y < 0).

    The paper gives the slope of the ramps, 16.7 deg (tan 0.3), and no other size: all other defaults are chosen. The rover
    starts at x = 0 on a flat part. Then follow, over the same length, a hill of hill_amplitude (1 - cos) on the left, and a
    ramp up, a horizontal top and a ramp down on the right. The rest is flat again.

    The corners of the ramps are rounded over `corner` on either side, with a curvature that is a triangle of that half width.
    A cubic surface reproduces this exactly if the corners lie on nodes and `corner` is a whole number of cells, as by default;
    it oscillates at a sharp corner (0). A wheel of 0.1 m radius has contact with both faces of the concave corner 14.7 mm from
    it, beyond the default rounding: its contact still jumps from the flat part to the ramp.

    Args:
        run_in: x at which hill and ramps begin, m.
        length: of the hill, and of the two ramps with the top between them, m.
        hill_amplitude: half the hill's height, m.
        ramp_slope: of both ramps, rad.
        ramp_height: of the top, m.
        corner: half length of the rounding of the ramps' corners, m; 0 is sharp.
        seam: width of the strip along y = 0 in which one side blends into the other, m. The wheels of the paper's rover run
            at y = ±0.27 m and, when it rolls, stay 0.1 m outside the default strip.
        run_out: length of the flat part beyond, m.
        behind: length of the flat part behind x = 0, m.
        width: of the map along y, m.
        spacing: of the nodes, m.
        interpolation: "cubic" or "linear".

    Returns:
        The terrain.

    Raises:
        TerrainError: a value outside its range, or ramps that do not fit into `length`.
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
    """Make a plane through (0, 0, 0).

    Args:
        slope: its angle with the horizontal, rad.
        aspect: direction in which it falls, counted from x to y, rad.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "cubic" or "linear".

    Returns:
        The terrain.

    Raises:
        TerrainError: a slope of π/2 or more, or a value outside its range.
    """
    finite(slope=slope)
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
    """Make a ramp between two horizontal parts of different height.

    Args:
        slope: of the ramp, rad; negative with a negative height for a ramp down.
        height: of the second part above the first, m.
        start: s at which the ramp begins, m.
        direction: of s, rad.
        corner: half length of the rounding of both corners, m; 0 is sharp.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "cubic" or "linear".

    Returns:
        The terrain.

    Raises:
        TerrainError: slope and height of different sign or 0, a vertical ramp, or a value outside its range.
    """
    finite(slope=slope, height=height, start=start)
    if not (0 < abs(slope) < math.pi / 2 and slope * height > 0):
        raise TerrainError(
            f"a ramp of {slope} rad cannot reach {height} m: give both above 0 or both below 0, and a slope of less than a "
            "quarter turn"
        )
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
    """Make a step.

    A height field has no vertical face: the face is one `spacing` long, from s = start to start + spacing. It is straight if
    `direction` is along the grid and `start` lies on a node. Otherwise cells cut its edges off.

    Args:
        height: of the step, m; negative: down.
        start: s at which the face begins, m.
        direction: of s, rad.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "linear" or "cubic".

    Returns:
        The terrain.

    Raises:
        TerrainError: a value outside its range.
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
    """Make a ditch whose walls are one `spacing` long.

    Args:
        depth: m; negative: a ridge.
        width: at the top, walls included, m.
        start: s at which it begins, m.
        direction: of s, rad.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "linear" or "cubic".

    Returns:
        The terrain.

    Raises:
        TerrainError: a width below two cells, or a value outside its range.
    """
    finite(depth=depth, start=start, width=width)
    if width < 2 * spacing:
        raise TerrainError(f"a ditch {width} m wide is narrower than two walls of one cell: refine the spacing of {spacing} m")
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
    """Make waves z = amplitude · sin(2π s / wavelength).

    Args:
        amplitude: half the height from trough to crest, m.
        wavelength: m.
        direction: of s, rad.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "cubic" or "linear".

    Returns:
        The terrain.

    Raises:
        TerrainError: a value outside its range.
    """
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
    """Make smooth random terrain with limited slope and curvature.

    It is a sum of plane waves over two octaves of wavelength, in all directions. It is scaled until its nodes come within 1 %
    of one of the two limits (between nodes they may be exceeded by that much); the wavelengths bring it near the other limit.
    The curvature is the larger principal value of the second derivative of z, which no vertical section exceeds.

    Args:
        seed: of all random numbers.
        max_slope: steepest slope, rad.
        min_radius: smallest radius of curvature, m.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "cubic" or "linear".

    Returns:
        The terrain.

    Raises:
        TerrainError: a value outside its range, or a spacing too coarse for the waves (fewer than 12 nodes to the shortest).
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
        a = over_y * (weight / wave)  # amplitude proportional to wavelength: equal slopes
        # the real part of a @ over_x; the last bits of @ depend on the number of threads
        return np.asarray(np.einsum("ik,kj->ij", a.real, over_x.real) - np.einsum("ik,kj->ij", a.imag, over_x.imag))

    z, zx, zy = field(np.ones(WAVES) + 0j), field(1j * kx), field(1j * ky)
    xx, xy, yy = field(-kx * kx + 0j), field(-kx * ky + 0j), field(-ky * ky + 0j)
    curvature = np.abs(xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    scale = 0.99 * min(steepest / float(np.hypot(zx, zy).max()), 1 / (min_radius * float(curvature.max())))
    return Terrain.from_array(scale * z, spacing, (x[0], y[0]), interpolation, name=f"rough {seed}")


#: Number of waves in `rough`, and its shortest wavelength relative to that of the single sine wave that meets both limits.
WAVES = 60
WAVE_FACTOR = 0.54


def _hinge(s: Array, corner: float) -> Array:
    """Return 0 for s < 0 and s for s > 0, with the corner rounded.

    The rounding within ±corner is two cubics; the result is twice continuously differentiable, or sharp if corner is 0.
    """
    finite(corner=corner)
    if not 0 <= corner < math.inf:
        raise TerrainError(f"corner is {corner} m; give 0 (sharp) or more")
    if corner == 0:
        return np.maximum(s, 0)
    inside = np.maximum(corner - np.abs(s), 0) ** 3 / (6 * corner**2)
    return np.maximum(s, 0) + inside


def _smoothstep(t: Array) -> Array:
    """Return a C2 blend: 0 for t <= 0, 1 for t >= 1."""
    t = np.clip(t, 0, 1)
    return t**3 * (10 - 15 * t + 6 * t**2)


def _along(size: float | tuple[float, float], spacing: float, direction: float) -> tuple[Array, Array, Array]:
    """Return s (rows, cols) at the nodes, and the nodes (cols,) and (rows,), m."""
    finite(direction=direction)
    x, y = centred(size, spacing)
    return x * math.cos(direction) + y[:, None] * math.sin(direction), x, y
