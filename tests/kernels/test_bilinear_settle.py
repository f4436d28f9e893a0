"""SIMD engine on bilinear terrain: minima, poses, and independence of the batch."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.batch import contact_mode
from rockerbogie._kernels.model import linkage, wheel
from rockerbogie._kernels.model.ground import META_X, META_Y, META_Z
from rockerbogie._kernels.search.tread import FOUND, least_gap
from rockerbogie._kernels.search.workspace import WORK_SIZE, lay_out
from rockerbogie._kernels.simd import bilinear_settle, cells
from rockerbogie._kernels.simd import linkage as simd_linkage
from rockerbogie._kernels.simd.layout import BILINEAR, BILINEAR_SIZE, CONTACT, LANES, POSE, WHEEL
from rockerbogie.settling import engines
from support import oracle
from support.helpers import paper_rover, random_rover

ROVERS = {
    "thin disc": rb.load_rover("rocky7").replace(wheel_width=np.zeros(6)),
    "rocky7": rb.load_rover("rocky7"),
    "perseverance": rb.load_rover("perseverance"),
    "odd": random_rover(np.random.default_rng(4)),
    "wide": paper_rover().replace(wheel_width=np.full(6, 0.15)),
}


def ground(kind: str, radius: float) -> rb.Terrain:
    """Return bilinear terrain; cell sizes and roughness are multiples of a wheel radius, m."""
    rng = np.random.default_rng(7)
    dx, dy, rough_by = {
        "noise": (0.8, 0.8, 0.15),
        "fine": (0.25, 0.3, 0.06),
        "coarse": (4.0, 4.0, 0.8),
        "stretched": (0.4, 1.6, 0.2),
        "blocks": (0.7, 0.7, 0.0),
        "plane": (1.0, 1.0, 0.0),
    }[kind]
    z = rng.normal(size=(160, 160)) * rough_by * radius
    if kind == "blocks":  # a third is raised by up to a wheel radius, with walls one cell wide
        z += np.kron(rng.uniform(0, 1.0, (40, 40)) * (rng.uniform(size=(40, 40)) < 0.33), np.ones((4, 4))) * radius
    if kind == "plane":
        z += radius * (0.1 * np.arange(160) - 0.05 * np.arange(160)[:, None])
    return rb.Terrain.from_array(z, (dx * radius, dy * radius), interpolation="linear")


def positions(terrain: rb.Terrain, rover: rb.Rover, count: int, seed: int = 3) -> tuple[np.ndarray, ...]:
    """Return random x, y (m) and yaw (rad), each (count,), with the rover on the map."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = terrain.bounds
    far = float(np.hypot(*np.abs(rover.hubs[:, :2]).max(axis=0)) + 2 * (rover.wheel_radius + rover.wheel_width).max())
    if 2 * far > min(x1 - x0, y1 - y0):
        pytest.skip("the map is smaller than the rover")
    return rng.uniform(x0 + far, x1 - far, count), rng.uniform(y0 + far, y1 - far, count), rng.uniform(-np.pi, np.pi, count)


