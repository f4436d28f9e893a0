"""Routes: against a search written from the definition, exact maps, and `drive`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.maps.moves import grid_steps, swept, turning_radius, turns_in_place
from rockerbogie.motion.path_files import read_route
from support.helpers import assert_close
from support.map_cases import drawn_map, map_of

#: The steps as the documentation lists them: a rook's, a king's, a king's and a knight's.
ROOK = [(1, 0), (0, 1), (-1, 0), (0, -1)]
KING = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
KNIGHT = [(2, 1), (1, 2), (-1, 2), (-2, 1), (-2, -1), (-1, -2), (1, -2), (2, -1)]
STEPS = {4: ROOK, 8: KING, 16: [s for pair in zip(KING, KNIGHT, strict=True) for s in pair]}
State = tuple[int, int, int]  # heading, row, column


@lru_cache
def run_through(step: tuple[int, int]) -> tuple[tuple[int, int], ...]:
    """Return the cells (row, column) under a straight line from cell (0, 0), by sampling.

    Cells that it touches at a corner do not count.
    """
    share = (np.arange(1000) + 0.5) / 1000
    cells = np.floor(np.stack([step[1] * share, step[0] * share], axis=-1) + 0.5).astype(int)
    return tuple((int(r), int(c)) for r, c in np.unique(cells, axis=0))


def ways_out(maps: xr.Dataset, state: State, in_place: bool, radius: float, backward: bool) -> Iterator[tuple[State, float]]:
    """Yield every move from a state with its cost, by the documentation, all weights 1."""
    exceeded, tilt = maps["exceeded"].values, maps["tilt"].values
    headings, rows, cols = exceeded.shape
    steps, dx = STEPS[headings], float(maps.attrs["resolution"])
    k, row, col = state

    def cost(places: set[State], length: float, turn: float) -> float | None:
        for h, r, c in places:
            if not (0 <= r < rows and 0 <= c < cols) or exceeded[h, r, c] or np.isnan(tilt[h, r, c]):
                return None
        return length * (1 + np.mean([(tilt[p] / 0.5) ** 2 for p in places])) + turn

    def leg(h: int, r: int, c: int, times: int) -> tuple[set[State], int, int, float]:
        a, b = steps[h]
        seen: set[State] = set()
        for _ in range(abs(times)):
            sign = 1 if times > 0 else -1
            seen |= {(h, r + down, c + right) for down, right in run_through((sign * a, sign * b))}
            r, c = r + sign * b, c + sign * a
        return seen, r, c, abs(times) * dx * math.hypot(a, b)

    signs = (1, -1) if backward else (1,)
    found: list[tuple[State, float | None]] = []
    for sign in signs:
        seen, r, c, length = leg(k, row, col, sign)
        found.append(((k, r, c), cost(seen, length, 0.0)))
    for other in ((k + 1) % headings, (k - 1) % headings):
        turn = 2 * math.pi / headings
        if in_place:
            found.append(((other, row, col), cost({state, (other, row, col)}, 0.0, turn)))
            continue
        shorter = min(dx * math.hypot(*steps[k]), dx * math.hypot(*steps[other]))
        count = next(n for n in range(1, 99) if n * shorter / math.tan(turn / 2) >= radius)
        for sign in signs:
            first, r, c, before = leg(k, row, col, sign * count)
            then, r, c, after = leg(other, r, c, sign * count)
            found.append(((other, r, c), cost(first | then, before + after, turn)))
    for end, price in found:
        if price is not None:
            yield end, price


def least_costs(maps: xr.Dataset, start: tuple[int, int], in_place: bool, radius: float, backward: bool) -> dict[State, float]:
    """Return the least cost to every state from a cell, by relaxation until nothing changes."""
    free = (maps["exceeded"].values == 0) & np.isfinite(maps["tilt"].values)
    out = {tuple(map(int, s)): list(ways_out(maps, tuple(map(int, s)), in_place, radius, backward)) for s in np.argwhere(free)}
    costs = {s: 0.0 for s in out if s[1:] == start}
    changed = True
    while changed:
        changed = False
        for state in list(costs):
            for end, price in out[state]:
                if costs[state] + price < costs.get(end, math.inf) - 1e-12:
                    costs[end] = costs[state] + price
                    changed = True
    return costs


def place(maps: xr.Dataset, row: int, col: int) -> tuple[float, float]:
    return float(maps["x"][col]), float(maps["y"][row])


@pytest.mark.parametrize("turning", ["on the spot", "on arcs", "on wide arcs"])
@pytest.mark.parametrize("headings", [4, 8, 16])
def test_least_cost_is_that_of_the_definition(headings: int, turning: str, monkeypatch: pytest.MonkeyPatch) -> None:
    in_place = turning == "on the spot"
    # as wide as one step along the shortest heading has room for, or just wider: two steps there
    radius = {"on arcs": 0.1, "on wide arcs": 0.51 / math.tan(math.pi / headings)}.get(turning, 0.0)
    monkeypatch.setattr("rockerbogie.maps.plan.turning_radius", lambda rover: radius)
    rover = rb.load_rover("curiosity") if in_place else rb.load_rover("elhami-dashti")
    reached = refused = 0
    for seed in range(8):
        rng = np.random.default_rng([seed, headings, len(turning)])
        maps = drawn_map(rng, headings, int(rng.integers(4, 8)), int(rng.integers(4, 8)), blocked=rng.choice([0.05, 0.15, 0.4]))
        backward = bool(rng.integers(2))
        free = np.argwhere((maps["exceeded"].values == 0).any(axis=0) & np.isfinite(maps["worst_tilt"].values))
        start, *goals = (tuple(map(int, free[k])) for k in rng.choice(len(free), 6, replace=False))
        costs = least_costs(maps, start, in_place, radius, backward)
        for goal in goals:
            expected = min((c for s, c in costs.items() if s[1:] == goal), default=math.inf)
            call = {"rover": rover, "backward": backward}
            if math.isinf(expected):
                refused += 1
                with pytest.raises(rb.PathError, match="no route from"):
                    rb.plan(maps, place(maps, *start), place(maps, *goal), **call)
                continue
            reached += 1
            plan = rb.plan(maps, place(maps, *start), place(maps, *goal), **call)
            assert_close(plan.cost[-1], expected, 2e-6 * max(1, expected), "m", "the risk is kept in single precision")
            assert (plan.x[0], plan.y[0]) == place(maps, *start)
            assert (plan.x[-1], plan.y[-1]) == place(maps, *goal)
            is_a_way(maps, plan, in_place, radius, backward)
    assert reached >= 15, "the maps drawn must have ways to find"
    assert refused >= 2, "and places that cannot be reached"


def is_a_way(maps: xr.Dataset, plan: rb.Plan, in_place: bool, radius: float, backward: bool) -> None:
    """Each pose follows from the one before by a move of the definition, at its cost."""
    headings = maps.sizes["heading"]
    k = np.round(plan.yaw * headings / (2 * np.pi), 6)
    kept = k == np.round(k)  # the corner of an arc faces halfway
    rows = np.round((plan.y - float(maps["y"][0])) / 0.5).astype(int)
    cols = np.round((plan.x - float(maps["x"][0])) / 0.5).astype(int)
    states = [(int(h) % headings, int(r), int(c)) for h, r, c, on in zip(k, rows, cols, kept, strict=True) if on]
    assert kept.all() or not in_place
    cost = plan.cost[kept]
    for n, (here, there) in enumerate(pairwise(states)):
        offered = dict(ways_out(maps, here, in_place, radius, backward))
        assert there in offered
        assert_close(cost[n + 1] - cost[n], offered[there], 1e-5, "m", "a move's cost")
        assert_close(plan.tilt[kept][n], maps["tilt"].values[here], 0, "rad", "the map's own tilt")


def test_steps_of_the_headings_are_the_documented_ones() -> None:
    for count, steps in STEPS.items():
        assert grid_steps(2 * np.pi * np.arange(count) / count) == steps
    for count in (3, 5, 12, 32, 64):
        steps = grid_steps(2 * np.pi * np.arange(count) / count)
        assert len(set(steps)) == count
        off = np.angle(np.exp(1j * (np.arctan2(*np.array(steps).T[::-1]) - 2 * np.pi * np.arange(count) / count)))
        assert np.abs(off).max() < np.pi / count


@pytest.mark.parametrize("step", [(1, 0), (1, 1), (2, 1), (-1, 2), (3, 2), (-4, -1), (3, -5)])
def test_swept_cells_are_those_under_the_line(step: tuple[int, int]) -> None:
    cells = swept(step)
    assert {(row, col) for col, row in cells} == set(run_through(step))
    assert (cells[0], cells[-1]) == ((0, 0), step)


def test_rovers_with_four_steered_corners_turn_on_the_spot() -> None:
    assert [turns_in_place(rb.load_rover(name)) for name in ("curiosity", "perseverance", "sawppy", "osr")] == [True] * 4
    assert not turns_in_place(rb.load_rover("rocky7"))
    rover = rb.load_rover("elhami-dashti")
    assert 0.5 * rover.wheelbase < turning_radius(rover) < 2 * rover.wheelbase


def empty(headings: int = 16, rows: int = 21, cols: int = 21) -> xr.Dataset:
    """A map of level ground, all of it passable."""
    shape = (headings, rows, cols)
    return map_of(np.zeros(shape, np.uint8), np.zeros(shape), np.zeros(shape[1:], bool), np.random.default_rng(0))


def test_a_route_on_level_terrain_is_straight() -> None:
    maps = empty()
    plan = rb.plan(maps, (*place(maps, 2, 1), 0.0), (*place(maps, 2, 19), 0.0))
    assert_close(plan.cost[-1], 9.0, 1e-9, "m", "18 cells of half a metre, no risk, no turn")
    assert_close(plan.yaw, 0.0, 0, "rad", "straight on")
    knight = rb.plan(maps, (*place(maps, 1, 1), np.pi / 8), place(maps, 9, 17))
    assert_close(knight.distance[-1], 8 * 0.5 * math.sqrt(5), 1e-9, "m", "eight knight's steps")


def test_a_turn_costs_turn_cost_per_radian() -> None:
    maps = empty()
    about = rb.plan(maps, (*place(maps, 5, 5), 0.0), (*place(maps, 5, 5), np.pi), turn_cost=0.25)
    assert_close(about.cost[-1], 0.25 * np.pi, 1e-12, "m", "half a turn")
    assert about.distance[-1] == 0
    assert_close(np.abs(np.diff(about.yaw)), np.pi / 8, 1e-12, "rad", "heading by heading")
    with pytest.raises(rb.PathError, match="there is no path to drive"):
        _ = about.path
    free = rb.plan(maps, (*place(maps, 5, 5), 0.0), (*place(maps, 5, 5), np.pi), turn_cost=0.0)
    assert free.cost[-1] == 0


def test_a_route_uses_the_gap_in_a_wall_and_avoids_tilt() -> None:
    maps = empty()
    maps["exceeded"][:, :, 10] = 4
    maps["exceeded"][:, 15, 10] = 0
    plan = rb.plan(maps, place(maps, 2, 2), place(maps, 2, 18))
    through = np.flatnonzero(np.isclose(plan.x, float(maps["x"][10])))
    assert_close(plan.y[through], float(maps["y"][15]), 1e-9, "m", "the only gap")
    steep = empty()
    steep["tilt"][:, :8, 10] = 0.45
    straight, around = (rb.plan(steep, place(steep, 2, 2), place(steep, 2, 18), tilt_weight=w) for w in (0.0, 50.0))
    assert straight.distance[-1] < around.distance[-1]
    assert straight.tilt.max() == 0.45
    assert around.tilt.max() == 0


def test_a_knight_s_step_needs_the_cells_it_crosses() -> None:
    maps = empty(rows=2, cols=3)
    call = ((*place(maps, 0, 0), np.pi / 8), (*place(maps, 1, 2), np.pi / 8))
    assert len(rb.plan(maps, *call).x) == 2
    maps["exceeded"][1, 0, 1] = 4  # at that heading alone
    detour = rb.plan(maps, *call)
    assert len(detour.x) > 2


def test_impossible_start_and_goal_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    maps = empty()
    maps["exceeded"][:, 4:7, 4:7] = 1
    inside, outside = place(maps, 5, 5), place(maps, 15, 15)
    nearest = "({:g}, {:g}) m, 1 m away".format(*place(maps, 3, 5))
    with pytest.raises(rb.PathError, match="the start .* is not passable") as error:
        rb.plan(maps, inside, outside)
    assert nearest in str(error.value) or "1 m away" in str(error.value)
    with pytest.raises(rb.PathError, match="the goal .* is off the map"):
        rb.plan(maps, outside, (0.0, 0.0))
    with pytest.raises(rb.PathError, match=r"start is .*give \(x, y\)"):
        rb.plan(maps, (1.0,), outside)
    with pytest.raises(rb.PathError, match="start is .*finite"):
        rb.plan(maps, (np.nan, 1.0), outside)
    walled = empty()
    walled["exceeded"][:, :, 10] = 1
    with pytest.raises(rb.PathError, match="no route from") as error:
        rb.plan(walled, place(walled, 3, 3), place(walled, 3, 14))
    assert "({:g}, {:g}) m, 2.5 m from it".format(*place(walled, 3, 9)) in str(error.value)
    nowhere = empty()
    nowhere["exceeded"][:] = 1
    with pytest.raises(rb.PathError, match="no cell of this map is passable"):
        rb.plan(nowhere, inside, outside)
    with pytest.raises(rb.RockerbogieError, match="tilt_weight is -1"):
        rb.plan(maps, outside, outside, tilt_weight=-1)
    with pytest.raises(rb.RockerbogieError, match="is not a preset"):
        rb.plan(maps.assign_attrs(rover="mine"), outside, place(maps, 2, 2))
    assert rb.plan(maps.assign_attrs(rover="mine"), outside, place(maps, 2, 2), turn_in_place=True).cost[-1] > 0
    with pytest.raises(rb.RockerbogieError, match="maps is .*traversability"):
        rb.plan(5, outside, inside)  # type: ignore[arg-type]


def test_routes_on_summary_layers_use_passable_cells_and_the_worst_tilt() -> None:
    maps = drawn_map(np.random.default_rng(3), 8, 12, 12, blocked=0.01)
    whole = maps["passable"].values == 1
    summaries = maps.drop_vars([name for name in maps.data_vars if "heading" in maps[name].dims])
    ends = np.argwhere(whole)[[0, -1]]
    plan = rb.plan(summaries, *(place(maps, *map(int, e)) for e in ends))
    for x, y, tilt in zip(plan.x, plan.y, plan.tilt, strict=True):
        cell = maps.sel(x=x, y=y)
        assert float(cell["passable"]) == 1
        assert tilt == float(cell["worst_tilt"])


@pytest.fixture(scope="module")
def hills() -> tuple[rb.Rover, rb.Terrain, xr.Dataset]:
    """Curiosity on made-up hills, tilt the only limit."""
    rover, ground = rb.load_rover("curiosity"), rb.surfaces.mars(seed=3, size=36.0)
    layers = ("tilt", "exceeded", "passable")
    limits = rb.Limits(tilt=np.radians(10))
    maps = rb.traversability(rover, ground, 16, 1.0, limits, bounds=(-13.2, -13.2, 13.2, 13.2), layers=layers)
    assert 0.5 < float(maps["passable"].mean()) < 0.95, "something to drive around"
    return rover, ground, maps


def test_drive_along_a_route_has_the_tilts_of_the_map(hills: tuple[rb.Rover, rb.Terrain, xr.Dataset], tmp_path: Path) -> None:
    rover, ground, maps = hills
    free = np.argwhere(maps["exceeded"].values.max(axis=0) == 0)
    start, goal = (place(maps, *map(int, free[k])) for k in (0, -1))
    plan = rb.plan(maps, (*start, 0.0), (*goal, np.pi / 2), rover=rover)
    turns = np.flatnonzero(np.diff(plan.distance) == 0)
    assert turns.size, "the way must turn on the spot for this to show much"
    path = plan.path
    assert_close(path.length, plan.distance[-1], 1e-9, "m", "turns are spread over the way, not added to it")
    run = rb.drive(rover, ground, path, speed=0.04, step=0.05)
    assert (run["status"].values == rb.Status.CONVERGED).mean() > 0.99
    still = np.flatnonzero((np.diff(plan.distance, append=np.inf) > 0) & (np.diff(plan.distance, prepend=-np.inf) > 0))
    at = path.sample(plan.distance[still])
    assert_close(at.x, plan.x[still], 1e-9, "m", "the path goes through the cells")
    assert_close(np.angle(np.exp(1j * (at.yaw - plan.yaw[still]))), 0.0, 1e-9, "rad", "faced as on the map")
    pose = rb.settle(rover, ground, at.x, at.y, at.yaw)
    assert_close(pose.tilt, plan.tilt[still], 1e-6, "rad", "the map's pose at each cell the rover does not turn in")
    plan.to_csv(tmp_path / "route.csv")
    again = read_route(tmp_path / "route.csv")
    assert_close(again.x, path.x, 1e-9, "m", "the file holds the path")
    assert_close(again.yaw - again.yaw[0], path.yaw - path.yaw[0], 1e-9, "rad", "and its headings")


def test_an_arc_only_rover_never_turns_on_the_spot() -> None:
    rover = rb.load_rover("rocky7")
    maps = empty(rows=41, cols=41)
    plan = rb.plan(maps, (*place(maps, 20, 20), 0.0), (*place(maps, 20, 20), np.pi), rover=rover)
    assert (np.diff(plan.distance) > 0).all()
    path = plan.path
    step = np.abs(path.sample(np.linspace(0, path.length, 500)).curvature)
    assert step.max() < 1 / turning_radius(rover)
    run = rb.drive(rover, rb.surfaces.plane(size=60.0), rb.Path.from_arrays(path.x - path.x[0], path.y - path.y[0], path.yaw))
    assert (run["status"].values == rb.Status.CONVERGED).all()


def test_paths_from_csv(tmp_path: Path) -> None:
    file = tmp_path / "way.csv"
    file.write_text("x,y\n0,0\n5,0\n5,5\n")
    assert_close(read_route(file, radius=1.0).length, 8 + np.pi / 2, 1e-12, "m", "waypoints, their corner rounded")
    file.write_text("x [m],y [m],yaw [deg]\n0,0,0\n0,0,90\n0,5,90\n")
    path = read_route(file)
    assert_close(path.sample([0.0, 0.5, 5.0]).yaw, np.radians([0, 90, 90]), 1e-12, "rad", "turned in the first tenth")
    file.write_text("east,north\n0,0\n1,1\n")
    with pytest.raises(rb.PathError, match=r"way.csv has no column 'x'; it has east, north"):
        read_route(file)
    with pytest.raises(rb.RockerbogieError, match="no path at"):
        read_route(tmp_path / "none.csv")


def test_the_same_call_gives_the_same_route() -> None:
    maps = empty()
    a, b = (rb.plan(maps, place(maps, 0, 0), place(maps, 20, 13)) for _ in range(2))
    assert (a.x == b.x).all()
    assert (a.yaw == b.yaw).all()


def test_a_route_over_a_real_terrain_model(data: Callable[[str], Path]) -> None:
    """Gale at 1 m: 1.9 million states; slopes stand for tilt, exact maps have their own test."""
    terrain = rb.Terrain.from_raster(data("gale/missionDEM.tif"))
    slope = np.arctan(np.linalg.norm(terrain.gradient(*np.meshgrid(terrain.x, terrain.y)), axis=-1))
    shape = (16, *slope.shape)
    steep = np.nan_to_num(slope, nan=1.0) > np.radians(14)
    maps = map_of(
        np.where(steep, 4, 0) * np.ones(shape, np.uint8), slope * np.ones(shape), np.isnan(slope), np.random.default_rng(0)
    )
    maps = maps.assign_coords(x=terrain.x, y=terrain.y).assign_attrs(resolution=1.0)
    free = np.argwhere(~steep)
    plan = rb.plan(maps, place(maps, *map(int, free[0])), place(maps, *map(int, free[-1])))
    assert np.nanmax(plan.tilt) <= np.radians(14)
    assert plan.distance[-1] > 300
