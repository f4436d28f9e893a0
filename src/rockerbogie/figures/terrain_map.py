"""Map of a whole terrain from above: passable cells, and a route over them."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..maps.grid import cell_size
from ..maps.style import CLASSES
from ..motion.path_files import Route
from .charts import HALO, Bounds, plain_metres, scale_bar
from .style import INK, figure, look

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

UNKNOWN, OUT_OF_REACH = "#c9d6e2", "#7f7f7f"
STRENGTH = (0.8, 0.75, 0.7, 0.5)  # opacity of the classes' colours over the shaded terrain
PALE = 0.7  # factor on it where a route is drawn over them
_ANGLES = {"tilt": "tilt", "pitch": "pitch", "roll": "roll", "rocker": "rocker", "bogie": "bogie"}


def terrain_map(maps: xr.Dataset, plan: Route | None = None) -> Figure:
    """Draw a map coloured by the share of headings passable, with its legend.

    Args:
        maps: small enough to draw, from `maps.preview.overview`; its layer `ground`, where there is one, is shaded.
        plan: a way to draw over it.

    Returns:
        The figure.
    """
    bounds = _bounds(maps)
    wide, high = bounds[2] - bounds[0], bounds[3] - bounds[1]
    left, right, below, above = 1.1, 3.3, 0.6, 0.62  # inches
    scale = min(6.6 / wide, 7.2 / high)
    across, up = wide * scale, high * scale
    page = (left + across + right, below + max(up, 3.6) + above)
    with look():
        fig = figure(*page)
        fig.set_layout_engine("none")
        ax = fig.add_axes((left / page[0], (page[1] - above - up) / page[1], across / page[0], up / page[1]))
        share = maps["passable"].values
        ax.imshow(
            _colours(maps, share, PALE if plan else 1.0), extent=(bounds[0], bounds[2], bounds[1], bounds[3]),
            origin="lower", interpolation="nearest",
        )  # fmt: skip
        ax.grid(False)
        ax.set_xlim(bounds[0], bounds[2])
        ax.set_ylim(bounds[1], bounds[3])
        way = [] if plan is None else _draw_way(ax, plan)
        scale_bar(ax, bounds)
        _north(ax)
        plain_metres(ax, *(("easting (m)", "northing (m)") if maps.attrs.get("crs") else ("x (m)", "y (m)")))
        at = left / page[0]
        title = f"Traversability of {maps.attrs['terrain']} for {maps.attrs['rover']}"
        fig.text(at, 1 - 0.22 / page[1], title, fontsize=11.5, fontweight="bold", va="center")
        fig.text(at, 1 - 0.44 / page[1], _said(plan, maps), fontsize=8.5, va="center", color="#555555")
        side = fig.add_axes(
            ((left + across + 0.25) / page[0], below / page[1], (right - 0.3) / page[0], 1 - (below + above) / page[1])
        )
        _legend(side, share, maps, way)
    return fig


def _bounds(maps: xr.Dataset) -> Bounds:
    """Return west, east, south and north of a map's cells, m."""
    dx, dy = cell_size(maps)
    (x0, x1), (y0, y1) = ((float(maps[axis][0]), float(maps[axis][-1])) for axis in ("x", "y"))
    return x0 - dx / 2, y0 - dy / 2, x1 + dx / 2, y1 + dy / 2


def _kinds(share: Array) -> NDArray[np.intp]:
    """Return the index in CLASSES of each share (0 to 1) of passable headings."""
    return np.digitize(share, [c.most + 1e-9 for c in CLASSES[:-1]])


def _colours(maps: xr.Dataset, share: Array, paled: float) -> Array:
    """Return RGB (y, x, 3) of the classes, over the shaded terrain."""
    kind = _kinds(np.nan_to_num(share))
    colour = np.array([to_rgb(c.colour) for c in CLASSES])[kind]
    strength = paled * np.array(STRENGTH)[kind][..., None]
    colour[np.isnan(share)] = to_rgb(UNKNOWN)
    colour[_out_of_reach(maps, share)] = to_rgb(OUT_OF_REACH)
    if "ground" not in maps:
        return np.asarray(1 - strength + strength * colour)
    z = maps["ground"].values
    dx, dy = cell_size(maps)
    filled = np.nan_to_num(z, nan=float(np.nanmedian(z)))
    light = 0.3 + 0.7 * LightSource(315, 45).hillshade(filled, dx=dx, dy=-dy, vert_exag=1.5)[..., None]
    return np.asarray(np.clip((1 - strength) * light + strength * colour * (0.45 + 0.7 * light), 0, 1))


