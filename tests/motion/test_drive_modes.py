"""Drives in equilibrium mode, and steering that stays near the present angle."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.motion.drive import ackermann, to_csv
from rockerbogie.settling.dataset import EQUILIBRIUM_VARIABLES, RUN_VARIABLES
from support.helpers import assert_close, paper_rover

PATH = rb.Path.straight((-1.5, 0.1), 0.2, 3.0)


def step_terrain() -> rb.Terrain:
    """A field of rocks on which wheels lift and bogies reach their limits."""
    return rb.surfaces.rocks(0.2, 3, size=8.0, spacing=0.02)


def stiff() -> rb.Rover:
    """A rover whose bogies hardly move."""
    return rb.load_rover("rocky7").replace(bogie_limits=np.array([-0.1, 0.1]))


@pytest.fixture(scope="module")
def run():
    return rb.drive(stiff(), step_terrain(), PATH, step=2e-3, mode="equilibrium")


def test_stations_are_equilibrium_poses(run) -> None:
    rover, terrain = stiff(), step_terrain()
    pose = rb.settle(rover, terrain, run.x.values, run.y.values, run.yaw.values, steering=run.steering.values, mode="equilibrium")
    assert set(run.data_vars) == set(RUN_VARIABLES) | set(EQUILIBRIUM_VARIABLES)
    for name in ("z", "roll", "bogie", "status", "support", "belly_support", "joint_stop"):
        assert np.array_equal(run[name], getattr(pose, name), equal_nan=True)
    assert np.array_equal(run.wheel_lifted.values == 1, pose.wheel_lifted)
    assert run.wheel_lifted.values.any(axis=1).mean() > 0.2
    assert (run.joint_stop.values != 0).any(axis=1).mean() > 0.2
    assert (np.abs(run.bogie.values) <= 0.1 + 1e-9).all()
    assert run.attrs["mode"] == "equilibrium"
    assert "WHEEL_LIFTED (first at" in run.attrs["status_summary"]


def test_rates_are_derivatives_with_wheels_off_the_ground(run) -> None:
    """Compare rates with differences at stations whose contacts and limits do not change."""
    active = np.concatenate([run.wheel_lifted.values, run.joint_stop.values], axis=1)
    alike = (active[1:-1] == active[:-2]).all(axis=1) & (active[1:-1] == active[2:]).all(axis=1)
    lifted = run.wheel_lifted.values.any(axis=1)[1:-1]
    assert (alike & lifted).sum() > 200
    for name in ("z", "roll", "pitch", "rocker", "bogie"):
        values, rates = run[name].values, run[f"{name}_rate"].values
        difference = (values[2:] - values[:-2]) / (run.time.values[2:] - run.time.values[:-2]).reshape(
            -1, *[1] * (values.ndim - 1)
        )
        off = np.abs(rates[1:-1] - difference)[alike & lifted]
        # at some stations a contact moves from one edge of a rock to another within the step
        assert np.quantile(off, 0.9) < 0.02 * np.abs(difference[alike & lifted]).max(), name
    assert np.isfinite(run.wheel_rate).all()


def test_a_joint_at_its_limit_has_rate_0(run) -> None:
    at_limit = run.joint_stop.sel(joint="bogie_left").values != 0
    six = run.wheel_lifted.values.sum(axis=1) == (run.joint_stop.values != 0).sum(axis=1)
    clean = at_limit & six & (run.belly_support.values == 0)
    assert clean.sum() > 50
    assert_close(run.bogie_rate.sel(side="left").values[clean], 0.0, 1e-12, "rad/s", "it does not move")


def test_modes_agree_on_six_wheels() -> None:
    rover, terrain = paper_rover(), rb.surfaces.rough(3, size=8.0)
    contact, rest = (rb.drive(rover, terrain, PATH, step=0.05, mode=mode) for mode in ("contact", "equilibrium"))
    assert (rest.status == rb.Status.CONVERGED).all()
    for name in ("z", "roll", "pitch", "bogie", "z_rate", "roll_rate", "bogie_rate", "wheel_rate"):
        assert_close(rest[name], contact[name], 1e-6, RUN_VARIABLES[name][1], "the same poses and contacts")


def test_an_equilibrium_run_goes_to_files(run, tmp_path) -> None:
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    to_csv(run, tmp_path / "run.csv")
    header = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "support_LR [N]" in header
    assert "joint_stop_bogie_left [1]" in header


def test_an_unknown_mode_is_refused() -> None:
    with pytest.raises(rb.RockerbogieError, match="mode 'rest' is not known; give 'contact' or 'equilibrium'"):
        rb.drive(paper_rover(), rb.surfaces.plane(), PATH, mode="rest")  # type: ignore[arg-type]


# -- steering near the present angle ----------------------------------------------------------------------------------


def all_steered() -> rb.Rover:
    return rb.Rover.from_pivots(
        wheel_radius=0.1, rocker_pivot=(0.1, 0.3, 0.3), bogie_pivot=(-0.2, 0.35, 0.2),
        hubs=[(0.5, 0.4, 0.1), (0, 0.5, 0.1), (-0.4, 0.4, 0.1)], steering_offset=(0.0, 0.03),
    )  # fmt: skip


def test_commands_through_crab_of_90_deg_do_not_jump() -> None:
    rover = all_steered()
    pose = rb.settle(rover, rb.surfaces.plane(size=20.0), 0.0, 0.0)
    present, angles, jumps = np.zeros(6), [], []
    for crab in np.radians(np.arange(0, 181, 5.0)):
        twist = rb.crab(0.05, crab)
        jumps.append(rb.wheel_commands(rover, pose, twist).steering)
        found = rb.wheel_commands(rover, pose, twist, near=present, steering_limit=2 * np.pi)
        assert_close(found.side_slip, 0.0, 1e-12, "m/s", "the wheels point along the direction of travel")
        assert_close(found.wheel_rates, 0.5, 1e-10, "rad/s", "and keep rolling forward")
        present = found.steering
        angles.append(present)
    assert_close(np.diff(angles, axis=0), np.radians(5), 1e-12, "rad", "5 deg at each step")
    assert np.abs(np.diff(jumps, axis=0)).max() > 3.0, "without near they jump by half a turn"


def test_beyond_the_limit_the_opposite_angle_is_taken() -> None:
    rover = all_steered()
    pose = rb.settle(rover, rb.surfaces.plane(size=20.0), 0.0, 0.0)
    twist = rb.crab(0.05, np.radians(100))
    found = rb.wheel_commands(rover, pose, twist, near=np.full(6, np.radians(85)))
    assert_close(np.degrees(found.steering), -80.0, 1e-9, "deg", "100 deg is beyond the limit of 90")
    assert_close(found.side_slip, 0.0, 1e-12, "m/s", "and -80 deg serves as well")
    assert (found.wheel_rates < 0).all()


def test_near_equal_to_the_default_angle_changes_nothing() -> None:
    rover = paper_rover()
    pose = rb.settle(rover, rb.surfaces.rough(4), np.linspace(-1, 1, 7), 0.0)
    twist = rb.arc(rover, 0.05, 1.5)
    free = rb.wheel_commands(rover, pose, twist)
    near = rb.wheel_commands(rover, pose, twist, near=free.steering)
    assert_close(near.steering, free.steering, 1e-12, "rad", "the same solution, from another start")


def test_a_drive_keeps_its_steering_continuous() -> None:
    rover = all_steered()
    yaw = np.radians(np.linspace(0, 180, 37))
    path = rb.Path.from_arrays(np.linspace(-2, 2, 37), np.zeros(37), -yaw)  # it turns while it travels along x
    held = rb.drive(rover, rb.surfaces.plane(size=20.0), path, step=0.02, near=np.zeros(6))
    free = rb.drive(rover, rb.surfaces.plane(size=20.0), path, step=0.02)
    assert np.abs(np.diff(held.steering, axis=0)).max() < 0.3
    assert np.abs(np.diff(free.steering, axis=0)).max() > 2.5
    turns = (held.steering - free.steering) / np.pi
    assert_close(turns, np.round(turns), 1e-12, "half turns", "the same directions")
    assert_close(held.side_slip, free.side_slip * np.cos(np.pi * turns), 1e-9, "m/s", "left is right for a wheel turned about")
    kappa = path.sample(held.distance.values)
    assert_close(held.steering[0], ackermann(rover, kappa.curvature[0], kappa.course[0] - kappa.yaw[0]), 1e-12, "rad", "near 0")
    with pytest.raises(rb.RockerbogieError, match=r"near has shape \(5,\)"):
        rb.drive(rover, rb.surfaces.plane(size=20.0), path, near=np.zeros(5))
    with pytest.raises(rb.RockerbogieError, match="steering and near are both given"):
        rb.drive(rover, rb.surfaces.plane(size=20.0), path, near=np.zeros(6), steering=np.zeros(6))
