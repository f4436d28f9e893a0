"""Predicted and logged attitude, and a band for their difference (docs/validation.md)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import is_number
from ..errors import RockerbogieError, expect
from ..files.version import __version__
from ..rover.model import LOAD_ROVER, Rover
from ..settling.settle import settle
from ..settling.status import Status
from ..settling.uncertainty import FACTORS, Doubt, fit_factors, interval_score, limits, sample, stands
from ..terrain.heightfield import Terrain
from ..terrain.roughness import missing_roughness
from .attitude_log import LARGEST, LogMap, read_places

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

CHANNELS = ("pitch", "roll")
#: Largest number of drawn terrains: they lie in one strip in memory.
MOST_DRAWS = 10_000
#: Correlation length of a model's height error, cells: the window of stereo matching.
ERROR_CELLS = 3.0


def validate(
    rover: Rover,
    terrain: Terrain,
    log: str | Path | xr.Dataset,
    *,
    mapping: LogMap | None = None,
    position_sigma: float = 1.0,
    height_sigma: float = 0.05,
    level: float = 0.8,
    apart: float = 5.0,
    draws: int = 400,
    seed: int = 0,
    progress: Callable[[int, int], object] | None = None,
    advance: Callable[[float], object] | None = None,
) -> xr.Dataset:
    """Settle the rover at a log's positions; compare its pitch and roll with the logged ones.

    The band about a prediction contains the share `level` of the possible attitudes, given three uncertainties: the position
    (`position_sigma`), the terrain model's height error (`height_sigma`), and the relief below its grid, which is
    the model's own roughness extrapolated to shorter waves. The rover is settled on `draws` terrains drawn from these. The
    drawn relief has one free factor, fitted for each place on the *other* places alone, those more than `apart` away: no
    value in `coverage` was fitted. A place without such others has the factor 1.

    Args:
        rover: the rover of the log.
        terrain: the terrain model.
        log: a CSV (see `read_places`), or a Dataset over one dim with x, y (m), roll, pitch, yaw (rad, our signs), and if
            known steering (..., wheel). Positions are of the body's reference point, in the terrain's frame.
        mapping: the meaning of the CSV's columns, if the log is of no known kind.
        position_sigma: standard deviation of x and of y, m.
        height_sigma: standard deviation of the model's heights, m; correlated over 3 cells.
        level: share of the possible attitudes that a band contains, between 0 and 1.
        apart: distance beyond which places are independent, m.
        draws: terrains per place; 0 for no band.
        seed: seed of the draws; the same seed gives the same bands.
        progress: called with (steps done, steps in all).
        advance: deprecated: called with the share done, 0 to 1; use progress.

    Returns:
        Dataset over `row` and `channel` (pitch, roll), rad: `predicted`, `logged`, `error`; over `channel`: `rms`, `bias`,
        `median_absolute_error`, `correlation`, `spread` (standard deviation of the logged). With a band also: `low`, `high`,
        `inside`, `factor` (row); `coverage`, `coverage_unfitted` (with the factor 1) over `channel`; `explained` (source,
        channel), the standard deviation from each source alone. `stand` (row) numbers the places: rows that hardly
        move are one, and band and coverage count each once. `status` (row) gives the reason for NaN predictions.

    Raises:
        RockerbogieError: a log that cannot be read, or lies off the terrain; angles beyond π/2; sizes out of range.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_raster")
    _check(position_sigma, height_sigma, level, apart, draws)
    places = _arranged(read_places(log, rover, mapping) if isinstance(log, str | Path) else log)
    x, y, yaw, steering = (places[name].to_numpy() for name in ("x", "y", "yaw", "steering"))
    pose = settle(rover, terrain, x, y, yaw, steering=steering)
    predicted = np.stack([getattr(pose, name) for name in CHANNELS], axis=-1)
    logged = np.stack([places[name].to_numpy() for name in CHANNELS], axis=-1)
    if not np.isfinite(predicted).any():
        xmin, ymin, xmax, ymax = terrain.bounds
        raise RockerbogieError(
            f"the rover settles in none of the log's {len(x)} rows ({Status(int(pose.status[0])).name} at the first): the log "
            f"spans ({x.min():.10g}, {y.min():.10g}) to ({x.max():.10g}, {y.max():.10g}) m, the map ({xmin:.10g}, {ymin:.10g}) "
            f"to ({xmax:.10g}, {ymax:.10g}); check which columns are x and y, and their origin"
        )
    found = _compared(places, predicted, logged, pose.status)
    found.attrs |= {"rover": rover.name, "terrain": terrain.name, "source": f"rockerbogie {__version__} validate"}
    if not draws:
        return found
    doubt = Doubt(position_sigma, height_sigma, ERROR_CELLS * min(terrain.spacing), missing_roughness(terrain, x, y))
    first, stand = stands(x, y, yaw)

    if advance is not None:
        warnings.warn(
            "validate(advance=) is deprecated: use progress, which is called with (done, total)", FutureWarning, stacklevel=2
        )

    def tell(done: int, total: int) -> None:
        if progress is not None:
            progress(done, total)
        if advance is not None:
            advance(done / total)

    def draw(n: int, unsure: Doubt, factors: Array) -> Array:
        at = first[n]
        rng = np.random.default_rng((seed, n))
        return sample(rover, terrain, (x[at], y[at], yaw[at]), steering[at], unsure, factors, draws, rng)

    bands = np.empty((len(first), len(FACTORS), 2, len(CHANNELS)))
    for n in range(len(first)):
        bands[n] = limits(draw(n, doubt, FACTORS), level)
        tell(17 * (n + 1), 20 * len(first))
    scores = interval_score(bands[:, :, 0], bands[:, :, 1], logged[first][:, None], level).sum(axis=-1)
    factor, whole = fit_factors(scores, x[first], y[first], apart)
    alone = {name: np.empty((len(first), len(CHANNELS))) for name in doubt.sources()}
    for k, (name, unsure) in enumerate(doubt.sources().items()):
        for n in range(len(first)):
            sampled = draw(n, unsure, np.array([whole]))[0]
            alone[name][n] = np.nan if np.isnan(sampled).all() else np.nanvar(sampled, axis=0)
        tell(17 + k + 1, 20)
    found.attrs |= {
        "level": level, "factor": whole, "hurst": doubt.roughness.hurst, "hurst_measured": doubt.roughness.measured,
        "position_sigma": position_sigma, "height_sigma": height_sigma, "apart": apart, "draws": draws, "seed": seed,
    }  # fmt: skip
    return _with_band(found, first, stand, bands, factor, alone)


