"""Least-cost routes over a map, and the part of it that a rover can reach."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import PathError, RockerbogieError, RoverError, expect
from ..motion.path_files import Route
from ..rover.formats import load_rover
from ..rover.model import LOAD_ROVER, Rover
from ..rover.rotations import wrap_angle
from .files import read_map
from .grid import cell_size, crs_of
from .layers import REACH
from .moves import Move, graph, grid_steps, moves, turning_radius, turns_in_place
from .overlays import cost_cells, keep_out_cells
from .search import reach_from, through
from .slip import SlipCost, slip_states

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
State = tuple[int, int, int]  # index of the heading, row (y), column (x)
Maps = "xr.Dataset | str | FilePath"

#: Tilt with a risk of 1 if the map has no limit of tilt, rad.
USUAL_TILT = np.radians(30.0)
#: Default speed for times, m/s: Curiosity's greatest.
USUAL_SPEED = 0.04


class _Layers(NamedTuple):
    """The parts of a map that a plan reads."""

    heading: Array  # (n,) rad
    x: Array  # (cols,) m
    y: Array  # (rows,) m
    passable: NDArray[np.bool_]  # (n, rows, cols)
    tilt: NDArray[np.floating[Any]]  # (n, rows, cols) rad
    clearance: NDArray[np.floating[Any]]  # (n, rows, cols) m
    cell: tuple[float, float]  # dx, dy, m
    crs: str | None
    rover: str


class _Problem(NamedTuple):
    """The graph of a map's states."""

    layers: _Layers
    costs: Any  # sparse (states, states): cost of each move, m
    number: NDArray[np.int32]  # (n, rows, cols) of each state in the graph; -1 where it is not passable
    rover: Rover | None
    travel: Array | None  # (n, rows, cols) expected wheel travel per metre; None without slip
    ways: list[list[Move]]  # moves out of each heading


def plan(
    maps: xr.Dataset | str | FilePath,
    start: Sequence[float],
    goal: Sequence[float] | Sequence[Sequence[float]],
    *,
    rover: Rover | None = None,
    keep_out: Any = None,
    keep_out_margin: float | None = None,
    cost: Any = None,
    tilt_weight: float = 1.0,
    turn_cost: float = 1.0,
    turn_in_place: bool | None = None,
    backward: bool = False,
    speed: float = USUAL_SPEED,
    slip: SlipCost | None = None,
) -> Route:
    """Compute the least-cost route from `start` to one goal, or to several goals in order.

    A state is a cell and one of the map's headings, passable where no limit is exceeded. The rover moves to the next cell along
    its heading, and turns to the neighbouring heading: on the spot, if its four corner wheels steer, else on an arc of two legs.
    Every state on the route is passable, cells that a leg only crosses too. A move costs its length times (1 + `tilt_weight` ·
    mean of (tilt / tilt limit)² + mean of `cost`) over its states, and `turn_cost` per radian turned. Dijkstra's search (SciPy's)
    finds the least sum over all goals together; of routes with equal costs it always returns the same one.

    Args:
        maps: from `traversability`, or a file it was saved to. A GeoTIFF of summaries serves too: then a cell passable at every
            heading is passable, and its worst tilt counts.
        start: (x, y) or (x, y, yaw), m and rad: the nearest cell, the nearest heading or any.
        goal: likewise; or a sequence of such goals, reached in this order.
        rover: gives the way it turns and its size. Default: the preset of the map's rover name.
        keep_out: areas that are not entered: a vector file (all its features), or a raster file or array (y, x) that is neither 0
            nor missing there.
        keep_out_margin: distance that the rover's reference point keeps from them, m. Default: the rover's own radius, so that
            no wheel enters at any heading; 0 if the rover is not known.
        cost: extra cost per metre, from 0: a vector file with a column `cost`, a raster file or an array (y, x).
        tilt_weight: weight of the tilt; 0 for the shortest route.
        turn_cost: m per radian.
        turn_in_place: overrides how the rover turns.
        backward: allow driving backwards.
        speed: of the wheels, for the times of the route, m/s.
        slip: slip curve of the soil: states at which it exceeds its limit too probably are not passable, and a metre costs its
            expected wheel travel (or energy) instead of 1; times count the wheel travel. Use `tilt_weight=0` for least time or
            energy alone.

    Returns:
        The route, with the goal that each pose leads to.

    Raises:
        PathError: start or goal off the map or not passable, or no route between them; with the nearest passable position.
        RockerbogieError: no map, a layer that cannot be read, or a weight below 0.
    """
    if not (np.isfinite(speed) and speed > 0):
        raise RockerbogieError(f"speed is {speed} m/s; give one above 0")
    problem = _problem(maps, rover, keep_out, keep_out_margin, cost, tilt_weight, turn_cost, turn_in_place, backward, slip)
    goals = _goals(goal)
    names = ["the goal"] if len(goals) == 1 else [f"goal {k}" for k in range(1, len(goals) + 1)]
    places = zip([start, *goals], ["the start", *names], strict=True)
    stops = [_states(problem.layers, place, name) for place, name in places]
    found = through(problem.costs, [[int(problem.number[state]) for state in states] for states in stops])
    if isinstance(found[0], int):
        leg, reached = found
        seen = np.zeros(problem.number.shape, dtype=bool)
        seen[problem.number >= 0] = np.isfinite(reached)
        raise PathError(_no_way(problem.layers, problem.number, seen, [start, *goals][leg], goals[leg]))
    nodes, price, leads_to = found
    at = np.flatnonzero(problem.number >= 0)[nodes]
    states: list[State] = [
        (int(k), int(row), int(col)) for k, row, col in zip(*np.unravel_index(at, problem.number.shape), strict=True)
    ]
    return _route_of(problem, states, price, leads_to.astype(np.int64), speed)


