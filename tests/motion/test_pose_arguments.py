"""Poses given to motion functions: of another rover, NaN, or singular."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.motion.jacobian import contact_rows, ground_rates, solve_each
from support.helpers import assert_close, paper_rover

ROVER = rb.load_rover("curiosity")
GROUND = rb.surfaces.rough(5, size=20.0, spacing=0.05, min_radius=1.0)
TWIST, RATES = np.array([0.05, 0.01, 0, 0, 0, 0.02]), np.full(6, 0.2)

CALLS = {
    "wheel_jacobians": rb.wheel_jacobians,
    "system_jacobian": rb.system_jacobian,
    "body_twist": lambda rover, pose: rb.body_twist(rover, pose, wheel_rates=RATES).twist,
    "wheel_commands": lambda rover, pose: rb.wheel_commands(rover, pose, TWIST).wheel_rates,
    "wheel_commands, set": lambda rover, pose: rb.wheel_commands(rover, pose, TWIST, steering=np.zeros(6)).wheel_rates,
    "wheel_slip": lambda rover, pose: rb.wheel_slip(rover, pose, TWIST, RATES).side,
}


@pytest.fixture(scope="module")
def pose() -> rb.Pose:
    return rb.settle(ROVER, GROUND, [0.0, 1.0, 2.0], 0.3, 0.2)


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_pose_of_another_rover_is_refused(call, pose: rb.Pose) -> None:
    with pytest.raises(
        rb.RockerbogieError, match="the pose is of rover 'curiosity', not of 'perseverance': give the rover it was"
    ):
        call(rb.load_rover("perseverance"), pose)
    changed = ROVER.replace(wheel_radius=ROVER.wheel_radius * 1.01)
    with pytest.raises(rb.RockerbogieError, match="the pose is of another rover named 'curiosity'"):
        call(changed, pose)


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_an_equal_rover_is_accepted(call, pose: rb.Pose) -> None:
    assert np.array_equal(call(rb.load_rover("curiosity"), pose), call(ROVER, pose))


def test_a_station_of_a_run_is_compared_by_name() -> None:
    run = rb.drive(ROVER, GROUND, rb.Path.straight((0, 0), 0.0, 0.1), step=0.05)
    assert rb.wheel_jacobians(ROVER, run).shape == (3, 6, 6, 9)
    with pytest.raises(rb.RockerbogieError, match="the pose is of rover 'curiosity', not of 'elhami-dashti'"):
        rb.wheel_jacobians(paper_rover(), run)


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_nan_pose_does_not_change_the_others(call) -> None:
    x = np.array([0.0, 50.0, 2.0])
    pose = rb.settle(ROVER, GROUND, x, 0.3, 0.2)
    assert np.isnan(pose.z).tolist() == [False, True, False]
    found = call(ROVER, pose)
    assert np.isnan(found[1]).any()
    for k in (0, 2):
        assert_close(found[k], call(ROVER, rb.settle(ROVER, GROUND, x[k], 0.3, 0.2)), 1e-12, "SI", "a pose alone")


def test_commands_of_a_nan_pose_are_nan_at_steering_0() -> None:
    pose = rb.settle(ROVER, GROUND, [0.0, 50.0], 0.3, 0.2)
    found = rb.wheel_commands(ROVER, pose, TWIST)
    assert np.isnan(found.wheel_rates[1]).all()
    assert not found.steering[1].any()
    assert np.abs(found.steering[0]).max() > 0.05
    held = rb.wheel_commands(ROVER, pose, TWIST, near=np.full(6, 0.3))
    assert_close(held.steering[1], 0.3 * ROVER.steers, 0, "rad", "it keeps the present angles")


def test_a_singular_system_gives_nan_for_its_pose_only() -> None:
    A = np.stack([np.eye(3), np.ones((3, 3)), 2 * np.eye(3), np.full((3, 3), np.nan)])
    assert_close(solve_each(A, np.ones(3)), [[1, 1, 1], [np.nan] * 3, [0.5] * 3, [np.nan] * 3], 0, "1", "row by row")
    rows = contact_rows(ROVER, rb.settle(ROVER, GROUND, [0.0, 1.0], 0.3))
    rows[0, :, 2] = 0.0
    found = ground_rates(rows, TWIST)
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1]).all()


def test_a_twist_that_does_not_fit_the_poses_is_refused(pose: rb.Pose) -> None:
    with pytest.raises(rb.RockerbogieError, match=r"do not broadcast together: pose \(3,\), twist \(2,\)"):
        rb.wheel_commands(ROVER, pose, np.zeros((2, 6)))
    with pytest.raises(rb.RockerbogieError, match="twist holds 1 infinite values"):
        rb.wheel_commands(ROVER, pose, [np.inf, 0, 0, 0, 0, 0])
