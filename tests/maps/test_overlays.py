"""Keep-out areas, costs, goals, reachability, GeoPackages and resampled maps."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from test_plan import empty, place

import rockerbogie as rb
from rockerbogie.motion.path_files import read_route
from support.helpers import assert_close
from support.map_cases import drawn_map

pyogrio = pytest.importorskip("pyogrio", reason="needs the geo extra")
rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")
shapely = pytest.importorskip("shapely", reason="needs the geo extra")

WALL = shapely.box(1004.6, 2000.1, 1005.4, 2007.9)  # of the empty map's 1000 to 1010.5 and 2000 to 2010.5 m


def write_vector(file: Path, shapes: list[object], crs: str | None = "EPSG:32633", **columns: list[object]) -> Path:
    """A vector file as GIS programs write it."""
    kinds = {shape.geom_type for shape in shapes}  # type: ignore[attr-defined]
    arrays = [np.array(values, dtype=object if isinstance(values[0], str) else None) for values in columns.values()]
    pyogrio.raw.write(
        file, shapely.to_wkb(np.array(shapes, dtype=object)), arrays, list(columns), crs=crs,
        geometry_type=kinds.pop() if len(kinds) == 1 else "Unknown",
    )  # fmt: skip
    return file


def length_away(route: rb.Route, shape: object) -> float:
    """The least distance of a route's line from a shape, m."""
    return float(shapely.LineString(np.stack([route.x, route.y], axis=1)).distance(shape))


@pytest.mark.parametrize("ending", ["gpkg", "geojson", "shp", "fgb"])
@pytest.mark.parametrize("margin", [0.0, 0.6])
def test_a_route_avoids_keep_out_areas(ending: str, margin: float, tmp_path: Path) -> None:
    maps = empty()
    start, goal = place(maps, 2, 2), place(maps, 2, 18)
    file = write_vector(tmp_path / f"wall.{ending}", [WALL])
    free = rb.plan(maps, start, goal)
    around = rb.plan(maps, start, goal, keep_out=file, keep_out_margin=margin)
    assert length_away(free, WALL) == 0
    assert length_away(around, WALL) > margin - 0.36, "a leg may pass nearer than its cells' centres, by half a diagonal"
    assert shapely.points(around.x, around.y)[0].distance(WALL) > margin
    assert min(point.distance(WALL) for point in shapely.points(around.x, around.y)) > margin
    walled = maps.copy(deep=True)
    centre = shapely.points(*np.meshgrid(maps["x"].values, maps["y"].values))
    touched = shapely.intersects(shapely.box(*[f(centre) + s for f, s in
        ((shapely.get_x, -0.25), (shapely.get_y, -0.25), (shapely.get_x, 0.25), (shapely.get_y, 0.25))]), WALL)  # fmt: skip
    if margin:
        spots = np.stack(np.meshgrid(maps["x"].values, maps["y"].values), axis=-1)
        near = np.linalg.norm(spots[:, :, None] - spots[touched][None, None], axis=-1).min(axis=-1) <= margin + 0.25 * np.sqrt(2)
        touched = touched | near
    walled["exceeded"][:] = np.where(touched, 4, walled["exceeded"])
    assert_close(around.cost[-1], rb.plan(walled, start, goal).cost[-1], 1e-9, "m", "as if those cells were beyond a limit")


def test_the_usual_margin_is_the_rover_s_radius(tmp_path: Path) -> None:
    maps, rover = empty(), rb.load_rover("osr")
    file = write_vector(tmp_path / "wall.gpkg", [WALL])
    route = rb.plan(maps, place(maps, 2, 2), place(maps, 2, 18), rover=rover, keep_out=file)
    reach = np.hypot(np.abs(rover.hubs[:, 0]) + rover.wheel_radius, np.abs(rover.hubs[:, 1]) + rover.wheel_width / 2).max()
    assert min(point.distance(WALL) for point in shapely.points(route.x, route.y)) > reach - 0.36


