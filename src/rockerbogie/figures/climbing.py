"""Pictures of a climb: side view with forces, friction and torque along the way, a film."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..rover.model import Rover
from ..statics.climb import REASONS, Climb
from ..statics.climb_limits import step_friction
from .film import ENDINGS, Picture, write_pictures
from .style import ALARM, FORCE, INK, LEFT, RIGHT, figure, look

Array = NDArray[np.float64]

_GROUND, _BODY, _FAINT, _BOGIE = "#d9cbb8", "#f0ece0", "#888888", "#56B4E9"
_FORWARD, _BACKWARD = "#009E73", "#CC79A7"
#: Length of the arrow of a force of a sixth of the weight, in units of the wheelbase.
ARROW = 0.16
#: Friction axes end here at the latest.
MOST_SHOWN = 1.6
FILM_SIZE, FILM_DPI = (8.4, 5.6), 90


def climb_figure(run: Climb, title: str = "") -> Figure:
    """Draw the rover at its hardest station, and friction and torque along the way.

    Args:
        run: the climb.
        title: text above; default: rover, obstacle and verdict.

    Returns:
        The figure.
    """
    k = run.station if run.limit else run.hardest
    with look():
        fig = figure(9.6, 8.2)
        view, friction, torque = fig.subplots(3, 1, height_ratios=[2.6, 1.25, 1.0])
        _side_view(view, run, k)
        _friction_axes(friction, run, k)
        _torque_axes(torque, run, k)
        friction.sharex(torque)
        friction.tick_params(labelbottom=False)
        fig.suptitle(
            title or _headline(run), x=0.01, ha="left", fontsize=10.5, fontweight="bold", color=ALARM if run.limit else INK
        )
    return fig


def _headline(run: Climb) -> str:
    """Return rover, obstacle and verdict in two lines."""
    back = " backward" if run.direction == "backward" else ""
    return f"{run.rover.name}{back} over {run.profile.name}, friction {run.friction:g}\n{run.verdict}"


def _side_view(axes: Any, run: Climb, k: int, window: tuple[float, float, float, float] | None = None) -> None:
    """Draw profile, rover and contact forces at station k."""
    rover = run.rover
    left, right, low, high = window or _window(run, [k])
    x = np.concatenate([[left], run.profile.x, [right]])
    z = np.concatenate([run.profile.z[:1], run.profile.z, run.profile.z[-1:]])
    axes.fill_between(x, z, low, color=_GROUND, lw=0, zorder=1)
    axes.plot(x, z, color="#7a6650", lw=1.2, zorder=2)
    (x0, _, z0), (x1, _, z1) = rover.body_box
    corners = _on_body(run, k, [x0, x1, x1, x0], [z0, z0, z1, z1])
    axes.add_patch(Polygon(np.stack([corners.real, corners.imag], axis=1), fc=_BODY, ec=_FAINT, lw=1.0, zorder=3))
    joints = _on_body(run, k, *np.stack([rover.rocker_pivot[0], rover.bogie_pivot[0]])[:, [0, 2]].T)
    pivot, bogie = zip(joints.real, joints.imag, strict=True)
    hubs = run.hub[k, ::2]
    for start, end, colour in (
        (pivot, hubs[0], LEFT), (pivot, bogie, LEFT), (bogie, hubs[1], _BOGIE), (bogie, hubs[2], _BOGIE),
    ):  # fmt: skip
        axes.plot([start[0], end[0]], [start[1], end[1]], color=colour, lw=4, solid_capstyle="round", zorder=5)
    for i, hub in enumerate(hubs):
        axes.add_patch(Circle(hub, rover.wheel_radius[2 * i], fc="white", ec=INK, lw=1.5, zorder=4))
        axes.plot(*hub, "o", color=INK, ms=3.5, zorder=6)
        names = " ".join(rover.wheel_names[2 * i : 2 * i + 2])
        axes.annotate(names, hub, (0, -6), textcoords="offset points", fontsize=7.5, ha="center", va="top", color=INK, zorder=6)
    for point in (pivot, bogie):
        axes.plot(*point, "o", color="white", mec=INK, mew=1.3, ms=6, zorder=7)
    _arrows(axes, run, k)
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _on_body(run: Climb, k: int, x: Any, z: Any) -> NDArray[np.complex128]:
    """Return points of the body frame at station k as x + i z in the plane of travel, m."""
    sign = -1.0 if run.direction == "backward" else 1.0
    points = sign * np.asarray(x, dtype=float) + 1j * np.asarray(z, dtype=float)
    return np.asarray(complex(run.x[k], run.z[k]) + np.exp(-1j * sign * run.pitch[k]) * points)


def _arrows(axes: Any, run: Climb, k: int) -> None:
    """Draw the contact force of each axle as an arrow that begins at the contact."""
    scale = ARROW * run.rover.wheelbase / (run.rover.mass * run.gravity / 6.0)
    for i in range(0, 6, 2):
        n = run.contact_normal[k, i]
        force = run.normal[k, i] * n + run.traction[k, i] * np.array([n[1], -n[0]])
        if not np.isfinite(force).all() or np.hypot(*force) * scale < 1e-3 * run.rover.wheelbase:
            continue
        point = run.contact_point[k, i]
        axes.annotate(
            "", point + force * scale, point, zorder=8,
            arrowprops={"arrowstyle": "-|>", "color": FORCE, "lw": 2.0, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip


def _window(run: Climb, stations: list[int]) -> tuple[float, float, float, float]:
    """Return left, right, low and high of a view of the rover at some stations, m."""
    radius, base = float(run.rover.wheel_radius.max()), run.rover.wheelbase
    hubs = run.hub[stations].reshape(-1, 2)
    left, right = hubs[:, 0].min() - radius - 0.15 * base, hubs[:, 0].max() + radius + 0.15 * base
    (x0, _, _), (x1, _, z1) = run.rover.body_box
    corner = np.concatenate([_on_body(run, k, [x0, x1], [z1, z1]) for k in stations])
    high = max(float(hubs[:, 1].max()) + radius, float(corner.imag.max())) + 0.05 * base
    near = np.interp([left, right], run.profile.x, run.profile.z)
    inside = run.profile.z[(run.profile.x >= left) & (run.profile.x <= right)]
    low = min(float(near.min()), float(inside.min(initial=np.inf)), float(hubs[:, 1].min()) - radius) - 0.08 * base
    return float(left), float(right), float(low), float(high)


def _friction_axes(axes: Any, run: Climb, k: int) -> Any:
    """Draw the required friction along the way, braking dotted; return the line of station k."""
    needed = np.where(np.isfinite(run.required_friction), run.required_friction, 10.0 * MOST_SHOWN)
    top = min(MOST_SHOWN, 1.15 * max(run.friction, float(np.minimum(needed, MOST_SHOWN).max()), 0.1))
    axes.plot(run.distance, np.where(run.uphill, np.nan, needed), color=_FAINT, lw=1.2, ls=":", label="to hold it back downhill")
    axes.plot(run.distance, np.where(run.uphill, needed, np.nan), color=INK, lw=1.6, label="to climb")
    axes.axhline(run.friction, color=RIGHT, lw=1.2, ls="--", label=f"available: {run.friction:g}")
    axes.fill_between(run.distance, 0, top, where=run.uphill & (needed > run.friction), color=RIGHT, alpha=0.18, lw=0)
    line = _mark(axes, run, k)
    _name_peaks(axes, run, needed, top)
    axes.set_ylim(0.0, top)
    axes.set_ylabel("friction needed")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), fontsize=8.5, ncols=3)
    return line


def _name_peaks(axes: Any, run: Climb, needed: Array, top: float) -> None:
    """Write the axle that climbs over each uphill stretch."""
    incline = np.arctan2(-run.contact_normal[:, ::2, 0], run.contact_normal[:, ::2, 1])
    order = np.argsort(-run.hub[0, ::2, 0])
    names = {int(axle): place for axle, place in zip(order, ("front", "middle", "rear"), strict=True)}
    steep = np.where(run.uphill & (incline.max(axis=1) > 0.02), incline.argmax(axis=1), -1)
    edges = np.flatnonzero(np.diff(steep)) + 1
    span = float(np.ptp(run.distance))
    last = -np.inf
    for part in np.split(np.arange(steep.size), edges):
        if steep[part[0]] < 0:
            continue
        peak = part[np.argmax(needed[part])]
        if run.distance[peak] - last < 0.06 * span:
            continue
        last = run.distance[peak]
        height = min(needed[peak], 0.86 * top)
        axes.annotate(
            names[int(steep[peak])], (run.distance[peak], height), (3, 2), textcoords="offset points", fontsize=8, color=INK
        )


def _torque_axes(axes: Any, run: Climb, k: int) -> None:
    """Draw the required torque along the way."""
    needed = np.where(np.isfinite(run.required_torque), run.required_torque, np.nan)
    axes.plot(run.distance, np.where(run.uphill, np.nan, needed), color=_FAINT, lw=1.2, ls=":")
    axes.plot(run.distance, np.where(run.uphill, needed, np.nan), color=INK, lw=1.6)
    if np.isfinite(run.torque_limit):
        axes.axhline(run.torque_limit, color=RIGHT, lw=1.2, ls="--", label=f"available: {run.torque_limit:g} N m")
        axes.legend(loc="upper right", fontsize=8.5)
    _mark(axes, run, k)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("motor torque needed\n(N m per wheel)")
    axes.set_xlabel("distance (m)")


def _mark(axes: Any, run: Climb, k: int) -> Any:
    """Draw a line at station k and return it."""
    return axes.axvline(run.distance[k], color=_colour_at(run, k), lw=1.2)


def _colour_at(run: Climb, k: int) -> str:
    """Return the colour of the line at station k."""
    return ALARM if run.limit and k == run.station else FORCE


def step_chart(rover: Rover, friction: float | None = None, heights: Array | None = None) -> Figure:
    """Draw the friction that a rover needs against the height of a step.

    Args:
        rover: the rover.
        friction: coefficient to mark, with the highest steps that it allows.
        heights: (n,) step heights, m. Default: up to four wheel radii.

    Returns:
        The figure.
    """
    radius = float(rover.wheel_radius.max())
    at: Array = np.linspace(0.04, 4.0, 100) * radius if heights is None else np.asarray(heights, dtype=float)
    with look():
        fig = figure(8.2, 4.8)
        axes = fig.subplots()
        top = 1.1
        for direction, colour in (("forward", _FORWARD), ("backward", _BACKWARD)):
            needed, why = step_friction(rover, at, direction)  # type: ignore[arg-type]
            axes.plot(at / radius, needed, color=colour, label=direction)
            top = max(top, 1.1 * min(MOST_SHOWN, float(np.nanmax(needed, initial=0.0))))
            end = next((i for i, reason in enumerate(why) if reason), None)
            if end is not None:
                last = max(end - 1, 0)
                axes.plot(at[last] / radius, needed[last], "x", color=colour, ms=8, mew=2)
                axes.annotate(
                    REASONS[why[end]], (at[last] / radius, needed[last]), (0, 9 if direction == "forward" else -17),
                    textcoords="offset points", fontsize=8.5, color=colour, ha="right" if 2 * last > at.size else "left",
                )  # fmt: skip
        if friction is not None:
            axes.axhline(friction, color=INK, lw=1.1, ls="--")
            axes.text(0.02, friction, f" friction {friction:g}", va="bottom", fontsize=8.5, transform=axes.get_yaxis_transform())
        second = axes.secondary_xaxis("top", functions=(lambda v: np.asarray(v) * radius, lambda v: np.asarray(v) / radius))
        second.set_xlabel("step height (m)")
        axes.set_xlim(0.0, float(at[-1]) / radius)
        axes.set_ylim(0.0, min(top, MOST_SHOWN))
        axes.set_xlabel("step height (wheel radii)")
        axes.set_ylabel("friction coefficient needed")
        axes.legend(loc="lower right")
        fig.suptitle(f"{rover.name}: friction needed to climb a step", x=0.01, ha="left", fontsize=10.5, fontweight="bold")
    return fig


def write_climb_film(
    file: str | Path,
    run: Climb,
    *,
    frames: int = 72,
    rate: float = 15.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a climb as a film, up to the station at which it ends.

    Args:
        file: ends in .gif or .mp4 (the latter needs the film extra).
        run: the climb.
        frames: number of pictures, evenly over the distance.
        rate: pictures per second.
        progress: called with pictures done and pictures in all.

    Returns:
        The file.

    Raises:
        RockerbogieError: another ending, PyAV not installed.
    """
    path = Path(file)
    if path.suffix.lower() not in ENDINGS:
        raise RockerbogieError(f"{str(file)!r} is no film: end it in {' or '.join(ENDINGS)}")
    last = run.station if run.limit else run.distance.size - 1
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(run.distance[: last + 1])))])
    at = np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], frames)).clip(0, last))
    return write_pictures(path, _pictures(run, at, progress), rate)


