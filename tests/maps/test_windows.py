"""A window gives the same bits as the whole map, and no more of the map is read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.maps import ground as filed_ground
from rockerbogie.maps.ground import Span, hold_ground, nodes_under, open_ground, reach
from rockerbogie.terrain import spline
from rockerbogie.terrain import window as terrain_module
from rockerbogie.terrain.heightfield import Terrain, assemble, build_window, crop
from rockerbogie.terrain.window import Derived, MapExtent, nodes_needed
from support.helpers import paper_rover

KINDS = ("linear", "cubic")
ORIGIN = (4_141_909.3, -273_417.85)
STEP = (0.08, 0.07)
SHAPE = (620, 590)  # three tiles a side


def heights(missing: bool, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    """Rough ground far below datum, with unknown nodes and a wide unknown patch."""
    rng = np.random.default_rng(7)
    z = -4450.0 + 0.02 * rng.normal(size=shape) + 0.3 * np.sin(np.arange(shape[1]) / 40)
    if missing:
        z[rng.random(shape) < 5e-4] = np.nan
        z[230:330, 120:290] = np.nan
    return z


def window_of(z: np.ndarray, rows: Span, cols: Span, whole: MapExtent) -> Terrain:
    """A window laid out of no heights but those it says it needs."""
    (r0, r1), (c0, c1) = (nodes_needed(*s, n, whole.interpolation) for s, n in zip((rows, cols), whole.shape, strict=True))
    return build_window(z[r0:r1, c0:c1].copy(), (r0, c0), rows, cols, whole)


def same(a: Any, b: Any) -> bool:
    """Equal to the last bit, nan where nan."""
    return np.asarray(a).tobytes() == np.asarray(b).tobytes()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("missing", [False, True])
def test_windows_equal_parts_of_the_whole_terrain(kind: Any, missing: bool) -> None:
    z = heights(missing)
    terrain = Terrain.from_array(z, STEP, ORIGIN, kind)
    whole = hold_ground(terrain).whole
    assert np.isfinite(whole.curvature or 0) == (kind == "cubic" and not missing)
    spans = [(0, 2), (0, 100), (250, 262), (255, 257), (256, 512), (100, 590), (588, 590)]
    for rows in [*spans, (618, 620), (0, 620)]:
        for cols in spans:
            laid, taken = window_of(z, rows, cols, whole), crop(terrain, rows, cols)
            for name in ("z", "grid", "upper_bound", "meta", "bridged"):
                assert same(getattr(laid, name), getattr(taken, name)), f"{name} of rows {rows}, columns {cols}"
            assert laid.bounds == taken.bounds


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
def test_poses_in_a_window_equal_those_on_the_whole_map(kind: Any, missing: bool, mode: Any) -> None:
    z, rover = heights(missing), paper_rover()
    terrain = Terrain.from_array(z, STEP, ORIGIN, kind)
    whole, far = hold_ground(terrain).whole, reach(rover)
    rng = np.random.default_rng(1)
    n = 60 if mode == "contact" else 15
    seen = set()
    for u, v in ((0.43, 0.41), (0.0, 0.5), (1.0, 1.0), (0.35, 0.55), (0.83, 0.8)):
        x = terrain.x[0] + u * np.ptp(terrain.x) + rng.uniform(-1, 1, n)
        y = terrain.y[0] + v * np.ptp(terrain.y) + rng.uniform(-1, 1, n)
        yaw = rng.uniform(-np.pi, np.pi, n)
        rows = nodes_under(y.min(), y.max(), ORIGIN[1], STEP[1], SHAPE[0], far)
        cols = nodes_under(x.min(), x.max(), ORIGIN[0], STEP[0], SHAPE[1], far)
        here = rb.settle(rover, terrain, x, y, yaw, mode=mode)
        seen |= set(here.status.tolist())
        for window in (window_of(z, rows, cols, whole), hold_ground(terrain).sent(rows, cols).window(rows, cols)):
            assert window.grid.nbytes < terrain.grid.nbytes / 4
            there = rb.settle(rover, window, x, y, yaw, mode=mode)
            assert same(there.q, here.q)
            assert same(there.status, here.status)
            assert same(there.clearance, here.clearance)
            for a, b in zip(there.contacts, here.contacts, strict=True):
                assert same(a, b)
            assert same(window.height(x, y), terrain.height(x, y))
            assert same(window.gradient(x, y), terrain.gradient(x, y))
    assert rb.Status.CONVERGED in seen
    assert rb.Status.OFF_MAP in seen
    assert missing == (rb.Status.NO_DATA in seen)


@pytest.mark.nojit
@pytest.mark.parametrize("kind", KINDS)
def test_no_node_outside_a_window_is_read(kind: Any) -> None:
    """In plain Python an index outside the window raises; compiled, NaN lies there."""
    rng = np.random.default_rng(3)
    shape, rover = (70, 64), paper_rover()
    z = 0.05 * rng.normal(size=shape)
    terrain = Terrain.from_array(z, 0.1, ORIGIN, kind)
    far = reach(rover)
    x, y = ORIGIN[0] + np.array([2.3, 3.0, 0.7]), ORIGIN[1] + np.array([3.1, 3.6, 3.3])
    yaw = rng.uniform(-np.pi, np.pi, 3)
    rows, cols = nodes_under(y.min(), y.max(), ORIGIN[1], 0.1, 70, far), nodes_under(x.min(), x.max(), ORIGIN[0], 0.1, 64, far)
    bare = crop(terrain, rows, cols)
    buried = np.full((bare.grid.shape[0] + 40, bare.grid.shape[1]), np.nan)  # so are the 20 rows before it and after it
    buried[20:-20] = bare.grid
    upper_bound = np.full((bare.upper_bound.shape[0] + 40, bare.upper_bound.shape[1]), np.nan)
    upper_bound[20:-20] = bare.upper_bound
    derived = Derived(buried[20:-20], upper_bound[20:-20], bare.meta, buried[20:-20])
    window = assemble(bare.z, bare.spacing, bare.origin, bare.interpolation, bare.crs, bare.name, derived)
    for mode in ("contact", "equilibrium"):
        here, there = (rb.settle(rover, t, x, y, yaw, mode=mode) for t in (terrain, window))  # type: ignore[arg-type]
        assert np.isfinite(here.z).any()
        assert same(there.q, here.q)
        assert same(there.clearance, here.clearance)
        assert same(there.gap, here.gap)


def test_the_reach_contains_the_rover() -> None:
    """No wheel at any joint angle and no corner of the box is further from the reference point."""
    rng = np.random.default_rng(0)
    for name in ("elhami-dashti", "curiosity", "perseverance", "rocky7"):
        rover = rb.load_rover(name)
        joints = rng.uniform(-np.pi, np.pi, (2000, 9))
        T = rb.wheel_frames(rover, joints[:, 0], joints[:, 1:3], np.where(rover.steers, joints[:, 3:], 0.0))
        hubs = np.linalg.norm(T[..., :3, 3], axis=-1) + np.hypot(rover.wheel_radius, rover.wheel_width / 2)
        assert hubs.max() <= reach(rover)
        corners = np.stack(np.meshgrid(*rover.body_box.T), axis=-1).reshape(-1, 3)
        assert np.linalg.norm(corners, axis=-1).max() <= reach(rover)


def test_nodes_beyond_the_margin_have_no_effect() -> None:
    """Coefficients tile by tile are the whole banded system's, to rounding."""
    from scipy.interpolate import make_interp_spline

    z = np.random.default_rng(5).normal(size=(900, 6))
    c = spline.coefficients(z, (0, 0), z.shape, (0, 900), (0, 6))
    nodes = [make_interp_spline(np.arange(n), np.eye(n), k=3) for n in z.shape]
    at = np.random.default_rng(6).uniform(0, 1, (4000, 2)) * np.subtract(z.shape, 1)
    exact = np.einsum("ki,ij,kj->k", nodes[0](at[:, 0]), z, nodes[1](at[:, 1]))
    terrain = Terrain.from_array(z, 1.0)
    assert same(terrain.grid.shape, c.shape)
    assert np.abs(terrain.height(at[:, 1], at[:, 0]) - exact).max() < 1e-12


