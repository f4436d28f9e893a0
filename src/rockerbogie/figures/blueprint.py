"""Drawing of a rover with its dimensions: left side and plan, to scale, in millimetres."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from ..rover.model import Rover
from .style import INK, LEFT, RIGHT, figure, look

Array = NDArray[np.float64]

_FAINT, _BODY = "#888888", "#f0ece0"


def blueprint(rover: Rover, title: str = "") -> Figure:
    """Draw a rover from the left and from above, on one scale, with its dimensions.

    Args:
        rover: the rover.
        title: text above; default: its name.

    Returns:
        The figure.
    """
    length = rover.wheelbase + 2 * rover.wheel_radius.max()
    low, high = _span(rover, 2)
    across = _span(rover, 1)
    tall, broad = high - low + 0.27 * length, across[1] - across[0] + 0.1 * length
    width = 10.0
    with look():
        fig = figure(width, 0.9 + width * (tall + broad) / (1.48 * length))
        side, plan = fig.subplots(2, 1, height_ratios=[tall, broad])
        _side(side, rover, length)
        _plan(plan, rover, length)
        for axes in (side, plan):
            axes.set_aspect("equal")
            axes.set_axis_off()
        fig.suptitle(title or rover.name, x=0.01, ha="left", fontsize=12, fontweight="bold", color=INK)
    return fig


def _span(rover: Rover, axis: int) -> tuple[float, float]:
    """Return the lowest and highest coordinate of the rover along y (axis 1) or z (axis 2), m."""
    reach = np.maximum(rover.wheel_width / 2, 0.06 * rover.wheel_radius) if axis == 1 else rover.wheel_radius
    edges = [
        *(rover.hubs[:, axis] - reach),
        *(rover.hubs[:, axis] + reach),
        *rover.body_box[:, axis],
        *rover.rocker_pivot[:, axis],
    ]
    return float(min(edges)), float(max(edges))


def _side(axes: Any, rover: Rover, length: float) -> None:
    """Draw the rover from the left, forward to the left."""
    box, radius = rover.body_box, rover.wheel_radius
    axes.add_patch(Rectangle((box[0, 0], box[0, 2]), *(box[1] - box[0])[[0, 2]], fc=_BODY, ec=_FAINT, lw=1))
    rocker, bogie, hubs = rover.rocker_pivot[0], rover.bogie_pivot[0], rover.hubs[::2]
    ground = float((rover.hubs[:, 2] - radius).min())
    for start, ends, shade in ((rocker, (bogie, hubs[0]), LEFT), (bogie, hubs[1:], "#56B4E9")):
        for end in ends:
            axes.plot(*np.array([start, end])[:, [0, 2]].T, color=shade, lw=4, solid_capstyle="round", zorder=3)
    for i, hub in enumerate(hubs):
        axes.add_patch(Circle((hub[0], hub[2]), radius[2 * i], fc="white", ec=INK, lw=1.5, zorder=2))
        axes.plot(hub[0], hub[2], "o", color=INK, ms=4, zorder=4)
        steers = " (steers)" if rover.steers[2 * i] else ""
        label = f"{rover.wheel_names[2 * i]}{steers}\nr {_mm(radius[2 * i])}"
        axes.text(hub[0], hub[2] + 0.32 * radius[2 * i], label, ha="center", va="bottom", fontsize=8, color=INK, zorder=5)
    white = {"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.8}
    for point, name in ((rocker, "rocker pivot"), (bogie, "bogie pivot")):
        axes.plot(point[0], point[2], "o", color="white", mec=INK, mew=1.5, ms=7, zorder=6)
        axes.annotate(
            name, (point[0], point[2]), (0, 10), textcoords="offset points", fontsize=8, color=INK, ha="center", va="bottom",
            bbox=white, zorder=7,
        )  # fmt: skip
    axes.axhline(ground, color=_FAINT, lw=1)
    step = 0.075 * length
    stations = np.array([*hubs[:, 0], rocker[0], bogie[0]])
    ordered = np.sort(np.unique(np.round(stations, 6)))
    for a, b in pairwise(ordered):
        _measure(axes, (a, ground - step), (b, ground - step), _mm(b - a), small=b - a < 0.08 * length)
    for x in ordered:
        axes.plot([x, x], [ground - 1.2 * step, ground], color=_FAINT, lw=0.6, ls=":")
    _measure(
        axes,
        (hubs[:, 0].min(), ground - 2.3 * step),
        (hubs[:, 0].max(), ground - 2.3 * step),
        f"wheelbase {_mm(rover.wheelbase)}",
    )
    front = float((hubs[:, 0] + radius[::2]).max())
    back = float((hubs[:, 0] - radius[::2]).min())
    for k, (point, name) in enumerate(((rocker, "rocker"), (bogie, "bogie"))):
        x = (front if point[0] > (front + back) / 2 else back) + (1 if point[0] > (front + back) / 2 else -1) * (
            0.05 + 0.07 * k
        ) * length
        axes.plot([point[0], x], [point[2], point[2]], color=_FAINT, lw=0.6, ls=":")
        _measure(axes, (x, ground), (x, point[2]), f"{name} {_mm(point[2] - ground)}", upright=True)
    axes.plot(0, 0, "+", color=RIGHT, ms=10, mew=1.5, zorder=7)
    axes.annotate("origin", (0, 0), (6, -9), textcoords="offset points", fontsize=7.5, color=RIGHT, zorder=7)
    axes.set_xlim(front + 0.24 * length, back - 0.24 * length)
    low, high = _span(rover, 2)
    axes.set_ylim(min(low, 0) - 0.22 * length, max(high, 0) + 0.05 * length)
    axes.set_title("left side (mm), forward to the left")


def _plan(axes: Any, rover: Rover, length: float) -> None:
    """Draw the rover from above, forward to the left."""
    box, shown = rover.body_box, np.maximum(rover.wheel_width, 0.12 * rover.wheel_radius)
    axes.add_patch(Rectangle((box[0, 0], box[0, 1]), *(box[1] - box[0])[:2], fc=_BODY, ec=_FAINT, lw=1))
    for i, hub in enumerate(rover.hubs):
        r, w = rover.wheel_radius[i], shown[i]
        axes.add_patch(Rectangle((hub[0] - r, hub[1] - w / 2), 2 * r, w, fc="white", ec=INK, lw=1.2, zorder=2))
        outward = 1 if i % 2 == 0 else -1
        place = (hub[0] + 0.75 * r, hub[1] + outward * w / 2)
        axes.annotate(
            rover.wheel_names[i], place, (0, 3 * outward), textcoords="offset points", fontsize=8, color=INK,
            ha="center", va="bottom" if outward > 0 else "top", zorder=4,
        )  # fmt: skip
        if rover.steers[i]:
            axis = hub[:2] + rover.steering_offset[i]
            axes.plot(*axis, "x", color=RIGHT, ms=6, mew=1.5, zorder=5)
    for s, colour in ((0, LEFT), (1, RIGHT)):
        rocker, bogie = rover.rocker_pivot[s], rover.bogie_pivot[s]
        chain = ((rocker, rover.hubs[s]), (rocker, bogie), (bogie, rover.hubs[2 + s]), (bogie, rover.hubs[4 + s]))
        for start, end in chain:
            axes.plot(*np.array([start, end])[:, :2].T, color=colour, lw=2.5, alpha=0.65, zorder=3)
        axes.plot(*np.array([rocker, bogie])[:, :2].T, "o", color="white", mec=INK, ms=5, zorder=4)
    axes.plot(*rover.rocker_pivot[:, :2].T, color=_FAINT, lw=1, ls="--", zorder=1)
    step = 0.05 * length
    back = float((rover.hubs[:, 0] - rover.wheel_radius).min())
    tracks = {(float(round(rover.hubs[2 * a, 1] - rover.hubs[2 * a + 1, 1], 6))): a for a in (0, 1, 2)}
    for k, (track, a) in enumerate(sorted(tracks.items())):
        x = back - (1 + 1.4 * k) * step
        _measure(axes, (x, rover.hubs[2 * a + 1, 1]), (x, rover.hubs[2 * a, 1]), f"track {_mm(track)}", upright=True)
        for y in rover.hubs[2 * a : 2 * a + 2, 1]:
            axes.plot([rover.hubs[2 * a, 0], x], [y, y], color=_FAINT, lw=0.6, ls=":")
    widths = " / ".join(_mm(w) for w in dict.fromkeys(rover.wheel_width[::2].tolist()))
    turned = "; x: steering axis" if rover.steers.any() else ""
    axes.set_title(f"from above (mm): wheel width {widths}{turned}")
    front = float((rover.hubs[:, 0] + rover.wheel_radius).max())
    axes.set_xlim(front + 0.24 * length, back - 0.24 * length)
    low, high = _span(rover, 1)
    axes.set_ylim(low - 0.05 * length, high + 0.05 * length)


def _measure(
    axes: Any, start: tuple[float, float], end: tuple[float, float], text: str, *, upright: bool = False, small: bool = False
) -> None:
    """Draw a dimension line with its number."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "<->", "color": INK, "lw": 0.8, "shrinkA": 0, "shrinkB": 0})
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    white = {"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none"}
    if small:
        axes.annotate(text, middle, (0, 5), textcoords="offset points", ha="center", va="bottom", fontsize=7.5, color=INK)
    else:
        axes.text(
            *middle, text, ha="center", va="center", fontsize=8, color=INK, rotation=90 if upright else 0, bbox=white, zorder=6
        )


def _mm(metres: float) -> str:
    """Return a length as text in millimetres."""
    return f"{1e3 * metres:.1f}".removesuffix(".0")