def _pictures(run: Climb, at: NDArray[np.intp], progress: Callable[[int, int], None]) -> Iterator[Picture]:
    """Yield the film's pictures (height, width, 3)."""
    window = _window(run, [int(k) for k in at])
    with look():
        fig = figure(*FILM_SIZE)
        fig.set_dpi(FILM_DPI)
        view, friction = fig.subplots(2, 1, height_ratios=[2.4, 1.0])
        _side_view(view, run, int(at[0]), window)
        line = _friction_axes(friction, run, int(at[0]))
        friction.set_xlabel("distance (m)")
        fig.suptitle(_headline(run), x=0.01, ha="left", fontsize=10, fontweight="bold", color=ALARM if run.limit else INK)
        canvas = FigureCanvasAgg(fig)
        fig.draw_without_rendering()
        fig.set_layout_engine("none")  # that of the first picture is that of all
        moving = (view, line, *friction.texts)  # texts lie above the line
        for artist in moving:
            artist.set_animated(True)
        canvas.draw()  # type: ignore[no-untyped-call]
        still = canvas.copy_from_bbox(fig.bbox)  # type: ignore[no-untyped-call]
    for done, k in enumerate(at):
        with look():
            for artist in (*view.collections, *view.lines, *view.patches, *view.texts):  # faster than view.clear()
                artist.remove()
            _side_view(view, run, int(k), window)
            line.set_xdata([run.distance[k]] * 2)
            line.set_color(_colour_at(run, int(k)))
            canvas.restore_region(still)  # type: ignore[no-untyped-call]
            for artist in moving:
                fig.draw_artist(artist)
            picture = np.array(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
        progress(done + 1, len(at))
        yield picture