@pytest.mark.parametrize("kind", ["noise", "fine", "coarse", "stretched", "blocks"])
@pytest.mark.parametrize("name", ROVERS)
def test_search_finds_the_minimum_or_rejects_the_lane(name: str, kind: str) -> None:
    """The scalar search is the reference; it is compared with the oracle elsewhere."""
    rover = ROVERS[name]
    terrain = ground(kind, float(rover.wheel_radius.min()))
    packed, car = terrain.packed, rover.packed
    if bilinear_settle.too_fine(packed.meta, car):
        pytest.skip("the SIMD engine is not used on cells this fine")
    x, y, yaw = positions(terrain, rover, 48)
    rng = np.random.default_rng(1)
    q = rng.normal(size=(48, 6)) * 0.15
    q[:, 0] = np.nan_to_num(terrain.height(x, y)) - packed.meta[META_Z] + rover.wheel_radius.max()
    buffer, S = np.zeros(WORK_SIZE), np.zeros(BILINEAR_SIZE)
    work = lay_out(buffer)
    linkage.set_hub_offsets(car, np.zeros(6), work.hub_offsets)
    sure = apart = 0
    for first in range(0, 48, LANES):
        for lane in range(LANES):
            k = first + lane
            S[POSE.x + lane], S[POSE.y + lane], S[POSE.yaw + lane] = (
                x[k] - packed.meta[META_X],
                y[k] - packed.meta[META_Y],
                yaw[k],
            )
            for n in range(6):
                S[POSE.q + n * LANES + lane] = q[k, n]
            for i in range(6):
                for n in range(5):
                    S[WHEEL[n] + i * LANES + lane] = work.hub_offsets[i, n]
        simd_linkage.set_heading(S)
        cells.set_home(S, packed.meta)
        simd_linkage.place_body(S, car)
        simd_linkage.place_wheels(S, car)
        bilinear_settle.search(S, S, packed.grid, packed.meta, car, True, 0)
        for lane in range(LANES):
            k = first + lane
            at = x[k] - packed.meta[META_X], y[k] - packed.meta[META_Y], math.cos(yaw[k]), math.sin(yaw[k])
            linkage.forward_kinematics(car, work.hub_offsets, *at, q[k], work.axes, work.pivots, work.wheels)
            for i in range(6):
                code, _ = least_gap(packed, work.wheels[i], 0.0, 1.0, 0.0, True, -math.inf, work.lowest, work.none)
                if code == FOUND and S[BILINEAR.rejected + i * LANES + lane] == 0.0:
                    sure += 1
                    apart += not abs(S[CONTACT.gap + i * LANES + lane] - work.lowest[wheel.GAP]) < 1e-10
    buffer[0] = 0.0
    assert apart == 0
    assert sure > 0.6 * 48 * 6


@pytest.mark.parametrize("kind", ["noise", "coarse", "stretched", "blocks", "plane"])
@pytest.mark.parametrize("name", ROVERS)
def test_poses_have_zero_gaps_by_the_oracle_and_equal_the_scalar_engine_s(name: str, kind: str) -> None:
    rover = ROVERS[name]
    terrain = ground(kind, float(rover.wheel_radius.min()))
    x, y, yaw = positions(terrain, rover, 64)
    given = terrain.packed, rover.packed, x, y, yaw, np.zeros((1, 6))
    q, status = np.full((64, 6), np.nan), np.zeros(64, np.uint8)
    grid, _, meta = terrain.packed
    contact_mode.settle_linear(grid, meta, *given[1:], q, status, np.arange(64), engines.NO_TOUCH, 0, 64)
    done = status != contact_mode.UNSETTLED
    if not bilinear_settle.too_fine(terrain.packed.meta, rover.packed):
        assert done.mean() > (0.95 if kind == "plane" else 0.5)
    alone, codes = np.full((64, 6), np.nan), np.zeros(64, np.uint8)
    contact_mode.settle_left(*given, alone, codes, np.arange(64), 0, 64)
    if not done.any():
        return
    # six equations may have several solutions; nearly always both engines find the same one
    same = np.abs(q[done] - alone[done]).max(axis=1) < 1e-8
    assert same.mean() > 0.9
    assert np.array_equal(status[done][same], codes[done][same])
    wheels = oracle.stand(rover, x[done], y[done], yaw[done], q[done])
    assert np.abs(oracle.least_gap(oracle.Ground.of(terrain), wheels).gap).max() < 2e-10


@pytest.mark.parametrize("name", ROVERS)
@pytest.mark.parametrize("cell", [1.0, 4.0, 12.0])
def test_wheels_along_the_grid_on_nearly_level_terrain_converge(name: str, cell: float) -> None:
    """Half a rim lies over one cell, its ends as high as the axle: its bound is close to 0 / 0."""
    rover = ROVERS[name]
    r = float(rover.wheel_radius.min())
    for roughness in (1e-3, 1e-2, 0.1):
        z = np.random.default_rng(2).normal(size=(150, 150)) * roughness * r
        terrain = rb.Terrain.from_array(z, cell * r, interpolation="linear")
        x, y, _ = positions(terrain, rover, 300)
        pose = rb.settle(rover, terrain, x, y, np.random.default_rng(4).integers(-4, 5, 300) * np.pi / 2)
        assert (pose.status == rb.Status.CONVERGED).all()
        assert np.abs(pose.gap).max() < 1e-9


