"""Forecast of slip along a drive, from past telemetry only (docs/forecast.md)."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, is_number
from ..errors import RockerbogieError, expect
from ..files.version import __version__
from ..rover.model import LOAD_ROVER, Rover
from ..settling.settle import settle
from ..terrain.heightfield import Terrain
from .slip_bank import USUAL_SLOPE, SlipBank
from .slip_log import NEW_TRAVEL, arrange_slip_log, read_slip_log

if TYPE_CHECKING:
    import xarray as xr

#: Distance of the forecast, m; warnings look two measurements, 2 m, ahead.
AHEAD, WARNING_REACH = 1.0, 2.0
#: A warning is given at this probability: being stuck costs as much as 1 / THRESHOLD stops to look.
LIMIT, THRESHOLD = 0.8, 0.015
#: Measurements before the first warning: until then the bank has no level.
FEWEST = 3
#: Variables of a log that place the rover on a map.
PLACES = ("x", "y", "yaw", "heading")
#: Travel between two forecasts without a new measurement, m.
EVERY = 0.25
#: Travel to the next measurement is one of the latest RECENT distances between two, or differs from it by JITTER, m; before
#: the second measurement it is AHEAD.
RECENT, JITTER = 8, (-0.1, 0.0, 0.1)


def forecast_slip(
    rover: Rover,
    terrain: Terrain | None,
    log: str | Path | xr.Dataset,
    *,
    limit: float = LIMIT,
    threshold: float = THRESHOLD,
    quantiles: tuple[float, ...] = (0.1, 0.5, 0.9),
    every: float = EVERY,
) -> xr.Dataset:
    """Forecast the slip of the next metre along a drive.

    Each forecast uses only rows of the log up to its own.

    A bank of local-level filters tracks the logit of slip from measurement to measurement. Each has a level for the soil
    under the rover, a damped growth and a gain on the slope. The forecast is the mixture of all filters. All constants were
    fixed on the drives of docs/forecast.md; only the filters' weights depend on the log.

    Args:
        rover: the rover that made the log.
        terrain: the map, if there is one: the slope 1 m ahead on the present course is then used; else the present slope. It
            also gives the slope where the log has positions but no attitude.
        log: a file of `read_slip_log`, or such a Dataset.
        limit: slip of which the warning warns, between 0 and 1.
        threshold: probability of exceeding it within 2 m of wheel travel at which a warning is given.
        quantiles: probabilities of the quantiles.
        every: wheel travel between two forecasts without a new measurement, m.

    Returns:
        Dataset over `step`: `time` (s), `distance` (wheel travel, m), `row` of the log; `known`, the last measured slip; `mean`
        and `quantile` (step, probability) of a slip that is measured over the next metre of wheel travel; `held_mean` and
        `held_quantile` of the mean of the log over that metre, `known` being held until the next measurement; `exceed`, the
        probability of a slip above `limit` within 2 m; `warning`, from the third measurement on.

    Raises:
        RockerbogieError: a log without slip, or arguments out of range.
    """
    import xarray as xr

    expect(rover, Rover, "rover", LOAD_ROVER)
    if terrain is not None:
        expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_raster, or give None")
    _check(limit, threshold, quantiles, every)
    data = slope_by_map(rover, terrain, slip_log_of(log, rover))
    time, distance, slip = (data[name].to_numpy() for name in ("time", "distance", "slip"))
    slope = np.hypot(data["along"].to_numpy(), data["across"].to_numpy())
    rows = _forecast_rows(distance, slip, every)
    coming = slope[rows] if terrain is None else _slope_ahead(rover, terrain, data, rows)
    bank, last, sum_from = SlipBank(), np.nan, 0
    before = copy(bank)  # the state at the last measurement, without it
    probabilities = np.array(quantiles)
    measured_by_position = data["from_position"].to_numpy()
    out: dict[str, list[Any]] = {name: [] for name in ("known", "mean", "quantile", "exceed", "held_mean", "held_quantile")}
    gaps: list[float] = []
    at = here = 0.0
    for row, ahead in zip(rows, coming, strict=True):
        travel = distance[row] - at
        if np.isfinite(slip[row]):
            if travel < NEW_TRAVEL and np.isfinite(last):  # a newer value of the same travel replaces the older one
                bank = copy(before)
            else:
                if np.isfinite(last):
                    gaps.append(travel)
                bank.advance(travel)
                before, at, here = copy(bank), distance[row], _mean_slope(slope, distance, sum_from, row)
                sum_from = row
            bank.measure(float(slip[row]), here, bool(measured_by_position[row]))
            last, travel = float(slip[row]), distance[row] - at
        ahead = USUAL_SLOPE if np.isnan(ahead) else float(ahead)
        mean, values = bank.moments(travel + AHEAD, ahead, probabilities)
        out["known"].append(last)
        out["mean"].append(mean)
        out["quantile"].append(values)
        shares, reach = _shares_held(gaps, travel)
        mean, values = bank.held(reach, ahead, last, shares, probabilities)
        out["held_mean"].append(mean)
        out["held_quantile"].append(values)
        out["exceed"].append(bank.exceeding(travel + AHEAD, ahead, limit))
    number = {"units": "1"}
    exceed = np.array(out["exceed"])
    warning = (exceed >= threshold) & (np.isfinite(slip).cumsum()[rows] >= FEWEST)
    return xr.Dataset(
        {
            "known": ("step", out["known"], number | {"long_name": "last measured slip"}),
            "mean": ("step", out["mean"], number | {"long_name": "mean of the slip over the next metre"}),
            "quantile": (("step", "probability"), np.array(out["quantile"]), number | {"long_name": "quantiles of that slip"}),
            "held_mean": ("step", out["held_mean"], number | {"long_name": "mean of the log's slip over the next metre"}),
            "held_quantile": (
                ("step", "probability"), np.array(out["held_quantile"]), number | {"long_name": "quantiles of that mean"},
            ),
            "exceed": ("step", exceed, number | {"long_name": f"probability of a slip above {limit:g} within 2 m"}),
            "warning": ("step", warning, {"long_name": f"that probability is {threshold:g} or more"}),
        },
        {
            "time": ("step", time[rows], {"units": "s"}),
            "distance": ("step", distance[rows], {"units": "m", "long_name": "wheel travel"}),
            "row": ("step", data["row"].to_numpy()[rows]),
            "probability": probabilities,
        },
        {
            "log": data.attrs["log"], "rover": rover.name, "limit": limit, "threshold": threshold, "ahead": AHEAD,
            "warning_reach": WARNING_REACH, "source": f"rockerbogie {__version__} forecast_slip",
        },
    )  # fmt: skip


def slip_log_of(log: str | Path | xr.Dataset, rover: Rover) -> xr.Dataset:
    """Return a slip log from a file or a Dataset.

    Args:
        log: a file of `read_slip_log`, or a Dataset as it returns.
        rover: the rover that made it.

    Returns:
        The log over `row`.

    Raises:
        RockerbogieError: it cannot be read.
    """
    return read_slip_log(log, rover) if isinstance(log, str | Path) else arrange_slip_log(log)


def _check(limit: float, threshold: float, quantiles: Any, every: float) -> None:
    """Raise RockerbogieError if an argument is out of range."""
    if not isinstance(quantiles, Sequence) or isinstance(quantiles, str):
        raise RockerbogieError(f"quantiles are {quantiles!r:.60}; give a tuple of numbers between 0 and 1")
    for name, value in (("limit", limit), ("threshold", threshold), *(("a quantile", q) for q in quantiles)):
        if not (is_number(value) and 0 < value < 1):
            raise RockerbogieError(f"{name} is {value!r:.60}; give a number between 0 and 1")
    if list(quantiles) != sorted(set(quantiles)):
        raise RockerbogieError(f"quantiles are {quantiles}; give them in ascending order, each once")
    if not (is_number(every) and every > 0):
        raise RockerbogieError(f"every is {every!r:.60}; give a distance above 0, in metres")


def _forecast_rows(distance: Array, slip: Array, every: float) -> Any:
    """Return the rows of the forecasts: each measurement, and each `every` metres after it."""
    rows, at = [], np.inf
    for row in range(len(distance)):
        if np.isfinite(slip[row]) or distance[row] >= at:
            rows.append(row)
            at = distance[row] + every
    return np.array(rows)


def _shares_held(gaps: list[float], travel: float) -> tuple[Array, float]:
    """Return how much of the next metre may pass before the next measurement.

    Args:
        gaps: travel between past measurements, m.
        travel: travel since the last one, m.

    Returns:
        Shares (n,), 0 to 1, equally probable; usual travel from the last measurement to the next, m.
    """
    usual = np.array(gaps[-RECENT:] or [AHEAD])
    usual = usual[usual > travel]
    usual = usual if len(usual) else np.array([travel])
    left = usual[:, None] + np.array(JITTER) - travel
    return np.clip(left.ravel() / AHEAD, 0.0, 1.0), float(np.median(usual))


def _mean_slope(slope: Array, distance: Array, start: int, end: int) -> float:
    """Return the mean slope over the travel between two rows; a usual one if it is not known."""
    part, travel = slope[start : end + 1], np.diff(distance[start : end + 1], prepend=distance[start])
    if not np.isfinite(part).all():
        return USUAL_SLOPE
    return float(np.average(part, weights=travel)) if travel.sum() > 0 else float(part[-1])


def slope_by_map(rover: Rover, terrain: Terrain | None, log: xr.Dataset) -> xr.Dataset:
    """Compute the slope by a map where a log has positions but no attitude.

    Args:
        rover: the rover that made the log.
        terrain: the map; None: the log stays as it is.
        log: as from `read_slip_log`.

    Returns:
        The log; `along` and `across` are those of poses settled on the map, in rows in which they were NaN.
    """
    missing = np.isnan(log["along"].to_numpy()) | np.isnan(log["across"].to_numpy())
    if terrain is None or not missing.any() or any(name not in log for name in PLACES):
        return log
    x, y, yaw, heading = (log[name].to_numpy()[missing] for name in PLACES)
    columns = {name: log[name].to_numpy().copy() for name in ("along", "across")}
    columns["along"][missing], columns["across"][missing] = _slope_at(rover, terrain, x, y, yaw, heading)
    return log.assign({name: ("row", values, log[name].attrs) for name, values in columns.items()})


def _slope_at(rover: Rover, terrain: Terrain, x: Array, y: Array, yaw: Array, heading: Array) -> tuple[Array, Array]:
    """Return the sines of the slope along and across the travel (...) of settled poses, or NaN."""
    known = np.isfinite(x + y + yaw)
    pose = settle(rover, terrain, *(np.where(known, value, 0.0) for value in (x, y, yaw)))
    along, across = -np.sin(pose.pitch) * heading, np.cos(pose.pitch) * np.sin(pose.roll)
    return np.where(known, along, np.nan), np.where(known, across, np.nan)


def _slope_ahead(rover: Rover, terrain: Terrain, data: xr.Dataset, rows: Any) -> Array:
    """Return the sine of the slope half a metre ahead: the present slope plus the map's change."""
    missing = [name for name in PLACES if name not in data]
    if missing:
        raise RockerbogieError(f"a forecast with terrain needs positions, and the log has no {missing[0]}: leave the terrain out")
    x, y, yaw, heading = (data[name].to_numpy()[rows] for name in PLACES)
    step = np.array([[0.0], [1.0]]) * heading * AHEAD / 2
    slopes = _slope_at(rover, terrain, x + step * np.cos(yaw), y + step * np.sin(yaw), yaw, heading)
    present = [data[name].to_numpy()[rows] for name in ("along", "across")]
    moved = [now + np.nan_to_num(part[1] - part[0]) for now, part in zip(present, slopes, strict=True)]
    return np.asarray(np.hypot(*moved))
