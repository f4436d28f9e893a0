"""Both settle engines give the same poses."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.settling.engines import ENGINES, use_engine
from support.helpers import assert_close

PRESETS = ("elhami-dashti", "curiosity", "perseverance", "rocky7", "osr", "sawppy")
COUNT = 150


@pytest.mark.parametrize("surface", ["rough", "rocks"])
@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
@pytest.mark.parametrize("name", PRESETS)
def test_simd_and_scalar_engine_agree(name: str, interpolation: str, surface: str) -> None:
    rover = rb.load_rover(name)
    unit = float(rover.wheel_radius[0])
    grid = {"size": 60 * unit, "spacing": 0.3 * unit, "interpolation": interpolation}
    if surface == "rough":
        terrain = rb.surfaces.rough(5, max_slope=0.4, min_radius=3 * unit, **grid)
    else:
        terrain = rb.surfaces.rocks(0.1, 5, smallest=unit, largest=4 * unit, **grid)
    rng = np.random.default_rng(17)
    x, y = rng.uniform(-18, 18, (2, COUNT)) * unit
    arguments = (rover, terrain, x, y, rng.uniform(-3, 3, COUNT))
    steering = rng.uniform(-0.5, 0.5, (COUNT, 6)) * rover.steers
    simd = rb.settle(*arguments, steering=steering)
    with use_engine("scalar"):
        scalar = rb.settle(*arguments, steering=steering)
    assert np.array_equal(simd.status, scalar.status)
    assert np.isfinite(simd.z).sum() > 0.95 * COUNT
    assert_close(simd.q, scalar.q, 1e-9, "m, rad", "the same contacts, solved by two independent kernels")


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
def test_engines_agree_about_the_edge_of_the_map(mode: str, interpolation: str, missing: bool) -> None:
    """Lanes do not iterate where the whole rover is beyond the edge; the scalar engine does."""
    rover = rb.load_rover("curiosity")
    hills = rb.surfaces.fractal(5, size=12.0, spacing=0.5)
    z = hills.z.copy()
    z[5, 5] = np.nan if missing else z[5, 5]
    terrain = rb.Terrain.from_array(z, hills.spacing, hills.origin, interpolation)
    rng = np.random.default_rng(19)
    x, y = rng.uniform(-9.0, 9.0, (2, COUNT))
    x[:4] = (-1e6, 1e9, 6.0 + rover.wheelbase, -6.0 - 3.0 * rover.wheelbase)
    arguments = (rover, terrain, x, y, rng.uniform(-3, 3, COUNT))
    simd = rb.settle(*arguments, mode=mode)
    with use_engine("scalar"):
        scalar = rb.settle(*arguments, mode=mode)
    assert np.array_equal(simd.status, scalar.status)
    assert 0.1 < (simd.status == rb.Status.OFF_MAP).mean() < 0.9
    assert_close(simd.q, scalar.q, 1e-9, "m, rad", "the same contacts, solved by two independent kernels")


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
@pytest.mark.parametrize("name", ["elhami-dashti", "curiosity", "osr"])
def test_equilibria_from_the_six_wheel_pose_are_those_of_the_descent(name: str, interpolation: str) -> None:
    rover = rb.load_rover(name)
    unit, count = float(rover.wheel_radius[0]), 50
    grid = {"size": 60 * unit, "spacing": 0.4 * unit, "interpolation": interpolation}
    terrain = rb.surfaces.rocks(0.1, 6, smallest=unit, largest=4 * unit, **grid)
    rng = np.random.default_rng(18)
    x, y = rng.uniform(-18, 18, (2, count)) * unit
    arguments = (rover, terrain, x, y, rng.uniform(-3, 3, count))
    steering = rng.uniform(-0.5, 0.5, (count, 6)) * rover.steers
    simd = rb.settle(*arguments, steering=steering, mode="equilibrium")
    with use_engine("scalar"):
        scalar = rb.settle(*arguments, steering=steering, mode="equilibrium")
    assert np.array_equal(simd.status, scalar.status)
    assert (simd.status == rb.Status.CONVERGED).sum() > 0.5 * count
    assert (simd.q != scalar.q).any(axis=1).sum() > 0.3 * count, "few poses were taken from the six-wheel pose"
    assert_close(simd.q, scalar.q, 1e-9, "m, rad", "one equilibrium, by Newton's method and by quadratic programs")
    assert_close(simd.support.sum(axis=1), scalar.support.sum(axis=1), 1e-6, "N", "supports hold the weight")


def test_every_mode_and_interpolation_has_both_engines() -> None:
    modes, interpolations, engines = (set(column) for column in zip(*ENGINES, strict=True))
    assert set(ENGINES) == {(m, i, e) for m in modes for i in interpolations for e in engines}
    assert engines == {"simd", "scalar"}


def test_the_scalar_engine_ends_with_its_block() -> None:
    calls = []
    saved = dict(ENGINES)
    try:
        ENGINES.update({key: (lambda poses, key=key: (calls.append(key[2]), saved[key](poses))) for key in saved})
        rover, terrain = rb.load_rover("rocky7"), rb.surfaces.plane()
        with use_engine("scalar"):
            rb.settle(rover, terrain, 0.0, 0.0)
        rb.settle(rover, terrain, 0.0, 0.0)
    finally:
        ENGINES.update(saved)
    assert calls == ["scalar", "simd"]
