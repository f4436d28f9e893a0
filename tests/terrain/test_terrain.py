"""Terrain, compared with SciPy's interpolators; map edges, missing data and far origins."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import RectBivariateSpline, RegularGridInterpolator

import rockerbogie as rb
from rockerbogie._kernels.model import ground
from rockerbogie.terrain.window import Datum
from support.helpers import assert_close

KINDS = ("cubic", "linear")


def rough(seed: int, rows: int = 14, cols: int = 19) -> np.ndarray:
    """Return white noise with a standard deviation of 0.5 m."""
    return np.random.default_rng(seed).normal(0.0, 0.5, (rows, cols))


def anywhere(terrain: rb.Terrain, n: int = 500, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return points x, y (n,) on the map, among them its four corners and some nodes."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = terrain.bounds
    x, y = rng.uniform(x0, x1, n), rng.uniform(y0, y1, n)
    x[:4], y[:4] = (x0, x0, x1, x1), (y0, y1, y0, y1)
    x[4:40], y[4:40] = rng.choice(terrain.x, 36), rng.choice(terrain.y, 36)
    return x, y


@pytest.mark.nojit
@pytest.mark.parametrize("spacing", [0.02, (0.3, 0.7), (93.0, 74.0)])
def test_cubic_is_the_not_a_knot_spline(spacing: Any) -> None:
    terrain = rb.Terrain.from_array(rough(1), spacing, origin=(-3.0, 5.0))
    scipy_spline = RectBivariateSpline(terrain.y, terrain.x, terrain.z, kx=3, ky=3, s=0)
    x, y = anywhere(terrain)
    dx, dy = terrain.spacing
    assert_close(terrain.height(x, y), scipy_spline.ev(y, x), 1e-10, "m", "FITPACK's interpolating cubic spline")
    slope = np.stack([scipy_spline.ev(y, x, dy=1), scipy_spline.ev(y, x, dx=1)], axis=-1)
    assert_close(terrain.gradient(x, y) * (dx, dy), slope * (dx, dy), 1e-9, "m per cell", "its first derivatives")


@pytest.mark.nojit
def test_cubic_curvature_is_the_splines() -> None:
    terrain = rb.Terrain.from_array(rough(2), (0.3, 0.7))
    scipy_spline = RectBivariateSpline(terrain.y, terrain.x, terrain.z, kx=3, ky=3, s=0)
    for x, y in np.random.default_rng(0).uniform((0, 0), terrain.bounds[2:], (50, 2)):
        *_, hxx, hxy, hyy = ground.surface(terrain.grid, terrain.meta, x, y)
        expected = [scipy_spline.ev(y, x, dx=j, dy=i) for i, j in ((2, 0), (1, 1), (0, 2))]
        assert_close([hxx, hxy, hyy], np.array(expected), 1e-8, "1/m", "FITPACK's second derivatives")


@pytest.mark.nojit
def test_linear_is_bilinear() -> None:
    terrain = rb.Terrain.from_array(rough(3), (0.3, 0.7), interpolation="linear")
    x, y = anywhere(terrain)
    bilinear = RegularGridInterpolator((terrain.y, terrain.x), terrain.z)
    assert_close(terrain.height(x, y), bilinear((y, x)), 1e-12, "m", "scipy's bilinear interpolation")
    col, row, u, v, h = 4, 6, 0.3, 0.6, 1e-6
    x, y = terrain.x[col] + u * 0.3, terrain.y[row] + v * 0.7
    slope = [(bilinear((y, x + h)) - bilinear((y, x - h))).item(), (bilinear((y + h, x)) - bilinear((y - h, x))).item()]
    assert_close(terrain.gradient(x, y), np.divide(slope, 2 * h), 1e-8, "m/m", "central differences inside a cell")


def test_cubic_curvature_is_continuous_across_grid_lines() -> None:
    """Value, slope and curvature agree on both sides of every grid line."""
    terrain = rb.Terrain.from_array(rough(4), (0.3, 0.7))
    rng = np.random.default_rng(0)
    step = 1e-9
    for x in terrain.x[1:-1]:
        y = rng.uniform(*terrain.y[[0, -1]])
        west, east = (np.array(ground.surface(terrain.grid, terrain.meta, x + e, y)) for e in (-step, step))
        assert_close(west, east, 1e-5, "m, 1, 1/m", "C2 in x: 2 nm apart, third derivatives below 1e3 /m²")
    for y in terrain.y[1:-1]:
        x = rng.uniform(*terrain.x[[0, -1]])
        south, north = (np.array(ground.surface(terrain.grid, terrain.meta, x, y + e)) for e in (-step, step))
        assert_close(south, north, 1e-5, "m, 1, 1/m", "C2 in y")


@pytest.mark.parametrize("kind", KINDS)
def test_nodes_keep_their_heights(kind: Any) -> None:
    z = rough(5) - 4450.0
    terrain = rb.Terrain.from_array(z, (0.3, 0.7), (137.4, -18.2), kind)
    x, y = np.meshgrid(terrain.x, terrain.y)
    assert_close(terrain.height(x, y), z, 5e-12, "m", "the surface goes through its nodes, at 4 km below datum too")


def test_a_cubic_is_reproduced() -> None:
    def f(x: Any, y: Any) -> Any:
        return 1 + 2 * x - y + 0.3 * x * x * y - 0.2 * y**3 + 0.1 * x**3 * y**2

    terrain = rb.Terrain.from_array(f(*np.meshgrid(0.5 * np.arange(7), 0.25 * np.arange(5))), (0.5, 0.25))
    x, y = anywhere(terrain)
    assert_close(terrain.height(x, y), f(x, y), 1e-11, "m", "a bicubic polynomial is its own not-a-knot spline")


@pytest.mark.parametrize("kind", KINDS)
def test_normal_is_the_slopes(kind: Any) -> None:
    terrain = rb.Terrain.from_array(rough(6), 0.4, interpolation=kind)
    x, y = anywhere(terrain)
    n = terrain.normal(x, y)
    slope = terrain.gradient(x, y)
    assert_close(np.linalg.norm(n, axis=-1), 1.0, 1e-15, "", "unit length")
    assert (n[:, 2] > 0).all()
    for axis in (0, 1):
        tangent = np.zeros((len(x), 3))
        tangent[:, axis], tangent[:, 2] = 1.0, slope[:, axis]
        assert_close((n * tangent).sum(axis=-1), 0.0, 1e-13, "", "square to both tangents")


@pytest.mark.parametrize("kind", KINDS)
def test_mirrored_rotated_and_lifted_terrains_agree(kind: Any) -> None:
    z = rough(7)
    terrain = rb.Terrain.from_array(z, (0.3, 0.7), interpolation=kind)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, terrain.bounds[2], 200), rng.uniform(0, terrain.bounds[3], 200)
    h, s = terrain.height(x, y), terrain.gradient(x, y)

    mirror = rb.Terrain.from_array(z[::-1], (0.3, 0.7), (0.0, -terrain.bounds[3]), kind)
    assert_close(mirror.height(x, -y), h, 1e-12, "m", "mirrored left-right")
    assert_close(mirror.gradient(x, -y), s * (1, -1), 1e-11, "m/m", "mirrored left-right")

    turned = rb.Terrain.from_array(z.T, (0.7, 0.3), interpolation=kind)
    assert_close(turned.height(y, x), h, 1e-12, "m", "x and y exchanged")
    assert_close(turned.gradient(y, x), s[:, ::-1], 1e-11, "m/m", "x and y exchanged")

    tilted = rb.Terrain.from_array(z + 0.2 * terrain.x - 0.1 * terrain.y[:, None] + 7.0, (0.3, 0.7), interpolation=kind)
    assert_close(tilted.height(x, y), h + 0.2 * x - 0.1 * y + 7.0, 1e-12, "m", "a plane laid under it adds")
    assert_close(tilted.gradient(x, y), s + (0.2, -0.1), 1e-11, "m/m", "a plane laid under it adds")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("origin", [(8e6, -8e6), (-273_417.85, 4_141_909.3)])
def test_a_far_origin_costs_only_the_last_digits_of_a_position(kind: Any, origin: tuple[float, float]) -> None:
    z = rough(8)
    near = rb.Terrain.from_array(z, (0.3, 0.7), interpolation=kind)
    far = rb.Terrain.from_array(z, (0.3, 0.7), origin, kind)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.01, near.bounds[2] - 0.01, 200), rng.uniform(0.01, near.bounds[3] - 0.01, 200)
    steepest = np.abs(near.gradient(x, y)).max()
    blur = 4 * np.spacing(8e6) * steepest
    assert_close(
        far.height(x + origin[0], y + origin[1]), near.height(x, y), blur, "m", "8e6 m is known to 1 nm: times the slope"
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("spacing", "origin"), [(0.1, 0.0), (0.1, 0.3), (0.02, 8e6), (1 / 3, -1e5 / 7), (1.0, 4_141_909.3)])
def test_the_edge_belongs_to_the_map(kind: Any, spacing: float, origin: float) -> None:
    terrain = rb.Terrain.from_array(rough(9), spacing, (origin, -origin), kind)
    x0, y0, x1, y1 = terrain.bounds
    assert np.isfinite(terrain.height([x0, x0, x1, x1], [y0, y1, y0, y1])).all()
    off = 1e-3 * spacing
    mx, my = (x0 + x1) / 2, (y0 + y1) / 2
    assert np.isnan(terrain.height([x0 - off, x1 + off, mx, mx], [my, my, y0 - off, y1 + off])).all()
    assert np.isnan(terrain.gradient(x1 + off, my)).all()
    assert np.isnan(terrain.normal(x1 + off, my)).all()
    assert np.isnan(terrain.height([np.nan, np.inf], [my, my])).all()


@pytest.mark.nojit
@pytest.mark.parametrize(("kind", "reach"), [("cubic", 2), ("linear", 1)])
def test_cells_that_depend_on_missing_nodes_are_missing(kind: Any, reach: int) -> None:
    z = rough(10)
    missing = [(6, 8), (0, 0), (13, 17)]
    for node in missing:
        z[node] = np.nan
    terrain = rb.Terrain.from_array(z, 0.5, interpolation=kind)
    for row in range(13):
        for col in range(18):
            h = terrain.height(0.5 * (col + 0.4), 0.5 * (row + 0.7))
            depends = any(col - reach < c <= col + reach and row - reach < r <= row + reach for r, c in missing)
            assert np.isnan(h) == depends, f"cell {row, col}"


def test_the_effect_of_missing_nodes_falls_by_0_27_per_cell() -> None:
    z = rough(11, 40, 40)
    whole = rb.Terrain.from_array(z, 1.0)
    z[18:21, 18:21] = np.nan
    gappy = rb.Terrain.from_array(z, 1.0)
    x, y = np.meshgrid(gappy.x, gappy.y)
    known = np.isfinite(gappy.height(x, y))
    assert_close(gappy.height(x, y)[known], z[known], 1e-12, "m", "known nodes keep their heights")
    relief = np.ptp(z[np.isfinite(z)])
    for cells in (4, 8, 12):
        at = np.linspace(20 + cells, 21 + cells, 20)
        assert_close(gappy.height(at, 19.3), whole.height(at, 19.3), relief * 0.27 ** (cells - 1), "m", "0.27 for each cell away")


@pytest.mark.parametrize("shape", [(), (1,), (3, 1, 2)])
def test_any_batch_shape(shape: tuple[int, ...]) -> None:
    terrain = rb.Terrain.from_array(rough(12), 0.5)
    x = np.random.default_rng(0).uniform(0, 5, shape)
    assert terrain.height(x, 1.0).shape == shape
    assert terrain.gradient(x, 1.0).shape == (*shape, 2)
    assert terrain.normal(x, 1.0).shape == (*shape, 3)
    assert terrain.height(np.zeros((4, 1)), np.zeros(3)).shape == (4, 3)


def test_the_given_array_is_copied() -> None:
    z = rough(13)
    before = z.copy()
    terrain = rb.Terrain.from_array(z, 0.5)
    z += 1.0
    assert_close(terrain.z, before, 0.0, "m", "a copy")
    with pytest.raises(ValueError, match="read-only"):
        terrain.z[0, 0] = 0.0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"interpolation": "quintic"}, "interpolation 'quintic' is not known; give 'cubic' or 'linear'"),
        ({"z": np.zeros(5)}, r"heights have shape \(5,\); cubic terrain needs \(rows, cols\) of at least 4 each"),
        ({"z": np.zeros((3, 9))}, r"heights have shape \(3, 9\); cubic terrain needs \(rows, cols\) of at least 4 each"),
        ({"z": np.zeros((1, 9)), "interpolation": "linear"}, r"shape \(1, 9\); linear terrain needs .* at least 2 each"),
        ({"z": np.zeros((2, 9, 9))}, r"heights have shape \(2, 9, 9\)"),
        ({"spacing": 0.0}, "spacing is 0.0; give one finite step above 0, or two"),
        ({"spacing": (0.1, -0.1)}, r"spacing is \(0.1, -0.1\); give one finite step above 0"),
        ({"spacing": np.nan}, "spacing is nan"),
        ({"spacing": (1.0, 2.0, 3.0)}, r"spacing \(\(1.0, 2.0, 3.0\)\) one number or two"),
        ({"spacing": "wide"}, r"spacing \('wide'\) one number or two"),
        ({"origin": (0.0, np.inf)}, r"origin is \(0.0, inf\); give the finite \(x, y\) of the first node"),
        ({"origin": (0.0,)}, r"origin is \(0.0,\); give the finite"),
        ({"z": np.where(np.eye(6) > 0, np.inf, 0.0)}, "a height of inf m at row 0, column 0"),
        *(
            (
                {"z": np.where(np.arange(36).reshape(6, 6) == 15, fill, 0.0)},
                f"a height of {float(fill)!r} m at row 2, column 3 .x = 0.3, y = 0.2 m.*NaN".replace("+", "."),
            )
            for fill in (1.01e7, 1e10, 1e15, 1e20, 9.969209968386869e36, -3.4028234663852886e38, 1.7e308, -1.7e308, 2**31)
        ),
        ({"z": np.full((6, 6), np.nan)}, "every height of terrain is missing"),
        ({"z": [[1.7e308, -1.7e308], [0.0, 0.0]], "interpolation": "linear"}, "a height of 1.7e.308 m at row 0, column 0"),
        ({"z": np.full((6, 6), 1e20, np.float32)}, "a height of 1.00000002.*e.20 m at row 0, column 0"),
        ({"z": np.full((6, 6), np.iinfo(np.int64).min)}, "a height of -9.2.*e.18 m"),
        ({"z": np.ma.masked_equal(np.where(np.arange(36) > 7, 1e20, np.nan).reshape(6, 6), 0)}, "a height of 1e.20 m at row 1"),
        ({"z": np.full((6, 6), np.longdouble("1e4000"))}, "a height of inf m"),
        ({"z": np.full((6, 6), 10**400)}, "heights must be an array of numbers"),
        ({"spacing": 1e20}, "spacing of terrain along x is 1e.20 m; give a step from 1e-06 to 1e.06 m"),
        ({"spacing": (1.0, 1e-300)}, "spacing of terrain along y is 1e-300 m; give a step"),
        (
            {"origin": (1e12, 0.0)},
            "terrain reaches to x = 1e.12 m in steps of 0.1 m, .* rounded by up to 6e-05 m; .* offset from x",
        ),
        ({"origin": (0.0, -1e308)}, "terrain reaches to y = 1e.308 m"),
        ({"origin": (0.0, 9.9e8), "spacing": 0.01}, "terrain reaches to y = 9.9e.08 m .* a rounding of 1e-06 of a step"),
        ({"spacing": 1e6, "z": np.zeros((4, 1002))}, "terrain reaches to x = 1.001e.09 m"),
        ({"z": [["a", "b"], ["c", "d"]]}, "heights must be an array of numbers"),
        ({"z": [["1", "2"], ["3", "4"]]}, "heights must be an array of numbers, .* is not a number"),
        ({"z": np.eye(6) > 0}, r"heights must be an array of numbers, .*: True \(bool\w*\) is not a number"),
        ({"z": [[True, False], [False, True]]}, "heights must be an array of numbers"),
        ({"z": np.ma.masked_array(np.eye(6) > 0, np.eye(6) > 0)}, "heights must be an array of numbers"),
        ({"z": np.zeros((6, 6), "M8[s]")}, "heights must be an array of numbers"),
        ({"z": np.zeros((6, 6), complex)}, "heights must be an array of numbers"),
        (
            {"z": xr.DataArray(np.eye(6) > 0, dims=("y", "x"))},
            r"the DataArray does not hold heights: True \(bool\w*\) is not a number",
        ),
        ({"z": [[1.0, 2.0], [3.0]]}, "heights must be an array of numbers"),
    ],
)
def test_invalid_arguments_are_refused(arguments: dict[str, Any], sentence: str) -> None:
    with pytest.raises(rb.TerrainError, match=sentence):
        rb.Terrain.from_array(**{"z": np.zeros((6, 6)), "spacing": 0.1, **arguments})


def test_masked_heights_are_missing_data() -> None:
    z = np.ma.masked_equal(np.where(np.arange(2500).reshape(50, 50) % 50 > 25, -9999.0, 0.0), -9999.0)
    terrain = rb.Terrain.from_array(z, 0.1, interpolation="linear")
    assert np.isnan(terrain.height(4.0, 2.0))
    assert terrain.height(1.0, 2.0) == 0
    rows = [np.ma.masked_array([1.0, 2.0], [False, True]), [3.0, 4.0]]
    assert np.array_equal(rb.Terrain.from_array(rows, 1.0, interpolation="linear").z, [[1, np.nan], [3, 4]], equal_nan=True)


@pytest.mark.parametrize("kind", KINDS)
def test_replacing_heights_makes_a_new_surface(kind: Any) -> None:
    """Arrays for the kernels follow every change, and cannot be passed."""
    terrain = rb.Terrain.from_array(rough(1), 0.3, (5.0, 7.0), kind, crs="EPSG:32633", name="old")
    changed = replace(terrain, z=rough(2) + 40.0, origin=(6.0, 7.0))
    fresh = rb.Terrain.from_array(rough(2) + 40.0, 0.3, (6.0, 7.0), kind, crs="EPSG:32633", name="old")
    x, y = anywhere(fresh)
    assert_close(changed.height(x, y), fresh.height(x, y), 0, "m", "the surface of the new heights")
    assert (changed.crs, changed.name) == (fresh.crs, fresh.name)
    assert np.array_equal(changed.meta, fresh.meta)
    with pytest.raises(TypeError, match="meta"):
        rb.Terrain(terrain.z, terrain.spacing, meta=terrain.meta)  # type: ignore[call-arg]
    with pytest.raises(rb.TerrainError, match="spacing is"):
        replace(terrain, spacing=(0.0, 1.0))


def test_suspicious_extremes_of_an_array_cause_a_warning() -> None:
    z = rough(3)
    z[2, 3] = -9999.0
    with pytest.warns(rb.TerrainWarning, match="terrain reaches -9999 m, which usually means missing data"):
        rb.Terrain.from_array(z, 0.3)


def test_complex_heights_are_refused() -> None:
    with pytest.raises(rb.RockerbogieError, match="complex"):
        rb.Terrain.from_array(np.zeros((5, 5), dtype=complex), 0.1)


FAR_AWAY = (-9999.0, -32768.0, 8848.0, 9.9e6)


def test_heights_may_be_radii_of_planets() -> None:
    z = 6_378_137.0 + rough(14)
    terrain = rb.Terrain.from_array(z, 0.5, interpolation="linear")
    assert_close(terrain.height(*np.meshgrid(terrain.x, terrain.y)), z, 1e-9, "m", "double precision resolves 1e-9 m there")


@pytest.mark.filterwarnings("error::RuntimeWarning", "ignore:terrain reaches")
@pytest.mark.parametrize("interpolation", KINDS)
def test_an_extreme_height_far_away_does_not_move_a_pose(interpolation: Any) -> None:
    """The reference height is a median: it does not depend on extremes."""
    rover = rb.load_rover("curiosity")
    row, col = np.mgrid[:120, :120] * 0.5
    z = 0.4 * np.sin(col / 3) + 0.3 * np.cos(row / 4) + 100
    good = rb.Terrain.from_array(z, 0.5, interpolation=interpolation)
    for fill in FAR_AWAY:
        spoilt = z.copy()
        spoilt[119, 119] = fill
        bad = rb.Terrain.from_array(spoilt, 0.5, interpolation=interpolation)
        assert bad.height(20.0, 20.0) == good.height(20.0, 20.0)
        for mode in ("contact", "equilibrium"):
            expected, found = (rb.settle(rover, terrain, 20.0, 20.0, 0.3, mode=mode) for terrain in (good, bad))  # type: ignore[arg-type]
            assert found.status == expected.status == rb.Status.CONVERGED
            assert_close(found.q, expected.q, 1e-12, "m, rad", "the spline stays 0.27 ** 70 of it so far")
            assert_close(found.clearance, expected.clearance, 1e-12, "m", "and the search for it leaves out what is far")


def reference(z: np.ndarray, band: int) -> float:
    """Return the reference height of a map that is read in bands of `band` rows, m."""
    datum = Datum("z", z.shape, (1.0, 1.0), (0.0, 0.0))  # type: ignore[arg-type]
    for row in range(0, len(z), band):
        datum.add(row, z[row : row + band])
    return datum.height()


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("shape", [(30, 40), (2500, 1100)])
def test_the_reference_height_does_not_depend_on_bands_or_extremes(shape: tuple[int, int], sparse: bool) -> None:
    z = np.random.default_rng(0).normal(-4450.2, 0.1, shape)
    if sparse:
        z[::3] = np.nan
        z[:, ::2] = np.nan  # no node of the large map's subgrid is known
    for fill in (None, 9.9e6, -9.9e6):
        if fill is not None:
            z[1, 1] = z[4, 5:25:2] = fill  # among the first known nodes
        for band in (1, 7, 1000, shape[0]):
            assert reference(z, band) == -4450.0


def test_the_reference_height_is_a_median_rounded_to_metres() -> None:
    for values, expected in (([0.4, 0.4, 9e6], 0.0), ([2.5, np.nan, 2.6], 3.0), ([-7.4], -7.0), ([-0.5, -0.5], 0.0)):
        assert reference(np.array([values]), 1) == expected
    with pytest.raises(rb.TerrainError, match=r"every height of z is missing \(NaN\)"):
        reference(np.full((3, 3), np.nan), 2)


def test_a_terrain_prints_as_a_line() -> None:
    terrain = rb.Terrain.from_array(
        np.array([[0.0, np.nan], [2.0, 4.0]]), (0.5, 0.25), (1, 2), "linear", crs="EPSG:32633", name="<yard>"
    )
    assert repr(terrain) == ("<Terrain <yard>: 2 by 2 nodes, cell 0.5 by 0.25 m, linear, x 1 to 1.5, y 2 to 2.25 m, EPSG:32633>")
    html = terrain._repr_html_()
    assert "&lt;yard&gt;" in html
    assert "0 to 4 m" in html
    assert "25 % of the nodes" in html
    assert repr(rb.surfaces.plane()).startswith("<Terrain plane: 101 by 101 nodes, cell 0.1 m, cubic, x -5 to 5, y -5 to 5 m")
