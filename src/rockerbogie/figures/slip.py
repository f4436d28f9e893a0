"""Charts of slip along a drive: measurements, forecast, warnings and the fitted slip curve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .style import INK, LEFT, RIGHT, figure, look

if TYPE_CHECKING:
    import xarray as xr

    from ..logs.slip_fit import SoilFit

BAND = "#B7D3E6"


def slip_figure(log: xr.Dataset, forecast: xr.Dataset, fit: SoilFit | None = None) -> Figure:
    """Draw slip along a drive with its forecast and warnings, and slip against slope.

    Args:
        log: from `read_slip_log`.
        forecast: from `forecast_slip`.
        fit: from `fit_soil`; None for a log without attitude.

    Returns:
        The figure.
    """
    with look():
        fig = figure(10.0, 8.6 if fit is not None else 5.6)
        axes = fig.subplots(3 if fit is not None else 2, 1, height_ratios=(1.6, 0.8, 1.3)[: 3 if fit is not None else 2])
        _along(axes[0], log, forecast)
        _risk(axes[1], forecast)
        axes[1].sharex(axes[0])
        if fit is not None:
            _curve(axes[2], fit)
        fig.suptitle(f"{forecast.attrs['log']}: slip, forecast from past telemetry only", x=0.01, ha="left")
    return fig


def _along(axes: Axes, log: xr.Dataset, forecast: xr.Dataset) -> None:
    """Draw measured slip, and the forecast 1 m before shifted to the travel that it is for."""
    at = forecast["distance"].to_numpy() + forecast.attrs["ahead"]
    quantile = forecast["quantile"].to_numpy()
    level = 100 * float(forecast["probability"][-1] - forecast["probability"][0])
    axes.fill_between(at, quantile[:, 0], quantile[:, -1], color=BAND, lw=0, label=f"{level:.0f} % band, forecast 1 m before")
    axes.plot(at, forecast["mean"], color=INK, lw=1.0, label="mean")
    known = np.isfinite(log["slip"].to_numpy())
    travel, slip = (log[name].to_numpy()[known] for name in ("distance", "slip"))
    direct = log["from_position"].to_numpy()[known]
    axes.scatter(travel[~direct], slip[~direct], s=18, color=LEFT, zorder=3, label="slip in the log")
    if direct.any():
        axes.scatter(travel[direct], slip[direct], s=26, marker="D", color=RIGHT, zorder=3, label="slip by corrected positions")
    axes.axhline(forecast.attrs["limit"], color=RIGHT, lw=0.8, ls="--")
    axes.set(ylabel="slip", ylim=(min(0.0, slip.min() - 0.05), 1.0))
    axes.legend(loc="upper left", ncols=2)


def _risk(axes: Axes, forecast: xr.Dataset) -> None:
    """Draw the probability of exceeding the limit within 2 m, and the warnings."""
    at, limit, threshold = forecast["distance"].to_numpy(), forecast.attrs["limit"], forecast.attrs["threshold"]
    axes.fill_between(at, 0, 1, where=forecast["warning"].to_numpy(), color="#F6D5C3", lw=0, step="post", label="warning")
    axes.step(at, np.maximum(forecast["exceed"], 1e-4), where="post", color=RIGHT, lw=1.2)
    axes.axhline(threshold, color=INK, lw=0.8, ls="--")
    axes.set(yscale="log", ylim=(1e-4, 1.0), xlabel="wheel travel (m)", ylabel=f"P(slip > {limit:g}\nwithin 2 m)")
    axes.legend(loc="upper left")


def _curve(axes: Axes, fit: SoilFit) -> None:
    """Draw slip against the slope's angle, straight uphill and across, with the measurements."""
    slope = np.radians(np.linspace(0.0, 30.0, 121))
    for along, across, colour, name in ((1.0, 0.0, LEFT, "uphill"), (0.0, 1.0, "#009E73", "across")):
        low, median, high = np.moveaxis(fit.slip(along * np.sin(slope), across * np.sin(slope)), -1, 0)
        axes.fill_between(np.degrees(slope), low, high, color=colour, alpha=0.15, lw=0)
        axes.plot(np.degrees(slope), median, color=colour, label=f"fitted, {name}, with its 80 % band")
    data = fit.data
    tilt = np.degrees(np.arcsin(np.clip(np.hypot(data["along"], data["across"]), 0, 1)))
    dots = axes.scatter(tilt, data["slip"], s=18, c=data["distance"], cmap="viridis", zorder=3, label="measured")
    axes.figure.colorbar(dots, ax=axes, label="wheel travel (m)")
    axes.set(xlabel="slope (deg)", ylabel="slip", ylim=(0.0, 1.0), title="Slip and slope")
    axes.legend(loc="upper left")
