"""Roughness below the resolution of a terrain model: estimate and random draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from .heightfield import Terrain

Array = NDArray[np.float64]

#: Lags at which a model's roughness is measured, cells: longer than its smoothing, shorter than its landforms.
LAGS = (4, 6, 8, 12, 16)
#: Shortest wavelength that a model resolves, and the lag at which its roughness is taken, cells.
CUTOFF = 8
#: Limits of the Hurst exponent. A fractal surface has less than 1; a greater measured value is landform, not roughness.
MOST_HURST, LEAST_HURST = 0.95, 0.1
#: Margin around the points in which a model's roughness is measured, cells.
AROUND = 64


@dataclass(frozen=True)
class Roughness:
    """Spectrum of the relief at wavelengths below `cutoff`, which a terrain model lacks.

    The power spectral density is strength · k^(-2·hurst - 2), with k in rad/m. `measured` is the Hurst exponent of the model
    before it is limited to `LEAST_HURST`…`MOST_HURST`.
    """

    hurst: float
    strength: float
    cutoff: float
    measured: float

    def spectrum(self, k: Array) -> Array:
        """Return the power spectral density.

        Args:
            k: (...) wave numbers, rad/m.

        Returns:
            (...) m⁴; its integral over the plane of wave numbers, divided by (2π)², is the mean square of the heights. 0 for
            wavelengths of at least `cutoff`.
        """
        return np.where(k > 2 * np.pi / self.cutoff, self.strength * np.maximum(k, 1e-12) ** (-2 * self.hurst - 2), 0.0)


def missing_roughness(terrain: Terrain, x: Array, y: Array) -> Roughness:
    """Estimate the relief that a terrain model around some points lacks.

    The model's roughness at a lag of 8 cells is extrapolated to shorter wavelengths. Roughness is the mean square of second
    differences z(r) - 2 z(0) + z(-r), which do not depend on slope; on fractal terrain it is proportional to r^2H. The Hurst
    exponent H is fitted at lags of 4 to 16 cells.

    Args:
        terrain: the terrain model.
        x: (n,) m.
        y: (n,) m.

    Returns:
        The roughness; of strength 0 on a plane.

    Raises:
        RockerbogieError: fewer nodes with data than the fit needs.
    """
    from scipy.special import gamma

    z, cell = _nearby(terrain, x, y), min(terrain.spacing)
    lags = np.array(LAGS)
    square = np.array([second_difference(z, lag) for lag in LAGS])
    if not np.isfinite(square).all():
        raise RockerbogieError(
            f"the terrain has {z.shape[1]} x {z.shape[0]} nodes around the log, too few with data to measure its "
            f"roughness: load {2 * LAGS[-1] + 1} or more a side, or switch the band off (draws 0)"
        )
    at_cutoff = square[LAGS.index(CUTOFF)]
    if at_cutoff <= 0:
        return Roughness(MOST_HURST, 0.0, CUTOFF * cell, np.nan)  # a plane
    measured = float(np.polyfit(np.log(lags), np.log(square), 1)[0] / 2)
    H = float(np.clip(measured, LEAST_HURST, MOST_HURST))
    # structure function D(r) = c r^2H; the mean square second difference is (4 - 4^H) D; spectrum of a field with that D
    c = at_cutoff / (CUTOFF * cell) ** (2 * H) / (4 - 4**H)
    strength = np.pi * c * 2 ** (2 * H + 1) * H * gamma(1 + H) / gamma(1 - H)
    return Roughness(H, float(strength), CUTOFF * cell, measured)


def second_difference(z: Array, lag: int) -> float:
    """Return the mean square of z(r) - 2 z(0) + z(-r) along rows and columns.

    Args:
        z: (rows, cols) heights, m.
        lag: r, nodes.

    Returns:
        m²; NaN if no such triple of nodes has data.
    """
    if min(z.shape) < 2 * lag + 1:
        return np.nan
    found = [w[2 * lag :] - 2 * w[lag:-lag] + w[: -2 * lag] for w in (z, z.T)]
    squares = np.concatenate([f[np.isfinite(f)] ** 2 for f in found])
    return float(squares.mean()) if squares.size else np.nan


def correlated_error(sigma: float, length: float, k: Array) -> Array:
    """Return the spectrum of a height error with Gaussian correlation exp(-r² / (2 length²)).

    Args:
        sigma: standard deviation, m.
        length: correlation length, m.
        k: (...) wave numbers, rad/m.

    Returns:
        (...) power spectral density, m⁴.
    """
    return np.asarray(2 * np.pi * (sigma * length) ** 2 * np.exp(-0.5 * (k * length) ** 2))


def draw_ground(rng: np.random.Generator, spectrum: Array, spacing: float) -> Array:
    """Draw Gaussian random heights with a given spectrum.

    Args:
        rng: the source of random numbers.
        spectrum: (n, n) power spectral density at `wave_numbers(n, spacing)`, m⁴.
        spacing: of the nodes, m.

    Returns:
        (n, n) heights, m, periodic across the edges.
    """
    white = np.fft.fft2(rng.standard_normal(spectrum.shape))
    return np.asarray(np.fft.ifft2(white * np.sqrt(spectrum) / spacing).real)


def wave_numbers(n: int, spacing: float) -> Array:
    """Return the wave numbers of the discrete Fourier transform of (n, n) nodes.

    Args:
        n: nodes a side.
        spacing: of the nodes, m.

    Returns:
        (n, n) rad/m, in the order of `numpy.fft.fft2`.
    """
    k = 2 * np.pi * np.fft.fftfreq(n, spacing)
    return np.asarray(np.hypot(k[:, None], k))


def _nearby(terrain: Terrain, x: Array, y: Array) -> Array:
    """Return the heights in a box around the points, `AROUND` cells larger on every side."""
    spans = []
    for places, first, step, count in zip((x, y), terrain.origin, terrain.spacing, terrain.z.shape[::-1], strict=True):
        low = int(np.floor((places.min() - first) / step)) - AROUND
        high = int(np.ceil((places.max() - first) / step)) + AROUND + 1
        spans.append(slice(max(low, 0), min(max(high, 0), count)))
    return terrain.z[spans[1], spans[0]]
