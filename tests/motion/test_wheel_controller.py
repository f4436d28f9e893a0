"""The wheel controller gives the commands of `wheel_commands`, within limits and in time."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.odometry import commands as kernel
from rockerbogie._kernels.odometry import layout as at
from rockerbogie.motion.jacobian import SimpleStance
from support.helpers import assert_close

ROVERS = ("curiosity", "osr", "rocky7", "elhami-dashti")


@pytest.mark.parametrize("name", ROVERS)
def test_the_kernel_equals_wheel_commands(name):
    """Compare with `wheel_commands` for random joint angles, contact angles and twists."""
    rover, rng = rb.load_rover(name), np.random.default_rng(5)
    for _ in range(20):
        present = np.where(rover.steers, rng.uniform(-0.6, 0.6, 6), 0.0)
        rocker, bogie, delta = rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2, 2), rng.uniform(-0.2, 0.2, 6)
        twist = np.zeros(6)
        twist[[0, 1, 5]] = rng.uniform(-0.1, 0.1, 3)
        limit = rng.choice([0.8, np.pi / 2, 3.0])
        pose = SimpleStance(np.array(rocker), bogie, delta, present)
        want = rb.wheel_commands(rover, pose, twist, near=present, steering_limit=limit)
        reading = np.zeros(at.R_SIZE)
        reading[at.R_STEERING : at.R_STEERING + 6] = present
        reading[at.R_ROCKER], reading[at.R_BOGIE : at.R_BOGIE + 2] = rocker, bogie
        turn, motion, rates, slip = np.empty(6), np.empty(9), np.empty(6), np.empty(6)
        kernel.commands(
            rover.packed, rover.steers.copy(), reading, delta, twist[[0, 1, 5]], np.full(6, limit), False,
            turn, motion, rates, slip,
        )  # fmt: skip
        assert_close(np.clip(turn, -limit, limit), want.steering, 1e-9, "rad", "steering")
        assert_close(rates, want.wheel_rates, 1e-9, "rad/s", "wheel rates")
        assert_close(motion[:6], want.twist, 1e-9, "SI", "twist")
        assert_close(slip, want.side_slip, 1e-9, "m/s", "side slip")


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
        (lambda c: rb.WheelController(c.rover, steering_limit=0.0), "above 0"),
        (lambda c: rb.WheelController(c.rover, aligned=0.2, waiting=0.1), "aligned"),
    ],
)
def test_wrong_calls_are_refused(call, message):
    with pytest.raises(rb.RockerbogieError, match=message):
        call(rb.WheelController(rb.load_rover("osr")))