def test_a_file_read_in_windows_equals_the_file_read_at_once(data: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rasterio", reason="needs the geo extra")
    path = data("perseverance/site78.tif")
    monkeypatch.setattr(filed_ground, "BAND", 10_000)  # 19 rows of it at once
    monkeypatch.setattr(filed_ground, "BLOCK", 200)
    for kind in KINDS:
        terrain = Terrain.from_raster(path, interpolation=kind)  # type: ignore[arg-type]
        filed = open_ground(path, 1, kind)  # type: ignore[arg-type]
        assert filed.whole == hold_ground(terrain).whole
        assert filed.digest() == hold_ground(terrain).digest()
        for rows, cols in (((0, 90), (200, 300)), ((240, 270), (500, 513))):
            for name in ("z", "grid", "upper_bound", "meta", "bridged"):
                assert same(getattr(filed.window(rows, cols), name), getattr(crop(terrain, rows, cols), name))


def test_the_reference_height_of_a_file_is_that_of_its_terrain(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """In bands of any size, with extremes, and where no node of the subgrid is known."""
    rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")
    monkeypatch.setattr(terrain_module, "DATUM_SIDE", 40)  # a subgrid of every 16th row and 15th column
    for band in (1, 5000, 1 << 22):
        monkeypatch.setattr(filed_ground, "BAND", band)
        for known in ((slice(None), slice(None)), (slice(1, None, 16), slice(None)), (slice(None), slice(2, None, 15))):
            z = np.full(SHAPE, np.nan)
            z[known] = heights(missing=True)[known]
            z[17, 17] = 9.9e6
            path = tmp_path / "ground.tif"
            place = rasterio.Affine(STEP[0], 0, ORIGIN[0], 0, -STEP[1], ORIGIN[1])
            profile = {"height": SHAPE[0], "width": SHAPE[1], "count": 1, "dtype": "float64", "nodata": np.nan}
            with rasterio.open(path, "w", driver="GTiff", transform=place, **profile) as raster:
                raster.write(z[::-1], 1)
            terrain, filed = Terrain.from_raster(path, interpolation="linear"), open_ground(path, 1, "linear")
            assert filed.whole == hold_ground(terrain).whole
            assert abs(filed.whole.level + 4450) <= 1
            for rows, cols in (((0, 40), (0, 40)), ((300, 420), (500, 590))):
                for name in ("z", "grid", "upper_bound", "meta", "bridged"):
                    assert same(getattr(filed.window(rows, cols), name), getattr(crop(terrain, rows, cols), name))
