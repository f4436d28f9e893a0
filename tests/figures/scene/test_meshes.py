"""Tests of the meshes of rovers and terrain."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.figures.scene import colours, mesh, terrain_mesh
from rockerbogie.figures.scene.rover_mesh import LINKS, link_transforms, rover_parts
from rockerbogie.rover.rotations import rotation_y
from support.helpers import assert_close, random_rover

PRESETS = ["elhami-dashti", "curiosity", "osr", "sawppy", "perseverance", "rocky7"]


def odd_rovers() -> list[rb.Rover]:
    """Return rovers without steering, with odd differentials, wheels or bodies; random ones."""
    base = rb.load_rover("osr")
    rng = np.random.default_rng(7)
    wide = np.array([[-0.2, -0.6, 0.1], [0.2, 0.6, 0.3]])
    return [
        base.replace(steers=np.zeros(6)),
        base.replace(differential=(0.0, -5.0)),
        base.replace(differential=(0.0, -0.5)),
        base.replace(wheel_radius=[0.05, 0.05, 0.09, 0.09, 0.07, 0.07], wheel_width=[0.02, 0.02, 0.05, 0.05, 0.0, 0.0]),
        base.replace(body_box=wide),
        base.replace(steering_offset=[0.01, 0.09]),
        *(random_rover(rng) for _ in range(6)),
    ]


def check_closed(part: mesh.Part) -> None:
    """Assert that each edge has its reverse and the enclosed volume is positive."""
    _, same = np.unique(part.vertices.round(9), axis=0, return_inverse=True)
    faces = same.ravel()[part.faces]
    edges = Counter((int(a), int(b)) for f in faces for a, b in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0])) if a != b)
    assert all(edges[b, a] == count for (a, b), count in edges.items()), f"{part.name} has an open edge"
    a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0, f"{part.name} is inside out"


@pytest.mark.parametrize("rover", [*map(rb.load_rover, PRESETS), *odd_rovers()], ids=lambda rover: rover.name)
def test_parts_are_closed_and_of_the_size_of_the_rover(rover: rb.Rover) -> None:
    parts = rover_parts(rover)
    links = {part.link for part in parts}
    assert {f"wheel_{i}" for i in range(6)} < links
    assert {f"fork_{i}" for i in range(6) if rover.steers[i]} == {link for link in links if link.startswith("fork")}
    assert sum(len(part.faces) for part in parts) < 10_000
    span = np.linalg.norm(np.ptp(rover.hubs, axis=0)) + np.linalg.norm(np.ptp(rover.body_box, axis=0)) + rover.wheel_radius.max()
    for part in parts:
        assert np.isfinite(part.vertices).all()
        assert np.abs(part.vertices).max() < 1.5 * span
        assert part.faces.min() == 0
        assert part.faces.max() == len(part.vertices) - 1
        assert all(0 <= c <= 1 for c in part.colour)
        check_closed(part)


@pytest.mark.parametrize("rover", [*map(rb.load_rover, PRESETS), *odd_rovers()], ids=lambda rover: rover.name)
def test_link_frames_are_the_rovers_own(rover: rb.Rover) -> None:
    rng = np.random.default_rng(3)
    rocker, bogie = rng.uniform(-0.3, 0.3, (4, 5)), rng.uniform(-0.4, 0.4, (4, 5, 2))
    steering = np.where(rover.steers, rng.uniform(-0.8, 0.8, (4, 5, 6)), 0.0)
    turn = rng.uniform(-9, 9, (4, 5, 6))
    body = rb.body_transform(1.0, -2.0, 0.5, 0.1, rng.uniform(-0.2, 0.2, (4, 5)), 2.0)
    T = link_transforms(rover, body, rocker, bogie, steering, turn)
    assert T.shape == (4, 5, len(LINKS), 4, 4)
    axles = body[..., None, :, :] @ rb.wheel_frames(rover, rocker, bogie, steering)
    assert_close(T[..., 8:14, :, :], axles, 1e-12, "m", "forks turn with the axle frames")
    assert_close(T[..., 14:, :3, 3], axles[..., :3, 3], 1e-12, "m", "hubs are those of wheel_frames")
    assert_close(T[..., 14:, :3, :3], axles[..., :3, :3] @ rotation_y(turn), 1e-12, "1", "wheels turn about their axles")
    R = T[..., :3, :3]
    assert_close(R @ np.swapaxes(R, -1, -2), np.eye(3), 1e-12, "1", "rotations without scale")
    pivot = T[..., 4:6, :3, :3] @ (rover.bogie_pivot - rover.rocker_pivot)[..., None]
    assert_close(T[..., 4:6, :3, 3] + pivot[..., 0], T[..., 6:8, :3, 3], 1e-12, "m", "bogies hang at the ends of the rockers")
    assert_close(
        T[1, 2], link_transforms(rover, body[1, 2], rocker[1, 2], bogie[1, 2], steering[1, 2], turn[1, 2]), 1e-12, "m", "batch"
    )


@pytest.mark.parametrize("name", PRESETS)
def test_rods_join_the_bar_to_the_horns(name: str) -> None:
    """The ends of the rods stay within their balls while the rockers move."""
    rover = rb.load_rover(name)
    parts = {part.name: part for part in rover_parts(rover)}
    rest = link_transforms(rover, np.eye(4), 0.0, np.zeros(2))
    moved = link_transforms(rover, np.eye(4), 0.25, np.zeros(2))
    for s, side in enumerate(("left", "right")):
        length = parts[f"rod_{side}"].vertices[:, 1].max()
        tip = np.array([0, length, 0, 1.0])
        rocker, rod = LINKS.index(f"rocker_{side}"), LINKS.index(f"rod_{side}")
        on_rocker = np.linalg.inv(rest[rocker]) @ rest[rod] @ tip
        apart = np.linalg.norm((moved[rocker] @ on_rocker - moved[rod] @ tip)[:3])
        assert apart < 0.16 * rover.wheel_radius.mean(), f"side {s}: {apart:.3g} m"
        assert np.linalg.norm(moved[rocker][:3, :3] - np.eye(3)) > 0.1


@pytest.mark.parametrize("name", PRESETS)
def test_wheels_reach_their_radius_and_no_further(name: str) -> None:
    rover = rb.load_rover(name)
    for i in range(6):
        points = np.concatenate([part.vertices for part in rover_parts(rover) if part.link == f"wheel_{i}"])
        assert_close(
            np.hypot(points[:, 0], points[:, 2]).max(), rover.wheel_radius[i], 2e-3 * rover.wheel_radius[i], "m", "grousers"
        )


def test_terrain_mesh_keeps_its_budget_and_leaves_out_missing_data() -> None:
    z = np.fromfunction(lambda r, c: 0.1 * np.sin(c / 40) + 0.001 * r, (400, 600))
    z[100:140, 200:260] = np.nan
    for interpolation in ("linear", "cubic"):
        terrain = rb.Terrain.from_array(z, (0.1, 0.2), (10.0, -5.0), interpolation=interpolation)
        for budget in (50, 5_000, 100_000, 3_000_000):
            made = terrain_mesh.terrain_mesh(terrain, triangles=budget)
            assert 0 < len(made.faces) <= budget
            assert np.isfinite(made.vertices).all()
            assert "grid" in made.note
            assert ("1 in" in made.note) == (budget < 400_000)
            corner = made.vertices[made.faces]
            assert (np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] > 0).all(), "faces look up"
            assert_close(made.vertices[:, 2], terrain.height(*made.vertices[:, :2].T), 1e-12, "m", "vertices lie on the terrain")
            low, high = np.array(terrain.bounds[:2]), np.array(terrain.bounds[2:])
            assert_close(made.vertices[:, :2].min(axis=0), low, 1e-9, "m", "from edge")
            assert_close(made.vertices[:, :2].max(axis=0), high, 1e-9, "m", "to edge")
        gap = (made.vertices[made.faces].mean(axis=1) - (32.5, 19.0, 0.0))[:, :2]
        assert not (np.abs(gap) < (2.0, 3.0)).all(axis=1).any(), "missing data is left out"
    with pytest.raises(rb.RockerbogieError, match="outside the terrain"):
        terrain_mesh.terrain_mesh(terrain, (100, 100, 120, 120))


def test_terrain_is_coloured_by_height_slope_shade_or_a_layer() -> None:
    ramp = rb.surfaces.ramp(size=6.0, spacing=0.1)
    by_height = terrain_mesh.terrain_mesh(ramp, colour="height", shaded=False)
    assert by_height.legend is not None
    low = np.argmin(by_height.vertices[:, 2])
    assert_close(by_height.colours[low], colours.colour_table("terrain")[0], 1e-12, "1", "the lowest point has the first colour")
    assert by_height.legend.units == "m"
    by_slope = terrain_mesh.terrain_mesh(ramp, colour="slope", limits=(0.0, 0.5))
    assert by_slope.legend is not None
    assert (by_slope.legend.low, by_slope.legend.high) == (0.0, 0.5)
    shaded = terrain_mesh.terrain_mesh(ramp, colour="hillshade")
    assert shaded.legend is None
    assert len(np.unique(shaded.colours[:, 0].round(6))) > 1, "the ramp is lit differently from the plane"
    with pytest.raises(rb.RockerbogieError, match="give plain, hillshade, height, slope"):
        terrain_mesh.terrain_mesh(ramp, colour="hight")
    with pytest.raises(rb.RockerbogieError, match="low below high"):
        terrain_mesh.terrain_mesh(ramp, limits=(1.0, 1.0))
    maps = rb.traversability(rb.load_rover("osr"), ramp, headings=2, resolution=0.25)
    made = terrain_mesh.terrain_mesh(ramp, colour="passable", maps=maps, shaded=False)
    assert made.legend is not None
    assert made.legend.classes[-1] == "every heading passable"
    for point, colour in list(zip(made.vertices, made.colours, strict=True))[:: len(made.vertices) // 50]:
        cell = maps["passable"].sel(x=point[0], y=point[1], method="nearest")
        if np.hypot(float(cell.x) - point[0], float(cell.y) - point[1]) > 0.1:
            continue
        expected = colours.MISSING if np.isnan(cell) else made.legend.colours[_class(float(cell))]
        assert_close(colour, expected, 1e-12, "1", "the colour of its cell")


def _class(share: float) -> int:
    return 0 if share <= 0 else 1 if share <= 0.5 else 2 if share < 1 else 3


def test_normals_of_a_tube_are_round_and_of_a_box_flat() -> None:
    tube = mesh.tube((0, 0, 0), (0, 0, 2), 0.5)
    normal = mesh.vertex_normals(*tube)
    side = np.abs(normal[:, 2]) < 0.5
    expected = tube.vertices[side] * (2, 2, 0)
    assert_close(normal[side], expected, 1e-9, "1", "outward from the axis")
    block = mesh.box((-1, -1, -1), (1, 1, 1))
    assert_close(np.abs(mesh.vertex_normals(*block)).max(axis=1), 1.0, 1e-12, "1", "along an axis")


@pytest.mark.parametrize(("centre", "shape"), [((5.0, 5.0), (201, 401)), ((0.0, 20.0), (50, 900)), ((-3.0, 100.0), (30, 30))])
def test_a_graded_grid_covers_the_map_and_is_dense_near_its_centre(centre, shape):
    z = np.add.outer(np.linspace(0, 1, shape[0]), np.linspace(0, 2, shape[1]) ** 2)
    terrain = rb.Terrain.from_array(z, (0.05, 0.1), interpolation="linear")
    grid = terrain_mesh.graded_grid(terrain, centre, 1.0, 20)
    xmin, ymin, xmax, ymax = terrain.bounds
    assert (grid.x[0], grid.y[0], grid.x[-1], grid.y[-1]) == pytest.approx((xmin, ymin, xmax, ymax))
    assert_close(grid.z, terrain.height(*np.meshgrid(grid.x, grid.y)), 1e-12, "m", "heights")
    for axis, lines, spacing in ((0, grid.x, 0.05), (1, grid.y, 0.1)):
        nodes = lines / spacing
        assert_close(nodes, nodes.round(), 1e-9, "nodes", "lines on nodes")
        assert len(lines) < 70
        near = lines[np.abs(lines - centre[axis]) < 1.0]
        if len(near) > 1:
            assert np.diff(near).max() <= 0.1 + 1e-9
