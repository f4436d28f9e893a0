"""The least-cost way over a map of a rover's states: cell by cell, heading by heading, as the rover can turn."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import PathError, RockerbogieError, RoverError, expect
from ..motion.path_files import Route
from ..rotations import wrap_angle
from ..rover.formats import load_rover
from ..rover.model import LOAD_ROVER, Rover
from .files import cell_size, read_map
from .moves import graph, grid_steps, moves, turning_radius, turns_in_place

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
State = tuple[int, int, int]  # index of the heading, row (y), column (x)

#: Tilt that counts as a risk of 1 where the map's limits name none, rad.
USUAL_TILT = np.radians(30.0)


class _Layers(NamedTuple):
    """What a plan needs of a map."""

    heading: Array  # (n,) rad
    x: Array  # (cols,) m
    y: Array  # (rows,) m
    passable: NDArray[np.bool_]  # (n, rows, cols)
    tilt: NDArray[np.floating[Any]]  # (n, rows, cols) rad
    cell: tuple[float, float]  # dx, dy, m
    crs: str | None
    rover: str


def plan(
    maps: xr.Dataset | str | FilePath,
    start: Sequence[float],
    goal: Sequence[float],
    *,
    rover: Rover | None = None,
    tilt_weight: float = 1.0,
    turn_cost: float = 1.0,
    turn_in_place: bool | None = None,
    backward: bool = False,
) -> Route:
    """The least-cost way over a map from `start` to `goal`, cell by cell and heading by heading.

    A state is a cell and one of the map's headings, passable where no limit is exceeded. The rover goes on to the cell
    along its heading, and turns to the neighbouring heading: on the spot, if its four corner wheels steer, else on an arc
    of two legs. Every state on the way is passable, cells that a leg only runs through too. A move costs its length
    times (1 + `tilt_weight` · the mean over its states of (tilt / tilt limit)²), and `turn_cost` a radian turned.
    Dijkstra's search (scipy's) finds the least sum; of ways that cost the same it is always the same one.

    Args:
        maps: from `traversability`, or a file it was saved to. A GeoTIFF of summaries does too: then a cell passable at
            every heading is passable, its worst tilt its tilt.
        start, goal: (x, y) or (x, y, heading), m and rad: the nearest cell, the nearest heading, or any.
        rover: says how it turns. Default: the preset of the map's rover name.
        tilt_weight: of the risk; 0 for the shortest way.
        turn_cost: m a radian.
        turn_in_place: overrules what the rover can.
        backward: may drive backwards too.

    Raises:
        PathError: start or goal off the map or not passable, or no way between them; with the nearest place that is.
        RockerbogieError: no map, or a weight below 0.
    """
    for name, value in (("tilt_weight", tilt_weight), ("turn_cost", turn_cost)):
        if not (np.isfinite(value) and value >= 0):
            raise RockerbogieError(f"{name} is {value}; give a finite number of at least 0")
    layers, limit = _layers(maps)
    in_place, radius = _turning(rover, layers.rover, turn_in_place)
    sources, targets = _states(layers, start, "start"), _states(layers, goal, "goal")
    risk = np.where(layers.passable, tilt_weight * (layers.tilt / limit) ** 2, 0.0).astype(np.float32)
    ways = moves(layers.heading, layers.cell, in_place, radius, backward)
    costs, number = graph(layers.passable, risk, ways, turn_cost)
    found = _search(costs, number, sources, targets)
    if isinstance(found, np.ndarray):
        raise PathError(_no_way(layers, number, found, start, goal))
    return _plan_of(layers, found[0], found[1])


def _layers(source: xr.Dataset | str | FilePath) -> tuple[_Layers, float]:
    """What a plan needs of a map in memory or on file, and the tilt that is a risk of 1, rad."""
    import xarray as xr

    maps = read_map(source) if isinstance(source, str | FilePath) else source
    if not isinstance(maps, xr.Dataset):
        raise RockerbogieError(
            f"maps is {maps!r:.60}, not a Dataset: give that of rockerbogie.traversability, or a file it was saved to"
        )
    limit = json.loads(maps.attrs.get("limits", "{}")).get("tilt") or USUAL_TILT
    try:
        heading, x, y = (np.asarray(maps[name].values, dtype=float) for name in ("heading", "x", "y"))
        if "exceeded" in maps and "tilt" in maps:
            passable = maps["exceeded"].transpose("heading", "y", "x").values == 0
            tilt = maps["tilt"].transpose("heading", "y", "x").values
        else:
            shape = (len(heading), len(y), len(x))
            passable = np.broadcast_to(maps["passable"].transpose("y", "x").values == 1, shape)
            tilt = np.broadcast_to(maps["worst_tilt"].transpose("y", "x").values, shape)
    except KeyError as error:
        raise RockerbogieError(f"this map has no {error}: plan on one that rockerbogie.traversability made") from None
    passable = passable & np.isfinite(tilt)
    about = (cell_size(maps), maps.attrs.get("crs"), str(maps.attrs.get("rover", "rover")))
    return _Layers(heading, x, y, passable, tilt, *about), float(limit)


def _turning(rover: Rover | None, name: str, in_place: bool | None) -> tuple[bool, float]:
    """Whether to turn on the spot, and the tightest arc if not, m."""
    if rover is None and in_place is None:
        try:
            rover = load_rover(name)
        except RoverError:
            raise RockerbogieError(
                f"the map's rover {name!r} is no preset, so how it turns is not known: give rover= or turn_in_place="
            ) from None
    if rover is not None:
        expect(rover, Rover, "rover", LOAD_ROVER)
    in_place = turns_in_place(rover) if in_place is None and rover is not None else bool(in_place)
    return in_place, 0.0 if rover is None or in_place else turning_radius(rover)


def _states(layers: _Layers, place: Sequence[float], name: str) -> list[State]:
    """The passable states at a place (x, y) or (x, y, heading)."""
    try:
        values = [float(v) for v in place]
    except (TypeError, ValueError):
        values = []
    if len(values) not in (2, 3) or not np.isfinite(values).all():
        raise PathError(f"{name} is {place!r}: give (x, y) or (x, y, heading), finite, in metres and radians")
    x, y = values[:2]
    col, row = int(np.abs(layers.x - x).argmin()), int(np.abs(layers.y - y).argmin())
    reach = (0.5 + 1e-9) * np.array(layers.cell)
    if abs(layers.x[col] - x) > reach[0] or abs(layers.y[row] - y) > reach[1]:
        spans = [f"({axes[0][k]:.10g}, {axes[1][k]:.10g})" for axes in ((layers.x, layers.y),) for k in (0, -1)]
        raise PathError(f"the {name} ({x:.10g}, {y:.10g}) m is off the map, whose cells lie from {spans[0]} to {spans[1]} m")
    off = np.abs(wrap_angle(layers.heading - values[2])) if len(values) == 3 else None
    headings = range(len(layers.heading)) if off is None else [int(off.argmin())]
    states = [(k, row, col) for k in headings if layers.passable[k, row, col]]
    if states:
        return states
    facing = "at any heading" if off is None else f"facing {np.degrees(layers.heading[headings[0]]):.4g} deg"
    free = np.any(layers.passable[list(headings)], axis=0)
    if not free.any():
        raise PathError(f"the rover may stand nowhere on this map {facing}: see its layer 'exceeded', or widen the limits")
    near = _nearest(layers, free, x, y)
    raise PathError(
        f"the rover may not stand at the {name} ({x:.10g}, {y:.10g}) m {facing}; "
        f"the nearest place where it may is ({near[0]:.10g}, {near[1]:.10g}) m, {near[2]:.4g} m away"
    )


def _nearest(layers: _Layers, free: NDArray[Any], x: float, y: float) -> tuple[float, float, float]:
    """The centre of the free cell (rows, cols) that is nearest to a place, and how far it is, m."""
    row, col = np.nonzero(free)
    away = np.hypot(layers.x[col] - x, layers.y[row] - y)
    k = int(away.argmin())
    return float(layers.x[col[k]]), float(layers.y[row[k]]), float(away[k])


def _search(
    costs: Any, number: NDArray[np.int32], sources: list[State], targets: list[State]
) -> tuple[list[State], Array] | NDArray[np.bool_]:
    """States of the least-cost way and the cost at each; or, if there is no way, where (heading, y, x) one can get to."""
    from scipy.sparse.csgraph import dijkstra

    begin = [int(number[s]) for s in sources]
    reached, before, _ = dijkstra(costs, indices=begin, min_only=True, return_predecessors=True)
    ends = [int(number[t]) for t in targets]
    end = min(ends, key=lambda k: (reached[k], k))
    if not np.isfinite(reached[end]):
        seen = np.zeros(number.shape, dtype=bool)
        seen[number >= 0] = np.isfinite(reached)
        return seen
    way = [end]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    way.reverse()
    flat = np.flatnonzero(number >= 0)[way]
    states = [tuple(int(v) for v in s) for s in zip(*np.unravel_index(flat, number.shape), strict=True)]
    return states, np.asarray(reached[way], dtype=float)  # type: ignore[return-value]


def _no_way(
    layers: _Layers, number: NDArray[np.int32], seen: NDArray[np.bool_], start: Sequence[float], goal: Sequence[float]
) -> str:
    near = _nearest(layers, np.any(seen, axis=0), float(goal[0]), float(goal[1]))
    share = seen.sum() / (number >= 0).sum()
    return (
        f"there is no way from ({start[0]:.10g}, {start[1]:.10g}) to ({goal[0]:.10g}, {goal[1]:.10g}) m within the limits: "
        f"of the passable states {100 * share:.3g} % can be reached; the nearest place to the goal among them is "
        f"({near[0]:.10g}, {near[1]:.10g}) m, {near[2]:.4g} m from it"
    )


def _plan_of(layers: _Layers, states: list[State], cost: Array) -> Route:
    """The poses of a way through states; an arc has one more, at its corner, facing halfway."""
    k, row, col = (np.array(v) for v in zip(*states, strict=True))
    x, y, heading = layers.x[col], layers.y[row], np.unwrap(layers.heading[k])
    tilt = np.asarray(layers.tilt[k, row, col], dtype=float)
    poses = [(x[0], y[0], heading[0], cost[0], tilt[0])]
    for n in range(1, len(states)):
        moved = np.array([x[n] - x[n - 1], y[n] - y[n - 1]])
        if moved.any() and k[n] != k[n - 1]:
            corner = _corner(layers, states[n - 1], states[n])
            here = np.nanmax(layers.tilt[[k[n - 1], k[n]], corner[0], corner[1]])
            middle = ((heading[n] + heading[n - 1]) / 2, (cost[n] + cost[n - 1]) / 2)
            poses.append((layers.x[corner[1]], layers.y[corner[0]], *middle, here))
        poses.append((x[n], y[n], heading[n], cost[n], tilt[n]))
    px, py, facing, price, lean = np.array(poses).T
    distance = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(px), np.diff(py)))])
    return Route(px, py, facing, distance, price, lean, layers.crs, layers.rover)


def _corner(layers: _Layers, left: State, reached: State) -> tuple[int, int]:
    """Row and column where the two legs of an arc meet: along the first heading as far as the legs' steps say."""
    steps = grid_steps(layers.heading, layers.cell)
    a, b = np.array(steps[left[0]]), np.array(steps[reached[0]])
    total = np.array([reached[2] - left[2], reached[1] - left[1]])
    count = round(float(total @ (a + b)) / float((a + b) @ (a + b)))  # of steps on each leg, below 0 backwards
    return left[1] + count * int(a[1]), left[2] + count * int(a[0])
