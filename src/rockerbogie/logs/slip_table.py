"""Slip tables: slip by slope, heading and soil, for planning by hand."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..errors import RockerbogieError
from ..files.version import __version__
from ..motion.soil_slip import SoilSlip
from .slip_fit import SoilFit

if TYPE_CHECKING:
    import xarray as xr

Soil = SoilFit | SoilSlip
SLOPES = np.radians(np.arange(0.0, 25.1, 2.5))
HEADINGS = np.radians(np.arange(0.0, 180.1, 45.0))
QUANTILES = (0.1, 0.5, 0.9)


def slip_table(
    soils: Soil | Mapping[str, Soil],
    slopes: ArrayLike = SLOPES,
    headings: ArrayLike = HEADINGS,
    *,
    quantiles: tuple[float, ...] = QUANTILES,
) -> xr.Dataset:
    """Tabulate slip by slope, heading and soil.

    Args:
        soils: a result of `fit_soil` (then the soil of the whole drive counts) or a `SoilSlip`, or several by name.
        slopes: (n,) angles of the steepest ascent, rad, 0 to π/2.
        headings: (m,) angles from straight uphill, rad: 0 uphill, π/2 across, π downhill.
        quantiles: probabilities of the quantiles.

    Returns:
        Dataset over `soil`, `slope` (rad), `heading` (rad), `probability`: `slip`. `outside` (soil, slope, heading) is True
        where the slope is beyond those of the log by more than 2°: there the curve is extrapolated.

    Raises:
        RockerbogieError: no soil, or slopes out of range.
    """
    import xarray as xr

    given = {"soil": soils} if isinstance(soils, SoilFit | SoilSlip) else dict(soils)
    if not given or not all(isinstance(fit, SoilFit | SoilSlip) for fit in given.values()):
        raise RockerbogieError("a slip table needs fitted soils: give the result of fit_soil, or a dict of names and results")
    named = {name: fit.curve if isinstance(fit, SoilFit) else fit for name, fit in given.items()}
    slope, heading = (np.atleast_1d(np.asarray(angle, dtype=float)) for angle in (slopes, headings))
    if not (np.isfinite(slope).all() and (slope >= 0).all() and (slope < np.pi / 2).all() and np.isfinite(heading).all()):
        raise RockerbogieError(
            "slopes and headings are finite angles in radians, slopes from 0 to π/2: convert degrees to radians"
        )
    along = np.sin(slope)[:, None] * np.cos(heading)
    across = np.sin(slope)[:, None] * np.sin(heading)
    slip = np.stack([curve.slip(along, across, quantiles=quantiles) for curve in named.values()])
    margin = np.sin(np.radians(2.0))
    outside = np.stack([curve.outside(along, across, margin) for curve in named.values()])
    over = ("soil", "slope", "heading")
    return xr.Dataset(
        {
            "slip": ((*over, "probability"), slip, {"units": "1", "long_name": "quantile of slip"}),
            "outside": (over, outside, {"long_name": "slope beyond those of the log"}),
        },
        {
            "soil": list(named),
            "slope": ("slope", slope, {"units": "rad"}),
            "heading": ("heading", heading, {"units": "rad", "long_name": "angle from uphill"}),
            "probability": list(quantiles),
        },
        {"source": f"rockerbogie {__version__} slip_table"},
    )


def write_slip_table(table: xr.Dataset, file: Path) -> Path:
    """Write a slip table as CSV, one row per soil, slope and heading, angles in degrees.

    Args:
        table: from `slip_table`.
        file: the CSV; replaced if it exists.

    Returns:
        The file.
    """
    names = [f"slip {100 * q:g} %" for q in table["probability"].to_numpy()]
    with open(file, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["soil", "slope [deg]", "heading [deg]", *names, "extrapolated"])
        for soil in table["soil"].to_numpy():
            one = table.sel(soil=soil)
            for i, slope in enumerate(np.degrees(table["slope"].to_numpy())):
                for j, heading in enumerate(np.degrees(table["heading"].to_numpy())):
                    slips = one["slip"].to_numpy()[i, j]
                    outside = "yes" if one["outside"].to_numpy()[i, j] else "no"
                    writer.writerow([soil, f"{slope:g}", f"{heading:g}", *(f"{slip:.3f}" for slip in slips), outside])
    return file
