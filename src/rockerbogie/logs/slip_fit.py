"""Slip curve of a soil, fitted to telemetry with its uncertainty (docs/forecast.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit, logit

from ..arrays import Array
from ..errors import RockerbogieError, expect
from ..files.version import __version__
from ..motion.soil_slip import SoilSlip
from ..rover.model import LOAD_ROVER, Rover
from ..terrain.heightfield import Terrain
from .forecast import slip_log_of, slope_by_map
from .slip_bank import CHANGES, ERRORS, POSITION_ERROR, SMALLEST, START
from .slip_log import last_of_each

if TYPE_CHECKING:
    import xarray as xr

#: Prior of the level (logit of slip on a horizontal plane) and of the gains on the sines: mean and standard deviation.
PRIOR_MEAN = np.array([float(logit(START)) - 1.2, 6.0, 3.0])
PRIOR_SIGMA = np.array([1.5, 6.0, 6.0])
FEWEST = 4


@dataclass(frozen=True)
class SoilFit:
    """Slip curves of a drive's soil from `fit_soil`.

    The gains on the slope are constant along the drive, the level changes.
    """

    rover: str
    curve: SoilSlip  # soil of the whole drive; its band contains the change along it
    at_end: SoilSlip  # soil at the last measurement, past data only
    change: float  # variance of the level's change per metre
    linear: tuple[float, float]  # along and across of the `SlopeSlip` nearest to the measurements
    data: xr.Dataset  # over `measurement`: see `fit_soil`

    def slip(
        self, along: ArrayLike, across: ArrayLike = 0.0, *, quantiles: ArrayLike = (0.1, 0.5, 0.9), last: bool = False
    ) -> Array:
        """Return quantiles of the slip on a slope.

        Args:
            along: (...) sine of the slope in the direction of travel, uphill positive.
            across: (...) sine of the slope across it.
            quantiles: (k,) probabilities.
            last: use the soil at the end of the log instead of the soil of the whole drive.

        Returns:
            (..., k) slips.
        """
        return (self.at_end if last else self.curve).slip(along, across, quantiles=quantiles)


def fit_soil(rover: Rover, terrain: Terrain | None, log: str | Path | xr.Dataset) -> SoilFit:
    """Fit a slip curve to the slip and the slope of a log.

    The logit of slip is a level plus two gains times the sines of the slope along and across. A Kalman filter runs along the
    drive with the level and both gains as state, and a smoother runs back. The change of the level per metre and the error of a
    measurement are the most likely ones of a grid. Slip is the logged one, or that of corrected
    positions; slope is the logged attitude, or that of poses settled on the map.

    Args:
        rover: the rover that made the log.
        terrain: the map, or None. It gives the slope where the log has positions but no attitude.
        log: a file of `read_slip_log`, or such a Dataset; with attitude, or with positions on the map.

    Returns:
        A `SoilFit`. Its `data` hold over `measurement`: `time` (s), `distance` (m), `slip`, `along`, `across` (mean sines since
        the measurement before), `fitted` (slip by the smoothed state), `level`, `level_sigma` from the whole drive, and from
        past data only `level_past`, `level_past_sigma`, `gain_past` and `gain_past_sigma` (measurement, axis).

    Raises:
        RockerbogieError: fewer than 4 measurements, or rows without slope.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    if terrain is not None:
        expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_raster, or give None")
    table = _measurements(slope_by_map(rover, terrain, slip_log_of(log, rover)))
    y = logit(np.clip(table["slip"], SMALLEST, 1 - SMALLEST))
    H = np.column_stack([np.ones(len(y)), table["along"], np.abs(table["across"])])
    travel = np.diff(table["distance"], prepend=table["distance"][0])
    grid = list(product(CHANGES, ERRORS))
    runs = [_filter(y, H, travel, change, np.where(table["from_position"] > 0, POSITION_ERROR, error)) for change, error in grid]
    best = int(np.argmax([run[0] for run in runs]))
    change, error = grid[best]
    _, means, covariances = runs[best]
    smooth, smooth_covariance = _smooth(means, covariances, travel, change)
    gains, gain_covariance = smooth[-1, 1:], smooth_covariance[-1, 1:, 1:]
    level_here = (H * smooth).sum(axis=1) - H[:, 1:] @ gains
    centre = np.concatenate([[1.0], H[:, 1:].mean(axis=0)])
    fitted_error = float(np.mean([centre @ P @ centre for P in smooth_covariance]))
    last_error = float(centre @ covariances[-1] @ centre)
    (a, b), (_, c) = gain_covariance.tolist()
    across = np.abs(table["across"])
    curve = SoilSlip(
        level=float(level_here.mean()), level_sigma=float(np.sqrt(level_here.var() + fitted_error)),
        gain_along=float(gains[0]), gain_across=float(gains[1]), gain_covariance=((a, b), (b, c)),
        centre=(float(centre[1]), float(centre[2])), error=error,
        along_range=(float(table["along"].min()), float(table["along"].max())),
        across_range=(float(across.min()), float(across.max())),
    )  # fmt: skip
    last = float(means[-1] @ centre - gains @ centre[1:])
    return SoilFit(
        rover=rover.name,
        curve=curve,
        at_end=replace(curve, level=last, level_sigma=float(np.sqrt(last_error))),
        change=change,
        linear=_linear(table["slip"], table["along"], table["across"]),
        data=_fit_data(table, H, means, covariances, smooth, smooth_covariance),
    )


