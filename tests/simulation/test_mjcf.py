"""Tests of the MuJoCo model: mechanism, masses, terrain, and equilibrium as `settle`."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import rockerbogie as rb
from rockerbogie.simulation.height_field import TRIANGLE_ERROR, default_cell, sample_terrain
from rockerbogie.simulation.mjcf import build_spec
from support.mjcf import load_mjcf
from support.rigid_drop import DropTower, Rest

PRESETS = ["elhami-dashti", "perseverance", "curiosity", "rocky7", "osr", "sawppy"]
rng = np.random.default_rng(7)


def load(name: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(rb.to_mjcf(rb.load_rover(name)))


def hills(size: float, spacing: float, height: float, interpolation: str = "cubic") -> rb.Terrain:
    """Random ground, smooth over some two cells, `size` m across."""
    n = int(size / spacing) + 1
    z = gaussian_filter(np.random.default_rng(5).normal(size=(n, n)), 1.5)
    return rb.Terrain.from_array(height * z / np.abs(z).max(), spacing, (-size / 2, -size / 2), interpolation)


@pytest.mark.parametrize("name", PRESETS)
def test_wheels_are_at_their_frames(name: str) -> None:
    """Any joint angles and steering: the text's axles are `wheel_frames`' to 1e-12 m."""
    rover, model = rb.load_rover(name), load(name)
    data = mujoco.MjData(model)
    for _ in range(20):
        rocker, bogie = rng.uniform(-0.4, 0.4), rng.uniform(-0.5, 0.5, 2)
        steering = np.where(rover.steers, rng.uniform(-1, 1, 6), 0.0)
        angles = {
            "rocker_left": rocker,
            "rocker_right": rover.right_rocker(rocker),
            "bogie_left": bogie[0],
            "bogie_right": bogie[1],
        }
        angles |= {f"steer_{n}": s for n, s, on in zip(rover.wheel_names, steering, rover.steers, strict=True) if on}
        data.qpos[:] = 0
        data.qpos[3] = 1
        for joint, angle in angles.items():
            data.joint(joint).qpos = angle
        mujoco.mj_kinematics(model, data)
        T = rb.wheel_frames(rover, rocker, bogie, steering)
        for i, wheel in enumerate(rover.wheel_names):
            np.testing.assert_allclose(data.body(f"wheel_{wheel}").xpos, T[i, :3, 3], atol=1e-12)
            np.testing.assert_allclose(data.body(f"wheel_{wheel}").xmat.reshape(3, 3), T[i, :3, :3], atol=1e-12)


@pytest.mark.parametrize("name", PRESETS)
def test_masses_and_inertias_are_the_links(name: str) -> None:
    rover, model = rb.load_rover(name), load(name)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    parts = ["body", "rocker_left", "rocker_right", "bogie_left", "bogie_right", *(f"wheel_{n}" for n in rover.wheel_names)]
    for part, link in zip(parts, rover.links, strict=True):
        body = data.body(part)
        turn = body.ximat.reshape(3, 3)
        assert model.body(part).mass[0] == pytest.approx(link.mass, rel=1e-12)
        np.testing.assert_allclose(body.xipos, link.com, atol=1e-12)
        inertia = turn @ np.diag(model.body(part).inertia) @ turn.T
        np.testing.assert_allclose(inertia, link.inertia, atol=1e-9 * max(np.trace(link.inertia), 1e-9))


def test_a_link_without_mass_gets_a_small_mass() -> None:
    base = rb.load_rover("elhami-dashti")
    weightless = rb.Link(0.0, base.bogies[0].com, np.zeros((3, 3)))
    model = build_spec(base.replace(bogies=(weightless, weightless))).compile()
    assert 0 < model.body("bogie_left").mass[0] < 2e-4 * base.mass


@pytest.mark.parametrize("law", [(0.0, -1.0), (0.0, -0.8), (0.0, -1.0, 0.05, 0.1, -0.2)])
def test_the_differential_couples_the_rockers(law: tuple[float, ...]) -> None:
    """The equality is met where right = Σ cₖ leftᵏ, and not where left is that of right."""
    rover = rb.load_rover("elhami-dashti").replace(differential=np.array(law))
    model = build_spec(rover).compile()
    data = mujoco.MjData(model)

    def miss(left: float, right: float) -> float:
        data.joint("rocker_left").qpos, data.joint("rocker_right").qpos = left, right
        mujoco.mj_forward(model, data)
        return float(np.abs(data.efc_pos[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]).max())

    right = float(rover.right_rocker(0.3))
    assert miss(0.3, right) < 1e-12
    if law != (0.0, -1.0):
        assert miss(right, 0.3) > 1e-3


def test_joint_limits_and_motors() -> None:
    rover = rb.load_rover("elhami-dashti").replace(rocker_limits=np.array([-0.2, 0.3]), bogie_limits=np.array([-0.4, np.inf]))
    model = build_spec(rover).compile()
    np.testing.assert_allclose(model.joint("rocker_left").range, [-0.2, 0.3])
    assert not model.joint("rocker_right").limited[0]
    assert model.joint("bogie_right").range[0] == -0.4
    assert model.joint("bogie_right").range[1] > 2 * np.pi
    names = {model.actuator(k).name for k in range(model.nu)}
    assert names == {f"wheel_{n}" for n in rover.wheel_names} | {"steer_LR", "steer_RR"}


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_the_height_field_is_the_terrain(interpolation: str) -> None:
    """Rays meet the triangles within their error of the terrain; nodes lie on its nodes."""
    rover, terrain = rb.load_rover("elhami-dashti"), hills(3.0, 0.1, 0.1, interpolation)
    region = (-0.77, -0.9, 1.03, 0.81)
    model = load_mjcf(rb.to_mjcf(rover, terrain, region=region))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    x, y = rng.uniform(-0.7, 0.8, (2, 300))
    hit, ground_only = np.zeros(1, dtype=np.int32), np.array([0, 1, 0, 0, 0, 0], dtype=np.uint8)
    down = np.array([0.0, 0, -1])
    far = [mujoco.mj_ray(model, data, np.array([a, b, 5.0]), down, ground_only, 1, -1, hit) for a, b in zip(x, y, strict=True)]
    assert np.abs(5 - np.array(far) - terrain.height(x, y)).max() < 2 * TRIANGLE_ERROR
    node_x, node_y, _ = sample_terrain(terrain, region, default_cell(rover, terrain, region))
    assert np.isclose(terrain.x[:, None], node_x, atol=1e-9).any(axis=1).sum() == 20  # nodes from -0.8 to 1.1
    assert np.isclose(terrain.y[:, None], node_y, atol=1e-9).any(axis=1).sum() == 19  # and from -0.9 to 0.9


def test_an_exported_rover_comes_to_rest_at_the_middle_of_its_terrain() -> None:
    """The text as written, after 3 s: z as `settle` within 1 mm."""
    rover, terrain = rb.load_rover("elhami-dashti"), hills(3.0, 0.1, 0.03)
    model = load_mjcf(rb.to_mjcf(rover, terrain, region=(-1.0, -1.2, 1.4, 1.2)))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=600)
    x, y, z = data.body("body").xpos
    assert np.hypot(x - 0.2, y) < 0.03  # braked wheels: it may slide a little as it lands
    assert abs(z - rb.settle(rover, terrain, x, y, np.arctan2(*data.body("body").xmat[[3, 0]])).z) < 1e-3


def test_only_missing_data_is_bridged() -> None:
    z = np.zeros((30, 30))
    z[:, 20:], z[10:12, 10:12] = 1.0, np.nan
    terrain = rb.Terrain.from_array(z, 0.1, interpolation="linear")
    assert np.isfinite(sample_terrain(terrain, None, 0.1)[2]).all()
    with pytest.raises(rb.TerrainError, match="has no data in the region"):
        sample_terrain(terrain, (1.01, 1.01, 1.09, 1.09), 0.1)
    with pytest.raises(rb.TerrainError, match="does not lie on the terrain"):
        sample_terrain(terrain, (50, 0, 51, 1), 0.1)
    with pytest.raises(rb.TerrainError, match="more than 20,000,000"):
        sample_terrain(terrain, None, 1e-4)


@pytest.mark.parametrize("name", ["elhami-dashti", "perseverance"])
@pytest.mark.parametrize(("tilt", "way"), [(0.0, 0.0), (0.29, 0.3), (0.29, np.pi / 2), (0.2, 2.5)])
def test_equilibrium_on_a_tilted_plane(name: str, tilt: float, way: float) -> None:
    """A solid plane, tilted by up to 17 degrees any way."""
    rover = rb.load_rover(name)
    half = np.array([np.cos(tilt / 2), -np.sin(way) * np.sin(tilt / 2), np.cos(way) * np.sin(tilt / 2), 0])
    rest = DropTower(rover, [{"type": "plane", "size": [0, 0, 1], "quat": half}]).drop(0.1, -0.2, 0.7)
    grid = np.linspace(-4, 4, 9)
    heights = -np.tan(tilt) * (np.cos(way) * grid + np.sin(way) * grid[:, None])
    check_at_rest(rest, rb.settle(rover, rb.Terrain.from_array(heights, 1.0, (-4, -4), "linear"), 0.1, -0.2, 0.7))
    assert rest.force.sum() * np.cos(tilt) == pytest.approx(rest.weight, rel=1e-3)


@pytest.mark.parametrize("name", ["elhami-dashti", "perseverance"])
def test_equilibrium_astride_a_ledge(name: str) -> None:
    """The left wheels on a box: wheels tilted by 10 degrees on level terrain.

    An ellipsoid stands for a disc, a cylinder touches with an edge.
    """
    rover = rb.load_rover(name)
    ledge = 0.09 * rover.wheelbase
    box = {"type": "box", "size": [3, 1.5, ledge / 2], "pos": [0, 1.6, ledge / 2]}
    rest = DropTower(rover, [{"type": "plane", "size": [0, 0, 1]}, box]).drop(0.0, 0.0, 0.0)
    y = np.linspace(-4, 4, 801)
    heights = np.repeat(np.where(y > 0.05, ledge, 0.0)[:, None], 801, axis=1)
    pose = rb.settle(rover, rb.Terrain.from_array(heights, 0.01, (-4, -4), "linear"), 0.0, 0.0, 0.0)
    assert 5 < abs(np.degrees(pose.roll)) < 15
    check_at_rest(rest, pose)


def check_at_rest(rest: Rest, pose: rb.Pose) -> None:
    """Check 0.03 mm and 0.01 deg: contact depth (0.01 mm) and ellipsoid width (0.02 mm)."""
    assert rest.at_rest
    assert abs(rest.z - pose.z) < 3e-5
    assert np.degrees(np.abs([rest.roll - pose.roll, rest.pitch - pose.pitch, rest.rocker - pose.rocker])).max() < 0.01
    assert np.degrees(np.abs(rest.bogie - pose.bogie)).max() < 0.01


@pytest.mark.parametrize("name", ["elhami-dashti", "perseverance", "rocky7"])
def test_equilibrium_on_rough_terrain(name: str) -> None:
    """Random drops on steep creased terrain: within 0.05 deg and 1 mm RMS of `settle`."""
    rover = rb.load_rover(name)
    size = rover.wheelbase
    terrain = hills(6 * size, 0.06 * size, 0.16 * size, "linear")
    tower = DropTower(rover, terrain)
    apart = []
    for _ in range(15):
        x, y, yaw = *rng.uniform(-1.8, 1.8, 2) * size, rng.uniform(-np.pi, np.pi)
        steering = np.where(rover.steers, rng.uniform(-0.6, 0.6, 6), 0.0)
        rest, pose = tower.drop(x, y, yaw, steering), rb.settle(rover, terrain, x, y, yaw, steering=steering)
        assert rest.at_rest
        assert pose.status == rb.Status.CONVERGED
        if not rest.lifted.any() and rest.body_force == 0:
            apart.append(np.array([rest.z, rest.roll, rest.pitch, rest.rocker, *rest.bogie]) - pose.q)
    rms = np.sqrt(np.mean(np.square(apart), axis=0))
    assert len(apart) >= 12
    assert rms[0] < 1e-3 * max(size, 1.0)
    assert np.degrees(rms[1:]).max() < 0.05


def test_a_bogie_at_its_limit_leaves_a_wheel_off_the_ground() -> None:
    rover = rb.load_rover("rocky7").replace(bogie_limits=np.radians([-5.0, 5.0]))
    step = [{"type": "plane", "size": [0, 0, 1]}, {"type": "box", "size": [0.6, 0.5, 0.05], "pos": [0.63, 0, 0.05]}]
    rest = DropTower(rover, step).drop(0.0, 0.0, 0.0)  # the rear wheels are 0.1 m below the top of the step
    assert rest.at_rest
    assert list(rest.on_stop) == [False, True, True]
    assert list(np.flatnonzero(rest.lifted)) == [4, 5]
    assert np.degrees(np.abs(rest.bogie)) == pytest.approx([5.0, 5.0], abs=0.01)
