"""Pictures: near surfaces hide far ones, light and shadow fall where they should."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.figures.charts import run_map, run_profile, steepest_of, tilt_of, worst_of
from rockerbogie.figures.closeup import pose_figure
from rockerbogie.figures.render import Camera, Mesh, hidden_by, render
from rockerbogie.figures.scene_drawing import grid_step, rover_mesh
from rockerbogie.figures.terrain_block import ground_mesh
from support.helpers import assert_close, paper_rover

RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def square(z: float, half: float, colour: tuple[float, float, float]) -> Mesh:
    """A level square about the z axis."""
    a, b, c, d = ((-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z))
    return Mesh.flat(np.array([[a, b, c], [a, c, d]]), colour)


@pytest.mark.parametrize("perspective", [True, False])
def test_camera_frames_all_points(perspective: bool) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(200, 3)) * (3, 1, 0.5)
    for azimuth, elevation in rng.uniform((-np.pi, 0.1), (np.pi, 1.5), (20, 2)):
        camera = Camera.framing(points, azimuth, elevation, (400, 300), margin=(0.1, 0.05, 0.02, 0.2), perspective=perspective)
        u, v, _ = camera.project(points).T
        assert u.min() > 400 * 0.1 - 1e-6
        assert u.max() < 400 * 0.95 + 1e-6
        assert v.min() > 300 * 0.02 - 1e-6
        assert v.max() < 300 * 0.8 + 1e-6
        fills = (np.ptp(u) > 400 * 0.85 - 1e-6) or (np.ptp(v) > 300 * 0.78 - 1e-6)
        assert fills, "as large as the picture allows"


@pytest.mark.parametrize("above", [True, False])
def test_near_triangles_hide_far_ones(above: bool) -> None:
    """Whatever order the triangles come in."""
    low, high = square(0.0, 1.0, GREEN), square(0.5, 0.5, RED)
    for parts in ([low, high], [high, low]):
        mesh = Mesh.join(parts)
        camera = Camera.framing(mesh.corners, 0.3, 1.5 if above else -1.5, (200, 200))
        image = render(mesh, camera, sun=(0.0, 1.5))
        u, v, _ = camera.project(np.zeros(3))
        red, green = image[int(v), int(u), :2]
        assert (red > 0.3 > green) if above else (green > 0.3 > red)
    camera = Camera.framing(mesh.corners, 0.3, 1.5, (200, 200))
    behind, free = hidden_by(mesh, camera, np.array([[0, 0, 0], [0.9, -0.9, 0]]))
    assert_close(behind, 0.5 / np.sin(1.5), 0.02, "m", "half a metre of air, seen a little aslant, to a pixel")
    assert_close(free, 0.0, 0.02, "m", "nothing stands before it")


def test_shadow_is_opposite_to_the_sun() -> None:
    ground, cover = square(0.0, 2.0, GREEN), square(0.5, 0.3, RED)
    mesh = Mesh.join([ground, cover])
    camera = Camera.framing(mesh.corners, 0.0, 1.45, (300, 300))
    for azimuth in (0.0, 1.0, 2.5):
        image = render(mesh, camera, sun=(azimuth, np.pi / 4))  # so high that the shadow lies half a metre beside the cover
        towards = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        shade, light = (image[int(v), int(u), 1] for u, v, _ in camera.project(np.array([-0.5 * towards, 0.9 * towards])))
        assert shade < 0.75 * light


def test_terrain_mesh_has_known_cells_only() -> None:
    z = np.zeros((21, 21))
    z[8:12, 8:12] = np.nan
    ground = rb.Terrain.from_array(z, 0.1, interpolation="linear")
    mesh = ground_mesh(ground, (0.2, 0.2, 1.8, 1.8))
    assert np.isfinite(mesh.corners).all()
    top = mesh.corners[mesh.ruled]
    inside = ((top[..., :2] > 0.75) & (top[..., :2] < 1.15)).all(axis=(1, 2))
    assert len(top)
    assert not inside.any(), "missing data is left open"


@pytest.mark.parametrize("name", ["elhami-dashti", "curiosity", "osr", "sawppy"])
def test_rover_is_drawn_at_its_pose(name: str) -> None:
    """Draw the treads in contact with flat terrain, below the contact points."""
    rover, ground = rb.load_rover(name), rb.surfaces.plane()
    pose = rb.settle(rover, ground, 0.3, -0.2, 0.7)
    mesh = rover_mesh(rover, pose.T_world_body, float(pose.rocker), pose.bogie, pose.steering)
    corners = mesh.corners.reshape(-1, 3)
    chord = float(rover.wheel_radius.max()) * (1 - np.cos(np.pi / 48))  # wheels are drawn with 48 sides
    assert_close(corners[:, 2].min(), 0.0, chord, "m", "wheels stand on the ground")
    reach = float((0.5 * rover.wheel_radius + 0.5 * rover.wheel_width).max())
    for point in pose.contact_point:
        near = corners[np.hypot(*(corners[:, :2] - point[:2]).T) < reach]
        assert_close(near[:, 2].min(), point[2], 3 * chord, "m", "each wheel does")


def test_figures_do_not_change_matplotlib_settings() -> None:
    before = dict(mpl.rcParams)
    rover, ground = paper_rover(), rb.surfaces.sine()
    run = rb.drive(rover, ground, rb.Path.straight((-1, 0), 0, 2), step=0.1)
    run_map(rover, ground, run)
    run_profile(rover, ground, run)
    pose_figure(rover, ground, run.isel(time=steepest_of(run)), "a pose")
    assert dict(mpl.rcParams) == before


def test_steepest_pose_has_the_largest_tilt() -> None:
    rover, ground = paper_rover(), rb.surfaces.sine()
    run = rb.drive(rover, ground, rb.Path.straight((-1, 0), 0, 2), step=0.1)
    pose = rb.settle(rover, ground, run["x"].values, run["y"].values, run["yaw"].values)
    assert_close(tilt_of(run), pose.tilt, 1e-9, "rad", "the same angle")
    assert steepest_of(run) == int(np.argmax(pose.tilt))
    nowhere = run.assign(roll=run["roll"] * np.nan)
    assert steepest_of(nowhere) is None
    assert worst_of(rover, nowhere) is None


def test_worst_is_the_pose_closest_to_a_limit() -> None:
    """A bogie beyond its joint limit on a ledge is worse than a steeper, even ramp."""
    x = np.arange(600) * 0.02
    z = np.tile(np.clip(x - 2, 0, 2) * np.tan(np.radians(20)), (120, 1))
    z[:, 400:410] += 0.12
    rover, ground = rb.load_rover("osr"), rb.Terrain.from_array(z, 0.02, interpolation="linear")
    run = rb.drive(rover, ground, rb.Path.straight((1, 1.2), 0, 9.5), step=0.05)
    worst = worst_of(rover, run)
    assert worst is not None
    share = np.abs(run["bogie"].values) / rover.bogie_limits[1]
    assert share.max() > 1
    assert worst.station == int(np.nanargmax(share.max(axis=1)))
    assert "bogie" in worst.reason
    assert "beyond its limit" in worst.reason
    assert steepest_of(run) != worst.station


def test_grid_step_is_a_round_number() -> None:
    for span, step in ((2.0, 0.1), (4.8, 0.2), (0.9, 0.05), (347.0, 20.0)):
        assert_close(grid_step((0, 0, span, span / 2)), step, 1e-12, "m", "some twenty lines")