def _check(position_sigma: float, height_sigma: float, level: float, apart: float, draws: int) -> None:
    """Raise RockerbogieError if an argument is out of range."""
    for name, value in (("position_sigma", position_sigma), ("height_sigma", height_sigma), ("apart", apart)):
        if not (np.isfinite(value) and value >= 0):
            raise RockerbogieError(f"{name} is {value}; give a finite length of 0 or more, in metres")
    if not 0 < level < 1:
        raise RockerbogieError(f"level is {level}; give the share a band holds, between 0 and 1, as in 0.8")
    if not (is_number(draws) and draws == int(draws) and (draws == 0 or 20 <= draws <= MOST_DRAWS)):
        raise RockerbogieError(
            f"draws is {draws!r:.60}; give 20 or more, or 0 for no band (a whole number, at most {MOST_DRAWS:,})"
        )


def _arranged(log: xr.Dataset) -> xr.Dataset:
    """Return the log over `row`, with a steering and a label for every row."""
    for name in ("x", "y", "roll", "pitch", "yaw"):
        if name not in log:
            raise RockerbogieError(f"the log has no {name}; it has {', '.join(map(str, log.variables))}")
        if log[name].ndim != 1 or log[name].dims != log["x"].dims:
            raise RockerbogieError(f"{name} in the log lies over {log[name].dims}; give one value a row")
        values = log[name].to_numpy()
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise RockerbogieError(f"{name} in the log is not finite in row {row + 1}: fill it, or drop that row")
        if name in ("roll", "pitch") and len(values) and np.abs(values).max() > LARGEST:
            row = int(np.argmax(np.abs(values)))
            raise RockerbogieError(
                f"{name} in the log is {values[row]:.4g} rad in row {row + 1}, beyond π/2: convert degrees to radians"
            )
    (dim,) = log["x"].dims
    if log.sizes[dim] == 0:
        raise RockerbogieError("the log has no rows: there is nothing to compare")
    if "steering" not in log:
        log = log.assign(steering=((dim, "wheel"), np.zeros((log.sizes[dim], 6))))
    if "place" not in log:
        label = log[dim].to_numpy() if dim in log.coords else 1 + np.arange(log.sizes[dim])
        log = log.assign(place=(dim, [f"{value:.10g}" if isinstance(value, float) else str(value) for value in label]))
    names = ["place", "x", "y", "roll", "pitch", "yaw", "steering"]
    return log.reset_coords()[names].rename({dim: "row"}) if dim != "row" else log[names]


