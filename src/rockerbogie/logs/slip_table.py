"""Slip tables: slip by slope, heading and soil, for planning by hand."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array
from ..errors import RockerbogieError, expect
from ..files.outputs import check_outputs
from ..files.version import __version__
from ..gravity import GRAVITY, check_gravity
from ..motion.prediction.outcome import DriveEnd
from ..motion.prediction.plane_slip import plane_slip
from ..motion.soil_slip import SoilSlip
from ..rover.model import LOAD_ROVER, Rover
from ..terrain.soil.fit import WheelFit
from ..terrain.soil.laws import Grousers, WheelLaw
from .slip_fit import SoilFit

if TYPE_CHECKING:
    import xarray as xr

#: Soil of a table: fitted to slip on slopes; or one on which a rover is predicted, a list being samples of an uncertain soil.
TableSoil = SoilFit | SoilSlip | str | WheelLaw | WheelFit | Sequence[WheelLaw]
SLOPES = np.radians(np.arange(0.0, 25.1, 2.5))
HEADINGS = np.radians(np.arange(0.0, 180.1, 45.0))
QUANTILES = (0.1, 0.5, 0.9)
#: A slope this much steeper than those of the log is extrapolated, rad.
MARGIN = np.radians(2.0)
#: Samples of a fitted soil.
SAMPLES = 40
ADVANCES, NO_PROGRESS = "advances", "no progress"
GIVE = (
    "give a soil's name or law, a result of fit_wheel_trials, a list of laws (samples of one soil), a result of fit_soil, "
    "a SoilSlip, or a dict of these by name"
)


def slip_table(
    soils: TableSoil | Sequence[str] | Mapping[str, TableSoil],
    slopes: ArrayLike = SLOPES,
    headings: ArrayLike = HEADINGS,
    *,
    quantiles: Sequence[float] = QUANTILES,
    rover: Rover | None = None,
    gravity: float = GRAVITY["earth"],
    grousers: Grousers | float | None = None,
    torque: ArrayLike | None = None,
) -> xr.Dataset:
    """Tabulate slip by slope, heading and soil, measured or predicted.

    Slip is 1 − advance along the heading / wheel travel. For a soil that was fitted to slip on slopes, it is read from the
    curve. For a soil's law, it is that of the rover's balance on a plane (`predict`).

    Args:
        soils: one of these, or several by name:
            a result of `fit_soil` (the soil of the whole drive counts) or a `SoilSlip`;
            a name of `soils()` or a law: predicted, without a band;
            a result of `fit_wheel_trials`, or a list of laws, samples of one uncertain soil: predicted, with a band.
            A list of names stands for several soils.
        slopes: (n,) angles of the steepest ascent, rad, from 0 to below π/2.
        headings: (m,) angles on the slope from straight uphill, rad: 0 uphill, π/2 across, π downhill.
        quantiles: (k,) ascending probabilities. A soil without a band has a value at 0.5 only.
        rover: the rover to predict, with masses.
        gravity: of a predicted rover, m/s².
        grousers, torque: of a predicted rover, as for `predict`.

    Returns:
        Dataset over `soil`, `slope` (rad), `heading` (rad), `probability`. `slip`: quantiles; 1 where the rover makes no
        progress, NaN where it has no motion, or no band. `drift` (rad; soil, slope, heading): median angle from the heading to
        the direction of travel, to the left; NaN for a fitted curve. `status`: "advances", "no progress" (median slip 1), or the
        reason for which there is no motion. `outside`: True where the slope is beyond those of the log by more than 2°, so that
        the curve is extrapolated.

    Raises:
        RockerbogieError: no soil, one of another kind, angles or quantiles out of range; no rover, or one that `predict` refuses.
    """
    import xarray as xr

    named = _named(soils)
    slope, heading = _angles(slopes, "slopes"), _angles(headings, "headings")
    if not ((slope >= 0.0) & (slope < np.pi / 2)).all():
        raise RockerbogieError(f"slopes are {slope.min():g} to {slope.max():g} rad; give 0 to below π/2: are they in degrees?")
    if np.abs(heading).max() > 2.0 * np.pi + 1e-9:
        raise RockerbogieError(f"headings reach {np.abs(heading).max():g} rad; give at most 2 π: are they in degrees?")
    levels = _quantiles(quantiles)
    columns = []
    for name, soil in named.items():
        if isinstance(soil, SoilFit | SoilSlip):
            columns.append(_curve(soil.curve if isinstance(soil, SoilFit) else soil, slope, heading, levels))
            continue
        if rover is None:
            raise RockerbogieError(f"the slip on {name!r} depends on the rover: give rover=")
        expect(rover, Rover, "rover", LOAD_ROVER)
        if isinstance(soil, WheelFit):
            samples: list[str | WheelLaw] = list(soil.samples(SAMPLES))
        else:
            samples = [soil] if isinstance(soil, str | WheelLaw) else list(soil)
        if len(samples) == 1 and 0.5 not in levels:
            raise RockerbogieError(f"soil {name!r} has no uncertainty, so its slip has no band: include 0.5 in quantiles")
        field = check_gravity(gravity)
        columns.append(_predicted(rover, samples, slope, heading, levels, field, grousers, torque))
    over = ("soil", "slope", "heading")
    slip, drift, outside, status = (np.stack(parts) for parts in zip(*columns, strict=True))
    return xr.Dataset(
        {
            "slip": ((*over, "probability"), slip, {"units": "1", "long_name": "quantile of slip"}),
            "drift": (over, drift, {"units": "rad", "long_name": "angle from the heading to the direction of travel"}),
            "status": (over, status, {"long_name": "motion of the rover"}),
            "outside": (over, outside, {"long_name": "slope beyond those of the log"}),
        },
        {
            "soil": list(named),
            "slope": ("slope", slope, {"units": "rad"}),
            "heading": ("heading", heading, {"units": "rad", "long_name": "angle from uphill, on the slope"}),
            "probability": levels,
        },
        {"source": f"rockerbogie {__version__} slip_table"}
        | ({} if rover is None else {"rover": rover.name, "gravity": gravity}),
    )


def write_slip_table(table: xr.Dataset, file: str | Path, *, force: bool = False) -> Path:
    """Write a slip table as CSV, one row per soil, slope and heading, angles in degrees.

    A cell without a value is empty; `status` gives the reason.

    Args:
        table: from `slip_table`.
        file: the CSV. A slip table there is replaced; another file is not.
        force: True to replace a file of another program.

    Returns:
        The file.

    Raises:
        RockerbogieError: not a slip table; the file exists and is no slip table, or cannot be written.
    """
    import xarray as xr

    if not (isinstance(table, xr.Dataset) and {"slip", "drift", "outside", "status", "probability"} <= {*table.variables}):
        raise RockerbogieError(f"table is {type(table).__name__}, not a slip table: make one with rockerbogie.slip_table")
    path = Path(file)
    check_outputs([path], force=force)
    names = [f"slip {100 * q:g} % [1]" for q in table["probability"].to_numpy()]
    rows = table_rows(table)
    try:
        with open(path, "w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(["soil", "slope [deg]", "heading [deg]", *names, "drift [deg]", "extrapolated", "status"])
            writer.writerows(rows)
    except OSError as error:
        raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None
    return path


def table_rows(table: xr.Dataset) -> list[list[str]]:
    """Return the rows of a slip table as text.

    Args:
        table: from `slip_table`.

    Returns:
        Rows of soil, slope and heading (degrees), slips, drift (degrees), "yes" if extrapolated, status.
    """
    slip, outside, status = (table[name].to_numpy() for name in ("slip", "outside", "status"))
    slopes, headings, drift = (np.degrees(table[name].to_numpy()) for name in ("slope", "heading", "drift"))
    rows = []
    for n, i, j in np.ndindex(status.shape):
        slips = ["" if np.isnan(value) else f"{value:.3f}" for value in slip[n, i, j]]
        angle = 0.0 + round(drift[n, i, j], 1)  # 0.0 + removes the sign of -0
        side = "" if np.isnan(angle) else f"{180.0 if angle == -180.0 else angle:.1f}"
        flag = "yes" if outside[n, i, j] else "no"
        name = str(table["soil"].to_numpy()[n])
        rows.append([name, f"{slopes[i]:.6g}", f"{headings[j]:.6g}", *slips, side, flag, str(status[n, i, j])])
    return rows


class _Column(NamedTuple):
    """Part of a table of one soil, over slopes and headings."""

    slip: Array  # (..., k)
    drift: Array  # (...) rad
    outside: NDArray[np.bool_]
    status: NDArray[np.str_]


def _named(soils: object) -> dict[str, TableSoil]:
    """Return the soils by name, or raise."""
    if isinstance(soils, Mapping):
        given = dict(soils)
    elif isinstance(soils, Sequence) and not isinstance(soils, str) and soils and all(isinstance(soil, str) for soil in soils):
        given = {soil: soil for soil in soils}
        if len(given) < len(soils):
            raise RockerbogieError(f"soils {', '.join(soils)}: one is given twice")
    else:
        given = {soils if isinstance(soils, str) else getattr(soils, "name", "soil"): soils}
    for name, soil in given.items():
        samples = isinstance(soil, Sequence) and not isinstance(soil, str)
        kinds = all(isinstance(law, WheelLaw) for law in soil) and len(soil) > 0 if samples else False
        if not (kinds or isinstance(soil, SoilFit | SoilSlip | WheelFit | WheelLaw | str)):
            raise RockerbogieError(f"soil {name!r} of a slip table is {soil!r:.60}: {GIVE}")
    if not given:
        raise RockerbogieError(f"a slip table needs a soil: {GIVE}")
    return given


def _angles(value: ArrayLike, name: str) -> Array:
    """Return angles (n,) as finite floats, or raise."""
    try:
        angles = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        raise RockerbogieError(f"{name} are {value!r:.60}; give angles in rad") from None
    if angles.ndim != 1 or angles.size == 0 or not np.isfinite(angles).all():
        raise RockerbogieError(f"{name} have shape {angles.shape}; give one or more finite angles in rad")
    return angles


def _quantiles(quantiles: Sequence[float]) -> list[float]:
    """Return probabilities as floats, or raise."""
    try:
        levels = [float(q) for q in quantiles]
    except (TypeError, ValueError):
        levels = []
    if not levels or not all(0.0 < q < 1.0 for q in levels) or any(b <= a for a, b in pairwise(levels)):
        raise RockerbogieError(f"quantiles are {quantiles!r:.60}; give ascending probabilities above 0 and below 1")
    return levels


def _curve(curve: SoilSlip, slope: Array, heading: Array, levels: list[float]) -> _Column:
    """Return the slip of a fitted curve."""
    along = np.sin(slope)[:, None] * np.cos(heading)
    across = np.sin(slope)[:, None] * np.sin(heading)
    slip = curve.slip(along, across, quantiles=levels)
    outside = np.asarray(curve.outside(along, across, float(np.sin(MARGIN))))
    return _Column(slip, np.full(along.shape, np.nan), outside, np.full(along.shape, ADVANCES, dtype="U20"))


def _predicted(
    rover: Rover, samples: Sequence[str | WheelLaw], slope: Array, heading: Array, levels: list[float], gravity: float,
    grousers: Grousers | float | None, torque: ArrayLike | None,
) -> _Column:  # fmt: skip
    """Return the predicted slip on one soil, of which `samples` are given."""
    found = plane_slip(rover, samples, slope, heading, gravity, grousers, torque)
    capped = np.minimum(found.slip, 1.0)
    none = np.isnan(found.slip)
    slip = np.full((*capped.shape[1:], len(levels)), np.nan)
    if len(samples) == 1:
        slip[..., levels.index(0.5)] = capped[0]
    else:
        slip[:] = np.moveaxis(np.quantile(capped, levels, axis=0), 0, -1)
    status = np.where(np.median(capped, axis=0) < 1.0, ADVANCES, NO_PROGRESS).astype("U20")
    for i, j in np.argwhere(none.any(axis=0)):
        code = DriveEnd(found.end[np.argmax(none[:, i, j]), i, j])
        status[i, j] = DriveEnd.STALLS.name.lower() if code == DriveEnd.REACHED_END else code.name.lower().replace("_", " ")
    # the mean direction: angles wrap at π
    middle = np.arctan2(np.median(np.sin(found.drift), axis=0), np.median(np.cos(found.drift), axis=0))
    return _Column(slip, middle, np.zeros(status.shape, dtype=bool), status)
