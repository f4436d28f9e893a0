"""Gaps and contacts of the scalar kernels over the whole tread, compared with the oracle."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.model.linkage import forward_kinematics, set_hub_offsets
from rockerbogie._kernels.model.wheel import CONTACT_SIZE, GAP
from rockerbogie._kernels.search.tread import OFF, least_gap
from rockerbogie._kernels.search.workspace import WORK_SIZE, lay_out
from rockerbogie._kernels.solve.newton import a_wheel_is_off
from support import oracle
from support.helpers import assert_close
from support.strategies import GROUNDS, heights, terrain_around

BRACKET = 1e-10  # m, for wheels of about 1 m radius


def any_pose(kind: str, interpolation: str, seed: int, count: int = 8) -> rb.Pose:
    """Return poses that are not settled: below and above the terrain, any attitude and steering."""
    rng = np.random.default_rng([seed, GROUNDS.index(kind)])
    wide = rng.choice([0.0, rng.uniform(0, 0.2), rng.uniform(0.2, 1.5), 1.5])
    rover = rb.Rover.from_pivots(
        wheel_radius=rng.uniform(0.5, 1.05, 3),
        wheel_width=wide * (rng.random(3) < 0.8),
        rocker_pivot=(0, 1, 1),
        bogie_pivot=(-1.5, 1, 0.5),
        hubs=[(2.4, 2.0, 0), (0, 2.0, 0), (-2.4, 2.0, 0)],
    )
    terrain = terrain_around(kind, rng, 1.0, np.exp(rng.uniform(np.log(0.3), np.log(12))), 8.0, interpolation)
    x, y = rng.uniform(-2, 2, (2, count))
    yaw = rng.choice([0, np.pi / 2, np.pi, -np.pi / 2], count) if rng.random() < 0.3 else rng.uniform(-np.pi, np.pi, count)
    tilt = rng.choice([0.0, 0.1, 0.5])
    q = np.stack(
        [
            terrain.height(x, y) + rng.uniform(-1, 2, count),
            *(tilt * rng.uniform(-1, 1, (2, count))),
            0.4 * tilt * rng.uniform(-1, 1, count),
            *rng.uniform(-0.6, 0.6, (2, count)),
        ],
        axis=-1,
    )
    steering = rng.choice([0.0, 0.6, 1.5]) * rng.uniform(-1, 1, (count, 6))
    return rb.Pose(rover, terrain, x, y, yaw, steering, q, np.zeros(count, np.uint8))


def wheels_of(pose: rb.Pose, q: np.ndarray | None = None) -> oracle.Wheels:
    return oracle.stand(pose.rover, pose.x, pose.y, pose.yaw, pose.q if q is None else q, pose.steering)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_the_oracle_s_bracket_contains_the_minimum_of_dense_samples(interpolation: str) -> None:
    """No sample of 3,001 × 121 on each tread is lower, and the lowest is within 2 cm."""
    for kind in ("white", "rocks", "step"):
        pose = any_pose(kind, interpolation, 3, 4)
        ground, wheels = oracle.Ground.of(pose.terrain), wheels_of(pose)
        xy = np.random.default_rng(0).uniform(-8, 8, (2, 500))
        assert_close(ground.height(*xy), pose.terrain.height(*xy), 1e-12, "m", "both evaluate the same surface")
        least = oracle.least_gap(ground, wheels, BRACKET)
        phi, side = (a.ravel() for a in np.meshgrid(np.linspace(-np.pi, np.pi, 3001), np.linspace(-1, 1, 121)))
        for i in range(0, 24, 5):
            point = wheels.take([i]).tread(phi, side * wheels.half[i])[0]
            dense = (point[:, 2] - ground.height(point[:, 0], point[:, 1])).min()
            assert -BRACKET <= dense - least.gap[i] < 0.02, f"{kind}: {dense} sampled, {least.gap[i]} by the oracle"


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("kind", GROUNDS)
def test_gap_is_the_minimum_over_the_whole_tread(kind: str, interpolation: str) -> None:
    for seed in range(2):
        pose = any_pose(kind, interpolation, seed)
        least = oracle.least_gap(oracle.Ground.of(pose.terrain), wheels_of(pose), BRACKET)
        assert_close(pose.gap.ravel(), least.gap, 1e-9, "m", f"{interpolation} {kind} terrain, draw {seed}")


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("origin", [0.0, 1e4])
def test_gap_on_grid_lines_and_on_the_edge_of_the_map_is_the_minimum(interpolation: str, origin: float) -> None:
    """Hubs lie on nodes, wheels along the grid.

    Rounding must not put a rim outside both cells or off the map.
    """
    cell, nodes = 0.3, 21
    for seed, kind in enumerate(GROUNDS):
        rng = np.random.default_rng([seed, 5])
        terrain = rb.Terrain.from_array(heights(kind, rng, nodes, nodes, 0.5), cell, (origin, -origin), interpolation)
        width = rng.choice([0.0, 0.0, 2 * cell])
        side = 2.1 if width == 0.0 else 1.5
        rover = rb.Rover.from_pivots(
            wheel_radius=0.6,
            wheel_width=width,
            rocker_pivot=(0, side, 1),
            bogie_pivot=(-0.9, side, 0.5),
            hubs=[(1.5, side, 0), (0, side, 0), (-1.5, side, 0)],
        )
        middle = cell * (nodes - 1) / 2
        across = np.array([0.0, 0.0, 0.3, 0.9, 0.9, -0.9])  # at 0.9 the left wheels lie along the map's edge
        x, y = np.full(6, origin + middle), -origin + middle + across
        q = np.zeros((6, 6))
        q[:, 0] = rng.uniform(0.6, 3, 6)
        q[::2, 2] = 0.2
        pose = rb.Pose(rover, terrain, x, y, np.array([0, np.pi, 0, 0, 0, 0.0]), np.zeros((6, 6)), q, np.zeros(6, np.uint8))
        least = oracle.least_gap(oracle.Ground.of(terrain), wheels_of(pose), BRACKET)
        assert_close(pose.gap.ravel(), least.gap, 2e-9, "m", f"{interpolation} {kind} terrain, origin {origin}")


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_contact_point_is_on_the_tread_and_higher_than_the_terrain_by_the_gap(interpolation: str) -> None:
    for kind in GROUNDS:
        pose = any_pose(kind, interpolation, 11)
        wheels, point = wheels_of(pose), pose.contact_point.reshape(-1, 3)
        over = point[:, 2] - oracle.Ground.of(pose.terrain).height(point[:, 0], point[:, 1])
        assert_close(over, pose.gap.ravel(), 1e-9, "m", f"the contact is above {kind} terrain by the gap")
        arm = point - wheels.hub
        along = (arm * wheels.Y).sum(-1)
        assert_close(np.hypot((arm * wheels.X).sum(-1), (arm * wheels.Z).sum(-1)), wheels.radius, 1e-9, "m", "on the rim")
        assert (abs(along) <= wheels.half + 1e-12).all(), f"{kind}: the contact is beside the tread"
        angle = pose.contact_angle.ravel()
        rim = wheels.hub + along[:, None] * wheels.Y
        rim -= wheels.radius[:, None] * (np.sin(angle)[:, None] * wheels.X + np.cos(angle)[:, None] * wheels.Z)
        assert_close(point, rim, 1e-9, "m", "the contact angle is that of eq. 5")


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_rate_of_the_gap_is_the_contact_s_velocity_along_the_normal(interpolation: str) -> None:
    """It holds for a small motion of the linkage, except where two contacts have equal gaps."""
    step, seen = 1e-6, 0
    for kind in set(GROUNDS) - {"flat", "plane"}:  # there the gap of a level wide wheel is constant along its width
        pose = any_pose(kind, interpolation, 7)
        wheels, normal = wheels_of(pose), pose.contact_normal.reshape(-1, 3)
        arm = pose.contact_point.reshape(-1, 3) - wheels.hub
        s = (arm * wheels.Y).sum(-1)
        phi = np.arctan2(-(arm * wheels.X).sum(-1), -(arm * wheels.Z).sum(-1))
        for unknown in np.eye(6):
            ahead, behind = (
                rb.Pose(
                    pose.rover, pose.terrain, pose.x, pose.y, pose.yaw, pose.steering, pose.q + sign * step * unknown, pose.status
                )
                for sign in (1, -1)
            )
            moved = (wheels_of(ahead).tread(phi, s)[0] - wheels_of(behind).tread(phi, s)[0]) / (2 * step)
            predicted = (moved * normal).sum(-1) / normal[:, 2]
            rate = ((ahead.gap - behind.gap) / (2 * step)).ravel()
            generic = abs(ahead.gap + behind.gap - 2 * pose.gap).ravel() / step < 1e-3
            seen += generic.sum()
            assert_close((rate / (1 + abs(rate)))[generic], (predicted / (1 + abs(rate)))[generic], 1e-3, "", f"{kind} terrain")
    assert seen > 2000


def test_separate_contacts_are_counted() -> None:
    """Level terrain or one bar gives 1 contact; bars on both sides of the hub give 2."""
    radius, cell = 0.1, 0.02
    rover = rb.Rover.from_pivots(
        wheel_radius=radius,
        rocker_pivot=(0, 0.3, 0.3),
        bogie_pivot=(-0.2, 0.3, 0.2),
        hubs=[(0.5, 0.3, 0.1), (0, 0.3, 0.1), (-0.4, 0.3, 0.1)],
    )
    x = cell * np.arange(-60, 61)
    flat = np.zeros((x.size, x.size))
    high = 0.03

    def on_bars(*ahead: float) -> rb.Pose:
        """Return a level rover with front wheels on bars along y, `ahead` m ahead of their hubs."""
        z = flat.copy()
        for distance in ahead:
            z[:, np.isclose(x, 0.5 + distance)] = high
        hub = 0.1 if not ahead else high + np.sqrt(radius**2 - ahead[0] ** 2)
        q = np.array([hub - 0.1, 0, 0, 0, 0, 0])
        terrain = rb.Terrain.from_array(z, cell, (x[0], x[0]), "linear")
        return rb.Pose(rover, terrain, *np.zeros((3, 1)), np.zeros((1, 6)), q[None], np.zeros(1, np.uint8))

    assert on_bars().contact_count.tolist() == [[1] * 6]
    assert on_bars(0.04).contact_count[0, :2].tolist() == [1, 1]
    assert on_bars(0.04, -0.04).contact_count[0, :2].tolist() == [2, 2]
    assert_close(on_bars(0.04, -0.04).gap[0, :2], 0.0, 1e-15, "m", "a rim over two bars")


def test_a_tread_within_1_mm_of_the_map_s_edge_is_on_the_map() -> None:
    rover = rb.load_rover("elhami-dashti")
    ahead = float(rover.hubs[:, 0].max() + rover.wheel_radius[0])
    beside = float(rover.hubs[:, 1].max())
    terrain = rb.Terrain.from_array(np.zeros((33, 65)), 0.0625, interpolation="linear")
    west, south, east, _ = terrain.bounds
    margin = 1e-3
    inside = rb.settle(rover, terrain, east - ahead - margin, south + beside + margin)
    assert inside.status == rb.Status.CONVERGED
    for x, y in (
        (east - ahead + margin, south + beside + margin),
        (east - ahead - margin, south + beside - margin),
        (west - 1, 0),
        (9e9, 0),
    ):
        assert rb.settle(rover, terrain, x, y).status == rb.Status.OFF_MAP


@pytest.mark.parametrize("width", [0.0, 0.3])
def test_a_wheel_off_the_map_is_one_whose_search_finds_no_terrain(width: float) -> None:
    """Tilted rovers across all four edges: the box decides as the search does."""
    rover = rb.Rover.from_pivots(
        wheel_radius=0.5,
        wheel_width=width,
        rocker_pivot=(0, 1, 1),
        bogie_pivot=(-1.5, 1, 0.5),
        hubs=[(2.4, 2, 0), (0, 2, 0), (-2.4, 2, 0)],
    )
    terrain = rb.surfaces.fractal(1, size=16.0, spacing=0.5, interpolation="linear")
    rng = np.random.default_rng(0)
    buffer = np.empty(WORK_SIZE)
    work, meta, none = lay_out(buffer), terrain.packed[2], np.empty((0, CONTACT_SIZE))
    set_hub_offsets(rover.packed, np.zeros(6), work.hub_offsets)
    off = 0
    for _ in range(400):
        (x, y), yaw, q = rng.uniform(-1, 17, 2), rng.uniform(-3, 3), rng.uniform(-0.5, 0.5, 6)
        upright = forward_kinematics(
            rover.packed, work.hub_offsets, x, y, np.cos(yaw), np.sin(yaw), q, work.axes, work.pivots, work.wheels
        )
        assert upright
        found = False
        for wheel in work.wheels:
            code, _ = least_gap(terrain.packed, wheel, 0.0, 1.0, 0.0, True, -np.inf, work.lowest, none)
            found |= code == OFF and work.lowest[GAP] == np.inf
        assert a_wheel_is_off(meta, work.wheels) == found
        off += found
    assert 100 < off < 300, "both kinds occur"
