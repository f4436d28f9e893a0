"""`verify` against dense sampling, against the oracle's brackets, on wrong poses and beside missing data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

import oracle
import rockerbogie as rb
from helpers import assert_close
from strategies import GROUNDS
from test_gap import any_pose, wheels_of

KINDS = ["linear", "cubic"]
PHI, SIDE = np.meshgrid(np.linspace(-np.pi, np.pi, 1441), np.linspace(-1, 1, 61))


def hand_made(rover: rb.Rover, terrain: rb.Terrain, rng: np.random.Generator, count: int, roll: float) -> rb.Pose:
    """Return poses at random places near the middle of the map, with wheels in the ground and above it; nothing is settled."""
    x0, y0, x1, y1 = terrain.bounds
    x, y = (a + (b - a) * rng.uniform(0.4, 0.6, count) for a, b in ((x0, x1), (y0, y1)))
    tilt, joints = rng.uniform(-roll, roll, count), rng.uniform(-0.4, 0.4, (count, 3))
    q = np.column_stack([terrain.height(x, y) + rng.uniform(0, 1, count), tilt, rng.uniform(-0.3, 0.3, count), joints])
    yaw = rng.choice([0.0, np.pi / 2, 0.3, -2.0], count)
    steering = np.where(rover.steers, rng.uniform(-0.5, 0.5, (count, 6)), 0.0)
    return rb.Pose(rover, terrain, x, y, yaw, steering, q, np.zeros(count, np.uint8))


def sampled(pose: rb.Pose) -> np.ndarray:
    """Return the lowest (tread z - terrain z) (n, 6) of a dense grid of points on each tread, m."""
    wheels, out = wheels_of(pose), []
    for i in range(6 * pose.status.size):
        point = wheels.take(np.full(PHI.size, i)).tread(PHI.ravel(), SIDE.ravel() * wheels.half[i])[0]
        out.append((point[:, 2] - pose.terrain.height(point[:, 0], point[:, 1])).min())
    return np.reshape(out, (-1, 6))


def sampled_box(pose: rb.Pose) -> np.ndarray:
    """Return the lowest (box z - terrain z) (n,) of a dense grid of points on all six faces of the body's box, m."""
    (low, high), T = pose.rover.body_box, pose.T_world_body
    g, out = np.linspace(0, 1, 201), np.full(pose.status.size, np.inf)
    u, v = (a.ravel() for a in np.meshgrid(g, g))
    for axis in range(3):
        for side in (0.0, 1.0):
            corner = np.insert(np.stack([u, v]), axis, side, axis=0).T
            for n in range(len(out)):
                p = (low + corner * (high - low)) @ T[n, :3, :3].T + T[n, :3, 3]
                out[n] = min(out[n], (p[:, 2] - pose.terrain.height(p[:, 0], p[:, 1])).min())
    return out


def hard_terrain(name: str, interpolation: str, seed: int) -> rb.Terrain:
    """Return terrain that is hard to search: node spacing near a wheel's radius, or many cells under each wheel."""
    rng = np.random.default_rng(seed)
    size, step = (60, 0.25) if seed % 2 else (160, 0.1)
    j, i = np.mgrid[:size, :size].astype(float)
    if name == "chequered":
        z = (i + j) % 2 * 0.1
    elif name == "random":
        z = rng.normal(0, 0.05, (size, size))
    elif name == "ripples":
        z = 0.1 * (np.sin(2 * np.pi * i / rng.uniform(2.1, 8)) + np.sin(2 * np.pi * j / rng.uniform(2.1, 8)))
    else:
        z = 0.01 * i - 0.03 * j
    return rb.Terrain.from_array(z, (step, step * rng.uniform(0.8, 1.2)), (300.0, -70.0), interpolation)


def steepest(terrain: rb.Terrain) -> float:
    """Return the largest slope at the nodes and between them, with a margin of 20 %."""
    x, y = (np.linspace(a[0], a[-1], 4 * a.size - 3) for a in (terrain.x, terrain.y))
    return float(1.2 * np.linalg.norm(terrain.gradient(x, y[:, None]), axis=-1).max())


def rover_of_width(width: float) -> rb.Rover:
    """Return a rover with wheels of 0.25 m radius."""
    return rb.Rover.from_pivots(
        wheel_radius=0.25, wheel_width=width, rocker_pivot=(0, 0.5, 0.5), bogie_pivot=(-0.5, 0.6, 0.3),
        hubs=[(1.0, 0.8, 0), (0, 0.9, 0), (-1.0, 0.8, 0)],
    )  # fmt: skip


