"""Scores of a slip forecast against the rest of its log (docs/forecast.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from .slip_log import arrange_slip_log, last_of_each

if TYPE_CHECKING:
    import xarray as xr

#: Measurements before the first score: the filters start without any.
SKIPPED = 3
#: Warnings less than this apart are one, m; a warning is false if the slip stays below the limit until this far after it, m.
TOGETHER = 2.0
TARGETS = ("next measurement", "log over the next metre")
BY = ("forecast", "last measurement", "last metre", "slope only")
#: Weight of the slope's coefficient towards 0 in the slope-only fit.
RIDGE = 1e-2


def score_forecast(forecast: xr.Dataset, log: xr.Dataset) -> xr.Dataset:
    """Score a forecast beside simpler ones: the same as before, and a fit of slip on slope.

    Two targets: the next measured slip, at each measurement; and the mean of the log's slip, held between measurements, over
    the next metre of wheel travel, at each forecast (left out if there is none between measurements). "last measurement" is
    the newest slip, "last metre" the mean of the log's slip over the last metre, "slope only" least squares on the slope over all
    past measurements.

    Args:
        forecast: from `forecast_slip`.
        log: the slip log that it was made of.

    Returns:
        Dataset over `target` and `by`: `rmse`; over `target`: `count`, `coverage` of the band between the outer quantiles.
        Attributes: `level` of that band; `warnings`; `false_warnings`, those after which slip stays below the limit for 2 m;
        `passes_limit`, the wheel travel at which slip first exceeds the limit, m, and `lead`, the travel from the start of the
        warning in force to there, m (0 without a warning); both NaN if slip does not exceed it.

    Raises:
        RockerbogieError: too few measurements.
    """
    import xarray as xr

    data = arrange_slip_log(log)
    known = last_of_each(data["distance"].to_numpy(), data["slip"].to_numpy())
    travel, slip = (data[name].to_numpy()[known] for name in ("distance", "slip"))
    slope = np.hypot(data["along"].to_numpy(), data["across"].to_numpy())[known]
    measured = data["row"].to_numpy()[known]
    if len(slip) < SKIPPED + 3:
        raise RockerbogieError(f"the log has {len(slip)} measurements of slip: a score needs {SKIPPED + 3}")
    at = forecast["distance"].to_numpy()
    fitted = _slope_fits(slip, slope)
    first = travel[SKIPPED]
    rmse, count, coverage = np.full((2, len(BY)), np.nan), np.zeros(2, dtype=np.int64), np.full(2, np.nan)
    row = forecast["row"].to_numpy()
    latest = np.searchsorted(measured, row, side="right") - 1
    steps = np.flatnonzero((at >= first) & np.isin(row, measured) & (latest < len(slip) - 1))
    rows = np.flatnonzero((at >= first) & (at + 1 <= travel[-1]))
    rows = rows[: 0 if np.isin(row, measured).all() else None]
    truths = slip[latest[steps] + 1], _held(travel, slip, at[rows], at[rows] + 1)
    for k, (used, truth) in enumerate(zip((steps, rows), truths, strict=True)):
        if not len(used):
            continue
        mean, quantile = (forecast[("", "held_")[k] + name].to_numpy() for name in ("mean", "quantile"))
        count[k] = len(used)
        coverage[k] = ((quantile[used, 0] <= truth) & (truth <= quantile[used, -1])).mean()
        metre = _held(travel, slip, at[used] - 1, at[used])
        guesses = mean[used], slip[latest[used]], metre, fitted[latest[used]]
        rmse[k] = [np.sqrt(np.mean((guess - truth) ** 2)) for guess in guesses]
    probability = forecast["probability"].to_numpy()
    attrs = {"log": data.attrs["log"], "level": float(probability[-1] - probability[0])}
    number = {"units": "1"}
    return xr.Dataset(
        {
            "rmse": (("target", "by"), rmse, number | {"long_name": "root mean square error"}),
            "count": ("target", count, number),
            "coverage": ("target", coverage, number | {"long_name": "share inside the band"}),
        },
        {"target": list(TARGETS), "by": list(BY)},
        attrs | _warnings(forecast, travel, slip),
    )


def _held(travel: Array, slip: Array, start: Array, end: Array) -> Array:
    """Return the mean from start to end of a slip that is held between measurements."""
    total = np.concatenate([[0.0], np.cumsum(slip[:-1] * np.diff(travel))])

    def integral(x: Array) -> Array:
        k = np.maximum(np.searchsorted(travel, x, side="right") - 1, 0)
        return np.asarray(total[k] + slip[k] * (x - travel[k]))

    begin = np.maximum(start, travel[0])
    return np.asarray((integral(end) - integral(begin)) / (end - begin))


def _slope_fits(slip: Array, slope: Array) -> Array:
    """Return the slip (n,) by fits on slope, each on all measurements up to its own."""
    found = np.cumsum(slip) / np.arange(1, len(slip) + 1)
    for n in range(3, len(slip)):
        x, y = slope[: n + 1], slip[: n + 1]
        if np.isfinite(x).all():
            off = x - x.mean()
            found[n] = y.mean() + off[-1] * (off @ (y - y.mean())) / (off @ off + RIDGE**2)
    return found


def _warnings(forecast: xr.Dataset, travel: Array, slip: Array) -> dict[str, Any]:
    """Return the number of warnings, of false ones, and the lead before the limit is passed."""
    at, warned, limit = forecast["distance"].to_numpy(), forecast["warning"].to_numpy(), float(forecast.attrs["limit"])
    episodes: list[list[float]] = []
    for where in at[warned]:
        if episodes and where - episodes[-1][1] <= TOGETHER:
            episodes[-1][1] = float(where)
        else:
            episodes.append([float(where), float(where)])
    high = travel[slip > limit]
    over = [(start, end) for start, end in episodes if end + TOGETHER <= at[-1]]  # later ones are open when the log ends
    false = sum(not ((high >= start) & (high <= end + TOGETHER)).any() for start, end in over)
    found: dict[str, Any] = {"warnings": len(episodes), "false_warnings": false, "passes_limit": np.nan, "lead": np.nan}
    if len(high):
        passed = float(high[0])
        force = [start for start, end in episodes if start < passed <= end + TOGETHER]
        found |= {"passes_limit": passed, "lead": passed - force[0] if force else 0.0}
    return found
