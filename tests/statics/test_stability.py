"""Tip margins against closed forms, a conic solver and MuJoCo."""

from __future__ import annotations

import numpy as np
import pytest
from test_loads import conic, level_rover, plane, settled, unit_columns

import rockerbogie as rb
from rockerbogie.statics.contacts import pack_contacts
from rockerbogie.statics.held_directions import HeldDirections


def test_on_little_friction_a_rover_slides_at_the_friction_angle() -> None:
    for slope in (0.0, 0.1):
        got = rb.stability(rb.settle(rb.load_rover("curiosity"), plane(slope), 0.0, 0.0, 0.4), friction=0.3)
        assert got.tip_margin == pytest.approx(np.arctan(0.3) - slope, abs=1e-5)
        assert got.slides
        if slope:
            assert np.cos(got.direction) == pytest.approx(-1.0, abs=1e-3)  # downhill


def test_force_angle_and_energy_of_a_rectangle_follow_the_closed_forms() -> None:
    ahead, weight = 0.06, 100.0 * rb.GRAVITY["earth"]
    rover = level_rover(ahead)
    got = rb.stability(rb.settle(rover, rb.surfaces.plane(), 0.0, 0.0))
    x = rover.body.com[0]
    distances = np.array([0.4, 0.5 - x, 0.5 + x])  # of the centre of mass from the sides, the front and the rear
    assert got.force_angle == pytest.approx(weight * (np.arctan2(distances, 0.3) * distances).min(), rel=1e-9)
    assert got.energy == pytest.approx(weight * (np.hypot(distances, 0.3) - 0.3).min(), rel=1e-9)


def tilted(pose: rb.Pose, azimuth: float, angle: float) -> rb.WheelLoads:
    """Return the loads under turned gravity, by the acceleration of the same effect."""
    g = rb.GRAVITY["earth"]
    turned = g * np.array([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), -np.cos(angle)])
    return rb.wheel_loads(pose, acceleration=np.array([0.0, 0.0, -g]) - turned)


@pytest.mark.parametrize(("name", "surface"), [("curiosity", "mars"), ("osr", "rocks")])
def test_a_conic_solver_holds_the_rover_within_the_margin_and_not_beyond(name: str, surface: str) -> None:
    pose = settled(name, 5, 3, surface=surface)
    friction = 1.2
    got = rb.stability(pose, friction=friction)
    for k in range(3):
        columns, _ = unit_columns(pose, k)
        weights = weight_columns(pose, k)
        scale = np.abs(columns[3:]).max()
        columns[3:] /= scale
        weights[3:] /= scale
        margin = float(got.tip_margin[k])
        assert 0.1 < margin < 1.5

        def short(azimuth: float, angle: float, weights: np.ndarray = weights, columns: np.ndarray = columns) -> float:
            turned = np.array([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), -np.cos(angle)])
            return conic(columns, -weights @ turned, friction)

        assert short(float(got.direction[k]), margin + 2e-3) > 0.0
        for azimuth in np.arange(12) * np.pi / 6:
            assert short(azimuth, margin - 2e-3) < 1e-9


def weight_columns(pose: rb.Pose, k: int) -> np.ndarray:
    """Return the nine sums of a unit weight along each axis, (9, 3)."""
    from test_loads import link_wrenches

    one = rb.wheel_loads(pose)
    empty = {name: np.zeros_like(getattr(one, name)) for name in ("normal", "traction", "side", "torque", "joint_torque")}
    none = rb.WheelLoads(
        **empty, required_friction=one.required_friction, friction_bound=one.friction_bound, belly=one.belly,
        status=one.status, law="vertical",
    )  # fmt: skip
    columns = [link_wrenches(pose, none, k, gravity=axis) for axis in np.eye(3)]
    return np.array(columns).T / pose.rover.mass


def test_the_margin_shrinks_by_the_slope() -> None:
    rover = rb.load_rover("osr")
    flat = rb.stability(rb.settle(rover, plane(0.0), 0.0, 0.0, np.pi))
    steep = rb.stability(rb.settle(rover, plane(0.3), 0.0, 0.0, np.pi))
    facing = rb.stability(rb.settle(rover, plane(0.0), 0.0, 0.0, 0.0))
    assert flat.tip_margin == pytest.approx(float(facing.tip_margin), abs=1e-5)  # turning the rover changes nothing
    assert abs(np.cos(facing.direction)) == pytest.approx(1.0, abs=1e-3)  # it tips along its own axis
    along = rb.stability(rb.settle(rover, plane(0.3), 0.0, 0.0, 0.0 if np.cos(facing.direction) < 0 else np.pi))
    assert along.tip_margin == pytest.approx(float(flat.tip_margin) - 0.3, abs=1e-4)
    assert steep.tip_margin >= along.tip_margin - 1e-6