@pytest.mark.parametrize("width", [0.0, 0.15, 1.0])
@pytest.mark.parametrize("interpolation", KINDS)
@pytest.mark.parametrize("name", ["chequered", "random", "ripples", "plane"])
def test_brackets_hold_the_sampled_minimum(name: str, interpolation: str, width: float) -> None:
    for seed in (1, 2):
        terrain, rng = hard_terrain(name, interpolation, seed), np.random.default_rng(seed)
        pose = hand_made(rover_of_width(width), terrain, rng, 4, roll=(0.05, 1.0)[seed - 1])
        v = rb.verify(pose)
        assert v.complete.all()
        assert v.known.all()
        assert v.on_map.all()
        assert (v.gap_high - v.gap_low <= 1e-8).all()
        assert (v.clearance_high - v.clearance_low <= 1e-8).all()
        over, box = sampled(pose) - v.gap_low, sampled_box(pose) - v.clearance_low
        steep = steepest(terrain)
        assert over.min() >= -1e-11
        assert over.max() <= (1 + steep) * (0.25 * np.pi / 1440 + width / 120)  # the lowest point's nearest sample
        assert box.min() >= -1e-11
        assert box.max() <= (1 + steep) * np.ptp(pose.rover.body_box, axis=0).max() / 200


@pytest.mark.parametrize("interpolation", KINDS)
@pytest.mark.parametrize("kind", GROUNDS)
def test_brackets_agree_with_the_oracle(kind: str, interpolation: str) -> None:
    pose = any_pose(kind, interpolation, 7, 4)
    v = rb.verify(pose)
    assert v.complete.all()
    least = oracle.least_gap(oracle.Ground.of(pose.terrain), wheels_of(pose), 1e-9).gap.reshape(-1, 6)
    assert_close(v.gap_high, least, 1.1e-8, "m", "both brackets hold the same minimum")
    assert_close(v.gap_low, least, 1.1e-8, "m", "both brackets hold the same minimum")


@pytest.mark.parametrize("interpolation", KINDS)
def test_a_pose_shifted_by_10_micrometres_fails(interpolation: str) -> None:
    rover, terrain = rb.load_rover("curiosity"), hard_terrain("plane", interpolation, 1)
    pose = rb.settle(rover, terrain, [307.0, 307.3], [-63.0, -63.2], [0.0, 0.7])
    assert rb.verify(pose).passes().all()
    for shift in (1e-5, -1e-5):
        q = pose.q + [shift, 0, 0, 0, 0, 0]
        v = rb.verify(replace(pose, q=q))
        assert v.complete.all()
        assert not v.passes().any()
        assert_close(v.gap_high, shift, 2e-8, "m", "every wheel moves with the body")
        assert v.passes(depth=2e-5).all()


def ripples(A: float, lx: float, ly: float) -> rb.Terrain:
    """Return cubic terrain of two waves with few nodes to each."""
    yy, xx = np.mgrid[0:80, 0:80] * 0.25
    return rb.Terrain.from_array(A * (np.sin(2 * np.pi * xx / lx) + np.sin(2 * np.pi * yy / ly)), 0.25)


def test_deep_penetration_is_found_with_scipy_s_spline_as_the_reference() -> None:
    """A tread whose level stretch hangs over a crest narrower than a cell, pushed into it: the penetration is the sampled one."""
    rover = rb.load_rover("curiosity")
    rng = np.random.default_rng(5)
    for shape in ((0.1, 1.1, 0.9), (0.1, 1.0, 0.6)):
        terrain = ripples(*shape)
        pose = hand_made(rover, terrain, rng, 3, 0.2)
        pose = replace(pose, q=pose.q + [0.1, 0, 0, 0, 0, 0])
        v, f = rb.verify(pose), RectBivariateSpline(terrain.y, terrain.x, terrain.z, s=0)
        assert v.complete.all()
        wheels = wheels_of(pose)
        for i in range(18):
            p = wheels.take(np.full(PHI.size, i)).tread(PHI.ravel(), SIDE.ravel() * wheels.half[i])[0]
            lowest = (p[:, 2] - f.ev(p[:, 1], p[:, 0])).min()
            assert -1e-11 <= lowest - v.gap_low.ravel()[i] <= 0.02