def _compared(places: xr.Dataset, predicted: Array, logged: Array, status: NDArray[np.uint8]) -> xr.Dataset:
    """Return rows and statistics by channel; rows that did not settle do not count."""
    error = predicted - logged
    known = np.isfinite(error).all(axis=1)
    e, p, v = error[known], predicted[known], logged[known]
    spread = v.std(axis=0)
    varied = (spread > 0) & (p.std(axis=0) > 0)
    together = ((p - p.mean(axis=0)) * (v - v.mean(axis=0))).mean(axis=0)
    correlation = np.where(varied, together / np.where(varied, p.std(axis=0) * spread, 1.0), np.nan)
    rad = {"units": "rad"}
    data: dict[str, Any] = {
        "predicted": (("row", "channel"), predicted, rad | {"long_name": "attitude of the settled rover"}),
        "logged": (("row", "channel"), logged, rad | {"long_name": "logged attitude"}),
        "error": (("row", "channel"), error, rad | {"long_name": "predicted less logged"}),
        "rms": ("channel", np.sqrt((e**2).mean(axis=0)), rad | {"long_name": "root mean square error"}),
        "bias": ("channel", e.mean(axis=0), rad | {"long_name": "mean error"}),
        "median_absolute_error": ("channel", np.median(np.abs(e), axis=0), rad | {"long_name": "median of the error's size"}),
        "correlation": ("channel", correlation, {"units": "1", "long_name": "of predicted and logged"}),
        "spread": ("channel", spread, rad | {"long_name": "standard deviation of the logged"}),
        "status": ("row", status, {"units": "1", "long_name": "status code, see rockerbogie.Status"}),
    }
    found = places[["place", "x", "y", "yaw"]].assign_coords(channel=list(CHANNELS)).assign(data)
    kept = {name: places.attrs[name] for name in ("log", "mapping", "place_is", "left_out", "notes") if name in places.attrs}
    found.attrs = {**kept, "rows": len(error), "settled": int(known.sum())}
    return found


def _with_band(
    found: xr.Dataset, first: NDArray[np.int64], stand: NDArray[np.int64], bands: Array, factor: Array, alone: dict[str, Array]
) -> xr.Dataset:
    """Return the rows with the bands (places, factors, 2, channel) at each place's factor.

    The attributes of `found` get the numbers of places and of places judged.
    """
    import xarray as xr

    predicted, logged = found["predicted"].to_numpy(), found["logged"].to_numpy()
    ends = bands[np.arange(len(first)), np.searchsorted(FACTORS, factor)] - predicted[first][:, None]
    low, high = (predicted + ends[stand, k] for k in (0, 1))
    plain = bands[:, np.searchsorted(FACTORS, 1.0)]
    judged = np.isfinite(ends).all(axis=(1, 2))
    if not judged.any():
        raise RockerbogieError("no place has enough terrain around it for a band: load more of it, or set draws to 0")
    inside = (low <= logged) & (logged <= high)
    unfitted = (plain[:, 0] <= logged[first]) & (logged[first] <= plain[:, 1])
    rad = {"units": "rad"}
    found.attrs |= {"places": len(first), "judged": int(judged.sum())}
    return found.assign(
        low=(("row", "channel"), low, rad | {"long_name": "low end of the band"}),
        high=(("row", "channel"), high, rad | {"long_name": "high end of the band"}),
        inside=(("row", "channel"), inside, {"long_name": "logged within the band"}),
        stand=("row", stand, {"long_name": "place of the row, from 0"}),
        factor=("row", factor[stand], {"units": "1", "long_name": "size of the drawn relief, fitted on other places"}),
        coverage=("channel", inside[first][judged].mean(axis=0), {"units": "1", "long_name": "share of places inside"}),
        coverage_unfitted=("channel", unfitted[judged].mean(axis=0), {"units": "1", "long_name": "the same with factor 1"}),
        explained=xr.DataArray(
            np.sqrt([np.nanmean(v, axis=0) for v in alone.values()]), {"source": list(alone)}, ("source", "channel"),
            attrs=rad | {"long_name": "standard deviation by this source alone"},
        ),
    )  # fmt: skip
