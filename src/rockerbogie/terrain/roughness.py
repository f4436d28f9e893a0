"""The relief a terrain model lacks: how rough its ground goes on being below the grid, and grounds drawn from that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from .heightfield import Terrain

Array = NDArray[np.float64]

#: Lags at which a model's own roughness is read, cells: longer than its smoothing, shorter than its landforms.
LAGS = (4, 6, 8, 12, 16)
#: Waves shorter than this many cells are taken to be missing, and the model's roughness is taken at this lag.
CUTOFF = 8
#: A fractal surface has a Hurst exponent under 1; what is measured above that is landform, not roughness.
MOST_HURST, LEAST_HURST = 0.95, 0.1
#: How far beyond the places asked for a model's roughness is read, cells.
AROUND = 64


@dataclass(frozen=True)
class Roughness:
    """Relief of waves shorter than `cutoff` (m), with spectrum strength · k^(-2·hurst - 2), k in rad/m.

    `measured` is the Hurst exponent as the model has it, before it is brought under 1.
    """

    hurst: float
    strength: float
    cutoff: float
    measured: float

    def spectrum(self, k: Array) -> Array:
        """Power spectral density (...) over wave number k (...): the mean square of heights is its integral / (2 pi)², m⁴."""
        return np.where(k > 2 * np.pi / self.cutoff, self.strength * np.maximum(k, 1e-12) ** (-2 * self.hurst - 2), 0.0)


def missing_roughness(terrain: Terrain, x: Array, y: Array) -> Roughness:
    """What a terrain model around (x, y) lacks: its own roughness at 8 cells, carried on to shorter waves.

    Roughness is the mean square of second differences z(r) - 2 z(0) + z(-r), blind to slopes; on fractal ground it goes as
    r^2H. H is fitted at lags of 4 to 16 cells.

    Raises:
        RockerbogieError: fewer known nodes than that needs.
    """
    from scipy.special import gamma

    z, cell = _nearby(terrain, x, y), min(terrain.spacing)
    lags = np.array(LAGS)
    square = np.array([second_difference(z, lag) for lag in LAGS])
    if not np.isfinite(square).all():
        raise RockerbogieError(
            f"the terrain has {z.shape[1]} x {z.shape[0]} nodes around the log, too few known to tell its roughness: "
            f"load {2 * LAGS[-1] + 1} or more a side, or ask for no band (draws 0)"
        )
    at_cutoff = square[LAGS.index(CUTOFF)]
    if at_cutoff <= 0:
        return Roughness(MOST_HURST, 0.0, CUTOFF * cell, np.nan)  # a plane
    measured = float(np.polyfit(np.log(lags), np.log(square), 1)[0] / 2)
    H = float(np.clip(measured, LEAST_HURST, MOST_HURST))
    # structure function D(r) = c r^2H; second differences have (4 - 4^H) of it; spectrum of a field with that D
    c = at_cutoff / (CUTOFF * cell) ** (2 * H) / (4 - 4**H)
    strength = np.pi * c * 2 ** (2 * H + 1) * H * gamma(1 + H) / gamma(1 - H)
    return Roughness(H, float(strength), CUTOFF * cell, measured)


def second_difference(z: Array, lag: int) -> float:
    """Mean square of z(r) - 2 z(0) + z(-r) along rows and columns at a lag of nodes, m²; nan where there are none."""
    if min(z.shape) < 2 * lag + 1:
        return np.nan
    found = [w[2 * lag :] - 2 * w[lag:-lag] + w[: -2 * lag] for w in (z, z.T)]
    squares = np.concatenate([f[np.isfinite(f)] ** 2 for f in found])
    return float(squares.mean()) if squares.size else np.nan


def correlated_error(sigma: float, length: float, k: Array) -> Array:
    """Spectrum (...) of a height error of standard deviation sigma, m, correlated as exp(-r²/2 length²)."""
    return np.asarray(2 * np.pi * (sigma * length) ** 2 * np.exp(-0.5 * (k * length) ** 2))


def draw_ground(rng: np.random.Generator, spectrum: Array, spacing: float) -> Array:
    """One Gaussian ground (n, n) with the given spectrum at `wave_numbers(n, spacing)`; it repeats at its rim."""
    white = np.fft.fft2(rng.standard_normal(spectrum.shape))
    return np.asarray(np.fft.ifft2(white * np.sqrt(spectrum) / spacing).real)


def wave_numbers(n: int, spacing: float) -> Array:
    """Of the Fourier transform of (n, n) nodes, rad/m."""
    k = 2 * np.pi * np.fft.fftfreq(n, spacing)
    return np.asarray(np.hypot(k[:, None], k))


def _nearby(terrain: Terrain, x: Array, y: Array) -> Array:
    """Heights around the places, `AROUND` cells more on every side."""
    spans = []
    for places, first, step, count in zip((x, y), terrain.origin, terrain.spacing, terrain.z.shape[::-1], strict=True):
        low = int(np.floor((places.min() - first) / step)) - AROUND
        high = int(np.ceil((places.max() - first) / step)) + AROUND + 1
        spans.append(slice(max(low, 0), min(max(high, 0), count)))
    return terrain.z[spans[1], spans[0]]