def test_a_layer_in_another_crs_is_transformed(tmp_path: Path) -> None:
    """The wall in UTM 33 and in longitude and latitude, by pyproj, keeps out of the same cells."""
    from pyproj import Transformer

    to_degrees = Transformer.from_crs(32633, 4326, always_xy=True)
    far = empty().assign_coords(x=empty()["x"] + 4e5, y=empty()["y"] + 5e6)
    wall = shapely.segmentize(shapely.transform(WALL, lambda p: p + (4e5, 5e6)), 0.1)
    degrees = shapely.transform(wall, lambda p: np.stack(to_degrees.transform(p[:, 0], p[:, 1]), axis=1))
    ends = (place(far, 2, 2), place(far, 2, 18))
    call = {"keep_out_margin": 0.0}
    metres = rb.plan(far, *ends, keep_out=write_vector(tmp_path / "a.gpkg", [wall]), **call)
    moved = rb.plan(far, *ends, keep_out=write_vector(tmp_path / "b.geojson", [degrees], "EPSG:4326"), **call)
    np.testing.assert_array_equal(metres.x, moved.x)
    assert length_away(metres, wall) > 0


def raster(file: Path, values: np.ndarray, cell: float, crs: str | None = "EPSG:32633", nodata: float | None = None) -> Path:
    """A GeoTIFF (rows from the north) whose south-west corner is that of the empty map."""
    rows, cols = values.shape
    transform = rasterio.Affine(cell, 0, 1000.0, 0, -cell, 2000.0 + rows * cell)
    profile = {"driver": "GTiff", "height": rows, "width": cols, "count": 1, "dtype": "float32", "nodata": nodata}
    with rasterio.open(file, "w", **profile, transform=transform, crs=crs) as out:
        out.write(values[::-1].astype("float32"), 1)
    return file


@pytest.mark.parametrize("cell", [0.1, 0.5, 1.0])
def test_a_route_avoids_a_keep_out_raster(cell: float, tmp_path: Path) -> None:
    maps, n = empty(), round(10.5 / cell)
    at = (np.arange(n) + 0.5) * cell
    x, y = np.meshgrid(at, at)
    values = np.where((x > 4) & (x < 5) & (y < 8), 1.0, 0.0)
    values[:2, :2] = -9999
    file = raster(tmp_path / "wall.tif", values, cell, nodata=-9999)
    route = rb.plan(maps, place(maps, 2, 2), place(maps, 2, 18), keep_out=file, keep_out_margin=0.0)
    inside = (route.x > 1004) & (route.x < 1005) & (route.y < 2008)
    assert not inside.any()
    assert route.y.max() > 2008


def test_costs_are_added_per_metre(tmp_path: Path) -> None:
    maps = empty()
    ends = ((*place(maps, 2, 1), 0.0), (*place(maps, 2, 19), 0.0))
    price = np.full((21, 21), 0.5)
    assert_close(rb.plan(maps, *ends, cost=price).cost[-1], 9.0 * 1.5, 1e-6, "m", "half as much again everywhere")
    assert_close(rb.plan(maps, *ends, cost=raster(tmp_path / "c.tif", price, 0.5)).cost[-1], 13.5, 1e-6, "m", "from a raster")
    band = [shapely.box(1004.0, 1990, 1006.0, 2100), shapely.box(1004.0, 1990, 1006.0, 2100)]
    file = write_vector(tmp_path / "c.gpkg", band, cost=[3.0, 1.0])
    found = rb.plan(maps, *ends, cost=file)
    assert_close(found.cost[-1], 9.0 + 3.0 * 2.0, 0.8, "m", "2 m and the legs across its edges, at the greater cost")
    ridge = write_vector(tmp_path / "d.gpkg", [shapely.box(1004.0, 1990, 1006.0, 2008)], cost=[50.0])
    assert rb.plan(maps, *ends, cost=ridge).y.max() > 2008, "around what is dear"


def test_several_goals_in_order_have_the_least_total_cost() -> None:
    """The least over all headings at the goal between, each found by plans to it and from it."""
    rng = np.random.default_rng(4)
    for _ in range(6):
        maps = drawn_map(rng, 8, 9, 9, 0.15)
        free = np.argwhere((maps["exceeded"].values == 0).any(axis=0))
        cells = free[rng.choice(len(free), 3, replace=False)]
        start, via, goal = (place(maps, *cell) for cell in cells)
        best = np.inf
        for k in np.flatnonzero(maps["exceeded"].values[:, cells[1][0], cells[1][1]] == 0):
            middle = (*via, float(maps["heading"][k]))
            try:
                best = min(best, rb.plan(maps, start, middle).cost[-1] + rb.plan(maps, middle, goal).cost[-1])
            except rb.PathError:
                continue
        if np.isinf(best):
            with pytest.raises(rb.PathError, match="there is no route"):
                rb.plan(maps, start, [via, goal])
            continue
        route = rb.plan(maps, start, [via, goal])
        assert_close(route.cost[-1], best, 1e-9, "m", "the least sum")
        assert (np.diff(route.cost) >= -1e-12).all()
        last = np.flatnonzero(route.goal == 1)[-1]
        assert_close([route.x[last], route.y[last]], via, 1e-9, "m", "the goal between is reached")
        assert_close([route.x[-1], route.y[-1]], goal, 1e-9, "m", "and the last")


