"""Tables of wheel forces: error, derivatives, symmetry, limits."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.terrain.soil.laws import WheelLaw
from rockerbogie.terrain.soil.table import ForceTable, tabulate

LAWS: dict[str, WheelLaw] = {
    "lunar": rb.load_soil("lunar-lrv-b"),
    "ishigami": rb.load_soil("ishigami-simulant"),
    "coulomb": rb.Coulomb(0.6),
    "curve": rb.SlipCurve(0.29, 4.0, rolling=0.05),
}
LOADS = (0.2, 120.0)


@pytest.fixture(scope="module", params=LAWS)
def table(request: pytest.FixtureRequest) -> ForceTable:
    """Return the table of each law for one wheel."""
    return tabulate(LAWS[request.param], 0.09, 0.11, LOADS)


def motions(n: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Return random loads and forward motions (load, rim, vx, vy), away from slip 1 and -1."""
    rng = np.random.default_rng(seed)
    return rng.uniform(1.0, 100.0, n), rng.uniform(0.1, 1.0, n), rng.uniform(0.1, 1.0, n), rng.uniform(-1.0, 1.0, n)


def test_table_agrees_with_the_law(table: ForceTable) -> None:
    rng = np.random.default_rng(1)
    load, slip, angle = rng.uniform(1.0, 100.0, 500), rng.uniform(-0.9, 0.9, 500), rng.uniform(-1.4, 1.4, 500)
    exact = rb.wheel_soil_forces(table.law, 0.09, 0.11, load, slip, angle)
    found, status = table.forces(load, slip, angle)
    assert (exact.status == rb.ForceStatus.COMPUTED).all()
    assert (status == rb.ForceStatus.COMPUTED).all()
    for row, (values, scale) in enumerate(
        [(exact.drawbar, load), (exact.side, load), (exact.torque, 0.09 * load), (exact.sinkage, 0.09)]
    ):
        apart = np.abs(found[:, row, 0] - values) / scale
        assert apart.max() < 0.01, f"row {row}: {apart.max():.2g} of the load"
        assert np.sqrt((apart**2).mean()) < 1e-3


def test_derivatives_are_those_of_the_values(table: ForceTable) -> None:
    base = motions(400)
    out, _ = table.motion_forces(*base)
    for k in range(4):
        step = 1e-6 * (100.0 if k == 0 else 1.0)
        low, high = ([v + sign * step if i == k else v for i, v in enumerate(base)] for sign in (-1.0, 1.0))
        numeric = (table.motion_forces(*high)[0] - table.motion_forces(*low)[0])[..., 0] / (2.0 * step)
        scale = np.maximum(np.abs(out[..., k + 1]), 1e-3 * np.abs(out[..., k + 1]).max(axis=0) + 1e-12)
        assert (np.abs(numeric - out[..., k + 1]) / scale).max() < 1e-3


def test_derivatives_by_slip_and_angle(table: ForceTable) -> None:
    rng = np.random.default_rng(2)
    base = [rng.uniform(1.0, 100.0, 300), rng.uniform(-0.8, 0.8, 300), rng.uniform(-1.2, 1.2, 300)]
    out, _ = table.forces(*base)
    for k in (1, 2):
        low, high = ([v + sign * 1e-6 if i == k else v for i, v in enumerate(base)] for sign in (-1.0, 1.0))
        numeric = (table.forces(*high)[0] - table.forces(*low)[0])[..., 0] / 2e-6
        assert np.abs(numeric - out[..., k + 1]).max() < 1e-4 * np.abs(out[..., k + 1]).max()


def test_table_is_smooth_at_rolling_and_odd_in_the_slip_angle(table: ForceTable) -> None:
    below, above = table.forces(50.0, -1e-9, 0.3)[0], table.forces(50.0, 1e-9, 0.3)[0]
    assert np.abs(below - above).max() < 1e-5 * np.abs(above).max()
    left, right = table.forces(50.0, 0.2, 0.3)[0], table.forces(50.0, 0.2, -0.3)[0]
    assert left[[0, 2, 3], 0] == pytest.approx(right[[0, 2, 3], 0], rel=1e-13)
    assert left[1, 0] == pytest.approx(-right[1, 0], rel=1e-13)
    assert left[1, 0] < 0.0
    low, high = table.forces(50.0, 0.2, -1e-9)[0], table.forces(50.0, 0.2, 1e-9)[0]
    assert np.abs(low[:, 1:] * [[1], [-1], [1], [1]] * [1, 1, -1] - high[:, 1:]).max() < 1e-5 * np.abs(high).max()


def test_wheel_in_reverse_is_the_mirror_image(table: ForceTable) -> None:
    load, rim, vx, vy = motions(50)
    forward, backward = table.motion_forces(load, rim, vx, vy)[0], table.motion_forces(load, -rim, -vx, vy)[0]
    sign = np.array([-1.0, 1.0, -1.0, 1.0])
    assert np.array_equal(forward[..., 0], backward[..., 0] * sign)
    assert np.array_equal(forward[..., 3], -backward[..., 3] * sign)


def test_only_the_direction_of_the_motion_counts(table: ForceTable) -> None:
    load, rim, vx, vy = motions(50)
    out, _ = table.motion_forces(load, rim, vx, vy)
    fast, _ = table.motion_forces(load, 8 * rim, 8 * vx, 8 * vy)
    assert np.allclose(out[..., 0], fast[..., 0], rtol=1e-12, atol=1e-12)
    euler = out[..., 2] * rim[:, None] + out[..., 3] * vx[:, None] + out[..., 4] * vy[:, None]
    assert np.abs(euler).max() < 1e-9 * np.abs(out[..., 2:]).max()


def test_force_is_finite_and_continuous_in_every_motion(table: ForceTable) -> None:
    turn = np.linspace(-np.pi, np.pi, 4001)
    tilt = np.array([0.0, 0.4, 1.2, 0.5 * np.pi])[:, None]
    rim, vx, vy = np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt) + 0 * turn
    out, status = table.motion_forces(50.0, rim, vx, vy)
    assert np.isfinite(out).all()
    steep = isinstance(table.law, rb.Coulomb | rb.SlipCurve)
    assert np.abs(np.diff(out[:, :, :3, 0], axis=1)).max() < (0.4 if steep else 0.1) * 50.0
    if not steep:
        against = (rim * vx < -1e-9) & (np.abs(rim * vx) > 1e-9)
        assert (status[against] == rb.ForceStatus.OUT_OF_RANGE).all()


def test_loads_outside_the_table(table: ForceTable) -> None:
    small, _ = table.forces([0.0, 0.05, 0.1], 0.3, 0.1)
    assert np.abs(small[0, :3, 0]).max() == 0.0
    assert small[2, :3, 0] == pytest.approx(2.0 * small[1, :3, 0], rel=1e-12)
    if table.law.packed(table.wheel, 9.8)[0] == 0:
        _, status = table.forces(150.0, 0.1, 0.0)
        assert status == rb.ForceStatus.OUT_OF_RANGE
