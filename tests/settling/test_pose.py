"""Representation and cached frames of poses."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from support.helpers import assert_close

ROVER, TERRAIN = rb.load_rover("rocky7"), rb.surfaces.rough(3)


@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
def test_one_pose_prints_as_a_line(mode: str) -> None:
    pose = rb.settle(ROVER, TERRAIN, 0.25, 0.5, 0.1, mode=mode)
    text = repr(pose)
    assert "\n" not in text
    assert len(text) < 160
    assert text == str(pose)
    assert text.startswith("<Pose of rocky7 on rough 3: CONVERGED, x 0.25, y 0.5, z ")
    assert f"pitch {np.degrees(pose.pitch):.2f}" in text


def test_a_batch_prints_its_shape_and_statuses() -> None:
    pose = rb.settle(ROVER, TERRAIN, [[0.0, 50.0, 0.1]], np.zeros((2, 1)))
    assert repr(pose) == "<Pose (2, 3) of rocky7 on rough 3: 4 CONVERGED, 2 OFF_MAP>"
    assert "2</td><td>part of a tread" in pose._repr_html_()
    assert repr(rb.settle(ROVER, TERRAIN, np.zeros((0, 5)), 0.0)) == "<Pose (0, 5) of rocky7 on rough 3: empty>"


def test_html_shows_one_pose_and_escapes_names() -> None:
    named = rb.Terrain.from_array(np.zeros((60, 60)), 0.1, (-3, -3), name="<b>yard</b>")
    html = rb.settle(ROVER, named, 0.0, 0.0)._repr_html_()
    assert "&lt;b&gt;yard" in html
    assert "<td>bogie left</td><td>" in html
    assert html.count("<tr>") == html.count("</tr>") == 10


def test_frames_are_those_of_the_functions_and_are_computed_once() -> None:
    steering = np.random.default_rng(1).uniform(-0.4, 0.4, (3, 2, 6)) * ROVER.steers
    pose = rb.settle(ROVER, TERRAIN, np.zeros((3, 1)), [0.1, 0.2], 0.3, steering=steering)
    axle = rb.wheel_frames(ROVER, pose.rocker, pose.bogie, steering)
    assert np.array_equal(pose.axle_frames, axle)
    assert np.array_equal(pose.contact_frames, rb.contact_frames(ROVER, axle, pose.contact_angle))
    assert pose.axle_frames is pose.axle_frames
    assert pose.contact_frames is pose.contact_frames
    with pytest.raises(ValueError, match="read-only"):
        pose.axle_frames[0] = 0.0


def test_contact_frames_of_a_disc_start_at_its_contact_points() -> None:
    pose = rb.settle(rb.load_rover("elhami-dashti"), TERRAIN, np.zeros((3, 1)), [0.1, 0.2], 0.3)
    world = pose.T_world_body[..., None, :, :] @ pose.contact_frames
    assert_close(world[..., 3][..., :3], pose.contact_point, 1e-9, "m", "the same point of the rim")


def test_a_dataset_in_equilibrium_mode_holds_forces(tmp_path) -> None:
    pose = rb.settle(ROVER, TERRAIN, [0.0, 0.5], 0.0, mode="equilibrium")
    data = pose.to_xarray()
    weight = ROVER.mass * 9.80665
    assert data["support"].attrs["units"] == "N"
    assert_close(data["support"].sum("wheel"), weight, 0.05 * weight, "N", "contact forces on gentle slopes carry the weight")
    assert data["joint_stop"].dims == ("pose", "joint")
    data.to_netcdf(tmp_path / "pose.nc", engine="h5netcdf")
    assert "support" not in rb.settle(ROVER, TERRAIN, 0.0, 0.0).to_xarray()


def test_contact_planes_are_normals_and_positions_along_the_axles() -> None:
    rover = rb.load_rover("curiosity")
    terrain = rb.surfaces.rocks(seed=4, size=(12.0, 12.0))
    steering = np.random.default_rng(2).uniform(-0.4, 0.4, (3, 2, 6)) * rover.steers
    pose = rb.settle(rover, terrain, np.array([[-1.0], [0.0], [40.0]]), [0.3, 1.2], 0.7, steering=steering)
    inverse = np.linalg.inv(pose.T_world_body[:2])[..., None, :, :]
    point = np.concatenate([pose.contact_point[:2], np.ones((2, 2, 6, 1))], axis=-1)[..., None]
    in_axle = (np.linalg.inv(pose.axle_frames[:2]) @ inverse @ point)[..., 1, 0]
    assert_close(pose.contact_planes[:2, ..., 3], in_axle, 1e-12, "m", "y of the contact in the axle's own frame")
    normal = (inverse[..., :3, :3] @ pose.contact_normal[:2, ..., None])[..., 0]
    assert_close(pose.contact_planes[:2, ..., :3], normal, 1e-12, "", "the normal in the body")
    assert np.abs(in_axle).max() > 0.05, "some treads touch a rock beside their middle"
    assert np.isnan(pose.contact_planes[2]).all(), "off the map"