def test_reachable_cells_are_those_with_a_route() -> None:
    rng = np.random.default_rng(9)
    maps = drawn_map(rng, 8, 8, 9, 0.45)
    free = np.argwhere((maps["exceeded"].values == 0).any(axis=0))
    start = place(maps, *free[len(free) // 2])
    found = rb.reachability(maps, start)
    assert set(found.data_vars) == {"passable", "reachable", "reach_cost"}
    for row, col in np.ndindex(8, 9):
        try:
            cost = rb.plan(maps, start, place(maps, row, col)).cost[-1]
        except rb.PathError:
            cost = np.nan
        assert_close(found["reach_cost"].values[row, col], cost, 1e-9, "m", "of the plan there")
    share = found["reachable"].values
    assert ((share > 0) == np.isfinite(found["reach_cost"].values))[np.isfinite(share)].all()
    assert 0 < (share > 0).sum() < (share == 0).sum() + (share > 0).sum()


@pytest.mark.parametrize("ending", ["tif", "nc", "zarr"])
def test_reachability_is_written_and_read_as_a_map(ending: str, tmp_path: Path) -> None:
    if ending == "zarr":
        pytest.importorskip("zarr")
    maps = drawn_map(np.random.default_rng(9), 8, 8, 9, 0.2)
    free = np.argwhere((maps["exceeded"].values == 0).any(axis=0))
    found = rb.reachability(maps, place(maps, *free[0]))
    back = rb.read_map(rb.write_map(found, tmp_path / f"reach.{ending}"))
    assert_close(back["reach_cost"], found["reach_cost"], 1e-5, "m", "single precision in a GeoTIFF")
    assert_close(back["reachable"], found["reachable"], 1e-7, "1", "single precision in a GeoTIFF")


def table(file: Path, name: str) -> list[dict[str, object]]:
    """A layer of a GeoPackage, which is an SQLite file, by Python's own library."""
    with sqlite3.connect(file) as base:
        base.row_factory = sqlite3.Row
        return [dict(row) for row in base.execute(f"SELECT * FROM {name} ORDER BY fid")]


def test_a_geopackage_holds_the_legs_with_their_attributes(tmp_path: Path) -> None:
    maps = empty()
    maps["tilt"][:, :, 10:] = 0.2
    maps["clearance"][:] = 0.4
    maps["clearance"][:, :, 15] = 0.1
    start, via, goal = (*place(maps, 2, 2), 0.0), place(maps, 2, 12), place(maps, 12, 18)
    route = rb.plan(maps, start, [via, goal], speed=0.02)
    file = tmp_path / "route.gpkg"
    route.to_geopackage(file)
    with sqlite3.connect(file) as base:
        assert {row[0] for row in base.execute("SELECT organization_coordsys_id FROM gpkg_spatial_ref_sys "
                "JOIN gpkg_contents USING (srs_id)")} == {32633}  # fmt: skip
        assert {row[0] for row in base.execute("SELECT table_name FROM gpkg_contents")} == {"route", "legs", "poses"}
    whole, legs, poses = (table(file, name) for name in ("route", "legs", "poses"))
    assert [row["goal"] for row in whole] == [1, 2]
    for rows in (whole, legs):
        assert_close(sum(row["length_m"] for row in rows), route.distance[-1], 1e-9, "m", "all of the route")
        assert_close(min(row["clearance_min_m"] for row in rows), 0.1, 1e-12, "m", "the least on it")
        assert_close(max(row["tilt_max_deg"] for row in rows), np.degrees(0.2), 1e-9, "deg", "the greatest on it")
    assert whole[0]["tilt_max_deg"] == whole[1]["tilt_max_deg"]
    assert_close(whole[0]["clearance_min_m"], 0.4, 1e-12, "m", "before the place of little clearance")
    assert_close(sum(row["time_s"] for row in whole), route.time[-1], 1e-9, "s", "all of the route")
    moving = float(route.distance[-1]) / 0.02
    assert route.time[-1] > moving
    assert_close(sum(row["time_s"] for row in legs), moving, 1e-6, "s", "straight at 2 cm/s; the rest is turning")
    assert len(poses) == len(route.x)
    for name in ("x", "y", "yaw", "distance", "cost", "tilt", "clearance", "time", "goal"):
        assert_close([row[name] for row in poses], getattr(route, name), 0, "SI", f"{name} as it was")
    features = pyogrio.raw.read(file, layer="legs")
    assert {shape.geom_type for shape in shapely.from_wkb(features[2])} == {"LineString"}
    assert_close(shapely.length(shapely.from_wkb(features[2])), [row["length_m"] for row in legs], 1e-9, "m", "as drawn")


def test_a_route_is_read_back_as_the_same_path(tmp_path: Path) -> None:
    maps = empty()
    route = rb.plan(maps, (*place(maps, 2, 2), 1.0), [place(maps, 9, 12), place(maps, 12, 3)])
    s = np.linspace(0, route.path.length, 200)
    for name, write in (("r.gpkg", route.to_geopackage), ("r.csv", route.to_csv)):
        write(tmp_path / name)
        back = read_route(tmp_path / name)
        for field in ("x", "y", "yaw"):
            tolerance = 0 if name.endswith("gpkg") else 1e-8
            assert_close(getattr(back.sample(s), field), getattr(route.path.sample(s), field), tolerance, "m", name)


def test_foreign_lines_and_points_are_read_as_waypoints(tmp_path: Path) -> None:
    corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)]
    expected = rb.Path.waypoints(corners, 0.5)
    line = write_vector(tmp_path / "line.gpkg", [shapely.LineString(corners)])
    dots = write_vector(tmp_path / "dots.shp", [shapely.Point(p) for p in corners], order=[1, 2, 3])
    for file in (line, dots):
        assert read_route(file, 0.5).length == expected.length
    area = write_vector(tmp_path / "area.gpkg", [WALL])
    with pytest.raises(rb.PathError, match="holds Polygon: a path is made of lines or points"):
        read_route(area)
    degrees = write_vector(tmp_path / "degrees.gpkg", [shapely.LineString([(10, 50), (11, 51)])], "EPSG:4326")
    with pytest.raises(rb.PathError, match="longitude and latitude"):
        read_route(degrees)


