"""Uncertainty of predicted attitude, from poses on random terrain at random positions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..rover.model import Rover
from ..rover.rotations import wrap_angle
from ..terrain.heightfield import Terrain
from ..terrain.roughness import Roughness, correlated_error, draw_ground, wave_numbers
from .settle import settle

#: Factors on the drawn relief that are tried: from a quarter of the extrapolated relief to four times as much.
FACTORS = 2.0 ** np.arange(-2, 2.1, 0.25)
#: A row that moved less than MOVED, m, and turned less than TURNED, rad, belongs to the position before it. If there are more
#: than MOST_PLACES positions, both limits are doubled.
MOVED, TURNED, MOST_PLACES = 0.5, 0.25, 300


@dataclass(frozen=True)
class Doubt:
    """Uncertainties of a prediction: position, height error, and missing relief."""

    position_sigma: float  # standard deviation of x and of y, m
    height_sigma: float  # standard deviation of the model's heights, m
    height_length: float  # correlation length of the height error, m
    roughness: Roughness  # relief below the model's resolution

    def spectrum(self, k: Array) -> Array:
        """Return the power spectrum of height error and missing relief together.

        Args:
            k: (...) wave numbers, rad/m.

        Returns:
            (...) m⁴.
        """
        return correlated_error(self.height_sigma, self.height_length, k) + self.roughness.spectrum(k)

    def sources(self) -> dict[str, Doubt]:
        """Return each uncertainty alone, the others set to 0.

        Returns:
            Name -> Doubt.
        """
        smooth = replace(self.roughness, strength=0.0)
        return {
            "position": replace(self, height_sigma=0.0, roughness=smooth),
            "height error": replace(self, position_sigma=0.0, roughness=smooth),
            "missing relief": replace(self, position_sigma=0.0, height_sigma=0.0),
        }


def stands(x: Array, y: Array, yaw: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Group rows that hardly move into positions.

    Args:
        x, y: (n,) m.
        yaw: (n,) rad.

    Returns:
        Index of the first row (p,) of each position, and the position (n,) of each row.
    """
    moved = MOVED
    while True:
        first, stand = [0], np.zeros(len(x), dtype=np.int64)
        for n in range(1, len(x)):
            k = first[-1]
            turned = abs(wrap_angle(yaw[n] - yaw[k]))
            if np.hypot(x[n] - x[k], y[n] - y[k]) > moved or turned > TURNED * moved / MOVED:
                first.append(n)
            stand[n] = len(first) - 1
        if len(first) <= MOST_PLACES:
            return np.array(first), stand
        moved *= 2


def sample(
    rover: Rover,
    terrain: Terrain,
    place: tuple[float, float, float],
    steering: Array,
    doubt: Doubt,
    factors: Array,
    draws: int,
    rng: np.random.Generator,
) -> Array:
    """Settle the rover near a position on random terrain.

    Each draw is a patch just large enough for the rover: the terrain model near a random position, resampled to a wheel radius
    or finer, plus random relief times the factor. The patches lie in one strip; all factors use the same draws.

    Args:
        rover, terrain: the mechanism and the terrain model.
        place: x, y (m) and yaw (rad).
        steering: (6,) rad.
        doubt: the uncertainties.
        factors: (f,) factors on the drawn relief.
        draws: number of draws.
        rng: random generator.

    Returns:
        (f, draws, 2) pitch and roll, rad; NaN where the rover does not settle or the model has no data.
    """
    spacing = min(terrain.spacing)
    spacing /= np.ceil(spacing / float(np.min(rover.wheel_radius)))
    reach = np.hypot(*rover.hubs[:, :2].T) + np.hypot(rover.wheel_radius, rover.wheel_width)
    half = int(np.ceil(reach.max() / spacing)) + 1
    n, side = 2 * half + 1, int(np.ceil(np.sqrt(draws)))
    offset = doubt.position_sigma * rng.standard_normal((draws, 2))
    tile = draw_ground(rng, doubt.spectrum(wave_numbers(side * n, spacing)), spacing)
    relief = tile.reshape(side, n, side, n).swapaxes(1, 2).reshape(-1, n, n)[:draws]
    step = spacing * np.arange(-half, half + 1)
    x, y = (at + offset[:, k, None, None] for k, at in enumerate(place[:2]))
    model = terrain.height(x + step, y + step[:, None])
    if not np.isfinite(model).any():
        return np.full((len(factors), draws, 2), np.nan)
    out = np.empty((len(factors), draws, 2))
    middle = (half * spacing, (np.arange(draws) * n + half) * spacing)
    for k, factor in enumerate(factors):
        strip = (model + factor * relief).reshape(draws * n, n)
        pose = settle(rover, Terrain.from_array(strip, spacing, interpolation="linear"), *middle, place[2], steering=steering)
        out[k] = np.stack([pose.pitch, pose.roll], axis=-1)
    return out


def limits(sampled: Array, level: float) -> Array:
    """Return the central interval that holds a share of the draws.

    Args:
        sampled: (factors, draws, channels).
        level: share of the draws, 0 to 1.

    Returns:
        (factors, 2, channels) low and high end; NaN if half of the draws or more did not settle.
    """
    known = np.isfinite(sampled).mean(axis=1) > 0.5
    found = np.full((*known.shape[:1], 2, known.shape[1]), np.nan)
    for k, c in np.argwhere(known):
        found[k, :, c] = np.nanquantile(sampled[k, :, c], [(1 - level) / 2, (1 + level) / 2])
    return found


def interval_score(low: Array, high: Array, value: Array, level: float) -> Array:
    """Return the interval score (Gneiting and Raftery 2007, eq. 43).

    Its mean is least for the true interval.

    Args:
        low, high: (...) ends of the interval.
        value: (...) observed value.
        level: nominal coverage, 0 to 1.

    Returns:
        (...) width plus 2/(1 - level) times the distance of the value from the interval.
    """
    return np.asarray(high - low + 2 / (1 - level) * (np.maximum(low - value, 0) + np.maximum(value - high, 0)))


def fit_factors(scores: Array, x: Array, y: Array, apart: float) -> tuple[Array, float]:
    """Choose the factor with the least score for each position, from far positions only.

    Args:
        scores: (p, factors); NaN counts as 0.
        x, y: (p,) positions, m.
        apart: m.

    Returns:
        Factor (p,) of each position, 1 if there are no scores far enough away; and the factor over all positions.
    """
    scores = np.nan_to_num(scores)
    far = np.hypot(x[:, None] - x, y[:, None] - y) > apart
    far &= scores.any(axis=1)
    return np.where(far.any(axis=1), FACTORS[np.argmin(far @ scores, axis=1)], 1.0), float(FACTORS[np.argmin(scores.sum(axis=0))])