def reachability(
    maps: xr.Dataset | str | FilePath,
    start: Sequence[float],
    *,
    rover: Rover | None = None,
    keep_out: Any = None,
    keep_out_margin: float | None = None,
    cost: Any = None,
    tilt_weight: float = 1.0,
    turn_cost: float = 1.0,
    turn_in_place: bool | None = None,
    backward: bool = False,
    slip: SlipCost | None = None,
) -> xr.Dataset:
    """Compute which cells of a map a rover can reach from a position, and at what cost.

    Args:
        maps, start, rover, keep_out, keep_out_margin, cost, tilt_weight, turn_cost, turn_in_place, backward, slip: as
            `plan`.

    Returns:
        Dataset over (y, x) that `write_map` writes. `reachable` is the share of the map's headings at which the rover can come
        to the cell: 0 where it cannot, NaN where the terrain is missing. `reach_cost` is the least cost of coming there, m of
        level terrain, NaN where it cannot. `passable` is that of the map.

    Raises:
        PathError: the start off the map or not passable.
        RockerbogieError: as `plan`.
    """
    import xarray as xr

    source = _opened(maps)
    problem = _problem(source, rover, keep_out, keep_out_margin, cost, tilt_weight, turn_cost, turn_in_place, backward, slip)
    begin = [int(problem.number[state]) for state in _states(problem.layers, start, "the start")]
    least = np.full(problem.number.shape, np.inf)
    least[problem.number >= 0] = reach_from(problem.costs, begin)
    can = np.isfinite(least)
    share = can.mean(axis=0).astype(np.float32)
    lowest = least.min(axis=0)
    base = source.drop_vars([name for name in source.data_vars if name != "passable"])
    if "passable" in source:
        share[np.isnan(source["passable"].transpose("y", "x").values)] = np.nan
    values = {"reachable": share, "reach_cost": np.where(np.isfinite(lowest), lowest, np.nan)}
    made = {
        name: xr.Variable(("y", "x"), values[name], {"units": layer.units, "long_name": layer.long_name})
        for name, layer in REACH.items()
    }
    about = f"({float(start[0]):.10g}, {float(start[1]):.10g})"
    return base.assign(made).assign_attrs(reached_from=about)