@pytest.mark.parametrize("width", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("heading", [0.5 * np.pi, -0.5 * np.pi])
def test_a_rover_tips_sideways_over_the_outer_edges_of_its_treads(width: float, heading: float) -> None:
    """Compare with the closed form.

    The middles of the treads are 0.4 m from the centre of mass, which is 0.3 m high.
    """
    rover = level_rover().replace(wheel_width=width, masses="keep")
    outer = np.arctan2(0.4 + width / 2, 0.3)
    for beyond in (-0.05, 0.05):
        pose = rb.settle(rover, plane(outer + beyond), 0.0, 0.0, heading)
        got = rb.stability(pose, friction=3.0)
        assert got.tip_angle == pytest.approx(-beyond, abs=2e-4)
        if beyond < 0.0:
            assert got.edge == ("LR LM LF" if heading > 0.0 else "RR RM RF")  # the plane rises along x
            assert 0.0 <= got.tip_margin - got.tip_bound < 1e-4
        assert rb.wheel_loads(pose).status == (rb.LoadStatus.BALANCED if beyond < 0.0 else rb.LoadStatus.NOT_HELD)


def test_the_support_polygon_holds_the_ends_of_contact_lines() -> None:
    rover = level_rover().replace(wheel_width=0.1, masses="keep")
    weight = rover.mass * rb.GRAVITY["earth"]
    got = rb.stability(rb.settle(rover, plane(0.0), 0.0, 0.0))
    ahead = 0.5 - abs(rover.body.com[0])
    distance = np.array([0.45, ahead, 1.0 - ahead])
    assert got.energy == pytest.approx(weight * (np.hypot(distance, 0.3) - 0.3).min(), rel=1e-9)
    assert got.force_angle == pytest.approx(weight * (np.arctan2(distance, 0.3) * distance).min(), rel=1e-9)


def test_gravity_scales_the_energy_and_not_the_angle() -> None:
    pose = settled("sawppy", 3, 4)
    earth, moon = rb.stability(pose), rb.stability(pose, gravity=rb.GRAVITY["moon"])
    np.testing.assert_array_equal(earth.tip_margin, moon.tip_margin)
    np.testing.assert_allclose(moon.energy / earth.energy, rb.GRAVITY["moon"] / rb.GRAVITY["earth"], rtol=1e-12)


def test_bad_input_is_a_sentence_and_no_pose_is_nan() -> None:
    pose = settled("curiosity", 3, 2)
    for wrong in ({"gravity": -1.0}, {"friction": 0.0}, {"friction": np.nan}, {"friction": "much"}, {"friction": True}):
        with pytest.raises(rb.RockerbogieError):
            rb.stability(pose, **wrong)
    got = rb.stability(rb.settle(pose.rover, pose.terrain, 1e4, 0.0))
    assert np.isnan([got.tip_margin, got.direction, got.energy]).all()
    assert got.edge == ""
    assert repr(got) == "<Stability: no pose, or no margin found>"


def test_a_locked_rover_in_mujoco_tips_at_the_same_tilt() -> None:
    mujoco = pytest.importorskip("mujoco", reason="needs mujoco")
    from support.braked import tilt_of_loss

    rover, friction = rb.load_rover("osr").replace(wheel_width=0.0), 1.2
    pose = rb.settle(rover, rb.surfaces.plane(), 0.0, 0.0)
    for azimuth in (0.0, 0.5 * np.pi):
        limits = [tilted(pose, azimuth, angle).required_friction < friction for angle in np.radians(np.arange(40.0, 60.0, 0.1))]
        expected = 40.0 + 0.1 * int(np.argmin(limits))
        assert np.degrees(tilt_of_loss(mujoco, rover, azimuth, friction, np.radians(expected))) == pytest.approx(
            expected, abs=0.5
        )


@pytest.mark.parametrize("width", [0.0, 0.25])
def test_a_locked_rover_with_wide_wheels_tips_sideways_in_mujoco_at_the_same_tilt(width: float) -> None:
    """Raise the centre of mass of Curiosity's body by 0.8 m.

    It tips at 36.0° over thin wheels, at 39.9° over treads of 0.25 m.
    """
    mujoco = pytest.importorskip("mujoco", reason="needs mujoco")
    from support.braked import tilt_of_loss

    rover, friction, azimuth = rb.load_rover("curiosity"), 1.3, 0.5 * np.pi
    body = rb.Link(rover.body.mass, rover.body.com + [0.0, 0.0, 0.8], rover.body.inertia)
    rover = rover.replace(body=body, wheel_width=width, masses="keep")
    pose = rb.settle(rover, rb.surfaces.plane(), 0.0, 0.0)
    angles = np.radians(np.arange(34.0, 42.0, 0.05))
    expected = angles[int(np.argmin([tilted(pose, azimuth, angle).required_friction < friction for angle in angles]))]
    found = tilt_of_loss(mujoco, rover, azimuth, friction, float(expected), np.radians(0.2), np.radians(6.0))
    assert np.degrees(found) == pytest.approx(np.degrees(expected), abs=0.3)


@pytest.mark.parametrize("heading", [0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi])
def test_the_tip_angle_is_signed(heading: float) -> None:
    """Compare slopes: the angle falls by a degree for each degree of slope, through 0 and below."""
    rover = rb.load_rover("osr")

    def tip_angle(slope: float) -> rb.Stability:
        z = np.tan(np.radians(slope)) * np.arange(0.0, 8.0, 0.1)[None, :] * np.ones((60, 1))
        return rb.stability(rb.settle(rover, rb.Terrain.from_array(z, 0.1, interpolation="linear"), 4.0, 3.0, heading))

    before, after, beyond = tip_angle(45.0), tip_angle(62.0), tip_angle(70.0)
    assert before.tip_angle == before.tip_margin > 0.0
    assert after.tip_margin == beyond.tip_margin == 0.0
    assert after.tip_angle < 0.0
    assert beyond.tip_angle == pytest.approx(after.tip_angle - np.radians(8.0), abs=1e-3), "gravity turns back by the excess"


@pytest.mark.parametrize(("name", "surface", "mode"), [("curiosity", "mars", "contact"), ("osr", "mars", "equilibrium")])
def test_both_bounds_of_the_margin_agree(name: str, surface: str, mode: str) -> None:
    pose = settled(name, 11, 300, mode, surface)
    got = rb.stability(pose)
    found = np.isfinite(pose.z)
    assert np.isfinite(got.tip_margin[found]).mean() > 0.99
    gap = got.tip_margin - got.tip_bound
    assert np.isfinite(gap[found]).mean() > 0.98  # contacts under the body have no lower bound
    assert np.nanmax(gap) < 1e-4
    assert np.nanmin(gap) >= 0.0


def test_joints_at_their_limits_limit_the_margin() -> None:
    rover = rb.load_rover("osr")
    terrain = rb.surfaces.rocks(seed=4, size=8.0 * rover.wheelbase, k=0.3)
    pose = rb.settle(rover, terrain, [-1.177, 1.603], [-0.721, 0.58], [-0.419, 1.965], mode="equilibrium")
    np.testing.assert_array_equal(pose.joint_stop, [[0, 1, 1], [0, 1, 0]])
    got = rb.stability(pose)
    assert np.all(got.tip_margin - got.tip_bound < 1e-4)
    np.testing.assert_array_equal(got.slides, ~got.stays.any(axis=-1))
    for k in range(2):
        direction, margin = float(got.direction[k]), float(got.tip_margin[k])
        assert 1.9 < tilted(pose, direction, margin - 0.015).required_friction[k] < 2.0
        assert 2.0 < tilted(pose, direction, margin + 0.01).required_friction[k] < 2.1


def test_a_margin_does_not_depend_on_the_other_poses_of_a_batch() -> None:
    pose = settled("sawppy", 3, 20)
    many = rb.stability(pose)
    for k in (0, 7, 19):
        one = rb.stability(rb.settle(pose.rover, pose.terrain, pose.x[k], pose.y[k], pose.yaw[k]))
        assert one.tip_margin == many.tip_margin[k]
        assert one.edge == many.edge[k]


def steep_plane(slope: float) -> rb.Terrain:
    """Return a plane of a slope (rad) up along x, of cells of half a metre."""
    x = np.arange(-6.0, 6.01, 0.5)
    return rb.Terrain.from_array(np.tile(np.tan(slope) * x, (x.size, 1)), 0.5, (-6.0, -6.0), "linear")


@pytest.mark.parametrize("width", [0.08, 0.3])
def test_a_tip_angle_on_a_plane_does_not_depend_on_the_position(width: float) -> None:
    """Wheels touch along their width, also where the line crosses a border of cells.

    Two headings of the narrower rover, at 105° and 255°, are so close to tipping that the lanes have no start.
    """
    rover, heading = rb.load_rover("rocky7").replace(wheel_width=width, masses="keep"), np.linspace(0.0, 2.0 * np.pi, 25)
    y = np.array([0.0, 0.1, 0.3, 0.55])[:, None]
    got = rb.stability(rb.settle(rover, steep_plane(np.radians(55.0)), 0.1, y, heading))
    np.testing.assert_allclose(got.tip_angle, np.tile(got.tip_angle[:1], (4, 1)), atol=1e-4)
    np.testing.assert_allclose(got.tip_angle, got.tip_angle[:, ::-1], atol=1e-4)  # the rover's sides mirror each other
    held = got.tip_angle > 0.0
    assert 0.1 < held.mean() < 0.9
    friction = rb.wheel_loads(rb.settle(rover, steep_plane(np.radians(55.0)), 0.1, y, heading)).required_friction
    np.testing.assert_array_equal(held, friction < 2.0)


@pytest.mark.parametrize(("name", "surface"), [("curiosity", "mars"), ("osr", "rocks")])
def test_projections_find_the_margin_of_the_lanes(name: str, surface: str) -> None:
    pose = settled(name, 8, 4, surface=surface)
    got, packed = rb.stability(pose), pack_contacts(pose)
    free = np.flatnonzero(got.tip_margin < 1.0)  # beyond, the lanes exclude forces that wedge it
    assert free.size >= 3
    for k in free:
        found = HeldDirections(packed, int(k), 2.0).margin()
        assert got.tip_bound[k] - 1e-6 <= found.angle <= got.tip_margin[k] + 1e-6
        assert found.slides == got.slides[k]
        np.testing.assert_array_equal(found.stays, got.stays[k])
