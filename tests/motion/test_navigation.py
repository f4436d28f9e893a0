"""Body twist, wheel commands and slip against derivatives of poses and rigid-body motion."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.motion.body_twist import SensorNoise
from rockerbogie.motion.jacobian import contact_rows, ground_rates
from rockerbogie.motion.slip import slip_ratio
from rockerbogie.motion.wheel_commands import arc, commands_along, crab, straight, turn_in_place
from rockerbogie.rover.frames import wheel_frames
from support.helpers import assert_close, paper_rover, random_rover


def moving(rover, terrain, x, y, yaw, way, h=1e-5):
    """Return poses, and twist and joint rates by central differences along rates of x, y, yaw."""
    pose, ahead, behind = (rb.settle(rover, terrain, x + s * way[0], y + s * way[1], yaw + s * way[2]) for s in (0.0, h, -h))
    good = (pose.status == 0) & (ahead.status == 0) & (behind.status == 0)
    assert good.mean() > 0.9, "too few poses to say anything"
    T = np.linalg.inv(pose.T_world_body) @ (ahead.T_world_body - behind.T_world_body) / (2 * h)
    twist = np.stack([T[..., 0, 3], T[..., 1, 3], T[..., 2, 3], T[..., 2, 1], T[..., 0, 2], T[..., 1, 0]], axis=-1)
    joints = (ahead.q[..., 3:] - behind.q[..., 3:]) / (2 * h)
    return pose, twist, joints, good


def hilly(seed=1):
    """Return smooth random terrain."""
    return rb.Terrain.from_array(np.random.default_rng(seed).normal(size=(60, 60)) * 0.06, 0.25, (-7.0, -7.0))


@pytest.mark.parametrize("width", [0.0, 0.08])
def test_lift_is_0_as_the_pose_moves(width):
    rng = np.random.default_rng(2)
    rover = paper_rover().replace(wheel_width=np.full(6, width))
    places = rng.uniform(-4, 4, (2, 200))
    pose, twist, joints, good = moving(rover, hilly(), *places, rng.uniform(-3, 3, 200), rng.normal(size=(3, 200)))
    rows = contact_rows(rover, pose)
    lift = np.einsum("nij,nj->ni", rows[:, :, 2, :9], np.concatenate([twist, joints], axis=1))
    worst = np.abs(lift).max(axis=1)[good]
    # a broad wheel's contact may jump from edge to edge within the difference's step; nothing else may be off
    speed = np.linalg.norm(twist, axis=1)[good].mean()
    assert_close(np.sort(worst)[: int(0.97 * good.sum())], 0.0, 2e-6 * speed, "m/s", "six gaps stay zero along settled poses")
    assert_close(np.median(worst), 0.0, 5e-7 * speed, "m/s", "contact angles are found to about a microradian")
    found = ground_rates(rows, twist)
    near = np.abs(lift).max(axis=1) < 1e-5
    assert_close(
        found[near], joints[near], 2e-4, "rad/s", "the joint rates that keep wheels on the terrain are those of the pose"
    )


def test_commands_and_twist_agree_where_no_wheel_slips():
    rover = paper_rover()
    x = np.linspace(-3, 3, 400)
    pose, twist, joints, good = moving(rover, rb.surfaces.sine(0.1, 2.0), x, 0.3 + 0 * x, 0 * x, np.array([0.02, 0, 0]), 1e-3)
    commands = rb.wheel_commands(rover, pose, twist)
    run = rb.drive(rover, rb.surfaces.sine(0.1, 2.0), rb.Path.straight((-3, 0.3), 0.0, 6.0), 0.02, step=6.0 / 399)
    assert_close(commands.wheel_rates, run["wheel_rate"], 1e-6, "rad/s", "a drive's rates are the commands along it")
    assert_close(run["side_slip"], 0.0, 1e-12, "m/s", "and so is its slip")
    size = np.linalg.norm(twist, axis=1).mean()
    assert_close(commands.side_slip, 0.0, 1e-12, "m/s", "straight ahead on terrain uniform across, no wheel slips")
    for sensors in ({}, {"rocker_rate": joints[:, 0], "bogie_rates": joints[:, 1:]}):
        motion = rb.body_twist(rover, pose, wheel_rates=commands.wheel_rates, **sensors)
        assert_close(motion.twist[good], twist[good], 1e-6 * size, "m/s, rad/s", "no slip: the derivative of the pose")
        assert_close(motion.residual[good], 0.0, 1e-6 * size, "m/s", "and no residual")


def test_residual_is_the_unavoidable_slip():
    rng = np.random.default_rng(3)
    rover = paper_rover()
    pose, twist, _, good = moving(rover, hilly(), *rng.uniform(-4, 4, (2, 50)), rng.uniform(-3, 3, 50), np.array([0.02, 0, 0.03]))
    commands = rb.wheel_commands(rover, pose, twist, steering=np.zeros(6))
    motion = rb.body_twist(rover, pose, wheel_rates=commands.wheel_rates, steering=np.zeros(6))
    slip = rb.wheel_slip(
        rover, pose, motion.twist, commands.wheel_rates, rocker_rate=motion.rocker_rate, bogie_rates=motion.bogie_rates
    )
    left = np.stack([slip.roll, slip.side, slip.lift], axis=-1)
    assert_close(left[good], motion.residual[good], 1e-7, "m/s", "the residual is the slip at the twist it found")
    assert np.linalg.norm(motion.residual[good]) > 1e-3, "turning with fixed wheels cannot be free of slip"


def test_slip_is_the_velocity_of_the_tread_at_its_contact():
    rng = np.random.default_rng(4)
    rover = random_rover(rng).replace(wheel_width=np.zeros(6))
    steering = rng.uniform(-0.4, 0.4, 6)
    h, size = 1e-5, rover.wheelbase
    ground = rb.Terrain.from_array(rng.normal(size=(60, 60)) * 0.04 * size, 0.5 * size, (-15 * size, -15 * size))
    way = np.array([0.1 * size, 0.02 * size, 0.1])
    x, y, yaw = rng.uniform(-4 * size, 4 * size, 20), rng.uniform(-4 * size, 4 * size, 20), rng.uniform(-3, 3, 20)
    pose, ahead, behind = (
        rb.settle(rover, ground, x + s * way[0], y + s * way[1], yaw + s * way[2], steering=steering) for s in (0.0, h, -h)
    )
    assert (pose.status == 0).all()
    axle = [p.T_world_body[:, None] @ wheel_frames(rover, p.rocker, p.bogie, p.steering) for p in (pose, ahead, behind)]
    rate = (axle[1] - axle[2]) / (2 * h)
    spin = rng.uniform(-3, 3, (20, 6))
    W = rate[..., :3, :3] @ np.swapaxes(axle[0][..., :3, :3], -1, -2)
    turning = np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], axis=-1) + spin[..., None] * axle[0][..., :3, 1]
    arm = pose.contact_point - axle[0][..., :3, 3]
    tread = rate[..., :3, 3] + np.cross(turning, arm)
    n = pose.contact_normal
    forward = np.cross(axle[0][..., :3, 1], n)
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    T = np.linalg.inv(pose.T_world_body) @ (ahead.T_world_body - behind.T_world_body) / (2 * h)
    twist = np.stack([T[..., 0, 3], T[..., 1, 3], T[..., 2, 3], T[..., 2, 1], T[..., 0, 2], T[..., 1, 0]], axis=-1)
    slip = rb.wheel_slip(rover, pose, twist, spin)
    assert_close(
        slip.roll,
        (tread * forward).sum(axis=-1),
        1e-5 * size,
        "m/s",
        "rigid-body velocity of the tread along its rolling direction",
    )
    assert_close(slip.side, (tread * np.cross(n, forward)).sum(axis=-1), 1e-5 * size, "m/s", "and across it")
    upright = np.cross(forward, axle[0][..., :3, 1])
    assert_close(slip.turn, (turning * upright).sum(axis=-1), 1e-5, "rad/s", "and about z of the contact frame")
    travel = (rate[..., :3, 3] * forward).sum(axis=-1)
    drive = rover.wheel_radius * (turning * axle[0][..., :3, 1]).sum(axis=-1)
    assert_close(slip.ratio, slip_ratio(drive, travel), 1e-3, "1", "hub speed against the rim's")


def test_slip_ratio():
    drive = [1.0, 1.0, 0.5, 0.0, -1.0, 1.0, 0.0]
    travel = [1.0, 0.5, 1.0, 1.0, -0.5, 0.0, 0.0]
    assert_close(slip_ratio(drive, travel), [0, 0.5, -0.5, -1, 0.5, 1, np.nan], 0, "1", "terramechanics' definition")


def flat_state():
    return SimpleNamespace(rocker=0.0, bogie=np.zeros(2), contact_angle=np.zeros(6), roll=0.0, pitch=0.0)


def level_rover(steers=(True, False, True)):
    return rb.Rover.from_pivots(
        wheel_radius=0.1, rocker_pivot=(0.1, 0.3, 0.3), bogie_pivot=(-0.2, 0.35, 0.2),
        hubs=[(0.5, 0.4, 0.1), (0, 0.5, 0.1), (-0.4, 0.4, 0.1)], steers=steers,
    )  # fmt: skip


def test_twists_on_level_terrain():
    rover, flat = level_rover(), flat_state()
    ahead = rb.wheel_commands(rover, flat, straight(0.05))
    assert_close(ahead.wheel_rates, 0.5, 1e-14, "rad/s", "v / r")
    assert_close(ahead.steering, 0.0, 0, "rad", "straight")
    curve = rb.wheel_commands(rover, flat, arc(rover, 0.05, 2.0))
    x, across = rover.hubs[:, 0], 2.0 - rover.hubs[:, 1]
    assert_close(curve.steering, np.arctan2(x, across), 1e-12, "rad", "Ackermann: perpendicular to the line to the centre")
    assert_close(
        curve.wheel_rates, 0.05 / 2.0 * np.hypot(x, across) / 0.1, 1e-12, "rad/s", "a rate in proportion to the distance from it"
    )
    assert_close(curve.side_slip, 0.0, 1e-12, "m/s", "corner wheels steer, middle ones are abeam: no slip")
    about = rb.wheel_commands(rover, flat, turn_in_place(rover, 0.1))
    left = rover.hubs[:, 1] > 0
    assert (np.sign(about.wheel_rates) == np.where(left, -1, 1)).all(), "a left turn: left wheels back, right ones forward"
    assert_close(about.side_slip, 0.0, 1e-12, "m/s", "the same turning centre")
    aside = rb.wheel_commands(level_rover((True, True, True)), flat, crab(0.05, 0.4))
    assert_close(aside.steering, 0.4, 1e-12, "rad", "all wheels point along the direction of travel")
    assert_close(aside.twist, crab(0.05, 0.4), 1e-14, "m/s", "without turning")


def test_offset_steering_axes_still_leave_no_side_slip():
    rng = np.random.default_rng(5)
    rover = random_rover(rng)
    pose = rb.settle(rover, rb.surfaces.plane(0.2, 0.5, size=20.0), 0.0, 0.0, 0.3)
    commands = rb.wheel_commands(rover, pose, arc(rover, 0.05, 2 * rover.wheelbase))
    assert_close(commands.side_slip, 0.0, 1e-10, "m/s", "each wheel turns to its own direction; its hub moves with the steering")


def test_limits_are_kept_and_the_difference_is_reported():
    rover, flat = level_rover(), flat_state()
    wanted = arc(rover, 0.05, 0.8)
    free = rb.wheel_commands(rover, flat, wanted)
    slow = rb.wheel_commands(rover, flat, wanted, wheel_rate_limit=0.2)
    assert_close(np.abs(slow.wheel_rates).max(), 0.2, 1e-14, "rad/s", "the fastest motor is at its limit")
    assert_close(slow.speed_scale, 0.2 / np.abs(free.wheel_rates).max(), 1e-12, "1", "the share of the speed that is left")
    assert_close(slow.twist, wanted * slow.speed_scale, 1e-12, "m/s, rad/s", "the same path, slower")
    stiff = rb.wheel_commands(rover, flat, wanted, steering_limit=0.3)
    assert np.abs(stiff.steering).max() <= 0.3
    assert_close(stiff.steering + stiff.steering_short, free.steering, 1e-12, "rad", "the difference is reported")
    assert (np.abs(stiff.side_slip[np.abs(stiff.steering_short) > 1e-9]) > 1e-3).all(), "and the resulting side slip"
    with pytest.raises(rb.RockerbogieError, match="limits are 0"):
        rb.wheel_commands(rover, flat, wanted, wheel_rate_limit=0)
    with pytest.raises(rb.RockerbogieError, match=r"twist has shape \(3,\)"):
        rb.wheel_commands(rover, flat, [0.1, 0, 0])


def test_any_subset_of_sensors():
    rover, flat = level_rover(), flat_state()
    wanted = arc(rover, 0.05, 2.0)
    c = rb.wheel_commands(rover, flat, wanted)
    three = np.where([True, False, True, True, False, False], c.wheel_rates, np.nan)
    motion = rb.body_twist(rover, flat, wheel_rates=three, steering=c.steering)
    assert_close(motion.twist, wanted, 1e-12, "m/s, rad/s", "three wheels are enough without slip; NaN marks a missing reading")
    assert np.isnan(motion.residual[[1, 4, 5], 0]).all()
    assert np.isfinite(motion.residual[[0, 2, 3], 0]).all()
    turning = rb.body_twist(rover, flat, gyro=wanted[3:], steering=c.steering)
    assert_close(turning.twist, wanted, 1e-12, "m/s, rad/s", "the rate about a known centre gives the speed")
    gyro = rb.body_twist(rover, flat, gyro=np.zeros(3), steering=np.zeros(6))
    assert_close(gyro.twist[1:], 0.0, 1e-12, "m/s, rad/s", "fixed wheels allow straight motion only")
    assert np.isnan(gyro.twist[0])
    assert np.isinf(gyro.covariance[0, 0]), "but no sensor gives the speed"
    assert np.isnan(gyro.residual).all(), "so the wheels' slip is unknown too"
    lean = rb.body_twist(rover, flat, wheel_rates=c.wheel_rates, inclinometer_rates=[0.0, 0.0], steering=c.steering)
    assert_close(lean.twist, wanted, 1e-12, "m/s, rad/s", "an inclinometer that agrees changes nothing")
    with pytest.raises(rb.RockerbogieError, match=r"gyro has shape \(2,\)"):
        rb.body_twist(rover, flat, gyro=[0.0, 0.0])


def test_covariance_equals_the_scatter():
    rng = np.random.default_rng(6)
    rover, flat = level_rover(), flat_state()
    noise = SensorNoise(roll_slip=0.01, side_slip=0.01, lift=0.002, gyro=0.003)
    n = 4000
    slipping = np.stack([rng.normal(0, 0.01, (n, 6)), rng.normal(0, 0.01, (n, 6)), rng.normal(0, 0.002, (n, 6))], axis=-1)
    rows = contact_rows(rover, flat)[:, :3, :9]
    # disturb the wheel and gyro readings only: the part of the covariance that they make
    rates = 0.5 + slipping[..., 0] / rover.wheel_radius
    gyro = rng.normal(0, 0.003, (n, 3))
    motion = rb.body_twist(rover, flat, wheel_rates=rates, gyro=gyro, noise=noise)
    A = np.concatenate([(rows / [[0.01], [0.01], [0.002]]).reshape(18, 9), np.eye(9)[3:6] / 0.003])
    gain = np.linalg.pinv(A)
    felt = gain[:, [*range(0, 18, 3), 18, 19, 20]]
    assert_close(motion.covariance[0], (gain @ gain.T)[:6, :6], 1e-12, "SI", "(AᵀA)⁻¹ of the whitened equations")
    scatter, expected = np.cov(motion.twist.T), (felt @ felt.T)[:6, :6]
    size = np.sqrt(np.diag(expected))
    assert_close(scatter / np.outer(size, size), expected / np.outer(size, size), 0.1, "1", "4,000 draws")


def test_batches_with_poses_off_the_map():
    rover = paper_rover()
    ground = rb.surfaces.plane(0.1, 0.0, size=10.0)
    pose = rb.settle(rover, ground, np.array([[0.0, 0.5, 50.0]]).reshape(3, 1, 1), np.zeros((1, 1, 2)), 0.0)
    commands = rb.wheel_commands(rover, pose, straight(0.1))
    assert commands.wheel_rates.shape == (3, 1, 2, 6)
    motion = rb.body_twist(rover, pose, wheel_rates=commands.wheel_rates)
    assert motion.twist.shape == (3, 1, 2, 6)
    assert np.isfinite(motion.twist[:2]).all()
    assert np.isnan(motion.twist[2]).all(), "no pose off the map, so no motion"


def test_commands_along_a_path_slow_down_for_slow_motors():
    rover = rb.load_rover("curiosity")
    ground = rb.surfaces.plane(size=20.0)
    run = rb.drive(rover, ground, rb.Path.waypoints([(-4, 0), (0, 0), (3, 3)], radius=3.0), 0.1, step=0.02)
    free = commands_along(run)
    assert_close(free["time"][-1], run["time"][-1], 1e-4, "s", "no limit, no delay")
    slow = commands_along(run, wheel_rate_limit=0.3, steering_rate_limit=0.1)
    assert np.abs(slow["wheel_rate"]).max() <= 0.3 + 1e-12
    swing = np.abs(np.diff(slow["steering"], axis=0)).max(axis=1) / np.diff(slow["time"])
    assert swing.max() <= 0.1 * (1 + 1e-6)
    rolled = np.trapezoid(run["wheel_rate"], run["time"], axis=0)
    for commands in (free, slow):
        total = np.trapezoid(commands["wheel_rate"], commands["time"], axis=0)
        assert_close(total, rolled, 1e-4, "rad", "the same distance is rolled")
    assert float(slow["time"][-1]) > float(run["time"][-1])
    assert slow["speed_scale"].min() < 0.5
    with pytest.raises(rb.RockerbogieError, match="limits are 0 and inf"):
        commands_along(run, wheel_rate_limit=0)