def _problem(
    maps: xr.Dataset | str | FilePath, rover: Rover | None, keep_out: Any, margin: float | None, cost: Any,
    tilt_weight: float, turn_cost: float, turn_in_place: bool | None, backward: bool, slip: SlipCost | None,
) -> _Problem:  # fmt: skip
    """Return the graph of a map's states and the data it was built from; check the arguments."""
    for name, value in (("tilt_weight", tilt_weight), ("turn_cost", turn_cost)):
        if not (np.isfinite(value) and value >= 0):
            raise RockerbogieError(f"{name} is {value}; give a finite number of at least 0")
    source = _opened(maps)
    layers, limit = _layers(source)
    machine, in_place, radius = _turning(rover, layers.rover, turn_in_place)
    if keep_out is not None:
        kept = keep_out_cells(source, keep_out, _radius(machine) if margin is None else margin)
        layers = layers._replace(passable=layers.passable & ~kept)
    elif margin is not None:
        raise RockerbogieError("keep_out_margin needs keep-out areas: give keep_out, too")
    risk = np.where(layers.passable, tilt_weight * (layers.tilt / limit) ** 2, 0.0).astype(np.float32)
    if cost is not None:
        risk = risk + cost_cells(source, cost).astype(np.float32)
    travel = None
    if slip is not None:
        expect(slip, SlipCost, "slip", "make one with rockerbogie.SlipCost(soil)")
        if backward:
            raise RockerbogieError("a plan with slip drives ahead only, because a slope is steeper one way: leave backward out")
        states = slip_states(source, slip)
        layers = layers._replace(passable=layers.passable & states.allowed)
        risk = np.where(layers.passable, risk + states.price - 1.0, 0.0).astype(np.float32)
        travel = states.travel
    ways = moves(layers.heading, layers.cell, in_place, radius, backward)
    costs, number = graph(layers.passable, risk, ways, turn_cost)
    return _Problem(layers, costs, number, machine, travel, ways)


def _radius(rover: Rover | None) -> float:
    """Return the radius of the circle that the wheels stay in, m; 0 if the rover is not known."""
    if rover is None:
        return 0.0
    corner = np.abs(rover.hubs[:, :2]) + np.stack([rover.wheel_radius, rover.wheel_width / 2], axis=1)
    return float(np.hypot(*corner.T).max())


def _goals(goal: Any) -> list[Sequence[float]]:
    """Return the goals as a list, of one or of several."""
    try:
        several = bool(len(goal)) and all(np.ndim(part) == 1 for part in goal)
    except TypeError:
        several = False
    return list(goal) if several else [goal]


def _opened(source: xr.Dataset | str | FilePath) -> xr.Dataset:
    """Return a map in memory or from its file."""
    import xarray as xr

    maps = read_map(source) if isinstance(source, str | FilePath) else source
    if not isinstance(maps, xr.Dataset):
        raise RockerbogieError(
            f"maps is {maps!r:.60}, not a Dataset: give that of rockerbogie.traversability, or a file it was saved to"
        )
    return maps