def _measurements(log: xr.Dataset) -> dict[str, Array]:
    """Return the measurements of a log with their mean slopes, each (n,)."""
    slip, distance = log["slip"].to_numpy(), log["distance"].to_numpy()
    rows = last_of_each(distance, slip)
    if len(rows) < FEWEST:
        raise RockerbogieError(f"{log.attrs['log']} has {len(rows)} measurements of slip: a fit needs {FEWEST} or more")
    slopes = np.stack([log[name].to_numpy()[: rows[-1] + 1] for name in ("along", "across")])
    without = int(np.isnan(slopes).any(axis=0).sum())
    if without == slopes.shape[1] or (without and "x" not in log):
        raise RockerbogieError(
            f"{log.attrs['log']} has no attitude: a slip curve needs the slope; add roll and pitch, give a map for the positions "
            "x, y and yaw of the log, or use the forecast alone"
        )
    if without:
        raise RockerbogieError(
            f"{log.attrs['log']}: {without} of {slopes.shape[1]} rows have no slope, neither by attitude nor by a pose on the "
            "map; leave these rows out"
        )
    found = {name: log[name].to_numpy()[rows].astype(float) for name in ("time", "distance", "slip", "from_position")}
    for name in ("along", "across"):
        values, total = log[name].to_numpy(), np.diff(distance, prepend=distance[0])
        starts = np.concatenate([[0], rows[:-1] + 1])
        weights = np.add.reduceat(total, starts)[: len(rows)]
        sums = np.add.reduceat(total * values, starts)[: len(rows)]
        if rows[-1] + 1 < len(values):  # the last sum must end at the last measurement
            last = slice(starts[-1], rows[-1] + 1)
            weights[-1], sums[-1] = total[last].sum(), (total * values)[last].sum()
        found[name] = np.where(weights > 0, sums / np.where(weights > 0, weights, 1.0), values[rows])
    return found


def _filter(y: Array, H: Array, travel: Array, change: float, error: Array) -> tuple[float, Array, Array]:
    """Return log likelihood, states (n, 3) and covariances (n, 3, 3) after each measurement."""
    x, P = PRIOR_MEAN.copy(), np.diag(PRIOR_SIGMA**2)
    likelihood, means, covariances = 0.0, [], []
    for k in range(len(y)):
        P = P.copy()
        P[0, 0] += change * travel[k]
        gain = P @ H[k]
        variance = float(H[k] @ gain + error[k])
        off = float(y[k] - H[k] @ x)
        likelihood -= 0.5 * (np.log(variance) + off**2 / variance)
        x, P = x + gain * off / variance, P - np.outer(gain, gain) / variance
        means.append(x)
        covariances.append(P)
    return likelihood, np.array(means), np.array(covariances)


def _smooth(means: Array, covariances: Array, travel: Array, change: float) -> tuple[Array, Array]:
    """Return states and covariances from the whole drive (Rauch, Tung and Striebel)."""
    smooth, spread = means.copy(), covariances.copy()
    for k in range(len(means) - 2, -1, -1):
        ahead = covariances[k].copy()
        ahead[0, 0] += change * travel[k + 1]
        gain = np.linalg.solve(ahead, covariances[k]).T
        smooth[k] = means[k] + gain @ (smooth[k + 1] - means[k])
        spread[k] = covariances[k] + gain @ (spread[k + 1] - ahead) @ gain.T
    return smooth, spread


def _linear(slip: Array, along: Array, across: Array) -> tuple[float, float]:
    """Return the coefficients of the nearest slip² = (a · along)² + (c · across)²."""
    from scipy.optimize import nnls

    squares, _ = nnls(np.column_stack([along**2, across**2]), np.maximum(slip, 0.0) ** 2)
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))


def _fit_data(
    table: dict[str, Array], H: Array, means: Array, covariances: Array, smooth: Array, smooth_covariance: Array
) -> xr.Dataset:
    """Return the Dataset of a fit."""
    import xarray as xr

    number = {"units": "1"}
    sigma = np.sqrt(np.diagonal(smooth_covariance, axis1=1, axis2=2))
    past = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    columns = {
        "slip": table["slip"], "along": table["along"], "across": table["across"], "from_position": table["from_position"] > 0,
        "fitted": expit((H * smooth).sum(axis=1)), "level": smooth[:, 0], "level_sigma": sigma[:, 0],
        "level_past": means[:, 0], "level_past_sigma": past[:, 0],
    }  # fmt: skip
    return xr.Dataset(
        {
            **{name: ("measurement", values, number) for name, values in columns.items()},
            "gain_past": (("measurement", "axis"), means[:, 1:], number),
            "gain_past_sigma": (("measurement", "axis"), past[:, 1:], number),
        },
        {
            "time": ("measurement", table["time"], {"units": "s"}),
            "distance": ("measurement", table["distance"], {"units": "m"}),
            "axis": ["along", "across"],
        },
        {"source": f"rockerbogie {__version__} fit_soil"},
    )
