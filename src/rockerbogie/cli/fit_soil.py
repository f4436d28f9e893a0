"""Command `rockerbogie fit-soil`: slip curve and slip forecast of a drive's log."""

from __future__ import annotations

import csv
import json as json_format
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.table import Table

from ..errors import RockerbogieError
from ..logs.forecast import LIMIT, THRESHOLD, forecast_slip
from ..logs.forecast_score import score_forecast
from ..logs.slip_fit import SoilFit
from ..logs.slip_fit import fit_soil as fit
from ..logs.slip_log import last_of_each, read_slip_log
from ..logs.slip_table import slip_table, write_slip_table
from ..motion.soil_slip import CURVE, END_CURVE
from ..rover.formats import load_rover
from .common import Folder, Force, Json, Linear, RoverName, guard_outputs, in_folder, make_folder, print_json, progress
from .rasters import Raster, load_terrain

if TYPE_CHECKING:
    import xarray as xr

#: Heads of the scores, in the order of `forecast_score.BY`.
HEADS = ("forecast", "last value", "last metre", "slope fit")
FILES = ("fit_soil.png", "fit_soil.json", "forecast.csv", "slip_table.csv")


def fit_soil(
    log: FilePath,
    /,
    *,
    rover: RoverName = "perseverance",
    terrain: Annotated[str | None, Parameter(name=["--terrain", "-t"])] = None,
    limit: float = LIMIT,
    threshold: float = THRESHOLD,
    linear: Linear = None,
    raster: Raster = None,
    output: Folder = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Fit a slip curve to a drive, and forecast its slip metre by metre from past telemetry.

    Prints the curve with its uncertainty, the warnings, and the errors of the forecast, of the last value and of a fit to
    slope. With -o it writes fit_soil.png, fit_soil.json, forecast.csv and slip_table.csv (slip by slope and heading).

    Parameters
    ----------
    log
        A CSV with time [s], slip [1], distance [m] (wheel travel) and, for the curve, roll and pitch, or x [m], y [m] and
        yaw with --terrain; or a published log of Perseverance (docs/forecast.md).
    rover
        A preset's name, or a rover file.
    terrain
        The map, if there is one: the forecast then uses the slope ahead, and poses on the map give the slope where the log
        has positions but no attitude. A raster file, or surface:NAME.
    limit
        Slip that the warning is about.
    threshold
        Warn if the probability that slip exceeds --limit within 2 m is at least this.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: cubic for files.
    output
        Folder for picture and data.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of the tables.
    """
    guard_outputs(in_folder(output, *FILES), log, rover, terrain, force=force)
    machine = load_rover(rover)
    ground = None if terrain is None else load_terrain(terrain, linear, raster)
    with progress() as bar:
        task = bar.add_task("reading", total=None)
        data = read_slip_log(log, machine)
        bar.update(task, description="forecasting")
        forecast = forecast_slip(machine, ground, data, limit=limit, threshold=threshold)
        curve, reason = _curve(machine, ground, data)
        try:
            score = score_forecast(forecast, data)
        except RockerbogieError:  # a short log has a forecast but no score
            score = None
        summary = _summary(data, curve, reason, forecast, score)
        bar.update(task, description="drawing")
        files = _write(data, curve, forecast, summary, output)
    if json:
        print_json(summary | {"files": files})
        return
    _print(summary, curve, score)
    for file in files:
        print(file)


def _curve(machine: Any, ground: Any, data: xr.Dataset) -> tuple[SoilFit | None, str]:
    """Return the fitted curve; None and the reason if the log does not determine one."""
    try:
        return fit(machine, ground, data), ""
    except RockerbogieError as error:
        return None, str(error)


def _summary(
    data: xr.Dataset, curve: SoilFit | None, reason: str, forecast: xr.Dataset, score: xr.Dataset | None
) -> dict[str, Any]:
    """Return the results as JSON's types."""
    found: dict[str, Any] = {
        "source": forecast.attrs["source"], "log": data.attrs["log"], "rover": forecast.attrs["rover"],
        "measurements": len(last_of_each(data["distance"].to_numpy(), data["slip"].to_numpy())),
        "wheel_travel": float(data["distance"][-1]),
        "limit": forecast.attrs["limit"], "threshold": forecast.attrs["threshold"],
    }  # fmt: skip
    if curve is None:
        found |= {CURVE: None, END_CURVE: None, "no_curve_because": reason}
    else:
        found |= {CURVE: curve.curve.to_dict(), END_CURVE: curve.at_end.to_dict()}
        found |= {"change": curve.change, "linear": list(curve.linear)}
    if score is not None:
        found["score"] = {
            str(target): {
                "count": int(score["count"].sel(target=target)),
                "coverage": float(score["coverage"].sel(target=target)),
                "rmse": {str(by): float(score["rmse"].sel(target=target, by=by)) for by in score["by"].to_numpy()},
            }
            for target in score["target"].to_numpy()[score["count"].to_numpy() > 0]
        } | {name: _finite(score.attrs[name]) for name in ("level", "warnings", "false_warnings", "passes_limit", "lead")}
    last = forecast.isel(step=-1)
    found["now"] = {
        "distance": float(last["distance"]), "known": float(last["known"]), "mean": float(last["mean"]),
        "quantile": last["quantile"].to_numpy(), "exceed": float(last["exceed"]), "warning": bool(last["warning"]),
        "held_mean": float(last["held_mean"]), "held_quantile": last["held_quantile"].to_numpy(),
    }  # fmt: skip
    return found


def _finite(value: float) -> float | None:
    """Return a number; None, which JSON has, for NaN."""
    return value if np.isfinite(value) else None


def _write(
    data: xr.Dataset, curve: SoilFit | None, forecast: xr.Dataset, summary: dict[str, Any], output: FilePath | None
) -> list[FilePath]:
    """Write picture, summary, forecast and slip table; return the files."""
    if output is None:
        return []
    from ..figures.slip import slip_figure
    from ..figures.style import save

    picture, record, steps, table = in_folder(make_folder(output), *FILES)
    save(slip_figure(data, forecast, curve), picture)
    text = json_format.dumps(summary, indent=2, allow_nan=False, default=lambda value: np.asarray(value).tolist())
    record.write_text(text + "\n", encoding="utf-8")
    with open(steps, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        names = [f"slip {100 * q:g} %" for q in forecast["probability"].to_numpy()]
        held = ["held mean", *(f"held {name}" for name in names)]
        writer.writerow(["time [s]", "distance [m]", "known slip", "mean slip", *names, "exceed", "warning", *held])
        for k in range(forecast.sizes["step"]):
            one = forecast.isel(step=k)
            numbers = [one["known"], one["mean"], *one["quantile"].to_numpy(), one["exceed"]]
            row = [f"{float(one['time']):.3f}", f"{float(one['distance']):.3f}", *(f"{float(v):.4f}" for v in numbers)]
            last = (f"{float(v):.4f}" for v in (one["held_mean"], *one["held_quantile"].to_numpy()))
            writer.writerow([*row, int(one["warning"]), *last])
    if curve is None:
        return [picture, record, steps]
    write_slip_table(slip_table(curve), table, force=True)  # guarded with the other files
    return [picture, record, steps, table]


def _print(summary: dict[str, Any], curve: SoilFit | None, score: xr.Dataset | None) -> None:
    """Print curve, errors and warnings."""
    console = Console(highlight=False, soft_wrap=True)
    console.print(
        f"[bold]{summary['log']}[/]: {summary['measurements']} measurements on {summary['wheel_travel']:.1f} m of wheel travel"
    )
    if curve is None:
        console.print(f"no slip curve: {summary['no_curve_because']}", markup=False)
    else:
        law = curve.curve
        sigma = np.sqrt(np.diag(law.gain_covariance))
        console.print(
            f"logit(slip) = {law.level:.2f} ± {law.level_sigma:.2f} + ({law.gain_along:.1f} ± {sigma[0]:.1f}) sin(along) "
            f"+ ({law.gain_across:.1f} ± {sigma[1]:.1f}) |sin(across)|",
            markup=False,
        )
        _print_curve(console, curve)
    if score is not None:
        _print_score(console, score)
    now = summary["now"]
    low, high = now["quantile"][0], now["quantile"][-1]
    console.print(
        f"at {now['distance']:.1f} m: next metre's slip {now['mean']:.2f} ({low:.2f} to {high:.2f}); above {summary['limit']:g} "
        f"within 2 m with probability {now['exceed']:.3f}" + (": WARNING" if now["warning"] else ""),
        markup=False,
    )


def _print_curve(console: Console, curve: SoilFit) -> None:
    """Print slip by slope, for the whole drive and for the soil at its end."""
    table = Table(box=box.SIMPLE, padding=(0, 1), pad_edge=False)
    for head in ("slope", "uphill", "across", "uphill, soil at the end"):
        table.add_column(head, justify="right", no_wrap=True)
    for degrees in (0, 5, 10, 15, 20, 25):
        sine = np.sin(np.radians(degrees))
        bands = curve.slip(sine), curve.slip(0.0, sine), curve.slip(sine, last=True)
        table.add_row(f"{degrees}°", *(f"{m:.2f} ({a:.2f} to {b:.2f})" for a, m, b in bands))
    console.print(table)


def _print_score(console: Console, score: xr.Dataset) -> None:
    """Print errors of the forecasts, and warnings."""
    table = Table(box=box.SIMPLE, padding=(0, 0), pad_edge=False)
    for head in ("error (RMS) of", *HEADS, "in band"):
        table.add_column(head, justify="left" if head.startswith("error") else "right", no_wrap=True)
    for target in score["target"].to_numpy():
        one = score.sel(target=target)
        if int(one["count"]):
            table.add_row(
                str(target).removeprefix("log over the "),
                *(f"{v:.3f}" for v in one["rmse"].to_numpy()),
                f"{100 * float(one['coverage']):.0f} %",
            )
    console.print(table)
    about = score.attrs
    text = f"{about['warnings']} warnings, of which {about['false_warnings']} false"
    if np.isfinite(about["passes_limit"]):
        text += f"; the limit is passed at {about['passes_limit']:.1f} m, warned {about['lead']:.1f} m before"
    console.print(text, markup=False)
