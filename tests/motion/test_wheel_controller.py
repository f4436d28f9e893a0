"""The wheel controller gives the commands of `wheel_commands`, within limits and in time."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.motion.jacobian import SimpleStance, contact_rows
from support.helpers import assert_close

ROVERS = ("curiosity", "osr", "rocky7", "elhami-dashti")


@pytest.mark.parametrize("settled", [True, False], ids=["settled", "stance"])
@pytest.mark.parametrize("name", ROVERS)
def test_commands_fulfil_the_contact_rows(name, settled):
    """Compare with `contact_rows`, which shares no code with the kernel of the commands."""
    rover, rng = rb.load_rover(name), np.random.default_rng(5)
    present = np.where(rover.steers, rng.uniform(-0.6, 0.6, (20, 6)), 0.0)
    if settled:
        terrain = rb.surfaces.fractal(3, size=30 * rover.wheelbase, spacing=0.5 * rover.wheel_radius[0])
        pose = rb.settle(rover, terrain, *rng.uniform(-5, 5, (2, 20)) * rover.wheelbase, 0.3, steering=present)
    else:
        pose = SimpleStance(rng.uniform(-0.2, 0.2, 20), *(rng.uniform(-0.2, 0.2, (20, k)) for k in (2, 6)), present)
    twist = rng.uniform(-0.1, 0.1, (20, 6))
    for limit in (0.8, 3.0):
        found = rb.wheel_commands(rover, pose, twist, near=present, steering_limit=limit)
        rows = contact_rows(rover, pose, found.steering)
        motion = np.concatenate([found.twist, found.rocker_rate[:, None], found.bogie_rates], axis=-1)
        slip = (rows[..., :9] @ motion[:, None, :, None])[..., 0]
        assert_close(found.twist[:, [0, 1, 5]], twist[:, [0, 1, 5]], 1e-12, "SI", "the wanted motion")
        assert_close(slip[..., 2], 0.0, 1e-9, "m/s", "no wheel leaves the terrain")
        assert_close(rover.wheel_radius * found.wheel_rates, slip[..., 0], 1e-9, "m/s", "no wheel slips along")
        assert_close(found.side_slip, slip[..., 1], 1e-9, "m/s", "side slip")
        assert_close(found.turn_slip, slip[..., 3], 1e-9, "rad/s", "turn slip")
        assert (np.abs(found.steering) <= limit).all()
        free = rover.steers & (found.steering_short == 0).all(axis=-1, keepdims=True)  # a wheel at its limit moves the others
        assert free.sum() > 20 or limit < 3.0 or not rover.steers.any()
        # where a contact lies far aside on a wide tread, the iteration may not converge: the slip is then reported
        assert (np.abs(found.side_slip[free]) <= 1e-9).mean() >= 0.95, "steered wheels do not slip sideways"


@pytest.mark.parametrize("limit", ["wide", [1.0, 2.0], np.nan, 0.0])
def test_a_wrong_steering_limit_is_refused(limit):
    rover = rb.load_rover("osr")
    pose = rb.settle(rover, rb.surfaces.plane(), 0.0, 0.0)
    with pytest.raises(rb.RockerbogieError, match="rad"):
        rb.wheel_commands(rover, pose, np.eye(6)[0], steering_limit=limit)


@pytest.mark.parametrize("sigma", [0.0, -1.0, np.nan, np.ones(5)])
def test_a_wrong_standard_deviation_is_refused(sigma):
    rover = rb.load_rover("osr")
    pose = rb.settle(rover, rb.surfaces.plane(), 0.0, 0.0)
    with pytest.raises(rb.RockerbogieError, match="standard deviation"):
        rb.body_twist(rover, pose, gyro=np.zeros(3), noise=rb.SensorNoise(gyro=sigma))


def test_on_flat_terrain_wheels_roll_about_the_turning_centre():
    """Compare steering and rates with plane geometry."""
    rover = rb.load_rover("curiosity")
    controller = rb.WheelController(rover)
    twist = rb.arc(rover, 0.05, 3.0)
    controller.command(twist)
    command = controller.command(twist)
    x, y = rover.hubs[:, 0], rover.hubs[:, 1]
    v = np.stack([twist[0] - twist[5] * y, twist[1] + twist[5] * x], axis=-1)
    assert_close(command.steering, np.where(rover.steers, np.arctan2(v[:, 1], v[:, 0]), 0.0), 1e-9, "rad", "steering")
    assert_close(command.wheel_rates, np.hypot(*v.T) / rover.wheel_radius, 1e-9, "rad/s", "rates")
    assert command.speed_scale == 1.0
    assert not command.waiting


def test_the_rover_waits_until_its_wheels_have_turned():
    rover = rb.load_rover("curiosity")
    controller = rb.WheelController(rover, steering_rate_limit=0.3)
    twist, dt, steering, scales, before = rb.turn_in_place(rover, 0.05), 0.02, np.zeros(6), [], np.zeros(6)
    for _ in range(400):
        command = controller.command(twist, dt=dt)
        steering = command.steering
        assert np.abs(steering - before).max() <= 0.3 * dt + 1e-12
        before = steering
        scales.append(command.speed_scale)
        assert command.waiting == (command.speed_scale == 0.0)
        assert_close(command.twist[5], command.speed_scale * 0.05, 1e-12, "rad/s", "the rover turns at the share stated")
    scales = np.array(scales)
    assert scales[0] == 0.0
    assert scales[-1] == 1.0
    assert (np.diff(scales) >= -1e-12).all()
    assert ((scales > 0) & (scales < 1)).sum() > 5, "it speeds up gradually"


def test_measured_angles_decide_whether_the_rover_waits():
    rover = rb.load_rover("curiosity")
    controller, twist = rb.WheelController(rover), rb.crab(0.05, 0.6)
    stuck = controller.command(twist, steering=np.zeros(6))
    assert stuck.waiting
    assert_close(stuck.wheel_rates, 0.0, 0.0, "rad/s", "it stands")
    turned = np.where(rover.steers, 0.6, 0.0)
    assert controller.command(twist, steering=turned).speed_scale == 1.0
    missing = turned.copy()
    missing[0] = np.nan
    assert controller.command(twist, steering=missing).speed_scale == 1.0, "a missing angle keeps its last value"


def test_wheels_stay_near_their_angles_when_the_rover_reverses():
    rover = rb.load_rover("curiosity")
    controller = rb.WheelController(rover, steering_limit=np.radians(95))
    first = controller.command(rb.crab(0.05, np.radians(80)))
    back = controller.command(rb.crab(0.05, np.radians(80) - np.pi))
    assert_close(back.steering, first.steering, 1e-9, "rad", "the same angles")
    assert_close(back.wheel_rates, -controller.command(rb.crab(0.05, np.radians(80))).wheel_rates, 1e-9, "rad/s", "reversed")
    over = controller.command(rb.crab(0.05, np.radians(93)))
    assert_close(over.steering[rover.steers], np.radians(93), 1e-9, "rad", "13 degrees on, not half a turn back")


def test_a_wheel_beyond_its_limit_takes_the_other_angle():
    rover = rb.load_rover("curiosity")
    controller = rb.WheelController(rover, steering_limit=np.radians(90))
    controller.command(rb.crab(0.05, np.radians(80)))
    command = controller.command(rb.crab(0.05, np.radians(100)))
    assert_close(command.steering[rover.steers], np.radians(-80), 1e-9, "rad", "half a turn away, within the limit")
    assert command.waiting


def test_limits_are_kept_and_reported():
    rover = rb.load_rover("curiosity")
    controller = rb.WheelController(rover, wheel_rate_limit=0.1, steering_limit=0.3)
    command = controller.command(rb.straight(1.0))
    assert_close(np.abs(command.wheel_rates).max(), 0.1, 1e-12, "rad/s", "the limit")
    assert_close(command.speed_scale, 0.1 * rover.wheel_radius[0], 1e-9, "1", "share of 1 m/s")
    command = controller.command(rb.crab(0.02, 0.5))
    assert_close(command.steering[rover.steers], 0.3, 1e-12, "rad", "the limit")
    assert_close(command.steering_short[rover.steers], 0.2, 1e-9, "rad", "the rest")


def test_a_rover_that_stops_keeps_its_steering():
    rover = rb.load_rover("curiosity")
    controller = rb.WheelController(rover)
    before = controller.command(rb.arc(rover, 0.05, 3.0))
    command = controller.command(np.zeros(6))
    assert_close(command.steering, before.steering, 0.0, "rad", "held")
    assert_close(command.wheel_rates, 0.0, 0.0, "rad/s", "stopped")
    assert not command.waiting


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda c: c.command([np.nan, 0, 0]), "twist is"),
        (lambda c: c.command([0.1, 0]), "twist is"),
        (lambda c: c.command(np.zeros(3), dt=0.0), "dt is"),
        (lambda c: c.command(np.zeros(3), steering=np.zeros(4)), "steering has shape"),
        (lambda c: c.command(np.zeros(3), steering="ahead"), "steering is 'ahead'; give six numbers"),
        (lambda c: c.command(np.zeros(3), contact_angle="steep"), "contact_angle is 'steep'; give six numbers"),
        (lambda c: c.command(np.zeros(3), effort=[1, 2, [3]]), "effort is .*; give six numbers"),
        (lambda c: c.command(np.zeros(3), dt="soon"), "dt is 'soon'"),
        (lambda c: rb.WheelController(c.rover, steering_limit=0.0), "above 0"),
        (lambda c: rb.WheelController(c.rover, steering_limit="wide"), "steering_limit is 'wide'; give a number or six"),
        (lambda c: rb.WheelController(c.rover, steering_limit=[1.0, 1.0, 1.0]), "give a number or six"),
        (lambda c: rb.WheelController(c.rover, wheel_rate_limit="fast"), "wheel_rate_limit is 'fast'; give a number"),
        (lambda c: rb.WheelController(c.rover, steering_rate_limit=None), "steering_rate_limit is None; give a number"),
        (lambda c: rb.WheelController(c.rover, aligned="x"), "aligned is 'x'; give a number"),
        (lambda c: rb.WheelController(c.rover, sharing_speed="x"), "sharing_speed is 'x'; give a number"),
        (lambda c: rb.WheelController(c.rover, aligned=0.2, waiting=0.1), "aligned"),
    ],
)
def test_wrong_calls_are_refused(call, message):
    with pytest.raises(rb.RockerbogieError, match=message):
        call(rb.WheelController(rb.load_rover("osr")))


def test_efforts_make_loaded_wheels_slower():
    """Compare the change of the rates with the rule over time and at its limit."""
    rover = rb.load_rover("curiosity")
    twist, dt, effort = rb.straight(0.1), 0.04, np.array([50.0, -20.0, 0.0, 10.0, 5.0, 15.0])
    plain = rb.WheelController(rover).command(twist, dt=dt).wheel_rates
    controller = rb.WheelController(rover, sharing_speed=0.01)
    dev = (effort.mean() - effort) / (9.81 * rover.mass * rover.wheel_radius / 6)
    for k in range(1, 4):
        rates = controller.command(twist, dt=dt, effort=effort).wheel_rates
        assert_close(rates - plain, 0.01 * dev * (1 + k * dt / 0.4) / rover.wheel_radius, 1e-12, "rad/s", f"step {k}")
        assert_close(controller.trim, rates - plain, 1e-15, "rad/s", "the trim stated")
    for _ in range(4000):
        rates = controller.command(twist, dt=dt, effort=effort).wheel_rates
    assert_close(rates, plain * (1 + 0.2 * np.sign(dev)), 1e-12, "rad/s", "a lasting difference ends at the limit")
    back = controller.command(-twist, dt=dt, effort=effort)
    assert (np.abs(back.wheel_rates + plain) <= 0.2 * np.abs(plain) + 1e-12).all()
    assert_close(controller.command(np.zeros(6), dt=dt, effort=effort).wheel_rates, 0.0, 0.0, "rad/s", "a standing rover stands")
    assert_close(controller.command(twist, dt=dt).wheel_rates, plain, 0.0, "rad/s", "without efforts there is no trim")


def test_wheels_without_effort_keep_their_rates():
    rover, twist = rb.load_rover("osr"), rb.straight(0.1)
    plain = rb.WheelController(rover).command(twist).wheel_rates
    some = rb.WheelController(rover).command(twist, effort=[1.0, np.nan, -1.0, np.nan, np.nan, 0.0]).wheel_rates
    assert (some[[1, 3, 4, 5]] == plain[[1, 3, 4, 5]]).all()
    assert some[0] < plain[0]
    assert some[2] > plain[2]
    one = rb.WheelController(rover).command(twist, effort=[1.0, *[np.nan] * 5]).wheel_rates
    assert (one == plain).all(), "one torque alone cannot be compared"
    off = rb.WheelController(rover, sharing_limit=0.0).command(twist, effort=np.arange(6.0)).wheel_rates
    assert (off == plain).all()


def test_wrong_contact_angles_change_rates_by_a_bounded_share():
    """Give angles for which six wheels in contact would need several times the rate."""
    rover, twist = rb.load_rover("curiosity"), rb.straight(0.1)
    plain = rb.WheelController(rover).command(twist).wheel_rates
    rng, largest = np.random.default_rng(2), 0.0
    for _ in range(100):
        command = rb.WheelController(rover).command(twist, contact_angle=rng.uniform(-0.9, 0.9, 6))
        largest = max(largest, float(np.abs(command.wheel_rates / (command.speed_scale * plain) - 1).max()))
    assert 0.59 < largest <= 0.6 + 1e-12


@pytest.mark.parametrize("name", ["curiosity", "osr"])
def test_contact_angles_that_are_noise_do_not_keep_the_rover_waiting(name):
    """Turn on the spot: while the rover stands, estimated contact angles are noise."""
    rover, rng = rb.load_rover(name), np.random.default_rng(3)
    controller, bogie = rb.WheelController(rover, steering_rate_limit=0.3), (0.1, -0.15)
    still = rb.WheelController(rover).command((0.0, 0.0, 0.1), rocker=0.05, bogie=bogie)
    for _ in range(100):
        noise = rng.uniform(-0.9, 0.9, 6)
        command = controller.command((0.0, 0.0, 0.1), dt=0.04, rocker=0.05, bogie=bogie, contact_angle=noise)
    assert command.speed_scale == 1.0
    assert_close(command.steering, still.steering, 1e-9, "rad", "the angles on the plane, reached at 0.012 rad a command")


@pytest.mark.parametrize(
    ("options", "says"),
    [({"sharing_speed": -1.0}, "sharing_speed"), ({"sharing_limit": 1.0}, "sharing_limit"), ({"sharing_speed": np.nan}, "m/s")],
)
def test_a_wrong_gain_of_load_sharing_is_refused(options, says):
    with pytest.raises(rb.RockerbogieError, match=says):
        rb.WheelController(rb.load_rover("osr"), **options)


def test_efforts_of_another_shape_are_refused():
    with pytest.raises(rb.RockerbogieError, match=r"effort has shape \(5,\); give \(6,\)"):
        rb.WheelController(rb.load_rover("osr")).command(rb.straight(0.1), effort=np.zeros(5))
