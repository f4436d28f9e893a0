"""Draw docs/img/validation_*.png and print the numbers of docs/validation.md.

python docs/draw_validation.py FOLDER_OF_DATA
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import xarray as xr

import rockerbogie as rb
from rockerbogie.figures.validation import validation_figure
from rockerbogie.settling.uncertainty import FACTORS, Doubt, interval_score, limits, sample, stands
from rockerbogie.terrain.roughness import missing_roughness

OUT = Path(__file__).parent / "img"
CASES = {
    "curiosity": ("gale/missionDEM.tif", "gale/curiosity_waypoints.csv"),
    "perseverance": ("perseverance/site78.tif", "perseverance/sol01590_first60.csv"),
}
SEEDS = range(5)


class Bands:
    """Ends of 80 % bands for each position, factor and channel, from one set of error sources."""

    def __init__(self, rover: rb.Rover, terrain: rb.Terrain, places: xr.Dataset, doubt: Doubt) -> None:
        x, y, yaw, steering = (places[name].values for name in ("x", "y", "yaw", "steering"))
        first, _ = stands(x, y, yaw)
        self.logged = np.stack([places[name].values for name in ("pitch", "roll")], axis=-1)[first]
        drawn = [
            sample(rover, terrain, (x[n], y[n], yaw[n]), steering[n], doubt, FACTORS, 400, np.random.default_rng((0, k)))
            for k, n in enumerate(first)
        ]
        self.ends = np.stack([limits(one, 0.8) for one in drawn])
        self.score = interval_score(self.ends[:, :, 0], self.ends[:, :, 1], self.logged[:, None], 0.8).sum(axis=-1)

    def inside(self, places: slice, factor: int) -> np.ndarray:
        """Return True (n, 2) where the band of a factor contains logged pitch and roll."""
        low, high = self.ends[places, factor].swapaxes(0, 1)
        return (low <= self.logged[places]) & (self.logged[places] <= high)

    def trained(self, on: slice, judged: slice) -> tuple[float, np.ndarray]:
        """Return the factor fitted on some positions, and its coverage of others by channel."""
        best = int(np.argmin(self.score[on].sum(axis=0)))
        return float(FACTORS[best]), self.inside(judged, best).mean(axis=0)


def nearest(rover: rb.Rover, terrain: rb.Terrain, places: xr.Dataset, row: int) -> str:
    """Return the smallest difference from the logged attitude within 1, 2, 3 and 4 m, as text."""
    x, y, yaw, pitch, roll = (float(places[name][row]) for name in ("x", "y", "yaw", "pitch", "roll"))
    dx, dy = np.meshgrid(*2 * [np.arange(-4, 4.01, 0.1)])
    pose = rb.settle(rover, terrain, x + dx, y + dy, yaw)
    off, away = np.degrees(np.hypot(pose.pitch - pitch, pose.roll - roll)), np.hypot(dx, dy)
    return ", ".join(f"{off[away <= reach].min():.1f} deg within {reach} m" for reach in (1, 2, 3, 4))


def percent(shares: np.ndarray) -> str:
    """Return shares as text in percent."""
    return " / ".join(f"{100 * share:.0f} %" for share in shares)


def main(folder: Path) -> None:
    """Validate both rovers on both interpolations, print the numbers and draw the pictures."""
    for name, (model, log) in CASES.items():
        rover = rb.load_rover(name)
        for interpolation in ("linear", "cubic"):
            terrain = rb.Terrain.from_raster(folder / model, interpolation=interpolation)
            places = rb.read_places(folder / log, rover)
            for seed in SEEDS if interpolation == "linear" else range(1):
                found = rb.validate(rover, terrain, places, seed=seed)
                errors = {k: np.degrees(found[k].values).round(2).tolist() for k in ("rms", "bias", "median_absolute_error")}
                print(f"{name} {interpolation} seed {seed}: pitch, roll", errors if seed == 0 else "")
                print(f"   held out {percent(found['coverage'].values)}, factor {found.attrs['factor']:.2f}", end="; ")
                print(f"factor 1, not fitted: {percent(found['coverage_unfitted'].values)}")
                if seed == 0 and interpolation == "linear":
                    wider = rb.validate(rover, terrain, places, apart=10.0)
                    print(f"   positions within 10 m left out: {percent(wider['coverage'].values)}")
                    rows = np.flatnonzero(~found["inside"].values.all(axis=1)) if name == "curiosity" else ()
                    for row in rows:
                        print(f"   {found['place'].values[row]}: smallest difference {nearest(rover, terrain, places, row)}")
                    validation_figure(found).savefig(OUT / f"validation_{name}.png")
        terrain = rb.Terrain.from_raster(folder / model, interpolation="linear")
        roughness = missing_roughness(terrain, places["x"].values, places["y"].values)
        doubt = Doubt(1.0, 0.05, 3.0, roughness)
        print(f"{name}: Hurst exponent measured {roughness.measured:.2f}, used {roughness.hurst:.2f}")
        for source, alone in doubt.sources().items():
            bands = Bands(rover, terrain, places, alone)
            at_one = int(np.searchsorted(FACTORS, 1.0))
            width = np.degrees(np.median(np.diff(bands.ends[:, at_one], axis=1)[:, 0], axis=0))
            held = percent(bands.inside(slice(None), at_one).mean(axis=0))
            print(f"   {source} alone: median width {width[0]:.1f} / {width[1]:.1f} deg, contains {held}")
        bands = Bands(rover, terrain, places, doubt)
        half = len(bands.logged) // 2
        for label, on, judged in (
            ("first half, judged on the second", slice(0, half), slice(half, None)),
            ("second half, judged on the first", slice(half, None), slice(0, half)),
        ):
            factor, shares = bands.trained(on, judged)
            print(f"   fitted on the {label}: factor {factor:.2f}, inside {percent(shares)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
