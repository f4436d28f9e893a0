"""Tiles of a large terrain, and the colours and legend of a map."""

from __future__ import annotations

import numpy as np

import rockerbogie as rb
from rockerbogie.figures.scene.colours import Legend
from rockerbogie.figures.scene.terrain_mesh import Grid, edge_error, grid_mesh, terrain_grid
from rockerbogie.lab.terrain_view import COARSE, MOST_FINE, TILE, legend_html, near_tiles, tiles_of


def test_tiles_cover_the_map_once_and_end_on_nodes() -> None:
    terrain = rb.Terrain.from_array(np.zeros((701, 1003)), (0.1, 0.2), (5.0, -7.0), interpolation="linear")
    tiles = tiles_of(terrain)
    area = sum((b[2] - b[0]) * (b[3] - b[1]) for _, b in tiles)
    xmin, ymin, xmax, ymax = terrain.bounds
    assert np.isclose(area, (xmax - xmin) * (ymax - ymin))
    for _, bounds in tiles:
        cells = (np.array(bounds) - np.tile(terrain.origin, 2)) / np.tile(terrain.spacing, 2)
        assert np.allclose(cells, cells.round(), atol=1e-6)
        assert max(cells[2] - cells[0], cells[3] - cells[1]) <= 1.5 * TILE


def test_a_small_map_is_one_tile() -> None:
    side = int((COARSE / 2) ** 0.5)
    assert len(tiles_of(rb.Terrain.from_array(np.zeros((side, side)), 0.1, interpolation="linear"))) == 1


def test_near_tiles_hold_the_position_and_are_few() -> None:
    terrain = rb.Terrain.from_array(np.zeros((1001, 1001)), 0.1, interpolation="linear")
    tiles = tiles_of(terrain)
    near = near_tiles(tiles, 33.0, 71.0, 3.0)
    first = near[0].bounds
    assert first[0] <= 33.0 <= first[2]
    assert first[1] <= 71.0 <= first[3]
    assert len(near_tiles(tiles, 50.0, 50.0, 1000.0)) == MOST_FINE
    assert near_tiles(tiles, -500.0, 0.0, 3.0) == []


def test_a_legend_shows_degrees_and_classes() -> None:
    colours = np.linspace(0, 1, 30).reshape(10, 3)
    text = legend_html(Legend("slope", "rad", 0.0, np.pi / 4, colours), "grid 1 m")
    assert "[°]" in text
    assert ">45<" in text
    assert "grid 1 m" in text
    classes = legend_html(Legend("passable", "", 0, 1, colours[:2], ("none <", "all")), "")
    assert "none &lt;" in classes


def test_skirts_cover_the_gaps_between_tiles_of_different_spacing() -> None:
    terrain = rb.Terrain.from_array(rb.surfaces.fractal(size=20.0, spacing=0.05, seed=4).z, 0.05, interpolation="linear")
    half = (terrain.bounds[0], terrain.bounds[1], 10.0, terrain.bounds[3])
    fine, coarse = terrain_grid(terrain, half, 10**6), terrain_grid(terrain, half, 300)
    error = edge_error(terrain, coarse)
    assert edge_error(terrain, fine) < 1e-12
    deviations = [
        np.abs(np.interp(fine.y, coarse.y, coarse.z[:, -1]) - fine.z[:, -1]),
        np.abs(np.interp(fine.x, coarse.x, coarse.z[0]) - fine.z[0]),
    ]
    assert max(map(np.max, deviations)) <= error
    assert error > 0.01
    plain, mesh = grid_mesh(coarse), grid_mesh(coarse, skirt=2 * error)
    rows, cols = coarse.z.shape
    around = 2 * (rows + cols) - 4
    assert len(mesh.faces) == len(plain.faces) + 2 * around
    assert np.array_equal(mesh.vertices[: len(plain.vertices)], plain.vertices)
    ends = mesh.vertices[len(plain.vertices) :].reshape(2, around + 1, 3)
    assert np.allclose(ends[0] - ends[1], (0, 0, 2 * error))
    assert len(mesh.colours) == len(mesh.vertices)


def test_a_skirt_leaves_out_missing_data() -> None:
    z = np.zeros((5, 6))
    z[0, 2] = np.nan
    grid = Grid(np.arange(6.0), np.arange(5.0), z, "")
    assert len(grid_mesh(grid, skirt=1.0).faces) == len(grid_mesh(grid).faces) + 2 * (2 * (5 + 6) - 4 - 2)
