"""Surfaces: the paper's sizes, bounds of slope and curvature, and the laws of Mars."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie import surfaces
from rockerbogie.terrain.surfaces.mars import golombek_rocks
from support.helpers import assert_close

TRACK = 0.27  # of the paper's rover, m


@pytest.fixture(scope="module")
def paper() -> rb.Terrain:
    return surfaces.paper()


def test_paper_left_side_is_the_hill(paper: rb.Terrain) -> None:
    x = np.random.default_rng(0).uniform(-1, 5, 5000)
    s = np.clip(x - 1, 0, 2)
    for y in (0.15, TRACK, 0.4, 1.0):
        assert_close(
            paper.height(x, y),
            0.15 * (1 - np.cos(np.pi * s)),
            2e-6,
            "m",
            "0.15 (1 - cos πs) m; a spline rounds the jump of curvature at its ends",
        )
        off = paper.gradient(x, y)[..., 0] - 0.15 * np.pi * np.sin(np.pi * s)
        assert_close(off, 0, 1.5e-3, "-", "its slope; a kink of 1.5 /m at the ends is a tenth of a degree to a spline of 7 mm")
        assert_close(off[np.abs(np.abs(x - 2) - 1) > 0.1], 0, 1e-6, "-", "and 0.1 m from the ends nothing is left of that")


def test_paper_right_side_is_two_ramps_of_tan_0_3(paper: rb.Terrain) -> None:
    rng = np.random.default_rng(0)
    corners = 1 + np.array([0, 2, 4, 6]) / 3
    for start, end, slope, height in ((-1, 0, 0, 0), (0, 1, 0.3, 0.1), (1, 2, 0, 0.2), (2, 3, -0.3, 0.1), (3, 5, 0, 0)):
        low, high = (corners[0] if start == 0 else -1.0) if start <= 0 else corners[start], 5.0 if end == 5 else corners[end]
        x = rng.uniform(low + 1 / 75, high - 1 / 75, 1000)
        assert_close(paper.gradient(x, -TRACK)[:, 0], slope, 1e-10, "-", "straight right up to the rounding of its corners")
        assert_close(paper.height((low + high) / 2, -TRACK), height, 1e-10, "m", "0.2 m high between ramps")
    x = np.concatenate([np.linspace(-1, 5, 40001), corners])
    sharp = np.interp(x, corners, [0, 0.2, 0.2, 0])
    off = paper.height(x, -TRACK) - sharp
    assert np.abs(off).max() == pytest.approx(0.3 / 75 / 6, rel=1e-6)  # at the very corner, 0.67 mm
    assert_close(off[np.abs(x[:, None] - corners).min(axis=1) > 1 / 75], 0, 1e-12, "m", "and no ripple beyond the rounding")


def test_paper_terrain_is_curved_only_at_rounded_corners_and_in_the_seam(paper: rb.Terrain) -> None:
    x, h = np.linspace(-0.99, 4.99, 20001), 1e-4
    slope = paper.gradient(x, -TRACK)[:, 0]
    assert slope.max() <= 0.3 + 1e-9
    assert slope.min() >= -0.3 - 1e-9
    for y in np.concatenate([np.linspace(0.11, 0.99, 9), -np.linspace(0.11, 0.99, 9)]):
        across = paper.height(x, y + h) - paper.height(x, y - h)
        assert_close(across, 0, 1e-9, "m", "outside the seam nothing changes across the tracks")
    middle = (paper.height(x, TRACK) + paper.height(x, -TRACK)) / 2
    assert_close(paper.height(x, 0.0), middle, 1e-6, "m", "the two sides meet half way, on y = 0")


def test_paper_sizes_are_keywords() -> None:
    other = surfaces.paper(
        run_in=0.5, length=3.0, hill_amplitude=0.1, ramp_slope=np.arctan(0.2), ramp_height=0.1, spacing=0.02, width=3
    )
    assert_close(
        other.height([2.0, 2.0, 0.5], [TRACK, -TRACK, 1.4]), [0.2, 0.1, 0.0], 1e-6, "m", "tops at half way, sizes as given"
    )
    assert other.bounds == pytest.approx((-1, -1.5, 5.5, 1.5), abs=0.021)


def test_plane_falls_towards_its_aspect() -> None:
    ground = surfaces.plane(np.radians(20), np.radians(90 + 30))
    n = ground.normal(1.0, -2.0)
    assert np.degrees(np.arccos(n[2])) == pytest.approx(20)
    assert np.degrees(np.arctan2(n[1], n[0])) == pytest.approx(120)
    assert_close(ground.height(0.0, 0.0), 0.0, 1e-12, "m", "through the origin")


@pytest.mark.parametrize(("slope", "height"), [(np.arctan(0.3), 0.2), (-0.5, -0.3)])
def test_ramp_rises_by_its_slope_to_its_height(slope: float, height: float) -> None:
    ground = surfaces.ramp(slope, height, start=1.0, direction=np.pi / 2)
    run = height / np.tan(slope)
    assert_close(
        ground.height(2.0, [0.9, 1 + run / 2, 1 + run + 0.1]), [0, height / 2, height], 1e-6, "m", "level, half way, level"
    )
    assert_close(ground.gradient(-3.0, 1 + run / 2), [0, np.tan(slope)], 1e-4, "-", "it goes up along its direction")


def test_step_and_ditch_have_faces_one_cell_wide() -> None:
    ground = surfaces.step(0.15, start=1.0, spacing=0.01)
    assert_close(ground.height([0.5, 1.0, 1.005, 1.01, 2], 0.3), [0, 0, 0.075, 0.15, 0.15], 1e-9, "m", "up within one cell")
    down = surfaces.step(-0.15, start=-1.0, direction=np.pi, spacing=0.01)
    assert_close(down.height([1.5, 0.5], 0.3), [0, -0.15], 1e-9, "m", "down towards -x, from x = 1")
    ditch = surfaces.ditch(0.1, 0.3, start=1.0, spacing=0.01)
    assert_close(ditch.height([0.99, 1.01, 1.15, 1.29, 1.31], 0), [0, -0.1, -0.1, -0.1, 0], 1e-9, "m", "0.3 m from lip to lip")


def test_sine_is_a_sine_along_its_direction() -> None:
    ground = surfaces.sine(0.2, 3.0, direction=0.7)
    x, y = np.random.default_rng(0).uniform(-4, 4, (2, 500))
    s = x * np.cos(0.7) + y * np.sin(0.7)
    assert_close(ground.height(x, y), 0.2 * np.sin(2 * np.pi * s / 3), 1e-8, "m", "a spline of 150 nodes a wave")


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("max_slope", "min_radius"), [(np.radians(25), 0.2), (np.radians(10), 1.0)])
def test_rough_reaches_but_does_not_exceed_its_bounds(seed: int, max_slope: float, min_radius: float) -> None:
    ground = surfaces.rough(seed, max_slope=max_slope, min_radius=min_radius)
    x = np.linspace(-2.9, 2.9, 1161)  # four to a cell
    slope = ground.gradient(x, x[:, None])
    steepest = np.degrees(np.arctan(np.hypot(slope[..., 0], slope[..., 1]).max()))
    (xy, xx), (yy, _) = (np.gradient(slope[..., k], x[1] - x[0]) for k in (0, 1))
    curvature = (np.abs(xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))[1:-1, 1:-1].max()
    assert 0.85 * np.degrees(max_slope) < steepest <= np.degrees(max_slope)
    assert min_radius <= 1 / curvature < 1.4 * min_radius


def test_fractal_has_the_given_roughness_and_hurst_exponent() -> None:
    baselines = np.array([0.2, 0.5, 1.0, 2.0])
    for hurst, rms_slope in ((0.65, np.radians(5)), (0.8, np.radians(2))):
        square = np.zeros(4)
        for seed in range(6):
            ground = surfaces.fractal(seed, hurst=hurst, rms_slope=rms_slope)
            for k, n in enumerate(np.rint(baselines / 0.05).astype(int)):
                square[k] += ((ground.z[:, n:] - ground.z[:, :-n]) ** 2).mean() / 12 + (
                    (ground.z[n:] - ground.z[:-n]) ** 2
                ).mean() / 12
        deviation = np.sqrt(square)
        assert deviation[2] == pytest.approx(np.tan(rms_slope), rel=0.1)  # six maps of 40 m are some hundred independent metres
        assert np.polyfit(np.log(baselines), np.log(deviation), 1)[0] == pytest.approx(hurst, abs=0.06)


@pytest.mark.parametrize("k", [0.05, 0.1, 0.2])
def test_rocks_have_golombek_s_size_distribution(k: float) -> None:
    q = 1.79 + 0.152 / k
    size, smallest, largest = 25.0, 0.1, 1.5
    x, y, diameter = golombek_rocks(k, (size, size), 5, smallest=smallest, largest=largest)
    grades = np.array([0.1, 0.15, 0.2, 0.3, 0.5, 0.8])
    covered = np.array([np.pi / 4 * (diameter[diameter >= d] ** 2).sum() for d in grades]) / size**2
    law = k * (np.exp(-q * grades) - np.exp(-q * largest))
    one_rock = np.pi / 4 * diameter[0] ** 2 / size**2
    assert np.abs(covered - law).max() < 0.02 * law[0] + one_rock  # one from each n-th part of the law: a rock's share off
    apart = np.hypot(x[:, None] - x, y[:, None] - y) - (diameter[:, None] + diameter) / 2
    assert apart[np.triu_indices(len(x), 1)].min() > 0  # side by side
    ground = surfaces.rocks(k, 5, size=size, spacing=0.02)
    assert (ground.z > 1e-9).mean() == pytest.approx(law[0], rel=0.06)  # seen on the map; a few hang over its rim
    assert 0.25 * diameter[0] < ground.z.max() < 0.6 * diameter[0]


def test_rocks_change_the_base_only_where_they_are() -> None:
    base = surfaces.sine(spacing=0.05)
    ground = surfaces.rocks(0.1, 3, base=base)
    higher = ground.z - base.z
    assert higher.min() == 0
    assert (higher == 0).mean() > 0.85
    assert (ground.interpolation, ground.spacing, ground.origin) == (base.interpolation, base.spacing, base.origin)


def test_mars_holds_craters_and_rocks() -> None:
    bare = surfaces.mars(4, crater_density=0, k=0)
    cratered = surfaces.mars(4, k=0)
    dug = cratered.z - bare.z
    assert_close(bare.z, surfaces.fractal(4).z, 0, "m", "without craters and rocks, the fractal ground")
    assert dug.min() < -0.2  # the floor of a crater of some metres
    assert 0.01 < dug.max() < 0.5  # and its rim
    rocks = surfaces.mars(4).z - cratered.z
    q = 1.79 + 0.152 / 0.07
    assert (rocks > 0).mean() == pytest.approx(0.07 * (np.exp(-q * 0.15) - np.exp(-q * 1.5)), rel=0.1)


@pytest.mark.parametrize("make", [surfaces.rough, surfaces.rocks, surfaces.mars, surfaces.fractal], ids=lambda f: f.__name__)
def test_a_seed_determines_the_terrain(make) -> None:
    size = {"size": 6.0, "spacing": 0.02}
    assert np.array_equal(make(seed=1, **size).z, make(seed=1, **size).z)
    assert not np.array_equal(make(seed=1, **size).z, make(seed=2, **size).z)


@pytest.mark.parametrize("name", surfaces.__all__)
def test_each_has_its_sizes_as_keywords_and_a_name(name: str) -> None:
    make = getattr(surfaces, name)
    ground = make(spacing=0.05, interpolation="linear") if name not in ("rough",) else make(interpolation="linear")
    assert ground.interpolation == "linear"
    assert ground.name.startswith(name)
    if name != "paper":
        x0, y0, x1, y1 = make(size=(7.0, 5.0)).bounds
        assert (x1 - x0, y1 - y0, x0 + x1, y0 + y1) == pytest.approx((7, 5, 0, 0))
    assert make.__doc__
    assert "spacing" in inspect.signature(make).parameters


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: surfaces.plane(size=-1), "size is -1"),
        (lambda: surfaces.plane(size=(1, 2, 3)), "one number or two"),
        (lambda: surfaces.plane(spacing=0), "spacing is 0; give a finite number above 0"),
        (lambda: surfaces.plane(spacing=np.nan), "spacing is nan"),
        (lambda: surfaces.plane(size=1e6, spacing=0.01), "shrink it or coarsen"),
        (lambda: surfaces.plane(size=0.2, spacing=0.1), "too small: enlarge it or refine"),
        (lambda: surfaces.plane(2.0), "slope is 2.0 rad; .* less than a quarter turn"),
        (lambda: surfaces.plane(aspect=np.inf), "direction is inf"),
        (lambda: surfaces.ramp(0.3, -0.2), "cannot reach -0.2 m"),
        (lambda: surfaces.ramp(corner=-1), "corner is -1 m; give 0"),
        (lambda: surfaces.ditch(width=0.01), "narrower than two walls"),
        (lambda: surfaces.step(np.nan), "height is nan"),
        (lambda: surfaces.sine(wavelength=0), "wavelength is 0"),
        (lambda: surfaces.rough(max_slope=2), "max_slope is 2 rad"),
        (lambda: surfaces.rough(spacing=0.2), "too coarse for waves"),
        (lambda: surfaces.paper(length=1.0), "do not fit into 1 m"),
        (lambda: surfaces.paper(ramp_slope=16.7), "ramp_slope is 16.7 rad"),
        (lambda: surfaces.paper(run_in=np.nan), "run_in is nan"),
        (lambda: surfaces.fractal(hurst=1.5), "hurst is 1.5"),
        (lambda: surfaces.fractal(rms_slope=-1), "rms_slope is -1 rad"),
        (lambda: surfaces.rocks(0), "k is 0; give an area fraction"),
        (lambda: surfaces.rocks(0.9), "k is 0.9; give an area fraction"),
        (lambda: surfaces.rocks(0.1, smallest=0.01), "below two cells of 0.02 m"),
        (lambda: surfaces.rocks(0.1, smallest=2.0), "not below the largest"),
        (lambda: surfaces.mars(crater_density=2), "crater_density is 2"),
        (lambda: surfaces.plane(interpolation="quintic"), "interpolation 'quintic' is not known"),
    ],
)  # fmt: skip
def test_impossible_sizes_are_refused(call, sentence: str) -> None:
    with pytest.raises(rb.TerrainError, match=sentence):
        call()


def test_rough_terrain_has_the_same_bits_for_any_number_of_threads() -> None:
    program = "import rockerbogie as rb, sys; sys.stdout.buffer.write(rb.surfaces.rough(3).z.tobytes())"
    for threads in ("1", "2"):
        environment = os.environ | {"OPENBLAS_NUM_THREADS": threads}
        done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, check=True)
        assert done.stdout == surfaces.rough(3).z.tobytes(), f"{threads} threads of BLAS"
