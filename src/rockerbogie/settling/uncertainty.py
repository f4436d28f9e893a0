"""How far a predicted attitude may be off: the rover settled on grounds and at places drawn from all that is not known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..rotations import wrap_angle
from ..rover.model import Rover
from ..terrain.heightfield import Terrain
from ..terrain.roughness import Roughness, correlated_error, draw_ground, wave_numbers
from .settle import settle

Array = NDArray[np.float64]

#: Factors on the drawn relief that are tried: a quarter of what was extrapolated to four times as much.
FACTORS = 2.0 ** np.arange(-2, 2.1, 0.25)
#: A row that moved less than this, m, and turned less, rad, is at the same place still; there are at most so many places
#: to draw for: the distance is doubled until there are.
MOVED, TURNED, MOST_PLACES = 0.5, 0.25, 300


@dataclass(frozen=True)
class Doubt:
    """What is not known: where the rover stands (standard deviation of x and of y, m), how far the model's heights are off
    (standard deviation and length of correlation, m), and the relief it lacks."""

    position_sigma: float
    height_sigma: float
    height_length: float
    roughness: Roughness

    def spectrum(self, k: Array) -> Array:
        """Of height error and missing relief together, m⁴."""
        return correlated_error(self.height_sigma, self.height_length, k) + self.roughness.spectrum(k)

    def sources(self) -> dict[str, Doubt]:
        """Each thing not known, as if all others were."""
        smooth = replace(self.roughness, strength=0.0)
        return {
            "position": replace(self, height_sigma=0.0, roughness=smooth),
            "height error": replace(self, position_sigma=0.0, roughness=smooth),
            "missing relief": replace(self, position_sigma=0.0, height_sigma=0.0),
        }


def stands(x: Array, y: Array, yaw: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The row (p,) at which each place begins, and the place (n,) of each row: rows that hardly move are one place."""
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
    """Pitch and roll (factors, draws, 2) of the rover settled about `place` (x, y, yaw) on drawn grounds, rad.

    Each draw is a patch just large enough for the rover: the model's ground about a drawn place, resampled to a wheel's
    radius or finer, plus drawn relief times the factor. The patches lie in one strip; factors share the draws.
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
    """Low and high end (factors, 2, channels) that hold the middle `level` of draws (factors, draws, channels); nan where
    more than half of them did not settle."""
    known = np.isfinite(sampled).mean(axis=1) > 0.5
    found = np.full((*known.shape[:1], 2, known.shape[1]), np.nan)
    for k, c in np.argwhere(known):
        found[k, :, c] = np.nanquantile(sampled[k, :, c], [(1 - level) / 2, (1 + level) / 2])
    return found


def interval_score(low: Array, high: Array, value: Array, level: float) -> Array:
    """Width plus 2/(1 - level) of what a value lies outside: least, on average, for the band that is true (Gneiting and
    Raftery 2007, eq. 43)."""
    return np.asarray(high - low + 2 / (1 - level) * (np.maximum(low - value, 0) + np.maximum(value - high, 0)))


def fit_factors(scores: Array, x: Array, y: Array, apart: float) -> tuple[Array, float]:
    """The factor (places,) of least score over all places more than `apart` away from each, and that over all places.

    Args:
        scores: (places, factors); nan does not count. A place with none to learn from gets 1.
    """
    scores = np.nan_to_num(scores)
    far = np.hypot(x[:, None] - x, y[:, None] - y) > apart
    far &= scores.any(axis=1)
    return np.where(far.any(axis=1), FACTORS[np.argmin(far @ scores, axis=1)], 1.0), float(FACTORS[np.argmin(scores.sum(axis=0))])