def test_geojson_reports_a_crs_that_it_cannot_hold(tmp_path: Path) -> None:
    route = rb.plan(empty(), place(empty(), 2, 2), place(empty(), 2, 6))
    with pytest.warns(UserWarning, match=r"WGS84 .* in EPSG:32633: only GDAL and QGIS read that CRS; a GeoPackage"):
        route.to_geojson(tmp_path / "a.geojson")
    bare = json.loads((tmp_path / "a.geojson").read_text())  # metres that name no CRS, as many programs write them
    del bare["crs"]
    (tmp_path / "b.geojson").write_text(json.dumps(bare))
    with pytest.raises(rb.RockerbogieError, match="save it as GeoPackage"):
        rb.plan(empty(), place(empty(), 2, 2), place(empty(), 2, 6), keep_out=tmp_path / "b.geojson")


BAD = {
    "no file": ({"keep_out": "none.gpkg"}, "no file 'none.gpkg'"),
    "no vector": ({"keep_out": "text.gpkg"}, "not a vector file that GDAL can read"),
    "no raster": ({"keep_out": "text.tif"}, "neither a vector nor a raster that GDAL can read"),
    "no cost": ({"cost": "wall.gpkg"}, "no column 'cost', the extra cost per metre; it has kind"),
    "text cost": ({"cost": "text_cost.gpkg"}, "not numbers"),
    "cost below 0": ({"cost": np.full((21, 21), -1.0)}, "below 0"),
    "shape": ({"cost": np.zeros((3, 3))}, r"shape \(3, 3\)"),
    "margin": ({"keep_out": "wall.gpkg", "keep_out_margin": -1.0}, "margin is -1"),
    "margin alone": ({"keep_out_margin": 1.0}, "give keep_out"),
    "speed": ({"speed": 0.0}, "speed is 0"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_layers_are_refused_in_one_sentence(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_vector(tmp_path / "wall.gpkg", [WALL], kind=["wall"])
    write_vector(tmp_path / "text_cost.gpkg", [WALL], cost=["dear"])
    for name in ("text.gpkg", "text.tif"):
        (tmp_path / name).write_text("words")
    maps, (call, hint) = empty(), BAD[case]
    with pytest.raises(rb.RockerbogieError, match=hint):
        rb.plan(maps, place(maps, 2, 2), place(maps, 2, 18), **call)  # type: ignore[arg-type]


def test_a_layer_off_the_map_is_reported(tmp_path: Path) -> None:
    file = write_vector(tmp_path / "far.gpkg", [shapely.box(0, 0, 1, 1)])
    with pytest.warns(UserWarning, match="far.gpkg has no feature on the map"):
        rb.plan(empty(), place(empty(), 2, 2), place(empty(), 2, 6), keep_out=file)


@pytest.mark.parametrize("how", ["every second", "coarsened", "part", "downward"])
def test_a_resampled_map_uses_its_own_transform(how: str, tmp_path: Path) -> None:
    """Each cell of the GeoTIFF lies where the Dataset has it; plans use the true cell size."""
    maps = empty(rows=20, cols=24)
    maps["worst_tilt"][:] = np.arange(20)[:, None] + 100 * np.arange(24)
    if how == "every second":
        changed = maps.isel(x=slice(1, None, 2), y=slice(0, None, 2))
    elif how == "coarsened":
        changed = maps[["worst_tilt", "passable"]].coarsen(x=3, y=2).mean()  # drops the attributes
    elif how == "part":
        changed = maps.sel(x=slice(1003, 1006), y=slice(2002, 2004))
    else:
        with pytest.raises(rb.RockerbogieError, match="sortby"):
            rb.write_map(maps.isel(y=slice(None, None, -1)), tmp_path / "m.tif")
        return
    rb.write_map(changed, tmp_path / "m.tif")
    with rasterio.open(tmp_path / "m.tif") as file:
        assert file.crs.to_epsg() == 32633
        band = [name.startswith("worst_tilt") for name in file.descriptions].index(True) + 1
        values = changed["worst_tilt"]
        scale = 180 / np.pi if file.descriptions[band - 1].endswith("_deg") else 1.0
        for y in changed["y"].values[[0, -1]]:
            for x in changed["x"].values[[0, -1]]:
                (got,) = next(file.sample([(x, y)], indexes=band))
                assert_close(got, scale * float(values.sel(x=x, y=y)), 1e-2, "deg", "the cell's own value")
    if how == "every second":
        route = rb.plan(changed, (*place(changed, 2, 1), 0.0), (*place(changed, 2, 9), 0.0))
        assert_close(route.distance[-1], 8.0, 1e-9, "m", "8 cells of 1 m")


def test_relief_and_margin_layers() -> None:
    """Slope, aspect, roughness of a plane and of waves; margins are limits minus angles."""
    rover = rb.load_rover("curiosity")
    limits = rb.Limits(pitch=np.radians(12), tilt=np.radians(20))
    layers = ["slope", "aspect", "roughness", "margin", "worst_margin", "tilt", "pitch", "roll"]
    plane = rb.surfaces.plane(np.radians(10), np.radians(40), size=12.0)
    maps = rb.traversability(rover, plane, 8, 2.0, limits, layers=layers)
    assert_close(maps["slope"], np.radians(10), 1e-9, "rad", "the plane's")
    assert_close(maps["aspect"], np.radians(40), 1e-9, "rad", "down the plane")
    inner = maps.isel(x=slice(1, -1), y=slice(1, -1))
    assert_close(inner["roughness"], 0.0, 1e-9, "m", "none")
    expected = np.minimum(limits.pitch - np.abs(maps["pitch"]), limits.tilt - maps["tilt"])
    assert_close(maps["margin"], expected, 1e-12, "rad", "what is left")
    assert (maps["margin"].min("heading", skipna=True) == maps["worst_margin"]).where(maps["worst_margin"].notnull(), True).all()
    assert float(maps["worst_margin"].min()) == pytest.approx(np.radians(2), abs=0.01), "uphill, 10 of 12 degrees"
    waves = rb.surfaces.sine(amplitude=0.05, wavelength=0.5, size=12.0)
    rough = rb.traversability(rover, waves, 1, 2.0, limits, layers=["roughness"])["roughness"]
    assert_close(rough.median(), 0.05 / np.sqrt(2), 0.01, "m", "the RMS of waves")
    assert set(rb.traversability(rover, plane, 1, 4.0).data_vars).isdisjoint({"slope", "margin", "roughness"})
    assert isinstance(rb.traversability(rover, plane, 1, 4.0, layers="all"), xr.Dataset)