@pytest.mark.parametrize("name", ROVERS)
def test_no_tread_lies_over_missing_data(name: str) -> None:
    """The scalar search gives a finite gap for each wheel of each pose."""
    rover = ROVERS[name]
    r = float(rover.wheel_radius.min())
    for cell in (0.5, 1.0):
        rng = np.random.default_rng(6)
        z = rng.normal(size=(200, 200)) * 0.1 * r
        z[rng.uniform(size=z.shape) < 0.01] = np.nan
        terrain = rb.Terrain.from_array(z, cell * r, interpolation="linear")
        x, y, yaw = positions(terrain, rover, 3000)
        pose = rb.settle(rover, terrain, x, y, yaw)
        known = pose.status != rb.Status.NO_DATA
        assert 0.02 < known.mean() < 0.98
        assert np.isfinite(pose.gap[known & np.isfinite(pose.z)]).all()


@pytest.mark.parametrize("name", ROVERS)
def test_a_pose_on_rough_terrain_is_independent_of_the_batch(name: str) -> None:
    """On a map with missing data, results are bit-identical alone and in any order."""
    rover = ROVERS[name]
    whole = ground("blocks", float(rover.wheel_radius.min()))
    z = whole.z.copy()
    z[np.random.default_rng(5).uniform(size=z.shape) < 0.001] = np.nan
    terrain = rb.Terrain.from_array(z, whole.spacing, interpolation="linear")
    x, y, yaw = positions(terrain, rover, 150)
    x[::11] -= terrain.bounds[2] / 2  # some off the map
    steering = np.where(rover.steers, np.random.default_rng(6).uniform(-0.5, 0.5, (150, 6)), 0.0)
    together = rb.settle(rover, terrain, x, y, yaw, steering=steering)
    assert {rb.Status.CONVERGED, rb.Status.OFF_MAP} <= set(together.status)
    order = np.random.default_rng(8).permutation(150)
    apart = rb.settle(rover, terrain, x[order], y[order], yaw[order], steering=steering[order])
    assert np.array_equal(apart.q, together.q[order], equal_nan=True)
    assert np.array_equal(apart.status, together.status[order])
    for k in range(0, 150, 13):
        alone = rb.settle(rover, terrain, x[k], y[k], yaw[k], steering=steering[k])
        assert np.array_equal(alone.q, together.q[k], equal_nan=True)
    for count in (2, 3, 5, 6, 8, 9, 13, 14, 17):  # in parts of a block, in half a block, in a block
        part = slice(7, 7 + count)
        few = rb.settle(rover, terrain, x[part], y[part], yaw[part], steering=steering[part])
        assert np.array_equal(few.q, together.q[part], equal_nan=True)


@pytest.mark.parametrize("yaw", [0.3, math.pi / 4])
def test_lanes_decide_rims_that_turn_back_over_a_grid_line(yaw: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """At nodes of a map of wide cells, fewer than 1 of 200 poses are left to the scalar engine."""
    left = []
    alone = engines.parallel_for

    def counted(kernel, count, *arguments, **options):
        if kernel is contact_mode.settle_left:
            left.append(count)
        alone(kernel, count, *arguments, **options)

    monkeypatch.setattr(engines, "parallel_for", counted)
    terrain = rb.surfaces.fractal(2, size=120.0, spacing=1.0, interpolation="linear")
    x, y = np.meshgrid(np.arange(-50.0, 51.0), np.arange(-50.0, 51.0))
    pose = rb.settle(rb.load_rover("curiosity"), terrain, x, y, yaw)
    assert (pose.status == rb.Status.CONVERGED).all()
    assert np.abs(pose.gap).max() < 1e-9
    assert sum(left) < x.size / 200
