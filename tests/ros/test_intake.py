"""The intake makes rows from messages that are late, doubled, faulty or missing."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.logs.odometry_filter import OdometryFilter
from rockerbogie.ros.intake import Imu, Intake

ROVER = rb.load_rover("osr")
RATE, DT = 1.0, 0.02  # rad/s of all wheels, s


def joints(t, angle=None, **more):
    """Return the columns of a joint state at t; wheels have turned by RATE times t."""
    value = RATE * t if angle is None else angle
    columns = {f"wheel_angle_{w}": value for w in ROVER.wheel_names}
    columns |= {f"steering_{w}": 0.0 for w, steers in zip(ROVER.wheel_names, ROVER.steers, strict=True) if steers}
    return columns | {"rocker": 0.0, "bogie_left": 0.0, "bogie_right": 0.0} | more


def imu(t, yaw=0.0):
    return Imu(t, np.array([0.0, 0.0, yaw]), np.zeros(3))


def fed(intake, steps, with_imu=True):
    """Return the rows of regular messages at the given step numbers."""
    rows = []
    for k in steps:
        if with_imu:
            rows += intake.imu(imu(k * DT))
        rows += intake.joints(k * DT, joints(k * DT)) + intake.tick()
    return rows


def distance(rows):
    """Return the distance by odometry of rows."""
    made = OdometryFilter(ROVER)
    for row in rows:
        made.update(row.time, row.joints, row.imu)
    return made.estimate.distance_3d


def test_a_row_waits_for_its_imu_reading():
    intake = Intake(ROVER)
    assert intake.joints(0.0, joints(0.0)) == []
    assert len(intake.imu(imu(0.0))) == 1
    assert intake.joints(DT, joints(DT)) == []
    (row,) = intake.imu(imu(DT, yaw=0.3))
    assert (row.stamp, row.imu["yaw"]) == (DT, 0.3)


def test_without_an_imu_only_the_first_row_waits():
    intake = Intake(ROVER)
    assert fed(intake, range(11), with_imu=False) == []
    assert len(fed(intake, [11], with_imu=False)) == 12
    assert len(fed(intake, [12], with_imu=False)) == 1
    assert not intake.events, "an IMU that was never there is not missed"


def test_an_imu_at_other_times_is_interpolated():
    intake = Intake(ROVER)
    intake.imu(imu(0.005, 0.1))
    intake.joints(DT, joints(DT))
    (row,) = intake.imu(imu(0.025, 0.3))
    assert row.imu["yaw"] == pytest.approx(0.25)


def test_an_imu_that_falls_silent_is_not_waited_for():
    intake = Intake(ROVER)
    fed(intake, range(10))
    rows = fed(intake, range(10, 40), with_imu=False)
    assert [row.stamp for row in rows] == pytest.approx([k * DT for k in range(10, 40)])
    assert rows[-1].imu is None
    assert not intake.has_imu
    assert intake.events["no IMU"] > 10


def test_swapped_rows_are_sorted_while_they_wait():
    intake = Intake(ROVER)
    fed(intake, range(3))
    for k in (4, 3):
        intake.joints(k * DT, joints(k * DT))
    rows = intake.imu(imu(4 * DT))
    assert [row.stamp for row in rows] == [3 * DT, 4 * DT]
    assert not intake.events


@pytest.mark.parametrize(
    "stamp, columns, event",
    [
        (5 * DT, joints(5 * DT), "duplicate"),
        (3 * DT, joints(3 * DT), "late"),
        (float("nan"), joints(6 * DT), "not finite"),
        (6 * DT, joints(6 * DT, angle=float("nan")), "not finite"),
        (6 * DT, joints(6 * DT, wheel_angle_LF=float("inf")), "not finite"),
    ],
)
def test_faulty_messages_are_dropped_and_counted(stamp, columns, event):
    intake = Intake(ROVER)
    rows = fed(intake, range(6)) + intake.joints(stamp, columns) + fed(intake, range(6, 12))
    assert [row.stamp for row in rows] == pytest.approx([k * DT for k in range(12)])
    assert intake.events == {event: 1}
    assert distance(rows) == pytest.approx(0.075 * RATE * 11 * DT, rel=1e-6)


def test_a_joint_that_is_not_finite_is_left_out_of_its_row():
    intake = Intake(ROVER, uses_imu=False)
    (row,) = intake.joints(0.0, joints(0.0, rocker=float("nan")))
    assert "rocker" not in row.joints
    assert intake.events["not finite"] == 1


def test_lost_messages_lose_no_distance():
    intake = Intake(ROVER)
    kept = [k for k in range(200) if k % 3 == 0 or k > 195]
    assert distance(fed(intake, kept)) == pytest.approx(0.075 * RATE * 199 * DT, rel=1e-6)


def test_a_clock_that_is_set_back_continues_the_track():
    intake = Intake(ROVER)
    rows = fed(intake, range(500))
    for k in range(500, 600):  # the clock goes back by 8 s, the wheels go on
        t = k * DT - 8.0
        rows += intake.imu(imu(t)) + intake.joints(t, joints(k * DT))
    assert intake.events["clock set"] == 1
    assert "set back by" in intake.last["clock set"]
    assert intake.events["late"] == 2, "three messages must agree"
    times = [row.time for row in rows]
    assert (np.diff(times) > 0).all()
    assert rows[-1].stamp == pytest.approx(599 * DT - 8.0)
    assert distance(rows) == pytest.approx(0.075 * RATE * 599 * DT, rel=1e-3)


def test_a_publisher_that_restarts_does_not_drive_the_rover_back():
    intake = Intake(ROVER)
    rows = fed(intake, range(500))
    for k in range(700, 800):  # 4 s later, counters from 0
        rows += intake.imu(imu(k * DT)) + intake.joints(k * DT, joints((k - 700) * DT))
    assert intake.events == {"gap": 1, "restart": 1}
    assert distance(rows) == pytest.approx(0.075 * RATE * (499 + 99) * DT, rel=1e-3)


def test_a_counter_that_jumps_is_bridged():
    intake = Intake(ROVER)
    rows = fed(intake, range(100))
    for k in range(100, 200):
        rows += intake.imu(imu(k * DT)) + intake.joints(k * DT, joints(k * DT, wheel_angle_LF=RATE * k * DT - 400.0))
    assert intake.events == {"counter jump": 1}
    assert "wheel LF" in intake.last["counter jump"]
    assert distance(rows) == pytest.approx(0.075 * RATE * 199 * DT, rel=1e-6)


def test_wrapped_angles_are_unwrapped():
    intake = Intake(ROVER)
    rows = []
    for k in range(1000):
        angle = (RATE * k * DT + np.pi) % (2 * np.pi) - np.pi
        rows += intake.imu(imu(k * DT)) + intake.joints(k * DT, joints(k * DT, angle=angle))
    assert not intake.events
    assert distance(rows) == pytest.approx(0.075 * RATE * 999 * DT, rel=1e-6)


def test_wheel_rates_over_a_gap_are_not_integrated():
    intake = Intake(ROVER, uses_imu=False)
    rows = []
    for k in (*range(100), *range(400, 500)):
        rows += intake.joints(k * DT, {f"wheel_rate_{w}": RATE for w in ROVER.wheel_names})
    assert intake.events == {"gap": 1}
    assert "not known" in intake.last["gap"]
    assert distance(rows) == pytest.approx(0.075 * RATE * 199 * DT, rel=1e-2)


def test_joints_of_several_messages_make_one_row():
    intake = Intake(ROVER, uses_imu=False)
    columns = joints(1.0)
    left = {name: value for name, value in columns.items() if name.startswith("wheel_angle_L")}
    right = {name: value for name, value in columns.items() if name.startswith("wheel_angle_R")}
    rest = {name: value for name, value in columns.items() if not name.startswith("wheel")}
    assert intake.joints(0.99, rest) == []
    assert intake.joints(1.0, left) == []
    assert intake.missing == ["RF", "RM", "RR"] or set(intake.missing) == {"RF", "RM", "RR"}
    (row,) = intake.joints(1.0, right)
    assert set(row.joints) == {"wheel_angle", "steering", "rocker", "bogie"}
    assert intake.missing == []
    (row,) = intake.joints(5.0, left | right)
    assert set(row.joints) == {"wheel_angle"}, "the other joints are too old"
