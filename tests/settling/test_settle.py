"""Poses in contact mode against brute force and under symmetries, in any batch."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.rover.rotations import body_transform
from support import oracle
from support.helpers import assert_close, paper_rover
from support.strategies import BATCH_SHAPES
from support.verified import TOLERANCE, TOUCHING, draw, grounds, verify_contact

SEED = 2024


def wide(rover: rb.Rover, width: float) -> rb.Rover:
    """Return the rover with wheels of a given width, m."""
    return rover.replace(wheel_width=np.full(6, width))


def places(count: int, reach: float, seed: int = SEED) -> tuple[np.ndarray, ...]:
    """Return random x, y (m) and yaw (rad), each (count,)."""
    rng = np.random.default_rng(seed)
    return (*rng.uniform(-reach, reach, (2, count)), rng.uniform(-np.pi, np.pi, count))


def turned(rover: rb.Rover, count: int, most: float = 0.7, seed: int = SEED) -> np.ndarray:
    """Return random steering (count, 6), 0 for wheels that do not steer."""
    return np.random.default_rng(seed).uniform(-most, most, (count, 6)) * rover.steers


@pytest.mark.parametrize("radii", [2.0, 12.0], ids=lambda n: f"{n:.0f} wheel radii")
@pytest.mark.parametrize(
    "name, width, count",
    [("elhami-dashti", 0.0, 300), ("elhami-dashti", 0.08, 90), ("perseverance", None, 60), ("rocky7", 0.0, 50)],
)
def test_smooth_terrain_equals_brute_force(name: str, width: float | None, count: int, radii: float) -> None:
    rover = rb.load_rover(name)
    rover = rover if width is None else wide(rover, width)
    radius = float(rover.wheel_radius[0])
    terrain = rb.surfaces.rough(
        SEED, max_slope=np.radians(25), min_radius=radii * radius, size=80 * radius, spacing=0.1 * radii * radius
    )
    x, y, yaw = places(count, 25 * radius)
    steering = turned(rover, count)
    pose = rb.settle(rover, terrain, x, y, yaw, steering=steering)
    brute = oracle.settle(rover, oracle.Ground.of(terrain), x, y, yaw, steering)
    assert set(np.unique(pose.status)) <= set(TOUCHING)
    assert np.isfinite(brute).all(), "the brute force itself did not converge"
    assert_close(pose.q, brute, 1e-8, "m, rad", f"{name}, slopes to 25 deg, radii of curvature from {radii:g} wheel radii")
    if radii > 2:
        assert abs(pose.roll).max() > 0.2, "waves longer than the rover tilt it both ways"
        assert abs(pose.pitch).max() > 0.2


def test_shifted_terrain_shifts_the_pose() -> None:
    rover, shift = wide(paper_rover(), 0.08), np.array([1250.0, -48.0, -4450.0])
    z = rb.surfaces.rough(3).z
    x, y, yaw = places(200, 2.0)
    here = rb.settle(rover, rb.Terrain.from_array(z, 0.02, (-3, -3)), x, y, yaw)
    there = rb.settle(
        rover, rb.Terrain.from_array(z + shift[2], 0.02, (-3 + shift[0], -3 + shift[1])), x + shift[0], y + shift[1], yaw
    )
    assert_close(there.z - shift[2], here.z, 1e-9, "m", "the rover moves with the terrain")
    assert_close(there.q[:, 1:], here.q[:, 1:], 1e-9, "rad", "a shift changes no angle")


def test_scaled_world_scales_the_pose() -> None:
    small, scale = paper_rover(), 7.0
    lengths = ("rocker_pivot", "bogie_pivot", "hubs", "wheel_radius", "wheel_width", "steering_offset", "body_box")
    large = small.replace(**{name: scale * getattr(small, name) for name in lengths})
    ground = rb.surfaces.rough(4)
    grown = rb.Terrain.from_array(scale * ground.z, scale * 0.02, (-3 * scale, -3 * scale))
    x, y, yaw = places(200, 2.0)
    one, other = rb.settle(small, ground, x, y, yaw), rb.settle(large, grown, scale * x, scale * y, yaw)
    assert_close(other.z / scale, one.z, 1e-9, "m", "lengths scale")
    assert_close(other.q[:, 1:], one.q[:, 1:], 1e-9, "rad", "angles do not")


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_mirrored_terrain_mirrors_the_pose(interpolation: str) -> None:
    rover = wide(rb.load_rover("elhami-dashti"), 0.06)
    ground = rb.surfaces.rough(5)
    left = rb.Terrain.from_array(ground.z, 0.02, (-3, -3), interpolation)
    right = rb.Terrain.from_array(ground.z[::-1], 0.02, (-3, -3), interpolation)
    x, y, yaw = places(200, 2.0)
    steering = turned(rover, 200)
    one = rb.settle(rover, left, x, y, yaw, steering=steering)
    other = rb.settle(rover, right, x, -y, -yaw, steering=-steering[:, [1, 0, 3, 2, 5, 4]])
    assert_close(other.q[:, [0, 2]], one.q[:, [0, 2]], 1e-8, "m, rad", "height and pitch are the same in a mirror")
    assert_close(other.q[:, [1, 3]], -one.q[:, [1, 3]], 1e-8, "rad", "roll and rocker change sign")
    assert_close(other.bogie, one.bogie[:, ::-1], 1e-8, "rad", "the bogies change sides")


@pytest.mark.parametrize("width", [0.0, 0.1])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_tilted_plane_tilts_the_pose_with_it(interpolation: str, width: float) -> None:
    rover = wide(paper_rover(), width)
    level = rb.settle(rover, rb.surfaces.plane(interpolation=interpolation), 0.0, 0.0)
    up = level.T_world_body[2, :3]
    for slope, aspect in ((0.3, 0.0), (0.3, 1.9), (0.5, -2.5), (0.01, 1.0)):
        plane = rb.surfaces.plane(slope, aspect, interpolation=interpolation)
        pose = rb.settle(rover, plane, 0.2, -0.1, [0.0, 0.7, 2.0, -2.5])
        assert (pose.status == rb.Status.CONVERGED).all()
        assert_close(pose.q[:, 3:], level.q[3:], 1e-9, "rad", "joints on a plane are those on level terrain")
        normal = plane.normal(0.0, 0.0)
        seen = np.einsum("...ji,j->...i", pose.T_world_body[:, :3, :3], normal)
        assert_close(
            seen, np.broadcast_to(up, seen.shape), 1e-9, "", "the plane's normal has the body coordinates of the vertical"
        )


def test_level_terrain_gives_the_paper_s_pose() -> None:
    pose = rb.settle(paper_rover(), rb.surfaces.plane(), 0.0, 0.0)
    assert_close(pose.pitch, -0.000562, 5e-7, "rad", "rear and middle axles differ by 0.3 mm in Table I")
    assert_close(pose.bogie, 0.000562, 5e-7, "rad", "the bogies compensate it")
    assert_close([pose.roll, pose.rocker], 0.0, 1e-12, "rad", "no tilt to the side")


@pytest.mark.parametrize("shape", BATCH_SHAPES)
@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
def test_batch_axes_lead(shape: tuple[int, ...], mode: str) -> None:
    rover, terrain = rb.load_rover("rocky7"), rb.surfaces.rough(1, min_radius=0.3)
    rng = np.random.default_rng(1)
    pose = rb.settle(rover, terrain, *rng.uniform(-1, 1, (3, *shape)), mode=mode)
    for name in ("x", "y", "z", "roll", "pitch", "yaw", "rocker", "status", "tilt", "clearance"):
        assert getattr(pose, name).shape == shape, name
    for name in ("q", "steering", "gap", "contact_angle", "contact_count", "wheel_lifted"):
        assert getattr(pose, name).shape == (*shape, 6), name
    for name, tail in (("bogie", (2,)), ("joint_stop", (3,)), ("contact_point", (6, 3)), ("contact_normal", (6, 3))):
        assert getattr(pose, name).shape == (*shape, *tail), name
    assert pose.T_world_body.shape == (*shape, 4, 4)
    assert pose.status.dtype == np.uint8
    if mode == "equilibrium":
        assert pose.support.shape == (*shape, 6)
        assert pose.belly_support.shape == shape


def test_positions_and_steering_broadcast() -> None:
    rover, terrain = paper_rover(), rb.surfaces.rough(2)
    x, y, yaw = np.linspace(-1, 1, 4)[:, None], np.linspace(-1, 1, 3), 0.3
    steering = turned(rover, 2)[:, None, None]
    pose = rb.settle(rover, terrain, x, y, yaw, steering=steering)
    assert pose.shape == (2, 4, 3)
    for k, i, j in np.ndindex(2, 4, 3):
        alone = rb.settle(rover, terrain, x[i, 0], y[j], yaw, steering=steering[k, 0, 0])
        assert np.array_equal(alone.q, pose.q[k, i, j])
    assert rb.settle(rover, terrain, np.zeros((0, 5)), 0.0).shape == (0, 5)


def rough_places(count: int) -> tuple[rb.Rover, rb.Terrain, np.ndarray, np.ndarray]:
    """Return a rover with wide wheels on rocks, with poses across the edge and missing data."""
    rover = wide(rb.load_rover("elhami-dashti"), 0.08)
    field = rb.surfaces.rocks(0.2, 3, size=8.0, spacing=0.04)
    z = field.z.copy()
    z[40:44, 120:126] = np.nan
    rng = np.random.default_rng(5)
    spots = rng.uniform(-4, 4, (2, count)), rng.uniform(-np.pi, np.pi, (1, count))
    return rover, rb.Terrain.from_array(z, 0.04, field.origin, "linear"), np.concatenate(spots), turned(rover, count)


def test_a_pose_depends_on_nothing_but_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    count = 6000
    rover, terrain, spots, steering = rough_places(count)
    whole = rb.settle(rover, terrain, *spots, steering=steering)
    assert set(np.unique(whole.status)) >= {rb.Status.CONVERGED, rb.Status.OFF_MAP, rb.Status.NO_DATA}
    order = np.random.default_rng(0).permutation(count)
    other = rb.settle(rover, terrain, *spots[:, order], steering=steering[order])
    assert np.array_equal(other.q, whole.q[order], equal_nan=True)
    assert np.array_equal(other.status, whole.status[order])
    monkeypatch.setattr(sys.modules["rockerbogie.settling.settle"], "CHUNK", 700)
    assert np.array_equal(rb.settle(rover, terrain, *spots, steering=steering).q, whole.q, equal_nan=True)
    for k in order[:50]:
        alone = rb.settle(rover, terrain, *spots[:, k], steering=steering[k])
        assert np.array_equal(alone.q, whole.q[k], equal_nan=True)
        assert np.array_equal(alone.contact_point, whole.contact_point[k], equal_nan=True)
        pair = rb.settle(rover, terrain, *spots[:, k : k + 2], steering=steering[k : k + 2])
        assert np.array_equal(pair.q, whole.q[k : k + 2], equal_nan=True)


def test_poses_alone_with_unlike_wheels_are_those_of_a_batch() -> None:
    rover, terrain, spots, steering = rough_places(200)
    rover = rover.replace(wheel_width=np.array([0.08, 0.08, 0.1, 0.1, 0.0, 0.0]))
    whole = rb.settle(rover, terrain, *spots, steering=steering)
    for k in range(40):
        alone = rb.settle(rover, terrain, *spots[:, k], steering=steering[k])
        assert np.array_equal(alone.q, whole.q[k], equal_nan=True)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
def test_plain_numbers_give_the_pose_of_arrays(mode: str, interpolation: str) -> None:
    rover, terrain, spots, steering = rough_places(12)
    steering[::3] = 0.0
    steering.flags.writeable = False
    terrain = rb.Terrain.from_array(terrain.z, terrain.spacing, terrain.origin, interpolation)
    spots[:, 0] = 1.0, -2.0, 1.0
    whole = rb.settle(rover, terrain, *spots, mode=mode, steering=steering)
    for k in range(12):
        turn = None if k % 3 == 0 else steering[k].tolist() if k % 3 == 1 else steering[k]
        for kind in (float, np.float64, int) if k == 0 else (float,):
            alone = rb.settle(rover, terrain, *map(kind, spots[:, k]), mode=mode, steering=turn)
            arrays = rb.settle(rover, terrain, *map(np.array, spots[:, k]), mode=mode, steering=turn)
            for name in ("x", "y", "yaw", "q", "status", "steering", "report"):
                value, other, of_batch = (getattr(pose, name) for pose in (alone, arrays, whole))
                if value is None:
                    assert other is None
                    continue
                assert (value.shape, value.dtype, value.flags.writeable) == (other.shape, other.dtype, other.flags.writeable)
                assert np.array_equal(value, other, equal_nan=True)
                assert np.array_equal(value, of_batch[k], equal_nan=True)
            assert alone.gravity == whole.gravity
            assert np.array_equal(alone.gap, whole.gap[k], equal_nan=True)


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 10**400, "east", None], ids=lambda bad: str(bad)[:4])
@pytest.mark.parametrize("name", ["x", "y", "yaw"])
def test_a_position_that_is_no_finite_number_is_refused(name: str, bad: object) -> None:
    given = {"x": 0.0, "y": 0.0, "yaw": 0.0, name: bad}
    with pytest.raises(rb.RockerbogieError, match=rf"{name} is not (a number|finite)"):
        rb.settle(paper_rover(), rb.surfaces.plane(), **given)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 0.0, -9.8, 10**400, "mars"], ids=lambda bad: str(bad)[:4])
def test_impossible_gravity_is_refused(bad: object) -> None:
    with pytest.raises(rb.RockerbogieError, match="gravity is"):
        rb.settle(paper_rover(), rb.surfaces.plane(), 0.0, 0.0, gravity=bad)


def settle_elsewhere(count: int, mode: str, **environment: str) -> tuple[np.ndarray, np.ndarray]:
    """Return q and status of `rough_places(count)`, computed by another process."""
    script = (
        "import sys, numpy as np, rockerbogie as rb\n"
        "from test_settle import rough_places\n"
        f"rover, terrain, spots, steering = rough_places({count})\n"
        f"pose = rb.settle(rover, terrain, *spots, steering=steering, mode={mode!r})\n"
        "np.save(sys.stdout.buffer, np.concatenate([pose.q, pose.status[:, None]], axis=1))\n"
    )
    folders = map(str, Path(__file__).parents[:2])
    path = os.pathsep.join([*folders, *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": path, **environment}, capture_output=True, check=True
    )
    table = np.load(io.BytesIO(done.stdout))
    return table[:, :6], table[:, 6]


def test_any_number_of_threads_gives_the_same() -> None:
    (one, _), (two, _) = (settle_elsewhere(3000, "contact", NUMBA_NUM_THREADS=n) for n in ("1", "2"))
    assert np.isfinite(one).any()
    assert np.array_equal(one, two, equal_nan=True)


@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
def test_plain_python_gives_what_the_compiled_kernels_give(mode: str) -> None:
    count = 4
    rover, terrain, spots, steering = rough_places(count)
    here = rb.settle(rover, terrain, *spots, steering=steering, mode=mode)
    q, status = settle_elsewhere(count, mode, NUMBA_DISABLE_JIT="1")
    assert np.isfinite(here.q[:, 0]).sum() >= 2
    assert np.array_equal(status, here.status)
    assert_close(q, here.q, 1e-9, "m, rad", "the same kernels, not compiled")


def test_missing_data_and_the_edge_of_the_map_give_nan_and_a_status() -> None:
    rover = wide(paper_rover(), 0.08)
    z = np.zeros((201, 201))
    z[100, 100] = np.nan  # at (0, 0)
    terrain = rb.Terrain.from_array(z, 0.02, (-2, -2), "linear")
    under_wheel = rb.settle(rover, terrain, -rover.hubs[2, 0], -rover.hubs[2, 1])
    under_belly = rb.settle(rover, terrain, 0.0, 0.0)
    over_edge = rb.settle(rover, terrain, [1.6, 0.0, 0.0, 5.0], [0.0, 1.8, -1.8, 0.0])
    assert under_wheel.status == rb.Status.NO_DATA
    assert under_belly.status == rb.Status.CONVERGED, "no tread lies over missing data"
    assert over_edge.status.tolist() == [rb.Status.OFF_MAP] * 4
    for pose in (under_wheel, over_edge):
        assert np.isnan(pose.q).all()
        assert np.isnan(pose.gap).all()
        assert np.isnan(pose.contact_point).all()
        assert (pose.contact_count == 0).all()


@pytest.mark.parametrize("which", ["k=20%", "marsyard2021 linear", "marsyard2021 cubic"])
def test_poses_on_rocks_and_a_mars_yard_are_verified(which: str) -> None:
    """Verify a part of the poses of `tools/verify_settle.py`."""
    ground = grounds()
    if which not in ground:
        pytest.skip("the Mars yard's file is not here: set ROCKERBOGIE_DATA")
    terrain = ground[which]()
    for name in ("elhami-dashti", "perseverance", "rocky7"):
        rover = rb.load_rover(name)
        verified = verify_contact(rb.settle(rover, terrain, *draw(terrain, rover, 200, 7)))
        known = verified.status.sum() - verified.status[rb.Status.NO_DATA]
        assert known > 150
        assert len(verified.gap) >= 0.995 * known, f"{name}: {verified.status}"
        assert verified.failed == 0, f"{name}: a gap of {verified.worst} m is reported as settled (limit {TOLERANCE} m)"


def test_pose_transform_is_the_paper_s() -> None:
    pose = rb.settle(paper_rover(), rb.surfaces.rough(6), [0.1, 0.5], 0.2, 0.4)
    T = body_transform(pose.x, pose.y, pose.z, pose.roll, pose.pitch, pose.yaw)
    assert_close(pose.T_world_body, T, 1e-15, "", "eq. 10")
    assert_close(np.cos(pose.tilt), T[:, 2, 2], 1e-12, "", "tilt is the angle of the body's z to the vertical")
