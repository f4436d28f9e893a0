"""Synthetic Mars: self-affine terrain, craters, and rocks by the law of the landing sites.

Sources of the laws and numbers:
- rocks: Golombek & Rapp 1997, J. Geophys. Res. 102(E2), 4117; Golombek et al. 2003, J. Geophys. Res. 108(E12), 8086:
  rocks of diameter D and larger cover k exp(-q D) of the area, q = 1.79 + 0.152 / k (D in metres);
- roughness: Shepard et al. 2001, J. Geophys. Res. 106(E12), 32777 (deviation of height against baseline, Hurst
  exponent); RMS slopes over 1 m of 5.4 ± 1.0 deg (Pathfinder) and 4.8 ± 1.0 deg (Viking 1), Hurst exponents of 0.5 to
  0.8, in Shepard et al., "The roughness of the Martian surface: what we know";
- craters: Melosh 1989, Impact Cratering (simple craters: depth a fifth, rim a twenty-eighth of the diameter); the
  ejecta's cube law: McGetchin et al. 1973, Earth Planet. Sci. Lett. 20, 226; number proportional to the inverse square of
  the diameter: Trask 1966, JPL TR 32-800 (equilibrium: 10^-1.1 craters of 1 m and larger per square metre).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...errors import TerrainError
from ..heightfield import Terrain
from ..window import Interpolation
from ._grid import centred, finite, positive

Array = NDArray[np.float64]

FRESH_DEPTH, FRESH_RIM = 0.2, 0.036  # depth of the floor and height of the rim, relative to the crater's diameter
EJECTA_REACH = 3.0  # crater radii at which the ejecta's cube law is faded out to 0
CROWDED = 200  # greatest number of rounds in which overlapping rocks are moved


def mars(
    seed: int = 0,
    *,
    rms_slope: float = math.radians(5),
    hurst: float = 0.65,
    crater_density: float = 0.02,
    smallest_crater: float = 2.0,
    k: float = 0.07,
    smallest_rock: float = 0.15,
    largest_rock: float = 1.5,
    size: float | tuple[float, float] = 40.0,
    spacing: float = 0.05,
    interpolation: Interpolation = "linear",
) -> Terrain:
    """Make synthetic Mars: `fractal` terrain, craters of all ages on it, and `rocks` on top.

    Args:
        seed: of all random numbers.
        rms_slope: of the terrain below, as for `fractal`, rad.
        hurst: the same, 0 to 1.
        crater_density: c: there are c / D² craters of diameter D and larger per square metre, D in metres. 0: no craters.
        smallest_crater: diameter, m. The largest is a quarter of the map's shorter side.
        k: area fraction of rocks, as for `rocks`; 0: no rocks.
        smallest_rock: diameter, m.
        largest_rock: diameter, m.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "linear" or "cubic".

    Returns:
        The terrain.

    Raises:
        TerrainError: a value outside its range.
    """
    finite(crater_density=crater_density)
    if not 0 <= crater_density < 1:
        raise TerrainError(f"crater_density is {crater_density}; give 0 (none) to 1 (saturated is 0.08)")
    positive(smallest_crater=smallest_crater)
    ground = fractal(seed, rms_slope=rms_slope, hurst=hurst, size=size, spacing=spacing, interpolation=interpolation)
    z = np.array(ground.z)
    xmin, ymin, xmax, ymax = ground.bounds
    rng = np.random.default_rng([seed, 1])
    largest = min(xmax - xmin, ymax - ymin) / 4
    fewest, most = (crater_density / d**2 for d in (max(largest, smallest_crater), smallest_crater))
    count = round((most - fewest) * (xmax - xmin) * (ymax - ymin))
    for diameter in np.sqrt(crater_density / (fewest + (most - fewest) * _strata(rng, count))):
        _crater(z, ground, rng.uniform(xmin, xmax), rng.uniform(ymin, ymax), diameter, rng.uniform(0.1, 1.0))
    ground = Terrain.from_array(z, spacing, ground.origin, interpolation, name=f"mars {seed}")
    if k == 0:
        return ground
    return rocks(k, seed, base=ground, smallest=smallest_rock, largest=largest_rock)


def fractal(
    seed: int = 0,
    *,
    rms_slope: float = math.radians(5),
    hurst: float = 0.65,
    size: float | tuple[float, float] = 40.0,
    spacing: float = 0.05,
    interpolation: Interpolation = "cubic",
) -> Terrain:
    """Make self-affine terrain with a given RMS slope and Hurst exponent.

    Heights at a distance L differ by tan(`rms_slope`) (L / 1 m)^`hurst` m RMS. They are the sum of waves with random phase
    and normal amplitude on a torus of twice the map's sides, so opposite edges of the map do not match.

    Args:
        seed: of all random numbers.
        rms_slope: over a baseline of 1 m, rad.
        hurst: between 0 (rough at every scale) and 1 (smooth when close), both excluded.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "cubic" or "linear".

    Returns:
        The terrain, with mean height near 0.

    Raises:
        TerrainError: a value outside its range.
    """
    finite(hurst=hurst, rms_slope=rms_slope)
    if not 0 < hurst < 1:
        raise TerrainError(f"hurst is {hurst}; give a number between 0 and 1 (Mars: 0.5 to 0.8)")
    if not 0 <= rms_slope < math.pi / 2:
        raise TerrainError(f"rms_slope is {rms_slope} rad; give 0 or more and less than a quarter turn")
    x, y = centred(size, spacing)
    rows, cols = 2 * len(y), 2 * len(x)
    kx = 2 * np.pi * np.fft.rfftfreq(cols, spacing)
    ky = 2 * np.pi * np.fft.fftfreq(rows, spacing)[:, None]
    k2 = kx**2 + ky**2
    k2[0, 0] = np.inf
    power = k2 ** -(hurst + 1)  # of each wave; proportional to k^-(2 H + 2) on a self-affine surface
    both = np.where((kx == 0) | (2 * np.arange(len(kx)) == cols), 1.0, 2.0)  # rfft keeps one of each pair of waves
    variance = float((both * power * 2 * (1 - np.cos(kx))).sum())  # of z(x + 1 m) - z(x)
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((rows, cols)))  # each of variance rows · cols
    z = np.fft.irfft2(np.sqrt(power * rows * cols / variance) * noise, s=(rows, cols))[: len(y), : len(x)]
    return Terrain.from_array(math.tan(rms_slope) * (z - z.mean()), spacing, (x[0], y[0]), interpolation, name=f"fractal {seed}")


def rocks(
    k: float = 0.1,
    seed: int = 0,
    *,
    smallest: float = 0.1,
    largest: float = 1.5,
    base: Terrain | None = None,
    size: float | tuple[float, float] = 10.0,
    spacing: float = 0.02,
    interpolation: Interpolation = "linear",
) -> Terrain:
    """Place rocks on a base: half-buried ellipsoids without overlap, sized by Golombek's law.

    A rock's outline is an ellipse with the area of its diameter, up to 1.5 times longer than wide. Its height is 0.3 to 0.6
    of its diameter. It is buried slightly below its widest section, so that its walls have slopes of 55 to 80 deg at the
    base. See `golombek_rocks` for the law.

    Args:
        k: area fraction that rocks of all sizes would cover, up to 0.4; 0.05 to 0.2 on Mars.
        seed: of all random numbers.
        smallest: diameter, m.
        largest: diameter, m.
        base: terrain below the rocks, whose nodes are kept. None: z = 0 with `size`, `spacing` and `interpolation`.
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.
        interpolation: "linear" or "cubic".

    Returns:
        The terrain.

    Raises:
        TerrainError: a value outside its range, rocks smaller than two cells, or more rocks than the map has room for.
    """
    if base is None:
        x, y = centred(size, spacing)
        base = Terrain.from_array(np.zeros((len(y), len(x))), spacing, (x[0], y[0]), interpolation)
    if smallest < 2 * max(base.spacing):
        raise TerrainError(
            f"rocks of {smallest} m are below two cells of {max(base.spacing):g} m: give at least {2 * max(base.spacing):g} m"
        )
    xmin, ymin, xmax, ymax = base.bounds
    px, py, diameter = golombek_rocks(k, (xmax - xmin, ymax - ymin), seed, smallest=smallest, largest=largest)
    rng = np.random.default_rng([seed, 2])
    n = len(diameter)
    stretch, turn, tall, sunk = (
        rng.uniform(1, 1.5, n),
        rng.uniform(0, np.pi, n),
        rng.uniform(0.3, 0.6, n),
        rng.uniform(0.8, 0.98, n),
    )
    z = np.array(base.z)
    for i in range(n):
        a, b = diameter[i] / 2 * np.sqrt(stretch[i]), diameter[i] / 2 / np.sqrt(stretch[i])
        window, u, v = _around(base, px[i] + xmin, py[i] + ymin, a)
        c, s = np.cos(turn[i]), np.sin(turn[i])
        r2 = ((c * u + s * v) / a) ** 2 + ((c * v - s * u) / b) ** 2
        floor = np.sqrt(1 - sunk[i] ** 2)
        cap = (np.sqrt(1 - sunk[i] ** 2 * np.minimum(r2, 1)) - floor) / (1 - floor)
        z[window] += tall[i] * diameter[i] * cap
    name = f"rocks k={k:g} seed {seed}" if base.name == "terrain" else base.name
    return Terrain.from_array(z, base.spacing, base.origin, base.interpolation, crs=base.crs, name=name)


def golombek_rocks(
    k: float, size: tuple[float, float], seed: int = 0, *, smallest: float = 0.1, largest: float = 1.5
) -> tuple[Array, Array, Array]:
    """Draw positions and diameters of rocks that do not overlap.

    Rocks of diameter D and larger cover the area fraction F(D) = k exp(-q D), q = 1.79 + 0.152 / k, D in metres (Golombek &
    Rapp 1997). So there are 4 k q exp(-q D) / (π D²) rocks per square metre and per metre of diameter between `smallest` and
    `largest`. One diameter is drawn from each n-th part of this law, so that small maps obey it as well as large ones.

    Args:
        k: area fraction that rocks of all sizes would cover, 0 to 0.4.
        size: x and y extent, m.
        seed: of all random numbers.
        smallest: diameter, m.
        largest: diameter, m.

    Returns:
        x and y (n,) from 0 to `size`, and diameters (n,), largest first, m.

    Raises:
        TerrainError: a value outside its range, or rocks that still overlap after `CROWDED` rounds.
    """
    from scipy.spatial import cKDTree

    finite(k=k)
    if not 0 < k <= 0.4:
        raise TerrainError(f"k is {k}; give an area fraction between 0 and 0.4 (Mars: 0.05 to 0.2)")
    positive(smallest=smallest, largest=largest)
    if not smallest < largest:
        raise TerrainError(f"smallest rock {smallest} m is not below the largest, {largest} m")
    q = 1.79 + 0.152 / k
    grades = np.geomspace(smallest, largest, 4000)
    density = 4 * k * q * np.exp(-q * grades) / (np.pi * grades**2)
    number = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(grades))])
    rng = np.random.default_rng(seed)
    n = round(number[-1] * size[0] * size[1])
    diameter = np.interp(_strata(rng, n), number / number[-1], grades)[::-1]
    place = rng.random((n, 2)) * size
    reach = diameter / 2 * np.sqrt(1.5)  # of the longest outline
    for _ in range(CROWDED):
        tree = cKDTree(place)
        near = tree.query_ball_point(place, 2 * reach)  # radius for the larger of two rocks, which finds the smaller
        first = np.repeat(np.arange(n), [len(found) for found in near])
        second = np.concatenate([np.asarray(found, dtype=int) for found in near]) if n else first
        apart = np.hypot(*(place[first] - place[second]).T)
        loser = np.unique(second[(second > first) & (apart < reach[first] + reach[second])])
        if len(loser) == 0:
            return place[:, 0], place[:, 1], diameter
        place[loser] = rng.random((len(loser), 2)) * size
    raise TerrainError(f"{n} rocks of k = {k:g} do not fit side by side: lower k or raise the smallest diameter")


def _strata(rng: np.random.Generator, n: int) -> Array:
    """Return n ascending random numbers in [0, 1), one in each n-th part."""
    return (np.arange(n) + rng.random(n)) / max(n, 1)


def _crater(z: Array, ground: Terrain, x: float, y: float, diameter: float, youth: float) -> None:
    """Add a simple crater to z: a bowl up to its rim, ejecta beyond; youth 1: fresh, 0: flat."""
    window, u, v = _around(ground, x, y, EJECTA_REACH * diameter / 2)
    r = np.hypot(u, v) / (diameter / 2)
    rim, depth = FRESH_RIM * youth * diameter, FRESH_DEPTH * youth * diameter
    fade = np.clip((EJECTA_REACH - r) / (EJECTA_REACH - 1), 0, 1)
    z[window] += np.where(r < 1, rim - depth * (1 - r**2), rim * np.maximum(r, 1) ** -3 * fade)


def _around(ground: Terrain, x: float, y: float, reach: float) -> tuple[tuple[slice, slice], Array, Array]:
    """Return the nodes within `reach` of (x, y): a window into z, and their offsets from (x, y).

    Returns:
        (row slice, column slice); (cols,) offsets along x, m; (rows, 1) offsets along y, m.
    """
    (x0, y0), (dx, dy) = ground.origin, ground.spacing
    rows, cols = ground.z.shape
    c0, c1 = max(math.ceil((x - reach - x0) / dx), 0), min(math.floor((x + reach - x0) / dx) + 1, cols)
    r0, r1 = max(math.ceil((y - reach - y0) / dy), 0), min(math.floor((y + reach - y0) / dy) + 1, rows)
    window = (slice(r0, max(r0, r1)), slice(c0, max(c0, c1)))
    return window, ground.x[window[1]] - x, (ground.y[window[0]] - y)[:, None]