def _out_of_reach(maps: xr.Dataset, share: Array) -> NDArray[np.bool_]:
    """Return the passable cells that cannot be reached, by a map of `reachability`."""
    if "reachable" not in maps:
        return np.zeros(share.shape, dtype=bool)
    return np.asarray((share > 0) & (maps["reachable"].values == 0))


def _draw_way(ax: Axes, plan: Route) -> list[Artist]:
    """Draw a route, and return its entries for the legend."""
    ax.plot(plan.x, plan.y, color="white", lw=4.2, solid_capstyle="round", solid_joinstyle="round", zorder=4)
    said = f"least-cost route, {plan.distance[-1]:.4g} m"
    marks: dict[str, Any] = {"mfc": "white", "mec": INK, "ms": 9, "ls": "", "zorder": 9, "clip_on": False}
    return [
        *ax.plot(plan.x, plan.y, color="#0072B2", lw=2.2, solid_capstyle="round", solid_joinstyle="round", zorder=5, label=said),
        *ax.plot(plan.x[0], plan.y[0], marker="o", label="start", **marks),
        *ax.plot(plan.x[-1], plan.y[-1], marker="s", label="goal", **marks),
    ]


def _north(ax: Axes) -> None:
    """Draw a north arrow."""
    arrow = {"arrowstyle": "-|>", "color": INK, "lw": 1.6, "path_effects": HALO}
    ax.annotate("", (0.96, 0.945), (0.96, 0.875), xycoords="axes fraction", arrowprops=arrow, zorder=8)
    ax.text(0.96, 0.95, "N", transform=ax.transAxes, ha="center", va="bottom", fontweight="bold", path_effects=HALO, zorder=8)


def _said(plan: Route | None, maps: xr.Dataset) -> str:
    """Return the title of the figure."""
    cell = np.atleast_1d(maps.attrs["resolution"])
    asked = f"{maps.sizes['heading']} headings at each cell of {' x '.join(f'{side:.4g}' for side in cell)} m"
    if plan is None:
        return asked
    turned = np.degrees(np.abs(np.diff(plan.yaw)).sum())
    return f"route: tilt up to {np.degrees(np.nanmax(plan.tilt)):.1f}°, turning {turned:.0f}° in all · {asked}"


def _legend(ax: Axes, share: Array, maps: xr.Dataset, way: list[Artist]) -> None:
    """Draw the legend: classes, their shares of the terrain, and the limits."""
    ax.axis("off")
    known = np.isfinite(share)
    part = np.bincount(_kinds(share[known]), minlength=len(CLASSES)) / max(known.sum(), 1)
    patches: list[Artist] = [
        Patch(color=c.colour, alpha=0.85, label=f"{c.label}\n{100 * p:.1f} % of the terrain with data")
        for c, p in reversed(list(zip(CLASSES, part, strict=True)))
    ]
    if "reachable" in maps:
        start = maps.attrs.get("reached_from", "the start")
        lost = 100 * _out_of_reach(maps, share).sum() / max(known.sum(), 1)
        patches.append(Patch(color=OUT_OF_REACH, label=f"out of reach from {start} m\n{lost:.1f} % of the terrain with data"))
    if not known.all():
        patches.append(Patch(color=UNKNOWN, label=f"missing data, or the map's edge\n{100 * (~known).mean():.1f} % of the map"))
    legend = ax.legend(
        handles=patches + way, loc="upper left", bbox_to_anchor=(0, 1), borderaxespad=0, fontsize=8.5, labelspacing=0.9
    )
    ax.annotate(
        _limits(maps.attrs), (0.02, -0.08), xycoords=legend, fontsize=8.5, va="top", linespacing=1.5, annotation_clip=False
    )


def _limits(attrs: dict[str, Any]) -> str:
    """Return the limits of a map as lines of text."""
    limits = json.loads(attrs.get("limits", "{}"))
    lines = [f"{name} up to {np.degrees(limits[name]):.3g}°" for name in _ANGLES if limits.get(name) is not None]
    if limits.get("clearance") is not None:
        lines.append(f"clearance above {limits['clearance']:g} m")
    if limits.get("required_friction") is not None:
        lines.append(f"required friction up to {limits['required_friction']:g}")
    if limits.get("tip_margin") is not None:
        lines.append(f"tip margin of {np.degrees(limits['tip_margin']):.3g}° or more")
    if limits.get("max_torque") is not None:
        lines.append(f"motor torque up to {limits['max_torque']:g} N·m")
    settled = "six wheels in contact" if attrs.get("mode", "contact") == "contact" else "in equilibrium"
    return "\n".join([f"Passable: {settled}", *lines])
