"""Odometry along drives whose truth is known, and refusals of wrong logs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import rockerbogie as rb
from rockerbogie._kernels.odometry import track as kernel
from rockerbogie.logs.odometry import SlopeSlip, flat_odometry, odometry
from support.helpers import assert_close, paper_rover


def run_over(ground, path, rover=None, step=0.02):
    run = rb.drive(rover or paper_rover(), ground, path, 0.02, step=step)
    assert (run["status"] == 0).all()
    return run


def first(run):
    return tuple(float(run[k][0]) for k in "xyz")


def end_error(track, run):
    return np.array([float(track[k][-1] - run[k][-1]) for k in "xyz"])


def test_a_screw_is_the_exponential_of_its_twist():
    rng = np.random.default_rng(1)
    for size in (1.0, 1e-3, 1e-9):
        phi, rho = rng.normal(size=(2, 3)) * [[size], [1.0]]
        W = np.array([[0, -phi[2], phi[1]], [phi[2], 0, -phi[0]], [-phi[1], phi[0], 0]])
        T = expm(np.block([[W, rho[:, None]], [np.zeros((1, 4))]]))
        moved, vector, turned = np.empty(3), np.empty(3), np.empty((3, 3))
        kernel.screw(phi, rho, moved)
        assert_close(moved, T[:3, 3], 1e-12, "m", "matrix exponential on SE(3)")
        kernel.turned_by(np.eye(3), phi, turned)
        assert_close(turned, T[:3, :3], 1e-12, "1", "its rotation")
        kernel.turn_between(np.eye(3), np.ascontiguousarray(T[:3, :3]), vector)
        assert_close(vector, phi, 1e-12, "rad", "and its logarithm")


def test_odometry_straight_over_waves():
    """Follow terrain uniform across: no wheel slips; wheels and joints determine the track."""
    ground = rb.surfaces.sine(0.1, 2.0, size=14.0)
    run = run_over(ground, rb.Path.straight((-5.0, 0.0), 0.0, 10.0), step=0.01)
    bare = run[["wheel_rate", "rocker", "bogie", "steering"]]
    lost = odometry(paper_rover(), ground, bare, start=first(run))
    assert_close(end_error(lost, run), 0.0, 0.1, "m", "1 % of 10 m with a map and no attitude at all")
    mapped = odometry(paper_rover(), ground, run, start=first(run))
    assert_close(end_error(mapped, run), 0.0, 2e-3, "m", "0.02 % with a map and an IMU")
    blind = odometry(paper_rover(), run.drop_vars(["x", "y", "z"]), start=first(run))
    assert_close(end_error(blind, run), 0.0, 0.1, "m", "1 % of 10 m with an IMU and no map")
    slope = np.abs(blind["contact_angle"] - run["contact_angle"])[1:]
    assert float(slope.mean()) < 0.5 * float(np.abs(run["contact_angle"]).mean()), "contact angles are found, if roughly"
    flat = flat_odometry(paper_rover(), run, start=first(run))
    assert end_error(flat, run)[0] > 0.15, "2-D odometry counts the way up and down as way ahead"


def test_3d_odometry_over_hills_is_better_than_planar():
    rover = rb.load_rover("curiosity")
    ground = rb.surfaces.rough(3, max_slope=0.35, min_radius=0.8, size=34.0, spacing=0.06)
    path = rb.Path.waypoints([(-10, -5), (0, -4), (6, 4), (-4, 8)], radius=4.0)
    run = run_over(ground, path, rover, step=0.06)
    blind, mapped, flat = (
        end_error(track, run)
        for track in (
            odometry(rover, run, start=first(run)),
            odometry(rover, ground, run, start=first(run)),
            flat_odometry(rover, run, start=first(run)),
        )
    )
    length = path.length
    assert np.linalg.norm(blind) < 0.01 * length
    assert np.linalg.norm(mapped) < 0.01 * length
    assert abs(flat[2]) > 3 * abs(blind[2]), "height is what a flat odometry cannot have"


def test_each_sensor_set_gives_the_track():
    """Turn on a plane about a centre abeam of the middle wheels: each sensor alone is enough."""
    rover = rb.load_rover("curiosity")
    run = run_over(rb.surfaces.plane(0.1, 0.6, size=30.0), rb.Path.arc((-3.0, 0.0), 0.2, 4.0, 1.0), rover)
    track = odometry(rover, run, start=first(run))
    assert_close(end_error(track, run), 0.0, 0.02, "m", "an IMU's attitude: 4 m of an arc on a plane")
    leaning = odometry(rover, run.drop_vars(["yaw"]), start=first(run))
    assert_close(leaning["roll"], run["roll"], 1e-9, "rad", "an inclinometer's roll is taken as it is")
    turned = float(leaning["yaw"][-1] - leaning["yaw"][0])
    assert_close(turned, 1.0, 0.02, "rad", "and the wheels tell the turn")
    level = run_over(rb.surfaces.plane(size=30.0), rb.Path.arc((-3.0, 0.0), 0.0, 4.0, 1.0), rover)
    spin = np.zeros((level.sizes["time"], 3))
    spin[:, 2] = level["yaw_rate"]
    gyro = level[["wheel_rate", "rocker", "bogie", "steering"]].assign(gyro=(("time", "axis"), spin))
    track = odometry(rover, gyro, start=first(level))
    assert_close(track["yaw"], level["yaw"], 1e-3, "rad", "a gyro's turning is summed up")
    bare = odometry(rover, level[["wheel_rate", "steering", "rocker", "bogie"]], start=first(level))
    assert_close(end_error(bare, level), 0.0, 0.02, "m", "wheels and steering alone, where nothing slips")


def test_wheel_angles_give_the_same_track_as_rates():
    run = run_over(rb.surfaces.plane(0.1, size=20.0), rb.Path.straight((-2.0, 0.0), 0.0, 4.0))
    steps = np.diff(run["time"])[:, None] * 0.5 * (run["wheel_rate"].values[1:] + run["wheel_rate"].values[:-1])
    angle = np.concatenate([np.zeros((1, 6)), np.cumsum(steps, axis=0)])
    counted = run.drop_vars("wheel_rate").assign(wheel_angle=(("time", "wheel"), angle))
    a, b = (odometry(paper_rover(), log, start=first(run)) for log in (run, counted))
    assert_close(a["x"], b["x"], 1e-9, "m", "an encoder's steps are its rate's integral")


def test_soil_corrects_slip_on_a_slope():
    rover, soil = paper_rover(), SlopeSlip(0.6, 0.4)
    ground = rb.surfaces.plane(0.2, 1.0, size=20.0)
    run = run_over(ground, rb.Path.straight((-2.0, 0.0), 0.0, 4.0))
    seen = odometry(rover, run, start=first(run), soil=soil)
    u = -np.sin(run["pitch"].values[0])  # sines of the slope ahead, and to the left
    left = float(np.sin(run["roll"][0]) * np.cos(run["pitch"][0]))
    twist = seen["twist"].values[-1]
    speed = float(run["wheel_rate"][0].mean()) * 0.1
    assert_close(twist[0], speed * (1 - 0.6 * u), 1e-4, "m/s", "ahead, less the slip along")
    assert_close(twist[1], -speed * 0.4 * left, 1e-4, "m/s", "and a skid downhill")
    with pytest.raises(rb.RockerbogieError, match="no roll and pitch"):
        odometry(rover, run.drop_vars(["roll"]), soil=soil)


def test_wrong_logs_are_refused_in_one_sentence():
    rover = paper_rover()
    run = run_over(rb.surfaces.plane(size=10.0), rb.Path.straight((-1.0, 0.0), 0.0, 1.0))
    with pytest.raises(rb.RockerbogieError, match="neither wheel_angle nor wheel_rate"):
        odometry(rover, run.drop_vars("wheel_rate"))
    with pytest.raises(rb.RockerbogieError, match="fewer than two rows"):
        odometry(rover, run.isel(time=[0]))
    with pytest.raises(rb.RockerbogieError, match="time does not grow"):
        odometry(rover, run.isel(time=[0, 2, 1]))
    holed = run.copy(deep=True)
    holed["rocker"][3] = np.nan
    with pytest.raises(rb.RockerbogieError, match="rocker in the log is not finite in row 4"):
        odometry(rover, holed)
    with pytest.raises(rb.RockerbogieError, match=r"rocker in the log has shape"):
        odometry(rover, run.assign(rocker=run["bogie"]))


def test_distance_is_horizontal_and_distance_3d_is_not() -> None:
    rover, slope = rb.load_rover("osr"), np.radians(20)
    path = rb.Path.straight((-1, 0), 0.0, 2.0)
    run = rb.drive(rover, rb.surfaces.plane(slope, size=20.0), path, speed=0.1, step=0.1)
    track = rb.odometry(rover, run[["wheel_rate", "steering", "rocker", "bogie", "roll", "pitch", "yaw"]])
    assert float(track.distance[-1]) == pytest.approx(2.0, abs=1e-9)
    assert float(track.distance_3d[-1]) == pytest.approx(2.0 / np.cos(slope), abs=1e-9)
