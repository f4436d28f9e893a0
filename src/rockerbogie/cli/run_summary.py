"""Summary of a run for the commands drive and simulate, as a table and in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..rover.model import Rover
from ..settling.status import MEANING, Status

if TYPE_CHECKING:
    import xarray as xr

#: Variables of a drive with loads that the summary shows, with their units there.
LOADS = {"required_friction": "", "max_torque": " N·m", "tip_margin": "°"}
#: Attributes of a simulated run about its hub motors.
MOTORS = ("wheel_rate_error_share", "torque_limit", "torque_limited")
#: Wheels hold their rates up to this error, as a share of the largest command; they slip above this mean slip ratio.
HELD, SLIPPED = 0.1, 0.1


def tracking(motors: dict[str, float]) -> str:
    """Return a sentence on how well the hub motors kept their commanded rates.

    Args:
        motors: the attributes MOTORS of a simulated run.

    Returns:
        One line.
    """
    error = motors["wheel_rate_error_share"]
    text = "no rate error (run shorter than 2 s)" if np.isnan(error) else f"worst rate error {100 * error:.2g} % over 1 s"
    limit, limited = motors["torque_limit"], 100 * motors["torque_limited"]
    return f"hub motors: {text}; at the torque limit of {limit:.3g} N·m in {limited:.2g} % of the records"


def why_short(sim: xr.Dataset) -> str:
    """Return why a simulated rover did not reach the end of its path.

    Args:
        sim: run of `simulate`.

    Returns:
        End of a sentence: the cause and what to change; without a known cause, where to look.
    """
    last = Status(int(sim["status"][-1]))
    if last in (Status.TIPPED, Status.OFF_MAP, Status.NO_DATA):
        why, remedy = MEANING[last] if last != Status.TIPPED else ("it tipped over", "take another path")
        return f"after {float(sim['time'][-1]):.1f} s, {why}; {remedy}"
    error, limited = float(sim.attrs["wheel_rate_error_share"]), float(sim.attrs["torque_limited"])
    slip = float(np.nanmean(np.abs(sim["slip_ratio"].to_numpy()[sim.sizes["time"] // 2 :])))
    if error > HELD and limited > 0:
        return (
            f"its motors were at their limit of {sim.attrs['torque_limit']:.3g} N·m in {100 * limited:.2g} % of the records "
            f"and missed their commanded rate by up to {100 * error:.2g} %; give a higher --torque or another path"
        )
    if slip > SLIPPED:
        return (
            f"its wheels held their rates but slipped (mean slip ratio {slip:.2f} in the second half) on friction "
            f"{sim.attrs['friction']:g}; try more friction or another path"
        )
    return "its wheels held their rates and did not slip much; see its track in map.png of -o"


def summarise(run: xr.Dataset) -> dict[str, Any]:
    """Return length, stations by status, and extremes of each channel of a run.

    Args:
        run: of `drive` or `simulate`.

    Returns:
        Values for JSON, SI and rad.
    """
    from ..figures.charts import tilt_of

    status = run["status"].values
    channels = {name: run[name].values for name in ("roll", "pitch", "rocker", "clearance")} | {
        "tilt": tilt_of(run).values,
        **{name: run[name].values for name in LOADS if name in run},
        "bogie_left": run["bogie"].sel(side="left").values,
        "bogie_right": run["bogie"].sel(side="right").values,
    }
    distance = run["distance"].values
    extremes = {}
    for name in ("tilt", "roll", "pitch", "rocker", "bogie_left", "bogie_right", "clearance", *LOADS):
        if name not in channels or np.isnan(channels[name]).all():
            continue  # the clearance is NaN if the body reaches over the edge of the map
        low, high = int(np.nanargmin(channels[name])), int(np.nanargmax(channels[name]))
        extremes[name] = {
            "min": float(channels[name][low]), "min_at": float(distance[low]),
            "max": float(channels[name][high]), "max_at": float(distance[high]),
        }  # fmt: skip
    return {
        "rover": run.attrs["rover"],
        "terrain": run.attrs["terrain"],
        "path": run.attrs["path"],
        "length": float(distance[-1]),
        "stations": int(status.size),
        "status": {code.name: int((status == code).sum()) for code in Status if (status == code).any()},
        "extremes": extremes,
    }


def print_summary(rover: Rover, summary: dict[str, Any]) -> None:
    """Print a run's summary as a table.

    Args:
        rover: gives the joint limits.
        summary: of `summarise`.
    """
    console = Console(highlight=False)
    console.print(f"[bold]{escape(summary['rover'])}[/] on [bold]{escape(summary['terrain'])}[/]: {summary['path']}")
    settled = summary["status"].get(Status.CONVERGED.name, 0)
    others = [f"{count} {name}" for name, count in summary["status"].items() if name != Status.CONVERGED.name]
    console.print(
        f"{summary['length']:.2f} m, {settled} of {summary['stations']} stations settled" + "".join(f", {o}" for o in others)
    )
    table = Table(box=box.SIMPLE, padding=(0, 1))
    for head in ("", "least", "at", "greatest", "at", "limits"):
        table.add_column(head, justify="left" if head in ("", "limits") else "right")
    stops = {
        name: ", ".join(f"{limit:+.3g}°" for limit in np.degrees(limits))
        for name, limits in (
            ("rocker", rover.rocker_limits),
            ("bogie_left", rover.bogie_limits),
            ("bogie_right", rover.bogie_limits),
        )
        if np.isfinite(limits).any()
    }
    for name, found in summary["extremes"].items():
        low, high = (_value(name, found[k]) for k in ("min", "max"))
        table.add_row(
            name.replace("_", " "), low, f"{found['min_at']:.2f} m", high, f"{found['max_at']:.2f} m", stops.get(name, "")
        )
    console.print(table)


def _value(name: str, value: float) -> str:
    """Return a channel's value with its unit."""
    if name == "clearance":
        return f"{value:.3f} m"
    if name in ("required_friction", "max_torque"):
        return f"{value:.3f}{LOADS[name]}"
    return f"{np.degrees(value):.2f}°"
