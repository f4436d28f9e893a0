"""SIMD engine on cubic terrain: independence of the batch, gaps, verified minima."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.model import wheel
from rockerbogie._kernels.search import tread, verify_minimum
from rockerbogie._kernels.search.workspace import WORK_SIZE, lay_out
from support import oracle
from support.helpers import paper_rover, random_rover


def smooth_ground(seed: int, steep: float, shortest: float, cell: float = 0.25, size: float = 12.0) -> rb.Terrain:
    """Return waves of random lengths, at least `shortest` m, with slopes of about `steep`."""
    rng = np.random.default_rng(seed)
    x = np.arange(0, size, cell)
    X, Y = np.meshgrid(x, x)
    z = np.zeros_like(X)
    for _ in range(12):
        k = rng.normal(size=2)
        k *= 2 * np.pi / (np.linalg.norm(k) * rng.uniform(shortest, 4 * shortest))
        z += steep / (4 * np.linalg.norm(k)) * np.sin(k[0] * X + k[1] * Y + rng.uniform(0, 7))
    return rb.Terrain.from_array(z, cell)


ROVERS = {
    "paper's disc": paper_rover(),
    "curiosity": rb.load_rover("curiosity"),
    "odd": random_rover(np.random.default_rng(4)),
    "wide": paper_rover().replace(wheel_width=np.full(6, 0.15)),
}


@pytest.mark.parametrize("name", ROVERS)
def test_a_pose_is_independent_of_the_batch(name: str) -> None:
    """Results are bit-identical alone and in any order."""
    rover, terrain = ROVERS[name], smooth_ground(1, 0.4, 1.5)
    rng = np.random.default_rng(2)
    x, y, yaw = rng.uniform(2, 10, 100), rng.uniform(2, 10, 100), rng.uniform(-9, 9, 100)
    x[::7] = rng.uniform(-1, 2, len(x[::7]))  # some near the edge of the map and beyond it
    steering = np.where(rover.steers, rng.uniform(-0.5, 0.5, (100, 6)), 0.0)
    together = rb.settle(rover, terrain, x, y, yaw, steering=steering)
    assert {rb.Status.CONVERGED, rb.Status.OFF_MAP} <= set(together.status)
    order = rng.permutation(100)
    apart = rb.settle(rover, terrain, x[order], y[order], yaw[order], steering=steering[order])
    assert np.array_equal(apart.q, together.q[order], equal_nan=True)
    assert np.array_equal(apart.status, together.status[order])
    for k in range(0, 100, 9):
        alone = rb.settle(rover, terrain, x[k], y[k], yaw[k], steering=steering[k])
        assert np.array_equal(alone.q, together.q[k], equal_nan=True)
    for count in (2, 8, 9, 17):  # in half a block and in a block
        part = slice(5, 5 + count)
        few = rb.settle(rover, terrain, x[part], y[part], yaw[part], steering=steering[part])
        assert np.array_equal(few.q, together.q[part], equal_nan=True)


@pytest.mark.parametrize("name", ["curiosity", "elhami-dashti"])
def test_gaps_after_the_last_newton_step_are_below_a_nanometre(name: str) -> None:
    """Gaps of rims with a single contact are not computed again after the last step."""
    rover = rb.load_rover(name).replace(wheel_width=np.zeros(6))
    radius = float(rover.wheel_radius.max())
    terrain = rb.surfaces.rough(1, max_slope=np.radians(28), min_radius=6 * radius, size=8 * rover.wheelbase)
    x0, y0, x1, y1 = terrain.bounds
    rng = np.random.default_rng(1)
    pose = rb.settle(rover, terrain, rng.uniform(x0, x1, 20000), rng.uniform(y0, y1, 20000), rng.uniform(-7, 7, 20000))
    settled = pose.status == rb.Status.CONVERGED
    assert settled.mean() > 0.6
    assert np.abs(pose.gap[settled]).max() < 1e-9


def test_headings_that_differ_by_full_turns_give_the_same_pose() -> None:
    rover, terrain = ROVERS["curiosity"], smooth_ground(1, 0.4, 1.5)
    yaw = np.array([0.7, 1e4, 1e9, -1e15, 1e300])
    far = rb.settle(rover, terrain, 6.0, 6.0, yaw)
    near = rb.settle(rover, terrain, 6.0, 6.0, np.arctan2(np.sin(yaw), np.cos(yaw)))
    assert (far.status == rb.Status.CONVERGED).all()
    assert np.abs(far.q - near.q).max() < 1e-9
    assert np.abs(far.gap).max() < 1e-9


@pytest.mark.parametrize("name", ROVERS)
@pytest.mark.parametrize(("steep", "shortest"), [(0.3, 3.0), (0.5, 0.8), (1.0, 0.6)])
def test_gaps_on_waves_are_zero_by_the_oracle(name: str, steep: float, shortest: float) -> None:
    """Some waves are so short that wheels bridge them."""
    rover, terrain = ROVERS[name], smooth_ground(3, steep, shortest)
    rng = np.random.default_rng(5)
    x, y, yaw = rng.uniform(2.5, 9.5, (3, 40))
    pose = rb.settle(rover, terrain, x, y, yaw)
    good = pose.status == rb.Status.CONVERGED
    assert good.mean() > 0.9
    wheels = oracle.stand(rover, x[good], y[good], yaw[good], pose.q[good])
    least = oracle.least_gap(oracle.Ground.of(terrain), wheels)
    assert np.abs(least.gap).max() < 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_a_verified_minimum_is_the_minimum(seed: int) -> None:
    """If `is_least` accepts a rim's lowest point, the oracle finds no lower point of the tread.

    Rims are at both ends of the width and in its middle. It accepts more than 20 of 75 points.
    """
    rng = np.random.default_rng(seed)
    decided = 0
    for _ in range(25):
        terrain = smooth_ground(
            int(rng.integers(1 << 30)), rng.uniform(0.1, 0.8), rng.uniform(0.7, 4.0), rng.choice([0.3, 1.0]), 9.0
        )
        radius, half = rng.uniform(0.1, 0.4), rng.uniform(0.0, 0.3)
        tilt, ahead = rng.uniform(-0.3, 0.3), rng.uniform(-np.pi, np.pi)
        axle = np.array([-math.sin(ahead) * math.cos(tilt), math.cos(ahead) * math.cos(tilt), math.sin(tilt)])
        hub = np.array([*rng.uniform(3, 6, 2), 0.0])
        hub[2] = terrain.height(*hub[:2]) + radius
        w = np.zeros(wheel.WHEEL_SIZE)
        assert wheel.make_wheel(w, *hub[:2], hub[2] - terrain.meta[2], *axle, 0.0, 0.0, 1.0, radius, half)
        upright = np.cross([math.cos(ahead), math.sin(ahead), 0.0], axle)
        phi = np.linspace(-1.4, 1.4, 20001)
        for place in (-half, 0.0, half):
            level = np.array([math.cos(ahead), math.sin(ahead), 0.0])
            points = hub + place * axle + radius * (np.sin(phi)[:, None] * level - np.cos(phi)[:, None] * upright)
            gap = points[:, 2] - terrain.height(points[:, 0], points[:, 1])
            at, low = phi[gap.argmin()], gap.min()
            w[wheel.HZ] = hub[2] - terrain.meta[2] - low  # lowered until this point is in contact
            buffer = np.zeros(WORK_SIZE)  # `work` does not own it
            work = lay_out(buffer)
            verdict = verify_minimum.is_least(terrain.packed, w, math.sin(at), math.cos(at), place, work.lowest, work.none)
            buffer[0] = 0.0
            if verdict != verify_minimum.LEAST:
                continue
            decided += 1
            down = hub - [0, 0, low]
            frame = (np.array([v]) for v in (down, level, axle, upright))
            one = oracle.Wheels(*frame, np.array([radius]), np.array([half]))
            least = oracle.least_gap(oracle.Ground.of(terrain), one, tolerance=1e-9)
            assert least.gap.min() > -2e-8  # the lowest of 20,001 samples is within r (1e-4)² / 8 of the minimum
    assert decided > 20


@pytest.mark.parametrize("keep", [-math.inf, 1e-3])
def test_rims_hold_the_only_low_point_where_bounds_show_it(keep: float) -> None:
    """Bounds decide half of the treads; the search finds the same minimum and no other."""
    rng = np.random.default_rng(9)
    decided = 0
    for _ in range(60):
        terrain = smooth_ground(int(rng.integers(1 << 30)), rng.uniform(0.1, 0.6), rng.uniform(2.0, 6.0), 1.0, 20.0)
        radius, half = rng.uniform(0.1, 0.4), rng.uniform(0.0, 0.3)
        tilt, ahead = rng.uniform(-0.3, 0.3), rng.uniform(-np.pi, np.pi)
        axle = np.array([-math.sin(ahead) * math.cos(tilt), math.cos(ahead) * math.cos(tilt), math.sin(tilt)])
        x, y = rng.uniform(6, 12, 2)
        w = np.zeros(wheel.WHEEL_SIZE)
        hub_z = float(terrain.height(x, y)) + radius - terrain.meta[2]
        assert wheel.make_wheel(w, x, y, hub_z, *axle, 0.0, 0.0, 1.0, radius, half)
        buffer = np.zeros(WORK_SIZE)  # `work` does not own it
        work = lay_out(buffer)
        code, _ = tread.least_gap(terrain.packed, w, 0.0, 1.0, 0.0, True, -math.inf, work.lowest, work.none)
        assert code == tread.FOUND
        lowest = work.lowest.copy()
        limit = keep + lowest[wheel.GAP] if keep > 0.0 else keep
        if verify_minimum._least_of_rims(terrain.packed, w, 0.0, 1.0, limit, work.lowest):
            decided += 1
            assert work.lowest[wheel.GAP] == pytest.approx(lowest[wheel.GAP], abs=1e-9)
            _, kept = tread.least_gap(terrain.packed, w, 0.0, 1.0, 0.0, True, limit, work.lowest, work.contacts)
            for _, sine, cosine, s in work.contacts[:kept]:
                if max(abs(sine - lowest[wheel.SIN]), abs(s - lowest[wheel.PLACE])) < 1e-4:
                    continue
                # an end of an arc in one cell: the gap falls beyond it
                a = math.atan2(sine, cosine)
                turned = [(math.sin(b), math.cos(b)) for b in (a, a + 1e-4, a - 1e-4)]
                gaps = [wheel.gap_at(terrain.grid, terrain.meta, w, *at, s) for at in turned]
                assert min(gaps[1:]) < gaps[0]
        buffer[0] = 0.0
    assert decided > 30


def test_a_contact_of_a_thin_disc_is_listed_once() -> None:
    """Ends of halved arcs are not listed beside the contact, except at a cell's side."""
    rng = np.random.default_rng(4)
    t = rb.Terrain.from_array(0.02 * rng.normal(size=(121, 121)), 0.1, interpolation="cubic")
    buffer = np.zeros(WORK_SIZE)  # `work` does not own it
    work, listed = lay_out(buffer), []
    for x, y in rng.uniform(4.0, 8.0, (40, 2)):
        w, ahead = np.zeros(wheel.WHEEL_SIZE), rng.uniform(-np.pi, np.pi)
        assert wheel.make_wheel(w, x, y, 1.0, -math.sin(ahead), math.cos(ahead), 0.0, 0.0, 0.0, 1.0, 0.25, 0.0)
        code, _ = tread.least_gap(t.packed, w, 0.0, 1.0, 0.0, True, -math.inf, work.lowest, work.none)
        assert code == tread.FOUND
        keep = work.lowest[wheel.GAP] + 1e-6
        listed.append(tread.least_gap(t.packed, w, 0.0, 1.0, 0.0, True, keep, work.lowest, work.contacts)[1])
    buffer[0] = 0.0
    assert min(listed) >= 1
    assert max(listed) <= 2