def _layers(maps: xr.Dataset) -> tuple[_Layers, float]:
    """Return the parts of a map that a plan reads, and the tilt that is a risk of 1, rad."""
    limit = json.loads(maps.attrs.get("limits", "{}")).get("tilt") or USUAL_TILT
    try:
        heading, x, y = (np.asarray(maps[name].values, dtype=float) for name in ("heading", "x", "y"))
        shape = (len(heading), len(y), len(x))
        if "exceeded" in maps and "tilt" in maps:
            passable = maps["exceeded"].transpose("heading", "y", "x").values == 0
            tilt = maps["tilt"].transpose("heading", "y", "x").values
        else:
            passable = np.broadcast_to(maps["passable"].transpose("y", "x").values == 1, shape)
            tilt = np.broadcast_to(maps["worst_tilt"].transpose("y", "x").values, shape)
    except KeyError as error:
        raise RockerbogieError(f"this map has no {error}: give one from rockerbogie.traversability") from None
    if "clearance" in maps:
        clearance = maps["clearance"].transpose("heading", "y", "x").values
    elif "worst_clearance" in maps:
        clearance = np.broadcast_to(maps["worst_clearance"].transpose("y", "x").values, shape)
    else:
        clearance = np.broadcast_to(np.nan, shape)
    passable = passable & np.isfinite(tilt)
    about = (cell_size(maps), crs_of(maps), str(maps.attrs.get("rover", "rover")))
    return _Layers(heading, x, y, passable, tilt, clearance, *about), float(limit)


def _turning(rover: Rover | None, name: str, in_place: bool | None) -> tuple[Rover | None, bool, float]:
    """Return the rover (if known), True if it turns on the spot, and its tightest arc, m."""
    if rover is None:
        try:
            rover = load_rover(name)
        except RoverError:
            if in_place is None:
                raise RockerbogieError(
                    f"the map's rover {name!r} is not a preset, so its way to turn is not known: give rover= or turn_in_place="
                ) from None
    if rover is not None:
        expect(rover, Rover, "rover", LOAD_ROVER)
    in_place = turns_in_place(rover) if in_place is None and rover is not None else bool(in_place)
    return rover, in_place, 0.0 if rover is None or in_place else turning_radius(rover)


def _states(layers: _Layers, place: Sequence[float], name: str) -> list[State]:
    """Return the passable states at a position (x, y) or (x, y, yaw)."""
    try:
        values = [float(v) for v in place]
    except (TypeError, ValueError):
        values = []
    if len(values) not in (2, 3) or not np.isfinite(values).all():
        raise PathError(f"{name} is {place!r}: give (x, y) or (x, y, yaw), finite, in metres and radians")
    x, y = values[:2]
    col, row = int(np.abs(layers.x - x).argmin()), int(np.abs(layers.y - y).argmin())
    reach = (0.5 + 1e-9) * np.array(layers.cell)
    if abs(layers.x[col] - x) > reach[0] or abs(layers.y[row] - y) > reach[1]:
        spans = [f"({axes[0][k]:.10g}, {axes[1][k]:.10g})" for axes in ((layers.x, layers.y),) for k in (0, -1)]
        raise PathError(f"{name} ({x:.10g}, {y:.10g}) m is off the map, whose cells lie from {spans[0]} to {spans[1]} m")
    off = np.abs(wrap_angle(layers.heading - values[2])) if len(values) == 3 else None
    headings = range(len(layers.heading)) if off is None else [int(off.argmin())]
    states = [(k, row, col) for k in headings if layers.passable[k, row, col]]
    if states:
        return states
    facing = "at any heading" if off is None else f"facing {np.degrees(layers.heading[headings[0]]):.4g} deg"
    free = np.any(layers.passable[list(headings)], axis=0)
    if not free.any():
        raise PathError(f"no cell of this map is passable {facing}: see its layer 'exceeded', or widen the limits")
    near = _nearest(layers, free, x, y)
    raise PathError(
        f"{name} ({x:.10g}, {y:.10g}) m is not passable {facing}; "
        f"the nearest passable position is ({near[0]:.10g}, {near[1]:.10g}) m, {near[2]:.4g} m away"
    )


def _nearest(layers: _Layers, free: NDArray[Any], x: float, y: float) -> tuple[float, float, float]:
    """Return the centre of the free cell nearest to a position, and its distance, m."""
    row, col = np.nonzero(free)
    away = np.hypot(layers.x[col] - x, layers.y[row] - y)
    k = int(away.argmin())
    return float(layers.x[col[k]]), float(layers.y[row[k]]), float(away[k])


