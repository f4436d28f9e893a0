"""State of the page without a browser: settled positions, glides, picking, readings, forces."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.lab.picking import ray_hit
from rockerbogie.lab.readings import measure, readings, readings_html, status_line, wheels_html
from rockerbogie.lab.state import LabState, standing, start_position
from rockerbogie.statics.force_vectors import force_vectors


@pytest.fixture(scope="module")
def rocks() -> rb.Terrain:
    return rb.surfaces.rocks(k=0.1, seed=3, size=8.0, spacing=0.05)


@pytest.fixture(scope="module")
def osr() -> rb.Rover:
    return rb.load_rover("osr")


def test_the_pose_is_that_of_settle(osr: rb.Rover, rocks: rb.Terrain) -> None:
    state = LabState(osr, rocks)
    for mode in ("contact", "equilibrium"):
        state.mode = mode  # type: ignore[assignment]
        pose = state.move(0.4, -0.7, 1.2)
        expected = rb.settle(osr, rocks, 0.4, -0.7, 1.2, mode=mode)  # type: ignore[arg-type]
        assert np.array_equal(pose.q, expected.q)
        assert pose.status == expected.status


def test_a_glide_ends_exactly_at_its_target(osr: rb.Rover, rocks: rb.Terrain) -> None:
    state = LabState(osr, rocks, 0.0, 0.0, 3.0)
    state.target = (0.5, -0.3, -3.0)
    places = []
    while state.glide():
        places.append((state.x, state.y, state.yaw))
        assert len(places) < 60
    assert places[-1] == (0.5, -0.3, -3.0)
    assert len(places) > 5
    assert np.array_equal(state.pose.q, rb.settle(osr, rocks, 0.5, -0.3, -3.0).q)
    turned = np.unwrap([place[2] for place in places])
    assert abs(turned[-1] - turned[0]) < 0.3, "the rover turns the short way"


def test_positions_are_clipped_to_the_map_and_nan_is_ignored(osr: rb.Rover, rocks: rb.Terrain) -> None:
    state = LabState(osr, rocks)
    pose = state.move(1e9, math.nan, 7.0)
    assert (state.x, state.y) == (rocks.bounds[2], 0.0)
    assert state.yaw == pytest.approx(7.0 - 2 * math.pi)
    assert rb.Status(int(pose.status)) == rb.Status.OFF_MAP
    name, _, level = status_line(pose)
    assert (name, level) == ("OFF_MAP", "over")
    assert np.isfinite(standing(osr, rocks, state.x, state.y)).all()
    loads, tip = measure(pose)
    html = readings_html(pose, readings(pose, state.limits, loads, tip))
    assert html.count("—") >= 8
    assert ">nan" not in (html + wheels_html(pose, loads)).lower()


def test_a_start_has_data() -> None:
    z = np.zeros((21, 21))
    z[8:13, 8:13] = np.nan
    terrain = rb.Terrain.from_array(z, 0.1)
    x, y = start_position(terrain)
    assert np.isfinite(terrain.height(x, y))
    assert 0.2 < math.hypot(x - 1.0, y - 1.0) < 0.5


def test_a_ray_meets_the_terrain_where_it_first_crosses_it(rocks: rb.Terrain) -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        goal = np.append(rng.uniform(-3, 3, 2), 0.0)
        goal[2] = rocks.height(goal[0], goal[1])
        origin = np.append(rng.uniform(-6, 6, 2), rng.uniform(2, 9))
        lift = float(rng.uniform(0, 0.5))
        hit = ray_hit(rocks, origin, goal - origin + (0, 0, lift), lift)  # type: ignore[arg-type]
        assert hit is not None
        assert hit[2] == pytest.approx(float(rocks.height(hit[0], hit[1])) + lift, abs=1e-12)
        way = goal + (0, 0, lift) - origin
        share = (hit - origin) @ way / (way @ way)
        assert share < 1 + 1e-6
        assert np.linalg.norm(origin + share * way - hit) < 2e-3
        before = origin + np.linspace(0, share - 2e-3, 3000)[:, None] * way
        over = before[:, 2] - rocks.height(before[:, 0], before[:, 1]) - lift
        assert not (over < -1e-2).any(), "no earlier crossing"


@pytest.mark.parametrize("direction", [(0, 0, 1), (1, 0, 0), (0, 0, 0), (math.nan, 0, -1)])
def test_a_ray_that_misses_gives_none(rocks: rb.Terrain, direction: tuple[float, float, float]) -> None:
    assert ray_hit(rocks, (0.0, 0.0, 5.0), direction) is None


def test_readings_have_levels_by_their_limits(osr: rb.Rover) -> None:
    ramp = rb.surfaces.plane(slope=math.radians(12), size=6.0)
    pose = rb.settle(osr, ramp, 0.0, 0.0, 0.3)
    loads, tip = measure(pose)

    tilt = float(pose.tilt)

    def level(share: float) -> str:
        limits = rb.Limits(tilt=tilt / share)
        return next(r.level for r in readings(pose, limits, loads, tip) if r.key == "tilt")

    assert (level(0.5), level(0.9), level(1.1)) == ("good", "near", "over")
    shown = {r.key: r.text for r in readings(pose, rb.Limits(), loads, tip)}
    assert shown["tilt"] == f"{math.degrees(tilt):.2f}°"
    assert shown["required_friction"] == f"{math.tan(math.radians(12)):.3f}"
    assert shown["tip_margin"] == f"{math.degrees(float(tip.tip_margin)):.1f}°"


def test_force_vectors_carry_the_weight(osr: rb.Rover, rocks: rb.Terrain) -> None:
    for x, yaw in ((0.0, 0.0), (0.7, 1.1), (-0.9, -2.0)):
        pose = rb.settle(osr, rocks, x, 0.2, yaw)
        loads, _ = measure(pose)
        total = force_vectors(pose, loads).sum(axis=0)
        weight = osr.mass * pose.gravity
        assert np.allclose(total, (0.0, 0.0, weight), atol=1e-6 * weight)
