"""Figure and page of the benchmark on flown attitudes."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..files.outputs import SOURCE
from ..logs.benchmark import ENTERED, PACKAGE, PLANE, SETS, MarsBenchmark
from .style import INK, LEFT, RIGHT, figure, look

if TYPE_CHECKING:
    import xarray as xr

BAND = "#B7D3E6"
TITLES = {about.name: about.title for about in SETS} | {"all": "All cases"}
MARKS = {PLANE: ("^", "#777777", "plane through six wheels"), ENTERED: ("D", "#CC79A7", "entered")}


def benchmark_figure(result: MarsBenchmark) -> Figure:
    """Draw logged and predicted attitudes, one row of charts per set.

    Args:
        result: from `benchmark_mars`.

    Returns:
        The figure.
    """
    sets = [name for name in result.scores["set"].to_numpy() if name != "all"]
    channels = result.cases["channel"].to_numpy()
    with look():
        fig = figure(11.0, 3.0 * len(sets) + 0.9)
        axes = fig.subplots(len(sets), len(channels), squeeze=False)
        for row, name in zip(axes, sets, strict=True):
            cases = result.cases.isel(case=np.flatnonzero(result.cases["set"].to_numpy() == name))
            for one, channel in zip(row, channels, strict=True):
                _panel(one, cases.sel(channel=channel), f"{TITLES[name]}: {channel}", str(channel))
        handles, labels = axes[0, 0].get_legend_handles_labels()
        fig.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return fig


def _panel(axes: Axes, cases: xr.Dataset, title: str, channel: str) -> None:
    """Draw one set and channel, case by case, degrees."""
    number = np.arange(cases.sizes["case"])
    axes.use_sticky_edges = False
    logged = np.degrees(cases["logged"].to_numpy())
    for contender in cases["contender"].to_numpy():
        values = cases.sel(contender=contender)
        predicted, low, high = (np.degrees(values[key].to_numpy()) for key in ("predicted", "low", "high"))
        if contender == PACKAGE:
            axes.bar(number, high - low, 0.85, low, color=BAND, zorder=1, label="80 % band of rockerbogie")
            axes.hlines(predicted, number - 0.43, number + 0.43, color=INK, lw=1.2, zorder=3, label="rockerbogie")
            outside = (logged < low) | (logged > high)
            continue
        mark, colour, label = MARKS[str(contender)]
        axes.scatter(number, predicted, s=16, marker=mark, facecolors="none", edgecolors=colour, lw=0.9, zorder=3, label=label)
        if np.isfinite(low).any():
            axes.vlines(number, low, high, color=colour, lw=1.0, zorder=2)
    axes.scatter(number, logged, s=16, c=np.where(outside, RIGHT, LEFT), zorder=4, label="logged (red: outside the band)")
    labels = [str(label) for label in cases["place"].to_numpy()]
    axes.set_xticks(number, labels, rotation=90, fontsize=6.5)
    axes.grid(visible=False, axis="x")
    axes.set_axisbelow(True)
    axes.set(title=title, ylabel=f"{channel} (deg)")


def score_rows(result: MarsBenchmark) -> list[dict[str, str]]:
    """Return the table of scores as text, degrees, one row per set and contender.

    Args:
        result: from `benchmark_mars`.

    Returns:
        Rows of column -> text; pairs are pitch / roll.
    """
    rows = []
    for name in result.scores["set"].to_numpy():
        total = int((result.cases["set"].to_numpy() == name).sum()) if name != "all" else result.cases.sizes["case"]
        for contender in result.contenders:
            s = result.scores.sel(set=name, contender=contender)

            def pair(key: str, s: xr.Dataset = s, digits: int = 2, scale: float = np.degrees(1.0)) -> str:
                values = scale * s[key].to_numpy()
                if not np.isfinite(values).any():
                    return "–"
                return " / ".join(f"{v:.{digits}f}" if np.isfinite(v) else "–" for v in values)

            rows.append(
                {
                    "set": TITLES[str(name)], "by": contender, "cases": f"{int(s['count'])} of {total}", "RMS": pair("rms"),
                    "of rockerbogie there": pair("rms_package"), "bias": pair("bias"),
                    "median error": pair("median_absolute_error"), "correlation": pair("correlation", scale=1.0),
                    "in 80 % band": pair("coverage", digits=0, scale=100.0), "interval score": pair("interval_score"),
                }
            )  # fmt: skip
    return rows


def write_page(file: Path, picture: Path, result: MarsBenchmark) -> Path:
    """Write the benchmark as one self-contained HTML page.

    Args:
        file: the page; replaced if it exists.
        picture: PNG of `benchmark_figure`, embedded.
        result: from `benchmark_mars`.

    Returns:
        The page.
    """
    rows = score_rows(result)
    head = "".join(f"<th>{escape(key)}</th>" for key in rows[0])
    body = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row.values()) + "</tr>" for row in rows)
    absent = "".join(f"<li>{escape(TITLES[name])}: {escape(reason)}</li>" for name, reason in result.absent.items())
    image = base64.b64encode(picture.read_bytes()).decode("ascii")
    parts = [
        f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="generator" content="{SOURCE}">',
        "<title>Attitudes flown on Mars</title><style>body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:1rem auto;",
        "padding:0 1rem;color:#222}table{border-collapse:collapse;font-variant-numeric:tabular-nums}td,th{padding:.25rem .7rem;",
        "text-align:left;border-bottom:1px solid #ddd}img{max-width:100%}</style>",
        "<h1>Attitudes flown on Mars</h1>",
        "<p>Predicted pitch and roll (pitch / roll, degrees; nose down and left side up positive) against the rovers' own logs. "
        "Bilinear terrain, published dimensions, nothing tuned on the cases of a band. Rows of a drive at one position count "
        "once. The interval score is the width of the 80 % band plus ten times the distance of a value outside it.</p>",
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>",
        f"<h2>Not scored</h2><ul>{absent}</ul>" if absent else "",
        f'<h2>Case by case</h2><img alt="logged and predicted attitude" src="data:image/png;base64,{image}">',
        f"<p>{SOURCE}; {result.cases.attrs['draws']} draws per band, seed {result.cases.attrs['seed']}.</p></html>",
    ]
    file.write_text("\n".join(parts), encoding="utf-8")
    return file
