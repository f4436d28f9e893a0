"""Charts of predicted against logged attitude: scatter with bands, and place by place."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from .style import INK, LEFT, RIGHT, figure, look

if TYPE_CHECKING:
    import xarray as xr

#: Greatest number of places whose names fit under an axis, and of those outside their band that are named in a scatter.
MOST_TICKS, MOST_NAMED = 40, 8
POSITIVE = {"pitch": "nose down", "roll": "left side up"}
BAND, INSIDE, OUTSIDE = "#B7D3E6", LEFT, RIGHT


def validation_figure(found: xr.Dataset) -> Figure:
    """Draw the result of `validate`, one row of charts per channel.

    Args:
        found: from `validate`; of rows at one place the first is drawn.

    Returns:
        The figure.
    """
    band = "low" in found
    first = np.unique(found["stand"].to_numpy(), return_index=True)[1] if band else np.arange(found.sizes["row"])
    places = found.isel(row=first)
    with look():
        fig = figure(11.0, 8.6)
        axes = fig.subplots(2, 2, width_ratios=(1.0, 1.35))
        for (scatter, along), channel in zip(axes, found["channel"].to_numpy(), strict=True):
            _scatter(scatter, places.sel(channel=channel), str(channel), band)
            _along(along, places.sel(channel=channel), str(channel), band)
        title = f"{found.attrs['rover'].capitalize()} on {found.attrs['terrain']}: attitude predicted and logged"
        fig.suptitle(title, x=0.01, ha="left")
        fig.legend(handles=_legend(found, band), loc="outside lower center", ncols=4)
    return fig


def _legend(found: xr.Dataset, band: bool) -> list[Any]:
    """Return the entries of the legend."""
    if not band:
        return [_dot(INSIDE, "logged"), Line2D([], [], color=INK, lw=1.0, label="predicted")]
    level = f"{100 * found.attrs['level']:.0f} %"
    return [
        _dot(INSIDE, "logged, within the band"),
        _dot(OUTSIDE, "logged, outside"),
        Line2D([], [], color=INK, lw=1.0, label="predicted"),
        Patch(color=BAND, label=f"{level} band, fitted on other places"),
    ]


def _dot(colour: str, label: str) -> Line2D:
    """Return a dot of a colour for the legend."""
    return Line2D([], [], color=colour, marker="o", ls="", ms=5, label=label)


def _colours(places: xr.Dataset, band: bool) -> list[str]:
    """Return the colour of each place: inside or outside its band."""
    return [INSIDE if good else OUTSIDE for good in places["inside"].to_numpy()] if band else [INSIDE] * places.sizes["row"]


def _scatter(axes: Axes, places: xr.Dataset, channel: str, band: bool) -> None:
    """Draw predicted against logged angles."""
    predicted, logged = np.degrees(places["predicted"].to_numpy()), np.degrees(places["logged"].to_numpy())
    known = np.isfinite(predicted)
    everything = [predicted[known], logged[known]]
    if band:
        low, high = np.degrees(places["low"].to_numpy()), np.degrees(places["high"].to_numpy())
        axes.vlines(predicted, low, high, color=BAND, lw=4.0, zorder=1)
        everything += [low[np.isfinite(low)], high[np.isfinite(high)]]
    together = np.concatenate(everything)
    margin = 0.04 * (together.max() - together.min()) + 0.5
    span = (together.min() - margin, together.max() + margin)
    axes.plot(span, span, color=INK, lw=1.0, zorder=2)
    axes.scatter(predicted, logged, s=22, c=_colours(places, band), zorder=3)
    _name_worst(axes, places, predicted, logged, span, band)
    rms, median = (np.degrees(float(places[name])) for name in ("rms", "median_absolute_error"))
    axes.set(xlim=span, ylim=span, xlabel=f"predicted {channel} (deg)", ylabel=f"logged {channel} (deg)")
    axes.set_title(f"{channel.capitalize()}: RMS {rms:.2f}°, median error {median:.2f}°, r = {float(places['correlation']):.2f}")
    axes.set_aspect("equal")
    axes.set_axisbelow(True)


def _name_worst(axes: Axes, places: xr.Dataset, predicted: Any, logged: Any, span: tuple[float, float], band: bool) -> None:
    """Label the places outside their band, worst first; without a band the worst three."""
    apart = np.where(np.isfinite(predicted), np.abs(logged - predicted), -np.inf)
    wanted = apart >= 0 if not band else (apart >= 0) & ~places["inside"].to_numpy()
    placed: list[tuple[float, float]] = []
    for k in np.argsort(-apart):
        at = (float(predicted[k]), float(logged[k]))
        if not wanted[k] or len(placed) == (MOST_NAMED if band else 3):
            continue
        if any(abs(at[0] - x) < 0.2 * (span[1] - span[0]) and abs(at[1] - y) < 0.05 * (span[1] - span[0]) for x, y in placed):
            continue
        placed.append(at)
        below = at[1] < at[0]  # away from the line
        axes.annotate(
            str(places["place"].to_numpy()[k]), at, xytext=(5 if below else -5, -5 if below else 5), textcoords="offset points",
            ha="left" if below else "right", va="top" if below else "bottom", fontsize=8, color=OUTSIDE if band else INK,
        )  # fmt: skip


def _along(axes: Axes, places: xr.Dataset, channel: str, band: bool) -> None:
    """Draw predicted and logged angles place by place."""
    number = np.arange(places.sizes["row"])
    predicted, logged = np.degrees(places["predicted"].to_numpy()), np.degrees(places["logged"].to_numpy())
    everything = [predicted, logged]
    if band:
        low, high = np.degrees(places["low"].to_numpy()), np.degrees(places["high"].to_numpy())
        axes.bar(number, high - low, 0.8, low, color=BAND, zorder=1)
        everything += [low, high]
    margin = 0.04 * (np.nanmax(everything) - np.nanmin(everything)) + 0.5
    axes.set_ylim(np.nanmin(everything) - margin, np.nanmax(everything) + margin)
    axes.set_axisbelow(True)
    axes.hlines(predicted, number - 0.4, number + 0.4, color=INK, lw=1.2, zorder=2)
    axes.scatter(number, logged, s=22, c=_colours(places, band), zorder=3)
    every = -(-len(number) // MOST_TICKS)
    labels = [str(label) for label in places["place"].to_numpy()]
    axes.set_xticks(number[::every], labels[::every], rotation=90, fontsize=8)
    axes.grid(visible=False, axis="x")
    name = str(places.attrs.get("place_is", "row"))
    axes.set(xlabel=f"place, by {name}", ylabel=f"{channel}, {POSITIVE[channel]} positive (deg)", title="Place by place")
    if band:
        axes.set_title(f"Place by place: {100 * float(places['coverage']):.0f} % inside the band")
