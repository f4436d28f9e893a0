"""Clearance of the body box, compared with brute force over its three lower faces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rockerbogie as rb
from rockerbogie._kernels.model.ground import surface
from rockerbogie._kernels.model.linkage import body_axes
from rockerbogie._kernels.search import body_box, box_edge, box_face
from rockerbogie._kernels.search.box_points import NEAR_ROOM, NEAR_SIZE
from support import oracle
from support.helpers import assert_close
from support.sharp_grounds import draw_case

Array = NDArray[np.float64]

SLACK = 1e-8  # the oracle's bracket, m


def bumps(interpolation: str, spacing: float, seed: int) -> rb.Terrain:
    """Return white noise of one cell's height; the box is several cells long or a part of one."""
    z = spacing * np.random.default_rng(seed).normal(size=(60, 60))
    return rb.Terrain.from_array(z, spacing, (-29.5 * spacing, -29.5 * spacing), interpolation)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("spacing", [0.1, 0.4, 3.0])
def test_clearance_is_the_minimum_over_the_whole_box(interpolation: str, spacing: float) -> None:
    rover, terrain = rb.load_rover("perseverance"), bumps(interpolation, spacing, 4)
    rng = np.random.default_rng(5)
    n = 60
    x, y = rng.uniform(-8 * spacing, 8 * spacing, (2, n))
    yaw = rng.uniform(-np.pi, np.pi, n)
    q = np.zeros((n, 6))
    q[:, 1:3] = rng.uniform(-0.5, 0.5, (n, 2))
    pose = rb.Pose(rover, terrain, x, y, yaw, np.zeros((n, 6)), q, np.zeros(n, dtype=np.uint8))
    faces = oracle.box(rover, x, y, yaw, q)
    brute = oracle.least_gap(oracle.Ground.of(terrain), faces, SLACK).gap.reshape(n, 3).min(axis=1)
    assert_close(pose.clearance, brute, 2 * SLACK, "m", "both are the minimum height of the box over the terrain")


def near_flat(kind: str) -> rb.Terrain:
    """Return cubic terrain of 5 cm cells above which a box has many almost equal gaps."""
    j, i = np.mgrid[:80, :80]
    rng = np.random.default_rng(6)
    z = {
        "constant": np.full(i.shape, 100.0),
        "plane": 100.0 + 0.005 * i - 0.0025 * j,
        "float32 plane": (100.0 + 0.005 * i - 0.0025 * j).astype(np.float32).astype(float),
        "noise of 1e-12 m": 1e-12 * rng.normal(size=i.shape),
        "noise of 1e-8 m": 1e-8 * rng.normal(size=i.shape),
        "single nodes": 0.01 * (rng.random(i.shape) < 0.02),
        "ridges": 0.01 * (i % 5 == 0) + 1e-9 * rng.normal(size=i.shape),
    }[kind]
    return rb.Terrain.from_array(z, 0.05, (-2.0, -2.0), "cubic", name=kind)


@pytest.fixture
def bounded(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list whose only element counts the parts that a search of the box bounds."""
    parts, compiled = [0], box_edge.bound_patch

    def counted(*args: Any) -> float:
        parts[0] += 1
        return compiled(*args)

    for module, names in (
        (body_box, ("search_edge", "search_face")),
        (box_edge, ("_search_piece", "_edge_bounds")),
        (box_face, ("_search_cubic_cell", "_search_quarter")),
    ):
        for name in names:
            monkeypatch.setattr(module, name, getattr(module, name).py_func)
        if module is not body_box:
            monkeypatch.setattr(module, "bound_patch", counted)
    return parts


def search_level_box(rover: rb.Rover, terrain: rb.Terrain, x: float, y: float, yaw: float, margin: float) -> Array:
    """Return the points (n, NEAR_SIZE) listed of a level box 10 cm above the datum."""
    axes, near = np.empty((3, 3)), np.empty((NEAR_ROOM, NEAR_SIZE))
    body_axes(0.0, 0.0, np.cos(yaw), np.sin(yaw), axes)
    at = (x - terrain.origin[0], y - terrain.origin[1], 0.1)
    _, count = body_box.box_over_ground.py_func(terrain.packed, rover.body_box.ravel(), axes, *at, margin, near)  # type: ignore[attr-defined]
    return near[:count]


@pytest.mark.parametrize("margin", [0.0, 0.01])
@pytest.mark.parametrize(
    "kind", ["constant", "plane", "float32 plane", "noise of 1e-12 m", "noise of 1e-8 m", "single nodes", "ridges"]
)
def test_ties_cost_a_few_parts_per_cell(bounded: list[int], kind: str, margin: float) -> None:
    rover = rb.load_rover("perseverance")
    search_level_box(rover, near_flat(kind), 0.1, 0.2, 0.3, margin)
    cells = np.prod(np.ptp(rover.body_box[:, :2], axis=0)) / 0.05**2
    assert bounded[0] <= 5.0 * cells, f"{bounded[0]} parts of {cells:.0f} cells are bounded"


def test_box_above_sparse_coefficients_is_searched_at_once(bounded: list[int]) -> None:
    # 1.3 cm of relief: every cell is within the margin, and each flat corner of a cell ties with its neighbours
    case = draw_case(2029, "coefficients", "cubic", 1)
    near = search_level_box(case.rover, case.terrain, case.x[0], case.y[0], case.yaw[0], 0.011)
    assert len(near) == NEAR_ROOM
    assert bounded[0] <= 10_000, f"{bounded[0]} parts are bounded"


@pytest.mark.parametrize("seed", range(20))
def test_a_steeper_face_is_nowhere_parallel_to_the_terrain(seed: int) -> None:
    rng = np.random.default_rng(seed)
    terrain = rb.Terrain.from_array(rng.normal(size=(9, 9)), rng.uniform(0.1, 2.0), interpolation="cubic")
    packed, at = terrain.packed, np.linspace(0.0, 1.0, 21)
    points = np.stack(np.meshgrid(4.0 + at, 4.0 + at), axis=-1) * terrain.spacing[0]
    slopes = np.abs([surface(packed.grid, packed.meta, x, y)[1:3] for x, y in points.reshape(-1, 2)]).max(axis=0)
    found = []
    for axis in (0, 1):
        for share in (0.9, 20.0):
            slope = [0.0, 0.0]
            slope[axis] = share * slopes[axis]
            face = box_face.Face(*np.zeros(20))._replace(gx=slope[0], gy=slope[1])
            found.append(box_face._is_steeper(packed.grid, packed.meta, 4, 4, face))
    assert found == [False, True, False, True]
    grid = packed.grid.copy()
    grid[5, 6] = np.nan
    assert not box_face._is_steeper(grid, packed.meta, 4, 4, face)