def _no_way(
    layers: _Layers, number: NDArray[np.int32], seen: NDArray[np.bool_], start: Sequence[float], goal: Sequence[float]
) -> str:
    """Return the message for a goal that cannot be reached."""
    near = _nearest(layers, np.any(seen, axis=0), float(goal[0]), float(goal[1]))
    share = seen.sum() / (number >= 0).sum()
    return (
        f"there is no route from ({start[0]:.10g}, {start[1]:.10g}) to ({goal[0]:.10g}, {goal[1]:.10g}) m within the limits: "
        f"of the passable states {100 * share:.3g} % can be reached; the nearest of them to the goal is at "
        f"({near[0]:.10g}, {near[1]:.10g}) m, {near[2]:.4g} m from it"
    )


def _route_of(problem: _Problem, states: list[State], cost: Array, goal: NDArray[np.int64], speed: float) -> Route:
    """Return the poses of a route; an arc has one more, at its corner, facing halfway."""
    layers = problem.layers
    k, row, col = (np.array(v) for v in zip(*states, strict=True))
    x, y, yaw = layers.x[col], layers.y[row], np.unwrap(layers.heading[k])
    tilt, clearance = (np.asarray(values[k, row, col], dtype=float) for values in (layers.tilt, layers.clearance))
    travel = _travel_of(problem, states)
    poses = [(x[0], y[0], yaw[0], cost[0], tilt[0], clearance[0], goal[0], 1.0)]
    for n in range(1, len(states)):
        moved = np.array([x[n] - x[n - 1], y[n] - y[n - 1]])
        if moved.any() and k[n] != k[n - 1]:
            up, across = _corner(layers, states[n - 1], states[n])
            turning = [k[n - 1], k[n]]
            most, least = np.nanmax(layers.tilt[turning, up, across]), np.fmin.reduce(layers.clearance[turning, up, across])
            middle = ((yaw[n] + yaw[n - 1]) / 2, (cost[n] + cost[n - 1]) / 2)
            poses.append((layers.x[across], layers.y[up], *middle, most, least, goal[n], travel[n - 1]))
        poses.append((x[n], y[n], yaw[n], cost[n], tilt[n], clearance[n], goal[n], travel[n - 1]))
    px, py, facing, price, tilts, room, leads_to, stretch = np.array(poses, dtype=float).T
    steps = np.hypot(np.diff(px), np.diff(py))
    rolled = steps * stretch[1:]  # wheel travel
    distance = np.concatenate([[0.0], np.cumsum(steps)])
    # a turn on the spot takes as long as the outermost wheel needs at this speed
    spent = np.where(steps > 0, rolled, np.abs(np.diff(facing)) * (_radius(problem.rover) or 1.0)) / speed
    time = np.concatenate([[0.0], np.cumsum(spent)])
    about = (layers.crs, layers.rover)
    return Route(px, py, facing, distance, price, tilts, *about, room, time, leads_to.astype(np.int64))


def _travel_of(problem: _Problem, states: list[State]) -> list[float]:
    """Return the wheel travel per metre of each move of a route: the mean over its states."""
    if problem.travel is None:
        return [1.0] * (len(states) - 1)
    travel = []
    for (k, row, col), (then, up, across) in pairwise(states):
        way = next(move.way for move in problem.ways[k] if move.end == (then, across - col, up - row))
        travel.append(float(np.mean([problem.travel[h, row + north, col + east] for h, east, north in way])))
    return travel


def _corner(layers: _Layers, left: State, reached: State) -> tuple[int, int]:
    """Return the row and column where the two legs of an arc meet."""
    steps = grid_steps(layers.heading, layers.cell)
    a, b = np.array(steps[left[0]]), np.array(steps[reached[0]])
    total = np.array([reached[2] - left[2], reached[1] - left[1]])
    count = round(float(total @ (a + b)) / float((a + b) @ (a + b)))  # of steps on each leg, below 0 backwards
    return left[1] + count * int(a[1]), left[2] + count * int(a[0])
