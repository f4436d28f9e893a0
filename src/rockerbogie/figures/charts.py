"""Charts of a run: the map that it crossed, and its angles along the path."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from numpy.typing import NDArray

from ..rover.model import Rover
from ..settling.status import MEANING, Status
from ..terrain.heightfield import Terrain
from .style import COLOURS, INK, LEFT, RIGHT, figure, look

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Bounds = tuple[float, float, float, float]

#: Limit of tilt for runs without limits of their own, rad.
USUAL_TILT = np.radians(30.0)
#: Relief below this share of a map's width counts as flat.
FLAT = 2e-4
#: Characters of a line of a legend over the width of a page.
LINE = 118
#: Legends above a chart, with entries close together.
CLOSE: dict[str, Any] = {"columnspacing": 1.1, "handlelength": 1.6, "handletextpad": 0.5}
HALO = [withStroke(linewidth=3, foreground="white")]
_MAP_PIXELS = 700
_STATUS_COLOURS = {
    Status.CONVERGED: "#d9d9d9",
    Status.OFF_MAP: "#000000",
    Status.NO_DATA: "#56B4E9",
    Status.JOINT_STOP: "#E69F00",
    Status.NOT_CONVERGED: "#D55E00",
    Status.WHEEL_LIFTED: "#F0E442",
    Status.BELLY_CONTACT: "#CC79A7",
    Status.TIPPED: "#0072B2",
}


class Worst(NamedTuple):
    """The station of a run that is closest to a limit, or furthest beyond one."""

    station: int  # index along time
    reason: str  # the value, its limit, the distance along the path


def tilt_of(run: xr.Dataset) -> xr.DataArray:
    """Return the angle between the body's z axis and the vertical, rad.

    Args:
        run: with `roll` and `pitch`, rad.

    Returns:
        Tilt, rad, 0 to π.
    """
    upright: xr.DataArray = np.cos(run["roll"]) * np.cos(run["pitch"])  # type: ignore[assignment]
    tilt: xr.DataArray = np.arccos(upright.clip(-1, 1))  # type: ignore[assignment]
    return tilt


def steepest_of(run: xr.Dataset) -> int | None:
    """Return the index of the station with the greatest tilt, or None if no station has a pose.

    Args:
        run: from `drive` or `simulate`.

    Returns:
        Index along time, or None.
    """
    tilt = tilt_of(run).values
    return int(np.nanargmax(tilt)) if np.isfinite(tilt).any() else None


def worst_of(rover: Rover, run: xr.Dataset) -> Worst | None:
    """Return the station closest to a limit, or furthest beyond one; None if there is no pose.

    The measure is a share of a limit: each joint's of its joint limit, the tilt's of 30°. The clearance c of the body counts as
    1 / (1 + c / wheel radius), which is 1 at c = 0.

    Args:
        rover: the rover that drove.
        run: from `drive` or `simulate`.

    Returns:
        The station and the reason, or None.
    """
    tilt, clearance, radius = tilt_of(run).values, run["clearance"].values, float(rover.wheel_radius.max())
    if not np.isfinite(tilt).any():
        return None
    joints = [("rocker", run["rocker"].values, rover.rocker_limits)]
    joints += [(f"{side} bogie", run["bogie"].sel(side=side).values, rover.bogie_limits) for side in ("left", "right")]
    found: list[tuple[float, int, str]] = []
    for name, angle, (low, high) in joints:
        with np.errstate(divide="ignore", invalid="ignore"):  # a limit of 0
            share = np.nan_to_num(np.where(angle >= 0, angle / high, angle / low))  # 0 for a joint without limits
        k = int(np.argmax(share))
        if share[k] > 0:
            limit = high if angle[k] >= 0 else low
            word = "beyond" if share[k] > 1 else "of"
            found.append((float(share[k]), k, f"{name} {np.degrees(angle[k]):.1f}° {word} its limit {np.degrees(limit):.3g}°"))
    k = int(np.nanargmax(tilt))
    found.append((float(tilt[k] / USUAL_TILT), k, f"tilt {np.degrees(tilt[k]):.1f}°"))
    if np.isfinite(clearance).any():
        k = int(np.nanargmin(clearance))
        found.append((1 / (1 + max(clearance[k], -0.99 * radius) / radius), k, f"clearance {clearance[k]:.3f} m"))
    _, index, what = max(found, key=lambda item: item[0])
    return Worst(index, f"{what}, {float(run['distance'][index]):.4g} m along the path")


def run_map(rover: Rover, terrain: Terrain, run: xr.Dataset) -> Figure:
    """Draw the path on the terrain from above, coloured by tilt, and a small overview map.

    Args:
        rover: the rover that drove.
        terrain: the terrain it drove on.
        run: from `drive`, `simulate` or `predict`.

    Returns:
        The figure.
    """
    x, y, tilt = run["x"].values, run["y"].values, np.degrees(tilt_of(run).values)
    bounds = _around(x, y, terrain.bounds, 3 * rover.wheelbase)
    wide, high = bounds[2] - bounds[0], bounds[3] - bounds[1]
    left, across, right, below, above = 1.1, 5.9, 2.25, 0.6, 0.45  # inches
    up = across * high / wide
    page = (left + across + right, below + max(up, 3.2) + above)
    with look():
        fig = figure(*page)
        fig.set_layout_engine("none")

        def axes(x: float, y: float, width: float, height: float) -> Axes:
            return fig.add_axes((x / page[0], y / page[1], width / page[0], height / page[1]))

        ax = axes(left, below, across, up)
        _hillshade(ax, terrain, bounds, contours=True)
        points = np.stack([x, y], axis=1)
        pieces = np.stack([points[:-1], points[1:]], axis=1)
        middle = np.fmax(tilt[:-1], tilt[1:])
        scale = Normalize(0, max(5.0, float(np.nanmax(middle, initial=0.0))))
        ax.plot(x, y, color="white", lw=5.0, solid_capstyle="round", zorder=3)
        good = np.isfinite(middle)
        ax.add_collection(
            LineCollection(list(pieces[good]), array=middle[good], cmap="plasma", norm=scale, lw=3.2, capstyle="round", zorder=4)
        )
        bad = ~np.isfinite(tilt)
        if bad.any():
            ax.plot(x[bad], y[bad], "x", color="#b00000", ms=5, zorder=5, label=f"no pose found ({bad.sum()})")
        ax.plot(x[0], y[0], "o", mfc="white", mec=INK, ms=8, zorder=6, clip_on=False, label="start")
        ax.plot(x[-1], y[-1], "s", mfc="white", mec=INK, ms=8, zorder=6, clip_on=False, label="end")
        steepest = steepest_of(run)
        if steepest is not None:
            label = f"steepest: {tilt[steepest]:.1f}° at {float(run['distance'][steepest]):.4g} m"
            ax.plot(x[steepest], y[steepest], "*", mfc="#F0E442", mec=INK, ms=15, zorder=7, label=label)
        scale_bar(ax, bounds)
        east, north = ("easting (m)", "northing (m)") if terrain.crs else ("x (m)", "y (m)")
        plain_metres(ax, east, north)
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, handletextpad=0.4)

        size = np.array([terrain.bounds[2] - terrain.bounds[0], terrain.bounds[3] - terrain.bounds[1]])
        inset = 1.6 * size / size.max()
        small = axes(left + across + 0.35, page[1] - above - inset[1], *inset)
        _hillshade(small, terrain, terrain.bounds, contours=False)
        small.plot(x, y, color="#b00000", lw=1.2)
        small.add_patch(Rectangle(bounds[:2], wide, high, fill=False, ec=INK, lw=1))
        small.set_xticks([])
        small.set_yticks([])
        small.set_title(terrain.name, fontsize=8, fontweight="normal")
        small.set_xlabel(f"{size[0]:.4g} m × {size[1]:.4g} m", fontsize=8)
        bar = axes(left + across + 0.35, below, 0.18, min(2.6, page[1] - above - below - inset[1] - 0.55))
        fig.colorbar(ScalarMappable(scale, "plasma"), cax=bar, label="tilt (deg)")
        bar.grid(False)
    return fig


def run_profile(rover: Rover, terrain: Terrain, run: xr.Dataset) -> Figure:
    """Draw terrain, attitude, joints, clearance and status over the distance driven.

    Args:
        rover: the rover that drove.
        terrain: the terrain it drove on.
        run: from `drive`, `simulate` or `predict`.

    Returns:
        The figure.
    """
    s = run["distance"].values
    with look():
        fig = figure(9.0, 9.0)
        axes = fig.subplots(5, 1, sharex=True, height_ratios=(1, 1.25, 1.25, 0.8, 0.14))
        ground, attitude, joints, belly, strip = axes
        z = terrain.height(run["x"].values, run["y"].values)
        ground.fill_between(s, z, np.nanmin(z), color="#d9b48f", lw=0, label="terrain below the reference point")
        ground.plot(s, run["z"], color=COLOURS["z"], label="reference point z")
        ground.set_ylabel("height (m)")
        _at_least(ground, 0.1)
        for name in ("roll", "pitch"):
            attitude.plot(s, np.degrees(run[name]), color=COLOURS[name], label=name)
        attitude.plot(s, np.degrees(tilt_of(run)), color=COLOURS["tilt"], lw=1.0, ls=(0, (1, 1)), label="tilt")
        attitude.set_ylabel("attitude (deg)")
        _at_least(attitude, 4.0)
        joints.plot(s, np.degrees(run["rocker"]), color=COLOURS["rocker"], label="rocker ρ")
        for side, colour in (("left", LEFT), ("right", RIGHT)):
            joints.plot(s, np.degrees(run["bogie"].sel(side=side)), color=colour, label=f"{side} bogie β")
        _stops(joints, rover.rocker_limits, COLOURS["rocker"], "rocker limits")
        _stops(joints, rover.bogie_limits, "#8a6d3b", "bogie limits")
        joints.set_ylabel("joints (deg)")
        _at_least(joints, 4.0)
        belly.plot(s, run["clearance"], color="#009E73", label="least height of the body above the terrain")
        belly.axhline(0, color="#b00000", lw=1)
        belly.set_ylabel("clearance (m)")
        _status_strip(strip, s, run["status"].values)
        worst = worst_of(rover, run)
        for ax in (ground, attitude, joints, belly):
            if worst is not None:
                ax.axvline(s[worst.station], color=INK, lw=0.9, ls=(0, (4, 3)))
            ax.legend(loc="lower left", bbox_to_anchor=(0, 0.98), ncols=5, fontsize=8.5, borderaxespad=0.1, **CLOSE)
            ax.tick_params(labelbottom=False)
        if worst is not None:
            right = s[worst.station] > (s[0] + s[-1]) / 2  # the text goes to the side with more room
            ground.annotate(
                f"worst: {worst.reason.rsplit(', ', 1)[0]}", (s[worst.station], 0.92), xycoords=("data", "axes fraction"),
                xytext=(-4 if right else 4, 0), textcoords="offset points", fontsize=8.5, ha="right" if right else "left",
                path_effects=HALO,
            )  # fmt: skip
        strip.set_xlim(s[0], s[-1])
        fig.align_ylabels(axes[:4])
    return fig


def _stops(ax: Axes, limits: Array, colour: str, label: str) -> None:
    """Draw the finite joint limits as horizontal lines with a label."""
    known = np.degrees(limits[np.isfinite(limits)])
    if known.size:
        name = f"{label} {', '.join(f'{limit:+.3g}°' for limit in known)}"
        ax.hlines(known, 0, 1, transform=ax.get_yaxis_transform(), color=colour, lw=1, ls=(0, (6, 2)), label=name)


def _status_strip(ax: Axes, s: Array, status: Array) -> None:
    """Draw the status of each station as colours along the path, with their meanings."""
    edges = np.concatenate([s[:1], (s[1:] + s[:-1]) / 2, s[-1:]])
    codes = [Status(int(code)) for code in np.unique(status)]
    for code in codes:
        for k in np.flatnonzero(status == code):
            ax.axvspan(edges[k], edges[k + 1], color=_STATUS_COLOURS[code], lw=0)
    ax.set_yticks([])
    ax.grid(False)
    ax.set_xlabel("distance along the path (m)")
    share = {code: f"{100 * (status == code).mean():.3g} %" for code in codes}
    texts = {code: fill(f"{code.name} ({share[code]}): {MEANING[code][0]}", LINE) for code in codes}
    labels = [Patch(color=_STATUS_COLOURS[code], label=texts[code]) for code in codes]
    ax.legend(handles=labels, loc="upper left", bbox_to_anchor=(0, -2.6), fontsize=8, borderaxespad=0)


def _at_least(ax: Axes, span: float) -> None:
    """Widen the vertical axis to at least a span, so that rounding errors do not fill it."""
    low, high = ax.get_ylim()
    if high - low < span:
        middle = (low + high) / 2
        ax.set_ylim(middle - span / 2, middle + span / 2)


def _around(x: Array, y: Array, whole: Bounds, room: float) -> Bounds:
    """Return a window around the path, within the map and not too long for its width, m."""
    low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
    middle, half = (low + high) / 2, (high - low) / 2
    half = np.maximum(half + np.maximum(room, 0.15 * half.max()), 0.55 * half.max())
    least, most = np.array(whole[:2]), np.array(whole[2:])
    start, end = np.maximum(middle - half, least), np.minimum(middle + half, most)
    return float(start[0]), float(start[1]), float(end[0]), float(end[1])


def _hillshade(ax: Axes, terrain: Terrain, bounds: Bounds, *, contours: bool) -> None:
    """Draw shaded terrain, with contours if asked for."""
    from scipy.ndimage import gaussian_filter

    span = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    step = max(span / _MAP_PIXELS, min(terrain.spacing) / 4)
    x = np.arange(bounds[0], bounds[2], step)
    y = np.arange(bounds[1], bounds[3], step)
    z = terrain.height(*np.meshgrid(x, y))
    filled = np.nan_to_num(z, nan=float(np.nanmedian(z)))
    shade = LightSource(315, 45).hillshade(filled, dx=step, dy=-step)
    colours = 0.42 + 0.5 * np.repeat(shade[..., None], 3, axis=-1)
    colours[np.isnan(z)] = (0.75, 0.85, 0.95)
    ax.imshow(colours, extent=(x[0], x[-1], y[0], y[-1]), origin="lower", interpolation="bilinear")
    ax.grid(False)
    ax.set_aspect("equal")
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])
    if contours:
        smooth = gaussian_filter(filled, 0.008 * span / step)  # contours of the terrain, not of single stones
        smooth[np.isnan(z)] = np.nan
        _contours(ax, x, y, smooth)


def _contours(ax: Axes, x: Array, y: Array, z: Array) -> None:
    """Draw height contours; flat terrain has none."""
    low, high = float(np.nanmin(z)), float(np.nanmax(z))
    relief, width = high - low, float(max(np.ptp(x), np.ptp(y)))
    if relief < FLAT * width:
        return
    levels = [level for level in MaxNLocator(10).tick_values(low, high) if low + 0.01 * relief < level < high - 0.01 * relief]
    if not levels:
        return
    moved = [level + 1e-5 * relief for level in levels]  # at the height of a plateau, contours would be arbitrary
    lines = ax.contour(x, y, z, levels=moved, colors="#4a4036", linewidths=0.6, alpha=0.7)
    ax.clabel(lines, fmt={at: f"{level:g} m" for at, level in zip(moved, levels, strict=True)}, fontsize=7)


def scale_bar(ax: Axes, bounds: Bounds) -> None:
    """Draw a bar of a round length in the lower left corner of a map.

    Args:
        ax: axes in metres.
        bounds: xmin, ymin, xmax, ymax of the map, m.
    """
    span = bounds[2] - bounds[0]
    rough = span / 5
    power = 10.0 ** np.floor(np.log10(rough))
    length = max(m * power for m in (1, 2, 5) if m * power <= rough)
    x, y = bounds[0] + 0.04 * span, bounds[1] + 0.045 * (bounds[3] - bounds[1])
    ax.plot([x, x + length], [y, y], color=INK, lw=3, solid_capstyle="butt", path_effects=HALO, zorder=8)
    ax.annotate(
        f"{length:g} m", (x + length / 2, y), xytext=(0, 5), textcoords="offset points", ha="center", path_effects=HALO, zorder=8
    )


def plain_metres(ax: Axes, across: str, up: str) -> None:
    """Label axes in metres, with few ticks and full numbers.

    Args:
        ax: axes in metres.
        across: label of x.
        up: label of y.
    """
    ax.set_xlabel(across)
    ax.set_ylabel(up)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(5))
        axis.set_major_formatter(StrMethodFormatter("{x:,.6g}" if max(map(abs, axis.get_view_interval())) < 1e5 else "{x:,.0f}"))
